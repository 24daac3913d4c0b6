//! What a model's file says of a branch's sway.

use crate::model::{NodeId, Skeleton, Swaying, TreeMode, moves_with};
use serde_json::{Map, Value, json};

/// For the `extras` of the joints of a tree, by node index: what is known of each one's sway, and
/// the modes of the tree that it moves with where it has no frequency of its own.
pub fn joint_extras(skeleton: &Skeleton, sway: &[Swaying], modes: &[TreeMode]) -> Vec<Value> {
    let branches = skeleton.botanical_branches();
    let mut all = Vec::with_capacity(sway.len());
    for (node, sway) in (0..).map(NodeId).zip(sway) {
        let mut own = extras(sway);
        let moves_with = moves_with(sway, modes, &branches, node);
        if !moves_with.is_empty() {
            own["participation"] = json!(moves_with);
        }
        all.push(own);
    }
    all
}

/// For the `extras` of a joint: what is known of its sway, with 95 % intervals; nothing for one
/// that was not measured.
fn extras(sway: &Swaying) -> Value {
    let mut all = Map::new();
    let mut put = |name: &str, value: f64, lo: f64, hi: f64| {
        if value.is_finite() && lo.is_finite() && hi.is_finite() {
            all.insert(name.into(), value.into());
            all.insert(format!("{name}_interval_95"), json!([lo, hi]));
        }
    };
    match sway {
        Err(crate::model::Unidentified::NotMeasured) => return Value::Null,
        Err(why) => drop(all.insert("unidentified".into(), why.word().into())),
        Ok(sway) => {
            let f = sway.frequency_hz;
            put("frequency_hz", f.value, f.lo, f.hi);
            sway.damping_ratio
                .into_iter()
                .for_each(|d| put("damping_ratio", d.value, d.lo, d.hi));
            all.insert("excitation".into(), sway.excitation.word().into());
        }
    }
    all.insert("identifiable".into(), sway.is_ok().into());
    all.into()
}

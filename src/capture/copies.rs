//! Which nodes are copies, of which, and how sure the forks are: what `nodes.csv` does not hold.

use crate::export::capture::Copied;
use crate::export::glb_notes::JointNote;
use crate::model::{NodeId, Skeleton};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Marks the copies. The first of these that says so decides: `copied` of `capture.json`; the
/// joints of the model's file, where older versions said it, without the angle of the plane;
/// neither. Gives what the user should know.
pub(super) fn mark(
    skeleton: &mut Skeleton,
    copied: &[Copied],
    joints: Option<&[JointNote]>,
) -> Option<String> {
    let place: BTreeMap<u32, NodeId> = (0..)
        .zip(&skeleton.nodes)
        .map(|(i, n)| (n.name.0, NodeId(i)))
        .collect();
    for joint in joints.into_iter().flatten() {
        if let Some(node) = place
            .get(&joint.node)
            .and_then(|id| skeleton.nodes.get_mut(id.index()))
        {
            node.certainty = joint.certainty.clamp(0.0, 1.0);
        }
    }
    let told: Vec<(u32, u32, f64)> = if copied.is_empty() {
        let copies: Vec<(u32, u32)> = joints
            .into_iter()
            .flatten()
            .filter_map(|j| Some((j.node, j.copy_of?)))
            .collect();
        let angles = evenly_parted(&copies);
        copies
            .into_iter()
            .zip(angles)
            .map(|((node, original), angle)| (node, original, angle))
            .collect()
    } else {
        copied
            .iter()
            .map(|c| (c.node, c.original, c.plane_angle_deg.to_radians()))
            .collect()
    };
    let mut unfit = 0;
    for (node, original, angle) in told {
        let (Some(&node), Some(&original)) = (place.get(&node), place.get(&original)) else {
            unfit += 1;
            continue;
        };
        let (copy, of) = (
            &skeleton.nodes[node.index()],
            &skeleton.nodes[original.index()],
        );
        // A copy of a copy, or of what comes after it, could not be posed; one of another level is
        // none.
        if original >= node || original.0 == 0 || of.copy_of.is_some() || copy.level != of.level {
            unfit += 1;
            continue;
        }
        let node = &mut skeleton.nodes[node.index()];
        (node.copy_of, node.plane_angle) =
            (Some(original), if angle.is_finite() { angle } else { 0.0 });
    }
    // All measured nodes come before all copies; what does not keep to that is taken for measured.
    let measured = skeleton.measured();
    let out_of_order = skeleton.nodes[measured..]
        .iter()
        .any(|n| n.copy_of.is_none());
    if out_of_order {
        skeleton.nodes.iter_mut().for_each(|n| n.copy_of = None);
    }
    let unseen = skeleton
        .nodes
        .iter()
        .filter(|n| n.n_tracks == 0 && n.copy_of.is_none())
        .count();
    (unfit > 0 || out_of_order || unseen > 0).then(|| {
        "of some branches that were not measured it is not known what they repeat; they move as in motion.csv".into()
    })
}

/// Angle of the plane of every copy where it is not told: older versions wrote copies plane by
/// plane, on planes that part half a turn evenly.
fn evenly_parted(copies: &[(u32, u32)]) -> Vec<f64> {
    let same = |of: u32, among: &[(u32, u32)]| {
        among.iter().filter(|(_, original)| *original == of).count() as f64
    };
    let angle = |(k, (_, of)): (usize, &(u32, u32))| {
        PI * same(*of, &copies[..=k]) / (same(*of, copies) + 1.0)
    };
    copies.iter().enumerate().map(angle).collect()
}

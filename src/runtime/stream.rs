//! A line of the stream of poses: JSON, one line a frame.

use super::shared::Shared;
use crate::model::{BranchSway, NodeName, Pose, Skeleton, SwayColumns, SwayNow, Verdict};
use serde::Serialize;
use std::fmt::Write;
use std::sync::atomic::Ordering;

/// The most modes of the tree in a line: the slowest, so that a line stays short.
const MOST_MODES: usize = 20;
/// The most of them that are named for a branch.
const MOST_MODES_OF_BRANCH: usize = 3;

/// What a line has beside the pose.
#[derive(Default)]
pub struct Beside<'a> {
    /// An answer of the sway that takes effect with this frame.
    pub sway: Option<&'a SwayNow>,
    /// What the capture is worth, where that is another verdict than before.
    pub verdict: Option<&'a Verdict>,
    /// What was lost so far; of a file nothing is, so that two replays give the same.
    pub lost: Option<&'a Shared>,
}

/// `{"frame":…,"time_s":…,"nodes":[[id,x,y,z],…]}` and a line feed: the measured nodes, model axes,
/// in px or, where `metres_per_px` is not 0, in metres. After them `"sway":{…}`, `"verdict":{…}` and
/// the counts of what was lost, as far as they are there.
pub fn line(pose: &Pose, skeleton: &Skeleton, metres_per_px: f64, beside: &Beside) -> String {
    let measured = &skeleton.nodes[..skeleton.measured()];
    let scale = if metres_per_px > 0.0 {
        metres_per_px
    } else {
        1.0
    };
    let nodes = pose.joints.iter().zip(measured).map(|(joint, node)| {
        let p = joint.position * scale;
        format!("[{},{:.3},{:.3},{:.3}]", node.name.0, p.x, p.y, p.z)
    });
    let nodes = list(nodes);
    let mut line = format!(
        "{{\"frame\":{},\"time_s\":{:.6},\"nodes\":{nodes}",
        pose.frame, pose.time_s
    );
    if let Some(sway) = beside.sway {
        line.push_str(&told(sway));
    }
    // It has nothing that could not be written as JSON.
    if let Some(Ok(verdict)) = beside.verdict.map(serde_json::to_string) {
        let _ = write!(line, ",\"verdict\":{verdict}");
    }
    if let Some(shared) = beside.lost {
        line.push_str(&counts(shared));
    }
    line.push_str("}\n");
    line
}

fn list(entries: impl Iterator<Item = String>) -> String {
    format!("[{}]", entries.collect::<Vec<_>>().join(","))
}

/// The same names and units as in `nodes.csv`.
fn told(sway: &SwayNow) -> String {
    let branches = list(
        sway.branches
            .iter()
            .map(|(name, branch)| of_branch(*name, branch)),
    );
    let excitation = sway
        .excitation
        .map_or_else(|| "null".to_owned(), |e| format!("\"{}\"", e.word()));
    let mut text = format!(
        ",\"sway\":{{\"frame\":{},\"time_s\":{:.6},\"span_s\":{:.3},\
         \"excitation\":{excitation},\"branches\":{branches}",
        sway.frame, sway.time_s, sway.span_s
    );
    let most = sway.modes.len().min(MOST_MODES);
    push_json(&mut text, "modes", &sway.modes[..most]);
    text.push('}');
    text
}

fn of_branch(name: NodeName, branch: &BranchSway) -> String {
    let mut text = format!(
        "{{\"node_id\":{},\"identifiable\":{}",
        name.0,
        branch.swaying.is_ok()
    );
    match &branch.swaying {
        Ok(sway) => {
            let columns = SwayColumns::NAMES
                .into_iter()
                .zip(SwayColumns::of(Some(sway)).values());
            let all = columns.chain([("amplitude_deg", sway.amplitude_deg)]);
            // What is not known has no key.
            for (name, x) in all.filter(|(_, x)| x.is_finite()) {
                let _ = write!(text, ",\"{name}\":{x:.5}");
            }
            let _ = write!(text, ",\"excitation\":\"{}\"", sway.excitation.word());
        }
        Err(why) => {
            let _ = write!(text, ",\"unidentified\":\"{}\"", why.word());
            let most = branch.moves_with.len().min(MOST_MODES_OF_BRANCH);
            push_json(&mut text, "participation", &branch.moves_with[..most]);
        }
    }
    text.push('}');
    text
}

/// Appends a list; nothing for an empty one.
fn push_json<T: Serialize>(text: &mut String, name: &str, list: &[T]) {
    // It has nothing that could not be written as JSON.
    if let (false, Ok(json)) = (list.is_empty(), serde_json::to_string(list)) {
        let _ = write!(text, ",\"{name}\":{json}");
    }
}

/// What was lost until now, for the stream of a camera.
fn counts(shared: &Shared) -> String {
    let c = shared.camera_state();
    let by_sequence = c
        .lost_by_sequence
        .map_or_else(|| "null".to_owned(), |n| n.to_string());
    let depth = c.depth.map_or(String::new(), |depth| {
        format!(",\"without_depth\":{}", depth.counts.frames_without)
    });
    format!(
        ",\"dropped\":{},\"dropped_by_sequence\":{by_sequence},\"dropped_by_time\":{},\"broken\":{},\
         \"reconnects\":{}{depth}",
        shared.counts.lost_in_camera.load(Ordering::Relaxed),
        c.lost_by_time,
        c.damaged + c.stale + shared.counts.undecodable.load(Ordering::Relaxed),
        c.reconnects
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Excitation, Grade, ModeSummary, Participation, Size, Sway, Unidentified};
    use nalgebra::Point2;
    use serde_json::{Value, json};

    fn swaying(branches: Vec<(u32, crate::model::Swaying)>) -> SwayNow {
        let branch = |(name, swaying)| {
            (
                NodeName(name),
                BranchSway {
                    swaying,
                    moves_with: Vec::new(),
                    spectrum: None,
                },
            )
        };
        SwayNow {
            frame: 300,
            time_s: 10.0,
            span_s: 9.5,
            excitation: None,
            branches: branches.into_iter().map(branch).collect(),
            modes: Vec::new(),
        }
    }

    /// The line of a tree without a node.
    fn line_with(beside: &Beside) -> Value {
        let skeleton = Skeleton {
            nodes: Vec::new(),
            foot_px: Point2::origin(),
            image_size: Size::new(64, 64),
        };
        let pose = Pose {
            frame: 330,
            time_s: 11.0,
            joints: Vec::new(),
        };
        serde_json::from_str(&line(&pose, &skeleton, 0.0, beside)).expect("json")
    }

    /// A tree of very many modes makes no line that is longer without end.
    #[test]
    fn modes_and_what_moves_with_them_are_told_in_short() {
        let frequency_hz = crate::model::Interval {
            value: 0.7,
            lo: 0.6,
            hi: 0.8,
        };
        let mode = ModeSummary {
            mode: 1,
            sway: Sway {
                frequency_hz,
                damping_ratio: None,
                excitation: Excitation::Wind,
                amplitude_deg: f64::NAN,
            },
            collinearity: None,
            points: 9,
            node: Some(NodeName(4)),
            is_trunks: false,
            branch: Some("limb_1".into()),
            energy: Vec::new(),
        };
        let moves_with = Participation {
            mode: 1,
            frequency_hz: 0.7,
            branch: mode.branch.clone(),
            share: 0.6,
        };
        let mut sway = swaying(vec![
            (4, Err(Unidentified::AncestorsSway)),
            (5, Err(Unidentified::TooShort)),
        ]);
        let branch = sway.branches.get_mut(&NodeName(4)).expect("branch");
        branch.moves_with = vec![moves_with; 9];
        sway.modes = vec![mode; 999];
        let told = &line_with(&Beside {
            sway: Some(&sway),
            ..Beside::default()
        })["sway"];
        let modes = told["modes"].as_array().expect("modes");
        assert_eq!(modes.len(), MOST_MODES);
        assert_eq!(modes[0]["branch"], "limb_1");
        let of_branch = &told["branches"][0]["participation"];
        assert_eq!(of_branch.as_array().map(Vec::len), Some(3));
        assert_eq!(
            of_branch[0],
            json!({"mode": 1, "frequency_hz": 0.7, "branch": "limb_1", "share": 0.6})
        );
        assert!(told["branches"][1].get("participation").is_none());
    }

    /// Whatever is not known is left out: a reader must never meet a number that is none.
    #[test]
    fn what_is_not_known_is_left_out() {
        let interval = |value| crate::model::Interval {
            value,
            lo: 0.5 * value,
            hi: 2.0 * value,
        };
        let known = |damping_ratio, amplitude_deg| {
            Ok(Sway {
                frequency_hz: interval(0.8),
                damping_ratio,
                excitation: Excitation::Wind,
                amplitude_deg,
            })
        };
        let sway = swaying(vec![
            (1, known(Some(interval(0.02)), 1.5)),
            (4, known(None, f64::NAN)),
            (9, Err(Unidentified::AboveSampling)),
        ]);
        let shared = Shared::default();
        let told = &line_with(&Beside {
            sway: Some(&sway),
            verdict: Some(&Verdict {
                grade: Grade::Fair,
                reasons: vec!["too \"dark\"".into()],
                advice: Vec::new(),
            }),
            lost: Some(&shared),
        });
        assert_eq!(
            (&told["sway"]["excitation"], &told["dropped"]),
            (&Value::Null, &json!(0))
        );
        assert_eq!(
            told["verdict"],
            json!({"grade": "fair", "reasons": ["too \"dark\""], "advice": []})
        );
        assert_eq!(
            told["sway"]["branches"],
            json!([
                {"node_id": 1, "identifiable": true, "frequency_hz": 0.8, "frequency_lo_hz": 0.4,
                 "frequency_hi_hz": 1.6, "damping_ratio": 0.02, "damping_lo": 0.01, "damping_hi": 0.04,
                 "amplitude_deg": 1.5, "excitation": "wind"},
                {"node_id": 4, "identifiable": true, "frequency_hz": 0.8, "frequency_lo_hz": 0.4,
                 "frequency_hi_hz": 1.6, "excitation": "wind"},
                {"node_id": 9, "identifiable": false, "unidentified": "above_sampling"},
            ])
        );
        assert_eq!(
            line_with(&Beside::default()),
            json!({"frame": 330, "time_s": 11.0, "nodes": []})
        );
    }
}

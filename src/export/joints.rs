//! From poses to the local rotations of glTF joints, thinned.
//!
//! Branch `i` turns about its parent node P(i) by Q_i(t), in model axes. Its glTF joint therefore rests at P(i) with
//! identity rotation, is a child of P(i)'s joint, and turns by Q_P(i)^-1 Q_i; then a point x of the branch at rest is
//! skinned to p_P(i)(t) + Q_i(t) (x - rest_P(i)), which is what `JointPose` means. The foot's joint stands still.

use super::ExportError;
use super::thin_keys::{slerp, thin};
use crate::model::{Pose, Skeleton};
use nalgebra::UnitQuaternion;

/// Keys of one joint's local rotation.
pub(super) struct Keys {
    pub node: usize,
    /// Seconds from the first pose, strictly growing also as `f32`.
    pub times_s: Vec<f32>,
    /// x y z w, of length 1; neighbours lie in one hemisphere.
    pub rotations: Vec<[f32; 4]>,
}

/// Keys of all joints that move, with every node within `tolerance_px` of its pose in every frame.
///
/// A node's error is the sum of (branch length x error of its rotation) over the branches on its way from the foot.
/// So a branch may be wrong by `tolerance / longest way from the foot to a tip through it`. Each joint's rotation is
/// taken against its parent's thinned one, so that errors do not add up down the tree.
pub(super) fn keys(skeleton: &Skeleton, poses: &[Pose], tolerance_px: f64) -> Result<Vec<Keys>, ExportError> {
    let nodes = &skeleton.nodes;
    if let Some(p) = poses.iter().find(|p| p.joints.len() != nodes.len()) {
        let why = format!("the pose of frame {} has {} joints, the tree {}", p.frame, p.joints.len(), nodes.len());
        return Err(ExportError::unfit(why));
    }
    let (poses, times) = usable(poses);
    if times.is_empty() {
        return Ok(Vec::new());
    }
    let ways = longest_ways(skeleton);
    let mut shown: Vec<Vec<UnitQuaternion<f64>>> = Vec::with_capacity(nodes.len());
    let mut out = Vec::new();
    for (i, node) in nodes.iter().enumerate() {
        let Some(parent) = node.parent.map(|p| p.index()) else {
            shown.push(vec![UnitQuaternion::identity(); times.len()]);
            continue;
        };
        let local = local_rotations(&poses, i, &shown[parent]);
        let tolerance_rad = (tolerance_px.max(0.0) / ways[i].max(1e-9)).min(0.1);
        let kept = thin(&times, &local, tolerance_rad);
        let still = kept.len() == 1 && local.iter().all(|q| q.angle() <= tolerance_rad);
        let seen = if still { vec![UnitQuaternion::identity(); times.len()] } else { replay(&times, &local, &kept) };
        shown.push(seen.iter().zip(&shown[parent]).map(|(l, p)| p * l).collect());
        if !still {
            out.push(Keys {
                node: i,
                times_s: kept.iter().map(|&k| times[k] as f32).collect(),
                rotations: one_hemisphere(kept.iter().map(|&k| local[k])),
            });
        }
    }
    Ok(out)
}

/// Poses whose time grows, also as `f32`, which is what the file holds; and their times from the first on.
fn usable(poses: &[Pose]) -> (Vec<&Pose>, Vec<f64>) {
    let start = poses.iter().map(|p| p.time_s).find(|t| t.is_finite()).unwrap_or(0.0);
    let (mut kept, mut times): (Vec<&Pose>, Vec<f64>) = (Vec::new(), Vec::new());
    for pose in poses {
        let time = f64::from((pose.time_s - start) as f32);
        if time.is_finite() && times.last().is_none_or(|&last| time > last) {
            kept.push(pose);
            times.push(time);
        }
    }
    (kept, times)
}

/// Rotation of branch `i` against its parent as shown; where a pose has none, the branch keeps its last one.
fn local_rotations(poses: &[&Pose], i: usize, parent: &[UnitQuaternion<f64>]) -> Vec<UnitQuaternion<f64>> {
    let mut last = UnitQuaternion::identity();
    let turn = |(pose, parent): (&&Pose, &UnitQuaternion<f64>)| {
        let q = pose.joints[i].rotation;
        if q.coords.iter().all(|c| c.is_finite()) && q.coords.norm() > 0.5 {
            last = UnitQuaternion::new_normalize(q.into_inner());
        }
        parent.inverse() * last
    };
    poses.iter().zip(parent).map(turn).collect()
}

/// What a viewer shows at every time, given only the kept keys.
fn replay(times: &[f64], rotations: &[UnitQuaternion<f64>], kept: &[usize]) -> Vec<UnitQuaternion<f64>> {
    let mut span = 0;
    (0..times.len())
        .map(|k| {
            while span + 1 < kept.len() && k > kept[span + 1] {
                span += 1;
            }
            let (a, b) = (kept[span], kept[(span + 1).min(kept.len() - 1)]);
            if a == b {
                return rotations[a];
            }
            slerp(&rotations[a], &rotations[b], (times[k] - times[a]) / (times[b] - times[a]))
        })
        .collect()
}

/// q and -q are one rotation; a viewer that does not know takes the long way round between them.
fn one_hemisphere(rotations: impl Iterator<Item = UnitQuaternion<f64>>) -> Vec<[f32; 4]> {
    let mut last = nalgebra::Vector4::new(0.0, 0.0, 0.0, 1.0);
    rotations
        .map(|q| {
            last = if q.coords.dot(&last) < 0.0 { -q.coords } else { q.coords };
            [last.x as f32, last.y as f32, last.z as f32, last.w as f32]
        })
        .collect()
}

/// For every branch, the length of the longest way from the foot to a tip that goes through it, px.
fn longest_ways(skeleton: &Skeleton) -> Vec<f64> {
    let nodes = &skeleton.nodes;
    let parent_of = |i: usize| nodes[i].parent.map(|p| p.index());
    let length = |i: usize| parent_of(i).map_or(0.0, |p| (nodes[i].position - nodes[p].position).norm());
    let mut from_foot = vec![0.0; nodes.len()];
    for i in 0..nodes.len() {
        from_foot[i] = length(i) + parent_of(i).map_or(0.0, |p| from_foot[p]);
    }
    let mut ways = from_foot;
    for i in (0..nodes.len()).rev() {
        if let Some(p) = parent_of(i) {
            ways[p] = ways[p].max(ways[i]);
        }
    }
    ways
}

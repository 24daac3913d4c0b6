//! From poses to the local rotations of glTF joints, thinned.
//!
//! Branch `i` turns about its parent node P(i) by Q_i(t), in model axes. Its glTF joint therefore rests at P(i) with
//! identity rotation, is a child of P(i)'s joint, and turns by Q_P(i)^-1 Q_i; then a point x of the branch at rest is
//! skinned to p_P(i)(t) + Q_i(t) (x - rest_P(i)), which is what `JointPose` means. The foot's joint stands still.

use super::ExportError;
use super::thin_keys::{slerp, thin};
use crate::model::{Pose, Skeleton};
use nalgebra::{UnitQuaternion, Vector3};

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
/// Joints are thinned from the foot up, each against what its parent's kept keys show, so that a joint also makes good
/// its parent's error. The tolerance grows towards the tips: a node may be wrong by `tolerance sqrt(depth / depth of
/// the deepest tip above)`, of which its parent has used only a part.
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
    let budget = budgets(skeleton);
    let mut shown: Vec<Shown> = Vec::with_capacity(nodes.len());
    let mut out = Vec::new();
    for (i, node) in nodes.iter().enumerate() {
        let Some(parent) = node.parent.map(|p| p.index()) else {
            shown.push(Shown::still(times.len()));
            continue;
        };
        let wanted = rotations(&poses, i);
        let base = &shown[parent];
        let local: Vec<_> = wanted.iter().zip(&base.rotation).map(|(q, p)| p.inverse() * q).collect();
        let way = node.position - nodes[parent].position;
        let limit_px = (tolerance_px * budget[i]).max(1e-9);
        let miss = |k: usize, turn: &UnitQuaternion<f64>| base.error_px[k] + (turn * way - wanted[k] * way);
        let error = |k: usize, turn: &UnitQuaternion<f64>| {
            let angle = turn.angle_to(&wanted[k]);
            // Turning about its own axis moves no node, but the bark.
            let at_bark = angle * node.radius.max(0.0) / tolerance_px.max(1e-9);
            (miss(k, turn).norm() / limit_px).max(at_bark).max(angle / 0.1)
        };
        let between = |a: usize, b: usize, k: usize| {
            let x = if a == b { 0.0 } else { (times[k] - times[a]) / (times[b] - times[a]) };
            base.rotation[k] * slerp(&local[a], &local[b], x)
        };
        let still = (0..times.len()).all(|k| error(k, &base.rotation[k]) <= 1.0);
        let kept = thin(times.len(), |a, b, k| error(k, &between(a, b, k)));
        let rotation: Vec<_> = if still {
            base.rotation.clone()
        } else {
            spans(&kept, times.len()).map(|(a, b, k)| between(a, b, k)).collect()
        };
        let error_px = rotation.iter().enumerate().map(|(k, turn)| miss(k, turn)).collect();
        shown.push(Shown { rotation, error_px });
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

/// What a viewer shows of one branch at the time of every pose.
struct Shown {
    /// In model axes.
    rotation: Vec<UnitQuaternion<f64>>,
    /// By how much the branch's end is off.
    error_px: Vec<Vector3<f64>>,
}

impl Shown {
    fn still(n: usize) -> Self {
        Self { rotation: vec![UnitQuaternion::identity(); n], error_px: vec![Vector3::zeros(); n] }
    }
}

/// For each of `n` frames the kept keys before and after it, and the frame.
fn spans(kept: &[usize], n: usize) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..n).map(|k| {
        let after = kept.partition_point(|&key| key < k).min(kept.len() - 1);
        if kept[after] == k { (k, k, k) } else { (kept[after.saturating_sub(1)], kept[after], k) }
    })
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

/// Rotations of branch `i` in model axes; where a pose has none, the branch keeps its last one.
fn rotations(poses: &[&Pose], i: usize) -> Vec<UnitQuaternion<f64>> {
    let mut last = UnitQuaternion::identity();
    let turn = |pose: &&Pose| {
        let q = pose.joints[i].rotation;
        if q.coords.iter().all(|c| c.is_finite()) && q.coords.norm() > 0.5 {
            last = UnitQuaternion::new_normalize(q.into_inner());
        }
        last
    };
    poses.iter().map(turn).collect()
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

/// Share of the tolerance that every node may use.
fn budgets(skeleton: &Skeleton) -> Vec<f64> {
    let nodes = &skeleton.nodes;
    let mut depth = vec![0_u32; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        depth[i] = node.parent.map_or(0, |p| depth[p.index()] + 1);
    }
    let mut deepest = depth.clone();
    for (i, node) in nodes.iter().enumerate().rev() {
        if let Some(p) = node.parent {
            deepest[p.index()] = deepest[p.index()].max(deepest[i]);
        }
    }
    depth.iter().zip(&deepest).map(|(&d, &of)| (f64::from(d) / f64::from(of.max(1))).sqrt()).collect()
}

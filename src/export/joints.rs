//! From poses to the local rotations of glTF joints, thinned.
//!
//! Branch `i` turns about its parent node P(i) by Q_i(t), in model axes. Its glTF joint therefore
//! rests at P(i) with identity rotation, is a child of P(i)'s joint, and turns by Q_P(i)^-1 Q_i;
//! then a point x of the branch at rest is skinned to p_P(i)(t) + Q_i(t) (x - rest_P(i)), which is
//! what `JointPose` means. The foot's joint stands still.

use super::followed::{Followed, Shown, played};
use super::sparse_keys::{Path, unit};
use super::thin_keys::{Arc, share, thin};
use crate::model::{Pose, Skeleton};
use nalgebra::{Quaternion, UnitQuaternion, Vector4};

/// Keys of one joint's local rotation.
pub(super) struct Keys {
    pub node: usize,
    /// Seconds from the first pose, strictly growing also as `f32`.
    pub times_s: Vec<f32>,
    /// x y z w, of length 1; neighbours lie in one hemisphere.
    pub rotations: Vec<[f32; 4]>,
}

/// How the tree moves.
pub(super) struct Moving {
    pub joints: Vec<Keys>,
    /// The poses that are shown, by their place among all, and their times from the first on, s.
    pub kept: Vec<usize>,
    pub times_s: Vec<f64>,
}

impl Moving {
    /// Keys of all joints that move, with every node in every frame within `tolerance_px` of its
    /// pose on the screen of the front view, where u and v are, and within twice that in depth,
    /// which was estimated and not seen: the error is
    /// `sqrt(du^2 + dv^2 + (dz / 2)^2)`.
    ///
    /// Joints are thinned from the foot up, each against what its parent's kept keys show, so that
    /// a joint also makes good its parent's error. The tolerance grows towards the tips: a node may
    /// be wrong by `tolerance sqrt(depth / depth of the deepest tip above)`, of which its parent
    /// has used only a part.
    pub fn new(
        skeleton: &Skeleton,
        all: &[Pose],
        tolerance_px: f64,
        thorough: &dyn Fn() -> bool,
    ) -> Self {
        let (kept, times_s) = usable(all);
        let poses: Vec<&Pose> = kept.iter().map(|&k| &all[k]).collect();
        let joints = if poses.is_empty() {
            Vec::new()
        } else {
            keys(skeleton, (&poses, &times_s), tolerance_px, thorough)
        };
        Self {
            joints,
            kept,
            times_s,
        }
    }

    /// Rotation keys that are left, and how many there were before thinning.
    pub fn keys(&self) -> u64 {
        self.joints.iter().map(|k| k.times_s.len() as u64).sum()
    }

    pub fn raw_keys(&self) -> u64 {
        (self.joints.len() * self.kept.len()) as u64
    }
}

fn keys(
    skeleton: &Skeleton,
    (poses, times): (&[&Pose], &[f64]),
    tolerance_px: f64,
    thorough: &dyn Fn() -> bool,
) -> Vec<Keys> {
    let nodes = &skeleton.nodes;
    let budget = budgets(skeleton);
    let mut shown: Vec<Shown> = Vec::with_capacity(nodes.len());
    let mut out = Vec::new();
    for (i, node) in nodes.iter().enumerate() {
        let Some(parent) = node.parent.map(|p| p.index()) else {
            shown.push(Shown::still(times.len()));
            continue;
        };
        let base = &shown[parent];
        let branch = Followed::new(
            base,
            &rotations(poses, i),
            node,
            node.position - nodes[parent].position,
        )
        .within(tolerance_px, budget[i]);
        let frames = 0..times.len();
        if frames
            .clone()
            .all(|k| branch.miss(k, &UnitQuaternion::identity()) <= 1.0)
        {
            shown.push(branch.shown(base, &vec![UnitQuaternion::identity(); times.len()]));
            continue;
        }
        let aims = one_hemisphere(frames.clone().map(|k| branch.aim(k)));
        let path = Path {
            times_s: times,
            aims: &aims,
            miss: |k: usize, turn: &UnitQuaternion<f64>| branch.miss(k, turn),
        };
        let on_aims = {
            let aim = |k: usize| UnitQuaternion::new_unchecked(Quaternion::from(aims[k]));
            let spans = |a: usize, b: usize| {
                let arc = Arc::new(&aim(a), &aim(b));
                let fits = |k: usize| branch.miss(k, &arc.at(share(times, a, b, k))) <= 1.0;
                // The middle first: it is off the farthest, as a rule.
                let middle = (a + b) / 2;
                fits(middle) && (a + 1..b).all(|k| k == middle || fits(k))
            };
            let one = frames.clone().all(|k| branch.miss(k, &aim(0)) <= 1.0);
            path.on_aims(&thin(times.len(), one, spans))
        };
        let keys = if thorough() {
            // The plan takes arcs for straight, so even turning is better off on its path.
            let planned = path
                .mended(branch.planned(&aims, times))
                .filter(|keys| keys.len() < on_aims.len());
            path.fewer(planned.unwrap_or(on_aims))
        } else {
            on_aims
        };
        shown.push(branch.shown(base, &played(&keys, times)));
        let rotations = one_hemisphere(keys.iter().map(|(_, turn)| unit(turn)));
        out.push(Keys {
            node: i,
            times_s: keys.iter().map(|(k, _)| times[*k] as f32).collect(),
            rotations: rotations
                .iter()
                .map(|q| [q.x as f32, q.y as f32, q.z as f32, q.w as f32])
                .collect(),
        });
    }
    out
}

/// Places of the poses whose time grows, also as `f32`, which is what the file holds; and their
/// times from the first on.
fn usable(poses: &[Pose]) -> (Vec<usize>, Vec<f64>) {
    let start = poses
        .iter()
        .map(|p| p.time_s)
        .find(|t| t.is_finite())
        .unwrap_or(0.0);
    let (mut kept, mut times): (Vec<usize>, Vec<f64>) = (Vec::new(), Vec::new());
    for (k, pose) in poses.iter().enumerate() {
        let time = f64::from((pose.time_s - start) as f32);
        if time.is_finite() && times.last().is_none_or(|&last| time > last) {
            kept.push(k);
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
fn one_hemisphere(rotations: impl Iterator<Item = UnitQuaternion<f64>>) -> Vec<Vector4<f64>> {
    let mut last = Vector4::new(0.0, 0.0, 0.0, 1.0);
    rotations
        .map(|q| {
            last = if q.coords.dot(&last) < 0.0 {
                -q.coords
            } else {
                q.coords
            };
            last
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
    depth
        .iter()
        .zip(&deepest)
        .map(|(&d, &of)| (f64::from(d) / f64::from(of.max(1))).sqrt())
        .collect()
}

//! From poses to the local rotations of glTF joints, thinned.
//!
//! Branch `i` turns about its parent node P(i) by Q_i(t), in model axes. Its glTF joint therefore
//! rests at P(i) with identity rotation, is a child of P(i)'s joint, and turns by Q_P(i)^-1 Q_i;
//! then a point x of the branch at rest is skinned to p_P(i)(t) + Q_i(t) (x - rest_P(i)), which is
//! what `JointPose` means. The foot's joint stands still.

use super::followed::{Followed, Key, Shown, played, unit};
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
    pub fn new(skeleton: &Skeleton, all: &[Pose], tolerance_px: f64) -> Self {
        let (kept, times_s) = usable(all);
        let poses: Vec<&Pose> = kept.iter().map(|&k| &all[k]).collect();
        let joints = if poses.is_empty() {
            Vec::new()
        } else {
            keys(skeleton, &poses, &times_s, tolerance_px)
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

fn keys(skeleton: &Skeleton, poses: &[&Pose], times_s: &[f64], tolerance_px: f64) -> Vec<Keys> {
    let nodes = &skeleton.nodes;
    let budget = budgets(skeleton);
    let mut shown: Vec<Shown> = Vec::with_capacity(nodes.len());
    let mut out = Vec::new();
    for (i, node) in nodes.iter().enumerate() {
        let Some(parent) = node.parent.map(|p| p.index()) else {
            shown.push(Shown::still(times_s.len()));
            continue;
        };
        let way = node.position - nodes[parent].position;
        let branch = Followed::new(&shown[parent], &rotations(poses, i), node, way)
            .within(tolerance_px, budget[i]);
        let keys = turns(&branch, times_s);
        let turns = match &keys {
            Some(keys) => played(keys, times_s),
            None => vec![UnitQuaternion::identity(); times_s.len()],
        };
        shown.push(branch.shown(&shown[parent], &turns));
        out.extend(keys.map(|keys| written(i, &keys, times_s)));
    }
    out
}

/// The keys of one branch; `None` where it may stay as it is at rest.
fn turns(branch: &Followed, times_s: &[f64]) -> Option<Vec<Key>> {
    let n = times_s.len();
    let rest = UnitQuaternion::identity();
    if (0..n).all(|k| branch.miss(k, &rest) <= 1.0) {
        return None;
    }
    let aims = one_hemisphere((0..n).map(|k| branch.aim(k)));
    let path = Path {
        branch,
        aims: &aims,
        times_s,
    };
    Some(path.thinned())
}

/// The way of one branch: a turn for every frame.
struct Path<'a> {
    branch: &'a Followed,
    /// Neighbours lie in one hemisphere.
    aims: &'a [Vector4<f64>],
    times_s: &'a [f64],
}

impl Path<'_> {
    /// The fewest keys on the path that do.
    fn thinned(&self) -> Vec<Key> {
        let n = self.aims.len();
        let first = self.aim(0);
        let still = (0..n).all(|k| self.branch.miss(k, &first) <= 1.0);
        let kept = thin(n, still, |a, b| self.spans(a, b));
        kept.into_iter().map(|k| (k, self.aims[k])).collect()
    }

    fn aim(&self, k: usize) -> UnitQuaternion<f64> {
        UnitQuaternion::new_unchecked(Quaternion::from(self.aims[k]))
    }

    /// Whether no key is needed between those of frames `a` and `b`.
    fn spans(&self, a: usize, b: usize) -> bool {
        let arc = Arc::new(&self.aim(a), &self.aim(b));
        // The middle first: it is off the farthest, as a rule.
        let middle = (a + b) / 2;
        self.fits(&arc, a, b, middle) && (a + 1..b).all(|k| k == middle || self.fits(&arc, a, b, k))
    }

    fn fits(&self, arc: &Arc, a: usize, b: usize, k: usize) -> bool {
        self.branch.miss(k, &arc.at(share(self.times_s, a, b, k))) <= 1.0
    }
}

/// Keys as they go into the file.
fn written(node: usize, keys: &[Key], times_s: &[f64]) -> Keys {
    let rotations = one_hemisphere(keys.iter().map(|(_, turn)| unit(turn)));
    Keys {
        node,
        times_s: keys.iter().map(|(k, _)| times_s[*k] as f32).collect(),
        rotations: rotations
            .iter()
            .map(|q| [q.x as f32, q.y as f32, q.z as f32, q.w as f32])
            .collect(),
    }
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
    let mut rotations = Vec::with_capacity(poses.len());
    for pose in poses {
        let q = pose.joints[i].rotation;
        if q.coords.iter().all(|c| c.is_finite()) && q.coords.norm() > 0.5 {
            last = UnitQuaternion::new_normalize(q.into_inner());
        }
        rotations.push(last);
    }
    rotations
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

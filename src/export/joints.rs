//! From poses to the local rotations of glTF joints, thinned.
//!
//! Branch `i` turns about its parent node P(i) by Q_i(t), in model axes. Its glTF joint therefore
//! rests at P(i) with identity rotation, is a child of P(i)'s joint, and turns by Q_P(i)^-1 Q_i;
//! then a point x of the branch at rest is skinned to p_P(i)(t) + Q_i(t) (x - rest_P(i)), which is
//! what `JointPose` means. The foot's joint stands still. A bend turns by nothing against the part
//! of its branch that it grows from: it has no keys.

use super::followed::{Followed, Key, Shown, played, unit};
use super::thin_keys::{Arc, share, thin};
use crate::model::{MovingBranch, Pose, Skeleton};
use nalgebra::{Quaternion, UnitQuaternion, Vector3, Vector4};

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
    let branches = skeleton.moving_branches();
    let budget = budgets(skeleton, &branches);
    let mut shown: Vec<Shown> = vec![Shown::still(times_s.len()); nodes.len()];
    let mut out = Vec::new();
    for branch in &branches {
        let i = branch.node.index();
        let base = shown[branch.begin.index()].clone();
        let rotations = rotations(poses, i);
        let reach = Reach::of(skeleton, branch);
        let farthest = Followed::new(&base, &rotations, reach.radius_px, reach.way)
            .within(tolerance_px, budget[i]);
        let keys = turns(&farthest, times_s);
        let turns = match &keys {
            Some(keys) => played(keys, times_s),
            None => vec![UnitQuaternion::identity(); times_s.len()],
        };
        for part in branch.parts() {
            let node = &nodes[part.index()];
            let way = node.position - nodes[branch.begin.index()].position;
            let part_of = Followed::new(&base, &rotations, node.radius, way);
            shown[part.index()] = part_of.shown(&base, &turns);
            // The others turn with the part that they grow from.
            if let Some(keys) = keys.as_ref().filter(|_| node.parent == Some(branch.begin)) {
                out.push(written(part.index(), keys, times_s));
            }
        }
    }
    out
}

/// How far a branch reaches from where it begins.
struct Reach {
    /// To the part that is farthest from there, px.
    way: Vector3<f64>,
    /// Of its thickest part.
    radius_px: f64,
}

impl Reach {
    fn of(skeleton: &Skeleton, branch: &MovingBranch) -> Self {
        let mut reach = Self {
            way: branch.vector(skeleton),
            radius_px: skeleton.nodes[branch.node.index()].radius,
        };
        let from = skeleton.nodes[branch.begin.index()].position;
        for rider in &branch.riders {
            let node = &skeleton.nodes[rider.index()];
            let way = node.position - from;
            if way.norm_squared() > reach.way.norm_squared() {
                reach.way = way;
            }
            reach.radius_px = reach.radius_px.max(node.radius);
        }
        reach
    }
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
pub(super) fn usable(poses: &[Pose]) -> (Vec<usize>, Vec<f64>) {
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

/// Share of the tolerance that every branch may use, by the node that it ends in.
fn budgets(skeleton: &Skeleton, branches: &[MovingBranch]) -> Vec<f64> {
    let mut depth = vec![0_u32; skeleton.nodes.len()];
    for branch in branches {
        depth[branch.node.index()] = depth[branch.parent.index()] + 1;
    }
    let mut deepest = depth.clone();
    for branch in branches.iter().rev() {
        let (i, p) = (branch.node.index(), branch.parent.index());
        deepest[p] = deepest[p].max(deepest[i]);
    }
    depth
        .iter()
        .zip(&deepest)
        .map(|(&d, &of)| (f64::from(d) / f64::from(of.max(1))).sqrt())
        .collect()
}

//! From poses to the local rotations of glTF joints, thinned.
//!
//! Branch `i` turns about its parent node P(i) by Q_i(t), in model axes. Its glTF joint therefore rests at P(i) with
//! identity rotation, is a child of P(i)'s joint, and turns by Q_P(i)^-1 Q_i; then a point x of the branch at rest is
//! skinned to p_P(i)(t) + Q_i(t) (x - rest_P(i)), which is what `JointPose` means. The foot's joint stands still.

use super::sparse_keys::{Keyed, Path};
use super::thin_keys::{Arc, thin};
use crate::model::{Node, Pose, Skeleton};
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
    /// Keys of all joints that move, with every node in every frame within `tolerance_px` of its pose on the screen of the
    /// front view, where u and v are, and within twice that in depth, which was estimated and not seen: the error is
    /// `sqrt(du^2 + dv^2 + (dz / 2)^2)`.
    ///
    /// Joints are thinned from the foot up, each against what its parent's kept keys show, so that a joint also makes good
    /// its parent's error. The tolerance grows towards the tips: a node may be wrong by `tolerance sqrt(depth / depth of
    /// the deepest tip above)`, of which its parent has used only a part.
    pub fn new(skeleton: &Skeleton, all: &[Pose], tolerance_px: f64, thorough: bool) -> Self {
        let (kept, times_s) = usable(all);
        let poses: Vec<&Pose> = kept.iter().map(|&k| &all[k]).collect();
        let joints =
            if poses.is_empty() { Vec::new() } else { keys(skeleton, (&poses, &times_s), tolerance_px, thorough) };
        Self { joints, kept, times_s }
    }

    /// Rotation keys that are left, and how many there were before thinning.
    pub fn keys(&self) -> u64 {
        self.joints.iter().map(|k| k.times_s.len() as u64).sum()
    }

    pub fn raw_keys(&self) -> u64 {
        (self.joints.len() * self.kept.len()) as u64
    }
}

fn keys(skeleton: &Skeleton, (poses, times): (&[&Pose], &[f64]), tolerance_px: f64, thorough: bool) -> Vec<Keys> {
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
        let branch = Followed::new(base, &rotations(poses, i), node, node.position - nodes[parent].position)
            .within(tolerance_px, budget[i]);
        let frames = 0..times.len();
        if frames.clone().all(|k| branch.miss(k, &UnitQuaternion::identity()) <= 1.0) {
            shown.push(branch.shown(base, &vec![UnitQuaternion::identity(); times.len()]));
            continue;
        }
        let aims = one_hemisphere(frames.clone().map(|k| branch.aim(k)));
        let aim = |k: usize| UnitQuaternion::new_unchecked(Quaternion::from(aims[k]));
        let x = |a: usize, b: usize, k: usize| (times[k] - times[a]) / (times[b] - times[a]);
        let spans = |a: usize, b: usize| {
            let arc = Arc::new(&aim(a), &aim(b));
            let fits = |k: usize| branch.miss(k, &arc.at(x(a, b, k))) <= 1.0;
            // The middle first: it is off the farthest, as a rule.
            let middle = (a + b) / 2;
            fits(middle) && (a + 1..b).all(|k| k == middle || fits(k))
        };
        let one = frames.clone().all(|k| branch.miss(k, &aim(0)) <= 1.0);
        let kept = thin(times.len(), one, spans);
        let path =
            Path { times_s: times, aims: &aims, miss: |k: usize, turn: &UnitQuaternion<f64>| branch.miss(k, turn) };
        let keyed = path.keyed(kept, thorough);
        shown.push(branch.shown(base, &played(&keyed, times)));
        let rotations = one_hemisphere(keyed.turns.iter().copied());
        out.push(Keys {
            node: i,
            times_s: keyed.frames.iter().map(|&k| times[k] as f32).collect(),
            rotations: rotations.iter().map(|q| [q.x as f32, q.y as f32, q.z as f32, q.w as f32]).collect(),
        });
    }
    out
}

/// One branch on its way through all frames, in the axes of its parent branch as a viewer shows that.
struct Followed {
    /// Where the branch's end is to be, from the parent node as it is shown: this also makes good by how much that is off.
    targets: Vec<Vector3<f64>>,
    /// Direction of depth.
    depth: Vec<Vector3<f64>>,
    wanted: Vec<UnitQuaternion<f64>>,
    /// From the parent node to this one at rest.
    way: Vector3<f64>,
    radius_px: f64,
    limit_px: f64,
    limit_angle: f64,
    /// Cosine of half of it.
    limit_cosine: f64,
}

impl Followed {
    /// `wanted`: rotations in model axes.
    fn new(base: &Shown, wanted: &[UnitQuaternion<f64>], node: &Node, way: Vector3<f64>) -> Self {
        let back: Vec<UnitQuaternion<f64>> = base.rotation.iter().map(UnitQuaternion::inverse).collect();
        let every = || wanted.iter().zip(&back).zip(&base.error_px);
        Self {
            targets: every().map(|((q, back), off)| back * (q * way - off)).collect(),
            depth: back.iter().map(|back| back * Vector3::z()).collect(),
            wanted: every().map(|((q, back), _)| back * q).collect(),
            way,
            radius_px: node.radius,
            limit_px: 0.0,
            limit_angle: 0.0,
            limit_cosine: 1.0,
        }
    }

    /// With the end allowed to be off by `share` of `tolerance_px`. Turning about its own axis moves no node, but the bark.
    fn within(mut self, tolerance_px: f64, share: f64) -> Self {
        self.limit_angle = (tolerance_px / self.radius_px.max(1e-9)).clamp(1e-9, 0.1);
        self.limit_px = (tolerance_px * share).max(1e-9);
        self.limit_cosine = (0.5 * self.limit_angle).cos();
        self
    }

    /// By how much the branch is off if it turns by `turn` in its parent's axes, in units of what is allowed.
    fn miss(&self, k: usize, turn: &UnitQuaternion<f64>) -> f64 {
        let off = turn * self.way - self.targets[k];
        let depth = off.dot(&self.depth[k]);
        // Half as much in depth.
        let off = (off.norm_squared() - 0.75 * depth * depth).max(0.0).sqrt() / self.limit_px;
        let cosine = turn.coords.dot(&self.wanted[k].coords).abs();
        if cosine >= self.limit_cosine { off } else { off.max(2.0 * cosine.min(1.0).acos() / self.limit_angle) }
    }

    /// The turn that brings the branch's end nearest to where it is to be, by the measure of [`miss`](Self::miss): what
    /// remains of the parent's error is then no larger than it was there.
    fn aim(&self, k: usize) -> UnitQuaternion<f64> {
        let is = self.wanted[k] * self.way;
        let measure = |v: Vector3<f64>| v - self.depth[k] * (0.5 * v.dot(&self.depth[k]));
        let Some(first) =
            is.cross(&Vector3::x()).try_normalize(1e-9).or_else(|| is.cross(&Vector3::y()).try_normalize(1e-9))
        else {
            return self.wanted[k];
        };
        let second = is.cross(&first).normalize();
        let (a, b, off) = (measure(first), measure(second), measure(self.targets[k] - is));
        // Neither is 0, and they are not parallel: the measure halves one direction at most.
        let (aa, ab, bb) = (a.dot(&a), a.dot(&b), b.dot(&b));
        let (x, y) = (a.dot(&off), b.dot(&off));
        let determinant = aa * bb - ab * ab;
        let to = is + (first * (x * bb - y * ab) + second * (y * aa - x * ab)) / determinant;
        let mend = UnitQuaternion::rotation_between(&is, &to);
        mend.filter(|q| q.angle() <= 0.5 * self.limit_angle).unwrap_or_default() * self.wanted[k]
    }

    fn shown(&self, base: &Shown, turns: &[UnitQuaternion<f64>]) -> Shown {
        let off = |(k, turn): (usize, &UnitQuaternion<f64>)| base.rotation[k] * (turn * self.way - self.targets[k]);
        Shown {
            rotation: turns.iter().zip(&base.rotation).map(|(turn, base)| base * turn).collect(),
            error_px: turns.iter().enumerate().map(off).collect(),
        }
    }
}

/// The turns that a viewer makes of the keys, at all times.
fn played(keyed: &Keyed, times: &[f64]) -> Vec<UnitQuaternion<f64>> {
    let mut out = vec![keyed.turns.first().copied().unwrap_or_default(); times.len()];
    for (pair, turns) in keyed.frames.windows(2).zip(keyed.turns.windows(2)) {
        let (a, b) = (pair[0], pair[1]);
        let arc = Arc::new(&turns[0], &turns[1]);
        (a..=b).for_each(|k| out[k] = arc.at((times[k] - times[a]) / (times[b] - times[a])));
    }
    out
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

/// Places of the poses whose time grows, also as `f32`, which is what the file holds; and their times from the first on.
fn usable(poses: &[Pose]) -> (Vec<usize>, Vec<f64>) {
    let start = poses.iter().map(|p| p.time_s).find(|t| t.is_finite()).unwrap_or(0.0);
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
            last = if q.coords.dot(&last) < 0.0 { -q.coords } else { q.coords };
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
    depth.iter().zip(&deepest).map(|(&d, &of)| (f64::from(d) / f64::from(of.max(1))).sqrt()).collect()
}

//! One branch of an animation: where a viewer is to show it, and by how much it may be off.

use super::thin_keys::{Arc, share};
use nalgebra::{Quaternion, UnitQuaternion, Vector3, Vector4};

/// A key of one joint: its frame, and the turn, not quite of length 1.
pub(super) type Key = (usize, Vector4<f64>);

/// The turn of a key.
pub(super) fn unit(q: &Vector4<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::try_new(Quaternion::from(*q), 1e-9).unwrap_or_default()
}

/// One branch on its way through all frames, in the axes of its parent branch as a viewer shows
/// that.
pub(super) struct Followed {
    /// Where the branch's end is to be, from the parent node as it is shown: this also makes good
    /// by how much that is off.
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
    /// `wanted`: rotations in model axes. `way`: to its end at rest.
    pub fn new(
        base: &Shown,
        wanted: &[UnitQuaternion<f64>],
        radius_px: f64,
        way: Vector3<f64>,
    ) -> Self {
        let n = wanted.len();
        let (mut targets, mut depth) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let mut own = Vec::with_capacity(n);
        for (k, rotation) in wanted.iter().enumerate() {
            let back = base.rotation[k].inverse();
            targets.push(back * (rotation * way - base.error_px[k]));
            depth.push(back * Vector3::z());
            own.push(back * rotation);
        }
        Self {
            targets,
            depth,
            wanted: own,
            way,
            radius_px,
            limit_px: 0.0,
            limit_angle: 0.0,
            limit_cosine: 1.0,
        }
    }

    /// With the end allowed to be off by `share` of `tolerance_px`. Turning about its own axis
    /// moves no node, but the bark.
    pub fn within(mut self, tolerance_px: f64, share: f64) -> Self {
        self.limit_angle = (tolerance_px / self.radius_px.max(1e-9)).clamp(1e-9, 0.1);
        self.limit_px = (tolerance_px * share).max(1e-9);
        self.limit_cosine = (0.5 * self.limit_angle).cos();
        self
    }

    /// By how much the branch is off if it turns by `turn` in its parent's axes, in units of what
    /// is allowed.
    pub fn miss(&self, k: usize, turn: &UnitQuaternion<f64>) -> f64 {
        let off = turn * self.way - self.targets[k];
        let depth = off.dot(&self.depth[k]);
        // Half as much in depth.
        let off = (off.norm_squared() - 0.75 * depth * depth).max(0.0).sqrt() / self.limit_px;
        let cosine = turn.coords.dot(&self.wanted[k].coords).abs();
        if cosine >= self.limit_cosine {
            off
        } else {
            off.max(2.0 * cosine.min(1.0).acos() / self.limit_angle)
        }
    }

    /// The turn that brings the branch's end nearest to where it is to be, by the measure of
    /// [`miss`](Self::miss): what remains of the parent's error is then no larger than it was
    /// there.
    pub fn aim(&self, k: usize) -> UnitQuaternion<f64> {
        let is = self.wanted[k] * self.way;
        let Some(first) = is
            .cross(&Vector3::x())
            .try_normalize(1e-9)
            .or_else(|| is.cross(&Vector3::y()).try_normalize(1e-9))
        else {
            return self.wanted[k];
        };
        let second = is.cross(&first).normalize();
        let a = self.measure(k, first);
        let b = self.measure(k, second);
        let off = self.measure(k, self.targets[k] - is);
        // Neither is 0, and they are not parallel: the measure halves one direction at most.
        let (aa, ab, bb) = (a.dot(&a), a.dot(&b), b.dot(&b));
        let (x, y) = (a.dot(&off), b.dot(&off));
        let determinant = aa * bb - ab * ab;
        let to = is + (first * (x * bb - y * ab) + second * (y * aa - x * ab)) / determinant;
        let mend = UnitQuaternion::rotation_between(&is, &to);
        mend.filter(|q| q.angle() <= 0.5 * self.limit_angle)
            .unwrap_or_default()
            * self.wanted[k]
    }

    /// What `v` counts as: half as much in depth.
    fn measure(&self, k: usize, v: Vector3<f64>) -> Vector3<f64> {
        v - self.depth[k] * (0.5 * v.dot(&self.depth[k]))
    }

    pub fn shown(&self, base: &Shown, turns: &[UnitQuaternion<f64>]) -> Shown {
        let mut shown = Shown {
            rotation: Vec::with_capacity(turns.len()),
            error_px: Vec::with_capacity(turns.len()),
        };
        for (k, turn) in turns.iter().enumerate() {
            let base = &base.rotation[k];
            shown.rotation.push(base * turn);
            let off = turn * self.way - self.targets[k];
            shown.error_px.push(base * off);
        }
        shown
    }
}

/// The turns that a viewer makes of the keys, at all times.
pub(super) fn played(keys: &[Key], times: &[f64]) -> Vec<UnitQuaternion<f64>> {
    let mut out = vec![
        keys.first()
            .map_or_else(UnitQuaternion::identity, |k| unit(&k.1));
        times.len()
    ];
    for pair in keys.windows(2) {
        let ((a, from), (b, to)) = (pair[0], pair[1]);
        let arc = Arc::new(&unit(&from), &unit(&to));
        (a..=b).for_each(|k| out[k] = arc.at(share(times, a, b, k)));
    }
    out
}

/// What a viewer shows of one branch at the time of every pose.
#[derive(Clone)]
pub(super) struct Shown {
    /// In model axes.
    rotation: Vec<UnitQuaternion<f64>>,
    /// By how much the branch's end is off.
    error_px: Vec<Vector3<f64>>,
}

impl Shown {
    pub fn still(n: usize) -> Self {
        Self {
            rotation: vec![UnitQuaternion::identity(); n],
            error_px: vec![Vector3::zeros(); n],
        }
    }
}

//! One tapering, slightly curved tube with frames carried along without twist.

use super::limb::Riding;
use super::mesh::Mesh;
use crate::model::NodeId;
use nalgebra::{UnitQuaternion, Vector3};

/// Direction of a branch and one direction across it, both of length 1 and square to each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub tangent: Vector3<f64>,
    pub across: Vector3<f64>,
}

impl Frame {
    /// A frame along `tangent` (of length 1), turned about it in an arbitrary but stable way.
    pub fn along(tangent: Vector3<f64>) -> Self {
        let axis = if tangent.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
        Self { tangent, across: square_to(axis, tangent).unwrap_or_else(Vector3::y) }
    }

    /// The same frame turned by the least rotation that brings its tangent to `tangent` (parallel transport).
    fn carried_to(self, tangent: Vector3<f64>) -> Self {
        let turned = UnitQuaternion::rotation_between(&self.tangent, &tangent).map_or(self.across, |q| q * self.across);
        square_to(turned, tangent).map_or_else(|| Self::along(tangent), |across| Self { tangent, across })
    }
}

/// `v` less its part along `tangent`, made length 1; `None` if nothing is left.
fn square_to(v: Vector3<f64>, tangent: Vector3<f64>) -> Option<Vector3<f64>> {
    (v - tangent * v.dot(&tangent)).try_normalize(1e-9)
}

/// What one branch looks like at rest, px.
pub(super) struct Tube {
    pub from: Vector3<f64>,
    pub to: Vector3<f64>,
    /// Frame in which the parent's tube ends.
    pub start: Frame,
    /// False for a trunk, which stands on its foot and is closed there.
    pub grows_from_branch: bool,
    /// How deep inside the parent the tube begins.
    pub root_depth: f64,
    pub radius: f64,
    /// 0 makes a closed tip.
    pub end_radius: f64,
    pub parent_joint: u16,
    pub joint: u16,
    pub sides: usize,
    pub rings: usize,
}

/// A point of the middle line.
struct Station {
    /// 0 at the parent, 1 at the end; below 0 inside the parent.
    t: f64,
    centre: Vector3<f64>,
    frame: Frame,
    /// Way along the middle line from the first station.
    s: f64,
}

impl Tube {
    /// Adds the tube's triangles and returns the frame in which it ends.
    pub fn append_to(&self, mesh: &mut Mesh) -> Frame {
        let stations = self.stations();
        let first = mesh.positions.len() as u32;
        for (k, station) in stations.iter().enumerate() {
            let before = &stations[k.saturating_sub(1)];
            let after = &stations[(k + 1).min(stations.len() - 1)];
            let slope = (self.radius_at(after.t) - self.radius_at(before.t)) / (after.s - before.s).max(1e-12);
            self.ring(mesh, station, slope);
        }
        let row = self.sides as u32 + 1;
        let last = stations.len() as u32 - 1;
        for k in 0..last {
            for j in 0..self.sides as u32 {
                let (a, b) = (first + k * row + j, first + (k + 1) * row + j);
                mesh.indices.extend([a, a + 1, b]);
                // The last ring of a tip is a single point: its second triangle would have no area.
                if k + 1 < last || self.end_radius > 0.0 {
                    mesh.indices.extend([a + 1, b + 1, b]);
                }
            }
        }
        if !self.grows_from_branch {
            self.close_foot(mesh, &stations[0]);
        }
        stations.last().map_or(self.start, |s| s.frame)
    }

    /// Middle line as a Hermite curve: it leaves along the parent and arrives along its own chord.
    fn stations(&self) -> Vec<Station> {
        let chord = self.to - self.from;
        let length = chord.norm();
        let direction = chord / length;
        // A branch that turns back must not run a loop first.
        let straightness = 0.5 + 0.5 * self.start.tangent.dot(&direction);
        let m0 = self.start.tangent * (length * (0.15 + 0.75 * straightness));
        let m1 = chord * 0.9;
        let mut out: Vec<Station> = Vec::with_capacity(self.rings + 2);
        let mut frame = self.start;
        if self.grows_from_branch && self.root_depth > 1e-6 * length {
            let centre = self.from - self.start.tangent * self.root_depth;
            out.push(Station { t: -self.root_depth / length, centre, frame, s: 0.0 });
        }
        for k in 0..=self.rings {
            let t = k as f64 / self.rings as f64;
            let (t2, t3) = (t * t, t * t * t);
            let centre = self.from + m0 * (t3 - 2.0 * t2 + t) + chord * (3.0 * t2 - 2.0 * t3) + m1 * (t3 - t2);
            let way = m0 * (3.0 * t2 - 4.0 * t + 1.0) + chord * (6.0 * t - 6.0 * t2) + m1 * (3.0 * t2 - 2.0 * t);
            frame = frame.carried_to(way.try_normalize(1e-9 * length).unwrap_or(direction));
            let s = out.last().map_or(0.0, |before| before.s + (centre - before.centre).norm());
            out.push(Station { t, centre, frame, s });
        }
        out
    }

    /// Even taper between forks; a tip stays round and closes.
    fn radius_at(&self, t: f64) -> f64 {
        let t = t.clamp(0.0, 1.0);
        if self.end_radius > 0.0 {
            self.radius + (self.end_radius - self.radius) * t
        } else {
            self.radius * (1.0 - t * t)
        }
    }

    /// Share of the branch's own joint: none at the pivot, all from half its length on.
    fn own_weight(t: f64) -> f32 {
        let x = (2.0 * t).clamp(0.0, 1.0);
        (x * x * (3.0 - 2.0 * x)) as f32
    }

    fn ring(&self, mesh: &mut Mesh, station: &Station, slope: f64) {
        let Frame { tangent, across } = station.frame;
        let third = tangent.cross(&across);
        let radius = self.radius_at(station.t);
        for j in 0..=self.sides {
            let turn = j as f64 / self.sides as f64;
            // The seam's two vertices must agree to the last bit.
            let (sin, cos) = (std::f64::consts::TAU * (j % self.sides) as f64 / self.sides as f64).sin_cos();
            let outward = across * cos + third * sin;
            let normal = (outward - tangent * slope).normalize();
            let v = station.s / (std::f64::consts::TAU * self.radius);
            self.vertex(mesh, station.centre + outward * radius, normal, [turn, v], station.t);
        }
    }

    /// A disc under the trunk, for whoever looks from below.
    fn close_foot(&self, mesh: &mut Mesh, foot: &Station) {
        let first = mesh.positions.len() as u32;
        let Frame { tangent, across } = foot.frame;
        let third = tangent.cross(&across);
        let below = -tangent;
        self.vertex(mesh, foot.centre, below, [0.5, 0.5], foot.t);
        for j in 0..self.sides {
            let (sin, cos) = (std::f64::consts::TAU * j as f64 / self.sides as f64).sin_cos();
            let rim = foot.centre + (across * cos + third * sin) * self.radius_at(foot.t);
            self.vertex(mesh, rim, below, [0.5 + 0.5 * cos, 0.5 + 0.5 * sin], foot.t);
        }
        for j in 0..self.sides as u32 {
            mesh.indices.extend([first, first + 1 + (j + 1) % self.sides as u32, first + 1 + j]);
        }
    }

    fn vertex(&self, mesh: &mut Mesh, at: Vector3<f64>, normal: Vector3<f64>, uv: [f64; 2], t: f64) {
        mesh.positions.push([at.x as f32, at.y as f32, at.z as f32]);
        mesh.normals.push([normal.x as f32, normal.y as f32, normal.z as f32]);
        mesh.uvs.push([uv[0] as f32, uv[1] as f32]);
        let own = Self::own_weight(t);
        let Riding { joints, weights } =
            Riding::between(NodeId(self.parent_joint.into()), NodeId(self.joint.into()), own);
        mesh.joints.push(joints);
        mesh.weights.push(weights);
    }
}

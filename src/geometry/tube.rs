//! One closed tube along a chain of limbs, with frames carried along without twist.

use super::chain::{self, Chain};
use super::mesh::Mesh;
use crate::shape::{CenterlineSample, square_to};
use nalgebra::{Point2, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// Numbers of sides that are used: few steps, so that few rings differ from the next.
const SIDES: [usize; 18] = [
    3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 96, 128, 192, 256,
];
/// How much wider a side branch is where it leaves, and how fast that is lost, in radii; no wider
/// than a share of what it grows from, or forks become knots.
const COLLAR: f64 = 0.3;
const COLLAR_RADII: f64 = 1.5;
const COLLAR_OF_PARENT: f64 = 0.9;

/// A ring of a tube.
struct Ring {
    sample: CenterlineSample,
    tangent: Vector3<f64>,
    sides: usize,
    /// The wood below it.
    made_up: bool,
}

/// Triangles that [`append`] makes of the chain.
pub(super) fn triangles(chain: &Chain, density: f64) -> usize {
    let mut count = 0;
    let mut before: Option<usize> = None;
    walk(chain, density, |sample, last| {
        let sides = sides_of(sample.radius, density);
        match before {
            None => count += sides - 2,
            Some(before) if last => count += before,
            Some(before) => count += before + sides,
        }
        before = Some(sides);
    });
    count
}

fn sides_of(radius: f64, density: f64) -> usize {
    let wanted = chain::sides(radius) * density;
    let above = SIDES.partition_point(|&s| s as f64 <= wanted);
    SIDES[above.saturating_sub(1)]
}

/// Calls `at` with every ring's sample; the last one is the tip.
fn walk(chain: &Chain, density: f64, mut at: impl FnMut(&CenterlineSample, bool)) {
    if let Some(first) = chain.links.first() {
        at(&first.samples[0], false);
    }
    let end = chain.links.len() - 1;
    for (k, link) in chain.links.iter().enumerate() {
        let n = link.rings(density);
        let joint = chain.links.get(k + 1).map_or(1, |next| link.rings_to(next));
        for i in (1..=n).chain(std::iter::repeat_n(n, joint - 1)) {
            // How thick it is there is all that counting needs, and the same samples are drawn.
            at(&link.at(i as f64 / n as f64).0, k == end && i == n);
        }
    }
}

/// Adds the tube's triangles.
pub(super) fn append(chain: &Chain, density: f64, mesh: &mut Mesh) {
    let rings = rings(chain, density);
    let Some(first) = rings.first() else { return };
    let collar = Collar::of(chain, first.sample.radius);
    let mut frame = Frame {
        across: square_to(first.tangent),
        way_px: 0.0,
        v: 0.0,
    };
    close_base(mesh, first, frame.across);
    let mut below: Option<RingStart> = None;
    for (k, ring) in rings.iter().enumerate() {
        if let Some(last) = k.checked_sub(1).map(|j| &rings[j]) {
            frame.carry(last, ring);
        }
        let is_tip = k + 1 == rings.len();
        let sides = match below {
            Some(below) if is_tip => below.sides,
            _ => ring.sides,
        };
        // A side branch starts in the middle of what it grows from.
        let radius = if is_tip {
            0.0
        } else if k == 0 {
            ring.sample.radius
        } else {
            collar.widened(ring.sample.radius, frame.way_px)
        };
        let start = RingStart {
            vertex: mesh.positions.len() as u32,
            sides,
        };
        add_ring(mesh, ring, &frame, sides, radius, slope(&rings, k));
        match below {
            Some(below) if is_tip => close_tip(mesh, below, start.vertex),
            Some(below) => join(mesh, below, start),
            None => {}
        }
        mesh.mark_new(ring.made_up);
        below = Some(start);
    }
}

/// The vertices of a ring: the first of them, and the number of its sides.
#[derive(Clone, Copy)]
struct RingStart {
    vertex: u32,
    sides: usize,
}

/// What is carried along a tube from ring to ring.
struct Frame {
    /// Where a ring begins, square to its tangent, of length 1.
    across: Vector3<f64>,
    /// Way from the base, px and in circumferences.
    way_px: f64,
    v: f64,
}

impl Frame {
    fn carry(&mut self, last: &Ring, ring: &Ring) {
        let step = (ring.sample.at - last.sample.at).norm();
        let radius = 0.5 * (ring.sample.radius + last.sample.radius);
        self.way_px += step;
        self.v += step / (TAU * radius.max(1e-6));
        self.across = carried(self.across, last.tangent, ring.tangent);
    }
}

/// How a branch widens towards its base: never wider than what it grows from.
struct Collar {
    /// Radius of the base, px.
    base: f64,
    widest: f64,
}

impl Collar {
    fn of(chain: &Chain, base: f64) -> Self {
        Self {
            base,
            widest: chain.grows_from_px.map_or(0.0, |px| COLLAR_OF_PARENT * px),
        }
    }

    fn widened(&self, radius: f64, way_px: f64) -> f64 {
        let lost = (-way_px / (COLLAR_RADII * self.base).max(1e-9)).exp();
        let wide = radius * (1.0 + COLLAR * lost);
        wide.min(self.widest.max(radius))
    }
}

/// The vertices of one ring, the first of them once more at the end; `slope` is by how much the
/// radius grows along the way.
fn add_ring(mesh: &mut Mesh, ring: &Ring, frame: &Frame, sides: usize, radius: f64, slope: f64) {
    let third = ring.tangent.cross(&frame.across);
    for j in 0..=sides {
        let (sin, cos) = (TAU * (j % sides) as f64 / sides as f64).sin_cos();
        let outward = frame.across * cos + third * sin;
        let normal = (outward - ring.tangent * slope).normalize();
        let at = ring.sample.at.coords + outward * radius;
        let uv = Point2::new(j as f64 / sides as f64, frame.v);
        vertex(mesh, at, normal, uv, &ring.sample);
    }
}

/// Triangles from a ring to the tip, all of whose vertices lie in one point.
fn close_tip(mesh: &mut Mesh, below: RingStart, tip: u32) {
    for j in 0..below.sides as u32 {
        mesh.indices
            .extend([below.vertex + j, below.vertex + j + 1, tip + j]);
    }
}

/// `across`, square to `from`, turned by the least rotation that brings `from` to `to` (parallel
/// transport).
fn carried(across: Vector3<f64>, from: Vector3<f64>, to: Vector3<f64>) -> Vector3<f64> {
    let turned = UnitQuaternion::rotation_between(&from, &to).map_or(across, |q| q * across);
    (turned - to * turned.dot(&to))
        .try_normalize(1e-9)
        .unwrap_or_else(|| square_to(to))
}

fn rings(chain: &Chain, density: f64) -> Vec<Ring> {
    let mut out: Vec<Ring> = Vec::new();
    for (k, link) in chain.links.iter().enumerate() {
        let n = link.rings(density);
        for i in (if k == 0 { 0 } else { 1 })..=n {
            let (sample, tangent) = link.at(i as f64 / n as f64);
            let sides = sides_of(sample.radius, density);
            let Some(next) = chain.links.get(k + 1).filter(|_| i == n) else {
                out.push(Ring {
                    tangent,
                    sides,
                    sample,
                    made_up: link.made_up,
                });
                continue;
            };
            // Where two limbs meet at an angle the ring stands half way, or several one after the
            // other.
            let (joint, on) = (link.rings_to(next), next.at(0.0).1);
            let turn = UnitQuaternion::rotation_between(&tangent, &on)
                .unwrap_or_else(UnitQuaternion::identity);
            for j in 0..joint {
                let share = if joint == 1 {
                    0.5
                } else {
                    j as f64 / (joint - 1) as f64
                };
                out.push(Ring {
                    tangent: turn.powf(share) * tangent,
                    sides,
                    sample,
                    made_up: link.made_up,
                });
            }
        }
    }
    out
}

/// By how much the radius grows along the way, at ring `k`.
fn slope(rings: &[Ring], k: usize) -> f64 {
    let (a, b) = (k.saturating_sub(1), (k + 1).min(rings.len() - 1));
    let way: f64 = (a..b)
        .map(|j| (rings[j + 1].sample.at - rings[j].sample.at).norm())
        .sum();
    ((drawn_radius(rings, b) - drawn_radius(rings, a)) / way.max(1e-9)).clamp(-2.0, 2.0)
}

/// Of ring `j`, px; the last one is the tip.
fn drawn_radius(rings: &[Ring], j: usize) -> f64 {
    if j + 1 == rings.len() {
        0.0
    } else {
        rings[j].sample.radius
    }
}

/// Triangles between two rings whose numbers of sides may differ: whichever ring is behind goes on.
fn join(mesh: &mut Mesh, below: RingStart, above: RingStart) {
    let (m, n) = (below.sides, above.sides);
    let (mut i, mut j) = (0, 0);
    while i < m || j < n {
        let (a, b) = (below.vertex + i as u32, above.vertex + j as u32);
        if j == n || (i < m && (i + 1) * n <= (j + 1) * m) {
            mesh.indices.extend([a, a + 1, b]);
            i += 1;
        } else {
            mesh.indices.extend([a, b + 1, b]);
            j += 1;
        }
    }
}

/// The end of the tube: under a trunk for a view from below, of a branch inside what it
/// grows from.
fn close_base(mesh: &mut Mesh, ring: &Ring, across: Vector3<f64>) {
    let first = mesh.positions.len() as u32;
    let third = ring.tangent.cross(&across);
    for j in 0..ring.sides {
        let (sin, cos) = (TAU * j as f64 / ring.sides as f64).sin_cos();
        let rim = ring.sample.at.coords + (across * cos + third * sin) * ring.sample.radius;
        vertex(
            mesh,
            rim,
            -ring.tangent,
            Point2::new(0.5 + 0.5 * cos, 0.5 + 0.5 * sin),
            &ring.sample,
        );
    }
    for j in 1..ring.sides as u32 - 1 {
        mesh.indices.extend([first, first + j + 1, first + j]);
    }
}

fn vertex(
    mesh: &mut Mesh,
    at: Vector3<f64>,
    normal: Vector3<f64>,
    uv: Point2<f64>,
    sample: &CenterlineSample,
) {
    mesh.positions.push([at.x as f32, at.y as f32, at.z as f32]);
    mesh.normals
        .push([normal.x as f32, normal.y as f32, normal.z as f32]);
    mesh.uvs.push([uv.x as f32, uv.y as f32]);
    mesh.joints.push(sample.skin.joints);
    mesh.weights.push(sample.skin.weights);
}

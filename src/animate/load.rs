//! What the wind finds to press on, and how far each branch gives way.

use super::tune::Tuning;
use crate::model::{MovingBranch, Skeleton};
use crate::signal::median;
use nalgebra::{Point3, Vector3};
use std::f64::consts::TAU;

/// Twigs and leaves that a cross-section feeds have so many times its area (pipe model).
const SAIL_BY_SECTION: f64 = 30.0;
/// A branch may give way so many times more or less than the median one: radii and frequencies are
/// estimates.
const UNLIKE: f64 = 4.0;
/// The thicker of two branches gives way less by this power of their radii than frequency and load
/// alone tell. These are taken as if the wind met all wood alike; it is weaker near the ground and
/// behind other branches, and without this a trunk would bend as far as a twig.
const THICKER: f64 = 0.5;
/// No branch is thinner, px.
const THINNEST_PX: f64 = 0.3;

/// One branch under load. Model axes at rest, px.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Where it turns.
    pub base: Point3<f64>,
    /// From there to where the wind presses on it.
    pub lever: Vector3<f64>,
    /// Area that the wind finds, px².
    pub sail: f64,
    /// By how much it bends under a bending moment, rad: Hooke's law (Hu et al. sect. 6). 0 where
    /// it does not.
    pub yields: f64,
}

/// The loads of all branches, by the node that they end in; what moves with that is part of it, and
/// has none of its own. In steady wind of force 6 the median branch bends by
/// `bend_deg`.
///
/// The stiffness of a branch is the square of its frequency times the moment of inertia of all that
/// it carries; the moment that bends it is that of the wind on all that it carries.
pub fn loads(skeleton: &Skeleton, tuning: &[Tuning], bend_deg: f64) -> Vec<Load> {
    let (mut loads, bends) = unscaled(skeleton, tuning);
    let (mut known_bends, mut radii_px) = (Vec::new(), Vec::new());
    for (i, node) in skeleton.nodes.iter().enumerate() {
        if loads[i].yields > 0.0 {
            known_bends.push(bends[i]);
            radii_px.push(radius(node.radius));
        }
    }
    let Some(bend) = median(known_bends, f64::total_cmp).filter(|m| *m > 0.0) else {
        return loads;
    };
    let radius_px = median(radii_px, f64::total_cmp).unwrap_or(THINNEST_PX);
    let scale = bend_deg.to_radians() / bend;
    let yielding = loads.iter_mut().enumerate().filter(|(_, l)| l.yields > 0.0);
    for (i, load) in yielding {
        let unlike = bends[i] / bend;
        let thicker = radius(skeleton.nodes[i].radius) / radius_px;
        let believed = (unlike * thicker.powf(-THICKER)).clamp(1.0 / UNLIKE, UNLIKE);
        load.yields *= scale * believed / unlike.max(1e-12);
    }
    loads
}

/// The loads with `yields` in one unknown unit, and how far steady wind bends each branch in that
/// unit.
fn unscaled(skeleton: &Skeleton, tuning: &[Tuning]) -> (Vec<Load>, Vec<f64>) {
    let nodes = &skeleton.nodes;
    let sections: Vec<f64> = nodes.iter().map(|n| radius(n.radius).powi(2)).collect();
    let ends_here = ending_sections(skeleton, &sections);
    let mut loads = vec![Load::default(); nodes.len()];
    let mut carried = vec![Carried::default(); nodes.len()];
    let mut bends = vec![0.0; nodes.len()];
    for branch in skeleton.moving_branches().iter().rev() {
        let i = branch.node.index();
        let base = nodes[branch.begin.index()].position;
        let pieces = pieces(skeleton, branch);
        if !pieces.iter().all(Piece::is_sound) {
            continue;
        }
        let (mut sail, mut turning) = (0.0, Vector3::zeros());
        for piece in &pieces {
            let length = piece.way.norm();
            let own = 2.0 * radius(nodes[piece.end].radius) * length
                + SAIL_BY_SECTION * ends_here[piece.end].max(0.0);
            let middle = piece.from + 0.5 * piece.way;
            carried[i].add(&Carried::of(&middle, sections[piece.end] * length, own));
            sail += own;
            turning += (piece.from - base + 0.5 * piece.way) * own;
        }
        let all = carried[i];
        carried[branch.parent.index()].add(&all);
        let way = branch.vector(skeleton);
        let length = way.norm();
        let inertia = all
            .inertia_about(&base)
            .max(sections[i] * length.powi(3) / 3.0);
        let stiff = inertia * (TAU * tuning.get(i).map_or(1.0, |t| t.frequency_hz)).powi(2);
        let yields = if length > 1e-6 && stiff > 0.0 {
            1.0 / stiff
        } else {
            0.0
        };
        // Of one straight piece the middle, to the last bit.
        let lever = if pieces.len() > 1 && sail > 0.0 {
            turning / sail
        } else {
            0.5 * way
        };
        loads[i] = Load {
            base,
            lever,
            sail,
            yields,
        };
        bends[i] = all.moment_about(&base) * yields;
    }
    (loads, bends)
}

/// A straight piece of a branch.
struct Piece {
    /// The node that it ends in, by index.
    end: usize,
    from: Point3<f64>,
    way: Vector3<f64>,
}

impl Piece {
    fn is_sound(&self) -> bool {
        let mut coordinates = self.way.iter().chain(self.from.iter());
        coordinates.all(|x| x.abs() < 1e9)
    }
}

/// The pieces of a branch: one from each of its parts down to the node that carries that.
fn pieces(skeleton: &Skeleton, branch: &MovingBranch) -> Vec<Piece> {
    let mut pieces = Vec::with_capacity(1 + branch.riders.len());
    for part in branch.parts() {
        let Some(below) = skeleton.ancestors(part).next() else {
            continue;
        };
        let from = skeleton.nodes[below.index()].position;
        pieces.push(Piece {
            end: part.index(),
            from,
            way: skeleton.nodes[part.index()].position - from,
        });
    }
    pieces
}

/// What of the cross-section of each branch no child of it takes over: it feeds twigs and leaves.
fn ending_sections(skeleton: &Skeleton, sections: &[f64]) -> Vec<f64> {
    let mut ends_here = sections.to_vec();
    for (i, node) in skeleton.nodes.iter().enumerate() {
        if let Some(parent) = node.parent.filter(|p| p.index() < i) {
            ends_here[parent.index()] -= sections[i];
        }
    }
    ends_here
}

fn radius(px: f64) -> f64 {
    if px.is_finite() {
        px.max(THINNEST_PX)
    } else {
        THINNEST_PX
    }
}

/// Sums over all that hangs on a branch, about the origin.
#[derive(Clone, Copy, Debug, Default)]
struct Carried {
    mass: f64,
    mass_place: Vector3<f64>,
    mass_square: f64,
    sail: f64,
    sail_place: Vector3<f64>,
}

impl Carried {
    fn of(at: &Point3<f64>, mass: f64, sail: f64) -> Self {
        let place = at.coords;
        let mass_square = mass * place.norm_squared();
        Self {
            mass,
            mass_place: mass * place,
            mass_square,
            sail,
            sail_place: sail * place,
        }
    }

    fn add(&mut self, other: &Self) {
        self.mass += other.mass;
        self.mass_place += other.mass_place;
        self.mass_square += other.mass_square;
        self.sail += other.sail;
        self.sail_place += other.sail_place;
    }

    fn inertia_about(&self, base: &Point3<f64>) -> f64 {
        self.mass_square - 2.0 * self.mass_place.dot(&base.coords)
            + self.mass * base.coords.norm_squared()
    }

    /// With the wind across the way to the middle of all that it presses on.
    fn moment_about(&self, base: &Point3<f64>) -> f64 {
        (self.sail_place - self.sail * base.coords).norm()
    }
}

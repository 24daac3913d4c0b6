//! What the wind finds to press on, and how far each branch gives way.

use super::tune::Tuning;
use crate::model::Skeleton;
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

/// The loads of all nodes, by index. In steady wind of force 6 the median branch bends by
/// `bend_deg`.
///
/// The stiffness of a branch is the square of its frequency times the moment of inertia of all that
/// it carries; the moment that bends it is that of the wind on all that it carries.
pub fn loads(skeleton: &Skeleton, tuning: &[Tuning], bend_deg: f64) -> Vec<Load> {
    let nodes = &skeleton.nodes;
    let sections: Vec<f64> = nodes.iter().map(|n| radius(n.radius).powi(2)).collect();
    let mut ends_here = sections.clone();
    for (i, node) in nodes.iter().enumerate() {
        node.parent
            .filter(|p| p.index() < i)
            .into_iter()
            .for_each(|p| ends_here[p.index()] -= sections[i]);
    }
    let mut out = vec![Load::default(); nodes.len()];
    let mut carried = vec![Carried::default(); nodes.len()];
    for i in (0..nodes.len()).rev() {
        let Some(p) = nodes[i].parent.map(|p| p.index()).filter(|&p| p < i) else {
            continue;
        };
        let (base, end) = (nodes[p].position, nodes[i].position);
        let way = end - base;
        if !way.iter().chain(base.iter()).all(|x| x.abs() < 1e9) {
            continue;
        }
        let (length, middle) = (way.norm(), base + 0.5 * way);
        let sail = 2.0 * radius(nodes[i].radius) * length + SAIL_BY_SECTION * ends_here[i].max(0.0);
        out[i] = Load {
            base,
            lever: 0.5 * way,
            sail,
            yields: 0.0,
        };
        carried[i].add(&Carried::of(&middle, sections[i] * length, sail));
        let all = carried[i];
        carried[p].add(&all);
        // How far steady wind would bend it, and how far a unit of moment does, both in one unknown
        // unit.
        let inertia = all
            .inertia_about(&base)
            .max(sections[i] * length.powi(3) / 3.0);
        let stiff = inertia * (TAU * tuning.get(i).map_or(1.0, |t| t.frequency_hz)).powi(2);
        out[i].yields = if length > 1e-6 && stiff > 0.0 {
            1.0 / stiff
        } else {
            0.0
        };
        carried[i].bends = all.moment_about(&base) * out[i].yields;
    }
    let bends = || {
        carried
            .iter()
            .zip(&out)
            .filter(|(_, l)| l.yields > 0.0)
            .map(|(c, _)| c.bends)
    };
    let median = crate::signal::median(bends().collect(), f64::total_cmp).filter(|m| *m > 0.0);
    let Some(median) = median else { return out };
    let scale = bend_deg.to_radians() / median;
    let bent = || (0..nodes.len()).filter(|&i| out[i].yields > 0.0);
    let middle_px = crate::signal::median(
        bent().map(|i| radius(nodes[i].radius)).collect(),
        f64::total_cmp,
    );
    let middle_px = middle_px.unwrap_or(THINNEST_PX);
    for (i, load) in out.iter_mut().enumerate().filter(|(_, l)| l.yields > 0.0) {
        let unlike = carried[i].bends / median;
        let thicker = radius(nodes[i].radius) / middle_px;
        let believed = (unlike * thicker.powf(-THICKER)).clamp(1.0 / UNLIKE, UNLIKE);
        load.yields *= scale * believed / unlike.max(1e-12);
    }
    out
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
    /// By how much steady wind bends the branch.
    bends: f64,
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
            bends: 0.0,
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

//! Limbs: what is drawn of a tree as wood, as middle lines with a thickness.

use super::curl::Curve;
use super::{radius, twigs};
use crate::config;
use crate::model::{FARTHEST_PX, NodeId, Skeleton};
use crate::random::generator;
use nalgebra::{Point3, Vector3};

/// Which joints move a point, and their shares: joint `i` is node `i` of the skeleton.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Riding {
    /// Unused entries are 0.
    pub joints: [u16; 4],
    /// Add up to 1; unused entries are 0.
    pub weights: [f32; 4],
}

impl Riding {
    /// Between the branch of `parent` and that of `node`, with share `own` (0 to 1) of the latter.
    pub fn between(parent: NodeId, node: NodeId, own: f32) -> Self {
        // A joint that has no share must be 0, or validators warn.
        let (joints, weights) = if own <= 0.0 {
            ([parent.0 as u16, 0, 0, 0], [1.0, 0.0, 0.0, 0.0])
        } else if own >= 1.0 {
            ([node.0 as u16, 0, 0, 0], [1.0, 0.0, 0.0, 0.0])
        } else {
            (
                [node.0 as u16, parent.0 as u16, 0, 0],
                [own, 1.0 - own, 0.0, 0.0],
            )
        };
        Self { joints, weights }
    }

    /// Share `t` of the way from `self` to `other`, where they name the same joints or one each;
    /// else the nearer one.
    pub(super) fn towards(self, other: Self, t: f32) -> Self {
        if self == other || t <= 0.0 {
            return self;
        }
        if t >= 1.0 {
            return other;
        }
        let part = |r: &Self, joint: u16| {
            let named = |k: &usize| r.weights[*k] > 0.0 && r.joints[*k] == joint;
            (0..4).find(named).map_or(0.0, |k| r.weights[k])
        };
        let first = self.joints[0].max(other.joints[0]);
        let second = [self, other]
            .into_iter()
            .flat_map(|r| r.joints.into_iter().zip(r.weights));
        let mut others = second
            .filter(|&(j, w)| w > 0.0 && j != first)
            .map(|(j, _)| j);
        let Some(second) = others.next() else {
            return self;
        };
        if others.any(|j| j != second) {
            return if t < 0.5 { self } else { other };
        }
        let share = part(&self, first) * (1.0 - t) + part(&other, first) * t;
        Self::between(NodeId(second.into()), NodeId(first.into()), share)
    }
}

/// A point of a limb's middle line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    /// Model axes at rest, px.
    pub at: Point3<f64>,
    /// px; 0 only at a tip.
    pub radius: f64,
    pub riding: Riding,
}

/// One branch or twig at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Limb {
    /// The branch that it is, or that carries it.
    pub node: NodeId,
    /// The limb that it grows from, earlier in the list; `None` for what stands on the ground.
    pub parent: Option<usize>,
    /// Added by self-similarity; not a branch of the skeleton.
    pub twig: bool,
    /// From its base to its tip, at least two; the first is on the parent's middle line.
    pub stations: Vec<Station>,
}

impl Limb {
    /// Way along its middle line, px.
    pub fn length(&self) -> f64 {
        self.stations
            .windows(2)
            .map(|s| (s[1].at - s[0].at).norm())
            .sum()
    }

    /// Radius at share `t` (0 to 1) of its stations, px.
    pub(super) fn radius_at(&self, t: f64) -> f64 {
        self.between(t)
            .map_or(0.0, |(a, b, s)| a.radius + (b.radius - a.radius) * s)
    }

    /// The stations about share `t` (0 to 1), and how far it is from the one to the other.
    pub(super) fn between(&self, t: f64) -> Option<(&Station, &Station, f64)> {
        let place = t.clamp(0.0, 1.0) * self.stations.len().checked_sub(1)? as f64;
        let k = (place as usize).min(self.stations.len().checked_sub(2)?);
        Some((&self.stations[k], &self.stations[k + 1], place - k as f64))
    }

    /// Direction in which it ends, of length 1; up where it has none.
    pub(super) fn arrives(&self) -> Vector3<f64> {
        let n = self.stations.len();
        (n >= 2)
            .then(|| (self.stations[n - 1].at - self.stations[n - 2].at).try_normalize(1e-12))
            .flatten()
            .unwrap_or_else(Vector3::y)
    }
}

/// A limb whose thickness is not known yet, and where it leaves its parent (share of the parent's
/// length).
#[derive(Clone, Debug)]
pub(super) struct Grown {
    pub limb: Limb,
    pub at: f64,
}

/// Whether a twig may grow from one point to another, model axes at rest, px.
pub type Room<'a> = &'a dyn Fn(&Point3<f64>, &Point3<f64>) -> bool;

/// Straight pieces that the middle line of a branch is told in.
const PIECES: u32 = 12;

/// The branches of the skeleton as curved limbs, those without length left out, then twigs, each
/// after what carries it.
///
/// The ends of branches do not move; in between they leave the straight line by at most
/// [`CURL_BOUND`](super::CURL_BOUND) of their length. Twigs grow where there is `room`. Same seed,
/// same tree. The trunk is as thick as the skeleton says; what leaves it by the pipe model, see
/// [`thicken`](super::thicken).
pub fn limbs(skeleton: &Skeleton, room: Room, wood: &config::Wood, seed: u64) -> Vec<Limb> {
    let mut grown = branches(skeleton, wood.curl, seed);
    twigs::add(&mut grown, skeleton, room, wood, seed);
    let trunk_px = skeleton.nodes.get(1).map_or(0.0, |top| top.radius);
    radius::by_pipes(&mut grown, skeleton, trunk_px);
    grown.into_iter().map(|g| g.limb).collect()
}

/// The child that every branch goes on in: a thick one, by the tips above it, that is straight.
pub(super) fn continuations(skeleton: &Skeleton) -> Vec<Option<NodeId>> {
    let nodes = &skeleton.nodes;
    let mut tips = vec![0u32; nodes.len()];
    let mut best: Vec<Option<(bool, f64, NodeId)>> = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate().rev() {
        tips[i] = tips[i].max(1);
        let Some(p) = node.parent.map(|p| p.index()).filter(|&p| p < i) else {
            continue;
        };
        tips[p] += tips[i];
        let Some(way) = way(skeleton, i) else {
            continue;
        };
        let straight = nodes[p]
            .parent
            .and_then(|_| self::way(skeleton, p))
            .map_or(0.0, |before| before.dot(&way));
        // A measured branch goes on in a measured one: its copies lie where nobody looked.
        let seen = node.copy_of.is_none() || nodes[p].copy_of.is_some();
        // As the pipe model makes it, and as chains of limbs are put together.
        let thick = f64::from(tips[i]).powf(0.4);
        let here = (seen, thick * (2.0 + straight), NodeId(i as u32));
        if best[p].is_none_or(|b| (here.0, here.1) >= (b.0, b.1)) {
            best[p] = Some(here);
        }
    }
    best.into_iter().map(|b| b.map(|(_, _, id)| id)).collect()
}

/// Direction of branch `i`, of length 1; `None` where it has no length, or its place is no number.
pub(super) fn way(skeleton: &Skeleton, i: usize) -> Option<Vector3<f64>> {
    let node = skeleton.nodes.get(i)?;
    let from = skeleton
        .nodes
        .get(node.parent.filter(|p| p.index() < i)?.index())?;
    let chord: Vector3<f64> = node.position - from.position;
    let finite = chord
        .iter()
        .chain(from.position.iter())
        .all(|x| x.abs() <= FARTHEST_PX);
    if finite {
        chord.try_normalize(1e-6)
    } else {
        None
    }
}

fn branches(skeleton: &Skeleton, curl: f64, seed: u64) -> Vec<Grown> {
    let nodes = &skeleton.nodes;
    let goes_on = continuations(skeleton);
    let smooth = (2.0 * curl).clamp(0.0, 1.0);
    let mut arrives: Vec<Vector3<f64>> = vec![Vector3::y(); nodes.len()];
    let mut limb_of: Vec<Option<usize>> = vec![None; nodes.len()];
    let mut out: Vec<Grown> = Vec::new();
    for (i, node) in nodes.iter().enumerate().take(usize::from(u16::MAX) + 1) {
        let Some(parent) = node.parent.filter(|p| p.index() < i) else {
            continue;
        };
        limb_of[i] = limb_of[parent.index()];
        arrives[i] = arrives[parent.index()];
        let Some(along) = way(skeleton, i) else {
            continue;
        };
        // Halfway between the two branches, so that no crease is left where one goes on as the
        // other.
        let on = goes_on[i].and_then(|k| way(skeleton, k.index()));
        arrives[i] = on
            .and_then(|on| (along + on * smooth).try_normalize(0.1))
            .unwrap_or(along);
        let before = arrives[parent.index()];
        let leaves = match limb_of[parent.index()] {
            // A trunk stands upright on the ground.
            None if along.y > 0.0 => Vector3::y(),
            None => along,
            Some(_) if goes_on[parent.index()] == Some(NodeId(i as u32)) => before,
            // A side branch leaves between the way of its parent and its own; from a right angle on
            // along its own.
            Some(_) => (along + before * (0.5 * along.dot(&before).max(0.0)))
                .try_normalize(0.1)
                .unwrap_or(along),
        };
        let curve = Curve::new(
            [nodes[parent.index()].position, node.position],
            leaves,
            arrives[i],
            curl,
            &mut generator(seed, node.name.0.into()),
        );
        // A trunk was filmed all along, and is as straight as it looks.
        let curve = if limb_of[parent.index()].is_none() {
            curve.calmer(0.3)
        } else {
            curve
        };
        let own = NodeId(i as u32);
        let station = |k: u32| {
            let t = f64::from(k) / f64::from(PIECES);
            let riding = Riding::between(parent, own, own_share(t));
            Station {
                at: curve.at(t),
                radius: 0.0,
                riding,
            }
        };
        let stations = (0..=PIECES).map(station).collect();
        let limb = Limb {
            node: own,
            parent: limb_of[i],
            twig: false,
            stations,
        };
        limb_of[i] = Some(out.len());
        out.push(Grown { limb, at: 1.0 });
    }
    out
}

/// Share of the branch's own joint at share `t` of its length: none at the pivot, which neither
/// joint moves, all at its end.
///
/// A branch that has turned by a small angle a is so bent as a beam is that is held in its parent's
/// direction at its base and in its own child's at its end: off the straight line by `a (2 t^2 -
/// t^3)` of its length. Its bending angle follows the bending moment from piece to piece (Hu et al.
/// 2017, section 6, fig. 13), and it meets the next without a crease.
fn own_share(t: f64) -> f32 {
    let t = t.clamp(0.0, 1.0);
    (t * (2.0 - t)) as f32
}

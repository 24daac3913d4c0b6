//! How thick the branches are: the pipe model.

use super::chain::leaves;
use super::limb::{Grown, Room, limbs};
use crate::config;
use crate::model::Skeleton;

/// Exponent e of `r_parent^e = sum r_child^e`, from and to. Shinozaki's pipes and Leonardo's rule
/// give 2, measured trees 2 to 3.
pub const PIPE_EXPONENTS: [f64; 2] = [1.8, 3.0];
/// Radius of the last twig, px at 640 px picture width.
pub const TIP_RADIUS_PX: f64 = 0.6;
/// A branch at whose end no twig stands counts as a pipe for each so many px of its length at 640
/// px picture width.
const PIPE_PX: f64 = 12.0;
/// Share of a branch's length over which the pipes of what leaves it on its way join it.
const JOINS_WITHIN: f64 = 0.3;
/// A branch stays as thick as it is up to the fork at its end; what goes on there loses the rest
/// within so many radii.
const SHOULDER_RADII: f64 = 2.0;
/// Power with which a limb that ends runs out, and what is left of the last twig's radius there.
const TIP_TAPER: f64 = 0.7;
const TIP_END: f64 = 0.4;
/// How much wider a trunk is at the ground, and the share of its length over which that is lost.
const ROOT_FLARE: f64 = 0.3;
const FLARE_WITHIN: f64 = 0.2;

/// Gives every node the radius (px) of the branch that ends there, at the middle of its length:
/// `trunk_radius_px` for the trunk, thinner with every branch and twig that leaves, never below
/// [`TIP_RADIUS_PX`] unless the trunk is. Twigs count as pipes: they are those that [`limbs`] adds
/// with the same arguments.
pub fn thicken(
    skeleton: &mut Skeleton,
    trunk_radius_px: f64,
    room: Room,
    wood: &config::Wood,
    seed: u64,
) {
    let trunk = if trunk_radius_px.is_finite() {
        trunk_radius_px.max(0.0)
    } else {
        0.0
    };
    skeleton.nodes.iter_mut().for_each(|n| n.radius = trunk);
    for limb in limbs(skeleton, room, wood, seed).iter().filter(|l| !l.twig) {
        if let Some(node) = skeleton
            .nodes
            .get_mut(limb.node.index())
            .filter(|n| n.level > 1)
        {
            node.radius = limb.stations[limb.stations.len() / 2].radius;
        }
    }
    for i in 0..skeleton.nodes.len() {
        let parent = skeleton.nodes[i].parent.filter(|p| p.index() < i);
        if let Some(parent) = parent.map(|p| skeleton.nodes[p.index()].radius) {
            skeleton.nodes[i].radius = skeleton.nodes[i].radius.min(parent);
        }
    }
}

/// Thickness along every limb: `r = r_trunk (pipes above / pipes of the tree)^(1/e)`, where a twig
/// that carries nothing is one pipe, and a branch one for each [`PIPE_PX`] of its length. What
/// leaves joins gradually, so that no limb has a step, and a limb ends as thick as the one begins
/// that it goes on in.
///
/// Copies count as what they are drawn as: a trunk whose copies were left out would be too thin for
/// all that it carries, and its branches, as thick as if there were one plane, too thick for it.
pub(super) fn by_pipes(grown: &mut [Grown], skeleton: &Skeleton, trunk_radius_px: f64) {
    let trunk = if trunk_radius_px.is_finite() {
        trunk_radius_px.max(0.0)
    } else {
        0.0
    };
    let tip = (TIP_RADIUS_PX * f64::from(skeleton.image_size.width) / 640.0).min(trunk);
    let mut bearing = vec![Bearing::default(); grown.len()];
    for i in (0..grown.len()).rev() {
        let limb = &grown[i].limb;
        // A branch that was followed is seen, so it is no hair, even where no twig has room on it.
        let alone_px = PIPE_PX * f64::from(skeleton.image_size.width) / 640.0;
        let least = if limb.twig {
            1.0
        } else {
            (limb.length() / alone_px).max(1.0)
        };
        let own = bearing[i].settle(least);
        let Some(p) = grown[i].limb.parent.filter(|&p| p < i) else {
            continue;
        };
        bearing[p].leaving.push(Leaving {
            at: grown[i].at,
            pipes: own,
        });
    }
    let roots = grown
        .iter()
        .zip(&bearing)
        .filter(|(g, _)| g.limb.parent.is_none());
    let total = roots.map(|(_, b)| b.pipes(0.0)).fold(1.0, f64::max);
    // The exponent with which one pipe is as thick as the last twig.
    let fits = total.max(1.1).ln() / (trunk / tip.max(1e-9)).max(1.1).ln();
    let exponent = fits.clamp(PIPE_EXPONENTS[0], PIPE_EXPONENTS[1]);
    let thick = |pipes: f64| (trunk * (pipes / total).powf(1.0 / exponent)).max(tip);
    let end = TIP_END * tip;
    let goes_on_from = heirs(grown, |k| thick(bearing[k].pipes(0.0)));
    for (i, bearing) in bearing.iter().enumerate() {
        let (earlier, rest) = grown.split_at_mut(i);
        let Some(Grown { limb, at }) = rest.first_mut() else {
            continue;
        };
        let most = limb
            .parent
            .and_then(|p| earlier.get(p))
            .map(|p| p.limb.radius_at(*at));
        let last = limb.stations.len().saturating_sub(1).max(1) as f64;
        let own = thick(bearing.pipes(0.0));
        let shoulder = most
            .filter(|_| goes_on_from[i])
            .map_or(0.0, |most| (most - own).max(0.0));
        let within = (SHOULDER_RADII * (own + shoulder) / limb.length().max(1e-9)).clamp(1e-9, 0.5);
        for (k, station) in limb.stations.iter_mut().enumerate() {
            let t = k as f64 / last;
            let mut radius = thick(bearing.pipes(t));
            if !bearing.goes_on {
                radius = end + (radius - end) * (1.0 - t).powf(TIP_TAPER);
            }
            if limb.parent.is_none() {
                radius *= 1.0 + ROOT_FLARE * (1.0 - t / FLARE_WITHIN).max(0.0).powi(2);
            }
            radius += shoulder * (1.0 - t / within).max(0.0).powi(2);
            // No thicker than what it grows from.
            station.radius = most.map_or(radius, |most| radius.min(most));
        }
    }
}

/// Whether each limb is the one that another goes on in, as chains are put together: a thick one
/// that is straight.
fn heirs(grown: &[Grown], thick: impl Fn(usize) -> f64) -> Vec<bool> {
    let mut best: Vec<Option<(f64, usize)>> = vec![None; grown.len()];
    for (i, Grown { limb, .. }) in grown
        .iter()
        .enumerate()
        .filter(|(_, g)| g.at >= 1.0 && g.limb.stations.len() >= 2)
    {
        let Some(p) = limb.parent.filter(|&p| p < i) else {
            continue;
        };
        let score = thick(i) * (2.0 + grown[p].limb.arrives().dot(&leaves(limb)));
        if best[p].is_none_or(|(most, _)| score > most) {
            best[p] = Some((score, i));
        }
    }
    let mut out = vec![false; grown.len()];
    best.into_iter().flatten().for_each(|(_, i)| out[i] = true);
    out
}

/// What a limb carries.
#[derive(Clone, Debug, Default)]
struct Bearing {
    leaving: Vec<Leaving>,
    /// Pipes that its end has, with all that leaves there.
    end: f64,
    goes_on: bool,
}

/// Where along a limb (0 to 1) how many pipes leave.
#[derive(Clone, Copy, Debug)]
struct Leaving {
    at: f64,
    pipes: f64,
}

impl Bearing {
    /// Takes what is at the end out of what leaves, once all is known, and gives the pipes at the
    /// base; an end where nothing goes on has `alone`.
    fn settle(&mut self, alone: f64) -> f64 {
        let at_end = |l: &Leaving| l.at >= 1.0;
        self.goes_on = self.leaving.iter().any(at_end);
        let end: f64 = self
            .leaving
            .iter()
            .filter(|l| at_end(l))
            .map(|l| l.pipes)
            .sum();
        self.end = if self.goes_on { end } else { alone };
        self.leaving.retain(|l| !at_end(l));
        self.pipes(0.0)
    }

    /// Pipes at share `t` of the limb.
    fn pipes(&self, t: f64) -> f64 {
        let half = 0.5 * JOINS_WITHIN;
        let joined = |l: &Leaving| {
            l.pipes * ((l.at.clamp(half, 1.0 - half) - t) / JOINS_WITHIN + 0.5).clamp(0.0, 1.0)
        };
        self.end + self.leaving.iter().map(joined).sum::<f64>()
    }
}

//! How thick the branches are: the pipe model.

use super::branches::continuations;
use super::limb::{Grown, Limb};
use crate::bounds::Bounds;
use crate::model::{NodeKind, Skeleton};

/// Exponent e of `r_parent^e = sum r_child^e`, from and to. Shinozaki's pipes and Leonardo's rule
/// give 2, measured trees 2 to 3.
pub const PIPE_EXPONENTS: Bounds = Bounds::new(1.8, 3.0);
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

/// A radius as it was measured; 0 for what is no number.
pub(super) fn sound(radius_px: f64) -> f64 {
    if radius_px.is_finite() {
        radius_px.max(0.0)
    } else {
        0.0
    }
}

/// [`TIP_RADIUS_PX`] in this picture, px.
fn tip_px(skeleton: &Skeleton) -> f64 {
    TIP_RADIUS_PX * f64::from(skeleton.image_size.width) / 640.0
}

/// Thickness along every limb: `r = r_trunk (pipes above / pipes of the tree)^(1/e)`, where a twig
/// that carries nothing is one pipe, and a branch one for each [`PIPE_PX`] of its length. What
/// leaves joins gradually, so that no limb has a step, and a limb ends as thick as the one begins
/// that it goes on in.
///
/// Copies count as what they are drawn as: a trunk whose copies were left out would be too thin for
/// all that it carries, and its branches, as thick as if there were one plane, too thick for it.
pub(super) fn by_pipes(grown: &mut [Grown], skeleton: &Skeleton, trunk_radius_px: f64) {
    let width_px = f64::from(skeleton.image_size.width);
    let bearing = bearings(grown, PIPE_PX * width_px / 640.0);
    let mut total = 1.0;
    for (g, bearing) in grown.iter().zip(&bearing) {
        if g.limb.parent.is_none() {
            total = f64::max(total, bearing.pipes(0.0));
        }
    }
    let model = PipeModel::new(sound(trunk_radius_px), tip_px(skeleton), total);
    let goes_on_from = heirs(grown, &bearing, &model);
    for (i, bearing) in bearing.iter().enumerate() {
        let (earlier, rest) = grown.split_at_mut(i);
        let Some(Grown { limb, at }) = rest.first_mut() else {
            continue;
        };
        let parent = limb.parent.and_then(|p| earlier.get(p));
        let most = parent.map(|p| p.limb.radius_at(*at));
        model.assign_radii(limb, bearing, most, goes_on_from[i]);
    }
}

/// Thickness of the branches whose wood the picture shows: from node to node as the skeleton says, and to
/// a twig's at a tip. One that leaves another begins so thick that its middle is as thick as it is seen. An
/// unseen branch in which a seen one goes on begins as thick as that ends. Others stay as thick as they are,
/// and like twigs no thicker than what they grow from.
pub(super) fn as_seen(grown: &mut [Grown], skeleton: &Skeleton) {
    if skeleton.nodes.iter().all(|n| n.kind != NodeKind::Traced) {
        return;
    }
    let mut is_seen = vec![false; skeleton.nodes.len()];
    for node in skeleton.nodes.iter().filter(|n| n.kind == NodeKind::Traced) {
        is_seen[node.parent.map_or(0, |p| p.index())] = true;
    }
    for (seen, node) in is_seen.iter_mut().zip(&skeleton.nodes) {
        *seen |= node.kind == NodeKind::Traced;
    }
    let goes_on = continuations(skeleton);
    for i in 0..grown.len() {
        let (earlier, rest) = grown.split_at_mut(i);
        let Some(Grown { limb, at }) = rest.first_mut() else {
            continue;
        };
        let own = skeleton.nodes.get(limb.node.index());
        match own.filter(|_| !limb.twig && is_seen[limb.node.index()]) {
            Some(node) => {
                let to = match goes_on[limb.node.index()] {
                    Some(_) => node.radius,
                    None => node.radius.min(tip_px(skeleton)),
                };
                let parent = node.parent.map(|p| p.index());
                let below = parent
                    .map(|p| skeleton.nodes[p].radius)
                    .filter(|radius| *radius > 0.0)
                    .unwrap_or(node.radius);
                let leaves = parent.is_some_and(|p| goes_on[p] != Some(limb.node));
                // One that leaves another has its own radius in its middle.
                let from = if leaves {
                    below.min(2.0 * node.radius - to)
                } else {
                    below
                };
                taper(limb, from, to);
            }
            None => {
                let parent = limb.parent.and_then(|p| earlier.get(p));
                let most = parent.map_or(f64::INFINITY, |p| p.limb.radius_at(*at));
                let of_branch = parent.filter(|_| !limb.twig);
                let heir = of_branch.and_then(|p| goes_on[p.limb.node.index()]);
                if heir == Some(limb.node) {
                    begin_as_thick(limb, most);
                }
                for sample in &mut limb.samples {
                    sample.radius = sample.radius.min(most);
                }
            }
        }
    }
}

/// At its base as thick as `from`, px, and evenly less thickened towards its end.
fn begin_as_thick(limb: &mut Limb, from: f64) {
    let last = limb.samples.len().saturating_sub(1).max(1) as f64;
    let end = limb.samples.last().map_or(0.0, |sample| sample.radius);
    for (k, sample) in limb.samples.iter_mut().enumerate() {
        let even = from + (end - from) * k as f64 / last;
        sample.radius = sample.radius.max(even);
    }
}

/// Evenly from one radius to another, px.
fn taper(limb: &mut Limb, from: f64, to: f64) {
    let last = limb.samples.len().saturating_sub(1).max(1) as f64;
    for (k, sample) in limb.samples.iter_mut().enumerate() {
        sample.radius = from + (to - from) * k as f64 / last;
    }
}

/// What every limb carries; a branch at whose end no twig stands counts as a pipe for each
/// `pipe_px` of its length.
fn bearings(grown: &[Grown], pipe_px: f64) -> Vec<Bearing> {
    let mut bearing = vec![Bearing::default(); grown.len()];
    for (i, Grown { limb, at }) in grown.iter().enumerate().rev() {
        // A branch that was followed is seen, so it is no hair, even where no twig has room on it.
        let alone = if limb.twig {
            1.0
        } else {
            (limb.length() / pipe_px).max(1.0)
        };
        let pipes = bearing[i].settle(alone);
        if let Some(p) = limb.parent.filter(|&p| p < i) {
            bearing[p].leaving.push(Leaving { at: *at, pipes });
        }
    }
    bearing
}

/// From pipes to radii, px.
struct PipeModel {
    trunk: f64,
    tip: f64,
    /// Pipes of the whole tree.
    total: f64,
    exponent: f64,
}

impl PipeModel {
    fn new(trunk: f64, tip: f64, total: f64) -> Self {
        let tip = tip.min(trunk);
        // The exponent with which one pipe is as thick as the last twig.
        let fits = total.max(1.1).ln() / (trunk / tip.max(1e-9)).max(1.1).ln();
        Self {
            trunk,
            tip,
            total,
            exponent: PIPE_EXPONENTS.clamp(fits),
        }
    }

    fn radius(&self, pipes: f64) -> f64 {
        (self.trunk * (pipes / self.total).powf(1.0 / self.exponent)).max(self.tip)
    }

    /// Gives every sample of `limb` its radius. `most` is that of what it grows from, where it
    /// does; `is_continuation` says that its parent goes on in it.
    fn assign_radii(
        &self,
        limb: &mut Limb,
        bearing: &Bearing,
        most: Option<f64>,
        is_continuation: bool,
    ) {
        let own = self.radius(bearing.pipes(0.0));
        let shoulder = match most {
            Some(most) if is_continuation => (most - own).max(0.0),
            _ => 0.0,
        };
        let within = (SHOULDER_RADII * (own + shoulder) / limb.length().max(1e-9)).clamp(1e-9, 0.5);
        let end = TIP_END * self.tip;
        let last = limb.samples.len().saturating_sub(1).max(1) as f64;
        for (k, sample) in limb.samples.iter_mut().enumerate() {
            let t = k as f64 / last;
            let mut radius = self.radius(bearing.pipes(t));
            if !bearing.goes_on {
                radius = end + (radius - end) * (1.0 - t).powf(TIP_TAPER);
            }
            if limb.parent.is_none() {
                radius *= 1.0 + ROOT_FLARE * (1.0 - t / FLARE_WITHIN).max(0.0).powi(2);
            }
            radius += shoulder * (1.0 - t / within).max(0.0).powi(2);
            // No thicker than what it grows from.
            sample.radius = most.map_or(radius, |most| radius.min(most));
        }
    }
}

/// Whether each limb is the one that another goes on in, as chains are put together: a thick one
/// that is straight.
fn heirs(grown: &[Grown], bearing: &[Bearing], model: &PipeModel) -> Vec<bool> {
    let mut best: Vec<Option<(f64, usize)>> = vec![None; grown.len()];
    for (i, Grown { limb, at }) in grown.iter().enumerate() {
        if *at < 1.0 || limb.samples.len() < 2 {
            continue;
        }
        let Some(p) = limb.parent.filter(|&p| p < i) else {
            continue;
        };
        let thick = model.radius(bearing[i].pipes(0.0));
        let score = thick * (2.0 + grown[p].limb.arrives().dot(&limb.departs()));
        if best[p].is_none_or(|(most, _)| score > most) {
            best[p] = Some((score, i));
        }
    }
    let mut out = vec![false; grown.len()];
    for (_, i) in best.into_iter().flatten() {
        out[i] = true;
    }
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
        let (at_end, on_the_way): (Vec<Leaving>, Vec<Leaving>) =
            self.leaving.iter().copied().partition(|l| l.at >= 1.0);
        self.goes_on = !at_end.is_empty();
        self.end = if self.goes_on {
            at_end.iter().map(|l| l.pipes).sum()
        } else {
            alone
        };
        self.leaving = on_the_way;
        self.pipes(0.0)
    }

    /// Pipes at share `t` of the limb.
    fn pipes(&self, t: f64) -> f64 {
        let on_the_way: f64 = self.leaving.iter().map(|l| l.joined(t)).sum();
        self.end + on_the_way
    }
}

impl Leaving {
    /// How many of the pipes are still in the limb at share `t` of it.
    fn joined(&self, t: f64) -> f64 {
        let half = 0.5 * JOINS_WITHIN;
        let share = (self.at.clamp(half, 1.0 - half) - t) / JOINS_WITHIN + 0.5;
        self.pipes * share.clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config;
    use crate::model::{Node, Size};
    use crate::shape::limbs;

    /// A trunk of 9 to 8 px, a limb of 6 px in which it goes on, what goes on unseen in that, and a traced
    /// branch of 5 px that ends.
    fn traced() -> Skeleton {
        let node = |name: u32, parent: u32, at: [f64; 3], radius: f64, kind: NodeKind| Node {
            radius,
            kind,
            level: name as u8,
            ..Node::made_up(name, Some(parent), at)
        };
        Skeleton {
            nodes: vec![
                Node {
                    radius: 9.0,
                    ..Node::made_up(0, None, [0.0; 3])
                },
                node(1, 0, [0.0, 100.0, 0.0], 8.0, NodeKind::Traced),
                node(2, 1, [0.0, 150.0, 0.0], 6.0, NodeKind::Traced),
                node(3, 2, [10.0, 250.0, 0.0], 1.0, NodeKind::Measured),
                node(4, 1, [60.0, 140.0, 0.0], 5.0, NodeKind::Traced),
            ],
            foot_px: [320.0, 350.0].into(),
            image_size: Size::new(640, 360),
        }
    }

    #[test]
    fn wood_tapers_to_its_tips_and_into_what_is_not_seen() {
        let bare = config::Wood {
            max_twigs: 0,
            ..config::Wood::default()
        };
        let all = limbs(&traced(), &|_, _| true, &bare, 1);
        let radii = |node: usize| -> Vec<f64> {
            let limb = all.iter().find(|limb| limb.node.index() == node);
            let samples = &limb.expect("a limb").samples;
            samples.iter().map(|sample| sample.radius).collect()
        };
        let trunk = radii(1);
        assert!((trunk[0] - 9.0).abs() < 1e-9, "{trunk:?}");
        assert!((trunk[trunk.len() - 1] - 8.0).abs() < 1e-9, "{trunk:?}");
        let unseen = radii(3);
        assert!((unseen[0] - 6.0).abs() < 1e-9, "{unseen:?}");
        let steps = unseen.windows(2).map(|r| r[0] - r[1]);
        assert!(
            steps.into_iter().all(|step| (0.0..1.5).contains(&step)),
            "{unseen:?}"
        );
        let ends = radii(4);
        assert!(ends[ends.len() - 1] <= TIP_RADIUS_PX, "{ends:?}");
        assert!(ends[0] > 5.0, "{ends:?}");
        // A thin one does not begin as thick as the trunk: it is as thick as seen in its middle.
        let mut thin = traced();
        thin.nodes[4].radius = 2.0;
        let all = limbs(&thin, &|_, _| true, &bare, 1);
        let limb = all.iter().find(|limb| limb.node.index() == 4);
        let samples = &limb.expect("a limb").samples;
        let mean = samples.iter().map(|s| s.radius).sum::<f64>() / samples.len() as f64;
        assert!((mean - 2.0).abs() < 1e-9, "{mean}");
    }
}

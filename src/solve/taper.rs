//! How thick the branches are whose wood is seen: widths as the picture shows them, evened out so
//! that no branch grows thicker towards its tip.

use crate::model::{Node, NodeId, RADIUS_SHARE};
use crate::shape::TIP_RADIUS_PX;

/// Radii go with the length of wood that a branch bears to this power: the pipe model with da Vinci's
/// exponent of 2.5, as for wood that is not seen.
const PIPE_POWER: f64 = 1.0 / 2.5;
/// So much thicker than the pipe model has it, with the constant of this tree, a branch may be. Where
/// branches lie side by side, the picture shows them as one that is thicker.
const WITHIN_PIPES: f64 = 1.3;
/// A tip whose width is not seen is as thick as its branch is so far below it, px.
const END_PX: f64 = 8.0;
/// Wood that a tip bears besides what is drawn, px.
const TIP_BORNE_PX: f64 = 3.0;

/// A radius that is seen along some length of wood.
#[derive(Clone, Copy, Debug)]
struct Measure {
    radius_px: f64,
    length_px: f64,
}

/// A stretch of an axis with one radius: the median of what is seen along it.
#[derive(Clone, Debug)]
struct Stretch {
    radius_px: f64,
    /// One a node.
    measures: Vec<Measure>,
}

impl Stretch {
    fn of(measures: Vec<Measure>) -> Self {
        Self {
            radius_px: weighted_median(measures.clone()),
            measures,
        }
    }
}

/// Sets the radii from those that are seen, px, by node. Along an axis from its fork to its tip
/// they are the best that do not grow (isotonic regression by pooling adjacent violators, Ayer et
/// al. 1955, with medians weighted by length, Robertson and Waltman 1968): where a line of wood begins
/// or ends, or others lie beside it, its width is no measure.
/// What is not seen is no thinner than what grows from it, and no branch is thicker than what it
/// grows from.
pub(super) fn taper(nodes: &mut [Node], seen_px: &[Option<f64>]) {
    let seen = |i: usize| seen_at(seen_px, i);
    for axis in axes(nodes) {
        let on_wood: Vec<usize> = axis
            .iter()
            .copied()
            .filter(|i| seen(*i).is_some())
            .collect();
        let mut measures = Vec::with_capacity(on_wood.len());
        for &i in &on_wood {
            measures.push(Measure {
                radius_px: seen(i).unwrap_or(0.0),
                length_px: edge_px(nodes, i),
            });
        }
        for (&i, radius_px) in on_wood.iter().zip(falling(&measures)) {
            nodes[i].radius = radius_px;
        }
    }
    for node in nodes.iter_mut() {
        node.radius = node.radius.max(TIP_RADIUS_PX);
    }
    for i in (1..nodes.len()).rev() {
        let own = nodes[i].radius;
        if let Some(parent) = nodes[i].parent.filter(|p| seen(p.index()).is_none()) {
            nodes[parent.index()].radius = nodes[parent.index()].radius.max(own);
        }
    }
    for i in 1..nodes.len() {
        if let Some(parent) = nodes[i].parent.filter(|p| p.index() > 0) {
            nodes[i].radius = nodes[i].radius.min(nodes[parent.index()].radius);
        }
    }
}

/// The radii of branches that a photograph shows, from those that are seen, px, by node: as [`taper`] has
/// them, and of a bare tree [`within_pipes`]. Where none is seen a branch begins with
/// [`RADIUS_SHARE`] of its parent's (Tan et al. 2008 sect. 2.2) and tapers to its tip.
pub fn assign_seen_radii(nodes: &mut [Node], seen_px: &[Option<f64>], is_bare: bool) {
    match is_bare {
        true => taper(nodes, &within_pipes(nodes, seen_px)),
        false => taper(nodes, seen_px),
    }
    let reach_px = reach_px(nodes);
    for i in 1..nodes.len() {
        let parent = nodes[i].parent.map(NodeId::index).filter(|p| *p > 0);
        if let (Some(parent), None) = (parent, seen_at(seen_px, i)) {
            let below_px = nodes[parent].radius;
            let goes_on = reach_px[i] + edge_px(nodes, i) >= reach_px[parent];
            let unseen_px = match goes_on {
                true => below_px * ((reach_px[i] + END_PX) / (reach_px[parent] + END_PX)).sqrt(),
                false => RADIUS_SHARE * below_px,
            };
            nodes[i].radius = nodes[i].radius.max(unseen_px);
        }
    }
    if let [foot, first, ..] = nodes {
        foot.radius = first.radius;
    }
}

/// The radius that is seen at a node, px; a tree without wood has none.
fn seen_at(seen_px: &[Option<f64>], node: usize) -> Option<f64> {
    seen_px.get(node).copied().flatten()
}

/// The radii that are seen, px, by node, but no thicker than the pipe model allows, whose constant is the median
/// over this tree's wood. All of its wood must be seen: limbs of a tree in leaf bear more than what is.
pub(super) fn within_pipes(nodes: &[Node], seen_px: &[Option<f64>]) -> Vec<Option<f64>> {
    let mut borne_px: Vec<f64> = (0..nodes.len()).map(|i| edge_px(nodes, i)).collect();
    for i in (1..nodes.len()).rev() {
        if let Some(parent) = nodes[i].parent.map(NodeId::index).filter(|p| *p < i) {
            borne_px[parent] += borne_px[i];
        }
    }
    let mut constants = Vec::new();
    let mut pipes_px = Vec::with_capacity(nodes.len());
    for (i, borne_px) in borne_px.into_iter().enumerate() {
        let length_px = edge_px(nodes, i);
        // At the middle of the edge; a tip bears leaves.
        let borne_px = borne_px - 0.5 * length_px + TIP_BORNE_PX;
        let pipe_px = borne_px.powf(PIPE_POWER);
        constants.extend(seen_at(seen_px, i).map(|seen_px| Measure {
            radius_px: seen_px / pipe_px,
            length_px,
        }));
        pipes_px.push(pipe_px);
    }
    let most = WITHIN_PIPES * weighted_median(constants);
    let mut within = Vec::with_capacity(nodes.len());
    for (i, pipe_px) in pipes_px.into_iter().enumerate() {
        within.push(seen_at(seen_px, i).map(|px| px.min(most * pipe_px)));
    }
    within
}

/// The radii nearest to those that are seen that do not grow, one for each.
fn falling(measures: &[Measure]) -> Vec<f64> {
    let mut pooled: Vec<Stretch> = Vec::new();
    for measure in measures {
        let mut last = Stretch::of(vec![*measure]);
        while let Some(mut before) = pooled.pop_if(|before| before.radius_px < last.radius_px) {
            before.measures.append(&mut last.measures);
            last = Stretch::of(before.measures);
        }
        pooled.push(last);
    }
    let radii = pooled
        .iter()
        .flat_map(|stretch| std::iter::repeat_n(stretch.radius_px, stretch.measures.len()));
    radii.collect()
}

/// The radius that half of the length has less than, and half more; 0 of none.
fn weighted_median(mut measures: Vec<Measure>) -> f64 {
    measures.sort_by(|a, b| a.radius_px.total_cmp(&b.radius_px));
    let half_px = 0.5 * measures.iter().map(|m| m.length_px).sum::<f64>();
    let mut below_px = 0.0;
    for (k, measure) in measures.iter().enumerate() {
        below_px += measure.length_px;
        // Exactly half way it is between two.
        if below_px == half_px && k + 1 < measures.len() {
            return 0.5 * (measure.radius_px + measures[k + 1].radius_px);
        }
        if below_px > half_px {
            return measure.radius_px;
        }
    }
    measures.last().map_or(0.0, |last| last.radius_px)
}

/// The axes of the tree: at every fork an axis goes on in the child from which it is farthest to a
/// tip, and the others begin axes of their own.
fn axes(nodes: &[Node]) -> Vec<Vec<usize>> {
    let reach_px = reach_px(nodes);
    let mut next: Vec<Option<usize>> = vec![None; nodes.len()];
    for i in (1..nodes.len()).rev() {
        let Some(parent) = nodes[i].parent.map(NodeId::index).filter(|p| *p < i) else {
            continue;
        };
        if next[parent].is_none() && reach_px[i] + edge_px(nodes, i) >= reach_px[parent] {
            next[parent] = Some(i);
        }
    }
    let mut axes = Vec::new();
    for (i, node) in nodes.iter().enumerate().skip(1) {
        let goes_on = node.parent.and_then(|p| next[p.index()]) == Some(i);
        if goes_on && node.parent != Some(NodeId(0)) {
            continue;
        }
        axes.push(std::iter::successors(Some(i), |at| next[*at]).collect());
    }
    axes
}

/// How far it is from each node to the farthest tip beyond it, px.
fn reach_px(nodes: &[Node]) -> Vec<f64> {
    let mut reach_px = vec![0.0_f64; nodes.len()];
    for i in (1..nodes.len()).rev() {
        if let Some(parent) = nodes[i].parent.map(NodeId::index).filter(|p| *p < i) {
            reach_px[parent] = reach_px[parent].max(reach_px[i] + edge_px(nodes, i));
        }
    }
    reach_px
}

/// Length of the edge that ends in a node.
fn edge_px(nodes: &[Node], i: usize) -> f64 {
    let parent = nodes[i].parent.and_then(|p| nodes.get(p.index()));
    parent.map_or(0.0, |p| (nodes[i].position - p.position).norm())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(parent: Option<u32>, x: f64, y: f64) -> Node {
        Node::made_up(0, parent, [x, y, 0.0])
    }

    /// A trunk of five pieces and a branch that leaves its third.
    fn tree() -> Vec<Node> {
        let mut nodes = vec![node(None, 0.0, 0.0)];
        for k in 1..=5 {
            nodes.push(node(Some(k - 1), 0.0, 20.0 * f64::from(k)));
        }
        nodes.push(node(Some(3), 15.0, 70.0));
        nodes.push(node(Some(6), 30.0, 80.0));
        nodes
    }

    fn radii(nodes: &[Node]) -> Vec<f64> {
        nodes.iter().map(|n| n.radius).collect()
    }

    #[test]
    fn a_thin_begin_does_not_make_the_tree_thin() {
        let mut nodes = tree();
        let seen = [
            None,
            Some(1.0),
            Some(10.0),
            Some(9.0),
            Some(8.0),
            Some(6.0),
            Some(4.0),
            None,
        ];
        taper(&mut nodes, &seen);
        let radii = radii(&nodes);
        assert!(radii[1] > 6.0, "{radii:?}");
        assert_eq!(radii[5], 6.0);
        assert_eq!(radii[6], 4.0);
        assert_eq!(radii[7], 1.0);
    }

    #[test]
    fn no_branch_grows_thicker_towards_its_tip() {
        let mut nodes = tree();
        let seen = [
            None,
            Some(6.0),
            None,
            Some(9.0),
            Some(3.0),
            Some(5.0),
            Some(20.0),
            Some(2.0),
        ];
        taper(&mut nodes, &seen);
        for (i, node) in nodes.iter().enumerate().skip(2) {
            let parent = nodes[node.parent.expect("a parent").index()].radius;
            assert!(node.radius <= parent, "{i}: {:?}", radii(&nodes));
        }
        assert_eq!(nodes[4].radius, 4.0);
        assert_eq!(nodes[5].radius, 4.0);
    }

    /// Two that are hidden, one after the other, made all beyond them as thin as a twig.
    #[test]
    fn what_is_hidden_along_a_limb_does_not_make_its_end_thin() {
        let mut nodes = tree();
        let seen = [
            None,
            Some(9.0),
            None,
            None,
            Some(7.0),
            Some(6.0),
            None,
            None,
        ];
        taper(&mut nodes, &seen);
        assert_eq!(radii(&nodes)[1..6], [9.0, 7.0, 7.0, 7.0, 6.0]);
    }

    /// Two branches side by side that are seen as one do not make a thick one.
    #[test]
    fn no_branch_is_much_thicker_than_the_wood_that_it_bears_asks_for() {
        let mut nodes = tree();
        let seen = [10.0, 9.5, 8.5, 7.5, 7.0, 4.0, 6.0, 6.0];
        let mut seen_px = vec![None];
        seen_px.extend(seen[1..].iter().copied().map(Some));
        let within = within_pipes(&nodes, &seen_px);
        assert_eq!(within[1..5], seen_px[1..5]);
        let tip_px = within[7].expect("a radius");
        assert!((3.0..5.5).contains(&tip_px), "{tip_px}");
        taper(&mut nodes, &within);
        assert!(nodes[7].radius <= tip_px, "{:?}", radii(&nodes));
    }

    /// A trunk before a shrub of its colours is seen as thin as the stroke along it: the wood above says more.
    #[test]
    fn a_photographed_trunk_that_is_hidden_below_does_not_make_a_wire() {
        let mut nodes = tree();
        let seen = [
            None,
            Some(1.5),
            Some(1.5),
            Some(7.0),
            Some(7.0),
            Some(6.0),
            None,
            None,
        ];
        assign_seen_radii(&mut nodes, &seen, false);
        let radii = radii(&nodes);
        assert!(radii[..4].iter().all(|px| *px >= 6.0), "{radii:?}");
        assert_eq!(radii[5], 6.0);
        // The branch whose width is not seen begins with a share of the trunk's, and tapers.
        assert_eq!(radii[6], RADIUS_SHARE * radii[3]);
        assert!((1.0..radii[6]).contains(&radii[7]), "{radii:?}");
    }

    #[test]
    fn without_wood_nothing_changes() {
        let mut nodes = tree();
        taper(&mut nodes, &[None; 8]);
        assert_eq!(radii(&nodes), [1.0; 8]);
    }
}

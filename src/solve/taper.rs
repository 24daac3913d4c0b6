//! How thick the branches are whose wood is seen: widths as the picture shows them, evened out so
//! that no branch grows thicker towards its tip.

use crate::model::{Node, NodeId};
use crate::shape::TIP_RADIUS_PX;

/// A stretch of an axis with one radius.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    radius_px: f64,
    length_px: f64,
    nodes: usize,
}

/// Sets the radii from those that are seen, px, by node. Along an axis from its fork to its tip
/// they are the best that do not grow (isotonic regression by pooling adjacent violators, Ayer et
/// al. 1955, weighted by length): where a line of wood begins or ends, its width is no measure.
/// What is not seen is no thinner than what grows from it, and no branch is thicker than what it
/// grows from.
pub(super) fn taper(nodes: &mut [Node], seen_px: &[Option<f64>]) {
    let seen = |i: usize| seen_px.get(i).copied().flatten();
    for axis in axes(nodes) {
        let on_wood: Vec<usize> = axis
            .iter()
            .copied()
            .filter(|i| seen(*i).is_some())
            .collect();
        let mut stretches = Vec::with_capacity(on_wood.len());
        for &i in &on_wood {
            stretches.push(Stretch {
                radius_px: seen(i).unwrap_or(0.0),
                length_px: edge_px(nodes, i),
                nodes: 1,
            });
        }
        for (&i, radius_px) in on_wood.iter().zip(falling(&stretches)) {
            nodes[i].radius = radius_px;
        }
    }
    for node in nodes.iter_mut() {
        node.radius = node.radius.max(TIP_RADIUS_PX);
    }
    for i in (1..nodes.len()).rev() {
        let own = nodes[i].radius;
        if let (Some(parent), Some(_)) = (nodes[i].parent, seen(i))
            && seen(parent.index()).is_none()
        {
            nodes[parent.index()].radius = nodes[parent.index()].radius.max(own);
        }
    }
    for i in 1..nodes.len() {
        if let Some(parent) = nodes[i].parent.filter(|p| p.index() > 0) {
            nodes[i].radius = nodes[i].radius.min(nodes[parent.index()].radius);
        }
    }
}

/// The radii nearest to those of the stretches that do not grow, one for each node.
fn falling(stretches: &[Stretch]) -> Vec<f64> {
    let mut pooled: Vec<Stretch> = Vec::new();
    for stretch in stretches {
        let mut last = *stretch;
        while let Some(before) = pooled.pop_if(|before| before.radius_px < last.radius_px) {
            let length_px = before.length_px + last.length_px;
            let area = before.radius_px * before.length_px + last.radius_px * last.length_px;
            last = Stretch {
                radius_px: area / length_px.max(f64::MIN_POSITIVE),
                length_px,
                nodes: before.nodes + last.nodes,
            };
        }
        pooled.push(last);
    }
    let radii = pooled
        .iter()
        .flat_map(|stretch| std::iter::repeat_n(stretch.radius_px, stretch.nodes));
    radii.collect()
}

/// The axes of the tree: at every fork an axis goes on in the child from which it is farthest to a
/// tip, and the others begin axes of their own.
fn axes(nodes: &[Node]) -> Vec<Vec<usize>> {
    let mut reach_px = vec![0.0_f64; nodes.len()];
    let mut next: Vec<Option<usize>> = vec![None; nodes.len()];
    for i in (1..nodes.len()).rev() {
        let Some(parent) = nodes[i].parent.map(NodeId::index).filter(|p| *p < i) else {
            continue;
        };
        let px = reach_px[i] + edge_px(nodes, i);
        if next[parent].is_none() || px > reach_px[parent] {
            (reach_px[parent], next[parent]) = (px, Some(i));
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

    #[test]
    fn without_wood_nothing_changes() {
        let mut nodes = tree();
        taper(&mut nodes, &[None; 8]);
        assert_eq!(radii(&nodes), [1.0; 8]);
    }
}

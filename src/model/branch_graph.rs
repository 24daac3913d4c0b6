//! The wood that pictures show, as centre lines.

use super::Size;
use crate::signal::distance_to_segment;
use nalgebra::{Point2, Vector2};
use std::ops::AddAssign;

/// A place is on a piece of wood within so many of its radii, and so many pixels at 640 px picture
/// width.
const REACH_RADII: f64 = 1.5;
const REACH_PX: f64 = 8.0;

/// Level is what rises by less than this, degrees: of what runs to all sides alike a thirtieth.
const LEVEL_DEG: f64 = 3.0;

/// Radius of a branch by that of its parent where it is not seen (Tan et al. 2008 sect. 2.2).
pub const RADIUS_SHARE: f64 = 0.75;

/// A joint of a traced branch; the branch runs from the parent to it.
#[derive(Clone, Debug, PartialEq)]
pub struct WoodNode {
    /// Index of the parent, smaller than the node's own; `None` for the foot.
    pub parent: Option<usize>,
    /// On the centre line at rest, px.
    pub position_px: Point2<f64>,
    /// Half the width that is seen there, px.
    pub radius_px: f64,
}

#[cfg(test)]
impl WoodNode {
    /// A joint for tests, 8.5 px wide.
    pub(crate) fn made_up(parent: Option<usize>, u_px: f64, v_px: f64) -> Self {
        Self {
            parent,
            position_px: Point2::new(u_px, v_px),
            radius_px: 4.25,
        }
    }
}

/// The branches that a picture shows, joined to one tree: nodes with parents before children, the
/// first is the trunk's foot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BranchGraph {
    pub nodes: Vec<WoodNode>,
}

impl BranchGraph {
    /// Each piece's way from its begin to its end, px.
    fn ways_px(&self) -> impl Iterator<Item = Vector2<f64>> {
        self.nodes.iter().filter_map(|node| {
            let parent = self.nodes.get(node.parent?)?;
            Some(node.position_px - parent.position_px)
        })
    }

    /// Length of all branches, px.
    pub fn length_px(&self) -> f64 {
        self.ways_px().map(|way| way.norm()).sum()
    }

    /// The share of the length that runs level in the picture, to 3 degrees; 0 without length.
    pub fn level_share(&self) -> f64 {
        let level = self.ways_px().filter(is_level);
        let level_px: f64 = level.map(|way| way.norm()).sum();
        level_px / self.length_px().max(f64::MIN_POSITIVE)
    }

    /// The length of the piece that ends in a node, and how much of that runs level, to 3 degrees; nothing of the
    /// foot.
    pub fn piece_length(&self, node: usize) -> BranchLength {
        let Some(parent) = self.nodes[node].parent else {
            return BranchLength::default();
        };
        let way = self.nodes[node].position_px - self.nodes[parent].position_px;
        BranchLength {
            all_px: way.norm(),
            level_px: if is_level(&way) { way.norm() } else { 0.0 },
        }
    }

    /// Length of what of the branches is at places that `is_within` holds for, px.
    pub fn length_within_px(&self, is_within: impl Fn(Point2<f64>) -> bool) -> f64 {
        let mut length_px = 0.0;
        for node in &self.nodes {
            let Some(parent) = node.parent.and_then(|parent| self.nodes.get(parent)) else {
                continue;
            };
            let way = node.position_px - parent.position_px;
            let steps = way.norm().ceil().max(1.0);
            for step in 0..steps as usize {
                let share = (step as f64 + 0.5) / steps;
                if is_within(parent.position_px + way * share) {
                    length_px += way.norm() / steps;
                }
            }
        }
        length_px
    }

    /// The way along the wood from the foot by the node `by` to the end that is farthest from it, px; empty
    /// without wood. The foot is node 0.
    pub fn longest_way_px(&self, by: usize) -> Vec<Point2<f64>> {
        let mut from_foot_px = vec![0.0; self.nodes.len()];
        let mut leads_by = vec![false; self.nodes.len()];
        let mut end: Option<usize> = None;
        for (i, node) in self.nodes.iter().enumerate() {
            leads_by[i] = i == by;
            if let Some(parent) = node.parent {
                let way = node.position_px - self.nodes[parent].position_px;
                from_foot_px[i] = from_foot_px[parent] + way.norm();
                leads_by[i] |= leads_by[parent];
            }
            if leads_by[i] && end.is_none_or(|end| from_foot_px[i] > from_foot_px[end]) {
                end = Some(i);
            }
        }
        let mut line_px = Vec::new();
        while let Some(node) = end.and_then(|end| self.nodes.get(end)) {
            line_px.push(node.position_px);
            end = node.parent;
        }
        line_px.reverse();
        line_px
    }

    /// The piece of wood that is nearest to a place, as the node in which it ends; `None` where
    /// none is near. `size` is that of the picture.
    pub fn piece_at(&self, at_px: Point2<f64>, size: Size) -> Option<usize> {
        let reach_px = REACH_PX * f64::from(size.width) / 640.0;
        let mut nearest: Option<usize> = None;
        let mut least_px = f64::INFINITY;
        for (piece, node) in self.nodes.iter().enumerate() {
            let Some(parent) = node.parent else { continue };
            let from_px = self.nodes[parent].position_px;
            let off_px = distance_to_segment(at_px, from_px, node.position_px);
            if off_px < least_px && off_px <= REACH_RADII * node.radius_px + reach_px {
                (nearest, least_px) = (Some(piece), off_px);
            }
        }
        nearest
    }

    /// The graph of some of its nodes; what is carried by one that is not kept is not kept either.
    pub fn of_nodes(&self, is_kept: &[bool]) -> Self {
        let mut place_of: Vec<Option<usize>> = Vec::with_capacity(self.nodes.len());
        let mut nodes: Vec<WoodNode> = Vec::new();
        for (node, is_kept) in self.nodes.iter().zip(is_kept) {
            let parent = node.parent.map(|parent| place_of[parent]);
            if !is_kept || parent == Some(None) {
                place_of.push(None);
                continue;
            }
            place_of.push(Some(nodes.len()));
            nodes.push(WoodNode {
                parent: parent.flatten(),
                ..node.clone()
            });
        }
        Self { nodes }
    }

    /// How many branches end somewhere.
    pub fn tips(&self) -> usize {
        let children = self.children();
        children
            .iter()
            .filter(|children| children.is_empty())
            .count()
    }

    /// Children of every node.
    pub fn children(&self) -> Vec<Vec<usize>> {
        let mut children = vec![Vec::new(); self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate() {
            if let Some(parent) = node.parent {
                children[parent].push(i);
            }
        }
        children
    }
}

/// A length of branches, px, and how much of it runs level.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BranchLength {
    pub all_px: f64,
    pub level_px: f64,
}

impl AddAssign for BranchLength {
    fn add_assign(&mut self, other: Self) {
        self.all_px += other.all_px;
        self.level_px += other.level_px;
    }
}

fn is_level(way: &Vector2<f64>) -> bool {
    way.y.abs().atan2(way.x.abs()) < LEVEL_DEG.to_radians()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A trunk of 100 px that forks.
    fn fork() -> BranchGraph {
        let nodes = vec![
            WoodNode::made_up(None, 100.0, 200.0),
            WoodNode::made_up(Some(0), 100.0, 100.0),
            WoodNode::made_up(Some(1), 60.0, 70.0),
            WoodNode::made_up(Some(1), 140.0, 70.0),
        ];
        BranchGraph { nodes }
    }

    #[test]
    fn what_a_lost_node_carries_is_lost_with_it() {
        let kept = fork().of_nodes(&[true, true, false, true]);
        assert_eq!(kept.nodes.len(), 3);
        assert_eq!(kept.nodes[2].parent, Some(1));
        assert_eq!(kept.nodes[2].position_px, fork().nodes[3].position_px);
        assert_eq!(fork().of_nodes(&[true, false, true, true]).nodes.len(), 1);
    }

    #[test]
    fn a_place_belongs_to_the_wood_beside_it_and_far_away_to_none() {
        let size = Size::new(640, 360);
        let at = |u, v| fork().piece_at(Point2::new(u, v), size);
        assert_eq!(at(108.0, 150.0), Some(1));
        assert_eq!(at(75.0, 78.0), Some(2));
        assert_eq!(at(100.0, 60.0), None);
        assert_eq!(at(f64::NAN, 0.0), None);
        assert_eq!(
            BranchGraph::default().piece_at(Point2::origin(), size),
            None
        );
    }

    #[test]
    fn the_longest_way_leads_from_the_foot_to_the_farthest_end() {
        let mut graph = fork();
        graph.nodes.push(WoodNode::made_up(Some(3), 150.0, 60.0));
        let way = [[100.0, 200.0], [100.0, 100.0], [140.0, 70.0], [150.0, 60.0]];
        assert_eq!(graph.longest_way_px(0), way.map(Point2::from));
        assert_eq!(BranchGraph::default().longest_way_px(0), []);
        // By the other branch of the fork, which ends there.
        let by_other = graph.longest_way_px(2);
        assert_eq!(by_other.last(), Some(&graph.nodes[2].position_px));
        assert_eq!(by_other[..2], graph.longest_way_px(0)[..2]);
    }

    #[test]
    fn all_pieces_together_have_a_length() {
        assert!((fork().length_px() - 200.0).abs() < 1e-9);
        assert!((fork().length_within_px(|_| true) - 200.0).abs() < 1e-9);
        assert_eq!(fork().level_share(), 0.0);
        let mut with_ledge = fork();
        with_ledge
            .nodes
            .push(WoodNode::made_up(Some(3), 90.0, 71.0));
        assert!((with_ledge.level_share() - 0.2).abs() < 1e-3);
        let piece = |node: usize| with_ledge.piece_length(node);
        assert!((piece(4).all_px - 50.0).abs() < 0.1 && piece(0) == BranchLength::default());
        assert!((piece(4).level_px - 50.0).abs() < 0.1 && piece(2).level_px == 0.0);
        assert_eq!(BranchGraph::default().level_share(), 0.0);
        assert_eq!(fork().length_within_px(|_| false), 0.0);
        assert_eq!(fork().children(), [vec![1], vec![2, 3], vec![], vec![]]);
        assert_eq!(fork().tips(), 2);
    }
}

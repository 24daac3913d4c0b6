//! Joins the skeleton that follows from motion with the wood that the picture shows.
//!
//! The wood says where branches run and fork, motion which piece of it belongs to which branch.
//! Every piece of wood is given a branch, so that along the way from the foot to a tip the branches
//! follow upon each other as the motion hierarchy has them, and the points near a piece are off its
//! branch by as few steps as possible: a labelling of a tree, solved exactly by dynamic
//! programming. A branch then ends on its wood, and what it passes on the way there are bends of
//! it.

mod unseen;

use super::bent_tree::{BentTree, Names, share_of_push, way_of};
use super::labels::{Labels, label};
use crate::model::{BranchGraph, Node, NodeId, NodeKind, NodeName, Skeleton};
use crate::signal::distance_to_segment;
use nalgebra::{Point2, Point3, Vector2};
use std::collections::BTreeSet;

/// A followed point on its branch.
#[derive(Clone, Copy, Debug)]
pub(super) struct PointOn {
    pub node: NodeId,
    pub rest_px: Point2<f64>,
}

/// A traced node goes on as one of the tree before that is no farther from it, px at 640 px picture
/// width.
const SAME_PX: f64 = 8.0;

/// `skeleton`, whose branches are straight, along the `wood`. Its measured nodes keep their order
/// among themselves. `plain` is the same without the branches that motion shows besides.
pub(super) fn along_wood(
    plain: &Skeleton,
    skeleton: &Skeleton,
    wood: &BranchGraph,
    points: &[PointOn],
    names: &mut Names,
) -> Joined {
    if skeleton.measured() < 2 {
        return Joined {
            skeleton: skeleton.clone(),
            seen_px: Vec::new(),
        };
    }
    let labels = label(skeleton, wood, points);
    let mut build = Build::new(skeleton, wood, &labels, points);
    build.measured();
    build.side_wood();
    build.set_levels();
    build.tree.set_side_depths(skeleton);
    build.tree.copy_into_planes(plain, skeleton, names);
    build.settle_unseen();
    build.name(names);
    Joined {
        skeleton: Skeleton {
            nodes: build.tree.nodes,
            ..skeleton.clone()
        },
        seen_px: build.tree.seen_px,
    }
}

/// A tree along its wood.
pub(super) struct Joined {
    pub skeleton: Skeleton,
    /// Radius of each node where the picture shows it, px; copies have that of their original.
    pub seen_px: Vec<Option<f64>>,
}

/// Pieces of wood that are not in the new tree yet, one after the other.
struct Way {
    /// The node that the first leaves.
    from: NodeId,
    pieces: Vec<usize>,
}

/// Puts the new tree together from branches and wood.
struct Build<'a> {
    old: &'a Skeleton,
    wood: &'a BranchGraph,
    labels: &'a Labels,
    points: &'a [PointOn],
    tree: BentTree,
    /// By measured node of the old tree: the piece of wood that bears most points of its branch.
    under: Vec<Option<usize>>,
    /// Where each measured node of the old tree stands in the new one.
    place_of: Vec<Option<NodeId>>,
    /// Where each piece of wood ends in the new tree.
    place_of_wood: Vec<Option<NodeId>>,
    /// Nodes of the new tree to which no wood is seen.
    unseen: BTreeSet<usize>,
}

impl<'a> Build<'a> {
    fn new(
        old: &'a Skeleton,
        wood: &'a BranchGraph,
        labels: &'a Labels,
        points: &'a [PointOn],
    ) -> Self {
        let mut build = Self {
            old,
            wood,
            labels,
            points,
            tree: BentTree::on_foot_of(old),
            under: wood_under(old, wood, points),
            place_of: vec![None; old.measured()],
            place_of_wood: vec![None; wood.nodes.len()],
            unseen: BTreeSet::new(),
        };
        if let Some(foot) = build.place_of.first_mut() {
            *foot = Some(NodeId(0));
        }
        if let Some(foot) = build.place_of_wood.first_mut() {
            *foot = Some(NodeId(0));
        }
        build
    }

    /// The measured nodes in their order, each after the bends on its way.
    fn measured(&mut self) {
        for branch in 1..self.old.measured() {
            match self.labels.end_of[branch] {
                Some(end) => self.on_wood(branch, end),
                None => self.off_wood(branch),
            }
        }
    }

    /// A branch that ends at the piece of wood `end`.
    fn on_wood(&mut self, branch: usize, end: usize) {
        let way = self.way_to(end);
        let mut parent = way.from;
        // It may leave a part of its carrier that is not on the way to that one's end.
        let is_own = |piece: &usize| self.labels.branch[*piece] == branch;
        let (own, carrier): (Vec<usize>, Vec<usize>) = way.pieces.into_iter().partition(is_own);
        for piece in carrier {
            parent = self.push_side(piece, parent);
        }
        let mut depth = self.tree.nodes[parent.index()].position.z;
        let pushed = way_of(self.old, branch);
        let seen_px: f64 = own.iter().map(|piece| self.length_px(*piece)).sum();
        let unseen_px = self.unseen_px(branch, end);
        let whole_px = seen_px + unseen_px;
        for &piece in &own {
            let share = share_of_push(&pushed, self.length_px(piece), whole_px);
            depth += share * pushed.z;
            let node = if piece == end && unseen_px == 0.0 {
                let old = &self.old.nodes[branch];
                self.place_of[branch] = Some(NodeId(self.tree.nodes.len() as u32));
                Node {
                    parent: Some(parent),
                    position: self.position(piece, depth),
                    ..old.clone()
                }
            } else {
                self.traced(branch, piece, parent, depth)
            };
            parent = self.push(node, branch, piece, share);
        }
        if unseen_px > 0.0 {
            let share = share_of_push(&pushed, unseen_px, whole_px);
            let end = self.old.nodes[branch].position;
            let end = Point3::new(end.x, end.y, depth + share * pushed.z);
            self.push_unseen(branch, parent, end, share);
        }
        self.bind_bends(branch);
    }

    /// The wood that is not in the tree yet, up to and with a piece.
    fn way_to(&self, piece: usize) -> Way {
        let mut pieces = Vec::new();
        let mut at = Some(piece);
        while let Some(piece) = at.filter(|piece| self.place_of_wood[*piece].is_none()) {
            pieces.push(piece);
            at = self.wood.nodes[piece].parent;
        }
        pieces.reverse();
        let from = at.and_then(|piece| self.place_of_wood[piece]);
        Way {
            from: from.unwrap_or(NodeId(0)),
            pieces,
        }
    }

    /// How far a branch goes on straight, unseen, from the last of its wood to its own end, px: 0
    /// where it ends on its wood. It goes on where most of the points on it, and on the branches
    /// that it carries and none of whose wood is seen, are nearer to that way than to its wood; but
    /// it does not turn back.
    fn unseen_px(&self, branch: usize, end: usize) -> f64 {
        let from = self.wood.nodes[end].position_px;
        let to = self.old.image_from_model(&self.old.nodes[branch].position);
        let parent = self.wood.nodes[end].parent.unwrap_or(0);
        let arrives = from - self.wood.nodes[parent].position_px;
        if arrives.dot(&(to - from)) <= 0.0 {
            return 0.0;
        }
        let (mut beyond, mut on_wood) = (0, 0);
        for point in self.points {
            if !self.enters_from(point.node, branch) {
                continue;
            }
            if distance_to_segment(point.rest_px, from, to) < self.off_wood_px(branch, point) {
                beyond += 1;
            } else {
                on_wood += 1;
            }
        }
        if beyond > on_wood {
            (to - from).norm()
        } else {
            0.0
        }
    }

    /// Whether a node of the old tree is `branch`, or is carried by it with no wood seen between.
    fn enters_from(&self, node: NodeId, branch: usize) -> bool {
        for here in std::iter::once(node).chain(self.old.ancestors(node)) {
            if here.index() == branch {
                return true;
            }
            if self.labels.end_of[here.index()].is_some() {
                return false;
            }
        }
        false
    }

    /// Distance of a point from the wood of `branch`, px.
    fn off_wood_px(&self, branch: usize, point: &PointOn) -> f64 {
        let mut least_px = f64::INFINITY;
        for (piece, node) in self.wood.nodes.iter().enumerate() {
            if let Some(parent) = node.parent.filter(|_| self.labels.branch[piece] == branch) {
                let from = self.wood.nodes[parent].position_px;
                let off_px = distance_to_segment(point.rest_px, from, node.position_px);
                least_px = least_px.min(off_px);
            }
        }
        least_px
    }

    /// A piece of wood that is a rigid part of the branch that it leaves. How deep it reaches
    /// nobody has seen: it stays as deep as its fork.
    fn push_side(&mut self, piece: usize, parent: NodeId) -> NodeId {
        // What leaves the foot belongs to the trunk.
        let branch = self.tree.branch_of[parent.index()].max(1);
        let depth = self.tree.nodes[parent.index()].position.z;
        let node = self.traced(branch, piece, parent, depth);
        self.push(node, branch, piece, 0.0)
    }

    /// The bends of a branch were made before its end was.
    fn bind_bends(&mut self, branch: usize) {
        let end = self.place_of[branch];
        for (i, node) in self.tree.nodes.iter_mut().enumerate() {
            if self.tree.branch_of[i] == branch && Some(NodeId(i as u32)) != end && i > 0 {
                node.moves_with = end;
            }
        }
    }

    fn length_px(&self, piece: usize) -> f64 {
        let node = &self.wood.nodes[piece];
        node.parent.map_or(0.0, |p| {
            (node.position_px - self.wood.nodes[p].position_px).norm()
        })
    }

    fn position(&self, piece: usize, depth: f64) -> Point3<f64> {
        let at = self.model_from_image(self.wood.nodes[piece].position_px);
        Point3::new(at.x, at.y, depth)
    }

    fn traced(&self, branch: usize, piece: usize, parent: NodeId, depth: f64) -> Node {
        let old = &self.old.nodes[branch];
        Node {
            name: NodeName(0),
            parent: Some(parent),
            position: self.position(piece, depth),
            radius: self.wood.nodes[piece].radius_px,
            n_tracks: 0,
            kind: NodeKind::Traced,
            certainty: 0.0,
            moves_with: self.place_of[branch],
            ..old.clone()
        }
    }

    /// A node at the end of a piece of wood.
    fn push(&mut self, node: Node, branch: usize, piece: usize, share: f64) -> NodeId {
        let radius_px = Some(self.wood.nodes[piece].radius_px).filter(|px| *px > 0.0);
        let place = self.tree.push(node, branch, share, radius_px);
        self.place_of_wood[piece] = Some(place);
        place
    }

    /// A place of the picture from the foot, to the right and up, px.
    fn model_from_image(&self, at_px: Point2<f64>) -> Vector2<f64> {
        Vector2::new(at_px.x - self.old.foot_px.x, self.old.foot_px.y - at_px.y)
    }

    /// The wood on which no branch ends and that no branch passes.
    fn side_wood(&mut self) {
        for piece in 1..self.wood.nodes.len() {
            if self.place_of_wood[piece].is_some() {
                continue;
            }
            let parent = self.wood.nodes[piece].parent.unwrap_or(0);
            let Some(parent) = self.place_of_wood[parent] else {
                continue;
            };
            self.push_side(piece, parent);
        }
    }

    /// One more than what carries it; side wood one above its branch.
    fn set_levels(&mut self) {
        let mut skeleton = Skeleton {
            nodes: std::mem::take(&mut self.tree.nodes),
            ..self.old.clone()
        };
        let mut levels: Vec<u8> = vec![0; skeleton.nodes.len()];
        for branch in skeleton.moving_branches() {
            levels[branch.node.index()] = levels[branch.parent.index()].saturating_add(1);
        }
        for i in (1..skeleton.nodes.len() as u32).map(NodeId) {
            let mover = skeleton.mover(i);
            if mover != i {
                let above = u8::from(!skeleton.is_bend(i));
                levels[i.index()] = levels[mover.index()].saturating_add(above);
            }
        }
        for (node, level) in skeleton.nodes.iter_mut().zip(levels) {
            node.level = level;
        }
        self.tree.nodes = skeleton.nodes;
    }

    /// Gives the bends and the side wood names: those of the nearest ones of the tree before, where
    /// they are in the same place.
    fn name(&mut self, names: &mut Names) {
        let reach_px = SAME_PX * f64::from(self.old.image_size.width) / 640.0;
        let mut before: Vec<(NodeName, Point3<f64>)> = Vec::new();
        for node in names.prior.iter().flat_map(|prior| &prior.nodes) {
            if node.moves_with.is_some() && node.copy_of.is_none() {
                before.push((node.name, node.position));
            }
        }
        for node in &mut self.tree.nodes {
            if node.moves_with.is_none() || node.copy_of.is_some() {
                continue;
            }
            let distance = |at: &Point3<f64>| (at.xy() - node.position.xy()).norm();
            let nearest = before
                .iter()
                .enumerate()
                .min_by(|a, b| distance(&a.1.1).total_cmp(&distance(&b.1.1)))
                .map(|(k, (_, at))| (k, distance(at)));
            match nearest.filter(|(_, px)| *px <= reach_px) {
                Some((k, _)) => node.name = before.swap_remove(k).0,
                None => node.name = names.take(),
            }
        }
    }
}

/// The piece of wood that bears most points of each measured node's branch; `None` where most of
/// these are on none.
fn wood_under(old: &Skeleton, wood: &BranchGraph, points: &[PointOn]) -> Vec<Option<usize>> {
    let mut pieces: Vec<Vec<Option<usize>>> = vec![Vec::new(); old.measured()];
    for point in points {
        let piece = wood.piece_at(point.rest_px, old.image_size);
        if let Some(of_branch) = pieces.get_mut(point.node.index()) {
            of_branch.push(piece);
        }
    }
    let n_pieces = wood.nodes.len();
    pieces.iter().map(|of| most_borne(of, n_pieces)).collect()
}

/// The piece that most points are on, where most of them are on one; the last of several.
fn most_borne(of_points: &[Option<usize>], n_pieces: usize) -> Option<usize> {
    let mut on_piece = vec![0; n_pieces];
    for piece in of_points.iter().flatten() {
        on_piece[*piece] += 1;
    }
    let on_wood: usize = on_piece.iter().sum();
    let most = (0..n_pieces).max_by_key(|piece| on_piece[*piece])?;
    (2 * on_wood > of_points.len()).then_some(most)
}

#[cfg(test)]
mod tests;

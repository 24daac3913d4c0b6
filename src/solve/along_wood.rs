//! Joins the skeleton that follows from motion with the wood that the picture shows.
//!
//! The wood says where branches run and fork, motion which piece of it belongs to which branch.
//! Every piece of wood is given a branch, so that along the way from the foot to a tip the branches
//! follow upon each other as the motion hierarchy has them, and the points near a piece are off its
//! branch by as few steps as possible: a labelling of a tree, solved exactly by dynamic
//! programming. A branch then ends on its wood, and what it passes on the way there are bends of
//! it.

use super::bent_tree::{BentTree, Names, share_of_push, way_of};
use super::labels::{Labels, label};
use super::least_wood::{Free, settle};
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

/// A straight branch has no joints nearer to each other, or to its ends, than this, px at 640 px
/// picture width.
const JOINT_PX: f64 = 4.0;

/// A branch that ends beside a piece of wood ends on it after this share of its length at least: it
/// needs a length to turn.
const LEAST_SHARE: f64 = 0.3;

/// `skeleton`, whose branches are straight, along the `wood`. Its measured nodes keep their order
/// among themselves.
pub(super) fn along_wood(
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
    build.tree.copy_into_planes(skeleton, names);
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

/// A place on wood beside the end of a branch.
struct Beside {
    /// The node from which the piece of wood comes.
    from: usize,
    at_px: Point2<f64>,
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

    /// A branch that has no wood of its own: it leaves the wood that most of its points are on,
    /// whichever branch has that, and where they are on none, the branch that carries it where they
    /// are nearest to that.
    fn off_wood(&mut self, branch: usize) {
        let old = &self.old.nodes[branch];
        if let Some(beside) = self.beside(branch) {
            let parent = self.reach(beside.from, branch);
            let begin = self.tree.nodes[parent.index()].position;
            let at = self.model_from_image(beside.at_px);
            let depth = begin.z + way_of(self.old, branch).z;
            self.push_straight(branch, parent, Point3::new(at.x, at.y, depth), 1.0);
            self.bind_bends(branch);
            return;
        }
        let carrier = old.parent.map_or(0, NodeId::index);
        let begin = match self.under[branch] {
            Some(piece) => self.reach(piece, branch),
            None => self.nearest_on(carrier, branch),
        };
        let parent = self.without_fold(begin, old.position);
        self.push_unseen(branch, parent, old.position, 1.0);
        self.bind_bends(branch);
    }

    /// The wood that a branch without wood of its own ends beside, if it does: it then ends on it,
    /// for the middle of its points is off the middle of the limb that they are on.
    fn beside(&self, branch: usize) -> Option<Beside> {
        let piece = self.under[branch]?;
        let end_px = self.old.image_from_model(&self.old.nodes[branch].position);
        if self.wood.piece_at(end_px, self.old.image_size)? != piece {
            return None;
        }
        let from = self.wood.nodes[piece].parent?;
        let from_px = self.wood.nodes[from].position_px;
        let way = self.wood.nodes[piece].position_px - from_px;
        let share = (end_px - from_px).dot(&way) / way.norm_squared();
        Some(Beside {
            from,
            at_px: from_px + share.clamp(LEAST_SHARE, 1.0) * way,
        })
    }

    /// A branch, or the part of it, whose wood is not seen.
    fn push_unseen(&mut self, branch: usize, from: NodeId, end: Point3<f64>, share: f64) {
        let first = self.tree.nodes.len();
        self.push_straight(branch, from, end, share);
        self.unseen.extend(first..self.tree.nodes.len());
    }

    /// Forks that are not seen stand where the tree needs least wood, copies as well; tips stay.
    fn settle_unseen(&mut self) {
        let mut bears = vec![false; self.tree.nodes.len()];
        for node in &self.tree.nodes {
            if let Some(parent) = node.parent {
                bears[parent.index()] = true;
            }
        }
        let mut free = Vec::new();
        for (node, bears) in bears.into_iter().enumerate() {
            let of = self.tree.nodes[node].copy_of.map_or(node, NodeId::index);
            if !bears || !self.unseen.contains(&of) {
                continue;
            }
            let branch = self.tree.branch_of[node];
            let is_end = self.place_of[branch].map(NodeId::index) == Some(of);
            let is_own = |p: &&PointOn| is_end && p.node.index() == branch;
            let own = self.points.iter().filter(is_own).count() as u32;
            free.push(Free { node, own });
        }
        let least = self.joint_px();
        settle(&mut self.tree.nodes, &free, least);
    }

    /// [`JOINT_PX`] in this picture, px.
    fn joint_px(&self) -> f64 {
        JOINT_PX * f64::from(self.old.image_size.width) / 640.0
    }

    /// A branch, or the part of it that is not seen, goes straight to its end, with a joint
    /// wherever one that it carries leaves it before. `share` is that of its push.
    fn push_straight(&mut self, branch: usize, from: NodeId, end: Point3<f64>, share: f64) {
        let begin = self.tree.nodes[from.index()].position;
        let old = &self.old.nodes[branch];
        let (mut parent, mut done) = (from, 0.0);
        for at in self.joints(branch, begin.xy(), end.xy()) {
            let joint = Node {
                name: NodeName(0),
                parent: Some(parent),
                position: begin + at * (end - begin),
                n_tracks: 0,
                ..old.clone()
            };
            parent = self.tree.push(joint, branch, share * (at - done), None);
            done = at;
        }
        let node = Node {
            parent: Some(parent),
            position: end,
            ..old.clone()
        };
        let place = self.tree.push(node, branch, share * (1.0 - done), None);
        self.place_of[branch] = Some(place);
    }

    /// Where the branches that a straight one carries, and whose wood is not seen either, leave it:
    /// shares of its length, ascending. A branch leaves where its points are nearest, but not
    /// beyond the place from which it would have to turn back.
    fn joints(&self, branch: usize, begin: Point2<f64>, end: Point2<f64>) -> Vec<f64> {
        let way = end - begin;
        let length_px = way.norm();
        let share = |at: Point2<f64>| (at - begin).dot(&way) / (length_px * length_px);
        let mut shares: Vec<f64> = Vec::new();
        for carried in branch + 1..self.old.measured() {
            let is_carried = self.old.nodes[carried].parent.map(NodeId::index) == Some(branch);
            if !is_carried || !self.is_unseen(carried) {
                continue;
            }
            let most = share(self.old.nodes[carried].position.xy());
            let mut least_px = f64::INFINITY;
            let mut nearest = most;
            for point in self.points.iter().filter(|p| self.is_on(p.node, carried)) {
                let at = Point2::from(self.model_from_image(point.rest_px));
                let off_px = distance_to_segment(at, begin, end);
                if off_px < least_px {
                    (least_px, nearest) = (off_px, share(at));
                }
            }
            shares.push(most.min(nearest));
        }
        shares.sort_by(f64::total_cmp);
        let apart = self.joint_px() / length_px;
        let mut joints: Vec<f64> = Vec::new();
        for share in shares {
            let last = joints.last().copied().unwrap_or(0.0);
            if share - last >= apart && 1.0 - share >= apart {
                joints.push(share);
            }
        }
        joints
    }

    /// Whether a branch has no wood of its own, and its points are on that of no other.
    fn is_unseen(&self, branch: usize) -> bool {
        self.labels.end_of[branch].is_none() && self.under[branch].is_none()
    }

    /// A place of the picture from the foot, to the right and up, px.
    fn model_from_image(&self, at_px: Point2<f64>) -> Vector2<f64> {
        Vector2::new(at_px.x - self.old.foot_px.x, self.old.foot_px.y - at_px.y)
    }

    /// The node of a piece of wood, or of the last below it that is there already or that a branch
    /// before `branch` has: that becomes side wood.
    fn reach(&mut self, piece: usize, branch: usize) -> NodeId {
        let way = self.way_to(piece);
        let mut place = way.from;
        for piece in way.pieces {
            if self.labels.branch[piece] > branch {
                break;
            }
            place = self.push_side(piece, place);
        }
        place
    }

    /// `begin`, or the nearest place below it from which a straight branch to `end` does not turn
    /// back on what it leaves.
    fn without_fold(&self, begin: NodeId, end: Point3<f64>) -> NodeId {
        let mut at = begin;
        while let Some(below) = self.tree.nodes[at.index()].parent {
            let here = self.tree.nodes[at.index()].position;
            let arrives = here - self.tree.nodes[below.index()].position;
            if arrives.xy().dot(&(end - here).xy()) > 0.0 {
                return at;
            }
            at = below;
        }
        // All of it turns back, as in a tree that hangs.
        begin
    }

    /// The node of the branch `carrier` that is nearest to the points of `branch`.
    fn nearest_on(&self, carrier: usize, branch: usize) -> NodeId {
        let end = self.place_of[carrier].unwrap_or(NodeId(0));
        let mut nearest = end;
        let mut least_px = f64::INFINITY;
        for (i, node) in self.tree.nodes.iter().enumerate() {
            if self.tree.branch_of[i] != carrier || i == 0 {
                continue;
            }
            let at_px = self.old.image_from_model(&node.position);
            let distances = self.points.iter().filter(|p| self.is_on(p.node, branch));
            let px = distances.map(|p| (p.rest_px - at_px).norm());
            let px = px.fold(f64::INFINITY, f64::min);
            if px < least_px {
                (nearest, least_px) = (NodeId(i as u32), px);
            }
        }
        nearest
    }

    /// Whether a node of the old tree is `branch` or carried by it.
    fn is_on(&self, node: NodeId, branch: usize) -> bool {
        node.index() == branch || self.old.ancestors(node).any(|n| n.index() == branch)
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
mod tests {
    use super::*;
    use crate::model::{Size, WoodNode};

    const FOOT: Point2<f64> = Point2::new(300.0, 300.0);

    fn node(name: u32, parent: Option<u32>, at: [f64; 3], copy_of: Option<u32>) -> Node {
        Node {
            copy_of: copy_of.map(NodeId),
            plane_angle: copy_of.map_or(0.0, |_| 1.0),
            ..Node::made_up(name, parent, at)
        }
    }

    /// A trunk of 100 px, a limb to each side of its top, and a copy of either.
    fn straight() -> Skeleton {
        let nodes = vec![
            node(0, None, [0.0, 0.0, 0.0], None),
            node(1, Some(0), [0.0, 100.0, 0.0], None),
            node(2, Some(1), [100.0, 150.0, 40.0], None),
            node(3, Some(1), [-80.0, 160.0, -20.0], None),
            node(4, Some(1), [50.0, 150.0, 80.0], Some(2)),
            node(5, Some(1), [-40.0, 160.0, -70.0], Some(3)),
        ];
        Skeleton {
            nodes,
            foot_px: FOOT,
            image_size: Size::new(640, 360),
        }
    }

    fn piece(parent: Option<usize>, x: f64, y: f64) -> WoodNode {
        WoodNode::made_up(parent, FOOT.x + x, FOOT.y - y)
    }

    /// The right limb leaves the trunk below its top and has a bend and a twig; the left one leaves
    /// the top.
    fn wood() -> BranchGraph {
        let nodes = vec![
            piece(None, 0.0, 0.0),
            piece(Some(0), 0.0, 60.0),
            piece(Some(1), 0.0, 100.0),
            piece(Some(1), 60.0, 90.0),
            piece(Some(3), 105.0, 150.0),
            piece(Some(3), 90.0, 80.0),
            piece(Some(2), -85.0, 165.0),
        ];
        BranchGraph { nodes }
    }

    fn points() -> Vec<PointOn> {
        let mut points = Vec::new();
        let mut on = |branch: u32, from: (f64, f64), to: (f64, f64)| {
            for k in 1..=8 {
                let t = f64::from(k) / 9.0;
                let (x, y) = (from.0 + t * (to.0 - from.0), from.1 + t * (to.1 - from.1));
                points.push(PointOn {
                    node: NodeId(branch),
                    rest_px: Point2::new(FOOT.x + x, FOOT.y - y),
                });
            }
        };
        on(1, (0.0, 0.0), (0.0, 100.0));
        on(2, (15.0, 68.0), (60.0, 90.0));
        on(2, (60.0, 90.0), (105.0, 150.0));
        on(3, (0.0, 100.0), (-85.0, 165.0));
        points
    }

    fn names(prior: Option<&Skeleton>) -> Names<'_> {
        Names { next: 6, prior }
    }

    #[test]
    fn branches_run_along_their_wood_and_fork_where_it_does() {
        let joined = along_wood(&straight(), &wood(), &points(), &mut names(None));
        let tree = &joined.skeleton;
        let places: Vec<NodeId> = tree.measured_branches().collect();
        let ends: Vec<Point3<f64>> = places
            .iter()
            .map(|p| tree.nodes[p.index()].position)
            .collect();
        assert_eq!(places.len(), 3);
        assert!(
            (ends[0] - Point3::new(0.0, 100.0, 0.0)).norm() < 1e-9,
            "{ends:?}"
        );
        assert!((ends[1].xy() - Point3::new(105.0, 150.0, 0.0).xy()).norm() < 1e-9);
        assert!((ends[2].xy() - Point3::new(-85.0, 165.0, 0.0).xy()).norm() < 1e-9);
        // The right limb begins at a bend of the trunk.
        let begin = tree.begin(places[1]).expect("a beginning");
        assert_eq!(tree.mover(begin), places[0]);
        assert_eq!(tree.nodes[begin.index()].position.y, 60.0);
        assert_eq!(tree.moving_parent(places[2]), Some(places[0]));
        // Its twig, on which no point is, is a rigid part of it.
        let twig = tree
            .nodes
            .iter()
            .position(|n| n.position.y == 80.0)
            .expect("a twig");
        assert_eq!(tree.nodes[twig].moves_with, Some(places[1]));
        assert!(
            tree.nodes
                .iter()
                .enumerate()
                .all(|(i, n)| n.parent.is_none_or(|p| p.index() < i))
        );
        assert_eq!(joined.seen_px.iter().flatten().count(), 6 + 4);
    }

    /// A bend that kept its original's place would be filmed twice.
    #[test]
    fn copies_have_the_bends_of_their_originals() {
        let tree = along_wood(&straight(), &wood(), &points(), &mut names(None)).skeleton;
        let copies: Vec<&Node> = tree.nodes.iter().filter(|n| n.copy_of.is_some()).collect();
        assert_eq!(copies.len(), 4, "{copies:?}");
        for copy in copies {
            let original = &tree.nodes[copy.copy_of.expect("a copy").index()];
            assert_eq!((copy.kind, copy.level), (original.kind, original.level));
            assert_eq!(copy.moves_with.is_some(), original.moves_with.is_some());
            assert!((copy.position - original.position).norm() > 10.0);
        }
        let mut names: Vec<u32> = tree.nodes.iter().map(|n| n.name.0).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), tree.nodes.len());
    }

    #[test]
    fn bends_that_stay_in_place_keep_their_names() {
        let before = along_wood(&straight(), &wood(), &points(), &mut names(None)).skeleton;
        let mut later = names(Some(&before));
        later.next = 100;
        let after = along_wood(&straight(), &wood(), &points(), &mut later).skeleton;
        for (before, after) in before.nodes.iter().zip(&after.nodes) {
            assert!(
                before.copy_of.is_some() || before.name == after.name,
                "{after:?}"
            );
        }
    }

    /// Leaves before the wood, or a limb behind another one.
    #[test]
    fn a_branch_without_wood_leaves_what_carries_it_without_folding_back() {
        let mut wood = wood();
        wood.nodes.pop();
        let tree = along_wood(&straight(), &wood, &points(), &mut names(None)).skeleton;
        let left = tree
            .nodes
            .iter()
            .find(|n| n.name == NodeName(3))
            .expect("the left limb");
        assert_eq!(left.position, straight().nodes[3].position);
        let parent = &tree.nodes[left.parent.expect("a parent").index()];
        assert!(
            parent.position.x == 0.0 && parent.position.y >= 60.0,
            "{parent:?}"
        );
    }

    /// Leaves hide all but the lowest wood.
    #[test]
    fn a_trunk_that_is_seen_in_part_goes_on_to_its_fork() {
        let mut wood = wood();
        wood.nodes.truncate(2);
        let tree = along_wood(&straight(), &wood, &points(), &mut names(None)).skeleton;
        let places = tree.foot_and_branches();
        let trunk = &tree.nodes[places[1].index()];
        // Its own points hold it.
        let off = (trunk.position - straight().nodes[1].position).norm();
        assert!(off < 1.0, "{trunk:?}");
        // The right limb's points begin above the bend, the left one's beside the fork. The limb
        // draws the joint a little to its side.
        let joint = &tree.nodes[trunk.parent.expect("a joint").index()];
        assert_eq!(joint.kind, NodeKind::Measured);
        assert_eq!(joint.moves_with, Some(places[1]));
        assert!((65.0..71.0).contains(&joint.position.y), "{joint:?}");
        assert!((0.0..5.0).contains(&joint.position.x), "{joint:?}");
        let bend = &tree.nodes[joint.parent.expect("a bend").index()];
        assert_eq!((bend.kind, bend.position.y), (NodeKind::Traced, 60.0));
        let parent = |branch: usize| tree.nodes[places[branch].index()].parent;
        assert_eq!((parent(2), parent(3)), (trunk.parent, Some(places[1])));
    }

    /// With no points of its own, a fork goes where its limbs take least wood.
    #[test]
    fn an_unseen_fork_without_points_stands_lower_where_its_limbs_part_wide() {
        let mut wood = wood();
        wood.nodes.truncate(2);
        let mut points = points();
        points.retain(|p| p.node != NodeId(1));
        let tree = along_wood(&straight(), &wood, &points, &mut names(None)).skeleton;
        let places = tree.foot_and_branches();
        let trunk = &tree.nodes[places[1].index()];
        assert!((61.0..97.0).contains(&trunk.position.y), "{trunk:?}");
        let tips = [2, 3].map(|branch: usize| tree.nodes[places[branch].index()].position);
        assert_eq!(
            tips,
            [2, 3].map(|branch: usize| straight().nodes[branch].position)
        );
    }

    /// It hangs on the same branch as its neighbours then, and not on what carries them all.
    #[test]
    fn a_branch_that_would_turn_back_leaves_a_straight_one_before_its_end() {
        let mut straight = straight();
        straight.nodes.truncate(4);
        // Beyond the middle of the left limb, downwards.
        straight
            .nodes
            .push(node(4, Some(3), [-75.0, 120.0, 0.0], None));
        let mut points = points();
        for k in 0..5 {
            let down = 4.0 * f64::from(k);
            points.push(PointOn {
                node: NodeId(4),
                rest_px: Point2::new(FOOT.x - 75.0, FOOT.y - 140.0 + down),
            });
        }
        let mut wood = wood();
        wood.nodes.pop();
        let tree = along_wood(&straight, &wood, &points, &mut names(None)).skeleton;
        let places = tree.foot_and_branches();
        let [left, hanging] = [3, 4].map(|branch: usize| &tree.nodes[places[branch].index()]);
        assert_eq!(hanging.parent, left.parent);
        assert_eq!(tree.moving_parent(places[4]), Some(places[3]));
        let joint = tree.nodes[hanging.parent.expect("a joint").index()].position;
        let (arrives, leaves) = (
            joint - Point3::new(0.0, 100.0, 0.0),
            hanging.position - joint,
        );
        assert!(arrives.xy().dot(&leaves.xy()) >= 0.0, "{joint}");
    }

    #[test]
    fn a_trunk_alone_and_wood_without_points_are_no_fault() {
        let mut alone = straight();
        alone.nodes.truncate(2);
        let tree = along_wood(&alone, &wood(), &[], &mut names(None)).skeleton;
        assert_eq!(tree.measured_branches().count(), 1);
        let none = BranchGraph::default();
        let tree = along_wood(&straight(), &none, &points(), &mut names(None)).skeleton;
        assert_eq!(tree.measured_branches().count(), 3);
    }
}

//! Joins the skeleton that motion tells with the wood that the picture shows.
//!
//! The wood says where branches run and fork, motion which piece of it belongs to which branch.
//! Every piece of wood is given a branch, so that along the way from the foot to a tip the branches
//! follow upon each other as the motion hierarchy has them, and the points near a piece are off its
//! branch by as few steps as possible: a labelling of a tree, solved exactly by dynamic
//! programming. A branch then ends on its wood, and what it passes on the way there are bends of
//! it.

use super::labels::{Labels, label};
use super::taper::taper;
use crate::model::{BranchGraph, Node, NodeId, NodeKind, NodeName, Skeleton};
use nalgebra::{Point2, Point3, UnitQuaternion, Vector3};

/// A followed point on its branch.
#[derive(Clone, Copy, Debug)]
pub(super) struct PointOn {
    pub node: NodeId,
    pub rest_px: Point2<f64>,
}

/// Names for nodes that no tree before had.
pub(super) struct Names<'a> {
    /// The next free one.
    pub next: u32,
    /// The tree before, whose traced nodes go on where they are the same.
    pub prior: Option<&'a Skeleton>,
}

/// A traced node goes on as one of the tree before that is no farther from it, px at 640 px picture
/// width.
const SAME_PX: f64 = 4.0;

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
    build.name(names);
    build.copies(names);
    Joined {
        skeleton: Skeleton {
            nodes: build.nodes,
            ..skeleton.clone()
        },
        seen_px: build.seen_px,
    }
}

/// The tree `along` its wood in the depth of `straight`, which has the same branches without their
/// bends, stood up anew, and copies of its own.
pub fn in_depth_of(straight: &Skeleton, along: &Skeleton, first_name: u32) -> Skeleton {
    let wood = BranchGraph::default();
    let labels = Labels {
        branch: Vec::new(),
        end_of: Vec::new(),
    };
    let mut build = Build::new(straight, &wood, &labels, &[]);
    build.again(along);
    build.copies(&mut Names {
        next: first_name,
        prior: None,
    });
    Skeleton {
        nodes: build.nodes,
        ..along.clone()
    }
}

/// A tree along its wood.
pub(super) struct Joined {
    pub skeleton: Skeleton,
    /// Radius of each node where the picture shows it, px; copies have that of their original.
    pub seen_px: Vec<Option<f64>>,
}

impl Joined {
    /// Puts the radii that are seen in the place of those that follow from the pipe model.
    pub fn set_radii(&mut self) {
        taper(&mut self.skeleton.nodes, &self.seen_px);
    }
}

/// The new tree while it grows.
struct Build<'a> {
    old: &'a Skeleton,
    wood: &'a BranchGraph,
    labels: &'a Labels,
    points: &'a [PointOn],
    nodes: Vec<Node>,
    /// Where each measured node of the old tree stands in the new one.
    place_of: Vec<Option<NodeId>>,
    /// Where each piece of wood ends in the new tree.
    place_of_wood: Vec<Option<NodeId>>,
    /// The branch, of the old tree, of each node of the new one, and its radius where it is seen,
    /// px.
    branch_of: Vec<usize>,
    seen_px: Vec<Option<f64>>,
    /// Of each node, the share of its branch's push that is met with on the way to it from its
    /// parent; 0 for side wood.
    share: Vec<f64>,
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
            nodes: old.nodes.first().cloned().into_iter().collect(),
            place_of: vec![None; old.measured()],
            place_of_wood: vec![None; wood.nodes.len()],
            branch_of: vec![0],
            seen_px: vec![None],
            share: vec![1.0],
        };
        if let Some(foot) = build.place_of.first_mut() {
            *foot = Some(NodeId(0));
        }
        if let Some(foot) = build.place_of_wood.first_mut() {
            *foot = Some(NodeId(0));
        }
        build
    }

    /// The nodes of a tree that is along its wood, with their places in the picture.
    fn again(&mut self, along: &Skeleton) {
        let movers: Vec<NodeId> = [NodeId(0)]
            .into_iter()
            .chain(along.measured_branches())
            .collect();
        let branch_of = |node: NodeId| movers.iter().position(|m| *m == along.mover(node));
        let is_own = |node: NodeId| along.mover(node) == node || along.is_bend(node);
        let measured = || (1..along.measured() as u32).map(NodeId);
        let mut whole_px = vec![0.0; movers.len()];
        for node in measured().filter(|node| is_own(*node)) {
            if let Some(branch) = branch_of(node) {
                whole_px[branch] += way_of(along, node.index()).xy().norm();
            }
        }
        for node in measured() {
            let branch = branch_of(node).unwrap_or(0);
            let mut share = 0.0;
            if is_own(node) {
                let px = way_of(along, node.index()).xy().norm();
                let pushed_px = way_of(self.old, branch).norm();
                let scale = (whole_px[branch] / pushed_px.max(f64::MIN_POSITIVE)).min(1.0);
                share = scale * px / whole_px[branch].max(f64::MIN_POSITIVE);
            }
            let mut new = along.nodes[node.index()].clone();
            let below = new.parent.and_then(|p| self.nodes.get(p.index()));
            new.position.z =
                below.map_or(0.0, |below| below.position.z) + share * way_of(self.old, branch).z;
            self.push(new, branch, None, share);
        }
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
        let mut way = Vec::new();
        let mut at = end;
        while self.place_of_wood[at].is_none() {
            way.push(at);
            match self.wood.nodes[at].parent {
                Some(parent) => at = parent,
                None => break,
            }
        }
        way.reverse();
        let mut parent = self.place_of_wood[at].unwrap_or(NodeId(0));
        // It may leave a part of its carrier that is not on the way to that one's end.
        let is_own = |piece: &usize| self.labels.branch[*piece] == branch;
        let (own, carrier): (Vec<usize>, Vec<usize>) = way.into_iter().partition(is_own);
        for piece in carrier {
            parent = self.push_side(piece, parent);
        }
        let mut depth = self.nodes[parent.index()].position.z;
        let pushed = way_of(self.old, branch);
        let whole_px: f64 = own.iter().map(|piece| self.length_px(*piece)).sum();
        // A branch that is shorter than it was thought to be was pushed too far.
        let scale = (whole_px / pushed.norm().max(f64::MIN_POSITIVE)).min(1.0);
        for &piece in &own {
            // Evenly from where it begins to its end.
            let share = scale * self.length_px(piece) / whole_px.max(f64::MIN_POSITIVE);
            depth += share * pushed.z;
            let node = if piece == end {
                let old = &self.old.nodes[branch];
                self.place_of[branch] = Some(NodeId(self.nodes.len() as u32));
                Node {
                    parent: Some(parent),
                    position: self.position(piece, depth),
                    ..old.clone()
                }
            } else {
                self.traced(branch, piece, parent, depth)
            };
            parent = self.push(node, branch, Some(piece), share);
        }
        self.bind_bends(branch);
    }

    /// A piece of wood that is a rigid part of the branch that it leaves. How deep it reaches
    /// nobody has seen: it stays as deep as its fork.
    fn push_side(&mut self, piece: usize, parent: NodeId) -> NodeId {
        // What leaves the foot belongs to the trunk.
        let branch = self.branch_of[parent.index()].max(1);
        let depth = self.nodes[parent.index()].position.z;
        let node = self.traced(branch, piece, parent, depth);
        self.push(node, branch, Some(piece), 0.0)
    }

    /// The bends of a branch were made before its end was.
    fn bind_bends(&mut self, branch: usize) {
        let end = self.place_of[branch];
        for (i, node) in self.nodes.iter_mut().enumerate() {
            if self.branch_of[i] == branch && Some(NodeId(i as u32)) != end && i > 0 {
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
        let at = self.wood.nodes[piece].position_px;
        let foot = self.old.foot_px;
        Point3::new(at.x - foot.x, foot.y - at.y, depth)
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

    fn push(&mut self, node: Node, branch: usize, piece: Option<usize>, share: f64) -> NodeId {
        let place = NodeId(self.nodes.len() as u32);
        self.nodes.push(node);
        self.branch_of.push(branch);
        let radius_px = piece.map(|piece| self.wood.nodes[piece].radius_px);
        self.seen_px.push(radius_px.filter(|px| *px > 0.0));
        self.share.push(share);
        if let Some(piece) = piece {
            self.place_of_wood[piece] = Some(place);
        }
        place
    }

    /// A branch none of whose wood is seen: it leaves the branch that carries it where its points
    /// are nearest to that.
    fn off_wood(&mut self, branch: usize) {
        let old = &self.old.nodes[branch];
        let carrier = old.parent.map_or(0, NodeId::index);
        let nearest = self.nearest_on(carrier, branch);
        let parent = self.without_fold(nearest, old.position);
        let node = Node {
            parent: Some(parent),
            ..old.clone()
        };
        let place = self.push(node, branch, None, 1.0);
        self.place_of[branch] = Some(place);
    }

    /// `begin`, or the nearest place below it from which a straight branch to `end` does not turn
    /// back on what it leaves.
    fn without_fold(&self, begin: NodeId, end: Point3<f64>) -> NodeId {
        let mut at = begin;
        while let Some(below) = self.nodes[at.index()].parent {
            let here = self.nodes[at.index()].position;
            let arrives = here - self.nodes[below.index()].position;
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
        for (i, node) in self.nodes.iter().enumerate() {
            if self.branch_of[i] != carrier || i == 0 {
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
            nodes: std::mem::take(&mut self.nodes),
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
        self.nodes = skeleton.nodes;
    }

    /// Gives the traced nodes names: those of the nearest traced nodes of the tree before, where
    /// they are in the same place.
    fn name(&mut self, names: &mut Names) {
        let reach_px = SAME_PX * f64::from(self.old.image_size.width) / 640.0;
        let mut before: Vec<(NodeName, Point3<f64>)> = Vec::new();
        for node in names.prior.iter().flat_map(|prior| &prior.nodes) {
            if node.kind == NodeKind::Traced && node.copy_of.is_none() {
                before.push((node.name, node.position));
            }
        }
        for node in &mut self.nodes {
            if node.kind != NodeKind::Traced {
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

    /// The copies, each along the wood of its original turned into its plane.
    fn copies(&mut self, names: &mut Names) {
        let measured = self.nodes.len();
        let old_copies: Vec<usize> = (self.old.measured()..self.old.nodes.len()).collect();
        let mut planes: Vec<f64> = Vec::new();
        for &copy in &old_copies {
            let angle = self.old.nodes[copy].plane_angle;
            if !planes.contains(&angle) {
                planes.push(angle);
            }
        }
        for plane_angle in planes {
            let mut ways: Vec<Option<CopyWay>> = vec![None; self.old.measured()];
            for &copy in &old_copies {
                let node = &self.old.nodes[copy];
                if let (Some(original), true) = (node.copy_of, node.plane_angle == plane_angle) {
                    ways[original.index()] = Some(CopyWay::of(self.old, copy, original));
                }
            }
            self.copy_to_plane(plane_angle, measured, &ways, names);
        }
    }

    fn copy_to_plane(
        &mut self,
        plane_angle: f64,
        measured: usize,
        ways: &[Option<CopyWay>],
        names: &mut Names,
    ) {
        let mut copy_of: Vec<Option<NodeId>> = vec![None; measured];
        for original in 1..measured {
            let Some(copied) = ways[self.branch_of[original]] else {
                continue;
            };
            let node = self.nodes[original].clone();
            let Some(parent) = node.parent else { continue };
            let way = node.position - self.nodes[parent.index()].position;
            let on = copy_of[parent.index()].unwrap_or(parent);
            let is_mover = node.moves_with.is_none();
            let copy = Node {
                name: if is_mover { copied.name } else { names.take() },
                parent: Some(on),
                position: self.nodes[on.index()].position
                    + copied.into_plane * way
                    + self.share[original] * copied.pushed,
                n_tracks: 0,
                copy_of: Some(NodeId(original as u32)),
                plane_angle,
                ..node
            };
            let place = self.push(copy, self.branch_of[original], None, 0.0);
            self.seen_px[place.index()] = self.seen_px[original];
            copy_of[original] = Some(place);
        }
        for copy in copy_of.iter().flatten() {
            let mover = self.nodes[copy.index()].moves_with;
            self.nodes[copy.index()].moves_with = mover.and_then(|m| copy_of[m.index()]);
        }
    }
}

/// How a copy stands to its original.
#[derive(Clone, Copy, Debug)]
struct CopyWay {
    name: NodeName,
    into_plane: UnitQuaternion<f64>,
    /// By how much its end was pushed out of the plane.
    pushed: Vector3<f64>,
}

impl CopyWay {
    fn of(skeleton: &Skeleton, copy: usize, original: NodeId) -> Self {
        let node = &skeleton.nodes[copy];
        let into_plane = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), node.plane_angle);
        let turned = into_plane * way_of(skeleton, original.index());
        Self {
            name: node.name,
            into_plane,
            pushed: way_of(skeleton, copy) - turned,
        }
    }
}

/// From a node's parent to the node.
fn way_of(skeleton: &Skeleton, node: usize) -> Vector3<f64> {
    let node = &skeleton.nodes[node];
    let parent = node.parent.map(|p| skeleton.nodes[p.index()].position);
    parent.map_or_else(Vector3::zeros, |parent| node.position - parent)
}

impl Names<'_> {
    fn take(&mut self) -> NodeName {
        self.next += 1;
        NodeName(self.next - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Size, WoodNode};

    const FOOT: Point2<f64> = Point2::new(300.0, 300.0);

    fn node(name: u32, parent: Option<u32>, at: [f64; 3], copy_of: Option<u32>) -> Node {
        Node {
            name: NodeName(name),
            parent: parent.map(NodeId),
            level: parent.map_or(0, |p| if p == 0 { 1 } else { 2 }),
            position: at.into(),
            radius: 1.0,
            n_tracks: 9,
            certainty: 0.5,
            copy_of: copy_of.map(NodeId),
            plane_angle: copy_of.map_or(0.0, |_| 1.0),
            moves_with: None,
            kind: Default::default(),
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
        WoodNode {
            parent,
            position_px: Point2::new(FOOT.x + x, FOOT.y - y),
            radius_px: 5.0,
        }
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

//! Branches, and ends of branches, whose wood is not seen: they go straight, and their forks stand where the
//! tree needs least wood.

use super::{Build, PointOn};
use crate::model::{Node, NodeId, NodeName};
use crate::signal::distance_to_segment;
use crate::solve::bent_tree::way_of;
use crate::solve::least_wood::{Free, settle};
use nalgebra::{Point2, Point3};

/// A straight branch has no joints nearer to each other, or to its ends, than this, px at 640 px
/// picture width.
const JOINT_PX: f64 = 4.0;

/// A branch that ends beside a piece of wood ends on it after this share of its length at least: it
/// needs a length to turn.
const LEAST_SHARE: f64 = 0.3;

/// A place on wood beside the end of a branch.
struct Beside {
    /// The node from which the piece of wood comes.
    from: usize,
    at_px: Point2<f64>,
}

impl Build<'_> {
    /// A branch that has no wood of its own: it leaves the wood that most of its points are on,
    /// whichever branch has that, and where they are on none, the branch that carries it where they
    /// are nearest to that.
    pub(super) fn off_wood(&mut self, branch: usize) {
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
        let share = (end_px - from_px).dot(&way) / way.norm_squared().max(f64::MIN_POSITIVE);
        Some(Beside {
            from,
            at_px: from_px + share.clamp(LEAST_SHARE, 1.0) * way,
        })
    }

    /// A branch, or the part of it, whose wood is not seen.
    pub(super) fn push_unseen(
        &mut self,
        branch: usize,
        from: NodeId,
        end: Point3<f64>,
        share: f64,
    ) {
        let first = self.tree.nodes.len();
        self.push_straight(branch, from, end, share);
        self.unseen.extend(first..self.tree.nodes.len());
    }

    /// Forks that are not seen stand where the tree needs least wood, copies as well; tips stay.
    pub(super) fn settle_unseen(&mut self) {
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

    /// The node of a piece of wood, or of the last below it that is there already or that a branch
    /// before `branch` has: that becomes side wood.
    pub(super) fn reach(&mut self, piece: usize, branch: usize) -> NodeId {
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
}

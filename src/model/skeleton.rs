//! The tree as joints and branches in 3D.

use super::{JointPose, Size};
use nalgebra::{Point2, Point3};

/// What lies farther from the foot than this, or at a place that is no number, is neither read nor
/// drawn, px.
pub const FARTHEST_PX: f64 = 1e6;

/// Height of a tree that was not filmed, px, and the room around it in its picture.
pub const NOT_FILMED_PX: f64 = 720.0;
const ROOM_PX: f64 = 40.0;

/// Index into [`Skeleton::nodes`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeId(pub u32);

impl NodeId {
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Names one node for good: it keeps its name when the tree is refined, and no other node of the
/// capture ever gets it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeName(pub u32);

/// Where a branch comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum NodeKind {
    /// Points that move together were followed on it.
    #[default]
    Measured,
    /// The modal analysis found it at the end of a measured branch.
    Shoot,
    /// A generator made it up.
    Grown,
    /// It was drawn or seen in a still picture.
    Traced,
}

impl NodeKind {
    pub const ALL: [Self; 4] = [Self::Measured, Self::Shoot, Self::Grown, Self::Traced];
    /// What files say of a node that repeats another one, in place of that one's kind.
    pub const COPY: &str = "copy";
    /// The column of tables of wood that says whether nobody has seen it: 1 or 0.
    pub const MADE_UP_COLUMN: &str = "made_up";

    /// One word for files.
    pub fn word(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Shoot => "shoot",
            Self::Grown => "grown",
            Self::Traced => "traced",
        }
    }

    /// The kind of that [`word`](Self::word).
    pub fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.word() == word)
    }
}

/// The end of a branch. The branch itself runs from the parent node to this one; the first node is
/// the trunk's foot.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// What it is called outside, in every file and on the screen; its place in the array changes
    /// with a refinement.
    pub name: NodeName,
    pub parent: Option<NodeId>,
    /// 0 at the trunk's foot, 1 at the trunk's top, one more with every cut of the hierarchy: one
    /// more than the branch that carries this one, [`Skeleton::moving_parent`]. A bend has the
    /// level of the limb's end, and side wood is one above the branch that it is a part of.
    pub level: u8,
    /// Position at rest in model axes: x right, y up, z towards the viewer, px, the trunk's foot at
    /// the origin.
    pub position: Point3<f64>,
    /// Radius of the branch that ends here, px.
    pub radius: f64,
    /// Points that move with this node or one below it; 0 for a copy, which nothing was measured
    /// on.
    pub n_tracks: u32,
    /// Where it comes from; a copy says what its original does.
    pub kind: NodeKind,
    /// How sure it is that the branches above part here, 0 to 1; 0 at a tip, and at the foot, which
    /// nothing parts from.
    pub certainty: f32,
    /// The measured node that this one repeats on a plane turned about the trunk.
    pub copy_of: Option<NodeId>,
    /// Angle by which the copy's plane is turned about the y axis, radians; 0 for a measured node.
    pub plane_angle: f64,
    /// The node of whose branch this one is a rigid part: a bend on the way to it, or side wood on
    /// which no point was followed. That one moves on its own and is not the foot; its bends stand
    /// before it, side wood may stand on either side. All parts of a branch hang together, or on
    /// the place where it begins. `None`: it moves on its own.
    pub moves_with: Option<NodeId>,
}

impl Node {
    /// What files say of where it comes from: its kind in one word, or that it is a copy.
    pub fn kind_word(&self) -> &'static str {
        match self.copy_of {
            Some(_) => NodeKind::COPY,
            None => self.kind.word(),
        }
    }

    /// Whether nobody has seen it: a copy of a branch, or one that a generator made up.
    pub fn is_made_up(&self) -> bool {
        self.copy_of.is_some() || self.kind == NodeKind::Grown
    }
}

#[cfg(test)]
impl Node {
    /// A measured node for tests, with one point and of level 0.
    pub(crate) fn made_up(name: u32, parent: Option<u32>, at: [f64; 3]) -> Self {
        Self {
            name: NodeName(name),
            parent: parent.map(NodeId),
            level: 0,
            position: at.into(),
            radius: 1.0,
            n_tracks: 1,
            kind: NodeKind::Measured,
            certainty: 1.0,
            copy_of: None,
            plane_angle: 0.0,
            moves_with: None,
        }
    }
}

/// Nodes with parents before children, the foot first, all measured nodes before all copies.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    pub nodes: Vec<Node>,
    /// The trunk's foot in the picture, px: the origin of the model.
    pub foot_px: Point2<f64>,
    /// Size of the picture that the model was taken from.
    pub image_size: Size,
}

#[cfg(test)]
impl Skeleton {
    /// A trunk that forks into two limbs, for tests; the right one goes on as the trunk. Names are
    /// not indices.
    pub(crate) fn forked() -> Self {
        let mut nodes = vec![
            Node::made_up(10, None, [0.0, 0.0, 0.0]),
            Node::made_up(11, Some(0), [0.0, 100.0, 0.0]),
            Node::made_up(12, Some(1), [-40.0, 160.0, 0.0]),
            Node::made_up(13, Some(1), [5.0, 190.0, 0.0]),
        ];
        for (node, level) in nodes.iter_mut().zip([0, 1, 2, 2]) {
            node.level = level;
        }
        Self {
            nodes,
            foot_px: [320.0, 300.0].into(),
            image_size: Size::new(640, 360),
        }
    }
}

impl Skeleton {
    /// A tree that was not filmed, [`NOT_FILMED_PX`] high, in a picture that holds all of it.
    pub fn not_filmed(nodes: Vec<Node>) -> Self {
        let (mut left, mut right, mut bottom) = (0.0_f64, 0.0_f64, 0.0_f64);
        for node in &nodes {
            left = left.min(node.position.x);
            right = right.max(node.position.x);
            bottom = bottom.min(node.position.y);
        }
        let size =
            [right - left, NOT_FILMED_PX - bottom].map(|side| (side + 2.0 * ROOM_PX).ceil() as u32);
        Self {
            nodes,
            foot_px: Point2::new(ROOM_PX - left, ROOM_PX + NOT_FILMED_PX),
            image_size: Size::new(size[0], size[1]),
        }
    }

    /// Number of nodes that were measured; they come first.
    pub fn measured(&self) -> usize {
        self.nodes
            .iter()
            .take_while(|n| n.copy_of.is_none())
            .count()
    }

    /// The measured nodes alone.
    pub fn without_copies(&self) -> Self {
        Self {
            nodes: self.nodes[..self.measured()].to_vec(),
            foot_px: self.foot_px,
            image_size: self.image_size,
        }
    }

    /// The highest level of a node.
    pub fn deepest_level(&self) -> u8 {
        self.nodes.iter().map(|n| n.level).max().unwrap_or(0)
    }

    /// Every node where it rests.
    pub fn joints_at_rest(&self) -> Vec<JointPose> {
        let positions = self.nodes.iter().map(|n| n.position);
        positions.map(JointPose::at_rest).collect()
    }

    /// The measured nodes that move on their own, in order, without the foot.
    pub fn measured_branches(&self) -> impl Iterator<Item = NodeId> {
        let nodes = (1..self.measured().max(1) as u32).map(NodeId);
        nodes.filter(|n| self.mover(*n) == *n)
    }

    /// The foot, then the measured branches in order: where each node of a tree whose branches are
    /// straight stands in the same tree with bends and side wood.
    pub fn foot_and_branches(&self) -> Vec<NodeId> {
        let foot = std::iter::once(NodeId(0));
        foot.chain(self.measured_branches()).collect()
    }

    /// Orthographic projection of a point in model axes to the picture, px.
    pub fn image_from_model(&self, p: &Point3<f64>) -> Point2<f64> {
        Point2::new(self.foot_px.x + p.x, self.foot_px.y - p.y)
    }

    /// The name of a node of this skeleton.
    pub fn name_of(&self, node: NodeId) -> Option<NodeName> {
        self.nodes.get(node.index()).map(|n| n.name)
    }

    /// The nodes that carry a node, nearest first. A file may say anything; a parent stands before
    /// its child, or the walk ends.
    pub fn ancestors(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        let below = |n: &NodeId| self.nodes.get(n.index())?.parent.filter(|p| p < n);
        std::iter::successors(below(&node), below)
    }

    /// The node that `node` moves with: itself, unless it is a rigid part of another one's branch.
    /// What a file says of a node that moves with the foot, or with one that has no motion of its
    /// own either, does not count.
    pub fn mover(&self, node: NodeId) -> NodeId {
        let own = self.nodes.get(node.index()).filter(|n| n.parent.is_some());
        let moves = |m: &NodeId| {
            let mover = self.nodes.get(m.index());
            mover.is_some_and(|m| m.moves_with.is_none() && m.parent.is_some())
        };
        own.and_then(|n| n.moves_with).filter(moves).unwrap_or(node)
    }

    /// Where the branch that `node` is the end or a part of begins, and about which it turns: the
    /// first node below its end that moves with another one. `None` for the foot, and where the
    /// branch hangs on nothing.
    pub fn begin(&self, node: NodeId) -> Option<NodeId> {
        let mover = self.mover(node);
        self.ancestors(mover).find(|n| self.mover(*n) != mover)
    }

    /// The branch that carries the one that `node` is the end or a part of, as the node in which
    /// that ends. `None` for the foot, and where a file lets branches carry each other.
    pub fn moving_parent(&self, node: NodeId) -> Option<NodeId> {
        let begin = self.begin(node)?;
        let parent = self.mover(begin);
        // A branch begins above the place where its carrier does.
        let is_above = self.begin(parent).is_none_or(|of_parent| of_parent < begin);
        is_above.then_some(parent)
    }

    /// Whether `node` is a bend: a part of a branch on the way to its end.
    pub fn is_bend(&self, node: NodeId) -> bool {
        let mover = self.mover(node);
        let mut part = self
            .ancestors(mover)
            .take_while(|n| self.mover(*n) == mover);
        part.any(|n| n == node)
    }

    /// The branches that carry a node's, nearest first, as the nodes in which they end; the foot
    /// last.
    pub fn carriers(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        let below = |n: &NodeId| self.moving_parent(*n);
        std::iter::successors(below(&node), below)
    }

    /// Children of every node, by node index.
    pub fn children(&self) -> Vec<Vec<NodeId>> {
        let mut out = vec![Vec::new(); self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate() {
            if let Some(p) = node.parent {
                out[p.index()].push(NodeId(i as u32));
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nodes by parent and by what they move with.
    fn tree(nodes: &[(Option<u32>, Option<u32>)]) -> Skeleton {
        let mut skeleton = Skeleton {
            nodes: Vec::new(),
            foot_px: Point2::origin(),
            image_size: Size::new(64, 64),
        };
        for (i, (parent, mover)) in (0..).zip(nodes) {
            skeleton.nodes.push(Node {
                moves_with: mover.map(NodeId),
                ..Node::made_up(i, *parent, [0.0, f64::from(i), 0.0])
            });
        }
        skeleton
    }

    fn begins(skeleton: &Skeleton) -> Vec<Option<u32>> {
        let nodes = (0..skeleton.nodes.len() as u32).map(NodeId);
        nodes.map(|n| skeleton.begin(n).map(|b| b.0)).collect()
    }

    fn parents(skeleton: &Skeleton) -> Vec<Option<u32>> {
        let nodes = (0..skeleton.nodes.len() as u32).map(NodeId);
        nodes
            .map(|n| skeleton.moving_parent(n).map(|p| p.0))
            .collect()
    }

    /// Numbers of nodes; 9 stands for none.
    fn by_number(nodes: [u32; 8]) -> [Option<u32>; 8] {
        nodes.map(|n| (n != 9).then_some(n))
    }

    /// Foot, trunk, a limb with two bends (2 and 4) that ends in 5, a branch (3) that leaves it at
    /// the first and stands before its end, and side wood (6 and 7).
    fn bent() -> Skeleton {
        tree(&[
            (None, None),
            (Some(0), None),
            (Some(1), Some(5)),
            (Some(2), None),
            (Some(2), Some(5)),
            (Some(4), None),
            (Some(4), Some(5)),
            (Some(6), Some(5)),
        ])
    }

    #[test]
    fn a_branch_begins_below_its_bends_and_is_carried_by_what_moves_it_there() {
        let tree = bent();
        assert_eq!(begins(&tree), by_number([9, 0, 1, 2, 1, 1, 1, 1]));
        assert_eq!(parents(&tree), by_number([9, 0, 1, 5, 1, 1, 1, 1]));
        let carriers: Vec<u32> = tree.carriers(NodeId(3)).map(|n| n.0).collect();
        assert_eq!(carriers, [5, 1, 0]);
        let bends: Vec<u32> = (0..8).filter(|n| tree.is_bend(NodeId(*n))).collect();
        assert_eq!(bends, [2, 4]);
        let measured: Vec<u32> = tree.measured_branches().map(|n| n.0).collect();
        assert_eq!(measured, [1, 3, 5]);
        assert_eq!(tree.foot_and_branches(), [0, 1, 3, 5].map(NodeId));
    }

    /// The limb comes before what it carries, though it stands behind it.
    #[test]
    fn branches_come_after_what_carries_them() {
        let branches = bent().moving_branches();
        let order: Vec<u32> = branches.iter().map(|b| b.node.0).collect();
        assert_eq!(order, [1, 5, 3]);
        assert_eq!(branches[1].riders, [2, 4, 6, 7].map(NodeId));
        let straight = tree(&[
            (None, None),
            (Some(0), None),
            (Some(0), None),
            (Some(1), None),
        ]);
        let order: Vec<u32> = straight
            .moving_branches()
            .iter()
            .map(|b| b.node.0)
            .collect();
        assert_eq!(order, [1, 2, 3]);
    }

    #[test]
    fn what_a_file_may_say_neither_hangs_nor_panics() {
        let odd = [
            // Movers that move with each other, with themselves, with the foot, with nobody.
            tree(&[
                (None, Some(1)),
                (Some(0), Some(2)),
                (Some(1), Some(1)),
                (Some(2), Some(3)),
                (Some(3), Some(0)),
                (Some(4), Some(99)),
            ]),
            // Branches that carry each other.
            tree(&[
                (None, None),
                (Some(0), Some(4)),
                (Some(0), Some(3)),
                (Some(1), None),
                (Some(2), None),
            ]),
            // Parents behind their children, and none at all.
            tree(&[
                (Some(3), None),
                (Some(1), Some(0)),
                (Some(9), Some(1)),
                (None, Some(0)),
            ]),
            tree(&[]),
        ];
        for tree in &odd {
            let branches = tree.moving_branches();
            assert!(branches.len() < tree.nodes.len().max(1));
            for node in (0..12).map(NodeId) {
                assert_eq!(tree.mover(tree.mover(node)), tree.mover(node));
                assert!(tree.carriers(node).count() <= tree.nodes.len());
                tree.is_bend(node);
            }
            assert_eq!(tree.main_branches().len(), tree.nodes.len());
        }
    }
}

//! The tree as joints and branches in 3D.

use super::Size;
use nalgebra::{Point2, Point3};

/// What lies farther from the foot than this, or at a place that is no number, is neither read nor
/// drawn, px.
pub const FARTHEST_PX: f64 = 1e6;

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
    /// 0 at the trunk's foot, 1 at the trunk's top, one more with every cut of the hierarchy.
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

impl Skeleton {
    /// Number of nodes that were measured; they come first.
    pub fn measured(&self) -> usize {
        self.nodes
            .iter()
            .take_while(|n| n.copy_of.is_none())
            .count()
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

//! A tree whose branches have bends, put together node by node, and its copies.

use crate::model::{Node, NodeId, NodeName, Skeleton};
use crate::shape::set_side_depths_apart;
use nalgebra::{UnitQuaternion, Vector3};

/// Names for nodes that no tree before had.
pub(super) struct Names<'a> {
    /// The next free one.
    pub next: u32,
    /// The tree before, whose traced nodes go on where they are the same.
    pub prior: Option<&'a Skeleton>,
}

impl Names<'_> {
    /// A name that no node has.
    pub fn take(&mut self) -> NodeName {
        self.next += 1;
        NodeName(self.next - 1)
    }
}

/// A tree with bends and side wood while it grows, of one whose branches are straight. All vectors
/// have an entry a node.
pub(super) struct BentTree {
    pub nodes: Vec<Node>,
    /// The measured node of the straight tree in which the node's branch ends.
    pub branch_of: Vec<usize>,
    /// Radius where the picture shows it, px; a copy has that of its original.
    pub seen_px: Vec<Option<f64>>,
    /// The share of its branch's push that is met with on the way to it from its parent; 0 for side
    /// wood.
    share: Vec<f64>,
}

impl BentTree {
    /// The foot alone.
    pub fn on_foot_of(straight: &Skeleton) -> Self {
        Self {
            nodes: straight.nodes.first().cloned().into_iter().collect(),
            branch_of: vec![0],
            seen_px: vec![None],
            share: vec![1.0],
        }
    }

    /// Adds a node and returns its place.
    pub fn push(&mut self, node: Node, branch: usize, share: f64, seen_px: Option<f64>) -> NodeId {
        let place = NodeId(self.nodes.len() as u32);
        self.nodes.push(node);
        self.branch_of.push(branch);
        self.seen_px.push(seen_px);
        self.share.push(share);
        place
    }

    /// Gives side wood a depth, which goes by no push. `straight` is the tree with straight branches.
    pub fn set_side_depths(&mut self, straight: &Skeleton) {
        let mut tree = Skeleton {
            nodes: std::mem::take(&mut self.nodes),
            foot_px: straight.foot_px,
            image_size: straight.image_size,
        };
        set_side_depths_apart(&mut tree);
        self.nodes = tree.nodes;
    }

    /// Adds the copies that `plain` has of its branches, each along the wood of its original turned into
    /// its plane. `straight` is the same tree with the branches that motion shows besides: they are
    /// copied with the branch that bears them, which ends where they leave it.
    pub fn copy_into_planes(&mut self, plain: &Skeleton, straight: &Skeleton, names: &mut Names) {
        let measured = self.nodes.len();
        for plane_angle in plane_angles(plain) {
            let mut ways = copy_ways(plain, plane_angle);
            for sub_branch in &straight.nodes[plain.measured()..straight.measured()] {
                let bearer = sub_branch.parent.and_then(|on| ways[on.index()]);
                ways.push(bearer.map(CopyWay::of_sub_branch));
            }
            self.copy_into_plane(plane_angle, measured, &ways, names);
        }
    }

    /// `ways` holds how the branches stand that are copied into this plane, by branch; `measured`
    /// is the number of nodes that are no copies.
    fn copy_into_plane(
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
            let own_name = copied.name.filter(|_| node.moves_with.is_none());
            let copy = Node {
                name: own_name.unwrap_or_else(|| names.take()),
                parent: Some(on),
                position: self.nodes[on.index()].position
                    + copied.into_plane * way
                    + self.share[original] * copied.pushed,
                n_tracks: 0,
                copy_of: Some(NodeId(original as u32)),
                plane_angle,
                ..node
            };
            let (branch, seen_px) = (self.branch_of[original], self.seen_px[original]);
            copy_of[original] = Some(self.push(copy, branch, 0.0, seen_px));
        }
        for copy in copy_of.iter().flatten() {
            let mover = self.nodes[copy.index()].moves_with;
            self.nodes[copy.index()].moves_with = mover.and_then(|m| copy_of[m.index()]);
        }
    }
}

/// The angles of the planes that a tree has copies in, in the order of the copies.
pub(super) fn plane_angles(straight: &Skeleton) -> Vec<f64> {
    let mut angles: Vec<f64> = Vec::new();
    for copy in &straight.nodes[straight.measured()..] {
        if !angles.contains(&copy.plane_angle) {
            angles.push(copy.plane_angle);
        }
    }
    angles
}

/// How the copies in one plane stand to their originals, by measured node.
fn copy_ways(straight: &Skeleton, plane_angle: f64) -> Vec<Option<CopyWay>> {
    let measured = straight.measured();
    let mut ways = vec![None; measured];
    for (copy, node) in straight.nodes.iter().enumerate().skip(measured) {
        if let (Some(original), true) = (node.copy_of, node.plane_angle == plane_angle) {
            ways[original.index()] = Some(CopyWay::of(straight, copy, original));
        }
    }
    ways
}

/// How a copy stands to its original.
#[derive(Clone, Copy, Debug)]
struct CopyWay {
    /// `None` for a sub-branch.
    name: Option<NodeName>,
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
            name: Some(node.name),
            into_plane,
            pushed: way_of(skeleton, copy) - turned,
        }
    }

    /// Of a sub-branch on what is copied like this.
    fn of_sub_branch(self) -> Self {
        Self {
            name: None,
            pushed: Vector3::zeros(),
            ..self
        }
    }
}

/// From a node's parent to the node.
pub(super) fn way_of(skeleton: &Skeleton, node: usize) -> Vector3<f64> {
    let node = &skeleton.nodes[node];
    let parent = node.parent.map(|p| skeleton.nodes[p.index()].position);
    parent.map_or_else(Vector3::zeros, |parent| node.position - parent)
}

/// The share of a branch's push that is met with on `px` of its way, which is `whole_px` long: it
/// is even from where the branch begins to its end. `pushed` is the way of the straight branch: one
/// that is shorter than it was thought to be was pushed too far.
pub(super) fn share_of_push(pushed: &Vector3<f64>, px: f64, whole_px: f64) -> f64 {
    let scale = (whole_px / pushed.norm().max(f64::MIN_POSITIVE)).min(1.0);
    scale * px / whole_px.max(f64::MIN_POSITIVE)
}

//! Trees with parts that move with a branch: bends, side wood, limbs that leave another one in its
//! middle.

// Every test file compiles this module for itself and uses a part of it.
#![allow(dead_code)]

use arborcam::model::{Node, NodeId, NodeKind, NodeName, Pose, Size, Skeleton};
use nalgebra::{Point2, Point3, UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_2;

/// Names of what is put in begin here.
const NEW_NAMES: u32 = 10_000;

/// A tree with parts put in.
pub struct Bent {
    pub skeleton: Skeleton,
    /// Where each node of the straight tree is in it.
    pub of: Vec<usize>,
    /// The bend of each branch of the straight tree.
    bends: Vec<usize>,
}

impl Bent {
    /// `straight` with a bend in every branch, and side wood on some bends and some ends. With
    /// `in_the_middle` every second branch above the trunk leaves its carrier at the bend.
    pub fn of(straight: &Skeleton, in_the_middle: bool) -> Self {
        let mut bent = Self {
            skeleton: Skeleton {
                nodes: Vec::new(),
                ..straight.clone()
            },
            of: Vec::new(),
            bends: Vec::new(),
        };
        for (i, node) in straight.nodes.iter().enumerate() {
            match node.parent {
                Some(parent) => {
                    let original = node.copy_of.map_or(i, NodeId::index);
                    let leaves_bend = in_the_middle && node.level > 2 && original % 2 == 0;
                    bent.add(straight, node, parent.index(), leaves_bend);
                }
                None => {
                    bent.of.push(bent.skeleton.nodes.len());
                    bent.bends.push(bent.skeleton.nodes.len());
                    bent.skeleton.nodes.push(node.clone());
                }
            }
        }
        bent
    }

    fn add(&mut self, straight: &Skeleton, node: &Node, parent: usize, leaves_bend: bool) {
        let original = node.copy_of.map(NodeId::index);
        let like = original.unwrap_or(self.of.len());
        let (side, twig) = (like % 3 == 1, like % 4 == 2);
        let first = self.skeleton.nodes.len();
        let end = first + 1 + usize::from(side);
        let from = if leaves_bend {
            self.bends[parent]
        } else {
            self.of[parent]
        };
        let from_at = straight.nodes[parent].position;
        let middle = from_at + 0.5 * (node.position - from_at) + Vector3::new(7.0, 3.0, -4.0);
        let kind = NodeKind::Traced;
        let bend = Node {
            name: NodeName(NEW_NAMES + first as u32),
            parent: Some(NodeId(from as u32)),
            position: middle,
            n_tracks: 0,
            kind,
            copy_of: original.map(|o| NodeId(self.bends[o] as u32)),
            moves_with: Some(NodeId(end as u32)),
            ..node.clone()
        };
        let side_wood = |at: usize, on: usize, from: Point3<f64>, copy_of: Option<usize>| Node {
            name: NodeName(NEW_NAMES + at as u32),
            parent: Some(NodeId(on as u32)),
            level: node.level + 1,
            position: from + Vector3::new(-9.0, 12.0, 5.0),
            copy_of: copy_of.map(|k| NodeId(k as u32)),
            ..bend.clone()
        };
        let nodes = &mut self.skeleton.nodes;
        nodes.push(bend.clone());
        if side {
            let of = original.map(|o| self.bends[o] + 1);
            nodes.push(side_wood(first + 1, first, middle, of));
        }
        nodes.push(Node {
            parent: Some(NodeId(first as u32)),
            copy_of: original.map(|o| NodeId(self.of[o] as u32)),
            ..node.clone()
        });
        if twig {
            let of = original.map(|o| self.of[o] + 1);
            nodes.push(side_wood(end + 1, end, node.position, of));
        }
        self.of.push(end);
        self.bends.push(first);
    }

    /// Values by node of the straight tree as values by node of this one.
    pub fn spread<T: Clone>(&self, values: &[T], otherwise: T) -> Vec<T> {
        let mut out = vec![otherwise; self.skeleton.nodes.len()];
        for (value, at) in values.iter().zip(&self.of) {
            out[*at] = value.clone();
        }
        out
    }
}

/// Trunk with a bend; on it a limb of two bends and a twig, side wood on side wood, and a branch
/// that leaves the limb at its first bend and stands before the limb's end. All but the trunk is
/// repeated on a second plane.
pub fn hand_made() -> Skeleton {
    let node = |name, parent: Option<u32>, level, at: [f64; 3], with: Option<u32>| Node {
        name: NodeName(name),
        parent: parent.map(NodeId),
        level,
        position: at.into(),
        radius: 6.0 / f64::from(1 + level),
        n_tracks: if with.is_some() { 0 } else { 9 },
        kind: match with {
            Some(_) => NodeKind::Traced,
            None => NodeKind::Measured,
        },
        certainty: 0.5,
        copy_of: None,
        plane_angle: 0.0,
        moves_with: with.map(NodeId),
    };
    let mut nodes = vec![
        node(0, None, 0, [0.0; 3], None),
        node(11, Some(0), 1, [6.0, 50.0, 0.0], Some(2)),
        node(1, Some(1), 1, [0.0, 100.0, 0.0], None),
        node(12, Some(2), 2, [30.0, 115.0, 4.0], Some(6)),
        node(2, Some(3), 3, [35.0, 160.0, -9.0], None),
        node(13, Some(3), 2, [60.0, 150.0, 2.0], Some(6)),
        node(3, Some(5), 2, [80.0, 165.0, 10.0], None),
        node(4, Some(6), 3, [120.0, 200.0, 20.0], None),
        node(14, Some(5), 3, [75.0, 130.0, 2.0], Some(6)),
        node(15, Some(8), 3, [85.0, 135.0, 8.0], Some(6)),
    ];
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), FRAC_PI_2);
    let first = 3_u32;
    let shifted = |id: NodeId| NodeId(if id.0 < first { id.0 } else { id.0 + 7 });
    for original in first..10 {
        let from = nodes[original as usize].clone();
        nodes.push(Node {
            name: NodeName(100 + original),
            parent: from.parent.map(shifted),
            position: turn * from.position,
            n_tracks: 0,
            copy_of: Some(NodeId(original)),
            plane_angle: FRAC_PI_2,
            moves_with: from.moves_with.map(shifted),
            ..from
        });
    }
    Skeleton {
        nodes,
        foot_px: Point2::new(320.0, 340.0),
        image_size: Size::new(640, 360),
    }
}

/// Every edge has its length, and what moves with a node is turned as that is.
pub fn assert_rigid(skeleton: &Skeleton, pose: &Pose) {
    assert_eq!(pose.joints.len(), skeleton.nodes.len());
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let Some(parent) = node.parent.map(NodeId::index) else {
            continue;
        };
        let was = (node.position - skeleton.nodes[parent].position).norm();
        let is = (pose.joints[i].position - pose.joints[parent].position).norm();
        assert!((is - was).abs() < 1e-9, "edge {i}: {was} px became {is} px");
        let mover = skeleton.mover(NodeId(i as u32)).index();
        let turned = pose.joints[i]
            .rotation
            .angle_to(&pose.joints[mover].rotation);
        assert!(turned < 1e-9, "{i} turns by {turned} against {mover}");
    }
}

/// The nodes of the straight tree are where they are in the bent one.
pub fn assert_same_places(straight: &Pose, bent: &Bent, pose: &Pose) {
    for (i, joint) in straight.joints.iter().enumerate() {
        let other = &pose.joints[bent.of[i]];
        let off = (joint.position - other.position).norm();
        assert!(off < 1e-9, "node {i} is {off} px off");
        assert!(
            joint.rotation.angle_to(&other.rotation) < 1e-7,
            "node {i} is turned otherwise"
        );
    }
}

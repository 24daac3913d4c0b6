//! From the flat skeleton to a prototype in space: copies on planes turned about the trunk (Li 2011
//! sect. 3).

use super::envelope::Envelope;
use super::trunk::in_trunk;
use crate::model::{Node, NodeId, NodeKind, NodeName, Outline, Skeleton};
use crate::skeleton::Node2d;
use nalgebra::{Point2, Point3, Rotation3, Vector3};
use std::f64::consts::PI;

/// Stands the 2D skeleton in the plane z = 0 and repeats all that is not `trunk` on `planes - 1`
/// further planes, turned by equal parts of a half turn about the vertical through the place where
/// each branch leaves the trunk. One trunk remains. Nodes that a turn brings out of the envelope
/// are drawn in towards its axis. A node whose place is no number stands where its parent does: a
/// branch without length.
pub fn copy_to_planes(
    flat: &[Node2d],
    tracks: &[u32],
    trunk: &[bool],
    outline: &Outline,
    envelope: &Envelope,
    planes: u32,
) -> Skeleton {
    let foot_px = flat.first().map_or(Point2::origin(), |n| n.position_px);
    let mut nodes = measured_nodes(flat, tracks, foot_px);
    place(&mut nodes, envelope);
    lean_as_seen(&mut nodes, trunk, envelope);
    let axes = axes(&nodes, trunk);
    let measured = nodes.len();
    for plane in 1..planes {
        let plane_angle = PI * f64::from(plane) / f64::from(planes);
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), plane_angle);
        let mut copy_id: Vec<NodeId> = (0..measured as u32).map(NodeId).collect();
        for original in 0..measured {
            if in_trunk(trunk, original) {
                continue; // the trunk is one
            }
            copy_id[original] = NodeId(nodes.len() as u32);
            let node = &nodes[original];
            let turned = turn * (node.position - axes[original]) + axes[original];
            let copy = Node {
                name: NodeName(nodes.len() as u32),
                parent: node.parent.map(|p| copy_id[p.index()]),
                position: envelope.clamp(&turned),
                n_tracks: 0,
                copy_of: Some(NodeId(original as u32)),
                plane_angle,
                ..node.clone()
            };
            nodes.push(copy);
        }
    }
    Skeleton {
        nodes,
        foot_px,
        image_size: outline.size,
    }
}

/// A place in the picture in model axes, in the plane z = 0 through the foot, px.
pub(super) fn model_from_image(position_px: Point2<f64>, foot_px: Point2<f64>) -> Point3<f64> {
    Point3::new(position_px.x - foot_px.x, foot_px.y - position_px.y, 0.0)
}

/// The nodes of `flat` in the plane z = 0.
fn measured_nodes(flat: &[Node2d], tracks: &[u32], foot_px: Point2<f64>) -> Vec<Node> {
    let mut nodes = Vec::with_capacity(flat.len());
    for (i, (node, &n_tracks)) in flat.iter().zip(tracks).enumerate() {
        nodes.push(Node {
            name: NodeName(i as u32),
            parent: node.parent.map(|p| NodeId(p as u32)),
            level: node.level,
            position: model_from_image(node.position_px, foot_px),
            radius: 1.0,
            n_tracks,
            certainty: node.certainty,
            copy_of: None,
            plane_angle: 0.0,
            moves_with: None,
            kind: NodeKind::Measured,
        });
    }
    nodes
}

/// For every node a point of the vertical about which its copies turn: the place where its branch
/// leaves the trunk. A leader may lean, and a branch that leaves high up must turn about it and not
/// about its foot.
fn axes(nodes: &[Node], trunk: &[bool]) -> Vec<Vector3<f64>> {
    let mut axes: Vec<Vector3<f64>> = Vec::with_capacity(nodes.len());
    for node in nodes {
        let parent = node.parent.map_or(0, |p| p.index());
        let leaves = Vector3::new(nodes[parent].position.x, 0.0, nodes[parent].position.z);
        let axis = match axes.get(parent) {
            Some(&below) if !in_trunk(trunk, parent) => below,
            _ => leaves,
        };
        axes.push(axis);
    }
    axes
}

/// Leans the trunk towards the viewer or away as a depth camera has seen it, with all that grows on it.
fn lean_as_seen(nodes: &mut [Node], trunk: &[bool], envelope: &Envelope) {
    for i in 1..nodes.len() {
        let below_z = nodes[i].parent.map_or(0.0, |p| nodes[p.index()].position.z);
        let seen = envelope.seen(i).filter(|_| in_trunk(trunk, i));
        nodes[i].position.z = seen.map_or(below_z, |seen| seen.z_px);
    }
}

/// Brings the measured nodes into the envelope, the foot to the origin, and what has no place to
/// its parent's.
fn place(nodes: &mut [Node], envelope: &Envelope) {
    for i in 0..nodes.len() {
        let at = nodes[i].position;
        nodes[i].position = match nodes[i].parent {
            None => Point3::origin(),
            Some(_) if at.coords.iter().all(|x| x.is_finite()) => envelope.clamp(&at),
            Some(parent) => nodes[parent.index()].position,
        };
    }
}

//! From the flat skeleton to a prototype in space: copies on planes turned about the trunk (Li et
//! al. section 3).

use super::envelope::Envelope;
use crate::model::{Node, NodeId, NodeKind, NodeName, Outline, Skeleton};
use crate::skeleton::Node2d;
use nalgebra::{Point3, Rotation3, Vector3};
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
    let foot_px = flat.first().map_or([0.0, 0.0], |n| n.position_px);
    let model = |p: [f64; 2]| Point3::new(p[0] - foot_px[0], foot_px[1] - p[1], 0.0);
    let mut nodes: Vec<Node> = flat
        .iter()
        .zip(tracks)
        .enumerate()
        .map(|(i, (n, &n_tracks))| Node {
            name: NodeName(i as u32),
            parent: n.parent.map(|p| NodeId(p as u32)),
            level: n.level,
            position: model(n.position_px),
            radius: 1.0,
            n_tracks,
            certainty: n.certainty,
            copy_of: None,
            plane_angle: 0.0,
            kind: NodeKind::Measured,
        })
        .collect();
    place(&mut nodes, envelope);
    let measured = nodes.len();
    let is_trunk = |i: usize| trunk.get(i).is_some_and(|t| *t);
    // A leader may lean: a branch that leaves high up must turn about it, and not about its foot.
    let mut axes: Vec<Vector3<f64>> = Vec::with_capacity(measured);
    for node in &nodes {
        let parent = node.parent.map_or(0, |p| p.index());
        let leaves = Vector3::new(nodes[parent].position.x, 0.0, 0.0);
        axes.push(
            axes.get(parent)
                .copied()
                .filter(|_| !is_trunk(parent))
                .unwrap_or(leaves),
        );
    }
    for plane in 1..planes {
        let angle = PI * f64::from(plane) / f64::from(planes);
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), angle);
        let mut copy_id: Vec<NodeId> = (0..measured as u32).map(NodeId).collect();
        for original in 0..measured {
            if is_trunk(original) {
                continue; // the trunk is one
            }
            copy_id[original] = NodeId(nodes.len() as u32);
            let mut copy = nodes[original].clone();
            copy.name = NodeName(nodes.len() as u32);
            copy.parent = copy.parent.map(|p| copy_id[p.index()]);
            copy.position =
                envelope.clamp(&(turn * (copy.position - axes[original]) + axes[original]));
            (copy.n_tracks, copy.copy_of, copy.plane_angle) =
                (0, Some(NodeId(original as u32)), angle);
            nodes.push(copy);
        }
    }
    Skeleton {
        nodes,
        foot_px,
        image_size: outline.size,
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

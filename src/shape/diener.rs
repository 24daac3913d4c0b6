//! The skeleton on the front and the back of an ellipsoid (Diener et al. 2006), to compare with (Li
//! et al. figure 4 a).

use crate::model::{Node, NodeId, NodeName, Outline, Skeleton};
use crate::skeleton::Node2d;
use nalgebra::Point3;

/// Every node of the crown twice, on the near and on the far side of the ellipsoid of revolution
/// about the vertical that holds the crown's nodes; the copies are the mirror image of the
/// originals in depth.
pub fn diener(flat: &[Node2d], tracks: &[u32], trunk: &[bool], outline: &Outline) -> Skeleton {
    let foot_px = flat.first().map_or([0.0, 0.0], |n| n.position_px);
    let place = |n: &Node2d| {
        Point3::new(
            n.position_px[0] - foot_px[0],
            foot_px[1] - n.position_px[1],
            0.0,
        )
    };
    let is_trunk = |i: usize| trunk.get(i).is_some_and(|t| *t);
    let crown: Vec<Point3<f64>> = (0..flat.len())
        .filter(|&i| !is_trunk(i))
        .map(|i| place(&flat[i]))
        .collect();
    let depth = ellipsoid(&crown);
    let node = |(i, n): (usize, &Node2d)| Node {
        name: NodeName(i as u32),
        parent: n.parent.map(|p| NodeId(p as u32)),
        level: n.level,
        position: if is_trunk(i) {
            place(n)
        } else {
            Point3::new(place(n).x, place(n).y, depth(&place(n)))
        },
        radius: 1.0,
        n_tracks: tracks.get(i).copied().unwrap_or(0),
        certainty: n.certainty,
        copy_of: None,
        plane_angle: 0.0,
        kind: Default::default(),
    };
    let mut nodes: Vec<Node> = flat.iter().enumerate().map(node).collect();
    let mut copy_id: Vec<NodeId> = (0..flat.len() as u32).map(NodeId).collect();
    for i in (0..flat.len()).filter(|&i| !is_trunk(i)) {
        copy_id[i] = NodeId(nodes.len() as u32);
        let mut copy = nodes[i].clone();
        copy.name = NodeName(nodes.len() as u32);
        copy.parent = copy.parent.map(|p| copy_id[p.index()]);
        copy.position.z = -copy.position.z;
        (copy.n_tracks, copy.copy_of) = (0, Some(NodeId(i as u32)));
        nodes.push(copy);
    }
    Skeleton {
        nodes,
        foot_px,
        image_size: outline.size,
    }
}

/// Depth of the near side over every point of the crown: the ellipse has the proportions of the
/// crown's box and is as large as it must be for all points to be inside.
fn ellipsoid(crown: &[Point3<f64>]) -> impl Fn(&Point3<f64>) -> f64 {
    let ends = |c: usize| {
        let values = || crown.iter().map(move |p| p[c]);
        (
            values().fold(f64::INFINITY, f64::min),
            values().fold(f64::NEG_INFINITY, f64::max),
        )
    };
    let ((left, right), (low, high)) = (ends(0), ends(1));
    let centre = [(left + right) / 2.0, (low + high) / 2.0];
    let half = [
        ((right - left) / 2.0).max(1.0),
        ((high - low) / 2.0).max(1.0),
    ];
    let off_sq = move |p: &Point3<f64>| {
        ((p.x - centre[0]) / half[0]).powi(2) + ((p.y - centre[1]) / half[1]).powi(2)
    };
    let farthest_sq = crown.iter().map(off_sq).fold(1.0, f64::max);
    move |p| half[0] * (farthest_sq - off_sq(p)).max(0.0).sqrt()
}

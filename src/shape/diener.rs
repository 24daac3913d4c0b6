//! The skeleton on the front and the back of an ellipsoid (Diener et al. 2006), to compare with (Li
//! 2011 fig. 4 a).

use super::planes::model_from_image;
use super::trunk::in_trunk;
use crate::model::{Node, NodeId, NodeName, Outline, Skeleton};
use crate::skeleton::Node2d;
use nalgebra::{Point2, Point3, Vector2};

/// Every node of the crown twice, on the near and on the far side of the ellipsoid of revolution
/// about the vertical that holds the crown's nodes; the copies are the mirror image of the
/// originals in depth.
pub fn diener(flat: &[Node2d], tracks: &[u32], trunk: &[bool], outline: &Outline) -> Skeleton {
    let foot_px = flat.first().map_or(Point2::origin(), |n| n.position_px);
    let places: Vec<Point3<f64>> = flat
        .iter()
        .map(|n| model_from_image(n.position_px, foot_px))
        .collect();
    let crown: Vec<Point3<f64>> = (0..flat.len())
        .filter(|&i| !in_trunk(trunk, i))
        .map(|i| places[i])
        .collect();
    let ellipsoid = Ellipsoid::around(&crown);
    let mut nodes = Vec::with_capacity(2 * flat.len());
    for (i, n) in flat.iter().enumerate() {
        let mut position = places[i];
        if !in_trunk(trunk, i) {
            position.z = ellipsoid.depth(&position);
        }
        nodes.push(Node {
            name: NodeName(i as u32),
            parent: n.parent.map(|p| NodeId(p as u32)),
            level: n.level,
            position,
            radius: 1.0,
            n_tracks: tracks.get(i).copied().unwrap_or(0),
            certainty: n.certainty,
            copy_of: None,
            plane_angle: 0.0,
            moves_with: None,
            kind: Default::default(),
        });
    }
    let mut copy_id: Vec<NodeId> = (0..flat.len() as u32).map(NodeId).collect();
    for i in 0..flat.len() {
        if in_trunk(trunk, i) {
            continue;
        }
        copy_id[i] = NodeId(nodes.len() as u32);
        let mut copy: Node = nodes[i].clone();
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

/// An ellipsoid of revolution about the vertical, px.
struct Ellipsoid {
    centre: Point2<f64>,
    /// Half of its width and of its height, but for the factor below.
    half: Vector2<f64>,
    /// Square of the factor that makes it hold all points.
    farthest_sq: f64,
}

impl Ellipsoid {
    /// In the proportions of the box around `crown`, and as large as it must be for all of it to be
    /// inside.
    fn around(crown: &[Point3<f64>]) -> Self {
        let (mut low, mut high) = (
            Point3::from([f64::INFINITY; 3]),
            Point3::from([f64::NEG_INFINITY; 3]),
        );
        for point in crown {
            (low, high) = (low.inf(point), high.sup(point));
        }
        let mut ellipsoid = Self {
            centre: Point2::new((low.x + high.x) / 2.0, (low.y + high.y) / 2.0),
            half: Vector2::new(
                ((high.x - low.x) / 2.0).max(1.0),
                ((high.y - low.y) / 2.0).max(1.0),
            ),
            farthest_sq: 1.0,
        };
        for point in crown {
            ellipsoid.farthest_sq = ellipsoid.farthest_sq.max(ellipsoid.off_sq(point));
        }
        ellipsoid
    }

    /// Square of the distance from the centre, 1 on the ellipse of the box.
    fn off_sq(&self, p: &Point3<f64>) -> f64 {
        (p.xy() - self.centre)
            .component_div(&self.half)
            .norm_squared()
    }

    /// Depth of the near side at a point of the crown, px.
    fn depth(&self, p: &Point3<f64>) -> f64 {
        self.half.x * (self.farthest_sq - self.off_sq(p)).max(0.0).sqrt()
    }
}

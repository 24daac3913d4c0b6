//! A flat tree in a picture, ready to be stood up in space.

use crate::model::{Node, NodeId, NodeKind, NodeName, Size, Skeleton};
use crate::signal::{convex_hull, distance_to_segment};
use nalgebra::{Point2, Point3, Vector2};

/// How far the region reaches beyond the tree, as a share of its height: leaves and twigs stand out.
const MARGIN: f64 = 0.02;
/// A node lies on the trunk's line no farther from it than this, px.
const ON_TRUNK_PX: f64 = 1.0;

/// A flat tree in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatTree {
    /// Its nodes in the plane z = 0, none of them a copy. A branch that is no straight line has
    /// bends.
    pub skeleton: Skeleton,
    /// Whether its radii are known; else they are 0.
    pub has_radii: bool,
    /// The trunk where it is marked, from the foot up, px; else nothing.
    pub trunk_px: Vec<Point2<f64>>,
    /// Corners of the outline of the crown, px; none where it is not known.
    pub crown_px: Vec<Point2<f64>>,
}

impl FlatTree {
    /// Whether a node there (px) lies on the line of the trunk.
    pub fn is_on_trunk(&self, at_px: Point2<f64>) -> bool {
        let mut pieces = self.trunk_px.windows(2);
        pieces.any(|ends| distance_to_segment(at_px, ends[0], ends[1]) < ON_TRUNK_PX)
    }

    /// Polygons in the picture, px, that cover the tree together, as [`cover_px`] has them, or with the
    /// outline of the crown where it is known.
    pub fn cover_px(&self) -> Vec<Vec<Point2<f64>>> {
        let mut cover = cover_px(&self.skeleton);
        if !self.crown_px.is_empty() {
            cover.pop();
            cover.push(self.crown_px.clone());
        }
        cover
    }
}

/// Polygons in the picture of a tree, px, that cover it together: the trunk up to the first fork, and,
/// as the last, the convex hull of all above it.
pub fn cover_px(tree: &Skeleton) -> Vec<Vec<Point2<f64>>> {
    let nodes = &tree.nodes;
    let place = |n: &Node| tree.image_from_model(&n.position);
    let heights = nodes.iter().map(|n| n.position.y);
    let height_px = heights.fold(0.0, f64::max);
    let margin_px = (MARGIN * height_px).max(2.0);
    let mut cover = Vec::new();
    let mut crown: Vec<Point2<f64>> = Vec::new();
    for (i, node) in nodes.iter().enumerate() {
        let Some(parent) = node.parent.map(|p| &nodes[p.index()]) else {
            continue;
        };
        if node.level <= 1 {
            let wide_px = margin_px.max(2.0 * node.radius);
            let ends = [place(parent), place(node)];
            cover.push(around(&ends, wide_px, tree.image_size));
        }
        let is_top = node.level == 1 && tree.mover(NodeId(i as u32)).index() == i;
        if node.level > 1 || is_top {
            crown.push(place(node));
        }
    }
    cover.push(around(&crown, margin_px, tree.image_size));
    cover
}

/// The convex hull of places, wider by `margin_px` to all sides, within the picture.
fn around(places: &[Point2<f64>], margin_px: f64, size: Size) -> Vec<Point2<f64>> {
    let most = Vector2::new(f64::from(size.width), f64::from(size.height)).add_scalar(-1.0);
    let mut wider = Vec::with_capacity(8 * places.len());
    for place in places {
        for eighth in 0..8 {
            let (sin, cos) = (f64::from(eighth) * std::f64::consts::FRAC_PI_4).sin_cos();
            let corner = place + Vector2::new(cos, sin) * margin_px;
            wider.push(Point2::new(
                corner.x.clamp(0.0, most.x),
                corner.y.clamp(0.0, most.y),
            ));
        }
    }
    convex_hull(&wider)
}

/// A node of a flat tree at `at_px`, its name its place in the array.
pub(super) fn flat_node(
    name: usize,
    parent: Option<NodeId>,
    level: u8,
    at_px: Point2<f64>,
    foot_px: Point2<f64>,
) -> Node {
    Node {
        name: NodeName(name as u32),
        parent,
        level,
        position: Point3::new(at_px.x - foot_px.x, foot_px.y - at_px.y, 0.0),
        radius: 0.0,
        n_tracks: 0,
        kind: NodeKind::Traced,
        certainty: 0.0,
        copy_of: None,
        plane_angle: 0.0,
        moves_with: None,
    }
}

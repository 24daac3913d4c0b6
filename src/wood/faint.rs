//! Twigs that are too faint to be distinguished from noise. A twig that is narrower than a pixel
//! changes the light of what stands behind it by its share of the pixel: its width is the sum of
//! these shares across it.

use crate::model::{BranchGraph, Rgb};
use crate::signal::median;
use nalgebra::{Point2, Vector2, Vector3};

/// Half the width from which on the middle of a limb shows the colour of bark alone, px.
const THICK_PX: f64 = 2.0;
/// Fewer places on thick wood than this show no colour of bark.
const LEAST_THICK: usize = 12;
/// Half the width below which a mask of whole pixels does not tell how wide a twig is, px.
const THIN_PX: f64 = 1.3;
/// Half the width, by its light, of the thinnest twig that is believed, px. Noise between twigs
/// has less: on made films, what is below lies on no branch in three cases of four.
const LEAST_PX: f64 = 0.35;
/// What stands behind is looked at from so far beyond the edge, and so wide, px.
const BESIDE_PX: f64 = 2.0;
const BEHIND_PX: f64 = 3.0;
/// Distance between the places that are looked at, across and along, px.
const STEP_PX: f64 = 0.5;
/// Where bark differs from what stands behind it by less than this, grey levels, no width is
/// estimated.
const LEAST_CONTRAST: f64 = 10.0;

/// `graph` without the twigs at its ends that are too faint in `picture`, from which it was traced.
pub fn without_faint(graph: BranchGraph, picture: &Rgb) -> BranchGraph {
    let Some(bark) = bark_colour(&graph, picture) else {
        return graph;
    };
    let mut n_children: Vec<usize> = graph.children().iter().map(Vec::len).collect();
    let mut is_kept = vec![true; graph.nodes.len()];
    // Children come after their parents: what they leave behind may be an end, too.
    for piece in (1..graph.nodes.len()).rev() {
        if n_children[piece] == 0 && is_faint(&graph, piece, picture, &bark) {
            is_kept[piece] = false;
            if let Some(parent) = graph.nodes[piece].parent {
                n_children[parent] -= 1;
            }
        }
    }
    graph.of_nodes(&is_kept)
}

/// A piece of a branch, which runs straight.
struct Piece {
    from: Point2<f64>,
    along: Vector2<f64>,
    length_px: f64,
}

impl Piece {
    /// The one that ends in node `end`; `None` for the foot, and where it has no length.
    fn of(graph: &BranchGraph, end: usize) -> Option<Self> {
        let to = graph.nodes[end].position_px;
        let from = graph.nodes[graph.nodes[end].parent?].position_px;
        let length_px = (to - from).norm();
        let along = (to - from).try_normalize(f64::EPSILON)?;
        Some(Self {
            from,
            along,
            length_px,
        })
    }

    /// Colours on a line beside it, `off_px` to its left, as far as it is in the picture.
    fn colours(&self, picture: &Rgb, off_px: f64) -> Vec<Vector3<f64>> {
        let left = Vector2::new(self.along.y, -self.along.x);
        let n_steps = (self.length_px / STEP_PX).ceil().max(1.0) as usize;
        let mut colours = Vec::with_capacity(n_steps);
        for k in 0..n_steps {
            let share = (k as f64 + 0.5) / n_steps as f64;
            let at = self.from + share * self.length_px * self.along + off_px * left;
            colours.extend(picture.interpolated(at));
        }
        colours
    }
}

/// The colour of thick limbs along their middle; `None` where too few are seen.
fn bark_colour(graph: &BranchGraph, picture: &Rgb) -> Option<Vector3<f64>> {
    let mut colours = Vec::new();
    for (end, node) in graph.nodes.iter().enumerate() {
        if node.radius_px >= THICK_PX
            && let Some(piece) = Piece::of(graph, end)
        {
            colours.extend(piece.colours(picture, 0.0));
        }
    }
    (colours.len() >= LEAST_THICK).then(|| median_colour(&colours))?
}

/// Whether the piece that ends in a node is so thin that its light must tell its width, and that is
/// too little.
fn is_faint(graph: &BranchGraph, end: usize, picture: &Rgb, bark: &Vector3<f64>) -> bool {
    let radius_px = graph.nodes[end].radius_px;
    if radius_px >= THIN_PX {
        return false;
    }
    let Some(piece) = Piece::of(graph, end) else {
        return false;
    };
    half_width_px(&piece, radius_px, picture, bark).is_some_and(|px| px < LEAST_PX)
}

/// Half the width of a piece by its light, px; `None` where bark does not differ from what stands
/// behind it.
fn half_width_px(piece: &Piece, radius_px: f64, picture: &Rgb, bark: &Vector3<f64>) -> Option<f64> {
    let edge_px = radius_px + BESIDE_PX;
    let left = colour_behind(piece, picture, edge_px, 1.0)?;
    let right = colour_behind(piece, picture, edge_px, -1.0)?;
    let n_steps = (2.0 * edge_px / STEP_PX).ceil() as usize;
    let step_px = 2.0 * edge_px / n_steps as f64;
    let mut width_px = 0.0;
    for k in 0..n_steps {
        let off_px = (k as f64 + 0.5) * step_px - edge_px;
        let share_left = 0.5 * (1.0 + off_px / edge_px);
        let behind = share_left * left + (1.0 - share_left) * right;
        let contrast = bark - behind;
        if contrast.norm() < LEAST_CONTRAST {
            return None;
        }
        let here = median_colour(&piece.colours(picture, off_px))?;
        width_px += step_px * (here - behind).dot(&contrast) / contrast.norm_squared();
    }
    Some(0.5 * width_px)
}

/// The colour of what is beyond the edge of a piece, to its left (1) or its right (-1).
fn colour_behind(piece: &Piece, picture: &Rgb, edge_px: f64, side: f64) -> Option<Vector3<f64>> {
    let mut colours = Vec::new();
    let mut off_px = edge_px + STEP_PX;
    while off_px <= edge_px + BEHIND_PX {
        colours.extend(piece.colours(picture, side * off_px));
        off_px += STEP_PX;
    }
    median_colour(&colours)
}

/// The median of each component; `None` of no colours.
fn median_colour(colours: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    let mut medians = Vector3::zeros();
    for component in 0..3 {
        let values = colours.iter().map(|colour| colour[component]);
        medians[component] = median(values.collect(), f64::total_cmp)?;
    }
    Some(medians)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Size, WoodNode};
    use crate::signal::distance_to_segment;

    const SIZE: Size = Size {
        width: 160,
        height: 120,
    };

    fn node(parent: Option<usize>, u: f64, v: f64, radius_px: f64) -> WoodNode {
        WoodNode {
            parent,
            position_px: Point2::new(u, v),
            radius_px,
        }
    }

    /// A trunk, a twig that goes on, one of half that width, and one where nothing is.
    fn graph() -> BranchGraph {
        BranchGraph {
            nodes: vec![
                node(None, 80.0, 110.0, 5.0),
                node(Some(0), 80.0, 60.0, 5.0),
                node(Some(1), 40.0, 30.0, 0.8),
                node(Some(1), 120.0, 30.0, 0.8),
                node(Some(3), 140.0, 12.0, 0.8),
                node(Some(2), 20.0, 28.0, 0.8),
            ],
        }
    }

    /// The share of a pixel that a limb covers.
    fn share(at: Point2<f64>, from: Point2<f64>, to: Point2<f64>, half_px: f64) -> f64 {
        let off_px = distance_to_segment(at, from, to);
        let most = (2.0 * half_px).min(1.0);
        (half_px + 0.5 - off_px).clamp(0.0, most)
    }

    /// The trunk, the right twig `half_px` wide to either side, the left one by a quarter of that.
    fn picture(half_px: f64) -> Rgb {
        let nodes = graph().nodes;
        let limb = |at, a: usize, b: usize, half| {
            share(at, nodes[a].position_px, nodes[b].position_px, half)
        };
        let mut pixels = Vec::new();
        for i in 0..SIZE.area() {
            let at = Point2::new((i % 160) as f64, (i / 160) as f64);
            let wood = limb(at, 0, 1, 5.0)
                .max(limb(at, 1, 3, half_px))
                .max(limb(at, 3, 4, half_px))
                .max(limb(at, 1, 2, 0.25 * half_px));
            let level = |bark: f64, sky: f64| (wood * bark + (1.0 - wood) * sky).round() as u8;
            pixels.extend([level(80.0, 190.0), level(70.0, 200.0), level(60.0, 220.0)]);
        }
        Rgb { size: SIZE, pixels }
    }

    #[test]
    fn light_tells_how_wide_a_thin_twig_is() {
        for half_px in [0.4, 0.7, 1.0] {
            let picture = picture(half_px);
            let bark = bark_colour(&graph(), &picture).expect("a trunk");
            let piece = Piece::of(&graph(), 3).expect("a piece");
            let told = half_width_px(&piece, 0.8, &picture, &bark).expect("contrast");
            assert!((told / half_px - 1.0).abs() < 0.2, "{told} of {half_px}");
        }
    }

    #[test]
    fn faint_ends_go_and_what_is_seen_stays() {
        let kept = without_faint(graph(), &picture(0.8));
        let ends: Vec<Point2<f64>> = kept.nodes.iter().map(|n| n.position_px).collect();
        let expected = [0, 1, 3, 4].map(|i: usize| graph().nodes[i].position_px);
        assert_eq!(ends, expected);
        assert_eq!(kept.nodes[3].parent, Some(2));
    }

    #[test]
    fn where_bark_is_like_what_stands_behind_it_all_stays() {
        let plain = Rgb {
            size: SIZE,
            pixels: vec![90; 3 * SIZE.area()],
        };
        assert_eq!(without_faint(graph(), &plain), graph());
    }
}

//! Whether a crown stroke is round the crown of a tree: leaves that differ from what is around them, or
//! branches, on a trunk and above its foot.

use super::colours::colour_at;
use super::contrast::Around;
use super::foliage::Foliage;
use super::joined::Parts;
use super::photograph::{NotSeen, Photograph};
use super::{Stroke, ways, widened};
use crate::model::{BranchGraph, Outline, Size};
use nalgebra::Point2;

/// Leaves differ from what is around the crown if they do by so many standard errors. Round six trees of made
/// photographs it is 7.1 to 23, on 24 places of their lawns 3.5 at most (even seeds of 36002 to 36006, 38002,
/// 38006, 39002); beside a tree of the same kind it is less than 5.
const LEAST_CROWN_DEVIATIONS: f64 = 3.5;
/// A crown without leaves, or with such as are around it, holds branches of this length at least, by its own
/// size (the root of its area), and one in leaf is no farther from the trunk than so much of it.
const LEAST_WOOD: f64 = 0.5;
const FARTHEST_CROWN: f64 = 0.25;
/// Leaves nearer to each other than twice this share of the picture's width are one piece, and pieces
/// with less than this share of the area of all are none of the tree's.
const CLUMP_SHARE: f64 = 0.006;
const SMALL_PIECE: f64 = 0.03;

/// By how many standard errors what is within the crown is more like leaves than what is around it; `None` where
/// too little is around it. Leaves are known from all else within, not from what is around: so the light of
/// a lawn, which changes evenly, does not make one of its parts unlike the others.
///
/// # Errors
/// OpenCV fails.
pub fn deviations(photo: &Photograph, foliage: &Foliage) -> opencv::Result<Option<f64>> {
    let off_px = off_px(photo.crown)?;
    let around = Around {
        crown: photo.crown,
        leaves: &foliage.mask,
        off_px: &off_px,
    };
    Ok(around.deviations(|i| foliage.odds.believed(&colour_at(photo.picture, i))))
}

/// How far off the crown each pixel is, px; 0 within it.
fn off_px(crown: &Outline) -> opencv::Result<Vec<f32>> {
    let inverse: Vec<u8> = crown.mask.iter().map(|m| 255 - m).collect();
    ways::distances(&inverse, crown.size)
}

/// Whether what is within a crown may be a lawn or a hedge: it does not differ from what is around it by so
/// many standard errors.
pub fn is_as_around(deviations: Option<f64>) -> bool {
    deviations.is_some_and(|by| by < LEAST_CROWN_DEVIATIONS)
}

/// Refuses a crown that is not that of these branches. One whose leaves are as what is around it must hold
/// branches, as one without leaves does, and not the trunk's foot. A crown in leaf must not be apart from them.
pub fn refuse_other(
    crown: &Outline,
    branches: &BranchGraph,
    in_leaf: bool,
    is_as_around: bool,
) -> Result<(), NotSeen> {
    let holds_wood = wood_share(crown, branches) >= LEAST_WOOD;
    let foot = branches.nodes.first().map(|foot| foot.position_px);
    let holds_foot = foot.is_some_and(|at| crown.contains(at.x, at.y));
    if !in_leaf {
        return if holds_wood {
            Ok(())
        } else {
            Err(NotSeen::Crown)
        };
    }
    if is_as_around && (!holds_wood || holds_foot) {
        return Err(NotSeen::Leaves);
    }
    refuse_far(crown, branches.nodes.iter().map(|node| node.position_px))
}

/// Refuses a trunk's stroke that is apart from the crown: what little is seen along it is not that tree's.
///
/// # Errors
/// It is apart, or OpenCV fails.
pub fn refuse_far_trunk(crown: &Outline, trunk: &Stroke) -> Result<(), NotSeen> {
    refuse_far(crown, trunk.iter().copied())
}

/// Refuses places that are all apart from the crown.
fn refuse_far(
    crown: &Outline,
    places_px: impl Iterator<Item = Point2<f64>>,
) -> Result<(), NotSeen> {
    let off_px = off_px(crown)?;
    let pixels = places_px.filter_map(|place| crown.size.pixel_at(place));
    let nearest_px = pixels
        .map(|pixel| off_px[pixel])
        .fold(f32::INFINITY, f32::min);
    match f64::from(nearest_px) > FARTHEST_CROWN * side_px(crown) {
        true => Err(NotSeen::Apart),
        false => Ok(()),
    }
}

/// The length of the branches within a crown by its own size, the root of its area.
pub fn wood_share(crown: &Outline, branches: &BranchGraph) -> f64 {
    branches.length_within_px(|at| crown.contains(at.x, at.y)) / side_px(crown)
}

fn side_px(crown: &Outline) -> f64 {
    let area = crown.mask.iter().filter(|m| **m != 0).count();
    (area as f64).sqrt()
}

/// Takes out the pieces of a lawn or a bush that lie within the crown stroke: those that are small and apart
/// from the others.
pub fn without_far_pieces(leaves: &mut [u8], size: Size) -> opencv::Result<()> {
    let joined = widened(leaves, size, CLUMP_SHARE * f64::from(size.width))?;
    let n_joined = joined.iter().filter(|m| **m != 0).count();
    let most = (SMALL_PIECE * n_joined as f64) as usize;
    let is_small = Parts::of(&joined, size, 8)?.no_larger_than(most);
    for (leaf, is_small) in leaves.iter_mut().zip(is_small) {
        *leaf = if is_small { 0 } else { *leaf };
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::WoodNode;

    /// A square of 40 px whose lower edge is at row 60.
    fn crown() -> Outline {
        let size = Size::new(100, 100);
        let mut mask = vec![0; size.area()];
        for v in 20..60 {
            mask[v * 100 + 30..v * 100 + 70].fill(255);
        }
        Outline {
            size,
            mask,
            polygon_px: Vec::new(),
            matte: None,
            other_foot_px: None,
        }
    }

    fn branch(from_v: f64, to_v: f64) -> BranchGraph {
        let mut graph = BranchGraph::default();
        for (parent, v) in [(None, from_v), (Some(0), to_v)] {
            graph.nodes.push(WoodNode::made_up(parent, 50.0, v));
        }
        graph
    }

    #[test]
    fn a_trunk_s_stroke_apart_from_the_crown_is_refused() {
        let stroke = |u: f64| vec![Point2::new(u, 95.0), Point2::new(u, 62.0)];
        let apart = refuse_far_trunk(&crown(), &stroke(5.0));
        assert!(matches!(apart, Err(NotSeen::Apart)), "{apart:?}");
        assert!(refuse_far_trunk(&crown(), &stroke(50.0)).is_ok());
    }

    #[test]
    fn leaves_as_around_are_a_tree_s_where_its_wood_is_in_them_and_its_foot_is_not() {
        let refused = |graph: &BranchGraph| refuse_other(&crown(), graph, true, true).is_err();
        assert!(!refused(&branch(90.0, 25.0)), "a trunk into the crown");
        assert!(refused(&branch(90.0, 50.0)), "hardly any wood in it");
        assert!(refused(&branch(55.0, 22.0)), "the foot in it");
        let differs = refuse_other(&crown(), &branch(90.0, 50.0), true, false);
        assert!(differs.is_ok(), "leaves that differ");
    }
}

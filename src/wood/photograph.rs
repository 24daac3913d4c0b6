//! The wood and the leaves of a tree in one photograph (Tan et al. 2008 sect. 2): strokes are in the
//! place of a film's motion.
//!
//! As in the paper the colours on the strokes, leaves left out, and those of all else are two
//! mixtures of five normal distributions. Branches are traced in a mask of the pixels that are more
//! likely wood, as those of films are; the paper moves a circle over the same pixels, which is the
//! other choice (`skeleton.trace_by`).

use super::colours::{Colours, colour_at};
use super::contrast::{self, Around};
use super::cut::{SURE, least_cut};
use super::foliage::{LeafColour, foliage};
use super::mask::{self, COLOUR_ODDS, Part, Parts, WoodMask};
use super::mixture::Mixture;
use super::{Stroke, bark, circles, faint, paths, probability, widened};
use crate::cancel::CancelToken;
use crate::config::TraceBy;
use crate::model::{AtRest, BranchGraph, Luma, Masks, Outline, Rgb, Size, Wood};
use crate::signal::convex_hull;
use nalgebra::{Point2, Vector3};
use opencv::core::{Mat, Point, Scalar, Vec3b, Vector};
use opencv::imgproc::{LINE_8, fill_convex_poly};
use opencv::prelude::*;
use std::sync::Arc;

/// The crown stroke is widened by so much, px (Tan et al. 2008 sect. 2.1: ten times by a pixel).
const FREEDOM_PX: f64 = 10.0;
/// Branches are looked for so far beside a branch stroke beyond the crown, as a share of the
/// picture's width (the radius of the circles of Tan et al. 2008 sect. 2.2, 50 px of 1500).
const BESIDE_STROKE: f64 = 1.0 / 30.0;
/// Parts of the mixtures of wood and of all else (Tan et al. 2008 sect. 2.2).
const PARTS: usize = 5;
/// Fewer colours than this on the strokes show no bark.
const LEAST_BARK: f64 = 64.0;
/// The colours on the strokes are bark if their odds against all else are this at least in their mean, as
/// a logarithm; elsewhere there is nothing to see.
const LEAST_TOLD: f64 = 0.5;
/// What is added to the odds of a bare tree's pixel on a ridge, and elsewhere; to those of a tree
/// in leaf; and of its leaves. By the truth of ten made photographs.
const RIDGE_ODDS: f32 = 1.6;
const PLAIN_ODDS: f32 = -2.4;
const LEAFY_ODDS: f32 = -1.0;
const LEAF_ODDS: f32 = -4.0;
/// The trunk's stroke is on something if the odds of its own colours are above those at either side by so
/// many of the difference's standard errors. As the colours are learned from the stroke itself, this is up
/// to 5.2 on nothing; along trunks of made photographs it is 9.4 or more (seeds 36001 to 36004). It is
/// doubtful with less, and not refused: the trunk of the shipped clip, 640 px wide and before bushes, has
/// 3.2.
const LEAST_TRUNK_DEVIATIONS: f64 = 5.0;
/// With less than this a trunk is refused. For other strokes the colours are the trunk's, and with less than
/// this they are doubtful: on nothing it is 0
/// in the median and 1.6 at most, along twigs that are drawn 2 px off 2.1 at least (the same seeds), but
/// one of some hundred of fresh seeds had -0.3: they are not refused.
const LEAST_DEVIATIONS: f64 = 1.0;
/// Leaves differ from what is around the crown if they do by so many standard errors. Round trees of made
/// photographs it is 9.0 or more, in a crown of which a fifth is leaves 5.3, on eight lawns 2.4 to 8.1: three
/// of these pass (even seeds of 36002 to 36008 and 37002 to 37008).
const LEAST_CROWN_DEVIATIONS: f64 = 4.0;
/// A crown without leaves holds branches of this length at least, by its own size (the root of its area),
/// and one in leaf is no farther from the trunk than so much of it.
const LEAST_WOOD: f64 = 0.5;
const FARTHEST_CROWN: f64 = 0.25;
/// Leaves nearer to each other than twice this share of the picture's width are one piece, and pieces
/// with less than this share of the area of all are none of the tree's.
const CLUMP_SHARE: f64 = 0.006;
const SMALL_PIECE: f64 = 0.03;
/// The odds of a colour are believed up to this, as a logarithm.
const MOST_ODDS: f64 = COLOUR_ODDS as f64;
/// How far a hand is off a twig, as a share of the picture's width (4 px of 1500).
const UNSTEADY: f64 = 4.0 / 1500.0;
/// A stroke of which less is in sight than this share leads through leaves.
const IN_SIGHT: f64 = 0.5;
/// Where so great a share of a piece of a branch is leaves, its width is not seen.
const HIDDEN: f64 = 0.5;

/// A photograph and what was drawn on it.
#[derive(Clone, Copy, Debug)]
pub struct Photograph<'a> {
    pub picture: &'a Rgb,
    /// Within the crown stroke.
    pub crown: &'a Outline,
    /// Lines along branches, px, the trunk's first, from its foot up; one at least.
    pub strokes: &'a [Stroke],
    /// Of the leaves that there are; `None`: there may be green ones.
    pub leaf_colour: Option<LeafColour>,
    pub trace_by: TraceBy,
}

/// What a photograph shows of a tree.
#[derive(Clone, Debug)]
pub struct SeenInPhotograph {
    /// The visible branches, with radius 0 where it is not seen, and the masks of wood and leaves.
    pub wood: Wood,
    pub in_leaf: bool,
    /// Where leaves or wood are, 255 or 0, row by row.
    pub tree: Vec<u8>,
    /// By how many standard errors the colours along the trunk's stroke differ from those at either side;
    /// `None` where too little of it is in sight.
    pub trunk_deviations: Option<f64>,
    /// The strokes, by their place among all, along which nothing is seen that differs from what is beside
    /// them.
    pub doubtful: Vec<usize>,
}

/// Why a photograph does not show what was drawn on it.
#[derive(Debug, thiserror::Error)]
pub enum NotSeen {
    #[error("the work was ended")]
    Cancelled,
    /// No wood leads to the foot of the trunk.
    #[error("there is no wood")]
    Wood,
    /// Along the trunk's stroke is nothing that differs from what is beside it.
    #[error("there is nothing along the trunk's stroke")]
    Trunk,
    #[error("the crown has no {} leaves", .0.name())]
    LeavesOf(LeafColour),
    #[error("the crown has neither leaves nor branches")]
    Crown,
    /// What is taken for leaves is as what is around the crown.
    #[error("the crown is as what is around it")]
    Leaves,
    #[error("the crown and the trunk are apart")]
    Apart,
    #[error(transparent)]
    Failed(#[from] opencv::Error),
}

/// Finds the wood and the leaves.
///
/// # Errors
/// The strokes are not on a tree, `cancel` ends the work, or OpenCV fails.
pub fn in_photograph(photo: Photograph, cancel: &CancelToken) -> Result<SeenInPhotograph, NotSeen> {
    let size = photo.picture.size;
    let trunk = photo.strokes.first().and_then(|trunk| trunk.first());
    let foot_px = trunk.ok_or(NotSeen::Wood)?;
    let crown = widened(&photo.crown.mask, size, FREEDOM_PX)?;
    let colour = photo.leaf_colour.unwrap_or_default();
    let leaves = foliage(photo.picture, &crown, colour, cancel);
    let leaves = without_far_pieces(leaves.ok_or(NotSeen::Cancelled)?, size)?;
    let in_leaf = leaves.iter().any(|leaf| *leaf != 0);
    if let (Some(colour), false) = (photo.leaf_colour, in_leaf) {
        return Err(NotSeen::LeavesOf(colour));
    }
    if in_leaf {
        refuse_like_rest(&photo, &leaves)?;
    }
    let region = with_strokes(photo.crown, &crown, photo.strokes)?;
    let empty = without_wood(size, &leaves);
    let bark_seen = Bark::of(photo, &region, &empty)?;
    let mask = wood_mask(photo, &region, &bark_seen, empty, cancel)?;
    let traced = match photo.trace_by {
        TraceBy::Paths => paths::branches(&mask, *foot_px)?,
        TraceBy::Circles => circles::branches(&mask, *foot_px)?,
    };
    let mut branches = match mask.in_leaf {
        true => traced,
        false => faint::without_faint(traced, photo.picture),
    };
    if branches.nodes.len() < 2 {
        return Err(NotSeen::Wood);
    }
    refuse_other_crown(photo.crown, &branches, mask.in_leaf)?;
    hide_radii(&mut branches, &leaves, size);
    let mut wood = probability::mask_of_wood(&mask, size);
    let mut tree = leaves.clone();
    for (i, leaf) in leaves.iter().enumerate() {
        wood.pixels[i] = wood.pixels[i].min(255 - leaf);
        tree[i] |= mask.mask[i];
    }
    let bark = bark::tile(photo.picture, &wood, &branches);
    let leaves = Luma {
        size,
        pixels: leaves,
    };
    let at_rest = AtRest {
        picture: photo.picture.clone(),
        masks: Masks { wood, leaves },
    };
    Ok(SeenInPhotograph {
        wood: Wood {
            branches,
            bark: bark.map(Arc::new),
            at_rest: Some(Arc::new(at_rest)),
        },
        in_leaf: mask.in_leaf,
        tree,
        trunk_deviations: bark_seen.trunk_deviations,
        doubtful: bark_seen.doubtful,
    })
}

/// Refuses leaves that do not differ from what is around the crown: a lawn, or a hedge.
fn refuse_like_rest(photo: &Photograph, leaves: &[u8]) -> Result<(), NotSeen> {
    let size = photo.picture.size;
    let inverse: Vec<u8> = photo.crown.mask.iter().map(|m| 255 - m).collect();
    let off_px = paths::distances(&inverse, size)?;
    let around = Around {
        crown: photo.crown,
        leaves,
        off_px: &off_px,
    };
    let of_leaves = Mixture::learned(&Colours::of(photo.picture, |i| leaves[i] != 0), PARTS);
    let of_rest = Colours::of(photo.picture, |i| around.is_beside(i));
    let of_rest = Mixture::learned(&of_rest, PARTS);
    let odds = |i: usize| {
        ln_ratio(&of_leaves, &of_rest, &colour_at(photo.picture, i)).clamp(-MOST_ODDS, MOST_ODDS)
    };
    match around.deviations(odds) {
        Some(deviations) if deviations < LEAST_CROWN_DEVIATIONS => Err(NotSeen::Leaves),
        _ => Ok(()),
    }
}

/// Refuses a crown that is not that of these branches: a bare one in which hardly any of them are, or
/// one in leaf that is apart from them.
fn refuse_other_crown(
    crown: &Outline,
    branches: &BranchGraph,
    in_leaf: bool,
) -> Result<(), NotSeen> {
    let size = crown.size;
    let area = crown.mask.iter().filter(|m| **m != 0).count();
    let side_px = (area as f64).sqrt();
    if !in_leaf {
        let within_px = branches.length_within_px(|at| crown.contains(at.x, at.y));
        return match within_px < LEAST_WOOD * side_px {
            true => Err(NotSeen::Crown),
            false => Ok(()),
        };
    }
    let inverse: Vec<u8> = crown.mask.iter().map(|m| 255 - m).collect();
    let off_px = paths::distances(&inverse, size)?;
    let places = branches.nodes.iter().filter_map(|node| {
        let [u, v] = [node.position_px.x, node.position_px.y].map(|c| c.round().max(0.0) as usize);
        off_px.get(v * size.width as usize + u)
    });
    let nearest_px = places.copied().fold(f32::INFINITY, f32::min);
    match f64::from(nearest_px) > FARTHEST_CROWN * side_px {
        true => Err(NotSeen::Apart),
        false => Ok(()),
    }
}

/// Leaves without the pieces of a lawn or a bush that lie within the crown stroke: those that are
/// small and apart from the others.
fn without_far_pieces(mut leaves: Vec<u8>, size: Size) -> opencv::Result<Vec<u8>> {
    let joined = widened(&leaves, size, CLUMP_SHARE * f64::from(size.width))?;
    let n_joined = joined.iter().filter(|m| **m != 0).count();
    let most = (SMALL_PIECE * n_joined as f64) as usize;
    let is_small = Parts::of(&joined, size, 8)?.no_larger_than(most);
    for (leaf, is_small) in leaves.iter_mut().zip(is_small) {
        *leaf = if is_small { 0 } else { *leaf };
    }
    Ok(leaves)
}

/// The pixels within `region` that are more likely wood than not.
///
/// # Errors
/// Nothing is within the region, `cancel` ends the work, or OpenCV fails.
fn wood_mask(
    photo: Photograph,
    region: &[u8],
    bark: &Bark,
    empty: WoodMask,
    cancel: &CancelToken,
) -> Result<WoodMask, NotSeen> {
    let (size, in_leaf, is_stroke) = (photo.picture.size, empty.in_leaf, &bark.is_stroke);
    let mut out = empty;
    let bounds = Part::holding(region, size).ok_or(NotSeen::Wood)?;
    let bgr = mask::enlarged_picture(photo.picture, size)?;
    let is_inside: Vec<bool> = region.iter().map(|m| *m != 0).collect();
    let is_ridge = match in_leaf {
        true => Vec::new(),
        false => mask::ridges(&bgr, bounds, &is_inside, size)?,
    };
    let mut odds = vec![0.0; size.area()];
    for i in (0..size.area()).filter(|i| is_inside[*i]) {
        let by_colour = bark.odds(&colour_at(photo.picture, i)) as f32;
        let by_place = match (is_ridge.get(i), out.is_leaf[i]) {
            (Some(true), _) => RIDGE_ODDS,
            (Some(false), _) => PLAIN_ODDS,
            (None, false) => LEAFY_ODDS,
            (None, true) => LEAF_ODDS,
        };
        odds[i] = by_colour + by_place;
        if is_stroke[i] {
            odds[i] = SURE;
        }
        out.odds[i] = odds[i];
    }
    let links = mask::links(bgr.data_typed::<Vec3b>()?, region, size);
    let is_wood = least_cut(size, &odds, &links, cancel).ok_or(NotSeen::Cancelled)?;
    for i in (0..size.area()).filter(|i| is_inside[*i] && is_wood[*i]) {
        out.mask[i] = 255;
    }
    if in_leaf {
        let is_wide = mask::wide(&out.mask, size)?;
        for (i, mask) in out.mask.iter_mut().enumerate() {
            *mask = if is_wide[i] || is_stroke[i] { *mask } else { 0 };
        }
    }
    mask::without_specks(&mut out.mask, size)?;
    Ok(out)
}

/// A mask without wood.
fn without_wood(size: Size, leaves: &[u8]) -> WoodMask {
    WoodMask {
        size,
        scale: 1,
        mask: vec![0; size.area()],
        odds: vec![f32::NEG_INFINITY; size.area()],
        moves: vec![false; size.area()],
        is_leaf: leaves.iter().map(|leaf| *leaf != 0).collect(),
        in_leaf: leaves.iter().any(|leaf| *leaf != 0),
    }
}

/// What is on the strokes: their pixels, their colours, and all others.
struct Bark {
    is_stroke: Vec<bool>,
    colours: Mixture,
    others: Mixture,
    /// By how many standard errors the trunk's stroke differs from what is beside it, where that is in
    /// sight.
    trunk_deviations: Option<f64>,
    /// The other strokes that do not differ from what is beside them.
    doubtful: Vec<usize>,
}

impl Bark {
    /// # Errors
    /// The strokes show too little bark, or the trunk's is on nothing.
    fn of(photo: Photograph, region: &[u8], empty: &WoodMask) -> Result<Self, NotSeen> {
        let is_stroke = mask::drawn(photo.strokes, empty)?;
        let on_strokes = Colours::of(photo.picture, |i| is_stroke[i] && !empty.is_leaf[i]);
        if on_strokes.count() < LEAST_BARK {
            return Err(NotSeen::Wood);
        }
        let others = Colours::of(photo.picture, |i| region[i] == 0 || empty.is_leaf[i]);
        let mut bark = Self {
            is_stroke,
            colours: Mixture::learned(&on_strokes, PARTS),
            others: Mixture::learned(&others, PARTS),
            trunk_deviations: None,
            doubtful: Vec::new(),
        };
        bark.look_along(photo, &empty.is_leaf)?;
        match bark.told(&on_strokes) < LEAST_TOLD {
            true => Err(NotSeen::Wood),
            false => Ok(bark),
        }
    }

    /// The odds that a colour is of bark, as a logarithm within the bounds in which it is believed.
    fn odds(&self, colour: &Vector3<f64>) -> f64 {
        ln_ratio(&self.colours, &self.others, colour).clamp(-MOST_ODDS, MOST_ODDS)
    }

    /// The mean odds of colours, without bounds.
    fn told(&self, colours: &Colours) -> f64 {
        let bins = colours.bins.iter();
        let told = bins.map(|bin| bin.count * ln_ratio(&self.colours, &self.others, &bin.mean()));
        told.sum::<f64>() / colours.count()
    }

    /// Holds what is along the strokes against what is beside them.
    ///
    /// # Errors
    /// The trunk's does not differ.
    fn look_along(&mut self, photo: Photograph, hides: &[bool]) -> Result<(), NotSeen> {
        let size = photo.picture.size;
        let mut doubtful = Vec::new();
        for (number, stroke) in photo.strokes.iter().enumerate() {
            // A trunk is wider than a hand is unsteady.
            let off_px = match number {
                0 => 0.0,
                _ => UNSTEADY * f64::from(size.width),
            };
            let odds = |at: Point2<f64>| Some(self.odds(&photo.picture.interpolated(at)?));
            let seen = contrast::along(stroke, size, hides, off_px, odds);
            let is_below = |least: f64| seen.deviations.is_some_and(|found| found < least);
            if number == 0 && is_below(LEAST_DEVIATIONS) {
                return Err(NotSeen::Trunk);
            }
            let is_doubtful = match number {
                0 => is_below(LEAST_TRUNK_DEVIATIONS),
                // One that leaves hide is drawn where it must be.
                _ => seen.in_sight >= IN_SIGHT && is_below(LEAST_DEVIATIONS),
            };
            if number == 0 {
                self.trunk_deviations = seen.deviations;
            }
            doubtful.extend(is_doubtful.then_some(number));
        }
        self.doubtful = doubtful;
        Ok(())
    }
}

/// The odds that a colour is of the first mixture, as a logarithm.
fn ln_ratio(first: &Mixture, second: &Mixture, colour: &Vector3<f64>) -> f64 {
    (first.density(colour) / second.density(colour)).ln()
}

/// Sets the radius of pieces that leaves hide to 0: a stroke through leaves is a branch, and is no
/// measure of its width.
fn hide_radii(branches: &mut BranchGraph, leaves: &[u8], size: Size) {
    let ends: Vec<Point2<f64>> = branches.nodes.iter().map(|n| n.position_px).collect();
    for (node, to) in branches.nodes.iter_mut().zip(&ends) {
        let Some(from) = node.parent.map(|p| ends[p]) else {
            continue;
        };
        let steps = (to - from).norm().ceil().max(1.0) as usize;
        let is_hidden = |step: &usize| {
            let at = from + (to - from) * (*step as f64 / steps as f64);
            let [u, v] = [at.x, at.y].map(|c| c.round().max(0.0) as usize);
            let place = v * size.width as usize + u;
            leaves.get(place).is_some_and(|leaf| *leaf != 0)
        };
        let hidden = (1..=steps).filter(is_hidden).count();
        if hidden as f64 > HIDDEN * steps as f64 {
            node.radius_px = 0.0;
        }
    }
}

/// The `widened` region of a crown, what is beside the strokes, and what lies between: the convex hull of
/// both, as limbs leave the trunk below the crown.
fn with_strokes(crown: &Outline, widened: &[u8], strokes: &[Stroke]) -> opencv::Result<Vec<u8>> {
    let size = crown.size;
    let (rows, cols) = (size.height as i32, size.width as i32);
    let mut mask = Mat::new_rows_cols_with_data(rows, cols, widened)?.try_clone()?;
    let wide_px = (2.0 * BESIDE_STROKE * f64::from(size.width)).ceil() as i32;
    let mut places: Vec<Point2<f64>> = strokes.iter().flatten().copied().collect();
    places.extend(crown.polygon_px.iter().map(|corner| corner.map(f64::from)));
    let hull: Vector<Point> = convex_hull(&places).iter().map(rounded).collect();
    let white = Scalar::all(255.0);
    if hull.len() > 2 {
        fill_convex_poly(&mut mask, &hull, white, LINE_8, 0)?;
    }
    for stroke in strokes {
        mask::draw_line(&mut mask, stroke, white, wide_px)?;
    }
    Ok(mask.data_bytes()?.to_vec())
}

fn rounded(at: &Point2<f64>) -> Point {
    Point::new(at.x.round() as i32, at.y.round() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::seed_of_part;
    use crate::signal::distance_to_segment;

    const SIZE: Size = Size {
        width: 320,
        height: 240,
    };
    const FOOT: Point2<f64> = Point2::new(160.0, 230.0);
    const TOP: Point2<f64> = Point2::new(160.0, 130.0);

    /// A dark trunk that forks, before a bright sky; the right limb runs behind leaves from its middle
    /// on where the tree is in leaf.
    fn picture(in_leaf: bool) -> Rgb {
        let limbs = [
            [FOOT, TOP],
            [TOP, Point2::new(100.0, 30.0)],
            [TOP, Point2::new(230.0, 40.0)],
        ];
        let mut pixels = Vec::new();
        for i in 0..SIZE.area() {
            let at = Point2::new((i % 320) as f64, (i / 320) as f64);
            let is_wood = limbs
                .iter()
                .any(|[a, b]| distance_to_segment(at, *a, *b) <= 4.0);
            let is_leaf = in_leaf && (at - Point2::new(225.0, 60.0)).norm() < 45.0;
            let noise = (seed_of_part(8, i as u64) % 25) as i64;
            let colour = match (is_leaf, is_wood) {
                (true, _) => [50, 110, 40],
                (false, true) => [80, 65, 50],
                (false, false) => [170, 190, 210],
            };
            pixels.extend(colour.map(|c: i64| (c + noise) as u8));
        }
        Rgb { size: SIZE, pixels }
    }

    fn seen(picture: &Rgb, strokes: &[Stroke]) -> Result<SeenInPhotograph, NotSeen> {
        let mut mask = vec![0; SIZE.area()];
        for (i, m) in mask.iter_mut().enumerate() {
            let [u, v] = [i % 320, i / 320];
            *m = if (80..280).contains(&u) && v < 120 {
                255
            } else {
                0
            };
        }
        let crown = Outline {
            size: SIZE,
            mask,
            polygon_px: Vec::new(),
            matte: None,
        };
        let photo = Photograph {
            picture,
            crown: &crown,
            strokes,
            leaf_colour: None,
            trace_by: TraceBy::Paths,
        };
        in_photograph(photo, &CancelToken::new())
    }

    #[test]
    fn one_stroke_along_the_trunk_shows_all_limbs_of_a_bare_tree() {
        let found = seen(&picture(false), &[vec![FOOT, TOP]]).expect("wood");
        assert!(!found.in_leaf);
        let branches = &found.wood.branches;
        assert_eq!(branches.tips(), 2, "{branches:?}");
        assert!(
            (300.0..350.0).contains(&branches.length_px()),
            "{branches:?}"
        );
        for node in &branches.nodes[1..] {
            assert!((node.radius_px - 4.0).abs() < 1.2, "{node:?}");
        }
        let n_tree = found.tree.iter().filter(|m| **m != 0).count();
        assert!((2000..3000).contains(&n_tree), "{n_tree}");
    }

    #[test]
    fn a_stroke_through_leaves_is_a_branch_whose_width_is_not_seen() {
        let end = Point2::new(230.0, 40.0);
        let found = seen(&picture(true), &[vec![FOOT, TOP], vec![TOP, end]]).expect("wood");
        assert!(found.in_leaf);
        let nodes = &found.wood.branches.nodes;
        let tip = nodes.iter().find(|n| (n.position_px - end).norm() < 6.0);
        assert_eq!(tip.map(|n| n.radius_px), Some(0.0), "{nodes:?}");
        let masks = &found.wood.at_rest.as_deref().expect("masks").masks;
        let leaves = masks.leaves.pixels.iter().filter(|m| **m != 0).count();
        assert!((5900..6700).contains(&leaves), "{leaves}");
        for (wood, leaf) in masks.wood.pixels.iter().zip(&masks.leaves.pixels) {
            assert!(u32::from(*wood) + u32::from(*leaf) <= 255);
        }
    }

    #[test]
    fn without_a_stroke_or_bark_on_it_nothing_is_found() {
        let found = seen(&picture(false), &[]);
        assert!(matches!(found, Err(NotSeen::Wood)), "{found:?}");
        let short = vec![FOOT, Point2::new(160.0, 229.0)];
        let found = seen(&picture(false), &[short]);
        assert!(matches!(found, Err(NotSeen::Wood)), "{found:?}");
    }

    #[test]
    fn a_trunk_on_the_sky_is_refused_and_another_stroke_there_is_doubtful() {
        let sky = vec![Point2::new(20.0, 200.0), Point2::new(120.0, 180.0)];
        for in_leaf in [false, true] {
            let picture = picture(in_leaf);
            let found = seen(&picture, std::slice::from_ref(&sky));
            assert!(
                matches!(found, Err(NotSeen::Trunk | NotSeen::Wood)),
                "{found:?}"
            );
            // Colours differ by chance, too: two of three strokes on nothing at least are doubtful.
            let lines = [[20.0, 200.0], [230.0, 200.0], [20.0, 150.0]];
            let on_nothing =
                lines.map(|[u, v]| vec![Point2::new(u, v), Point2::new(u + 80.0, v - 20.0)]);
            let strokes = [vec![vec![FOOT, TOP]], on_nothing.to_vec()].concat();
            let found = seen(&picture, &strokes).expect("wood");
            assert!(found.doubtful.len() >= 2, "{:?}", found.doubtful);
            assert!(found.trunk_deviations.is_some_and(|found| found > 9.0));
        }
    }
}

//! The wood and the leaves of a tree in one photograph (Tan et al. 2008 sect. 2): strokes are in the
//! place of a film's motion.
//!
//! As in the paper the colours on the strokes, leaves left out, and those of all else are two
//! mixtures of five normal distributions. Branches are traced in a mask of the pixels that are more
//! likely wood, as those of films are; the paper moves a circle over the same pixels, which is the
//! other choice (`skeleton.trace_by`).

use super::colours::colour_at;
use super::cut::{SURE, least_cut};
use super::drawing;
use super::foliage::{Foliage, InCrown, LeafColour, LeafHint, share_of};
use super::joined::{wide, without_specks};
use super::mask::{self, WoodMask};
use super::part::Part;
use super::ridges::ridges;
use super::stroke_colours::StrokeColours;
use super::{Stroke, bark, circles, crown, faint, paths, probability, ways, widened};
use crate::cancel::CancelToken;
use crate::config::TraceBy;
use crate::model::{AtRest, BranchGraph, BranchLength, Luma, Masks, Outline, Rgb, Size, Wood};
use crate::signal::{convex_hull, median};
use nalgebra::Point2;
use opencv::core::{Mat, Point, Scalar, Vec3b, Vector};
use opencv::imgproc::{LINE_8, fill_convex_poly};
use opencv::prelude::*;
use std::sync::Arc;

/// The crown stroke is widened by so much, px (Tan et al. 2008 sect. 2.1: ten times by a pixel).
const FREEDOM_PX: f64 = 10.0;
/// Branches are looked for so far beside a branch stroke beyond the crown, as a share of the
/// picture's width (the radius of the circles of Tan et al. 2008 sect. 2.2, 50 px of 1500).
pub const BESIDE_STROKE: f64 = 1.0 / 30.0;
/// Parts of the mixtures of wood and of all else (Tan et al. 2008 sect. 2.2).
pub const PARTS: usize = 5;
/// What is added to the odds of a bare tree's pixel on a ridge, and elsewhere; to those of a tree
/// in leaf; and of its leaves. By the truth of ten made photographs.
const RIDGE_ODDS: f32 = 1.6;
const PLAIN_ODDS: f32 = -2.4;
const LEAFY_ODDS: f32 = -1.0;
const LEAF_ODDS: f32 = -4.0;
/// Where the mask is wider than so many times the trunk it is no wood: where limbs part it is up to 1.5. A trunk
/// has so great a radius at least.
const THICK: f32 = 2.5;
const LEAST_TRUNK_PX: f32 = 3.0;
/// Below the trunk's foot, within so many of its radii, there are no branches.
const NEAR_FOOT: f64 = 10.0;
/// A branch is a wall of whose length, with all that it carries, so great a share runs level: four times what
/// whole trees have at most (0.054), as parts of them may have more. As much as this share of the whole tree's
/// length is level at least, so that no level twig is one, and it carries less than half of the tree. Not fitted:
/// set before the photographs of `docs/photo.md` were looked at.
const WALL_LEVEL: f64 = 0.2;
const WALL_LENGTH: f64 = 0.005;
const WALL_CARRIES: f64 = 0.5;
/// Where so great a share of a piece of a branch is leaves, its width is not seen.
const HIDDEN: f64 = 0.5;

/// What the strokes on a photograph follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StrokesAlong {
    /// Branches as a hand draws them: high in a crown it is beside the wood now and then.
    Drawn,
    /// The middle of wood that was found.
    Wood,
}

/// A photograph and what was drawn on it.
#[derive(Clone, Copy, Debug)]
pub struct Photograph<'a> {
    pub picture: &'a Rgb,
    /// Within the crown stroke.
    pub crown: &'a Outline,
    /// Lines along branches, px, the trunk's first, from its foot up; one at least.
    pub strokes: &'a [Stroke],
    pub along: StrokesAlong,
    /// What is known of the leaves before.
    pub leaves: LeafHint,
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
    /// The leaves have the colours of what is around the crown, as those of a lawn do.
    pub is_as_around: bool,
    /// The share of the length of all that was traced that runs level, as edges of buildings do; those that were
    /// taken off count.
    pub level_share: f64,
    /// The colour of half of the crown, which may be leaves that were not looked for: red where they were looked for as
    /// green, and both where the tree was said to be bare.
    pub other_leaves: Option<LeafColour>,
}

/// Where so much of a crown is red, or green if it was said to be bare, it is leaves: of 20 made ones in autumn at
/// least 0.60; of bare crowns before walls of brick at most 0.38. Green is of the same pixels where they are yellow.
const LEAFY_SHARE: f64 = 0.5;
const GREEN_SHARE: f64 = 0.25;

/// Of 40 made photographs with strokes one tree has more than this share of its length that runs level: it is
/// before windows, of which some are traced. Of what is traced on walls without strokes it is 0.06 to 0.13.
const MUCH_LEVEL: f64 = 0.05;

impl SeenInPhotograph {
    /// The share of the branches' length that runs level where so much does that a wall may be among them.
    pub fn walls_share(&self) -> Option<f64> {
        let left = self.wood.branches.level_share();
        (left > MUCH_LEVEL).then_some(left)
    }
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

/// The leaves of a crown, and what they were found by.
pub struct LeavesSeen {
    /// The crown stroke with the freedom that it is given.
    within: Vec<u8>,
    /// 255 or 0, row by row.
    leaves: Vec<u8>,
    is_as_around: bool,
}

impl LeavesSeen {
    /// # Errors
    /// `cancel` ends the work, or OpenCV fails.
    pub fn of(photo: Photograph, cancel: &CancelToken) -> Result<Self, NotSeen> {
        let size = photo.picture.size;
        let within = widened(&photo.crown.mask, size, FREEDOM_PX)?;
        let is_stroke = drawing::on_lines(photo.strokes, size, drawing::STROKE_PX)?;
        let in_crown = InCrown {
            picture: photo.picture,
            region: &within,
            is_bark: &is_stroke,
        };
        let colour = photo.leaves.sought();
        let foliage = colour.and_then(|colour| Foliage::of(in_crown, colour, cancel));
        if cancel.is_cancelled() {
            return Err(NotSeen::Cancelled);
        }
        let mut is_as_around = false;
        let mut leaves = match foliage {
            Some(foliage) => {
                is_as_around = crown::is_as_around(crown::deviations(&photo, &foliage)?);
                foliage.mask
            }
            None => vec![0; size.area()],
        };
        crown::without_far_pieces(&mut leaves, size)?;
        Ok(Self {
            within,
            leaves,
            is_as_around,
        })
    }

    /// Whether there are any.
    pub fn in_leaf(&self) -> bool {
        self.leaves.iter().any(|leaf| *leaf != 0)
    }
}

/// Finds the wood beside leaves, which were found with the same crown, perhaps with other strokes along the
/// branches.
///
/// # Errors
/// The strokes are not on a tree, `cancel` ends the work, or OpenCV fails.
pub fn beside_leaves(
    photo: Photograph,
    seen: &LeavesSeen,
    cancel: &CancelToken,
) -> Result<SeenInPhotograph, NotSeen> {
    let size = photo.picture.size;
    let trunk = photo.strokes.first().and_then(|trunk| trunk.first());
    let foot_px = trunk.ok_or(NotSeen::Wood)?;
    if let (LeafHint::Of(colour), false) = (photo.leaves, seen.in_leaf()) {
        return Err(NotSeen::LeavesOf(colour));
    }
    let LeavesSeen {
        within,
        leaves,
        is_as_around,
    } = seen;
    let is_as_around = *is_as_around;
    let is_stroke = drawing::on_lines(photo.strokes, size, drawing::STROKE_PX)?;
    let region = with_strokes(photo.crown, within, photo.strokes)?;
    let empty = without_wood(size, leaves);
    let on_strokes = StrokeColours::of(photo, is_stroke, &region, &empty.is_leaf)?;
    let mask = wood_mask(photo, &region, &on_strokes, empty, cancel)?;
    let traced = match photo.trace_by {
        TraceBy::Paths => paths::branches(&mask, *foot_px)?,
        TraceBy::Circles => circles::branches(&mask, *foot_px)?,
    };
    let mut branches = match mask.in_leaf {
        true => traced,
        false => faint::without_faint(traced, photo.picture),
    };
    branches = without_roots(&branches);
    if branches.nodes.len() < 2 {
        return Err(NotSeen::Wood);
    }
    crown::refuse_other(photo.crown, &branches, mask.in_leaf, is_as_around)?;
    if on_strokes.doubtful.contains(&0) {
        crown::refuse_far_trunk(photo.crown, &photo.strokes[0])?;
    }
    let level_share = branches.level_share();
    branches = without_walls(&branches, &on_strokes.is_stroke, size);
    hide_radii(&mut branches, leaves, size);
    let mut wood = probability::mask_of_wood(&mask, size);
    let mut tree = leaves.clone();
    for (i, leaf) in leaves.iter().enumerate() {
        wood.pixels[i] = wood.pixels[i].min(255 - leaf);
        tree[i] |= mask.mask[i];
    }
    let bark = bark::tile(photo.picture, &wood, &branches);
    let leaves = Luma {
        size,
        pixels: leaves.clone(),
    };
    let at_rest = AtRest {
        picture: photo.picture.clone(),
        masks: Masks { wood, leaves },
    };
    Ok(SeenInPhotograph {
        wood: Wood {
            branches,
            bare: !mask.in_leaf,
            bark: bark.map(Arc::new),
            at_rest: Some(Arc::new(at_rest)),
        },
        in_leaf: mask.in_leaf,
        tree,
        trunk_deviations: on_strokes.trunk_deviations,
        doubtful: on_strokes.doubtful,
        is_as_around: mask.in_leaf && is_as_around,
        level_share,
        other_leaves: other_leaves(photo, within),
    })
}

/// The colour of leaves that may be there and were not looked for.
fn other_leaves(photo: Photograph, within: &[u8]) -> Option<LeafColour> {
    let share = |colour: LeafColour| share_of(photo.picture, within, colour);
    match photo.leaves {
        LeafHint::Of(sought) => {
            let is_green = share(LeafColour::Green) > LEAFY_SHARE.max(share(sought));
            is_green.then_some(LeafColour::Green)
        }
        LeafHint::Bare if share(LeafColour::Green) > LEAFY_SHARE => Some(LeafColour::Green),
        LeafHint::Bare | LeafHint::Unknown => {
            let is_red =
                share(LeafColour::Red) > LEAFY_SHARE && share(LeafColour::Green) < GREEN_SHARE;
            is_red.then_some(LeafColour::Red)
        }
    }
}

/// The pixels within `region` that are more likely wood than not.
///
/// # Errors
/// Nothing is within the region, `cancel` ends the work, or OpenCV fails.
fn wood_mask(
    photo: Photograph,
    region: &[u8],
    on_strokes: &StrokeColours,
    empty: WoodMask,
    cancel: &CancelToken,
) -> Result<WoodMask, NotSeen> {
    let (size, in_leaf, is_stroke) = (photo.picture.size, empty.in_leaf, &on_strokes.is_stroke);
    let mut out = empty;
    let bounds = Part::holding(region, size).ok_or(NotSeen::Wood)?;
    let bgr = mask::enlarged_picture(photo.picture, size)?;
    let is_inside: Vec<bool> = region.iter().map(|m| *m != 0).collect();
    let is_ridge = match in_leaf {
        true => Vec::new(),
        false => ridges(&bgr, bounds, &is_inside, size)?,
    };
    let mut odds = vec![0.0; size.area()];
    for i in (0..size.area()).filter(|i| is_inside[*i]) {
        let by_colour = on_strokes.odds(&colour_at(photo.picture, i)) as f32;
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
        let is_wide = wide(&out.mask, size)?;
        for (i, mask) in out.mask.iter_mut().enumerate() {
            *mask = if is_wide[i] || is_stroke[i] { *mask } else { 0 };
        }
    }
    without_specks(&mut out.mask, size)?;
    without_thick(&mut out.mask, &photo.strokes[0], size)?;
    for (mask, is_stroke) in out.mask.iter_mut().zip(is_stroke) {
        *mask = if *is_stroke { 255 } else { *mask };
    }
    Ok(out)
}

/// Takes out of a mask of wood what is far thicker than its trunk, as no branch is: a wall that has the
/// colours of bark.
fn without_thick(mask: &mut [u8], trunk: &Stroke, size: Size) -> opencv::Result<()> {
    let inside_px = ways::distances(mask, size)?;
    let Some(radius_px) = radius_low_px(trunk, &inside_px, size) else {
        return Ok(());
    };
    let thick_px = THICK * radius_px.max(LEAST_TRUNK_PX);
    let mut off_core = Vec::with_capacity(mask.len());
    for inside in &inside_px {
        off_core.push(if *inside > thick_px { 0 } else { 255 });
    }
    if off_core.contains(&0) {
        let off_core_px = ways::distances(&off_core, size)?;
        for (mask, off_px) in mask.iter_mut().zip(off_core_px) {
            *mask = if off_px > thick_px { *mask } else { 0 };
        }
    }
    Ok(())
}

/// The median of the radius along the lower half of a trunk, in the middle of the wood there; `None` where it
/// is not in the picture.
fn radius_low_px(trunk: &Stroke, inside_px: &[f32], size: Size) -> Option<f32> {
    let mut radii = Vec::new();
    for ends in drawing::lower_part(trunk, drawing::LOW).windows(2) {
        let way = ends[1] - ends[0];
        let count = way.norm().ceil().max(1.0) as usize;
        for step in 0..count {
            let at = ends[0] + way * (step as f64 / count as f64);
            let pixel = size.pixel_at(at);
            radii.extend(pixel.map(|pixel| inside_px[middle_of_wood(pixel, inside_px, size)]));
        }
    }
    median(radii, f32::total_cmp)
}

/// The pixel to which it always goes farther from the wood's edge, uphill from one pixel to the next; no
/// farther than a stroke may lie beside its branch.
fn middle_of_wood(from: usize, inside_px: &[f32], size: Size) -> usize {
    let (width, height) = (size.width as usize, size.height as usize);
    let most = (BESIDE_STROKE * width as f64) as usize;
    let mut at = from;
    for _ in 0..most {
        let (u, v) = (at % width, at / width);
        let mut best = at;
        for v2 in v.saturating_sub(1)..=(v + 1).min(height - 1) {
            for u2 in u.saturating_sub(1)..=(u + 1).min(width - 1) {
                let other = v2 * width + u2;
                if inside_px[other] > inside_px[best] {
                    best = other;
                }
            }
        }
        if best == at {
            break;
        }
        at = best;
    }
    at
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

/// The branches without those near the trunk's foot that lead below it: what is there is the ground, or a plant
/// on it.
fn without_roots(branches: &BranchGraph) -> BranchGraph {
    let Some(foot) = branches.nodes.first() else {
        return BranchGraph::default();
    };
    let mut is_kept = vec![true; branches.nodes.len()];
    let mut carries = vec![Carries::default(); branches.nodes.len()];
    for (i, node) in branches.nodes.iter().enumerate().rev() {
        let Some(parent) = node.parent else { continue };
        let off_px = node.position_px - foot.position_px;
        let is_below = off_px.y > foot.radius_px && off_px.norm() < NEAR_FOOT * foot.radius_px;
        let leads_below = carries[i].all > 0 && carries[i].kept == 0;
        is_kept[i] = !is_below && !leads_below;
        carries[parent].all += 1;
        carries[parent].kept += usize::from(is_kept[i]);
    }
    branches.of_nodes(&is_kept)
}

/// The branches without those off the strokes of which much runs level, with all that they carry: edges of
/// walls and rows of windows. What carries half of the tree is none. From the tips down, so that a limb
/// which such an edge hangs on is judged without it.
fn without_walls(branches: &BranchGraph, is_stroke: &[bool], size: Size) -> BranchGraph {
    let all_px = branches.length_px();
    let mut leads_to_stroke = vec![false; branches.nodes.len()];
    let mut is_kept = vec![true; branches.nodes.len()];
    let mut carried = vec![BranchLength::default(); branches.nodes.len()];
    for (i, node) in branches.nodes.iter().enumerate().rev() {
        let Some(parent) = node.parent else { continue };
        let pixel = size.pixel_at(node.position_px);
        leads_to_stroke[i] |= pixel.is_some_and(|pixel| is_stroke[pixel]);
        leads_to_stroke[parent] |= leads_to_stroke[i];
        carried[i] += branches.piece_length(i);
        let own = carried[i];
        let is_wall = own.level_px > WALL_LEVEL * own.all_px
            && own.level_px > WALL_LENGTH * all_px
            && own.all_px < WALL_CARRIES * all_px;
        is_kept[i] = leads_to_stroke[i] || !is_wall;
        if is_kept[i] {
            carried[parent] += own;
        }
    }
    branches.of_nodes(&is_kept)
}

/// How many nodes have one as their parent, and how many of these are kept.
#[derive(Clone, Copy, Debug, Default)]
struct Carries {
    all: usize,
    kept: usize,
}

/// A piece has no radius if leaves hide it: a stroke through leaves is a branch, and is no measure of its width. Nor
/// has one of which all that goes on is hidden, for there leaves cover a part of its width; unless none below it is
/// seen.
fn hide_radii(branches: &mut BranchGraph, leaves: &[u8], size: Size) {
    let nodes = &mut branches.nodes;
    let mut is_hidden = vec![false; nodes.len()];
    let mut ends_in_leaves = vec![false; nodes.len()];
    let mut goes_on_in_sight = vec![false; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        let Some(parent) = node.parent else { continue };
        let share = hidden_share(nodes[parent].position_px, node.position_px, leaves, size);
        is_hidden[i] = share > HIDDEN;
        match is_hidden[i] {
            true => ends_in_leaves[parent] = true,
            false => goes_on_in_sight[parent] = true,
        }
    }
    for i in 1..nodes.len() {
        let is_seen_below = nodes[i].parent.is_some_and(|p| p > 0 && !is_hidden[p]);
        let is_last = ends_in_leaves[i] && !goes_on_in_sight[i];
        if is_hidden[i] || is_last && is_seen_below {
            nodes[i].radius_px = 0.0;
        }
    }
}

/// The share of a line that leaves hide.
fn hidden_share(from: Point2<f64>, to: Point2<f64>, leaves: &[u8], size: Size) -> f64 {
    let steps = (to - from).norm().ceil().max(1.0) as usize;
    let mut hidden = 0;
    for step in 1..=steps {
        let at = from + (to - from) * (step as f64 / steps as f64);
        hidden += usize::from(size.pixel_at(at).is_some_and(|pixel| leaves[pixel] != 0));
    }
    hidden as f64 / steps as f64
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
        drawing::draw_line(&mut mask, stroke, white, wide_px)?;
    }
    Ok(mask.data_bytes()?.to_vec())
}

fn rounded(at: &Point2<f64>) -> Point {
    Point::new(at.x.round() as i32, at.y.round() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::WoodNode;
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

    /// A trunk that forks, and the edge of a wall that leads away from it: level, down, and level again.
    #[test]
    fn an_edge_of_a_wall_is_no_branch_but_where_it_was_drawn() {
        let nodes = vec![
            WoodNode::made_up(None, 160.0, 230.0),
            WoodNode::made_up(Some(0), 160.0, 130.0),
            WoodNode::made_up(Some(1), 100.0, 30.0),
            WoodNode::made_up(Some(1), 230.0, 40.0),
            WoodNode::made_up(Some(1), 260.0, 131.0),
            WoodNode::made_up(Some(4), 261.0, 150.0),
            WoodNode::made_up(Some(5), 290.0, 151.0),
        ];
        let graph = BranchGraph { nodes };
        let mut is_stroke = vec![false; SIZE.area()];
        assert_eq!(
            without_walls(&graph, &is_stroke, SIZE).nodes,
            graph.nodes[..4]
        );
        let drawn = SIZE.pixel_at(graph.nodes[5].position_px).expect("a pixel");
        is_stroke[drawn] = true;
        // What the drawn line goes on in is a wall still.
        assert_eq!(
            without_walls(&graph, &is_stroke, SIZE).nodes,
            graph.nodes[..6]
        );
    }

    /// The trunk's radius does not depend on whether the line runs in its middle.
    #[test]
    fn a_line_beside_the_middle_has_the_radius_of_the_middle() {
        let mut mask = vec![0; SIZE.area()];
        for v in 100..230 {
            mask[v * 320 + 150..v * 320 + 171].fill(255);
        }
        let inside_px = ways::distances(&mask, SIZE).expect("distances");
        for u in [151.0, 155.0, 160.0, 169.0] {
            let line = vec![Point2::new(u, 220.0), Point2::new(u, 110.0)];
            let radius_px = radius_low_px(&line, &inside_px, SIZE).expect("a radius");
            assert!((radius_px - 10.5).abs() < 1.0, "{u}: {radius_px}");
        }
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
            other_foot_px: None,
        };
        let photo = Photograph {
            picture,
            crown: &crown,
            strokes,
            along: StrokesAlong::Drawn,
            leaves: LeafHint::Unknown,
            trace_by: TraceBy::Paths,
        };
        let leaves = LeavesSeen::of(photo, &CancelToken::new())?;
        beside_leaves(photo, &leaves, &CancelToken::new())
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
    fn what_is_far_thicker_than_the_trunk_is_no_wood() {
        let mut mask = vec![0; SIZE.area()];
        for (i, pixel) in mask.iter_mut().enumerate() {
            let at = Point2::new((i % 320) as f64, (i / 320) as f64);
            let is_trunk = distance_to_segment(at, FOOT, TOP) <= 4.0;
            let is_wall = (200.0..300.0).contains(&at.x) && (50.0..150.0).contains(&at.y);
            *pixel = if is_trunk || is_wall { 255 } else { 0 };
        }
        without_thick(&mut mask, &vec![FOOT, TOP], SIZE).expect("opencv");
        let left = mask.iter().enumerate().filter(|(_, m)| **m != 0);
        let (trunk, wall): (Vec<_>, Vec<_>) = left.partition(|(i, _)| i % 320 < 180);
        assert!(trunk.len() > 850, "{}", trunk.len());
        // Corners of the wall are left, which nothing joins to the tree.
        assert!(wall.len() < 200, "{}", wall.len());
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
    fn the_last_width_before_leaves_is_none_unless_it_is_the_only_one() {
        let leaves: Vec<u8> = (0..SIZE.area())
            .map(|i| if i / 320 < 96 { 255 } else { 0 })
            .collect();
        let radii = |heights: &[f64]| {
            let mut graph = BranchGraph::default();
            for (i, v) in heights.iter().enumerate() {
                let node = WoodNode::made_up(i.checked_sub(1), 100.0, *v);
                graph.nodes.push(node);
            }
            hide_radii(&mut graph, &leaves, SIZE);
            let seen = graph.nodes[1..].iter().map(|n| n.radius_px > 0.0);
            seen.collect::<Vec<bool>>()
        };
        assert_eq!(radii(&[200.0, 150.0, 100.0, 20.0]), [true, false, false]);
        assert_eq!(radii(&[200.0, 100.0, 20.0]), [true, false]);
        assert_eq!(radii(&[200.0, 150.0, 100.0]), [true, true]);
    }

    #[test]
    fn what_leads_below_the_foot_is_no_branch() {
        let mut graph = BranchGraph::default();
        for (parent, u, v) in [
            (None, 100.0, 200.0),
            (Some(0), 100.0, 190.0),
            (Some(1), 100.0, 50.0),
            (Some(1), 112.0, 192.0),
            (Some(3), 116.0, 208.0),
            (Some(4), 122.0, 200.0),
            (Some(2), 190.0, 210.0),
        ] {
            graph.nodes.push(WoodNode::made_up(parent, u, v));
        }
        let kept = without_roots(&graph);
        let places: Vec<f64> = kept.nodes.iter().map(|n| n.position_px.x).collect();
        assert_eq!(places, [100.0, 100.0, 100.0, 190.0]);
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

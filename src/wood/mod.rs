//! Which pixels are wood, and the branches that they draw (Tan et al. 2008 sect. 2).
//!
//! The paper has one photograph and the user's strokes. Here the film's motion is in their place:
//! [`steady`] takes the camera's motion out of the frames; [`evidence`] averages the tree over
//! frames that are carried back to rest, and separates what moves with it from what stands behind;
//! [`mask`] classifies pixels as wood or not by colour ([`bark_colour`], [`leaves`]) and by [`ridges`];
//! [`paths`], or [`circles`] as in the paper,
//! draw the centre lines; [`probability`] says how sure each pixel is; [`bark`] unrolls the trunk.
//! Strokes help where colour does not. [`beside_leaves`] is the paper's own case: one picture, and
//! strokes in place of motion; [`foliage`] finds its leaves, and [`contrast`] says whether a stroke is on
//! anything, [`crown`] whether it is round a crown. Without strokes a crown in leaf is looked for in
//! [`greenery`].

mod bark;
mod bark_colour;
mod circles;
mod colours;
mod contrast;
mod crossings;
mod crown;
mod cut;
mod drawing;
mod evidence;
mod faint;
mod foliage;
mod greenery;
mod joined;
mod leaves;
mod mask;
mod mixture;
mod part;
mod paths;
mod photograph;
mod probability;
mod ridges;
mod steady;
mod stroke_colours;
mod ways;

pub use foliage::{LeafColour, LeafHint};
pub use greenery::greenery;
pub use photograph::{
    BESIDE_STROKE, LeavesSeen, NotSeen, Photograph, SeenInPhotograph, StrokesAlong, beside_leaves,
};

use crate::cancel::CancelToken;
use crate::config::TraceBy;
use crate::model::{AtRest, CameraMotion, Foot, Outline, Rgb, Size, Wood, shows_leaves};
use crate::motion::Spread;
use crate::signal::median;
use crate::signal::statistics::median_vector;
use evidence::evidence;
use nalgebra::{Point2, Vector2};
use opencv::core::{Mat, Size as CvSize, ToInputArray};
use opencv::imgproc::{MORPH_ELLIPSE, dilate_def, gaussian_blur_def, get_structuring_element};
use opencv::prelude::*;
use std::sync::Arc;
use steady::{SteadyShot, steadied};

/// Fewer frames than this show no motion to judge by.
pub const LEAST_SHOTS: usize = 8;
/// Frames nearest to rest that the picture of rest is made from, and frames with much motion that
/// are held against it.
const AT_REST: usize = 6;
const MOVED: usize = 18;
/// Share of the points' displacements that the tree is looked for within.
const FAR_SHARE: f64 = 0.99;

/// Which of some frames to look at, the stillest first. `motions` holds how far from their rest
/// places the points are in each; only these frames have to be decoded. Empty where there are fewer
/// than [`LEAST_SHOTS`].
pub fn choose(motions: &[Displacements]) -> Vec<usize> {
    let mut by_motion: Vec<(f64, usize)> = Vec::with_capacity(motions.len());
    for (k, displacements) in motions.iter().enumerate() {
        by_motion.extend(motion_px(displacements).map(|px| (px, k)));
    }
    by_motion.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    if by_motion.len() < LEAST_SHOTS {
        return Vec::new();
    }
    let (at_rest, others) = by_motion.split_at(AT_REST.min(by_motion.len() / 3));
    // Frames with more motion than most hold more evidence.
    let moved = &others[others.len().saturating_sub(MOVED.max(others.len() / 2))..];
    let n = moved.len().min(MOVED);
    let spread = (0..n).map(|k| &moved[k * moved.len() / n]);
    at_rest.iter().chain(spread).map(|(_, k)| *k).collect()
}

/// How far from its rest place each followed point is in a frame, px; `None` where it was not seen.
pub type Displacements = Vec<Option<Vector2<f64>>>;

/// Median displacement of the points, px; `None` where none was seen.
fn motion_px(displacements: &Displacements) -> Option<f64> {
    let seen = displacements.iter().flatten();
    median(seen.map(|d| d.norm()).collect(), f64::total_cmp)
}

/// A frame in colour, and how far from its rest place each followed point was in it.
#[derive(Clone, Debug)]
pub struct Shot<'a> {
    pub picture: &'a Rgb,
    /// Without the camera's motion.
    pub displacements: &'a Displacements,
    /// The camera's motion, which the picture has.
    pub camera: CameraMotion,
}

/// A line that the user drew along a branch, px.
pub type Stroke = Vec<Point2<f64>>;

/// The length of a line, px.
pub fn length_px(line: &Stroke) -> f64 {
    line.windows(2).map(|ends| (ends[1] - ends[0]).norm()).sum()
}

/// What to look for wood in.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The stillest first, see [`choose`].
    pub shots: &'a [Shot<'a>],
    /// Rest places of the followed points, px.
    pub rest_px: &'a [Point2<f64>],
    pub outline: &'a Outline,
    pub foot: Foot,
    pub strokes: &'a [Stroke],
    pub trace_by: TraceBy,
}

/// Finds the wood. `None` where there are too few frames, or none is seen, and where `cancel` ends
/// the work before.
///
/// # Errors
/// OpenCV fails.
pub fn find(view: View, cancel: &CancelToken) -> opencv::Result<Option<Wood>> {
    let size = view.outline.size;
    let is_usable =
        |shot: &&Shot| shot.picture.size == size && shot.picture.pixels.len() == 3 * size.area();
    if view.shots.len() < LEAST_SHOTS || !view.shots.iter().all(|shot| is_usable(&shot)) {
        return Ok(None);
    }
    // It was drawn round the tree in one pose, and is to hold it in all.
    let region = widened(&view.outline.mask, size, farthest_px(view.shots))?;
    let mut steady = steadied(view.shots, view.rest_px, &region, cancel)?;
    let n_rest = AT_REST.min(steady.len() / 3);
    let rest_px = settle(&mut steady, n_rest, view.rest_px);
    let Some(spread) = Spread::new(size, &rest_px, view.foot.position_px) else {
        return Ok(None);
    };
    let shots: Vec<Shot> = steady.iter().map(SteadyShot::as_shot).collect();
    let evidence = evidence(&shots, n_rest, &spread, cancel)?;
    let mask = mask::wood_mask(&evidence, &region, view.foot, view.strokes, cancel)?;
    if cancel.is_cancelled() {
        return Ok(None);
    }
    let traced = match view.trace_by {
        TraceBy::Paths => paths::branches(&mask, view.foot.position_px)?,
        TraceBy::Circles => circles::branches(&mask, view.foot.position_px)?,
    };
    // In leaf, what stands behind a twig is leaves, of all lights.
    let branches = match mask.in_leaf {
        true => traced,
        false => faint::without_faint(traced, &evidence.rest),
    };
    tracing::debug!(
        shots = shots.len(),
        pixels = mask.mask.iter().filter(|m| **m != 0).count(),
        nodes = branches.nodes.len(),
        in_leaf = mask.in_leaf,
        "wood"
    );
    if branches.nodes.len() < 2 {
        return Ok(None);
    }
    let masks = probability::masks(&mask, &evidence)?;
    let bark = bark::tile(&evidence.rest, &masks.wood, &branches);
    let bare = evidence.rest.has_colour() && !shows_leaves(&masks.leaves, Some(view.outline));
    let at_rest = AtRest {
        picture: evidence.rest,
        masks,
    };
    Ok(Some(Wood {
        branches,
        bare,
        bark: bark.map(Arc::new),
        at_rest: Some(Arc::new(at_rest)),
    }))
}

/// Where the points are in the stillest shots, the first `n_rest`; the displacements of all shots
/// become those from there. After a release, the median place of a point is a pixel off the one
/// where it comes to rest, and what stands still would seem to have moved by that.
fn settle(shots: &mut [SteadyShot], n_rest: usize, rest_px: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut settled_px = Vec::with_capacity(rest_px.len());
    for (k, rest) in rest_px.iter().enumerate() {
        let stillest = shots[..n_rest].iter();
        let off = median_vector(stillest.filter_map(|shot| shot.displacements[k]));
        for shot in &mut *shots {
            if let Some(displacement) = &mut shot.displacements[k] {
                *displacement -= off;
            }
        }
        settled_px.push(rest + off);
    }
    settled_px
}

/// How far points go from their rest places, px.
fn farthest_px(shots: &[Shot]) -> f64 {
    let mut all: Vec<f64> = Vec::new();
    for shot in shots {
        all.extend(shot.displacements.iter().flatten().map(|d| d.norm()));
    }
    all.sort_unstable_by(f64::total_cmp);
    let rank = (FAR_SHARE * all.len() as f64) as usize;
    all.get(rank.min(all.len().saturating_sub(1)))
        .copied()
        .unwrap_or(0.0)
}

/// A mask (row by row, of a picture of this `size`) widened by so much to all sides.
fn widened(mask: &[u8], size: Size, by_px: f64) -> opencv::Result<Vec<u8>> {
    let (rows, cols) = (size.height as i32, size.width as i32);
    let mask = Mat::new_rows_cols_with_data(rows, cols, mask)?;
    let side = 2 * by_px.ceil().clamp(0.0, f64::from(cols)) as i32 + 1;
    let middle = opencv::core::Point::new(-1, -1);
    let disc = get_structuring_element(MORPH_ELLIPSE, CvSize::new(side, side), middle)?;
    let mut out = Mat::default();
    dilate_def(&mask, &mut out, &disc)?;
    Ok(out.data_bytes()?.to_vec())
}

/// A picture blurred by a Gaussian with this standard deviation, px.
fn blurred(picture: &impl ToInputArray, sigma_px: f64) -> opencv::Result<Mat> {
    let mut out = Mat::default();
    gaussian_blur_def(picture, &mut out, CvSize::new(0, 0), sigma_px)?;
    Ok(out)
}

/// A picture as OpenCV has it, red first.
fn colour_mat(picture: &Rgb) -> opencv::Result<Mat> {
    let (rows, cols) = (picture.size.height as i32, picture.size.width as i32);
    let bytes = Mat::new_rows_cols_with_data(rows, 3 * cols, &picture.pixels)?;
    bytes.reshape(3, rows)?.try_clone()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{FootBasis, Masks, Size};
    use crate::signal::distance_to_segment;

    const SIZE: Size = Size {
        width: 320,
        height: 240,
    };
    const FOOT: Point2<f64> = Point2::new(160.0, 230.0);

    /// A dark trunk that forks, 8 px wide, turned by `angle` about its foot before a wall with
    /// windows, which are as dark as it is.
    fn picture(angle: f64, noise: u64) -> Rgb {
        let mut pixels = Vec::with_capacity(3 * SIZE.area());
        for i in 0..SIZE.area() {
            let (u, v) = ((i % 320) as f64, (i / 320) as f64);
            let at = turned(Point2::new(u, v), -angle);
            let is_wood = limbs()
                .iter()
                .any(|[a, b]| distance_to_segment(at, *a, *b) <= 4.0);
            let is_window = (u as i32 / 12) % 3 == 0 && (v as i32 / 12) % 3 == 0;
            let level = if is_wood || is_window { 60 } else { 170 };
            let grain = crate::random::seed_of_part(noise, i as u64) % 9;
            let level = level + grain as u8;
            pixels.extend([level, level.saturating_sub(12), level.saturating_sub(25)]);
        }
        Rgb { size: SIZE, pixels }
    }

    fn limbs() -> [[Point2<f64>; 2]; 3] {
        let top = Point2::new(160.0, 130.0);
        [
            [FOOT, top],
            [top, Point2::new(100.0, 30.0)],
            [top, Point2::new(230.0, 40.0)],
        ]
    }

    fn turned(at: Point2<f64>, angle: f64) -> Point2<f64> {
        FOOT + nalgebra::Rotation2::new(angle) * (at - FOOT)
    }

    fn followed() -> Vec<Point2<f64>> {
        let mut places = Vec::new();
        for [a, b] in limbs() {
            places.extend((1..12).map(|k| a + (b - a) * (f64::from(k) / 12.0)));
        }
        places
    }

    fn whole() -> Outline {
        Outline {
            size: SIZE,
            mask: vec![255; SIZE.area()],
            polygon_px: Vec::new(),
            matte: None,
            other_foot_px: None,
        }
    }

    fn masks(found: &Wood) -> &Masks {
        &found.at_rest.as_deref().expect("masks").masks
    }

    fn found(swing: f64, strokes: &[Stroke], cancel: &CancelToken) -> Option<Wood> {
        let rest_px = followed();
        let angles: Vec<f64> = (0..16)
            .map(|k| swing * f64::from(k % 8 - 4) / 4.0)
            .collect();
        let motions: Vec<Displacements> = angles
            .iter()
            .map(|angle| {
                rest_px
                    .iter()
                    .map(|at| Some(turned(*at, *angle) - at))
                    .collect()
            })
            .collect();
        let pictures: Vec<Rgb> = (0..16).map(|k| picture(angles[k], k as u64)).collect();
        let chosen = choose(&motions);
        let shots: Vec<Shot> = chosen
            .iter()
            .map(|&k| Shot {
                camera: CameraMotion::default(),
                picture: &pictures[k],
                displacements: &motions[k],
            })
            .collect();
        let view = View {
            shots: &shots,
            rest_px: &rest_px,
            outline: &whole(),
            foot: Foot {
                position_px: FOOT,
                half_width_px: 10.0,
                basis: FootBasis::Outline,
                other_px: None,
            },
            strokes,
            trace_by: TraceBy::Paths,
        };
        find(view, cancel).expect("opencv")
    }

    /// What a single picture cannot show: windows as dark as the tree stand still while it sways.
    #[test]
    fn a_swaying_tree_is_distinguished_from_dark_windows_behind_it() {
        let found = found(0.05, &[], &CancelToken::new()).expect("wood");
        let (mut on, mut all) = (0, 0);
        for (i, wood) in masks(&found).wood.pixels.iter().enumerate() {
            let is_in_mask = *wood > Masks::MOST_OUTSIDE;
            let at = Point2::new((i % 320) as f64, (i / 320) as f64);
            let is_wood = limbs()
                .iter()
                .any(|[a, b]| distance_to_segment(at, *a, *b) <= 6.0);
            all += usize::from(is_in_mask);
            on += usize::from(is_in_mask && is_wood);
        }
        assert!(all > 1500 && on as f64 > 0.93 * all as f64, "{on} of {all}");
        let branches = &found.branches;
        let tips = branches.children().iter().filter(|c| c.is_empty()).count();
        assert!((2..=3).contains(&tips), "{branches:?}");
        let length_px = branches.length_px();
        assert!((180.0..420.0).contains(&length_px), "{branches:?}");
    }

    /// A tree that hardly moves shows little of itself; what the user draws is wood all the same.
    #[test]
    fn what_the_user_draws_is_wood() {
        let stroke = vec![Point2::new(160.0, 150.0), Point2::new(260.0, 150.0)];
        let on_stroke = |found: Wood| {
            let row = &masks(&found).wood.pixels[150 * SIZE.width as usize..];
            let pixels = row[180..250].iter();
            pixels.filter(|wood| **wood > Masks::MOST_OUTSIDE).count()
        };
        let never = CancelToken::new();
        let without = on_stroke(found(0.05, &[], &never).expect("wood"));
        let with = on_stroke(found(0.05, &[stroke], &never).expect("wood"));
        assert!(without < 10 && with == 70, "{without} {with}");
    }

    #[test]
    fn points_rest_where_they_are_in_the_stillest_shots() {
        let off = Vector2::new(0.8, -0.3);
        let picture = Rgb {
            size: Size::new(1, 1),
            pixels: vec![0; 3],
        };
        let shot = |displacement| SteadyShot {
            picture: picture.clone(),
            displacements: vec![displacement, None],
        };
        let moved = Vector2::new(9.0, 2.0);
        let mut shots = [Some(off), None, Some(off), Some(off + moved)].map(shot);
        let rest_px = settle(&mut shots, 3, &[Point2::new(5.0, 5.0), Point2::origin()]);
        assert_eq!(rest_px, [Point2::new(5.8, 4.7), Point2::origin()]);
        assert_eq!(shots[0].displacements[0], Some(Vector2::zeros()));
        let last = shots[3].displacements[0].expect("seen");
        assert!((last - moved).norm() < 1e-9);
    }

    #[test]
    fn work_that_is_not_wanted_any_more_finds_nothing() {
        let cancel = CancelToken::new();
        cancel.cancel();
        assert!(found(0.05, &[], &cancel).is_none());
    }

    #[test]
    fn the_stillest_frames_come_first_and_too_few_are_none() {
        let of = |px: f64| vec![Some(Vector2::new(px, 0.0)), None];
        let motions: Vec<Displacements> = (0..40).map(|k| of(f64::from((k * 7) % 40))).collect();
        let chosen = choose(&motions);
        assert_eq!(chosen.len(), AT_REST + MOVED);
        let px = |k: usize| motions[k][0].map_or(0.0, |d| d.x);
        assert!(chosen[..AT_REST].iter().all(|k| px(*k) < AT_REST as f64));
        assert!(chosen[AT_REST..].iter().all(|k| px(*k) > 20.0));
        assert!(choose(&motions[..LEAST_SHOTS - 1]).is_empty());
        assert!(choose(&vec![vec![None]; 30]).is_empty());
    }
}

//! Which pixels are wood, and the branches that they draw (Tan et al. 2008 sect. 2).
//!
//! The paper has one photograph and the user's strokes. Here the film's motion is in their place:
//! [`evidence`] averages the tree over frames that are carried back to rest, and tells what moves
//! with it from what stands behind; [`mask`] tells wood from the rest by colour; [`paths`] draws
//! the centre lines.

mod evidence;
mod field;
mod mask;
mod paths;

use crate::cancel::CancelToken;
use crate::model::{BranchGraph, Luma, Outline, Rgb};
use evidence::evidence;
use field::Spread;
use nalgebra::{Point2, Vector2};
use opencv::core::{Mat, Size as CvSize};
use opencv::imgproc::{MORPH_ELLIPSE, dilate_def, get_structuring_element};
use opencv::prelude::*;

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
/// than
/// [`LEAST_SHOTS`].
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
    // Those with more motion than most tell more.
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
    crate::signal::median(seen.map(|d| d.norm()).collect(), f64::total_cmp)
}

/// A frame in colour, and how far from its rest place each followed point was in it.
#[derive(Clone, Debug)]
pub struct Shot<'a> {
    pub picture: &'a Rgb,
    pub displacements: &'a Displacements,
}

/// The wood that a film shows.
#[derive(Clone, Debug)]
pub struct Wood {
    pub branches: BranchGraph,
    /// The tree at rest; what stands behind it is blurred.
    pub rest: Rgb,
    /// 255 is wood, at the size of the picture.
    pub mask: Luma,
}

/// What to look for wood in.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The stillest first, see [`choose`].
    pub shots: &'a [Shot<'a>],
    /// Rest places of the followed points, px.
    pub rest_px: &'a [Point2<f64>],
    pub outline: &'a Outline,
    pub foot: TrunkFoot,
}

/// Where the trunk leaves the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrunkFoot {
    pub position_px: Point2<f64>,
    /// Half of the most that the trunk may be wide there, px.
    pub half_width_px: f64,
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
    let Some(spread) = Spread::new(size, view.rest_px, view.foot.position_px) else {
        return Ok(None);
    };
    let shots = view.shots;
    let evidence = evidence(shots, AT_REST.min(shots.len() / 3), &spread, cancel)?;
    let region = widened(view.outline, farthest_px(shots))?;
    let mask = mask::wood_mask(&evidence, &region, view.foot, cancel)?;
    if cancel.is_cancelled() {
        return Ok(None);
    }
    let branches = paths::branches(&mask, view.foot.position_px)?;
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
    Ok(Some(Wood {
        branches,
        rest: evidence.rest,
        mask: mask.at_picture_size(size),
    }))
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

/// The outline, which was drawn round the tree in one pose, widened to hold it in all.
fn widened(outline: &Outline, by_px: f64) -> opencv::Result<Vec<u8>> {
    let (rows, cols) = (outline.size.height as i32, outline.size.width as i32);
    let mask = Mat::new_rows_cols_with_data(rows, cols, &outline.mask)?;
    let side = 2 * by_px.ceil().clamp(0.0, f64::from(cols)) as i32 + 1;
    let middle = opencv::core::Point::new(-1, -1);
    let disc = get_structuring_element(MORPH_ELLIPSE, CvSize::new(side, side), middle)?;
    let mut out = Mat::default();
    dilate_def(&mask, &mut out, &disc)?;
    Ok(out.data_bytes()?.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;

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
            let is_wood = limbs().iter().any(|[a, b]| off(at, *a, *b) <= 4.0);
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

    fn off(at: Point2<f64>, from: Point2<f64>, to: Point2<f64>) -> f64 {
        let along = to - from;
        let share = ((at - from).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        (at - (from + share * along)).norm()
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
        }
    }

    fn found(swing: f64, cancel: &CancelToken) -> Option<Wood> {
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
                picture: &pictures[k],
                displacements: &motions[k],
            })
            .collect();
        let view = View {
            shots: &shots,
            rest_px: &rest_px,
            outline: &whole(),
            foot: TrunkFoot {
                position_px: FOOT,
                half_width_px: 10.0,
            },
        };
        find(view, cancel).expect("opencv")
    }

    /// What a single picture cannot tell: windows as dark as the tree stand still while it sways.
    #[test]
    fn a_swaying_tree_is_told_from_dark_windows_behind_it() {
        let wood = found(0.05, &CancelToken::new()).expect("wood");
        let (mut on, mut all) = (0, 0);
        for (i, mask) in wood.mask.pixels.iter().enumerate() {
            let at = Point2::new((i % 320) as f64, (i / 320) as f64);
            let is_wood = limbs().iter().any(|[a, b]| off(at, *a, *b) <= 6.0);
            all += usize::from(*mask != 0);
            on += usize::from(*mask != 0 && is_wood);
        }
        assert!(all > 1500 && on as f64 > 0.93 * all as f64, "{on} of {all}");
        let tips = wood
            .branches
            .children()
            .iter()
            .filter(|c| c.is_empty())
            .count();
        assert!((2..=3).contains(&tips), "{:?}", wood.branches);
        let length_px = wood.branches.length_px();
        assert!((180.0..420.0).contains(&length_px), "{:?}", wood.branches);
    }

    #[test]
    fn work_that_is_not_wanted_any_more_finds_nothing() {
        let cancel = CancelToken::new();
        cancel.cancel();
        assert!(found(0.05, &cancel).is_none());
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

//! What moves with the tree: the picture of the tree at rest, and for every pixel whether it
//! belongs to the tree or to what stands behind it.
//!
//! Two layers are held against each other, the tree, whose motion the followed points tell, and a
//! background that stands still. A pixel of the tree looks the same in every frame at the place to
//! which the motion has brought it, and a pixel of the background at its own place. Where the
//! picture is plain both are true, and nothing is said.

use super::{Shot, blurred, colour_mat};
use crate::cancel::CancelToken;
use crate::model::{Rgb, Size};
use crate::motion::Spread;
use crate::signal::median;
use nalgebra::Vector2;
use opencv::core::{BORDER_REPLICATE, Mat, Scalar, Vec3f};
use opencv::imgproc::{INTER_CUBIC, INTER_LINEAR, remap};
use opencv::prelude::*;

/// Pictures are blurred by so much before they are compared, px: a motion is a tenth of a pixel
/// off.
const BLUR_PX: f64 = 0.8;
/// Differences beyond so many deviations of the noise all say the same.
const OUTLIER: f32 = 5.0;
/// Least deviation of the noise that is believed, grey levels.
const LEAST_NOISE: f32 = 1.0;
/// Median of the length of a normal vector with three components, in deviations.
const MEDIAN_OF_THREE: f32 = 1.54;

/// What the motion says of every pixel of the picture at rest.
pub struct Evidence {
    /// The tree at rest; what stands behind is blurred there.
    pub rest: Rgb,
    /// Row by row, -1 (stands still) to 1 (moves with the tree); 0 where nothing can be said.
    pub tree: Vec<f32>,
}

/// Holds the two layers against each other. The first `n_rest` of `shots` are the stillest: the
/// picture of rest is made from them. Nothing is to be made of the answer where `cancel` has ended
/// the work.
///
/// # Errors
/// OpenCV fails.
pub fn evidence(
    shots: &[Shot],
    n_rest: usize,
    spread: &Spread,
    cancel: &CancelToken,
) -> opencv::Result<Evidence> {
    let size = spread.size();
    let (at_rest, moved) = shots.split_at(n_rest);
    let mut warped = Vec::with_capacity(n_rest);
    for shot in at_rest {
        if cancel.is_cancelled() {
            break;
        }
        let field = spread.displacements(shot.displacements);
        let picture = float_picture(shot.picture)?;
        warped.push(carried_back(&picture, &field, size, INTER_CUBIC)?);
    }
    let rest = median_picture(&warped, size)?;
    let rest_blurred = blurred(&float_picture(&rest)?, BLUR_PX)?;
    let mut stays = Vec::with_capacity(moved.len());
    let mut moves = Vec::with_capacity(moved.len());
    for shot in moved {
        if cancel.is_cancelled() {
            break;
        }
        let field = spread.displacements(shot.displacements);
        let picture = blurred(&float_picture(shot.picture)?, BLUR_PX)?;
        let carried = carried_back(&picture, &field, size, INTER_LINEAR)?;
        stays.push(differences(&picture, &rest_blurred)?);
        moves.push(differences(&carried, &rest_blurred)?);
    }
    let noise = noise_of(&stays, &moves);
    let mut tree = vec![0.0; size.area()];
    for (stays, moves) in stays.iter().zip(&moves) {
        for ((sum, stays), moves) in tree.iter_mut().zip(stays).zip(moves) {
            *sum += bounded(stays / noise) - bounded(moves / noise);
        }
    }
    let n_moved = moved.len().max(1) as f32;
    tree.iter_mut().for_each(|sum| *sum /= n_moved);
    Ok(Evidence { rest, tree })
}

/// What a difference in deviations says, 0 to 1.
fn bounded(deviations: f32) -> f32 {
    (deviations / OUTLIER).powi(2).min(1.0)
}

/// Deviation of the noise, grey levels: most pixels are like the picture at rest in one way or the
/// other.
fn noise_of(stays: &[Vec<f32>], moves: &[Vec<f32>]) -> f32 {
    let mut medians = Vec::with_capacity(stays.len());
    for (stays, moves) in stays.iter().zip(moves) {
        let least = stays.iter().zip(moves).map(|(a, b)| a.min(*b));
        medians.extend(median(least.collect(), f32::total_cmp));
    }
    let median = median(medians, f32::total_cmp).unwrap_or(0.0);
    (median / MEDIAN_OF_THREE).max(LEAST_NOISE)
}

/// The picture in single precision.
fn float_picture(picture: &Rgb) -> opencv::Result<Mat> {
    let mut float = Mat::default();
    colour_mat(picture)?.convert_to(&mut float, opencv::core::CV_32F, 1.0, 0.0)?;
    Ok(float)
}

/// The picture with every pixel where it is at rest.
fn carried_back(
    picture: &Mat,
    field: &[Vector2<f32>],
    size: Size,
    interpolation: i32,
) -> opencv::Result<Mat> {
    let (rows, cols) = (size.height as i32, size.width as i32);
    let width = size.width as usize;
    let mut from_u = Vec::with_capacity(field.len());
    let mut from_v = Vec::with_capacity(field.len());
    for (v, row) in field.chunks_exact(width).enumerate() {
        from_u.extend(row.iter().enumerate().map(|(u, moved)| u as f32 + moved.x));
        from_v.extend(row.iter().map(|moved| v as f32 + moved.y));
    }
    let from_u = Mat::new_rows_cols_with_data(rows, cols, &from_u)?;
    let from_v = Mat::new_rows_cols_with_data(rows, cols, &from_v)?;
    let mut out = Mat::default();
    let border = Scalar::default();
    remap(
        picture,
        &mut out,
        &from_u,
        &from_v,
        interpolation,
        BORDER_REPLICATE,
        border,
    )?;
    Ok(out)
}

/// The median of every colour of every pixel.
fn median_picture(pictures: &[Mat], size: Size) -> opencv::Result<Rgb> {
    let mut pixels = Vec::with_capacity(3 * size.area());
    for v in 0..size.height as i32 {
        let mut rows: Vec<Vec<Vec3f>> = Vec::with_capacity(pictures.len());
        for picture in pictures {
            rows.push(picture.at_row(v)?.to_vec());
        }
        for pixel in median_row(&mut rows) {
            pixels.extend(pixel.0.map(|colour| (colour + 0.5) as u8));
        }
    }
    pixels.resize(3 * size.area(), 0);
    Ok(Rgb { size, pixels })
}

/// The median of `rows` at each of their places: the greatest values are carried to the last rows
/// (bubble sort), at all places at once. Nothing of no rows.
fn median_row(rows: &mut [Vec<Vec3f>]) -> &[Vec3f] {
    let middle = rows.len() / 2;
    for last in (middle.max(1)..rows.len()).rev() {
        for k in 0..last {
            let (lower, upper) = rows.split_at_mut(k + 1);
            for (a, b) in lower[k].iter_mut().zip(&mut upper[0]) {
                for (a, b) in a.0.iter_mut().zip(&mut b.0) {
                    (*a, *b) = (a.min(*b), a.max(*b));
                }
            }
        }
    }
    rows.get(middle).map_or(&[], Vec::as_slice)
}

/// Length of the difference of two pictures in every pixel.
fn differences(a: &Mat, b: &Mat) -> opencv::Result<Vec<f32>> {
    let (a, b): (&[Vec3f], &[Vec3f]) = (a.data_typed()?, b.data_typed()?);
    Ok(a.iter().zip(b).map(|(a, b)| length_between(a, b)).collect())
}

fn length_between(a: &Vec3f, b: &Vec3f) -> f32 {
    let squares = a.iter().zip(b.iter()).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f32>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_rows_is_that_of_each_place() {
        let value = |row: u64, at: u64| (crate::random::seed_of_part(row, at) % 99) as f32;
        for count in 1..7 {
            let row = |k: u64| (0..20).map(|at| Vec3f::all(value(k, at))).collect();
            let mut rows: Vec<Vec<Vec3f>> = (0..count).map(row).collect();
            for (at, found) in (0..).zip(median_row(&mut rows)) {
                let values = (0..count).map(|k| value(k, at)).collect();
                let expected = median(values, f32::total_cmp).expect("values");
                assert_eq!(*found, Vec3f::all(expected), "{count} rows");
            }
        }
        assert!(median_row(&mut []).is_empty());
    }
}

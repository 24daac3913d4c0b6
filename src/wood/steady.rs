//! The frames as a camera on a steady tripod would have taken them, in light that stays the same.
//!
//! A motion of one pixel distinguishes the tree from what stands still: on a tripod that trembles,
//! or under an exposure that follows the clouds, the ground would seem to move as well.

use super::{Displacements, Shot, colour_mat};
use crate::cancel::CancelToken;
use crate::model::{CameraMotion, Rgb};
use nalgebra::Point2;
use opencv::core::{BORDER_REPLICATE, Mat, Scalar, Size as CvSize};
use opencv::imgproc::{INTER_CUBIC, WARP_INVERSE_MAP, warp_affine};
use opencv::prelude::*;

/// A camera that moves by less than this, px, is left alone: a picture that is carried back by a
/// part of a pixel becomes softer.
const LEAST_PX: f64 = 0.25;
/// Light that changes by a smaller share than this is left alone.
const LEAST_LIGHT: f64 = 0.01;

/// A frame, and how far from its rest place each followed point is in it, both without the camera's
/// motion.
pub struct SteadyShot {
    pub picture: Rgb,
    pub displacements: Displacements,
}

impl SteadyShot {
    pub fn as_shot(&self) -> Shot<'_> {
        Shot {
            picture: &self.picture,
            displacements: &self.displacements,
            camera: CameraMotion::default(),
        }
    }
}

/// Takes the camera's motion and the change of light out of `shots`. The light is that of the
/// background, what `region` (row by row, 0 outside) does not hold.
///
/// # Errors
/// OpenCV fails.
pub fn steadied(
    shots: &[Shot],
    rest_px: &[Point2<f64>],
    region: &[u8],
    cancel: &CancelToken,
) -> opencv::Result<Vec<SteadyShot>> {
    let Some(first) = shots.first() else {
        return Ok(Vec::new());
    };
    let background = Surroundings {
        region,
        light: light(first.picture, region),
    };
    let mut steady = Vec::with_capacity(shots.len());
    for shot in shots {
        if cancel.is_cancelled() {
            break;
        }
        let mut picture = shot.picture.clone();
        background.relight(&mut picture);
        let moved_px = shot.camera.farthest_px(&picture.size.corners_px());
        steady.push(if moved_px < LEAST_PX {
            SteadyShot {
                picture,
                displacements: as_filmed(shot, rest_px),
            }
        } else {
            SteadyShot {
                picture: without_motion(&picture, &shot.camera)?,
                displacements: shot.displacements.clone(),
            }
        });
    }
    Ok(steady)
}

/// The displacements with the camera's motion, as a picture has them that is left as it is.
fn as_filmed(shot: &Shot, rest_px: &[Point2<f64>]) -> Displacements {
    let mut filmed = Displacements::with_capacity(rest_px.len());
    for (rest, moved) in rest_px.iter().zip(shot.displacements) {
        filmed.push(moved.map(|moved| shot.camera.filmed_px(rest + moved) - rest));
    }
    filmed
}

/// What stands still in a picture.
struct Surroundings<'a> {
    region: &'a [u8],
    /// Mean of each colour, grey levels; `None` where there is no background.
    light: Option<[f64; 3]>,
}

impl Surroundings<'_> {
    /// Gives a picture the light of this one.
    fn relight(&self, picture: &mut Rgb) {
        let (Some(own), Some(other)) = (self.light, light(picture, self.region)) else {
            return;
        };
        let mut gain = [1.0; 3];
        for (gain, (own, other)) in gain.iter_mut().zip(own.iter().zip(other)) {
            *gain = own / other.max(1.0);
        }
        if gain
            .iter()
            .all(|gain: &f64| (gain - 1.0).abs() < LEAST_LIGHT)
        {
            return;
        }
        for pixel in picture.pixels.chunks_exact_mut(3) {
            for (colour, gain) in pixel.iter_mut().zip(gain) {
                *colour = (f64::from(*colour) * gain).round().clamp(0.0, 255.0) as u8;
            }
        }
    }
}

/// Mean of each colour outside of the region, grey levels; `None` where all is inside.
fn light(picture: &Rgb, region: &[u8]) -> Option<[f64; 3]> {
    let mut sum = [0_u64; 3];
    let mut n = 0_u64;
    for (pixel, inside) in picture.pixels.chunks_exact(3).zip(region) {
        if *inside == 0 {
            n += 1;
            for (sum, colour) in sum.iter_mut().zip(pixel) {
                *sum += u64::from(*colour);
            }
        }
    }
    (n > 0).then(|| sum.map(|sum| sum as f64 / n as f64))
}

/// The picture with what stands still in its steady place.
fn without_motion(picture: &Rgb, camera: &CameraMotion) -> opencv::Result<Rgb> {
    let rows = camera.affine_rows();
    let affine = Mat::new_rows_cols_with_data(2, 3, &rows)?;
    let mut steady = Mat::default();
    let size = CvSize::new(picture.size.width as i32, picture.size.height as i32);
    let flags = INTER_CUBIC | WARP_INVERSE_MAP;
    let border = Scalar::default();
    warp_affine(
        &colour_mat(picture)?,
        &mut steady,
        &affine,
        size,
        flags,
        BORDER_REPLICATE,
        border,
    )?;
    Ok(Rgb {
        size: picture.size,
        pixels: steady.data_bytes()?.to_vec(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Agreement, Background, Size};
    use nalgebra::{Similarity2, Vector2};

    const SIZE: Size = Size {
        width: 160,
        height: 120,
    };

    /// A ground with structure, shifted, and in other light.
    fn ground(shift: Vector2<f64>, light: f64) -> Rgb {
        let mut pixels = Vec::new();
        for i in 0..SIZE.area() {
            let u = (i % SIZE.width as usize) as f64 - shift.x;
            let v = (i / SIZE.width as usize) as f64 - shift.y;
            let grey = 90.0 + 40.0 * (u / 4.0 + v / 7.0).sin() + 30.0 * (u / 6.0 - v / 5.0).cos();
            pixels.extend([(light * grey).round() as u8; 3]);
        }
        Rgb { size: SIZE, pixels }
    }

    /// The tree is looked for in the middle.
    fn region() -> Vec<u8> {
        let mut region = vec![0; SIZE.area()];
        for (i, inside) in region.iter_mut().enumerate() {
            *inside = u8::from((60..100).contains(&(i % SIZE.width as usize)));
        }
        region
    }

    fn steady(shots: &[Shot]) -> Vec<SteadyShot> {
        let rest_px = [Point2::new(80.0, 50.0), Point2::new(70.0, 20.0)];
        steadied(shots, &rest_px, &region(), &CancelToken::new()).expect("OpenCV")
    }

    fn shifted(shift: Vector2<f64>) -> CameraMotion {
        CameraMotion {
            filmed_from_steady: Similarity2::new(shift, 0.0, 1.0),
            background: Background::Seen(Agreement::default()),
        }
    }

    #[test]
    fn a_trembling_camera_and_passing_clouds_are_taken_out() {
        let shift = Vector2::new(1.6, -1.0);
        let pictures = [ground(Vector2::zeros(), 1.0), ground(shift, 1.3)];
        let displacements = vec![Some(Vector2::new(4.0, 0.5)), None];
        let cameras = [shifted(Vector2::zeros()), shifted(shift)];
        let mut shots = Vec::new();
        for (picture, camera) in pictures.iter().zip(cameras) {
            shots.push(Shot {
                picture,
                displacements: &displacements,
                camera,
            });
        }
        let steady = steady(&shots);
        assert!(
            steady
                .iter()
                .all(|shot| shot.displacements == displacements)
        );
        let (a, b) = (&steady[0].picture.pixels, &steady[1].picture.pixels);
        let inner = |i: &usize| {
            let (u, v) = (i / 3 % SIZE.width as usize, i / 3 / SIZE.width as usize);
            (4..156).contains(&u) && (4..116).contains(&v)
        };
        let off = (0..a.len())
            .filter(inner)
            .map(|i| a[i].abs_diff(b[i]))
            .max();
        assert!(off.is_some_and(|off| off <= 12), "{off:?}");
    }

    /// A picture that is not carried back has its points where they were filmed.
    #[test]
    fn a_camera_that_hardly_moves_is_left_alone() {
        let picture = ground(Vector2::zeros(), 1.0);
        let displacements = vec![Some(Vector2::new(3.0, 1.0)), None];
        let shot = Shot {
            picture: &picture,
            displacements: &displacements,
            camera: shifted(Vector2::new(0.1, 0.0)),
        };
        for shot in steady(&[shot.clone(), shot]) {
            assert_eq!(shot.picture.pixels, picture.pixels);
            let moved = shot.displacements[0].expect("seen");
            assert!((moved - Vector2::new(3.1, 1.0)).norm() < 1e-9, "{moved}");
        }
        assert!(steady(&[]).is_empty());
    }
}

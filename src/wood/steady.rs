//! The frames as a camera on a steady tripod would have taken them, in light that stays the same.
//!
//! A motion of one pixel distinguishes the tree from what stands still: on a tripod that trembles,
//! or under an exposure that follows the clouds, the ground would seem to move as well.

use super::{Displacements, Shot, colour_mat, median_vector};
use crate::cancel::CancelToken;
use crate::model::{Rgb, Size};
use nalgebra::{Isometry2, Point2, Translation2, UnitComplex, Vector2};
use opencv::core::{
    BORDER_REPLICATE, Mat, Point2f, Scalar, Size as CvSize, TermCriteria, TermCriteria_COUNT,
    TermCriteria_EPS, Vector, no_array,
};
use opencv::imgproc::{
    COLOR_RGB2GRAY, INTER_CUBIC, WARP_INVERSE_MAP, cvt_color_def, good_features_to_track,
    warp_affine,
};
use opencv::prelude::*;
use opencv::video::{build_optical_flow_pyramid_def, calc_optical_flow_pyr_lk};

/// Points of the background that are followed from one shot to the next, at most; how far apart they
/// are, px; and how clear a corner they are, as a share of the clearest one.
const POINTS: i32 = 400;
const APART_PX: f64 = 6.0;
const CLEAR: f64 = 0.01;
/// The window in which they are compared, px, and how often the picture is halved.
const WINDOW: CvSize = CvSize::new(15, 15);
const LEVELS: i32 = 3;
/// A point that comes back this far from where it began was lost, px.
const BACK_PX: f64 = 0.5;
/// Points agree on a motion that they miss by no more than this, px.
const AGREE_PX: f64 = 0.5;
/// Rounds of reweighting.
const ROUNDS: usize = 10;
/// Fewer points than this, or than half of those that were followed, say nothing of the camera.
const LEAST_POINTS: usize = 12;
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
        }
    }
}

/// Takes the camera's motion and the change of light out of `shots`. They are taken from the
/// background, what `region` (row by row, 0 outside) does not hold: the shift and turn on which most
/// of its corners agree, and how bright it is. Where it has too few corners, or they move each its
/// own way, the shots stay where they are.
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
    let background = Background::of(first.picture, region)?;
    let (mut pictures, mut motions) = (Vec::new(), Vec::new());
    for shot in shots {
        if cancel.is_cancelled() {
            break;
        }
        let mut picture = shot.picture.clone();
        // The light first: corners are followed by their grey levels.
        background.relight(&mut picture);
        motions.push(background.motion_to(&picture)?);
        pictures.push(picture);
    }
    let to_mean = mean(&motions).inverse();
    let mut steady = Vec::with_capacity(pictures.len());
    for ((shot, picture), motion) in shots.iter().zip(pictures).zip(&motions) {
        let motion = motion * to_mean;
        steady.push(if farthest_px(&motion, first.picture.size) < LEAST_PX {
            SteadyShot {
                picture,
                displacements: shot.displacements.clone(),
            }
        } else {
            SteadyShot {
                picture: without_motion(&picture, &motion)?,
                displacements: displacements_without(&motion, rest_px, shot.displacements),
            }
        });
    }
    Ok(steady)
}

/// Where what stands still is in a picture, by its place in another one, px.
type CameraMotion = Isometry2<f64>;

/// The mean of small motions.
fn mean(motions: &[CameraMotion]) -> CameraMotion {
    let (mut shift, mut angle) = (Vector2::zeros(), 0.0);
    for motion in motions {
        shift += motion.translation.vector;
        angle += motion.rotation.angle();
    }
    let count = motions.len().max(1) as f64;
    CameraMotion::new(shift / count, angle / count)
}

/// How far the corners of a picture move, px.
fn farthest_px(motion: &CameraMotion, size: Size) -> f64 {
    let (width, height) = (f64::from(size.width), f64::from(size.height));
    let mut farthest_px: f64 = 0.0;
    for (u, v) in [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)] {
        let corner = Point2::new(u, v);
        farthest_px = farthest_px.max((motion * corner - corner).norm());
    }
    farthest_px
}

fn displacements_without(
    motion: &CameraMotion,
    rest_px: &[Point2<f64>],
    displacements: &Displacements,
) -> Displacements {
    let back = motion.inverse();
    let displaced = rest_px.iter().zip(displacements);
    let still = displaced.map(|(rest, moved)| Some(back * (rest + (*moved)?) - rest));
    still.collect()
}

/// What stands still in a picture.
struct Background<'a> {
    region: &'a [u8],
    /// Mean of each colour, grey levels; `None` where there is no background.
    light: Option<[f64; 3]>,
    pyramid: Vector<Mat>,
    /// Where it has corners.
    corners: Vector<Point2f>,
}

impl<'a> Background<'a> {
    fn of(picture: &Rgb, region: &'a [u8]) -> opencv::Result<Self> {
        let size = picture.size;
        let outside: Vec<u8> = region.iter().map(|r| 255 * u8::from(*r == 0)).collect();
        let mask = Mat::new_rows_cols_with_data(size.height as i32, size.width as i32, &outside)?;
        let grey = grey(picture)?;
        let mut corners = Vector::new();
        good_features_to_track(
            &grey,
            &mut corners,
            POINTS,
            CLEAR,
            APART_PX,
            &mask,
            3,
            false,
            0.04,
        )?;
        Ok(Self {
            region,
            light: light(picture, region),
            pyramid: pyramid(&grey)?,
            corners,
        })
    }

    /// Where it is in another picture; no motion where that cannot be told.
    fn motion_to(&self, picture: &Rgb) -> opencv::Result<CameraMotion> {
        if self.corners.len() < LEAST_POINTS {
            return Ok(CameraMotion::identity());
        }
        let other = pyramid(&grey(picture)?)?;
        let there = followed(&self.pyramid, &other, &self.corners)?;
        let back = followed(&other, &self.pyramid, &there)?;
        let mut pairs = Vec::with_capacity(self.corners.len());
        for ((from, to), back) in self.corners.iter().zip(&there).zip(&back) {
            let pair = Pair {
                from: point(from),
                to: point(to),
            };
            if (point(back) - pair.from).norm() <= BACK_PX {
                pairs.push(pair);
            }
        }
        Ok(rigid(&pairs).unwrap_or_else(CameraMotion::identity))
    }

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

fn grey(picture: &Rgb) -> opencv::Result<Mat> {
    let mut grey = Mat::default();
    cvt_color_def(&colour_mat(picture)?, &mut grey, COLOR_RGB2GRAY)?;
    Ok(grey)
}

/// A grey picture in all the sizes in which points are followed, each with its gradients.
fn pyramid(grey: &Mat) -> opencv::Result<Vector<Mat>> {
    let mut pyramid = Vector::new();
    build_optical_flow_pyramid_def(grey, &mut pyramid, WINDOW, LEVELS)?;
    Ok(pyramid)
}

/// Where points of one picture are in another (Lucas and Kanade 1981); those that are lost are
/// anywhere.
fn followed(
    from: &Vector<Mat>,
    to: &Vector<Mat>,
    points: &Vector<Point2f>,
) -> opencv::Result<Vector<Point2f>> {
    let mut there = Vector::new();
    let mut status = Vector::<u8>::new();
    let until = TermCriteria::new(TermCriteria_COUNT + TermCriteria_EPS, 30, 0.01)?;
    calc_optical_flow_pyr_lk(
        from,
        to,
        points,
        &mut there,
        &mut status,
        &mut no_array(),
        WINDOW,
        LEVELS,
        until,
        0,
        1e-4,
    )?;
    Ok(there)
}

fn point(at: Point2f) -> Point2<f64> {
    Point2::new(f64::from(at.x), f64::from(at.y))
}

/// A point in two pictures, px.
#[derive(Clone, Copy, Debug)]
struct Pair {
    from: Point2<f64>,
    to: Point2<f64>,
}

/// The shift and turn on which most pairs agree (least squares, reweighted: Holland and Welsch
/// 1977); `None` where most do not.
fn rigid(pairs: &[Pair]) -> Option<CameraMotion> {
    let shift = median_vector(pairs.iter().map(|pair| pair.to - pair.from));
    let mut motion = CameraMotion::new(shift, 0.0);
    for _ in 0..ROUNDS {
        motion = weighted_rigid(pairs, &motion);
    }
    let agree = pairs
        .iter()
        .filter(|pair| miss_px(pair, &motion) <= AGREE_PX);
    let n_agree = agree.count();
    (n_agree >= LEAST_POINTS && 2 * n_agree >= pairs.len()).then_some(motion)
}

fn miss_px(pair: &Pair, motion: &CameraMotion) -> f64 {
    (motion * pair.from - pair.to).norm()
}

/// The motion of least squares, where pairs that `before` misses count less (Cauchy's weights).
fn weighted_rigid(pairs: &[Pair], before: &CameraMotion) -> CameraMotion {
    let weight = |pair: &Pair| 1.0 / (1.0 + (miss_px(pair, before) / AGREE_PX).powi(2));
    let (mut from, mut to, mut weights) = (Vector2::zeros(), Vector2::zeros(), 0.0);
    for pair in pairs {
        from += weight(pair) * pair.from.coords;
        to += weight(pair) * pair.to.coords;
        weights += weight(pair);
    }
    let (from, to) = (from / weights, to / weights);
    let (mut along, mut across) = (0.0, 0.0);
    for pair in pairs {
        let (a, b) = (pair.from.coords - from, pair.to.coords - to);
        along += weight(pair) * a.dot(&b);
        across += weight(pair) * a.perp(&b);
    }
    let rotation = UnitComplex::from_angle(across.atan2(along));
    CameraMotion::from_parts(Translation2::from(to - rotation * from), rotation)
}

/// The picture with what stands still in its mean place.
fn without_motion(picture: &Rgb, motion: &CameraMotion) -> opencv::Result<Rgb> {
    let affine = motion.to_homogeneous();
    let rows: Vec<f64> = affine.transpose().iter().copied().take(6).collect();
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

    fn steady(pictures: &[Rgb], displacements: &[Displacements]) -> Vec<SteadyShot> {
        let mut shots = Vec::new();
        for (picture, displacements) in pictures.iter().zip(displacements) {
            shots.push(Shot {
                picture,
                displacements,
            });
        }
        let rest_px = [Point2::new(80.0, 50.0), Point2::new(70.0, 20.0)];
        steadied(&shots, &rest_px, &region(), &CancelToken::new()).expect("OpenCV")
    }

    #[test]
    fn a_trembling_camera_and_passing_clouds_are_taken_out() {
        let shift = Vector2::new(1.6, -1.0);
        let pictures = [ground(Vector2::zeros(), 1.0), ground(shift, 1.3)];
        let sway = Vector2::new(4.0, 0.5);
        let displacements = [
            vec![Some(Vector2::zeros()), None],
            vec![Some(shift + sway), None],
        ];
        let steady = steady(&pictures, &displacements);
        // Both stand where the camera was on average.
        for (shot, expected) in steady.iter().zip([0.5 * shift, sway + 0.5 * shift]) {
            let moved = shot.displacements[0].expect("seen");
            assert!((moved - expected).norm() < 0.1, "{moved} {expected}");
            assert_eq!(shot.displacements[1], None);
        }
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

    /// The corners of a shadow move, but most corners do not.
    #[test]
    fn a_shadow_that_wanders_over_the_ground_is_no_motion_of_the_camera() {
        let mut pictures = Vec::new();
        for left in [0, 6] {
            let mut picture = ground(Vector2::zeros(), 1.0);
            for (i, pixel) in picture.pixels.chunks_exact_mut(3).enumerate() {
                let (u, v) = (i % SIZE.width as usize, i / SIZE.width as usize);
                if (left + 4..left + 34).contains(&u) && (20..80).contains(&v) {
                    pixel.iter_mut().for_each(|colour| *colour /= 2);
                }
            }
            pictures.push(picture);
        }
        let displacements = vec![vec![Some(Vector2::zeros()), None]; 2];
        for shot in steady(&pictures, &displacements) {
            assert_eq!(shot.displacements[0], Some(Vector2::zeros()));
        }
    }

    #[test]
    fn a_steady_camera_and_a_plain_background_are_left_alone() {
        let still = ground(Vector2::zeros(), 1.0);
        let plain = Rgb {
            size: SIZE,
            pixels: vec![140; 3 * SIZE.area()],
        };
        for picture in [still, plain] {
            let displacements = vec![vec![Some(Vector2::new(3.0, 1.0)), None]; 2];
            for shot in steady(&[picture.clone(), picture.clone()], &displacements) {
                assert_eq!(shot.picture.pixels, picture.pixels);
                let moved = shot.displacements[0].expect("seen");
                assert!((moved - Vector2::new(3.0, 1.0)).norm() < 1e-9);
            }
        }
        assert!(steady(&[], &[]).is_empty());
    }
}

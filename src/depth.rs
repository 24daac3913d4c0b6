//! The depth of a point in a depth image. Holes are missing, and so are flying pixels: at the edge of
//! a branch a sensor mixes it with what is behind, and gives a depth where nothing is.

mod gate;
mod lag;
mod register;

pub use gate::DepthGate;
pub use lag::{DepthLag, LagMeter};
pub use register::Registration;

use crate::config;
use crate::model::{CameraModel, DepthFormat, DepthImage, DepthRig, DepthSeen, Pinhole, Size};
use crate::signal::median;
use nalgebra::{Isometry3, Matrix3, Point2, Rotation3, Translation3, UnitQuaternion, Vector2};

/// The depth of a point is that of the pixels around it up to this distance, px of the depth image.
const RADIUS: i64 = 2;
/// Two pixels that differ by more than this many standard deviations of a difference are on different
/// things.
const JUMP_SDS: f64 = 3.0;
/// They may always differ by this share of their distance: a branch that runs towards the camera.
const JUMP_SHARE: f64 = 0.01;
/// A pixel counts if so many of the eight around it are on the same thing. Along a twig of one pixel
/// there are two; of flying pixels each has a depth of its own.
const LEAST_ALIKE: usize = 2;
/// Fewer pixels are no thing.
const LEAST_PIXELS: usize = 3;

/// The colour camera of the settings; `None` where they do not have it.
pub fn pinhole(settings: &config::Depth) -> Option<Pinhole> {
    let pinhole = Pinhole {
        focal_px: Vector2::new(settings.fx_px, settings.fy_px),
        middle_px: Point2::new(settings.cx_px, settings.cy_px),
    };
    pinhole.is_valid().then_some(pinhole)
}

/// The same with its distortion, for pictures of the size `picture`.
pub fn colour_camera(settings: &config::Depth, picture: Size) -> Option<CameraModel> {
    Some(CameraModel {
        size: picture,
        pinhole: pinhole(settings)?,
        distortion: CameraModel::coefficients(&settings.distortion),
    })
}

/// The depth camera of the settings beside the colour camera; `None` where they have none.
pub fn rig(settings: &config::Depth, colour: CameraModel) -> Option<DepthRig> {
    let own = settings.own_camera.first()?;
    let pinhole = Pinhole {
        focal_px: Vector2::new(own.fx_px, own.fy_px),
        middle_px: Point2::new(own.cx_px, own.cy_px),
    };
    let depth = CameraModel {
        size: Size::new(own.width, own.height),
        pinhole,
        distortion: CameraModel::coefficients(&own.distortion),
    };
    let turn = Rotation3::from_matrix(&Matrix3::from_row_slice(&own.rotation));
    let colour_from_depth = Isometry3::from_parts(
        Translation3::from(own.translation_m),
        UnitQuaternion::from_rotation_matrix(&turn),
    );
    Some(DepthRig {
        depth,
        colour,
        colour_from_depth,
    })
}

/// The format of the film's depth images by the settings of its run; `None` for a film without depth.
pub fn format(settings: &config::Depth) -> Option<DepthFormat> {
    let pinhole = pinhole(settings).filter(|_| settings.read && settings.unit_m > 0.0)?;
    Some(DepthFormat {
        pinhole,
        distortion: CameraModel::coefficients(&settings.distortion),
        unit_m: settings.unit_m,
        late_s: settings.late_s,
    })
}

/// The settings of a run on a film with depth images of this format, or without any.
pub fn settings_of_run(settings: &config::Depth, format: Option<&DepthFormat>) -> config::Depth {
    let (focal_px, middle_px) = format.map_or((Vector2::zeros(), Point2::origin()), |format| {
        (format.pinhole.focal_px, format.pinhole.middle_px)
    });
    config::Depth {
        unit_m: format.map_or(0.0, |format| format.unit_m),
        fx_px: focal_px.x,
        fy_px: focal_px.y,
        cx_px: middle_px.x,
        cy_px: middle_px.y,
        distortion: format.map_or(Vec::new(), |format| without_zeros(&format.distortion)),
        ..settings.clone()
    }
}

/// Coefficients without those at the end that are 0.
fn without_zeros(distortion: &[f64; 8]) -> Vec<f64> {
    let last = distortion.iter().rposition(|k| *k != 0.0);
    distortion[..last.map_or(0, |last| last + 1)].to_vec()
}

/// Reads depths of points.
#[derive(Clone, Debug)]
pub struct DepthReader {
    unit_m: f64,
    noise_m: f64,
    noise_per_m: f64,
}

impl DepthReader {
    /// `None` for a film without depth.
    pub fn new(settings: &config::Depth) -> Option<Self> {
        format(settings).map(|format| Self {
            unit_m: format.unit_m,
            noise_m: settings.noise_m,
            noise_per_m: settings.noise_per_m,
        })
    }

    /// Standard deviation of a depth, m. That of triangulation, by stripes or by two cameras, grows
    /// with the square of the distance (Khoshelham and Elberink 2012 eq. 9).
    fn sd_m(&self, depth_m: f64) -> f64 {
        let noise_m = self.noise_m.hypot(self.noise_per_m * depth_m * depth_m);
        // That of rounding to a count.
        noise_m.max(self.unit_m / 12.0_f64.sqrt())
    }

    /// The depth of what is seen at `at_px` of a picture of the size `picture`; `None` where that is
    /// not known. At an edge it is that of the nearer thing: points are on the tree, and what is
    /// behind it does not move.
    pub fn at(&self, image: &DepthImage, picture: Size, at_px: Point2<f64>) -> Option<DepthSeen> {
        let middle = Pixel::at(at_px, picture, image.size)?;
        let mut depths_m = Vec::new();
        for v in middle.v - RADIUS..=middle.v + RADIUS {
            for u in middle.u - RADIUS..=middle.u + RADIUS {
                depths_m.extend(self.on_a_thing(image, Pixel { u, v }));
            }
        }
        depths_m.sort_unstable_by(f64::total_cmp);
        let depth_m = self.nearest_thing(&depths_m)?;
        Some(DepthSeen {
            depth_m: depth_m as f32,
            // Pixels beside each other share their error.
            sd_m: self.sd_m(depth_m) as f32,
        })
    }

    /// The depth of a pixel that is neither a hole nor flies, m.
    fn on_a_thing(&self, image: &DepthImage, at: Pixel) -> Option<f64> {
        let depth_m = self.depth_m(image, at)?;
        let jump_m = self.jump_m(depth_m);
        let mut alike = 0;
        for v in at.v - 1..=at.v + 1 {
            for u in at.u - 1..=at.u + 1 {
                let beside = Pixel { u, v };
                let other_m = self.depth_m(image, beside).filter(|_| beside != at);
                alike += usize::from(other_m.is_some_and(|m| (m - depth_m).abs() <= jump_m));
            }
        }
        (alike >= LEAST_ALIKE).then_some(depth_m)
    }

    /// The middle depth of the nearest thing among sorted depths, m.
    fn nearest_thing(&self, depths_m: &[f64]) -> Option<f64> {
        let things = depths_m.chunk_by(|a, b| b - a <= self.jump_m(*a));
        let nearest = things
            .into_iter()
            .find(|thing| thing.len() >= LEAST_PIXELS)?;
        median(nearest.to_vec(), f64::total_cmp)
    }

    fn depth_m(&self, image: &DepthImage, at: Pixel) -> Option<f64> {
        Some(f64::from(image.count(at.u, at.v)?) * self.unit_m)
    }

    /// How far two pixels on the same thing differ at most, m; at least by a step of the sensor.
    fn jump_m(&self, depth_m: f64) -> f64 {
        let by_noise_m = JUMP_SDS * std::f64::consts::SQRT_2 * self.sd_m(depth_m);
        by_noise_m.max(JUMP_SHARE * depth_m).max(1.5 * self.unit_m)
    }
}

/// A pixel of a depth image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Pixel {
    u: i64,
    v: i64,
}

impl Pixel {
    /// The pixel of a depth image at a place of the picture; `None` where the place is no number.
    fn at(at_px: Point2<f64>, picture: Size, depth: Size) -> Option<Self> {
        let across = f64::from(depth.width) / f64::from(picture.width);
        let down = f64::from(depth.height) / f64::from(picture.height);
        // Pixels are counted from the middle of the first one.
        let (u, v) = ((at_px.x + 0.5) * across - 0.5, (at_px.y + 0.5) * down - 0.5);
        (u.is_finite() && v.is_finite()).then(|| Self {
            u: u.round() as i64,
            v: v.round() as i64,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        width: 40,
        height: 30,
    };
    const MILLIMETRE: f64 = 0.001;

    fn reader() -> DepthReader {
        DepthReader {
            unit_m: MILLIMETRE,
            noise_m: 0.0,
            noise_per_m: 0.0014,
        }
    }

    /// A branch 4 px wide at 2 m before a wall at 3 m; beside it flying pixels, and in it holes.
    fn branch() -> DepthImage {
        let mut counts = vec![3000; SIZE.area()];
        for v in 0..30 {
            for u in 18..22 {
                counts[v * 40 + u] = 2000 + (v % 3) as u16;
            }
            counts[v * 40 + 22] = 2150 + 25 * v as u16;
            if v % 4 == 0 {
                counts[v * 40 + 19] = 0;
            }
        }
        DepthImage::new(SIZE, counts)
    }

    #[test]
    fn an_edge_has_the_depth_of_the_branch_and_not_of_what_flies_beside_it() {
        let image = branch();
        for v in 4..26 {
            for u in [18.0, 20.0, 21.4, 22.0, 23.0] {
                let seen = reader().at(&image, SIZE, Point2::new(u, f64::from(v)));
                let seen = seen.expect("a depth");
                assert!((seen.depth_m - 2.001).abs() < 0.0021, "{u} {v}: {seen:?}");
                assert!((seen.sd_m - 0.0056).abs() < 1e-4);
            }
        }
        let wall = reader().at(&image, SIZE, Point2::new(30.0, 10.0));
        assert!((wall.expect("a wall").depth_m - 3.0).abs() < 1e-6);
    }

    #[test]
    fn holes_and_lone_pixels_have_no_depth() {
        let mut image = branch();
        image.counts.fill(0);
        let at = |image: &DepthImage| reader().at(image, SIZE, Point2::new(20.0, 15.0));
        assert_eq!(at(&image), None);
        image.counts[15 * 40 + 20] = 2000;
        assert_eq!(at(&image), None);
        assert_eq!(reader().at(&image, SIZE, Point2::new(f64::NAN, 1.0)), None);
        assert_eq!(reader().at(&image, SIZE, Point2::new(-90.0, 1.0)), None);
    }

    #[test]
    fn a_depth_image_may_be_smaller_than_the_picture() {
        let picture = Size::new(80, 60);
        let seen = reader().at(&branch(), picture, Point2::new(40.0, 30.0));
        assert!((seen.expect("a depth").depth_m - 2.001).abs() < 0.0021);
    }
}

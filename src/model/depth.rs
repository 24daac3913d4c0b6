//! Depth beside a picture: images of it, what a point has of it, and what it says of a tree.

use super::{Size, TrackId};
use nalgebra::{Point2, Point3, Vector2};
use std::collections::BTreeMap;

/// A picture and a depth image that are further apart in time do not belong together, s (Sturm et al.
/// 2012).
pub const DEPTH_APART_S: f64 = 0.02;
/// Depth images may be stamped later or earlier than they were taken by this at most, s.
pub const LONGEST_LAG_S: f64 = 0.25;

/// Focal lengths across and down are in this proportion: pixels are squares, or of television.
const FOCAL_RATIOS: std::ops::RangeInclusive<f64> = 0.5..=2.0;
/// Angles that pictures span across, degrees.
const VIEWS_DEG: std::ops::RangeInclusive<f64> = 0.5..=170.0;

/// A camera without distortion: where places before it are seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Focal lengths across and down, px.
    pub focal_px: Vector2<f64>,
    /// Where the axis meets the picture, px.
    pub middle_px: Point2<f64>,
}

impl Pinhole {
    /// The place that is seen at `at_px` in this depth (along the axis), in the camera's axes: x right,
    /// y down, z away from it, m.
    pub fn place_m(&self, at_px: Point2<f64>, depth_m: f64) -> Point3<f64> {
        let ray = (at_px - self.middle_px).component_div(&self.focal_px);
        Point3::new(ray.x * depth_m, ray.y * depth_m, depth_m)
    }

    /// Whether pictures of this size can be of it: what is written wrongly by a digit is no camera.
    ///
    /// # Errors
    /// Why not, in one line.
    pub fn check(&self, picture: Size) -> Result<(), String> {
        if !self.is_valid() {
            return Err("its focal lengths must be numbers above 0".to_owned());
        }
        let [across, down] = [self.focal_px.x, self.focal_px.y];
        if !FOCAL_RATIOS.contains(&(across / down)) {
            return Err(format!(
                "its focal lengths are {across} px across and {down} px down, and they are nearly the same in all \
                 cameras"
            ));
        }
        let view_deg = 2.0
            * (0.5 * f64::from(picture.width) / across)
                .atan()
                .to_degrees();
        if !VIEWS_DEG.contains(&view_deg) {
            return Err(format!(
                "with a focal length of {across} px its picture spans {view_deg:.1} degrees, and {} to {} are usual",
                VIEWS_DEG.start(),
                VIEWS_DEG.end()
            ));
        }
        let [u, v] = [self.middle_px.x, self.middle_px.y];
        let is_in = (0.0..=f64::from(picture.width)).contains(&u)
            && (0.0..=f64::from(picture.height)).contains(&v);
        match is_in {
            true => Ok(()),
            false => Err(format!(
                "its middle is {u}, {v} px, off the picture of {picture}"
            )),
        }
    }

    /// Whether it is one: focal lengths above 0, all numbers finite.
    pub fn is_valid(&self) -> bool {
        let numbers = self.focal_px.iter().chain(self.middle_px.iter());
        numbers.clone().all(|x| x.is_finite()) && self.focal_px.iter().all(|f| *f > 0.0)
    }
}

/// A depth image as the sensor gives it, row by row: counts of its unit along the axis of the colour
/// camera, with whose picture it is registered; 0 where nothing was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    pub size: Size,
    pub counts: Vec<u16>,
    /// How much later than its picture it was taken, by the stamps of both as far as they are set right, s.
    pub later_s: f64,
}

/// Length of a count of [`DepthImage::from_metres`], m: below the noise of all sensors from 1 m on.
pub const METRES_UNIT_M: f64 = 0.001;

impl DepthImage {
    /// An image of depths in metres, row by row, in counts of [`METRES_UNIT_M`]; what is no depth
    /// above 0, or is beyond 65 m, is a hole. `None` where there are too few numbers.
    pub fn from_metres(size: Size, metres: impl Iterator<Item = f32>) -> Option<Self> {
        let mut counts = Vec::with_capacity(size.area());
        for depth_m in metres.take(size.area()) {
            let count = (f64::from(depth_m) / METRES_UNIT_M).round();
            let is_depth = (1.0..f64::from(u16::MAX)).contains(&count);
            counts.push(if is_depth { count as u16 } else { 0 });
        }
        (counts.len() == size.area()).then_some(Self::new(size, counts))
    }

    /// An image of the moment of its picture.
    pub fn new(size: Size, counts: Vec<u16>) -> Self {
        Self {
            size,
            counts,
            later_s: 0.0,
        }
    }

    /// An image of counts of two bytes, the lower first; `None` where there are too few.
    pub fn from_bytes(size: Size, bytes: &[u8]) -> Option<Self> {
        let pixels = bytes.chunks_exact(2).take(size.area());
        let counts: Vec<u16> = pixels.map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
        (counts.len() == size.area()).then_some(Self::new(size, counts))
    }

    /// Memory that it takes, bytes.
    pub fn bytes(&self) -> usize {
        2 * self.counts.len()
    }

    /// Whether a count says that nothing was measured. The highest number marks too far in several
    /// formats.
    pub fn is_hole(count: u16) -> bool {
        count == 0 || count == u16::MAX
    }

    /// The count of a pixel; `None` where nothing was measured, and outside.
    pub fn count(&self, u: i64, v: i64) -> Option<u16> {
        let (u, v) = (u32::try_from(u).ok()?, u32::try_from(v).ok()?);
        if u >= self.size.width || v >= self.size.height {
            return None;
        }
        let at = v as usize * self.size.width as usize + u as usize;
        let count = self.counts.get(at).copied();
        count.filter(|count| !Self::is_hole(*count))
    }
}

/// What is known of the depth images of a film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthFormat {
    /// The colour camera, with which they are registered.
    pub pinhole: Pinhole,
    /// How its lens distorts, as in [`CameraModel`](super::CameraModel); 0 where nobody knows.
    pub distortion: [f64; 8],
    /// Metres for each count.
    pub unit_m: f64,
    /// How much later its images are stamped than they were taken, by the clock of the pictures, s.
    pub late_s: f64,
}

/// The depth of a point along the camera's axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthSeen {
    pub depth_m: f32,
    /// Its standard deviation, m.
    pub sd_m: f32,
}

/// A place along the line of sight in model axes, towards the viewer from the trunk's foot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeDepth {
    pub z_px: f64,
    /// Its standard deviation, px.
    pub sd_px: f64,
}

/// What depth says of a tree at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct RestDepths {
    /// Distance of the trunk's foot from the camera along its axis, m.
    pub foot_m: f64,
    /// Length of a pixel at that distance, m: the scale of the model.
    pub metres_per_px: f64,
    /// Depth of the points at rest.
    pub tracks: BTreeMap<TrackId, DepthSeen>,
}

impl RestDepths {
    /// The same place in model axes.
    pub fn in_model(&self, seen: DepthSeen) -> NodeDepth {
        NodeDepth {
            z_px: depth_in_model_px(self.foot_m, self.metres_per_px, seen.depth_m.into()),
            sd_px: f64::from(seen.sd_m) / self.metres_per_px,
        }
    }
}

/// Where a place at `depth_m` is along the line of sight in model axes, px towards the viewer from a
/// foot at `foot_m`, where a pixel is `metres_per_px` long.
pub fn depth_in_model_px(foot_m: f64, metres_per_px: f64, depth_m: f64) -> f64 {
    (foot_m - depth_m) / metres_per_px
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_that_is_written_wrongly_is_refused() {
        let why = |fx: f64, fy: f64, cx: f64| {
            let pinhole = Pinhole {
                focal_px: Vector2::new(fx, fy),
                middle_px: Point2::new(cx, 180.0),
            };
            pinhole.check(Size::new(640, 360)).err().unwrap_or_default()
        };
        assert_eq!(why(525.0, 527.0, 319.5), "");
        assert!(why(525.0, 52.5, 319.5).contains("nearly the same in all cameras"));
        assert!(why(100_001.0, 100_001.0, 319.5).contains("spans 0.4 degrees"));
        assert!(why(5.0, 5.0, 319.5).contains("spans 178.2 degrees"));
        assert!(why(525.0, 525.0, -5.0).contains("off the picture of 640x360"));
        assert!(why(f64::NAN, 525.0, 319.5).contains("above 0"));
    }

    #[test]
    fn a_place_is_found_from_its_pixel_and_depth() {
        let pinhole = Pinhole {
            focal_px: Vector2::new(500.0, 250.0),
            middle_px: Point2::new(319.5, 239.5),
        };
        let place = pinhole.place_m(Point2::new(419.5, 189.5), 2.0);
        assert!((place - Point3::new(0.4, -0.4, 2.0)).norm() < 1e-12);
        assert!(pinhole.is_valid());
        let none = Pinhole {
            focal_px: Vector2::new(0.0, 250.0),
            ..pinhole
        };
        assert!(!none.is_valid());
    }

    #[test]
    fn depths_in_metres_are_counted_and_holes_stay_holes() {
        let metres = [2.0, 0.0, f32::NAN, f32::INFINITY, -1.0, 1.2346];
        let size = Size::new(3, 2);
        let image = DepthImage::from_metres(size, metres.into_iter()).expect("an image");
        assert_eq!(image.counts, [2000, 0, 0, 0, 0, 1235]);
        assert_eq!(DepthImage::from_metres(size, [1.0].into_iter()), None);
    }

    #[test]
    fn what_was_not_measured_is_missing_and_not_near() {
        let image = DepthImage::new(Size::new(2, 2), vec![0, 900, u16::MAX, 7]);
        let at = |u, v| image.count(u, v);
        assert_eq!(
            [at(0, 0), at(1, 0), at(0, 1), at(1, 1)],
            [None, Some(900), None, Some(7)]
        );
        assert_eq!([at(-1, 0), at(2, 0), at(0, 2)], [None; 3]);
    }
}

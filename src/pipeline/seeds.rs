//! Where a picture shows leaves: one seed for each.

use crate::config;
use crate::model::{CameraMotion, Luma, Outline, Rgb};
use crate::track::Detector;
use nalgebra::Point2;

/// Corners may lie nearer together than points that are followed, px at 640 px picture width, and
/// be weaker: each is a leaf.
const SEED_DISTANCE_PX: f64 = 3.0;
const SEED_QUALITY: f64 = 1e-4;

/// Harris corners of a whole frame inside the outline, px, strongest first.
pub fn seeds(picture: &Rgb, outline: &Outline, count: u32) -> Vec<Point2<f32>> {
    if picture.pixels.len() != 3 * picture.size.area() || outline.mask.len() != outline.size.area()
    {
        return Vec::new();
    }
    let detect = config::Detect {
        points: count,
        min_distance_px: SEED_DISTANCE_PX,
        quality: SEED_QUALITY,
        border_px: 0.0,
    };
    let luma = Luma {
        size: picture.size,
        pixels: picture.pixels.chunks_exact(3).map(grey).collect(),
    };
    let camera = CameraMotion::default();
    Detector::new(&detect, outline).detect(&luma, &[], count as usize, &camera)
}

/// Luma of a pixel of red, green and blue (ITU-R BT.601), 0 to 255.
fn grey(pixel: &[u8]) -> u8 {
    let [r, g, b] = [pixel[0], pixel[1], pixel[2]].map(u32::from);
    ((299 * r + 587 * g + 114 * b + 500) / 1000) as u8
}

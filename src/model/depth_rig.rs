//! Two cameras side by side, one of depth and one of colour: where each sees a place.

use super::{Pinhole, Size};
use nalgebra::{Isometry3, Point2, Vector2};

/// Rounds of the search for the ray of a pixel; each gains a digit or more with usual lenses.
const MAX_ROUNDS: usize = 40;
/// A round that moves less than this, as a share of the focal length, is the last one.
const CONVERGED: f64 = 1e-9;
/// A ray that is not seen nearer to its pixel than this has not been found, as a share of the focal
/// length: a tenth of a pixel of a usual camera.
const FOUND: f64 = 2e-4;

/// A camera with its distortion, for images of a size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraModel {
    /// Size of the images that it is for, px.
    pub size: Size,
    pub pinhole: Pinhole,
    /// k1, k2, p1, p2, k3, k4, k5, k6 of OpenCV's rational model; with the last three 0 that is
    /// Brown's (1966), and all of them 0 are no distortion.
    pub distortion: [f64; 8],
}

impl CameraModel {
    /// A camera without distortion.
    pub fn new(size: Size, pinhole: Pinhole) -> Self {
        Self {
            size,
            pinhole,
            distortion: [0.0; 8],
        }
    }

    /// The numbers of a distortion of which only these first ones are given, in the same order.
    pub fn coefficients(first: &[f64]) -> [f64; 8] {
        std::array::from_fn(|k| first.get(k).copied().unwrap_or(0.0))
    }

    /// Whether it is one: a size, focal lengths above 0, all numbers finite.
    pub fn is_valid(&self) -> bool {
        self.size.area() > 0
            && self.pinhole.is_valid()
            && self.distortion.iter().all(|k| k.is_finite())
    }

    /// The same for images of another size with the same view.
    pub fn for_size(&self, size: Size) -> Self {
        let scale = Vector2::new(
            f64::from(size.width) / f64::from(self.size.width),
            f64::from(size.height) / f64::from(self.size.height),
        );
        let half = Vector2::repeat(0.5);
        // Pixels are counted from the middle of the first one.
        let middle_px = (self.pinhole.middle_px + half).coords;
        let pinhole = Pinhole {
            focal_px: self.pinhole.focal_px.component_mul(&scale),
            middle_px: Point2::from(middle_px.component_mul(&scale) - half),
        };
        Self {
            size,
            pinhole,
            ..*self
        }
    }

    /// Where a ray through (x, y, 1) is seen, px.
    pub fn seen_px(&self, ray: Vector2<f64>) -> Point2<f64> {
        let bent = bent(&self.distortion, ray);
        self.pinhole.middle_px + bent.component_mul(&self.pinhole.focal_px)
    }

    /// The ray through (x, y, 1) that is seen at `at_px`; `None` where the model has none.
    pub fn ray(&self, at_px: Point2<f64>) -> Option<Vector2<f64>> {
        let seen = (at_px - self.pinhole.middle_px).component_div(&self.pinhole.focal_px);
        let mut ray = seen;
        for _ in 0..MAX_ROUNDS {
            let step = seen - bent(&self.distortion, ray);
            ray += step;
            if step.norm() < CONVERGED {
                break;
            }
        }
        let off = (seen - bent(&self.distortion, ray)).norm();
        // What is no number is not found, either.
        (off < FOUND).then_some(ray)
    }
}

/// OpenCV's rational model of a lens.
fn bent(distortion: &[f64; 8], at: Vector2<f64>) -> Vector2<f64> {
    let [k1, k2, p1, p2, k3, k4, k5, k6] = *distortion;
    let (x, y, square) = (at.x, at.y, at.norm_squared());
    let above = 1.0 + square * (k1 + square * (k2 + square * k3));
    let below = 1.0 + square * (k4 + square * (k5 + square * k6));
    let radial = above / below;
    Vector2::new(
        x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
        y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
    )
}

/// A depth camera beside a colour camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthRig {
    pub depth: CameraModel,
    pub colour: CameraModel,
    /// From the axes of the depth camera to those of the colour camera (x right, y down, z away), m.
    pub colour_from_depth: Isometry3<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_is_seen_where_it_came_from() {
        let pinhole = Pinhole {
            focal_px: Vector2::new(505.0, 504.0),
            middle_px: Point2::new(330.25, 332.0),
        };
        let size = Size::new(640, 576);
        // Of a camera of an Azure Kinect.
        let wide = [0.436, 0.068, -9e-5, 6.4e-5, 0.0044, 0.773, 0.148, 0.020];
        let brown = [-0.2, 0.05, 1e-3, -5e-4, 0.0, 0.0, 0.0, 0.0];
        for distortion in [[0.0; 8], wide, brown] {
            let camera = CameraModel {
                size,
                pinhole,
                distortion,
            };
            for at_px in size.corners_px().into_iter().chain([pinhole.middle_px]) {
                let ray = camera.ray(at_px).expect("a ray");
                assert!((camera.seen_px(ray) - at_px).norm() < 0.01);
                let half = camera.for_size(Size::new(320, 288));
                let expected = (at_px + Vector2::repeat(0.5)) / 2.0 - Vector2::repeat(0.5);
                assert!((half.seen_px(ray) - expected).norm() < 0.01);
            }
        }
        let broken = CameraModel {
            size,
            pinhole,
            distortion: [f64::NAN; 8],
        };
        assert!(broken.ray(Point2::new(1.0, 1.0)).is_none() && !broken.is_valid());
    }
}

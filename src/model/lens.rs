//! A lens that bends straight lines, and how points are put where a pinhole would show them.

use super::{Pose, Size, Skeleton};
use nalgebra::{Point2, Point3, Vector2};

/// Rounds of a solver: each gains digits, and all of a double are there long before.
const MAX_ROUNDS: usize = 50;
/// A round that moves less than this, as a share of the focal length, is the last one.
const CONVERGED: f64 = 1e-12;
/// What is seen farther from the middle than this has no place in a flat picture, radians.
const WIDEST_RAD: f64 = 1.5;

/// How a lens distorts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// Four coefficients of the angle to the axis (Kannala and Brandt 2006, as OpenCV's `fisheye`):
    /// angle (1 + k1 angle^2 + k2 angle^4 + k3 angle^6 + k4 angle^8).
    Fisheye([f64; 4]),
    /// Radial and tangential: k1, k2, p1, p2, k3 (Brown 1966, as OpenCV's standard model).
    RadialTangential([f64; 5]),
}

/// A lens as it was calibrated, for pictures of one size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Size of the pictures that it is for, px.
    pub size: Size,
    /// Focal lengths across and down, px.
    pub focal_px: Vector2<f64>,
    /// Where the axis meets the picture, px.
    pub middle_px: Point2<f64>,
    pub distortion: Distortion,
    /// Time from the first to the last row of a frame, s; 0 where that is not known.
    pub readout_s: f64,
}

impl Lens {
    /// The same for pictures of another size that show the same view; `None` where they have other
    /// proportions (by more than 1 %).
    pub fn for_size(&self, size: Size) -> Option<Self> {
        let across = f64::from(size.width) / f64::from(self.size.width);
        let down = f64::from(size.height) / f64::from(self.size.height);
        let is_same_view =
            across.is_finite() && across > 0.0 && (down / across - 1.0).abs() <= 0.01;
        let half = Vector2::repeat(0.5);
        is_same_view.then(|| Self {
            size,
            focal_px: self.focal_px * across,
            // Pixels are counted from the middle of the first one.
            middle_px: (self.middle_px + half) * across - half,
            ..*self
        })
    }

    /// Where a pinhole of the same focal length would show a point, px; no numbers where it has no place
    /// there.
    pub fn undistorted(&self, at_px: Point2<f64>) -> Point2<f64> {
        let bent = (at_px - self.middle_px).component_div(&self.focal_px);
        let straight = match self.distortion {
            Distortion::Fisheye(k) => fisheye_straight(&k, bent),
            Distortion::RadialTangential(k) => brown_straight(&k, bent),
        };
        self.middle_px + straight.component_mul(&self.focal_px)
    }

    /// Where the lens shows a point of a pinhole's picture, px.
    pub fn distorted(&self, at_px: Point2<f64>) -> Point2<f64> {
        let straight = (at_px - self.middle_px).component_div(&self.focal_px);
        let bent = match self.distortion {
            Distortion::Fisheye(k) => {
                let radius = straight.norm();
                let share = if radius > 0.0 {
                    fisheye(&k, radius.atan()) / radius
                } else {
                    1.0
                };
                share * straight
            }
            Distortion::RadialTangential(k) => brown(&k, straight),
        };
        self.middle_px + bent.component_mul(&self.focal_px)
    }

    /// A tree whose nodes are where a pinhole would show them.
    pub fn straighten(&self, skeleton: &Skeleton) -> Skeleton {
        let mut straight = skeleton.clone();
        straight.foot_px = self.undistorted(skeleton.foot_px);
        for node in &mut straight.nodes {
            node.position = self.moved(&node.position, skeleton, straight.foot_px);
        }
        straight
    }

    /// The same of a pose of the tree `skeleton`, whose nodes are where they are filmed.
    pub fn straighten_pose(&self, pose: &mut Pose, skeleton: &Skeleton) {
        let foot_px = self.undistorted(skeleton.foot_px);
        for joint in &mut pose.joints {
            joint.position = self.moved(&joint.position, skeleton, foot_px);
        }
    }

    fn moved(&self, at: &Point3<f64>, skeleton: &Skeleton, foot_px: Point2<f64>) -> Point3<f64> {
        let off = self.undistorted(skeleton.image_from_model(at)) - foot_px;
        Point3::new(off.x, -off.y, at.z)
    }
}

fn fisheye(k: &[f64; 4], angle: f64) -> f64 {
    let square = angle * angle;
    angle * (1.0 + square * (k[0] + square * (k[1] + square * (k[2] + square * k[3]))))
}

fn fisheye_slope(k: &[f64; 4], angle: f64) -> f64 {
    let square = angle * angle;
    1.0 + square
        * (3.0 * k[0] + square * (5.0 * k[1] + square * (7.0 * k[2] + square * 9.0 * k[3])))
}

/// By Newton's method, from the angle that there would be without distortion.
fn fisheye_straight(k: &[f64; 4], bent: Vector2<f64>) -> Vector2<f64> {
    let wanted = bent.norm();
    if wanted == 0.0 {
        return bent;
    }
    let mut angle = wanted.min(WIDEST_RAD);
    for _ in 0..MAX_ROUNDS {
        let step = (fisheye(k, angle) - wanted) / fisheye_slope(k, angle);
        angle -= step;
        if step.abs() < CONVERGED {
            break;
        }
    }
    let is_solved =
        (fisheye(k, angle) - wanted).abs() < 1e-9 && (0.0..=WIDEST_RAD).contains(&angle);
    match is_solved {
        true => angle.tan() / wanted * bent,
        false => Vector2::repeat(f64::NAN),
    }
}

fn brown(k: &[f64; 5], at: Vector2<f64>) -> Vector2<f64> {
    let [k1, k2, p1, p2, k3] = *k;
    let (x, y, square) = (at.x, at.y, at.norm_squared());
    let radial = 1.0 + square * (k1 + square * (k2 + square * k3));
    Vector2::new(
        x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
        y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
    )
}

/// By fixed-point rounds, as OpenCV's `undistortPoints`.
fn brown_straight(k: &[f64; 5], bent: Vector2<f64>) -> Vector2<f64> {
    let mut straight = bent;
    for _ in 0..MAX_ROUNDS {
        let step = bent - brown(k, straight);
        straight += step;
        if step.norm() < CONVERGED {
            break;
        }
    }
    match (brown(k, straight) - bent).norm() < 1e-9 {
        true => straight,
        false => Vector2::repeat(f64::NAN),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens(distortion: Distortion) -> Lens {
        Lens {
            size: Size::new(640, 360),
            focal_px: Vector2::new(500.0, 502.0),
            middle_px: Point2::new(322.0, 176.0),
            distortion,
            readout_s: 0.0,
        }
    }

    #[test]
    fn points_come_back_from_where_the_lens_shows_them() {
        let fisheye = lens(Distortion::Fisheye([0.05, -0.02, 0.01, -0.003]));
        let brown = lens(Distortion::RadialTangential([
            -0.21, 0.06, 0.001, -0.0007, -0.01,
        ]));
        for lens in [fisheye, brown] {
            for at in [[322.0, 176.0], [5.0, 4.0], [630.0, 350.0], [100.0, 300.0]] {
                let straight = lens.undistorted(at.into());
                let off = lens.distorted(straight) - Point2::from(at);
                assert!(off.norm() < 1e-6, "{lens:?}, {at:?}: {off}");
            }
            let corner = Point2::new(5.0, 4.0);
            assert!((lens.undistorted(corner) - corner).norm() > 3.0, "{lens:?}");
        }
    }

    /// An equidistant lens: a point at the angle a is a focal lengths from the middle.
    #[test]
    fn an_equidistant_lens_is_known() {
        let lens = lens(Distortion::Fisheye([0.0; 4]));
        let at = lens.undistorted(Point2::new(322.0 + 500.0 * 0.4, 176.0));
        assert!((at.x - (322.0 + 500.0 * 0.4_f64.tan())).abs() < 1e-9 && at.y == 176.0);
        assert!(
            lens.undistorted(Point2::new(322.0 + 500.0 * 1.6, 176.0))
                .x
                .is_nan()
        );
    }

    #[test]
    fn a_smaller_picture_of_the_same_view_has_a_smaller_lens() {
        let full = lens(Distortion::Fisheye([0.1, 0.0, 0.0, 0.0]));
        let half = full.for_size(Size::new(320, 180)).expect("the same view");
        assert_eq!((half.focal_px.x, half.middle_px.x), (250.0, 160.75));
        assert!(full.for_size(Size::new(640, 480)).is_none());
    }
}

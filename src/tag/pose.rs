//! How a square hangs before a camera, by its corners in the picture (Collins and Bartoli 2014,
//! "Infinitesimal Plane-based Pose Estimation", IPPE), made exact by least squares on the corners.

use super::homography::{Homography, SQUARE};
use nalgebra::{
    Matrix2, Matrix3, Point2, Rotation3, RowVector3, SMatrix, SVector, Vector2, Vector3,
};

/// Rounds of least squares: corners move by less than a thousandth of a pixel after six.
const ROUNDS: usize = 12;
/// A step that makes it worse is shortened so often.
const SHORTER: usize = 6;
/// A parameter is moved so far to see what the corners owe to it, rad and px.
const NUDGE: f64 = 1e-5;
/// Added to the diagonal, as a share of it: near to the front the tilt hardly moves the corners.
const DAMPING: f64 = 1e-6;

/// Numbers of a pose, and of corners. The first three are the turn, then follow place and size.
const FREE: usize = 6;
pub const TURN: usize = 0;
const PLACE: usize = 3;
pub const SIZE: usize = 5;
const SEEN: usize = 8;

/// How the numbers of a pose change with the corners.
pub type Answer = SMatrix<f64, FREE, SEEN>;

/// Corners as one vector: u and v of each.
pub type Corners = SVector<f64, SEEN>;

/// A square of side 1 before a camera whose axis meets the picture at the origin.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    focal_px: f64,
    /// Its middle in the picture, px.
    middle_px: Vector2<f64>,
    /// Pixels for its side where that is parallel to the picture, at the depth of its middle.
    pub side_px: f64,
    /// Its axes, to the right, down and away from the camera, in those of the camera.
    turned: Rotation3<f64>,
}

/// A pose by least squares.
#[derive(Clone, Copy, Debug)]
pub struct Fitted {
    pub pose: Pose,
    /// How turn (rad), place (px) and size (as a share) answer to each corner, for 1 px.
    pub answer: Answer,
    /// The squares that are left, px².
    pub left_px2: f64,
}

impl Pose {
    /// Both poses that look alike from far away, with this focal length: the square is turned to the one
    /// side of the line of sight or to the other. Both have the same size.
    pub fn both(homography: &Homography, focal_px: f64) -> Option<[Self; 2]> {
        let middle_px = homography.apply(Point2::origin()).coords;
        let ray = (middle_px / focal_px).push(1.0);
        let to_ray = Rotation3::rotation_between(&Vector3::z(), &ray)?;
        let across = seen_across(&to_ray, middle_px / focal_px);
        let seen = across.try_inverse()? * homography.jacobian();
        let side_px = seen.singular_values().max();
        let plane = seen / side_px;
        let is_sound = side_px.is_finite() && side_px > 0.0 && plane.determinant() > 0.0;
        if !is_sound {
            return None;
        }
        // What is missing to columns of length 1 and right angles points along the line of sight.
        let missing = Matrix2::identity() - plane.transpose() * plane;
        let along = Vector2::new(
            missing[(0, 0)].max(0.0).sqrt(),
            missing[(1, 1)].max(0.0).sqrt() * missing[(0, 1)].signum(),
        );
        Some([1.0, -1.0].map(|sign| {
            let right = plane.column(0).push(sign * along.x).normalize();
            let down = plane.column(1).push(sign * along.y);
            let down = (down - right * right.dot(&down)).normalize();
            let turned = Matrix3::from_columns(&[right, down, right.cross(&down)]);
            Self {
                focal_px,
                middle_px,
                side_px,
                turned: to_ray * Rotation3::from_matrix_unchecked(turned),
            }
        }))
    }

    /// Where its corners are seen, px.
    fn corners(&self) -> Corners {
        let mut corners = Corners::zeros();
        for (k, corner) in SQUARE.iter().enumerate() {
            let at = self.turned * corner.coords.push(0.0) * self.side_px;
            let seen = (at.xy() + self.middle_px) / (1.0 + at.z / self.focal_px);
            (corners[2 * k], corners[2 * k + 1]) = (seen.x, seen.y);
        }
        corners
    }

    /// The pose after a step: turn, rad; shift, px; larger by a share.
    fn after(&self, step: &SVector<f64, FREE>) -> Self {
        let turn = Rotation3::from_scaled_axis(step.fixed_rows::<3>(TURN).into_owned());
        Self {
            turned: turn * self.turned,
            middle_px: self.middle_px + step.fixed_rows::<2>(PLACE),
            side_px: self.side_px * step[SIZE].exp(),
            ..*self
        }
    }

    /// The pose whose corners are nearest to these by least squares, from this one on.
    pub fn fitted(self, seen: &Corners) -> Option<Fitted> {
        let (mut pose, mut left) = (self, (seen - self.corners()).norm_squared());
        let mut answer = pose.answer()?;
        for _ in 0..ROUNDS {
            let mut step = answer * (seen - pose.corners());
            let mut is_better = false;
            for _ in 0..SHORTER {
                let next = pose.after(&step);
                let squares = (seen - next.corners()).norm_squared();
                if squares < left {
                    (pose, left, is_better) = (next, squares, true);
                    break;
                }
                step *= 0.5;
            }
            answer = pose.answer()?;
            if !is_better {
                break;
            }
        }
        Some(Fitted {
            pose,
            answer,
            left_px2: left,
        })
    }

    fn answer(&self) -> Option<Answer> {
        let at = self.corners();
        let mut jacobian = SMatrix::<f64, SEEN, FREE>::zeros();
        for k in 0..FREE {
            let mut step = SVector::<f64, FREE>::zeros();
            step[k] = NUDGE;
            jacobian.set_column(k, &((self.after(&step).corners() - at) / NUDGE));
        }
        let mut normal = jacobian.transpose() * jacobian;
        for k in 0..FREE {
            normal[(k, k)] *= 1.0 + DAMPING;
        }
        Some(normal.try_inverse()? * jacobian.transpose())
    }

    /// Which way its lower side is, in the camera's axes.
    pub fn down(&self) -> Vector3<f64> {
        self.turned * Vector3::y()
    }

    /// Angle from the upright of the picture to its own, clockwise, as a camera sees it that looks along the
    /// same axis at something in the middle of its picture, degrees.
    pub fn roll_deg(&self) -> f64 {
        let down = self.down();
        (-down.x).atan2(down.y).to_degrees()
    }

    /// How that changes with a turn about each axis of the camera, degrees for 1 rad.
    pub fn roll_gradient_deg(&self) -> RowVector3<f64> {
        let down = self.down();
        let squares = down.xy().norm_squared().max(f64::MIN_POSITIVE);
        // A turn w moves what is down by w x down.
        let by_x = down.x * down.z;
        let by_y = down.y * down.z;
        let share = RowVector3::new(-by_x, -by_y, squares) / squares;
        share.map(f64::to_degrees)
    }

    /// How much shorter it is along the direction in which it is seen aslant.
    pub fn foreshortened(&self) -> f64 {
        let ray = (self.middle_px / self.focal_px).push(1.0).normalize();
        (self.turned * Vector3::z()).dot(&ray).abs()
    }
}

/// What a plane across a line of sight looks like, that goes through (at, 1): it is seen aslant in the picture.
fn seen_across(to_ray: &Rotation3<f64>, at: Vector2<f64>) -> Matrix2<f64> {
    let turned = to_ray.matrix();
    let flat = turned.fixed_view::<2, 2>(0, 0);
    flat - at * turned.fixed_view::<1, 2>(2, 0)
}

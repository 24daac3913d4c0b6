//! What is known of the camera that sees a tag.

use crate::model::{CameraModel, Pinhole, Size};
use nalgebra::{Point2, Vector2};

/// The field of view of an unknown camera along the longer side of its picture, degrees: the middle of what
/// webcams and telephones have (55 to 78).
const USUAL_VIEW_DEG: f64 = 60.0;
/// Standard deviation of the logarithm of the focal length of an unknown camera: 95 % have from 36 to 92
/// degrees.
const UNKNOWN_SD: f64 = 0.3;
/// Standard deviations to either side that are tried, and steps in each of them.
const MOST_SD: f64 = 2.5;
const STEPS_PER_SD: f64 = 4.0;

/// A focal length that a camera may have, and how likely that is against the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Focal {
    pub px: f64,
    pub weight: f64,
}

/// A camera that sees a tag.
#[derive(Clone, Debug, PartialEq)]
pub struct TagCamera {
    known: Option<CameraModel>,
    middle_px: Point2<f64>,
    focals: Vec<Focal>,
}

impl TagCamera {
    /// A camera that was measured.
    pub fn known(model: CameraModel) -> Self {
        Self {
            middle_px: model.pinhole.middle_px,
            focals: vec![Focal {
                px: model.pinhole.focal_px.mean(),
                weight: 1.0,
            }],
            known: Some(model),
        }
    }

    /// A camera without distortion whose picture of this size spans such an angle along its longer side.
    pub fn of_view(size: Size, view_deg: f64) -> Self {
        let middle_px = middle_px(size);
        let focal_px = Vector2::repeat(focal_px(size, view_deg));
        Self::known(CameraModel::new(
            size,
            Pinhole {
                focal_px,
                middle_px,
            },
        ))
    }

    /// A camera of which nothing is known but the size of its picture.
    pub fn unknown(size: Size) -> Self {
        let usual_px = focal_px(size, USUAL_VIEW_DEG);
        let steps = (MOST_SD * STEPS_PER_SD) as i32;
        let focals = (-steps..=steps).map(|k| {
            let sd = f64::from(k) / STEPS_PER_SD;
            Focal {
                px: usual_px * (UNKNOWN_SD * sd).exp(),
                weight: (-0.5 * sd * sd).exp(),
            }
        });
        Self {
            known: None,
            middle_px: middle_px(size),
            focals: focals.collect(),
        }
    }

    /// The focal lengths that it may have.
    pub fn focals(&self) -> &[Focal] {
        &self.focals
    }

    /// A place of the picture from where the axis meets it, without distortion, px; `None` where the lens
    /// shows nothing.
    pub fn from_axis_px(&self, at_px: Point2<f64>) -> Option<Point2<f64>> {
        match (&self.known, self.focals.first()) {
            (Some(model), Some(focal)) => Some((model.ray(at_px)? * focal.px).into()),
            _ => Some((at_px - self.middle_px).into()),
        }
    }
}

fn middle_px(size: Size) -> Point2<f64> {
    Point2::new(f64::from(size.width) - 1.0, f64::from(size.height) - 1.0) * 0.5
}

fn focal_px(size: Size, view_deg: f64) -> f64 {
    0.5 * f64::from(size.width.max(size.height)) / (0.5 * view_deg.to_radians()).tan()
}

//! One cluster of leaves at its place.

use super::attachment::AttachmentPoint;
use super::template::Template;
use nalgebra::{Matrix3, Point3, Rotation3, Vector3};

/// A copy of the template at rest.
#[derive(Clone, Debug)]
pub(super) struct Cluster {
    pub attachment: usize,
    /// Middle of the cluster, model axes at rest, px.
    pub centre: Point3<f64>,
    /// y is its main axis, z where its leaves face.
    pub turn: Rotation3<f64>,
    /// px.
    pub size: f64,
}

impl Cluster {
    /// A cluster that is not turned yet.
    pub fn upright(attachment: usize, centre: Point3<f64>, size: f64) -> Self {
        Self {
            attachment,
            centre,
            turn: Rotation3::identity(),
            size,
        }
    }

    /// Where a point of the template is at rest.
    pub fn at(&self, template: &Template, p: &Point3<f64>) -> Point3<f64> {
        self.centre + self.turn * (p - template.centre) * self.size
    }
}

/// How a cluster stands, by where it is (Li 2011 app. B.1): it grows away from its branch and on
/// along it, outwards and up; its leaves face outwards and to the sky. `axis` is the trunk; `off`
/// is drawn from a normal distribution, mean 0 and deviation 1.
pub(super) fn orientation(
    attachment: &AttachmentPoint,
    centre: &Point3<f64>,
    axis: &Point3<f64>,
    off: Vector3<f64>,
) -> Rotation3<f64> {
    let across = Vector3::new(centre.x - axis.x, 0.0, centre.z - axis.z);
    let outwards = across.try_normalize(1e-9).unwrap_or(Vector3::z());
    let from_branch = (centre - attachment.at)
        .try_normalize(1e-9)
        .unwrap_or(outwards);
    let main: Vector3<f64> = 0.6 * attachment.direction
        + 0.6 * from_branch
        + 0.5 * outwards
        + 0.25 * Vector3::y()
        + 0.35 * off;
    let main = main.try_normalize(1e-9).unwrap_or(outwards);
    let face: Vector3<f64> = outwards + 0.5 * Vector3::y() + 0.35 * off.yzx();
    let face = face - main * face.dot(&main);
    let face = face.try_normalize(1e-3).unwrap_or_else(|| any_across(main));
    Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[main.cross(&face), main, face]))
}

/// Some direction square to `main`, which has length 1.
fn any_across(main: Vector3<f64>) -> Vector3<f64> {
    let any = if main.z.abs() < 0.9 {
        Vector3::z()
    } else {
        Vector3::y()
    };
    (any - main * any.dot(&main)).normalize()
}

//! Directions on the unit sphere, and the rotations between them.

use nalgebra::{Rotation3, Unit, UnitQuaternion, UnitVector3, Vector3};

/// The rotation that takes `from` to `to` without twist about the branch.
pub fn shortest_rotation(from: &UnitVector3<f64>, to: &UnitVector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between_axis(from, to).unwrap_or_else(|| {
        let (axis, _) = tangents(from);
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_axis_angle(
            &Unit::new_normalize(axis),
            std::f64::consts::PI,
        ))
    })
}

/// Two unit vectors at right angles to `d` and to each other.
pub fn tangents(d: &UnitVector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let other = if d.x.abs() < 0.6 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let a = d.cross(&other).normalize();
    (a, d.cross(&a))
}

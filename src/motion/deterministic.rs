//! The deterministic solution: the line of sight through the tracked point meets the sphere on
//! which the branch's end can move (Li 2011 sect. 4.1).

use nalgebra::{Point3, Unit, Vector3};

/// Direction from the local root `root` to the node, which stays at distance `length` from it and
/// is to project onto `target`; `now` is where the node is before it turns itself. Positions in
/// model axes (projection is along z), px.
///
/// Of two meeting points the nearer to `now` is taken; where there is none, the target is shifted
/// towards `now` until there is.
pub fn direction(
    root: &Point3<f64>,
    length: f64,
    now: &Point3<f64>,
    target: [f64; 2],
) -> Unit<Vector3<f64>> {
    let rest = Unit::new_normalize(now - root);
    let wanted = [target[0] - root.x, target[1] - root.y];
    let start = [now.x - root.x, now.y - root.y];
    let along = [wanted[0] - start[0], wanted[1] - start[1]];
    // |start + s along| = length for the largest s in [0, 1]: `now` itself lies on the sphere, so
    // there is one.
    let (a, b) = (
        along[0].powi(2) + along[1].powi(2),
        start[0] * along[0] + start[1] * along[1],
    );
    let c = start[0].powi(2) + start[1].powi(2) - length * length;
    let s = if wanted[0].hypot(wanted[1]) <= length || a < 1e-12 {
        1.0
    } else {
        ((-b + (b * b - a * c).max(0.0).sqrt()) / a).clamp(0.0, 1.0)
    };
    let (x, y) = (start[0] + s * along[0], start[1] + s * along[1]);
    let depth = (length * length - x * x - y * y).max(0.0).sqrt();
    let z = if now.z - root.z < 0.0 { -depth } else { depth };
    Unit::try_new(Vector3::new(x, y, z), 1e-9).unwrap_or(rest)
}

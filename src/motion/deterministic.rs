//! The deterministic solution: the line of sight through the tracked point meets the sphere on
//! which the branch's end can move (Li 2011 sect. 4.1).

use nalgebra::{Point2, Point3, Unit, Vector3};

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
    target: Point2<f64>,
) -> Unit<Vector3<f64>> {
    let rest = Unit::new_normalize(now - root);
    let wanted = target - root.xy();
    let start = now.xy() - root.xy();
    let along = wanted - start;
    // |start + s along| = length for the largest s in [0, 1]: `now` itself lies on the sphere, so
    // there is one.
    let (a, b) = (along.norm_squared(), start.dot(&along));
    let c = start.norm_squared() - length * length;
    let s = if wanted.x.hypot(wanted.y) <= length || a < 1e-12 {
        1.0
    } else {
        ((-b + (b * b - a * c).max(0.0).sqrt()) / a).clamp(0.0, 1.0)
    };
    let end = start + s * along;
    let depth = (length * length - end.x * end.x - end.y * end.y)
        .max(0.0)
        .sqrt();
    let z = if now.z - root.z < 0.0 { -depth } else { depth };
    Unit::try_new(end.push(z), 1e-9).unwrap_or(rest)
}

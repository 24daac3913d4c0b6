//! The deterministic solution: the line of sight through the tracked point meets the sphere on
//! which the branch's end can move (Li 2011 sect. 4.1).

use crate::model::NodeDepth;
use nalgebra::{Point2, Point3, Unit, Vector3};

/// A depth that is off the root's by more than so many of its standard deviations says on which side of the
/// root the node is.
const SIDE_SD: f64 = 2.0;

/// The line of sight to a node in a frame: model axes, px.
#[derive(Clone, Copy, Debug)]
pub struct SightLine {
    pub target_px: Point2<f64>,
    /// Standard deviation of the target.
    pub sd_px: f64,
    /// By a depth camera.
    pub depth: Option<NodeDepth>,
}

/// Direction from the local root `root` to the node, which stays at distance `length` from it and
/// is to project onto the target; `now` is where the node is before it turns itself. Positions in
/// model axes (projection is along z), px.
///
/// Of two meeting points the nearer to `now` is taken; where there is none, the target is shifted
/// towards `now` until there is. Where the node's depth was seen, that side of the root is taken on which it
/// is, and the mean of the depths of meeting point and camera, each weighted by the inverse of its variance: a
/// line of sight that grazes the sphere says little of depth. The node then lies in the direction of target and
/// mean depth, and may project beside the target.
pub fn direction(
    root: &Point3<f64>,
    length: f64,
    now: &Point3<f64>,
    seen: SightLine,
) -> Unit<Vector3<f64>> {
    let rest = Unit::new_normalize(now - root);
    let wanted = seen.target_px - root.xy();
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
    let half_chord = (length * length - end.norm_squared()).max(0.0).sqrt();
    let depth = seen.depth.map(|d| NodeDepth {
        z_px: d.z_px - root.z,
        ..d
    });
    let side = depth
        .filter(|d| d.z_px.abs() > SIDE_SD * d.sd_px)
        .map_or(now.z - root.z, |d| d.z_px);
    let sphere_z = if side < 0.0 { -half_chord } else { half_chord };
    let z = depth.map_or(sphere_z, |d| {
        mean_depth(sphere_z, end.norm(), seen.sd_px, length, d)
    });
    Unit::try_new(end.push(z), 1e-9).unwrap_or(rest)
}

/// Mean of the depth of the meeting point and of that which the camera saw, both from the root's, weighted by
/// the inverse of their variances. The meeting point is `across` from the root in the picture, to `sd_px`.
fn mean_depth(sphere_z: f64, across: f64, sd_px: f64, length: f64, seen: NodeDepth) -> f64 {
    // To first order the depth on the sphere varies by across / |z| for each px, and at its rim, where z is 0,
    // by the root of across times px.
    let sphere_variance = (across * sd_px).powi(2) / (sphere_z.powi(2) + across * sd_px).max(1e-12);
    let seen_variance = seen.sd_px.powi(2);
    let seen_z = seen.z_px.clamp(-length, length);
    (seen_variance * sphere_z + sphere_variance * seen_z)
        / (seen_variance + sphere_variance).max(1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where the end of a branch of length 50 at (10, 20, 30) is, from there, that is seen so far to the right of
    /// its root; it was nearer to the camera.
    fn end(right_px: f64, depth: Option<NodeDepth>) -> Vector3<f64> {
        let root = Point3::new(10.0, 20.0, 30.0);
        let now = root + Vector3::new(0.0, 30.0, 40.0);
        let seen = SightLine {
            target_px: Point2::new(10.0 + right_px, 20.0),
            sd_px: 1.0,
            depth,
        };
        50.0 * direction(&root, 50.0, &now, seen).into_inner()
    }

    fn depth(z_px: f64, sd_px: f64) -> Option<NodeDepth> {
        Some(NodeDepth { z_px, sd_px })
    }

    #[test]
    fn depth_says_on_which_side_of_its_root_a_branch_ends() {
        assert!((end(30.0, None) - Vector3::new(30.0, 0.0, 40.0)).norm() < 1e-9);
        let farther = end(30.0, depth(10.0, 5.0));
        assert!(
            (farther - Vector3::new(30.0, 0.0, -40.0)).norm() < 1.0,
            "{farther}"
        );
        for z_px in [10.0, 100.0, 1e9] {
            let of_no_worth = end(30.0, depth(z_px, 1e3));
            assert!(
                (of_no_worth - Vector3::new(30.0, 0.0, 40.0)).norm() < 1e-2,
                "{of_no_worth}"
            );
        }
    }

    #[test]
    fn a_branch_that_lies_across_the_view_points_to_where_its_depth_was_seen() {
        let across = end(50.0, depth(40.0, 2.0));
        // 10 px by a variance of 4 px^2, 0 px by one of 50 px^2.
        assert!(
            (across.z / across.x - 500.0 / 54.0 / 50.0).abs() < 1e-6,
            "{across}"
        );
        let of_no_worth = end(50.0, depth(100.0, 1e3));
        assert!(of_no_worth.z.abs() < 0.01, "{of_no_worth}");
        // One that points to the camera is where the line of sight meets its sphere.
        let along = end(0.0, depth(70.0, 2.0));
        assert!(
            (along - Vector3::new(0.0, 0.0, 50.0)).norm() < 1e-6,
            "{along}"
        );
    }
}

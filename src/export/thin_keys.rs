//! Which of many rotation keys are needed.

use nalgebra::{Quaternion, UnitQuaternion};

/// Rotation between two keys, as a glTF viewer makes it (LINEAR): along the shorter arc, at even speed.
pub(super) fn slerp(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>, x: f64) -> UnitQuaternion<f64> {
    let dot = a.coords.dot(&b.coords);
    let end = if dot < 0.0 { -b.coords } else { b.coords };
    let angle = dot.abs().min(1.0).acos();
    // Below this angle the sines cancel badly and the straight line is exact enough.
    let (wa, wb) = if angle < 1e-4 {
        (1.0 - x, x)
    } else {
        (((1.0 - x) * angle).sin() / angle.sin(), (x * angle).sin() / angle.sin())
    };
    UnitQuaternion::new_normalize(Quaternion::from(a.coords * wa + end * wb))
}

/// Indices of the keys to keep, ascending, so that `slerp` between them stays within `tolerance_rad` of every key
/// (Douglas and Peucker's method). One key where one will do. `times` grow strictly; both slices are equally long.
pub(super) fn thin(times: &[f64], rotations: &[UnitQuaternion<f64>], tolerance_rad: f64) -> Vec<usize> {
    let n = times.len().min(rotations.len());
    let Some(first) = rotations.first() else { return Vec::new() };
    if n < 2 || rotations.iter().all(|q| q.angle_to(first) <= tolerance_rad) {
        return vec![0];
    }
    let mut keep = vec![false; n];
    (keep[0], keep[n - 1]) = (true, true);
    let mut spans = vec![(0, n - 1)];
    while let Some((a, b)) = spans.pop() {
        let mut worst = (a, tolerance_rad);
        for k in a + 1..b {
            let x = (times[k] - times[a]) / (times[b] - times[a]);
            let off = slerp(&rotations[a], &rotations[b], x).angle_to(&rotations[k]);
            if off > worst.1 {
                worst = (k, off);
            }
        }
        if worst.0 > a {
            keep[worst.0] = true;
            spans.extend([(a, worst.0), (worst.0, b)]);
        }
    }
    (0..n).filter(|&k| keep[k]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn about_z(angles: impl Iterator<Item = f64>) -> Vec<UnitQuaternion<f64>> {
        angles.map(|a| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), a)).collect()
    }

    #[test]
    fn even_turning_needs_two_keys_and_rest_one() {
        let times: Vec<f64> = (0..100).map(f64::from).collect();
        assert_eq!(thin(&times, &about_z(times.iter().map(|t| 0.01 * t)), 1e-6), [0, 99]);
        assert_eq!(thin(&times, &about_z(times.iter().map(|_| 0.3)), 1e-6), [0]);
        assert_eq!(thin(&[], &[], 1e-6), [0; 0]);
    }

    #[test]
    fn a_sway_keeps_its_extremes_within_tolerance_and_loses_most_keys() {
        let times: Vec<f64> = (0..330).map(|k| f64::from(k) / 30.0).collect();
        let sway = about_z(times.iter().map(|t| 0.2 * (std::f64::consts::TAU * 0.7 * t).sin()));
        let keys = thin(&times, &sway, 0.005);
        assert!(keys.len() < 110, "{} keys", keys.len());
        for pair in keys.windows(2) {
            for k in pair[0]..pair[1] {
                let x = (times[k] - times[pair[0]]) / (times[pair[1]] - times[pair[0]]);
                assert!(slerp(&sway[pair[0]], &sway[pair[1]], x).angle_to(&sway[k]) <= 0.005);
            }
        }
    }
}

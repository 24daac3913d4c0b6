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

/// Indices of the `n` keys to keep, ascending (Douglas and Peucker's method), so that nowhere `error(a, b, k)` exceeds
/// 1: by how much key `k` is missed, in units of what is allowed, if between the kept keys `a` and `b` there is none.
/// One key where one will do, which is asked as `error(0, 0, k)`.
pub(super) fn thin(n: usize, error: impl Fn(usize, usize, usize) -> f64) -> Vec<usize> {
    if (1..n).all(|k| error(0, 0, k) <= 1.0) {
        return (0..n.min(1)).collect();
    }
    let mut keep = vec![false; n];
    (keep[0], keep[n - 1]) = (true, true);
    let mut spans = vec![(0, n - 1)];
    while let Some((a, b)) = spans.pop() {
        let mut worst = (a, 1.0);
        for k in a + 1..b {
            let off = error(a, b, k);
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

    fn thin_about_z(tolerance_rad: f64, angle: impl Fn(f64) -> f64) -> (Vec<usize>, f64) {
        let turn = |k: usize| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle(k as f64 / 30.0));
        let off = |a: usize, b: usize, k: usize| {
            let x = if a == b { 0.0 } else { (k - a) as f64 / (b - a) as f64 };
            slerp(&turn(a), &turn(b), x).angle_to(&turn(k)) / tolerance_rad
        };
        let keys = thin(330, off);
        let spans = keys.windows(2).flat_map(|w| (w[0]..w[1]).map(move |k| (w[0], w[1], k)));
        let worst = spans.map(|(a, b, k)| off(a, b, k)).fold(0.0, f64::max);
        (keys, worst)
    }

    #[test]
    fn even_turning_needs_two_keys_and_rest_one() {
        assert_eq!(thin_about_z(1e-6, |t| 0.2 * t).0, [0, 329]);
        assert_eq!(thin_about_z(1e-6, |_| 0.3).0, [0]);
        assert_eq!(thin(0, |_, _, _| 0.0), [0; 0]);
        assert_eq!(thin(1, |_, _, _| f64::INFINITY), [0]);
    }

    #[test]
    fn a_sway_loses_most_keys_and_stays_within_tolerance() {
        let (keys, worst) = thin_about_z(0.005, |t| 0.2 * (std::f64::consts::TAU * 0.7 * t).sin());
        assert!(keys.len() < 110 && worst <= 1.0, "{} keys, {worst}", keys.len());
    }
}

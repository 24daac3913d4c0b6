//! Which of many keys are needed.

use nalgebra::{Quaternion, UnitQuaternion, Vector4};

/// Spans in a row that do not do, after which longer ones are not tried: a longer span seldom does
/// where shorter ones fail.
const TRIED: usize = 3;

/// Frames from one key to the next, as far as the fewest are looked for: a branch that hangs still
/// at the end of a film would do with fewer, but to try ever longer spans takes time with the cube
/// of their length, and somebody is waiting for that end.
const LONGEST: usize = 32;

/// Cosine of half a turn of 0.1 rad. On a shorter way the straight line is ahead or behind by a few
/// millionths of a radian, and the sines cost most of the time.
const SHORT: f64 = 0.998_75;

/// The shorter arc between two rotations, along which a glTF viewer goes at even speed (LINEAR).
pub(super) struct Arc {
    a: Vector4<f64>,
    b: Vector4<f64>,
    /// Half the angle of the turn and its sine, where that is not short.
    long: Option<(f64, f64)>,
}

impl Arc {
    pub fn new(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> Self {
        let dot = a.coords.dot(&b.coords);
        let end = if dot < 0.0 { -b.coords } else { b.coords };
        let long = (dot.abs() < SHORT).then(|| {
            let angle = dot.abs().acos();
            (angle, angle.sin())
        });
        Self {
            a: a.coords,
            b: end,
            long,
        }
    }

    /// 0 at the one end, 1 at the other.
    pub fn at(&self, x: f64) -> UnitQuaternion<f64> {
        let (wa, wb) = match self.long {
            Some((angle, sine)) => (((1.0 - x) * angle).sin() / sine, (x * angle).sin() / sine),
            None => (1.0 - x, x),
        };
        UnitQuaternion::new_normalize(Quaternion::from(self.a * wa + self.b * wb))
    }
}

/// Which share of the time from frame `a` to frame `b` is over in frame `k`.
pub(super) fn share(times_s: &[f64], a: usize, b: usize, k: usize) -> f64 {
    if a == b {
        0.0
    } else {
        (times_s[k] - times_s[a]) / (times_s[b] - times_s[a])
    }
}

/// Indices of the fewest of `n` keys that do, ascending, the first and the last among them: `spans`
/// is asked for (a, b) with a + 1 < b whether all keys between the two can be left out. One key
/// where `still` says that one will do.
///
/// A shortest way from key to key: dropping the worst first, as Douglas and Peucker do, keeps a
/// fifth more.
pub(super) fn thin(n: usize, still: bool, spans: impl Fn(usize, usize) -> bool) -> Vec<usize> {
    if still || n < 2 {
        return (0..n.min(1)).collect();
    }
    // Fewest keys up to each one, and the key before it.
    let mut best: Vec<(usize, usize)> = vec![(0, 0)];
    for b in 1..n {
        let mut found = (best[b - 1].0 + 1, b - 1);
        let mut failed = 0;
        for a in (b.saturating_sub(LONGEST)..b - 1).rev() {
            // Not even the best that could follow is better than what there is.
            if spans(a, b) {
                failed = 0;
                if best[a].0 + 1 < found.0 {
                    found = (best[a].0 + 1, a);
                }
            } else {
                failed += 1;
                if failed == TRIED {
                    break;
                }
            }
        }
        best.push(found);
    }
    let mut kept: Vec<usize> =
        std::iter::successors(Some(n - 1), |&b| (b > 0).then(|| best[b].1)).collect();
    kept.reverse();
    longer(&kept, spans)
}

/// The same without those that are not needed in stretches longer than any that was tried: of a
/// branch that hangs still, or turns evenly.
fn longer(kept: &[usize], spans: impl Fn(usize, usize) -> bool) -> Vec<usize> {
    let mut out: Vec<usize> = kept.iter().copied().take(1).collect();
    for pair in kept[1..].windows(2) {
        let from = out.last().copied().unwrap_or(0);
        if pair[1] - from <= LONGEST || !spans(from, pair[1]) {
            out.push(pair[0]);
        }
    }
    out.extend(&kept[1..].last().copied());
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn thin_about_z(tolerance_rad: f64, angle: impl Fn(f64) -> f64) -> (Vec<usize>, f64) {
        let turn =
            |k: usize| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle(k as f64 / 30.0));
        let off = |a: usize, b: usize, k: usize| {
            Arc::new(&turn(a), &turn(b))
                .at((k - a) as f64 / (b - a) as f64)
                .angle_to(&turn(k))
                / tolerance_rad
        };
        let still = (1..330).all(|k| turn(0).angle_to(&turn(k)) <= tolerance_rad);
        let keys = thin(330, still, |a, b| (a + 1..b).all(|k| off(a, b, k) <= 1.0));
        let spans = keys
            .windows(2)
            .flat_map(|w| (w[0]..w[1]).map(move |k| (w[0], w[1], k)));
        let worst = spans.map(|(a, b, k)| off(a, b, k)).fold(0.0, f64::max);
        (keys, worst)
    }

    #[test]
    fn even_turning_needs_two_keys_and_rest_one() {
        assert_eq!(thin_about_z(1e-4, |t| 0.2 * t).0, [0, 329]);
        assert_eq!(thin_about_z(1e-6, |_| 0.3).0, [0]);
        assert_eq!(thin(0, false, |_, _| true), [0; 0]);
        assert_eq!(thin(1, false, |_, _| false), [0]);
        assert_eq!(thin(2, false, |_, _| false), [0, 1]);
    }

    /// A film of a minute after which a tree has come to rest took minutes to end.
    #[test]
    fn the_time_for_a_branch_at_rest_grows_with_the_film_and_no_faster() {
        let asked = |n: usize| {
            let frames = std::cell::Cell::new(0);
            let spans = |a: usize, b: usize| {
                frames.set(frames.get() + b - a);
                true
            };
            thin(n, false, spans);
            frames.get()
        };
        assert!(
            asked(2000) < 3 * asked(1000),
            "{} frames looked at, {} in half of it",
            asked(2000),
            asked(1000)
        );
    }

    #[test]
    fn a_sway_loses_most_keys_and_stays_within_tolerance() {
        let (keys, worst) = thin_about_z(0.005, |t| 0.2 * (std::f64::consts::TAU * 0.7 * t).sin());
        assert!(
            keys.len() < 110 && worst <= 1.0,
            "{} keys, {worst}",
            keys.len()
        );
    }
}

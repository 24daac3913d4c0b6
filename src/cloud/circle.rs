//! Circles through points that are off them, and may lie beside.

use nalgebra::{Matrix3, Point2, Vector3};

/// Rounds of the fit, and its bound of Tukey's biweight in standard deviations (Beaton & Tukey
/// 1974).
const ROUNDS: usize = 12;
const TUKEY: f64 = 4.685;
/// From a median of absolute misses to a standard deviation.
const SD_OF_MEDIAN: f64 = 1.4826;
/// Sectors of the circle.
const SECTORS: usize = 12;

/// A circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Circle {
    pub middle: Point2<f64>,
    pub radius: f64,
    /// Standard deviation of the points off it, without those far off.
    pub spread: f64,
    /// Share of its twelfths that points lie in, 0 to 1.
    pub covered: f64,
}

impl Circle {
    /// The circle that most points are near: algebraic fit as a start (Kåsa 1976), then geometric
    /// misses with Tukey's weights. `None` where the points lie on a line, or there are fewer than
    /// five.
    pub fn through(points: &[Point2<f64>]) -> Option<Self> {
        let mut circle = algebraic(points, &vec![1.0; points.len()])?;
        let mut misses = vec![0.0; points.len()];
        for _ in 0..ROUNDS {
            for (miss, at) in misses.iter_mut().zip(points) {
                *miss = (at - circle.middle).norm() - circle.radius;
            }
            circle.spread = spread(&misses);
            let bound = TUKEY * circle.spread.max(1e-9);
            let weights: Vec<f64> = misses.iter().map(|m| tukey(m / bound)).collect();
            let step = circle.step(points, &misses, &weights)?;
            circle.middle.x += step.x;
            circle.middle.y += step.y;
            circle.radius += step.z;
            if !(circle.radius > 0.0 && circle.radius.is_finite()) {
                return None;
            }
        }
        circle.covered = covered(points, &circle);
        Some(circle)
    }

    /// One round of Gauss and Newton: how middle and radius are to change.
    fn step(
        &self,
        points: &[Point2<f64>],
        misses: &[f64],
        weights: &[f64],
    ) -> Option<Vector3<f64>> {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for ((at, miss), weight) in points.iter().zip(misses).zip(weights) {
            let Some(out) = (at - self.middle).try_normalize(1e-12) else {
                continue;
            };
            let slope = Vector3::new(-out.x, -out.y, -1.0);
            normal += *weight * slope * slope.transpose();
            right -= *weight * *miss * slope;
        }
        normal.cholesky().map(|c| c.solve(&right))
    }
}

fn tukey(x: f64) -> f64 {
    if x.abs() < 1.0 {
        (1.0 - x * x).powi(2)
    } else {
        0.0
    }
}

fn spread(misses: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = misses.iter().map(|m| m.abs()).collect();
    let middle = sizes.len() / 2;
    SD_OF_MEDIAN * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1
}

fn algebraic(points: &[Point2<f64>], weights: &[f64]) -> Option<Circle> {
    if points.len() < 5 {
        return None;
    }
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (at, weight) in points.iter().zip(weights) {
        let row = Vector3::new(at.x, at.y, 1.0);
        normal += *weight * row * row.transpose();
        right += *weight * at.coords.norm_squared() * row;
    }
    let found = normal.cholesky()?.solve(&right);
    let middle = Point2::new(0.5 * found.x, 0.5 * found.y);
    let square = found.z + middle.coords.norm_squared();
    (square > 0.0 && square.is_finite()).then(|| Circle {
        middle,
        radius: square.sqrt(),
        spread: 0.0,
        covered: 0.0,
    })
}

fn covered(points: &[Point2<f64>], circle: &Circle) -> f64 {
    let mut holds = [false; SECTORS];
    for at in points {
        let out = at - circle.middle;
        if (out.norm() - circle.radius).abs() < 0.5 * circle.radius {
            let share = (out.y.atan2(out.x) / std::f64::consts::TAU).rem_euclid(1.0);
            holds[((share * SECTORS as f64) as usize).min(SECTORS - 1)] = true;
        }
    }
    holds.iter().filter(|h| **h).count() as f64 / SECTORS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half a circle is seen, and a twig beside it.
    #[test]
    fn half_a_trunk_and_a_twig_give_the_trunk() {
        let mut points = Vec::new();
        for i in 0..60 {
            let angle = f64::from(i) * std::f64::consts::PI / 60.0;
            let radius = 0.2 + if i % 2 == 0 { 0.002 } else { -0.002 };
            points.push(Point2::new(
                1.0 + radius * angle.cos(),
                2.0 + radius * angle.sin(),
            ));
        }
        points.extend((0..8).map(|i| Point2::new(1.35 + 0.002 * f64::from(i), 2.1)));
        let circle = Circle::through(&points).expect("a circle");
        assert!((circle.radius - 0.2).abs() < 0.004, "{circle:?}");
        assert!(
            (circle.middle - Point2::new(1.0, 2.0)).norm() < 0.005,
            "{circle:?}"
        );
        assert!((0.4..0.7).contains(&circle.covered), "{circle:?}");
        let line: Vec<Point2<f64>> = (0..9).map(|i| Point2::new(f64::from(i), 0.0)).collect();
        assert_eq!(Circle::through(&line), None);
        assert_eq!(Circle::through(&line[..2]), None);
    }
}

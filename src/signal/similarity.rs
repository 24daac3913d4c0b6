//! The similarity (shift, turn, scale) on which most of some pairs of places agree.

use super::statistics::{median, median_vector};
use nalgebra::{Matrix2x4, Matrix4, Point2, Similarity2, UnitComplex, Vector2, Vector4};

/// Rounds of reweighting (Holland and Welsch 1977).
const ROUNDS: usize = 12;
/// The tuning constant of Cauchy's weights, which keeps 95 % efficiency on normal errors (Holland
/// and Welsch 1977).
pub const CAUCHY: f64 = 2.385;
/// Median absolute deviation of a normal distribution times this is its standard deviation.
const SD_PER_MAD: f64 = 1.4826;
/// The least standard deviation of a place, px: none is found more exactly.
const LEAST_SD_PX: f64 = 0.02;

/// The same thing in two pictures, px.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    pub from_px: Point2<f64>,
    pub to_px: Point2<f64>,
}

impl Pair {
    /// What a motion misses it by, px.
    pub fn miss_px(&self, motion: &Similarity2<f64>) -> Vector2<f64> {
        motion * self.from_px - self.to_px
    }
}

/// The similarity of least squares, reweighted, and how exactly it is known.
#[derive(Clone, Copy, Debug)]
pub struct CommonMotion {
    pub motion: Similarity2<f64>,
    /// Standard deviation of a place's coordinate about the motion, px, from the median.
    sd_px: f64,
    /// Where places are counted from, px.
    centre: Vector2<f64>,
    /// Covariance of a, b, c, d for places of variance 1.
    covariance: Matrix4<f64>,
}

impl CommonMotion {
    /// That of the most of `pairs`: those that it misses by much lose their weight. `None` where
    /// all lie in one place, and of none.
    pub fn of(pairs: &[Pair]) -> Option<Self> {
        let shift = median_vector(pairs.iter().map(|pair| pair.to_px - pair.from_px));
        let mut motion = Similarity2::new(shift, 0.0, 1.0);
        let mut fitted = None;
        for _ in 0..ROUNDS {
            let fit = Self::about(pairs, &motion)?;
            motion = fit.motion;
            fitted = Some(fit);
        }
        fitted
    }

    /// Least squares of weights by what `before` misses the pairs by: u' = a u - b v + c,
    /// v' = b u + a v + d.
    fn about(pairs: &[Pair], before: &Similarity2<f64>) -> Option<Self> {
        let sd_px = sd_px(pairs, before)?;
        let count = pairs.len() as f64;
        let centre = pairs.iter().map(|p| p.from_px.coords).sum::<Vector2<f64>>() / count;
        let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for pair in pairs {
            let miss = pair.miss_px(before).norm() / (CAUCHY * sd_px);
            let weight = 1.0 / (1.0 + miss * miss);
            let rows = rows(pair.from_px.coords - centre);
            normal += weight * rows.transpose() * rows;
            right += weight * rows.transpose() * pair.to_px.coords;
        }
        let inverse = normal.cholesky()?.inverse();
        Some(Self {
            motion: motion_of(inverse * right, centre)?,
            sd_px,
            centre,
            covariance: inverse,
        })
    }

    /// What two independent findings of one motion say together, each weighted by the inverse of its
    /// covariance (Aitken 1935); `None` where one of them knows nothing.
    pub fn with(&self, other: &Self) -> Option<Self> {
        let (own, others) = (
            self.about_centre(self.centre)?,
            other.about_centre(self.centre)?,
        );
        let covariance = (own.information + others.information).cholesky()?.inverse();
        let of_both = own.information * own.values + others.information * others.values;
        Some(Self {
            motion: motion_of(covariance * of_both, self.centre)?,
            sd_px: 1.0,
            centre: self.centre,
            covariance,
        })
    }

    /// a, b, c and d where places are counted from `centre`, and the inverse of their covariance.
    fn about_centre(&self, centre: Vector2<f64>) -> Option<Informed> {
        let Similarity2 { isometry, .. } = self.motion;
        let (turn, scale) = (isometry.rotation, self.motion.scaling());
        let shift = self.motion * Point2::from(centre);
        let mut carried = Matrix4::identity();
        carried
            .fixed_view_mut::<2, 4>(2, 0)
            .copy_from(&rows(centre - self.centre));
        let covariance = carried * (self.sd_px.powi(2) * self.covariance) * carried.transpose();
        Some(Informed {
            values: Vector4::new(scale * turn.re, scale * turn.im, shift.x, shift.y),
            information: covariance.cholesky()?.inverse(),
        })
    }

    /// Standard deviation of the motion at the worst of some places, px.
    pub fn worst_sd_px(&self, places_px: &[Point2<f64>]) -> f64 {
        let mut worst: f64 = 0.0;
        for place in places_px {
            let rows = rows(place.coords - self.centre);
            let variance = (rows * self.covariance * rows.transpose()).symmetric_eigenvalues();
            worst = worst.max(variance.max());
        }
        self.sd_px * worst.sqrt()
    }
}

/// a, b, c and d of a motion, and the inverse of their covariance.
struct Informed {
    values: Vector4<f64>,
    information: Matrix4<f64>,
}

/// The motion of a, b, c and d where places are counted from `centre`, px.
fn motion_of(values: Vector4<f64>, centre: Vector2<f64>) -> Option<Similarity2<f64>> {
    let [a, b, c, d]: [f64; 4] = values.into();
    let scale = a.hypot(b);
    if !(scale > 0.0 && scale.is_finite()) {
        return None;
    }
    let rotation = UnitComplex::from_angle(b.atan2(a));
    let shift = Vector2::new(c, d) - scale * (rotation * centre);
    Some(Similarity2::from_parts(shift.into(), rotation, scale))
}

/// Standard deviation of a place's coordinate about a motion, px, from the median.
fn sd_px(pairs: &[Pair], motion: &Similarity2<f64>) -> Option<f64> {
    let mut misses = Vec::with_capacity(2 * pairs.len());
    for pair in pairs {
        let miss = pair.miss_px(motion);
        misses.extend([miss.x.abs(), miss.y.abs()]);
    }
    Some(sd_of_misses(misses.into_iter())?.max(LEAST_SD_PX))
}

/// Standard deviation of what has these absolute misses, from their median; `None` of none.
pub fn sd_of_misses(misses: impl Iterator<Item = f64>) -> Option<f64> {
    let mad = median(misses.collect(), f64::total_cmp)?;
    Some(SD_PER_MAD * mad)
}

/// What a, b, c, d do to the place `at`.
fn rows(at: Vector2<f64>) -> Matrix2x4<f64> {
    Matrix2x4::new(at.x, -at.y, 1.0, 0.0, at.y, at.x, 0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places on a grid of 8 by 4 about `middle_px`, so far apart, that are found to 0.05 px.
    fn pairs(truth: &Similarity2<f64>, middle_px: Point2<f64>, apart_px: f64) -> Vec<Pair> {
        let mut pairs = Vec::new();
        for k in 0..32 {
            let place = Vector2::new(f64::from(k % 8) - 3.5, f64::from(k / 8) - 1.5);
            let from_px = middle_px + apart_px * place;
            let angle = 2.4 * f64::from(k);
            let to_px = truth * from_px + 0.05 * Vector2::new(angle.cos(), angle.sin());
            pairs.push(Pair { from_px, to_px });
        }
        pairs
    }

    #[test]
    fn two_findings_together_are_surer_than_each() {
        let truth = Similarity2::new(Vector2::new(3.0, -1.5), 0.004, 1.002);
        let near = CommonMotion::of(&pairs(&truth, Point2::new(80.0, 250.0), 5.0)).unwrap();
        let wide = CommonMotion::of(&pairs(&truth, Point2::new(320.0, 180.0), 40.0)).unwrap();
        let both = near.with(&wide).unwrap();
        for place in [Point2::new(80.0, 250.0), Point2::new(500.0, 40.0)] {
            let [alone, wide_alone, together] =
                [&near, &wide, &both].map(|found| found.worst_sd_px(&[place]));
            assert!(together < alone && together < wide_alone, "{place}");
            let off_px = (both.motion * place - truth * place).norm();
            assert!(off_px < 3.0 * together, "{place}: {off_px} of {together}");
        }
        // What is hardly known hardly counts.
        let far = both.motion * Point2::new(500.0, 40.0);
        let far_by_wide = wide.motion * Point2::new(500.0, 40.0);
        assert!((far - far_by_wide).norm() < 0.02);
    }
}

//! The von Mises distribution of angles (Zeng 2015 eq. 2.25).

use crate::random::Generator;
use nalgebra::Vector2;
use rand::RngExt;
use std::f64::consts::{PI, TAU};

/// Angles nearer to each other than the deviation of this kappa, 0.6 degrees, are not told apart.
const GREATEST_KAPPA: f64 = 1e4;
/// Nodes of the trapezoidal rule for the Bessel functions. It converges geometrically on a full
/// period (Trefethen and Weideman 2014): this is exact for every kappa up to the greatest.
const NODES: u32 = 4096;
/// Halvings of the interval in which kappa is looked for: more than a number has digits.
const HALVINGS: u32 = 64;

/// Distribution of an angle about a mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VonMises {
    /// mu, radians.
    pub mean: f64,
    /// 0 is even all round, more is narrower.
    pub kappa: f64,
    /// The mean as a unit vector.
    towards: Vector2<f64>,
    /// exp(-kappa) I0(kappa).
    scaled_i0: f64,
}

/// That no angle has a density as high as is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NothingSoDense {
    /// The highest density, 1/rad.
    pub highest: f64,
}

impl VonMises {
    /// About `mean` (radians), with a kappa from 0 to the greatest.
    pub fn new(mean: f64, kappa: f64) -> Self {
        let kappa = kappa.clamp(0.0, GREATEST_KAPPA);
        Self {
            mean,
            kappa,
            towards: Vector2::new(mean.cos(), mean.sin()),
            scaled_i0: scaled_bessel(kappa).order_0,
        }
    }

    /// The one that `angles` (radians) are likeliest of: mu is their circular mean, and kappa from
    /// A(kappa) = I1/I0 = R, the length of their mean vector. `None` without angles, or where one
    /// is no number.
    pub fn fit(angles: &[f64]) -> Option<Self> {
        let count = angles.len() as f64;
        let cos = angles.iter().map(|a| a.cos()).sum::<f64>() / count;
        let sin = angles.iter().map(|a| a.sin()).sum::<f64>() / count;
        let length = cos.hypot(sin);
        (length.is_finite()).then(|| Self::new(sin.atan2(cos), kappa_of(length)))
    }

    /// Density at an angle, 1/rad.
    pub fn density(&self, angle: f64) -> f64 {
        self.likelihood(angle) / (TAU * self.scaled_i0)
    }

    /// Density at an angle as a share of the highest.
    pub fn likelihood(&self, angle: f64) -> f64 {
        self.likelihood_off_mean(angle - self.mean)
    }

    fn likelihood_off_mean(&self, off: f64) -> f64 {
        (self.kappa * (off.cos() - 1.0)).exp()
    }

    /// The same of an angle as a unit vector: its cosine and its sine.
    pub fn likelihood_towards(&self, angle: Vector2<f64>) -> f64 {
        (self.kappa * (angle.dot(&self.towards) - 1.0)).exp()
    }

    /// How far from the mean the density is above `threshold` (1/rad), radians: pi where it is
    /// everywhere.
    ///
    /// # Errors
    /// It is nowhere.
    pub fn half_width(&self, threshold: f64) -> Result<f64, NothingSoDense> {
        let highest = self.density(self.mean);
        if threshold >= highest || threshold.is_nan() {
            return Err(NothingSoDense { highest });
        }
        if threshold <= self.density(self.mean + PI) {
            return Ok(PI);
        }
        // The inverse of the density.
        Ok((1.0 + (threshold / highest).ln() / self.kappa).acos())
    }

    /// An angle of this distribution that is not farther than `half_width` from the mean, radians
    /// about 0: drawn evenly and taken as often as its density is a share of the highest (von
    /// Neumann's rejection). That ends: of the angles within a half width from
    /// [`half_width`](Self::half_width) the least dense is taken with the threshold's share, and
    /// for any other the mean itself is the answer after a million tries.
    pub fn sample_within(&self, half_width: f64, random: &mut Generator) -> f64 {
        const TRIES: u32 = 1_000_000;
        for _ in 0..TRIES {
            let off = half_width * random.random_range(-1.0..=1.0);
            if random.random::<f64>() < self.likelihood_off_mean(off) {
                return self.mean + off;
            }
        }
        self.mean
    }
}

/// exp(-kappa) times the modified Bessel functions of orders 0 and 1.
struct ScaledBessel {
    order_0: f64,
    order_1: f64,
}

/// By their integrals: I_n = (1 / pi) times the integral of exp(kappa cos t) cos(n t) from 0 to pi
/// (DLMF 10.32.3). Zeng's eq. 2.26 is Bessel's own equation, whose solutions are others.
fn scaled_bessel(kappa: f64) -> ScaledBessel {
    let (mut order_0, mut order_1) = (0.0, 0.0);
    for k in 0..NODES {
        let cos = (TAU * f64::from(k) / f64::from(NODES)).cos();
        let value = (kappa * (cos - 1.0)).exp() / f64::from(NODES);
        order_0 += value;
        order_1 += cos * value;
    }
    ScaledBessel { order_0, order_1 }
}

/// The kappa with A(kappa) = `length`, by bisection; A grows with kappa from 0 to 1.
fn kappa_of(length: f64) -> f64 {
    let (mut low, mut high) = (0.0, GREATEST_KAPPA);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let bessel = scaled_bessel(middle);
        if bessel.order_1 < length * bessel.order_0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::generator;

    /// Abramowitz and Stegun, table 9.8: exp(-x) I0(x) and exp(-x) I1(x).
    #[test]
    fn bessel_functions_are_those_of_the_table() {
        let table = [
            (0.0, 1.0, 0.0),
            (1.0, 0.465_759_607_7, 0.207_910_415_3),
            (5.0, 0.183_540_812_6, 0.163_972_266_9),
            (10.0, 0.127_833_337_2, 0.121_262_681_4),
        ];
        for (x, i0, i1) in table {
            let found = scaled_bessel(x);
            assert!((found.order_0 - i0).abs() < 1e-9, "I0({x})");
            assert!((found.order_1 - i1).abs() < 1e-9, "I1({x})");
        }
        // For large x the asymptotic series.
        let x = GREATEST_KAPPA;
        let series = (1.0 + 1.0 / (8.0 * x) + 9.0 / (128.0 * x * x)) / (TAU * x).sqrt();
        assert!((scaled_bessel(x).order_0 / series - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_highest_density_is_as_it_was_worked_out() {
        for (kappa, highest) in [(1.0, 0.34), (1.3, 0.40), (2.0, 0.52), (10.0, 1.25)] {
            let found = VonMises::new(0.3, kappa).density(0.3);
            assert!((found - highest).abs() < 0.005, "{kappa}: {found}");
        }
    }

    #[test]
    fn known_parameters_are_recovered() {
        let mut random = generator(5, 0);
        for kappa in [0.5, 2.0, 20.0, 400.0] {
            let known = VonMises::new(-0.7, kappa);
            let mut angles = Vec::new();
            for _ in 0..20_000 {
                angles.push(known.sample_within(PI, &mut random));
            }
            let found = VonMises::fit(&angles).expect("angles");
            assert!((found.kappa / kappa - 1.0).abs() < 0.05, "{found:?}");
            assert!((found.mean + 0.7).abs() < 0.05, "{found:?}");
        }
    }

    /// Kolmogorov and Smirnov's distance of 10,000 draws from the distribution that is cut off at
    /// the threshold: above 0.0163 once in a hundred seeds.
    #[test]
    fn draws_follow_the_cut_distribution() {
        let known = VonMises::new(0.4, 3.0);
        let half = known.half_width(0.4).expect("dense enough");
        let mut random = generator(7, 0);
        let mut angles: Vec<f64> = (0..10_000)
            .map(|_| known.sample_within(half, &mut random))
            .collect();
        angles.sort_by(f64::total_cmp);
        let steps = 2000;
        let width = 2.0 * half / f64::from(steps);
        let mut shares = vec![0.0];
        for k in 0..steps {
            let angle = known.mean - half + (f64::from(k) + 0.5) * width;
            shares.push(shares[k as usize] + width * known.density(angle));
        }
        let mut farthest = 0.0_f64;
        for (k, angle) in angles.iter().enumerate() {
            assert!(known.density(*angle) >= 0.4 - 1e-9);
            let at = (((angle - known.mean + half) / width) as usize).min(steps as usize);
            let expected = shares[at] / shares[steps as usize];
            farthest = farthest.max((expected - k as f64 / 10_000.0).abs());
        }
        assert!(farthest < 0.0163 + 1.0 / f64::from(steps), "{farthest}");
    }

    #[test]
    fn a_threshold_that_nothing_reaches_is_an_error() {
        let flat = VonMises::new(0.0, 1.0);
        let NothingSoDense { highest } = flat.half_width(0.4).expect_err("nowhere");
        assert!((highest - 0.342).abs() < 0.001);
        assert!(flat.half_width(f64::NAN).is_err());
        assert_eq!(flat.half_width(0.01), Ok(PI));
        // An even distribution has one density.
        let even = VonMises::new(0.0, 0.0);
        assert!(even.half_width(0.16).is_err());
        assert_eq!(even.half_width(0.1), Ok(PI));
    }

    #[test]
    fn alike_angles_have_the_greatest_kappa_and_none_have_none() {
        assert!(VonMises::fit(&[0.3; 5]).expect("angles").kappa > 0.99 * GREATEST_KAPPA);
        assert_eq!(VonMises::fit(&[]), None);
        assert_eq!(VonMises::fit(&[f64::NAN]), None);
        // Opposite angles have no direction.
        assert!(VonMises::fit(&[0.0, PI]).expect("angles").kappa < 1e-6);
    }

    #[test]
    fn a_narrow_one_is_drawn_from_without_end_or_panic() {
        let narrow = VonMises::new(1.0, GREATEST_KAPPA);
        let angle = narrow.sample_within(PI, &mut generator(1, 0));
        assert!((angle - 1.0).abs() < 0.1);
    }
}

//! The Dirichlet distribution (Li 2011 eq. 11), and the one that some samples are likeliest of
//! (Minka 2000, "Estimating a Dirichlet distribution").

use crate::random::Generator;
use rand_distr::{Distribution, Gamma};
use special::Gamma as _;

/// No share of a sample counts as smaller: the logarithm of 0 would outweigh all others.
const SMALLEST_SHARE: f64 = 1e-4;
/// With fewer samples only their mean is taken.
pub const FEWEST_SAMPLES: usize = 8;
/// The greatest precision: shares of one half then deviate by half a hundredth. More is not learned
/// from samples that are all but the same.
const GREATEST_PRECISION: f64 = 1e4;
/// Rounds of the fixed point before Newton's steps, which need a start in the neighbourhood.
const FIXED_POINT_ROUNDS: u32 = 20;
const MOST_NEWTON_STEPS: u32 = 100;
/// Newton's steps end when no parameter changes by more than this share.
const CONVERGED: f64 = 1e-10;

/// Distribution of tuples of shares that add up to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Dirichlet {
    /// All above 0.
    beta: Vec<f64>,
}

/// What a distribution was found by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// The maximum of the likelihood.
    Likelihood,
    /// The mean of the samples alone, with the greatest precision: there were fewer than
    /// [`FEWEST_SAMPLES`], or they are all but the same.
    Mean,
}

/// A distribution that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct DirichletFit {
    pub distribution: Dirichlet,
    pub basis: Basis,
}

/// The distribution that `samples` are likeliest of: tuples of the same length, whose shares add up
/// to 1. `None` without samples, or where a share is no number.
pub fn fit(samples: &[Vec<f64>]) -> Option<DirichletFit> {
    let length = samples.first().map(Vec::len).filter(|n| *n > 0)?;
    if samples.iter().any(|z| z.len() != length) {
        return None;
    }
    let samples: Vec<Vec<f64>> = samples.iter().map(|z| above_zero(z)).collect();
    let moments = Moments::of(&samples, length);
    if moments.mean.iter().any(|m| !m.is_finite()) {
        return None;
    }
    let likeliest = moments
        .precision()
        .filter(|s| samples.len() >= FEWEST_SAMPLES && *s < GREATEST_PRECISION)
        .map(|start| likeliest(&moments, start))
        .filter(|d| d.precision() < GREATEST_PRECISION);
    Some(match likeliest {
        Some(distribution) => DirichletFit {
            distribution,
            basis: Basis::Likelihood,
        },
        None => DirichletFit {
            distribution: Dirichlet::around(&moments.mean, GREATEST_PRECISION),
            basis: Basis::Mean,
        },
    })
}

/// The same shares, none of them smaller than [`SMALLEST_SHARE`], adding up to 1.
fn above_zero(sample: &[f64]) -> Vec<f64> {
    let raised: Vec<f64> = sample.iter().map(|z| z.max(SMALLEST_SHARE)).collect();
    let sum: f64 = raised.iter().sum();
    raised.iter().map(|z| z / sum).collect()
}

/// What of the samples counts: by share the means of z, z² and ln z.
struct Moments {
    mean: Vec<f64>,
    mean_square: Vec<f64>,
    mean_ln: Vec<f64>,
}

impl Moments {
    fn of(samples: &[Vec<f64>], length: usize) -> Self {
        let (mut mean, mut mean_square) = (vec![0.0; length], vec![0.0; length]);
        let mut mean_ln = vec![0.0; length];
        for sample in samples {
            for (k, z) in sample.iter().enumerate() {
                mean[k] += z / samples.len() as f64;
                mean_square[k] += z * z / samples.len() as f64;
                mean_ln[k] += z.ln() / samples.len() as f64;
            }
        }
        Self {
            mean,
            mean_square,
            mean_ln,
        }
    }

    /// The precision by moments: the geometric mean over the shares of what the variance of each
    /// says; `None` where none varies.
    fn precision(&self) -> Option<f64> {
        let (mut sum_ln, mut count) = (0.0, 0);
        for (mean, square) in self.mean.iter().zip(&self.mean_square) {
            let precision = (mean - square) / (square - mean * mean);
            if precision > 0.0 && precision.is_finite() {
                sum_ln += precision.ln();
                count += 1;
            }
        }
        (count > 0).then(|| (sum_ln / f64::from(count)).exp())
    }
}

/// The maximum of the likelihood, from a start by moments.
fn likeliest(moments: &Moments, start: f64) -> Dirichlet {
    let mut beta: Vec<f64> = moments.mean.iter().map(|m| m * start).collect();
    for _ in 0..FIXED_POINT_ROUNDS {
        beta = fixed_point(&beta, &moments.mean_ln);
    }
    for _ in 0..MOST_NEWTON_STEPS {
        // A step out of what can be is no step; the fixed point always goes up.
        let next =
            newton(&beta, &moments.mean_ln).unwrap_or_else(|| fixed_point(&beta, &moments.mean_ln));
        let changes = next.iter().zip(&beta).map(|(a, b)| (a / b - 1.0).abs());
        let change = changes.fold(0.0, f64::max);
        beta = next;
        if change < CONVERGED {
            break;
        }
    }
    Dirichlet { beta }
}

/// One round of psi(beta_k) = psi(sum of beta) + mean ln z_k (Minka 2000 eq. 9).
fn fixed_point(beta: &[f64], mean_ln: &[f64]) -> Vec<f64> {
    let psi_sum = beta.iter().sum::<f64>().digamma();
    mean_ln
        .iter()
        .map(|ln| inverse_digamma(psi_sum + ln))
        .collect()
}

/// The x with psi(x) = `y`, by five of Newton's steps, which give all digits (Minka 2000 app. C).
fn inverse_digamma(y: f64) -> f64 {
    let mut x = if y >= -2.22 {
        y.exp() + 0.5
    } else {
        -1.0 / (y - 1.0_f64.digamma())
    };
    for _ in 0..5 {
        x -= (x.digamma() - y) / x.trigamma();
    }
    x
}

/// One of Newton's steps. The second derivative is a diagonal and a constant, so that it is
/// inverted in closed form (Minka 2000 eq. 15 to 18). `None` where it leads to 0 or below.
fn newton(beta: &[f64], mean_ln: &[f64]) -> Option<Vec<f64>> {
    let sum: f64 = beta.iter().sum();
    let (psi_sum, z) = (sum.digamma(), sum.trigamma());
    let mut gradient = Vec::with_capacity(beta.len());
    let mut q = Vec::with_capacity(beta.len());
    for (b, ln) in beta.iter().zip(mean_ln) {
        gradient.push(psi_sum - b.digamma() + ln);
        q.push(-b.trigamma());
    }
    let of_gradient: f64 = gradient.iter().zip(&q).map(|(g, q)| g / q).sum();
    let of_one: f64 = q.iter().map(|q| 1.0 / q).sum();
    let common = of_gradient / (1.0 / z + of_one);
    let mut next = Vec::with_capacity(beta.len());
    for ((b, g), q) in beta.iter().zip(&gradient).zip(&q) {
        next.push(b - (g - common) / q);
    }
    next.iter()
        .all(|b| b.is_finite() && *b > 0.0)
        .then_some(next)
}

impl Dirichlet {
    /// Of these parameters; `None` unless all are numbers above 0.
    pub fn new(beta: Vec<f64>) -> Option<Self> {
        let is_sound = !beta.is_empty() && beta.iter().all(|b| b.is_finite() && *b > 0.0);
        is_sound.then_some(Self { beta })
    }

    /// With this mean, all of it above 0, and precision.
    fn around(mean: &[f64], precision: f64) -> Self {
        let beta = mean.iter().map(|m| m * precision).collect();
        Self { beta }
    }

    pub fn parameters(&self) -> &[f64] {
        &self.beta
    }

    /// s, the sum of the parameters: how near samples are to the mean.
    pub fn precision(&self) -> f64 {
        self.beta.iter().sum()
    }

    /// m = beta / s.
    pub fn mean(&self) -> Vec<f64> {
        let precision = self.precision();
        self.beta.iter().map(|b| b / precision).collect()
    }

    /// The logarithm of the density at a tuple of shares, less what is the same for all of them.
    pub fn ln_density(&self, shares: &[f64]) -> f64 {
        let of_share = |(b, z): (&f64, &f64)| (b - 1.0) * z.max(SMALLEST_SHARE).ln();
        self.beta.iter().zip(shares).map(of_share).sum()
    }

    /// A tuple drawn at random: gamma variates by their sum.
    pub fn sample(&self, random: &mut Generator) -> Vec<f64> {
        let mut drawn = Vec::with_capacity(self.beta.len());
        for b in &self.beta {
            // The parameters were checked: it does not fail.
            drawn.push(Gamma::new(*b, 1.0).map_or(0.0, |gamma| gamma.sample(random)));
        }
        let sum: f64 = drawn.iter().sum();
        if sum > 0.0 {
            drawn.iter().map(|x| x / sum).collect()
        } else {
            // Parameters so small that every variate is rounded to 0.
            self.mean()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::generator;

    fn drawn(beta: &[f64], count: usize, seed: u64) -> Vec<Vec<f64>> {
        let known = Dirichlet::new(beta.to_vec()).expect("sound");
        let mut random = generator(seed, 0);
        (0..count).map(|_| known.sample(&mut random)).collect()
    }

    /// The largest relative error of mean and precision over the seeds, in the mean of ten.
    fn error(beta: &[f64], count: usize) -> f64 {
        let precision: f64 = beta.iter().sum();
        let mut sum = 0.0;
        for seed in 1..=10 {
            let found = fit(&drawn(beta, count, seed)).expect("samples");
            assert_eq!(found.basis, Basis::Likelihood);
            let found = found.distribution;
            let mut largest = (found.precision() / precision - 1.0).abs();
            for (m, b) in found.mean().iter().zip(beta) {
                largest = largest.max((m * precision / b - 1.0).abs());
            }
            sum += largest / 10.0;
        }
        sum
    }

    #[test]
    fn known_parameters_are_recovered() {
        for beta in [&[4.0, 2.0, 7.0][..], &[1.0, 1.0, 1.0], &[30.0, 12.0, 20.0]] {
            let (few, many) = (error(beta, 200), error(beta, 5000));
            assert!(few < 0.1, "{beta:?}: {few}");
            assert!(many < 0.02, "{beta:?}: {many}");
        }
    }

    #[test]
    fn a_long_tuple_is_recovered() {
        let beta: Vec<f64> = (0..60).map(|k| 0.3 + 3.0 / f64::from(1 + k)).collect();
        let error = error(&beta, 1000);
        assert!(error < 0.15, "{error}");
    }

    /// At the maximum no step leads higher: psi(beta_k) - psi(s) is the mean of ln z_k.
    #[test]
    fn the_likelihood_is_stationary() {
        let samples = drawn(&[2.0, 0.7, 5.0], 50, 3);
        let found = fit(&samples).expect("samples").distribution;
        for (k, b) in found.parameters().iter().enumerate() {
            let mean_ln = samples.iter().map(|z| above_zero(z)[k].ln()).sum::<f64>() / 50.0;
            let off = b.digamma() - found.precision().digamma() - mean_ln;
            assert!(off.abs() < 1e-8, "{off}");
        }
    }

    #[test]
    fn few_and_identical_samples_give_their_mean() {
        let one = vec![0.2, 0.3, 0.5];
        for samples in [vec![one.clone()], vec![one.clone(); 40]] {
            let found = fit(&samples).expect("samples");
            assert_eq!(found.basis, Basis::Mean);
            for (m, z) in found.distribution.mean().iter().zip(&one) {
                assert!((m - z).abs() < 1e-12);
            }
            assert!((found.distribution.precision() / GREATEST_PRECISION - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn what_is_no_sample_gives_nothing() {
        assert_eq!(fit(&[]), None);
        assert_eq!(fit(&[Vec::new()]), None);
        assert_eq!(fit(&[vec![0.5, 0.5], vec![1.0]]), None);
        assert_eq!(fit(&vec![vec![f64::INFINITY, 0.5]; 9]), None);
        assert_eq!(Dirichlet::new(vec![1.0, 0.0]), None);
    }

    #[test]
    fn shares_of_nothing_are_possible() {
        let mut samples = Vec::new();
        for _ in 0..6 {
            samples.extend([vec![0.0, 1.0, 0.0], vec![1.0, 0.0, 0.0]]);
        }
        let found = fit(&samples).expect("samples").distribution;
        assert!(found.parameters().iter().all(|b| b.is_finite() && *b > 0.0));
        let tiny = Dirichlet::new(vec![1e-300; 3]).expect("sound");
        let sum: f64 = tiny.sample(&mut generator(1, 0)).iter().sum();
        assert!((sum - 1.0).abs() < 1e-12);
    }
}

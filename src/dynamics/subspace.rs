//! Frequencies of a structure that chance keeps driving, by covariance-driven stochastic subspace
//! identification (Peeters and De Roeck 1999): the covariances of its motions at growing lags are
//! those of a linear system, whose poles are found for many orders. A pole that stays from order to
//! order is a mode.

use crate::bounds::Bounds;
use crate::signal::vectors::dot;
use nalgebra::DMatrix;
use std::f64::consts::TAU;

/// Lags up to which covariances are used, s, each in turn: what is a mode is one by all.
pub(super) const LAGS_S: [f64; 3] = [1.2, 1.6, 2.2];
/// Orders of the system, and their step.
const LEAST_ORDER: usize = 4;
const MOST_ORDER: usize = 42;
const ORDER_STEP: usize = 2;
/// Singular vectors are looked for in as many directions, and so often: beyond the highest order
/// singular values of trees fall to a third within these, and by the square of that with each
/// iteration the vectors come nearer.
const ITERATED: usize = MOST_ORDER + MOST_ORDER / 2;
const ITERATIONS: usize = 6;
/// A pole stays if the order before has one whose frequency and damping are as near as this, as
/// shares (usual limits of stabilisation diagrams).
const NEAR_FREQUENCY: f64 = 0.01;
const NEAR_DAMPING: f64 = 0.3;
const LEAST_DAMPING: f64 = 0.01;
/// No mode of a tree is damped more than this.
const MOST_DAMPING: f64 = 0.3;
/// A mode is met with in so many orders by each lag, in the mean.
const LEAST_MET: f64 = 2.5;

/// A pole that stays from order to order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StablePole {
    pub frequency_hz: f64,
    /// Orders that it was met with in, of all lags together.
    pub met: usize,
}

/// Frequency, Hz, and damping ratio of one pole.
#[derive(Clone, Copy, Debug)]
struct Pole {
    frequency_hz: f64,
    damping: f64,
}

/// The poles of modes, by frequency, from covariances up to each of `lags_s`. `channels` are motions
/// without gaps, of mean 0 and of like size, `step_s` apart.
pub(super) fn stable_poles(
    channels: &[Vec<f64>],
    step_s: f64,
    within_hz: Bounds,
    lags_s: &[f64],
) -> Vec<StablePole> {
    let mut stable_hz: Vec<f64> = Vec::new();
    for lag_s in lags_s {
        let rows = (lag_s / step_s).round().max(2.0) as usize;
        let mut before: Vec<Pole> = Vec::new();
        for poles in poles_by_order(channels, rows, step_s, within_hz) {
            let stays = |pole: &&Pole| before.iter().any(|b| is_same(pole, b));
            stable_hz.extend(poles.iter().filter(stays).map(|pole| pole.frequency_hz));
            before = poles;
        }
    }
    stable_hz.sort_unstable_by(f64::total_cmp);
    let groups = stable_hz.chunk_by(|a, b| b - a < NEAR_FREQUENCY * b);
    let least = LEAST_MET * lags_s.len() as f64;
    let modes = groups.filter(|group| group.len() as f64 >= least);
    modes
        .map(|group| StablePole {
            frequency_hz: group[group.len() / 2],
            met: group.len(),
        })
        .collect()
}

fn is_same(a: &Pole, b: &Pole) -> bool {
    (a.frequency_hz - b.frequency_hz).abs() < NEAR_FREQUENCY * a.frequency_hz
        && (a.damping - b.damping).abs() < NEAR_DAMPING * a.damping.max(LEAST_DAMPING)
}

/// The poles of every order, from covariances at up to twice as many lags as `rows`.
fn poles_by_order(
    channels: &[Vec<f64>],
    rows: usize,
    step_s: f64,
    within_hz: Bounds,
) -> Vec<Vec<Pole>> {
    let n = channels.len();
    let frames = channels.first().map_or(0, Vec::len);
    if n == 0 || frames < 4 * rows {
        return Vec::new();
    }
    let mut lagged = Vec::with_capacity(2 * rows);
    for lag in 0..2 * rows {
        lagged.push(covariance(channels, lag));
    }
    let mut hankel = DMatrix::zeros(n * rows, n * rows);
    for a in 0..rows {
        for b in 0..rows {
            hankel
                .view_mut((a * n, b * n), (n, n))
                .copy_from(&lagged[a + b + 1]);
        }
    }
    let largest = hankel.amax();
    if largest == 0.0 || !hankel.iter().all(|x| x.is_finite()) {
        return Vec::new();
    }
    let Some((left, sizes)) = left_singular(&(hankel / largest)) else {
        return Vec::new();
    };
    let most = MOST_ORDER.min(n * (rows - 1));
    let mut observability = left.columns(0, most).into_owned();
    for (mut column, size) in observability.column_iter_mut().zip(&sizes) {
        column *= size.sqrt();
    }
    let above = observability.rows(0, n * (rows - 1)).transpose();
    let below = observability.rows(n, n * (rows - 1));
    // The products of a lower order are the first ones of a higher.
    let (products, shifted) = (&above * above.transpose(), &above * below);
    let mut out = Vec::new();
    for order in (LEAST_ORDER..=most).step_by(ORDER_STEP) {
        let of_order = products.view((0, 0), (order, order)).into_owned();
        let Some(factored) = of_order.cholesky() else {
            break;
        };
        let transition = factored.solve(&shifted.view((0, 0), (order, order)));
        out.push(poles(&transition, step_s, within_hz));
    }
    out
}

/// The left singular vectors of the largest singular values, and these, the largest first, by
/// orthogonal iteration (Golub and Van Loan 2013, sect. 8.2.4) of [`ITERATED`] columns.
fn left_singular(matrix: &DMatrix<f64>) -> Option<(DMatrix<f64>, Vec<f64>)> {
    let transposed = matrix.transpose();
    let mut left = matrix.columns(0, ITERATED.min(matrix.ncols())).into_owned();
    for _ in 0..ITERATIONS {
        left = matrix * (&transposed * left.qr().q());
    }
    let left = left.qr().q();
    // Q R = Hᵀ L: L times the left singular vectors of Rᵀ are those of L Lᵀ H.
    let triangle = (&transposed * &left).qr().r();
    let found = triangle.transpose().try_svd(true, false, f64::EPSILON, 0)?;
    let sizes = found.singular_values.iter().copied().collect();
    Some((left * found.u?, sizes))
}

/// Mean products of all channels with all, those of the first `lag` frames later.
fn covariance(channels: &[Vec<f64>], lag: usize) -> DMatrix<f64> {
    let frames = channels[0].len() - lag;
    DMatrix::from_fn(channels.len(), channels.len(), |a, b| {
        let later = &channels[a][lag..];
        dot(later, &channels[b][..frames]) / frames as f64
    })
}

/// The poles of a system in discrete time that are modes of a tree.
fn poles(transition: &DMatrix<f64>, step_s: f64, within_hz: Bounds) -> Vec<Pole> {
    let mut out = Vec::new();
    for value in transition.complex_eigenvalues().iter() {
        let rate = value.ln() / step_s;
        let pole = Pole {
            frequency_hz: rate.norm() / TAU,
            damping: -rate.re / rate.norm(),
        };
        let is_swing = rate.im > 0.0 && pole.damping > 0.0 && pole.damping < MOST_DAMPING;
        if is_swing && within_hz.contains(pole.frequency_hz) {
            out.push(pole);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::generator;
    use rand::RngExt;

    const STEP_S: f64 = 1.0 / 15.0;

    /// An oscillator of 1 kg that white noise drives.
    fn driven(frequency_hz: f64, damping: f64, seed: u64) -> Vec<f64> {
        let mut random = generator(seed, 0);
        let omega = TAU * frequency_hz;
        let (mut at, mut speed) = (0.0, 0.0);
        let mut out = Vec::new();
        for _ in 0..900 {
            for _ in 0..20 {
                let step_s = STEP_S / 20.0;
                let force: f64 = random.random_range(-1.0..1.0);
                speed += step_s * (force - 2.0 * damping * omega * speed - omega * omega * at);
                at += step_s * speed;
            }
            out.push(at);
        }
        out
    }

    #[test]
    fn modes_are_found_and_noise_has_none() {
        let (slow, fast) = (driven(0.6, 0.02, 1), driven(1.4, 0.03, 2));
        let mut random = generator(3, 0);
        let mut channels = Vec::new();
        for k in 0..6 {
            let (a, b) = (1.0 - 0.3 * k as f64, 0.2 + 0.5 * k as f64);
            let sum = slow.iter().zip(&fast);
            let noise = 0.01 * slow.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let channel = sum.map(|(s, f)| a * s + b * f + noise * random.random_range(-1.0..1.0));
            channels.push(channel.collect::<Vec<f64>>());
        }
        let within_hz = Bounds::new(0.1, 5.0);
        let found = stable_poles(&channels, STEP_S, within_hz, &LAGS_S);
        let found_hz: Vec<f64> = found.iter().map(|p| p.frequency_hz).collect();
        assert!((found_hz[0] - 0.6).abs() < 0.03, "{found_hz:?}");
        assert!(
            found_hz.iter().any(|f| (f - 1.4).abs() < 0.06),
            "{found_hz:?}"
        );
        assert!(stable_poles(&[], STEP_S, within_hz, &LAGS_S).is_empty());
        let still = vec![vec![0.0; 900]; 4];
        assert!(stable_poles(&still, STEP_S, within_hz, &LAGS_S).is_empty());
        let short = vec![vec![1.0; 20]; 4];
        assert!(stable_poles(&short, STEP_S, within_hz, &LAGS_S).is_empty());
    }

    /// Singular values that fall as those of trees do.
    #[test]
    fn the_largest_singular_vectors_are_those_of_all() {
        let mut random = generator(4, 0);
        let mut square = || DMatrix::from_fn(90, 90, |_, _| random.random_range(-1.0..1.0));
        let (from, mut onto) = (square().qr().q(), square().qr().q());
        for (k, mut column) in onto.column_iter_mut().enumerate() {
            column *= 0.9_f64.powi(k as i32);
        }
        let (left, sizes) = left_singular(&(onto * from.transpose())).expect("an answer");
        for (order, size) in sizes.iter().enumerate().take(MOST_ORDER) {
            let wanted = 0.9_f64.powi(order as i32);
            assert!((size - wanted).abs() < 1e-7 * wanted, "{order}: {size}");
        }
        let among = left.columns(0, MOST_ORDER);
        let off = among.transpose() * among - DMatrix::identity(MOST_ORDER, MOST_ORDER);
        assert!(off.amax() < 1e-12);
    }
}

//! Fewer keys by keys that lie beside the path.
//!
//! Keys that lie on a path cut its bends and carry its noise; keys that may lie beside it, within the tolerance, are fewer by
//! a fifth. One key after the other is tried to be left out, its neighbours moved so that the largest miss between them is
//! as small as can be: least squares with the weights of Lawson (1961), which grow where the miss is large.

use super::thin_keys::Arc;
use nalgebra::{Quaternion, UnitQuaternion, Vector4};

/// Keys on either side that are moved.
const WINDOW: usize = 3;
const ITERATIONS: usize = 12;
/// By now the misses show whether there is a chance.
const LOOKED_AT: usize = 3;
const HOPELESS: f64 = 1.5;
const PASSES: usize = 3;

/// Keys of one joint: which frames, and the turn in each.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Keyed {
    pub frames: Vec<usize>,
    pub turns: Vec<UnitQuaternion<f64>>,
}

/// A path of turns, one a frame.
pub(super) struct Path<'a, F: Fn(usize, &UnitQuaternion<f64>) -> f64> {
    pub times_s: &'a [f64],
    /// Where the path goes best; neighbours in one hemisphere.
    pub aims: &'a [Vector4<f64>],
    /// By how much a turn misses in a frame, in units of what is allowed.
    pub miss: F,
}

impl<F: Fn(usize, &UnitQuaternion<f64>) -> f64> Path<'_, F> {
    /// Keys at the aims of these frames, which do; `thorough`: as few as can be found beside the path.
    pub fn keyed(&self, kept: Vec<usize>, thorough: bool) -> Keyed {
        let mut keys: Vec<(usize, Vector4<f64>)> = kept.into_iter().map(|k| (k, self.aims[k])).collect();
        for _ in 0..if thorough { PASSES } else { 0 } {
            let before = keys.len();
            let mut j = 1;
            while j + 1 < keys.len() {
                match self.without(&keys, j) {
                    Some(fewer) => keys = fewer,
                    None => j += 1,
                }
            }
            if keys.len() == before {
                break;
            }
        }
        let (frames, turns) = keys.into_iter().map(|(k, q)| (k, unit(&q))).unzip();
        Keyed { frames, turns }
    }

    /// The keys without number `j`, if those around it can be moved so that all fits.
    fn without(&self, keys: &[(usize, Vector4<f64>)], j: usize) -> Option<Vec<(usize, Vector4<f64>)>> {
        let mut fewer = keys.to_vec();
        fewer.remove(j);
        let (low, high) = (j.saturating_sub(WINDOW), (j + WINDOW - 1).min(fewer.len() - 1));
        // The ends of the window stay where they are, and those of the path: a loop would no longer close.
        let free = (low + 1, high);
        self.fit(&mut fewer, (low, high), free).then_some(fewer)
    }

    /// Moves the keys `free.0..free.1` so that everything from key `low` to key `high` fits; `false` if that cannot be.
    fn fit(&self, keys: &mut [(usize, Vector4<f64>)], (low, high): (usize, usize), free: (usize, usize)) -> bool {
        let (first, last) = (keys[low].0, keys[high].0);
        let mut weights = vec![1.0; last - first + 1];
        for round in 0..ITERATIONS {
            self.solve(keys, (low, high), free, &weights);
            let mut worst = 0.0_f64;
            for pair in keys[low..=high].windows(2) {
                let ((a, from), (b, to)) = (pair[0], pair[1]);
                let arc = Arc::new(&unit(&from), &unit(&to));
                for k in a..=b {
                    let miss = (self.miss)(k, &arc.at(self.share(a, b, k)));
                    worst = worst.max(miss);
                    // The frame of a key belongs to both spans, and is weighed once.
                    if k < b || b == last {
                        weights[k - first] *= miss.max(1e-6);
                    }
                }
            }
            if worst <= 1.0 {
                return true;
            }
            if !worst.is_finite() || (round >= LOOKED_AT && worst > HOPELESS) {
                return false;
            }
            let sum: f64 = weights.iter().sum();
            weights.iter_mut().for_each(|w| *w /= sum);
        }
        false
    }

    /// Least squares in the free keys: a symmetric system with three diagonals.
    fn solve(
        &self,
        keys: &mut [(usize, Vector4<f64>)],
        (low, high): (usize, usize),
        free: (usize, usize),
        weights: &[f64],
    ) {
        let n = free.1 - free.0;
        let (mut diagonal, mut beside, mut right) = (vec![0.0; n], vec![0.0; n], vec![Vector4::zeros(); n]);
        let first = keys[low].0;
        let place = |key: usize| (free.0..free.1).contains(&key).then(|| key - free.0);
        for key in low..high {
            let ((a, from), (b, to)) = (keys[key], keys[key + 1]);
            for k in a..=b {
                if k == b && key + 1 < high {
                    continue;
                }
                let (w, x) = (weights[k - first], self.share(a, b, k));
                let aim = self.aims[k];
                match (place(key), place(key + 1)) {
                    (Some(i), Some(_)) => {
                        diagonal[i] += w * (1.0 - x) * (1.0 - x);
                        diagonal[i + 1] += w * x * x;
                        beside[i] += w * x * (1.0 - x);
                        right[i] += aim * (w * (1.0 - x));
                        right[i + 1] += aim * (w * x);
                    }
                    (Some(i), None) => {
                        diagonal[i] += w * (1.0 - x) * (1.0 - x);
                        right[i] += (aim - to * x) * (w * (1.0 - x));
                    }
                    (None, Some(i)) => {
                        diagonal[i] += w * x * x;
                        right[i] += (aim - from * (1.0 - x)) * (w * x);
                    }
                    (None, None) => {}
                }
            }
        }
        for i in 1..n {
            let m = beside[i - 1] / diagonal[i - 1].max(1e-12);
            diagonal[i] -= m * beside[i - 1];
            let above = right[i - 1];
            right[i] -= above * m;
        }
        for i in (0..n).rev() {
            let next = if i + 1 < n { keys[free.0 + i + 1].1 * beside[i] } else { Vector4::zeros() };
            keys[free.0 + i].1 = (right[i] - next) / diagonal[i].max(1e-12);
        }
    }

    fn share(&self, a: usize, b: usize, k: usize) -> f64 {
        if a == b { 0.0 } else { (self.times_s[k] - self.times_s[a]) / (self.times_s[b] - self.times_s[a]) }
    }
}

fn unit(q: &Vector4<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::try_new(Quaternion::from(*q), 1e-9).unwrap_or_default()
}

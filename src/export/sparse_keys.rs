//! Fewer keys by keys that lie beside the path.
//!
//! Keys that lie on a path cut its bends and carry its noise; keys that may lie beside it, within
//! the tolerance, are fewer by a fifth. One key after the other is tried to be left out, its
//! neighbours moved so that the largest miss between them is as small as can be: least squares with
//! the weights of Lawson (1961), which grow where the miss is large.

use super::thin_keys::{Arc, share};
use nalgebra::{Quaternion, UnitQuaternion, Vector4};

/// Keys on either side that are moved.
const WINDOW: usize = 3;
const ITERATIONS: usize = 16;
/// By now the misses show whether there is a chance.
const LOOKED_AT: usize = 3;
const HOPELESS: f64 = 1.8;
/// Turns that differ by less (as quaternions) are one: far below what tolerances are, far above
/// rounding.
const CLOSED: f64 = 1e-7;

/// A key of one joint: its frame, and the turn, not quite of length 1.
pub(super) type Key = (usize, Vector4<f64>);

/// A path of turns, one a frame.
pub(super) struct Path<'a, F: Fn(usize, &UnitQuaternion<f64>) -> f64> {
    pub times_s: &'a [f64],
    /// Where the path goes best; neighbours in one hemisphere.
    pub aims: &'a [Vector4<f64>],
    /// By how much a turn misses in a frame, in units of what is allowed.
    pub miss: F,
}

impl<F: Fn(usize, &UnitQuaternion<f64>) -> f64> Path<'_, F> {
    /// Keys at the aims of these frames.
    pub fn on_aims(&self, frames: &[usize]) -> Vec<Key> {
        frames.iter().map(|&k| (k, self.aims[k])).collect()
    }

    /// Keys that were planned by a rule of thumb, with those moved that miss; `None` where that
    /// does not do.
    pub fn mended(&self, mut keys: Vec<Key>) -> Option<Vec<Key>> {
        if self.closes()
            && let [first, .., last] = keys.as_mut_slice()
        {
            (first.1, last.1) = (self.aims[first.0], self.aims[last.0]);
        }
        for j in 1..keys.len() {
            if !self.fits(&keys[j - 1], &keys[j]) {
                let window = (
                    j.saturating_sub(1 + WINDOW),
                    (j + WINDOW).min(keys.len() - 1),
                );
                if !self.fit(&mut keys, window) {
                    return None;
                }
            }
        }
        Some(keys)
    }

    /// As few of these keys, which do, as can be found beside the path.
    pub fn fewer(&self, mut keys: Vec<Key>) -> Vec<Key> {
        let mut j = 1;
        while j + 1 < keys.len() {
            match self.without(&keys, j) {
                Some(fewer) => keys = fewer,
                None => j += 1,
            }
        }
        keys
    }

    /// The keys without number `j`, if those around it can be moved so that all fits.
    fn without(&self, keys: &[Key], j: usize) -> Option<Vec<Key>> {
        let mut fewer = keys.to_vec();
        fewer.remove(j);
        let window = (
            j.saturating_sub(WINDOW),
            (j + WINDOW - 1).min(fewer.len() - 1),
        );
        self.fit(&mut fewer, window).then_some(fewer)
    }

    /// Whether the path ends where it began: a loop must close with its keys, too.
    fn closes(&self) -> bool {
        self.aims
            .first()
            .zip(self.aims.last())
            .is_some_and(|(a, b)| (a - b).norm().min((a + b).norm()) < CLOSED)
    }

    /// Whether the way between two keys does.
    fn fits(&self, from: &Key, to: &Key) -> bool {
        let arc = Arc::new(&unit(&from.1), &unit(&to.1));
        (from.0..=to.0)
            .all(|k| (self.miss)(k, &arc.at(share(self.times_s, from.0, to.0, k))) <= 1.0)
    }

    /// Moves keys so that everything from key `low` to key `high` fits; `false` if that cannot be.
    /// These two stay where they are, unless the path itself ends there and is no loop.
    fn fit(&self, keys: &mut [Key], (low, high): (usize, usize)) -> bool {
        let ends = !self.closes();
        let free = (
            if low == 0 && ends { 0 } else { low + 1 },
            if high + 1 == keys.len() && ends {
                high + 1
            } else {
                high
            },
        );
        let (first, last) = (keys[low].0, keys[high].0);
        let mut weights = vec![1.0; last - first + 1];
        for round in 0..ITERATIONS {
            self.solve(keys, (low, high), free, &weights);
            let mut worst = 0.0_f64;
            for pair in keys[low..=high].windows(2) {
                let ((a, from), (b, to)) = (pair[0], pair[1]);
                let arc = Arc::new(&unit(&from), &unit(&to));
                for k in a..=b {
                    let miss = (self.miss)(k, &arc.at(share(self.times_s, a, b, k)));
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
        keys: &mut [Key],
        (low, high): (usize, usize),
        free: (usize, usize),
        weights: &[f64],
    ) {
        let n = free.1 - free.0;
        let (mut diagonal, mut beside, mut right) =
            (vec![0.0; n], vec![0.0; n], vec![Vector4::zeros(); n]);
        let first = keys[low].0;
        let place = |key: usize| (free.0..free.1).contains(&key).then(|| key - free.0);
        for key in low..high {
            let ((a, from), (b, to)) = (keys[key], keys[key + 1]);
            for k in a..=b {
                if k == b && key + 1 < high {
                    continue;
                }
                let (w, x) = (weights[k - first], share(self.times_s, a, b, k));
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
            let next = if i + 1 < n {
                keys[free.0 + i + 1].1 * beside[i]
            } else {
                Vector4::zeros()
            };
            keys[free.0 + i].1 = (right[i] - next) / diagonal[i].max(1e-12);
        }
    }
}

/// The turn of a key.
pub(super) fn unit(q: &Vector4<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::try_new(Quaternion::from(*q), 1e-9).unwrap_or_default()
}

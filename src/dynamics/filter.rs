//! What signals have of one oscillation among others: Wiener's filter, at any times.
//!
//! The covariance of the sum is inverted and that of the part multiplied in a time that grows with
//! the number of values only, by the same factor as the likelihood's (`celerite.rs`).

use super::celerite::{Part, Ranks, Times};

/// A filter for one part of a sum.
pub(super) struct Filter {
    /// Of the sum: u, v and fading of every rank in every frame, then W of its factor and the
    /// diagonal.
    all: Table,
    w: Vec<f64>,
    d: Vec<f64>,
    own: Table,
    variance: f64,
}

/// Ranks in all frames, a row for each frame.
struct Table {
    ranks: usize,
    u: Vec<f64>,
    v: Vec<f64>,
    fade: Vec<f64>,
}

impl Table {
    fn new(ranks: &Ranks, frames: usize) -> Self {
        let j = ranks.len();
        let [mut u, mut v, mut fade] = [
            vec![0.0; frames * j],
            vec![0.0; frames * j],
            vec![0.0; frames * j],
        ];
        for k in 0..frames {
            let row = k * j..(k + 1) * j;
            ranks.at(k, &mut u[row.clone()], &mut v[row.clone()], &mut fade[row]);
        }
        Self {
            ranks: j,
            u,
            v,
            fade,
        }
    }
}

impl Filter {
    /// For `parts[of]` of a sum of `parts` and noise of variance `noise` in every value; `None` if
    /// the sum has no likelihood.
    pub fn new(times: &Times, parts: &[Part], noise: f64, of: usize) -> Option<Self> {
        let part = parts.get(of)?;
        let n = times.s.len();
        let (all, own) = (
            Table::new(&times.ranks(parts), n),
            Table::new(&times.ranks(&[*part]), n),
        );
        let j = all.ranks;
        let diagonal = noise + parts.iter().map(Part::variance).sum::<f64>();
        let (mut s, mut w, mut d) = (vec![0.0; j * j], vec![0.0; n * j], vec![0.0; n]);
        for k in 0..n {
            let (u, v, fade) = (&all.u[k * j..], &all.v[k * j..], &all.fade[k * j..]);
            let mut su = vec![0.0; j];
            for a in 0..j {
                for b in 0..j {
                    if k > 0 {
                        let added = d[k - 1] * w[(k - 1) * j + a] * w[(k - 1) * j + b];
                        s[a * j + b] = fade[a] * fade[b] * (s[a * j + b] + added);
                    }
                    su[a] += s[a * j + b] * u[b];
                }
            }
            d[k] = diagonal - (0..j).map(|a| u[a] * su[a]).sum::<f64>();
            if d[k].is_nan() || d[k] <= 0.0 {
                return None;
            }
            (0..j).for_each(|a| w[k * j + a] = (v[a] - su[a]) / d[k]);
        }
        Some(Self {
            all,
            w,
            d,
            own,
            variance: part.variance(),
        })
    }

    /// The best guess of the part in a signal.
    pub fn of(&self, signal: &[f64]) -> Vec<f64> {
        let (n, j) = (self.d.len(), self.all.ranks);
        let Table { u, fade, .. } = &self.all;
        let mut x = signal.to_vec();
        let mut f = vec![0.0; j];
        for k in 0..n {
            for a in 0..j {
                if k > 0 {
                    f[a] = fade[k * j + a] * (f[a] + self.w[(k - 1) * j + a] * x[k - 1]);
                }
                x[k] -= u[k * j + a] * f[a];
            }
        }
        f.fill(0.0);
        for k in (0..n).rev() {
            x[k] /= self.d[k];
            for a in 0..j {
                if k + 1 < n {
                    f[a] = fade[(k + 1) * j + a] * (f[a] + u[(k + 1) * j + a] * x[k + 1]);
                }
                x[k] -= self.w[k * j + a] * f[a];
            }
        }
        let mut out: Vec<f64> = x.iter().map(|x| self.variance * x).collect();
        let Table { ranks, u, v, fade } = &self.own;
        let j = *ranks;
        for a in 0..j {
            let (mut before, mut after) = (0.0, 0.0);
            for k in 1..n {
                before = fade[k * j + a] * (before + v[(k - 1) * j + a] * x[k - 1]);
                out[k] += u[k * j + a] * before;
                let m = n - k;
                after = fade[m * j + a] * (after + u[m * j + a] * x[m]);
                out[m - 1] += v[(m - 1) * j + a] * after;
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(times_s: &[f64], hz: f64) -> Vec<f64> {
        let phases = times_s.iter().map(|t| std::f64::consts::TAU * hz * t);
        phases.map(f64::sin).collect()
    }

    fn oscillator(frequency_hz: f64, variance: f64) -> Part {
        Part::Oscillator {
            variance,
            frequency_hz,
            damping: 0.01,
            gusts_per_s: 1e3,
        }
    }

    /// Two sways close together in one signal: each comes out as it went in.
    #[test]
    fn a_sway_is_told_from_another_one_beside_it() {
        let times: Vec<f64> = (0..900)
            .map(|k| 0.066 * f64::from(k) + 0.01 * (f64::from(k) * 1.7).sin())
            .collect();
        let (slow, fast) = (wave(&times, 0.6), wave(&times, 0.8));
        let both: Vec<f64> = slow.iter().zip(&fast).map(|(a, b)| a + 2.0 * b).collect();
        let parts = [
            oscillator(0.6, 0.5),
            Part::Drift {
                variance: 0.01,
                rate_per_s: 0.1,
            },
            oscillator(0.8, 2.0),
        ];
        let times = Times::new(times.clone());
        for (of, wanted, size) in [(0, &slow, 1.0), (2, &fast, 2.0)] {
            let found = Filter::new(&times, &parts, 1e-3, of).unwrap().of(&both);
            let off = found
                .iter()
                .zip(wanted)
                .map(|(f, w)| (f - size * w).powi(2))
                .sum::<f64>()
                / 900.0;
            assert!(
                off.sqrt() < 0.1 * size,
                "part {of} is off by {}",
                off.sqrt()
            );
        }
        assert!(Filter::new(&times, &parts, -9.0, 0).is_none());
    }
}

//! What is compared between points: their motion on common steps in time.

use super::rest::rest_position_px;
use crate::model::TrackTable;
use nalgebra::DMatrix;

/// Steps on either side over which a displacement is averaged: tracking noise is not to decide who
/// belongs to whom.
const SMOOTH_STEPS: usize = 1;
/// Time over which the liveliness of a moment is taken, s: about a period of what sways.
const LIVELINESS_S: f64 = 1.0;
/// Mean square displacement that tracking alone may show, px^2: quieter moments than this count
/// less, as noise is most of them.
const LIVELINESS_FLOOR: f32 = 0.09;
/// Independent sums per lane let the compiler use vector instructions, and fix the order of
/// addition.
const LANES: usize = 8;

/// Two coordinates for each point and step, mean removed, 0 where a point was not seen.
pub struct Signals {
    /// A row a step, a column a point, so that what belongs to a point lies together.
    u: DMatrix<f32>,
    v: DMatrix<f32>,
    seen: DMatrix<f32>,
}

impl Signals {
    /// Velocities: differences between the frames of `table` for which `use_step(step)` holds, of
    /// the points in
    /// `rows`, px per step; seen where both frames are.
    pub fn velocities(
        table: &TrackTable,
        rows: &[usize],
        use_step: impl Fn(usize) -> bool,
    ) -> Self {
        let steps: Vec<usize> = (0..table.times_s.len().saturating_sub(1))
            .filter(|&k| use_step(k))
            .collect();
        Self::new(rows.len(), steps.len(), |i, s| {
            let p = &table.positions[rows[i]];
            let (a, b) = (p[steps[s]]?, p[steps[s] + 1]?);
            Some([b[0] - a[0], b[1] - a[1]])
        })
    }

    /// Displacements from the mean, px, in which every moment counts alike: divided by how lively
    /// the points are at that time. After a release all branches swing together first, and
    /// strongly; which of them belong together shows later, when those of different frequency and
    /// damping have come apart.
    pub fn displacements(table: &TrackTable, rows: &[usize]) -> Self {
        let steps = table.times_s.len();
        // Less the rest position first: single precision is short of digits for a slow sway far
        // from the origin.
        let rest_px: Vec<[f64; 2]> = rows
            .iter()
            .map(|&row| rest_position_px(table, row))
            .collect();
        let smooth = |i: usize, s: usize| {
            let around = s.saturating_sub(SMOOTH_STEPS)..=(s + SMOOTH_STEPS).min(steps - 1);
            let p = &table.positions[rows[i]];
            p[s]?;
            let rest = rest_px[i];
            let (sum, n) = p[around]
                .iter()
                .flatten()
                .fold(([0.0f64; 2], 0.0), |(sum, n), q| {
                    (
                        [
                            sum[0] + f64::from(q[0]) - rest[0],
                            sum[1] + f64::from(q[1]) - rest[1],
                        ],
                        n + 1.0,
                    )
                });
            Some([(sum[0] / n) as f32, (sum[1] / n) as f32])
        };
        let mut signals = Self::new(rows.len(), steps, smooth);
        signals.weigh_moments_alike(&table.times_s);
        signals
    }

    fn new(points: usize, steps: usize, value: impl Fn(usize, usize) -> Option<[f32; 2]>) -> Self {
        let zero = DMatrix::zeros(steps, points);
        let (mut u, mut v, mut seen) = (zero.clone(), zero.clone(), zero);
        for i in 0..points {
            let (mut sum, mut count) = ([0.0f32; 2], 0.0f32);
            for s in 0..steps {
                if let Some(d) = value(i, s) {
                    (u[(s, i)], v[(s, i)], seen[(s, i)]) = (d[0], d[1], 1.0);
                    sum = [sum[0] + d[0], sum[1] + d[1]];
                    count += 1.0;
                }
            }
            for s in 0..steps {
                u[(s, i)] -= seen[(s, i)] * sum[0] / count.max(1.0);
                v[(s, i)] -= seen[(s, i)] * sum[1] / count.max(1.0);
            }
        }
        Self { u, v, seen }
    }

    fn weigh_moments_alike(&mut self, times_s: &[f64]) {
        let energy: Vec<f32> = (0..self.steps())
            .map(|s| {
                let n = self.seen.row(s).sum().max(1.0);
                (self.u.row(s).norm_squared() + self.v.row(s).norm_squared()) / n
            })
            .collect();
        let lively: Vec<f32> = times_s
            .iter()
            .map(|t| {
                let near = times_s
                    .iter()
                    .zip(&energy)
                    .filter(|(o, _)| (*o - t).abs() <= LIVELINESS_S / 2.0);
                let (sum, n) = near.fold((0.0, 0.0), |(sum, n), (_, e)| (sum + e, n + 1.0f32));
                sum / n.max(1.0)
            })
            .collect();
        for (s, e) in lively.iter().enumerate() {
            let weight = 1.0 / (e + LIVELINESS_FLOOR).sqrt();
            self.u.row_mut(s).scale_mut(weight);
            self.v.row_mut(s).scale_mut(weight);
        }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.u.ncols()
    }

    /// Number of steps in time.
    pub fn steps(&self) -> usize {
        self.u.nrows()
    }

    /// The two coordinates of a point, step by step, scaled so that their squares add up to 1;
    /// zeros for a point that never moved.
    pub fn unit(&self, point: usize) -> Vec<[f32; 2]> {
        let energy = self.u.column(point).norm_squared() + self.v.column(point).norm_squared();
        let scale = if energy > 0.0 {
            1.0 / energy.sqrt()
        } else {
            0.0
        };
        (0..self.steps())
            .map(|s| [scale * self.u[(s, point)], scale * self.v[(s, point)]])
            .collect()
    }

    /// Mean over the points that were seen, step by step.
    pub fn mean(&self) -> Vec<[f64; 2]> {
        let of_step = |s: usize| {
            let n = f64::from(self.seen.row(s).sum()).max(1.0);
            [
                f64::from(self.u.row(s).sum()) / n,
                f64::from(self.v.row(s).sum()) / n,
            ]
        };
        (0..self.steps()).map(of_step).collect()
    }

    /// Real part of rho of Zeng eq. 2.20 for points `a` and `b`, over the steps in which both were
    /// seen, -1 to 1.
    ///
    /// The equation as printed multiplies the complex velocities without conjugating one of them,
    /// by which two equal circular motions would come out as unrelated; Liu et al. take the
    /// conjugate, and so does this. Of the complex result the part in phase is kept and not the
    /// magnitude: two branches that swing against each other, or a quarter of a period apart, are
    /// different branches.
    pub fn correlation(&self, a: usize, b: usize) -> f32 {
        let (mut re, mut ea, mut eb) = ([0.0f32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
        let of = |point: usize| {
            let at = point * self.steps()..(point + 1) * self.steps();
            (
                &self.u.as_slice()[at.clone()],
                &self.v.as_slice()[at.clone()],
                &self.seen.as_slice()[at],
            )
        };
        let ((a_u, a_v, a_seen), (b_u, b_v, b_seen)) = (of(a), of(b));
        for s in 0..self.steps() {
            let l = s % LANES;
            let (au, av, sa) = (a_u[s], a_v[s], a_seen[s]);
            let (bu, bv, sb) = (b_u[s], b_v[s], b_seen[s]);
            re[l] += au * bu + av * bv;
            ea[l] += sb * (au * au + av * av);
            eb[l] += sa * (bu * bu + bv * bv);
        }
        let sum = |x: [f32; LANES]| x.iter().sum::<f32>();
        normalised(sum(re), sum(ea) * sum(eb))
    }

    /// The correlations of all pairs: as [`correlation`](Self::correlation), by products of
    /// matrices, which is some twenty times faster.
    pub fn correlations(&self) -> DMatrix<f32> {
        let (product, energy) = self.products();
        self.correlations_of(product, &energy)
    }

    /// [`correlations`](Self::correlations), and the root mean square difference of all pairs over
    /// the steps in which both were seen, on its diagonal that of each point from rest; infinite
    /// for two that never were seen together.
    pub fn compared(&self) -> (DMatrix<f32>, DMatrix<f32>) {
        let (product, energy) = self.products();
        let both = self.seen.tr_mul(&self.seen);
        let differences = DMatrix::from_fn(self.len(), self.len(), |a, b| {
            let sum = if a == b {
                product[(a, a)]
            } else {
                energy[(a, b)] + energy[(b, a)] - 2.0 * product[(a, b)]
            };
            if both[(a, b)] > 0.0 {
                (sum.max(0.0) / both[(a, b)]).sqrt()
            } else {
                f32::INFINITY
            }
        });
        (self.correlations_of(product, &energy), differences)
    }

    /// Scalar products of all pairs, and what each point (row) has of energy in the steps in which
    /// the other (column) was seen.
    fn products(&self) -> (DMatrix<f32>, DMatrix<f32>) {
        let product = self.u.tr_mul(&self.u) + self.v.tr_mul(&self.v);
        let energy =
            (self.u.component_mul(&self.u) + self.v.component_mul(&self.v)).tr_mul(&self.seen);
        (product, energy)
    }

    fn correlations_of(&self, mut rho: DMatrix<f32>, energy: &DMatrix<f32>) -> DMatrix<f32> {
        for b in 0..self.len() {
            for a in 0..b {
                let r = normalised(rho[(a, b)], energy[(a, b)] * energy[(b, a)]);
                rho[(a, b)] = r;
                rho[(b, a)] = r;
            }
            rho[(b, b)] = 1.0;
        }
        rho
    }
}

fn normalised(product: f32, energies: f32) -> f32 {
    if energies > 0.0 {
        (product / energies.sqrt()).clamp(-1.0, 1.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::TrackId;

    /// Gaps differ from point to point: the fast way must leave the same steps out as the plain
    /// one.
    #[test]
    fn all_pairs_at_once_are_the_single_pairs() {
        let path = |i: usize| {
            (0..40usize)
                .map(|k| {
                    let t = k as f32 / 15.0;
                    let seen = !(k * 7 + i * 3).is_multiple_of(5);
                    seen.then(|| {
                        [
                            100.0 + (3.0 * t + i as f32).sin(),
                            50.0 + (4.0 * t * (1.0 + i as f32)).cos(),
                        ]
                    })
                })
                .collect()
        };
        let table = TrackTable {
            ids: (0..6).map(TrackId).collect(),
            times_s: (0..40).map(|k| f64::from(k) / 15.0).collect(),
            positions: (0..6).map(path).collect(),
            fb_errors_px: vec![0.1; 6],
        };
        let rows: Vec<usize> = (0..6).collect();
        for signals in [
            Signals::velocities(&table, &rows, |_| true),
            Signals::displacements(&table, &rows),
        ] {
            let all = signals.correlations();
            for a in 0..6 {
                for b in (0..6).filter(|&b| b != a) {
                    assert!(
                        (all[(a, b)] - signals.correlation(a, b)).abs() < 1e-4,
                        "{a} and {b}"
                    );
                }
            }
        }
    }
}

//! What is compared between points: their motion on common steps in time.

use super::rest::rest_position_px;
use crate::model::TrackTable;
use nalgebra::{DMatrix, Point2, Vector2};

/// Steps on either side over which a displacement is averaged: tracking noise is not to decide
/// which points belong together.
const SMOOTH_STEPS: usize = 1;
/// Time over which the root mean square of the motion at a moment is taken, s: about a period of
/// what sways.
const RMS_WINDOW_S: f64 = 1.0;
/// Mean square displacement that tracking alone may show, px^2: quieter moments than this count
/// less, as noise is most of them.
const NOISE_FLOOR_PX2: f32 = 0.09;
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
    /// the points in `rows`, px per step; seen where both frames are.
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
            Some(b - a)
        })
    }

    /// Displacements from the mean, divided by the root mean square of all points at that time, so
    /// that every moment counts alike. After a release all branches swing together first, and
    /// strongly; which of them belong together shows later, when those of different frequency and
    /// damping have come apart.
    pub fn displacements(table: &TrackTable, rows: &[usize]) -> Self {
        let steps = table.times_s.len();
        // Less the rest position first: single precision is short of digits for a slow sway far
        // from the origin.
        let rest_px: Vec<Point2<f64>> = rows
            .iter()
            .map(|&row| rest_position_px(table, row))
            .collect();
        let mut signals = Self::new(rows.len(), steps, |i, s| {
            smoothed(&table.positions[rows[i]], s, rest_px[i])
        });
        signals.normalise_by_instantaneous_rms(&table.times_s);
        signals
    }

    fn new(
        points: usize,
        steps: usize,
        value: impl Fn(usize, usize) -> Option<Vector2<f32>>,
    ) -> Self {
        let zero = DMatrix::zeros(steps, points);
        let (mut u, mut v, mut seen) = (zero.clone(), zero.clone(), zero);
        for i in 0..points {
            let (mut sum, mut count) = (Vector2::zeros(), 0.0f32);
            for s in 0..steps {
                if let Some(d) = value(i, s) {
                    (u[(s, i)], v[(s, i)], seen[(s, i)]) = (d.x, d.y, 1.0);
                    sum += d;
                    count += 1.0;
                }
            }
            for s in 0..steps {
                u[(s, i)] -= seen[(s, i)] * sum.x / count.max(1.0);
                v[(s, i)] -= seen[(s, i)] * sum.y / count.max(1.0);
            }
        }
        Self { u, v, seen }
    }

    /// Divides by the root mean square of all points within [`RMS_WINDOW_S`] around each step.
    fn normalise_by_instantaneous_rms(&mut self, times_s: &[f64]) {
        let mut mean_sq: Vec<f32> = Vec::with_capacity(self.steps());
        for s in 0..self.steps() {
            let n = self.seen.row(s).sum().max(1.0);
            mean_sq.push((self.u.row(s).norm_squared() + self.v.row(s).norm_squared()) / n);
        }
        for (s, time_s) in times_s.iter().enumerate() {
            let (mut sum, mut n) = (0.0, 0.0f32);
            for (other_s, mean_sq) in times_s.iter().zip(&mean_sq) {
                if (other_s - time_s).abs() <= RMS_WINDOW_S / 2.0 {
                    sum += mean_sq;
                    n += 1.0;
                }
            }
            let weight = 1.0 / (sum / n.max(1.0) + NOISE_FLOOR_PX2).sqrt();
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
    pub fn unit(&self, point: usize) -> Vec<Vector2<f32>> {
        let energy = self.u.column(point).norm_squared() + self.v.column(point).norm_squared();
        let scale = if energy > 0.0 {
            1.0 / energy.sqrt()
        } else {
            0.0
        };
        (0..self.steps())
            .map(|s| scale * Vector2::new(self.u[(s, point)], self.v[(s, point)]))
            .collect()
    }

    /// Mean over the points that were seen, step by step.
    pub fn mean(&self) -> Vec<Vector2<f64>> {
        let mut mean = Vec::with_capacity(self.steps());
        for s in 0..self.steps() {
            let n = f64::from(self.seen.row(s).sum()).max(1.0);
            let sum = [&self.u, &self.v].map(|m| f64::from(m.row(s).sum()));
            mean.push(Vector2::from(sum) / n);
        }
        mean
    }

    /// Real part of rho of Zeng 2015 eq. 2.20 for points `a` and `b`, over the steps in which both
    /// were seen, -1 to 1.
    ///
    /// The equation as printed multiplies the complex velocities without conjugating one of them,
    /// by which two equal circular motions would come out as unrelated; Liu et al. take the
    /// conjugate, and so does this. Of the complex result the part in phase is kept and not the
    /// magnitude: two branches that swing against each other, or a quarter of a period apart, are
    /// different branches.
    pub fn correlation(&self, a: usize, b: usize) -> f32 {
        let (mut re, mut ea, mut eb) = ([0.0f32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
        let (a_u, b_u) = (column(&self.u, a), column(&self.u, b));
        let (a_v, b_v) = (column(&self.v, a), column(&self.v, b));
        let (a_seen, b_seen) = (column(&self.seen, a), column(&self.seen, b));
        for s in 0..self.steps() {
            let l = s % LANES;
            let (au, av, sa) = (a_u[s], a_v[s], a_seen[s]);
            let (bu, bv, sb) = (b_u[s], b_v[s], b_seen[s]);
            re[l] += au * bu + av * bv;
            ea[l] += sb * (au * au + av * av);
            eb[l] += sa * (bu * bu + bv * bv);
        }
        let [re, ea, eb] = [re, ea, eb].map(|lanes| lanes.iter().sum::<f32>());
        normalised(re, ea * eb)
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

/// Displacement from `rest_px` at a step, px: the mean over [`SMOOTH_STEPS`] to either side; `None`
/// where the point is not seen at the step itself.
fn smoothed(
    track: &[Option<Point2<f32>>],
    step: usize,
    rest_px: Point2<f64>,
) -> Option<Vector2<f32>> {
    track[step]?;
    let around = step.saturating_sub(SMOOTH_STEPS)..=(step + SMOOTH_STEPS).min(track.len() - 1);
    let (mut sum, mut n) = (Vector2::<f64>::zeros(), 0.0);
    for p in track[around].iter().flatten() {
        // The last bits depend on the order of the sum.
        sum = sum + p.coords.cast() - rest_px.coords;
        n += 1.0;
    }
    Some((sum / n).cast())
}

/// The values of a point, step by step.
fn column(m: &DMatrix<f32>, point: usize) -> &[f32] {
    &m.as_slice()[point * m.nrows()..(point + 1) * m.nrows()]
}

/// The correlation, of a scalar product and the product of both energies, -1 to 1.
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

    fn place_px(point: usize, frame: usize) -> Option<Point2<f32>> {
        if (frame * 7 + point * 3).is_multiple_of(5) {
            return None;
        }
        let t = frame as f32 / 15.0;
        let u = 100.0 + (3.0 * t + point as f32).sin();
        let v = 50.0 + (4.0 * t * (1.0 + point as f32)).cos();
        Some(Point2::new(u, v))
    }

    /// Gaps differ from point to point: the fast way must leave the same steps out as the plain
    /// one.
    #[test]
    fn all_pairs_at_once_are_the_single_pairs() {
        let table = TrackTable {
            ids: (0..6).map(TrackId).collect(),
            times_s: (0..40).map(|k| f64::from(k) / 15.0).collect(),
            positions: (0..6)
                .map(|i| (0..40).map(|k| place_px(i, k)).collect())
                .collect(),
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

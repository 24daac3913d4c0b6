//! A point's first patch found again in a later picture, to a fraction of a pixel.
//!
//! Inverse compositional Gauss-Newton on the shift alone (Baker and Matthews, "Lucas-Kanade 20 years on", 2004). The patch
//! is warped as the points around it say that the branch has turned and bent; patch and picture are brought to zero mean
//! and unit variance, so that a leaf in the shade is the same leaf; weights fall off from the middle, where the point is.

use crate::model::Luma;

/// Half the side of a patch, px: 11 x 11 pixels.
const HALF_PX: i32 = 5;
const SIDE: usize = 2 * HALF_PX as usize + 1;
const N: usize = SIDE * SIDE;
/// Standard deviation of the Gaussian weights, as a share of half the side.
const SIGMA: f32 = 0.6;
/// The search ends when a step is shorter than this, px, or after so many; no step is longer than that, px.
const CLOSE_PX: f32 = 0.03;
const STEPS: usize = 12;
const LONGEST_STEP_PX: f32 = 1.5;
/// Variance of brightness below which there is nothing to be recognised.
const LEAST_VARIANCE: f32 = 1.0;

/// Rows of the matrix that takes offsets in a patch to offsets in the picture.
pub type Warp = [[f32; 2]; 2];
/// No turning, no bending.
pub const UPRIGHT: Warp = [[1.0, 0.0], [0.0, 1.0]];

/// What a point looked like when it was detected.
pub struct Patch {
    /// Brightness with zero mean and unit variance under the weights, and its slopes.
    values: [f32; N],
    slopes: [[f32; 2]; N],
    /// Inverse of the weighted sum of products of slopes: xx, xy, yy.
    inverse: [f32; 3],
}

/// Where a patch was found.
#[derive(Clone, Copy, Debug)]
pub struct Match {
    pub at_px: [f32; 2],
    /// Normalised cross-correlation under the weights there, and where the search began; -1 to 1.
    pub likeness: f32,
    pub likeness_at_start: f32,
    pub converged: bool,
}

/// Cuts out and finds patches.
pub struct Registration {
    /// Sum 1.
    weights: [f32; N],
}

impl Default for Registration {
    fn default() -> Self {
        let sigma_px = SIGMA * HALF_PX as f32;
        let mut weights = [0.0; N];
        for (w, (x, y)) in weights.iter_mut().zip(offsets()) {
            *w = (-(x * x + y * y) / (2.0 * sigma_px * sigma_px)).exp();
        }
        let sum: f32 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
        Self { weights }
    }
}

impl Registration {
    /// The patch around `at` (px).
    pub fn patch(&self, luma: &Luma, at: [f32; 2]) -> Patch {
        let (mut values, mut slopes) = ([0.0; N], [[0.0; 2]; N]);
        let scale = 1.0 / self.normalise(&mut values, |v| sample(luma, at, &UPRIGHT, v));
        for (s, (x, y)) in slopes.iter_mut().zip(offsets()) {
            let at = |dx: f32, dy: f32| bilinear(luma, at[0] + x + dx, at[1] + y + dy);
            let half = 0.5 * scale;
            *s = [half * (at(1.0, 0.0) - at(-1.0, 0.0)), half * (at(0.0, 1.0) - at(0.0, -1.0))];
        }
        // Brightness is compared less its mean, so that its slopes count less their means, too.
        let mean = |c: usize| self.weights.iter().zip(&slopes).map(|(w, s)| w * s[c]).sum::<f32>();
        let means = [mean(0), mean(1)];
        slopes.iter_mut().for_each(|s| *s = [s[0] - means[0], s[1] - means[1]]);
        let sum = |a: usize, b: usize| self.weights.iter().zip(&slopes).map(|(w, s)| w * s[a] * s[b]).sum::<f32>();
        let (xx, xy, yy) = (sum(0, 0) + 1e-4, sum(0, 1), sum(1, 1) + 1e-4);
        let determinant = (xx * yy - xy * xy).max(1e-8);
        Patch { values, slopes, inverse: [yy / determinant, -xy / determinant, xx / determinant] }
    }

    /// How alike `patch` and the picture around `at` are, -1 to 1.
    pub fn likeness(&self, patch: &Patch, luma: &Luma, at: [f32; 2], warp: &Warp) -> f32 {
        let mut values = [0.0; N];
        self.normalise(&mut values, |v| sample(luma, at, warp, v));
        self.weights.iter().zip(&values).zip(&patch.values).map(|((w, a), b)| w * a * b).sum()
    }

    /// Looks for `patch` in `luma` from `start` (px) on.
    pub fn find(&self, patch: &Patch, luma: &Luma, start: [f32; 2], warp: &Warp) -> Match {
        let mut values = [0.0; N];
        let mut found = Match { at_px: start, likeness: 0.0, likeness_at_start: 0.0, converged: false };
        for k in 0..STEPS {
            self.normalise(&mut values, |v| sample(luma, found.at_px, warp, v));
            let (mut likeness, mut right) = (0.0f32, [0.0f32; 2]);
            for (((w, a), b), s) in self.weights.iter().zip(&values).zip(&patch.values).zip(&patch.slopes) {
                likeness += w * a * b;
                let r = w * (b - a);
                right = [right[0] + r * s[0], right[1] + r * s[1]];
            }
            found.likeness = likeness;
            if k == 0 {
                found.likeness_at_start = likeness;
            }
            let [xx, xy, yy] = patch.inverse;
            let shift = [xx * right[0] + xy * right[1], xy * right[0] + yy * right[1]];
            let mut step = [0, 1].map(|c| warp[c][0] * shift[0] + warp[c][1] * shift[1]);
            let length = step[0].hypot(step[1]);
            if length > LONGEST_STEP_PX {
                step = step.map(|x| x * LONGEST_STEP_PX / length);
            }
            found.at_px = [found.at_px[0] + step[0], found.at_px[1] + step[1]];
            if length < CLOSE_PX {
                found.converged = true;
                break;
            }
        }
        found
    }

    /// Fills `values` and brings them to zero mean and unit variance; gives their standard deviation. Where there is no
    /// texture they are all 0, which is like nothing.
    fn normalise(&self, values: &mut [f32; N], fill: impl FnOnce(&mut [f32; N])) -> f32 {
        fill(values);
        let mean: f32 = self.weights.iter().zip(values.iter()).map(|(w, v)| w * v).sum();
        values.iter_mut().for_each(|v| *v -= mean);
        let variance: f32 = self.weights.iter().zip(values.iter()).map(|(w, v)| w * v * v).sum();
        let deviation = variance.max(LEAST_VARIANCE).sqrt();
        let scale = if variance < LEAST_VARIANCE { 0.0 } else { 1.0 / deviation };
        values.iter_mut().for_each(|v| *v *= scale);
        deviation
    }
}

/// Offsets of a patch's pixels from its middle, row by row.
fn offsets() -> impl Iterator<Item = (f32, f32)> {
    (-HALF_PX..=HALF_PX).flat_map(|y| (-HALF_PX..=HALF_PX).map(move |x| (x as f32, y as f32)))
}

fn sample(luma: &Luma, at: [f32; 2], warp: &Warp, into: &mut [f32; N]) {
    let (w, h) = (luma.size.width as usize, luma.size.height as usize);
    let half = HALF_PX as f32;
    let reach = [0, 1].map(|c| half * (warp[c][0].abs() + warp[c][1].abs()));
    let inside = (0..2).all(|c| at[c] - reach[c] >= 0.0 && at[c] + reach[c] < ([w, h][c] as f32) - 1.0);
    if !inside {
        for (value, (x, y)) in into.iter_mut().zip(offsets()) {
            let to = [0, 1].map(|c| at[c] + warp[c][0] * x + warp[c][1] * y);
            *value = bilinear(luma, to[0], to[1]);
        }
        return;
    }
    for (row, y) in into.chunks_exact_mut(SIDE).zip(-HALF_PX..=HALF_PX) {
        let y = y as f32;
        let left = [0, 1].map(|c| at[c] + warp[c][1] * y - warp[c][0] * half);
        for (value, x) in row.iter_mut().zip(0..SIDE) {
            let (u, v) = (left[0] + warp[0][0] * x as f32, left[1] + warp[1][0] * x as f32);
            // Rounding may put the outermost a hair outside.
            let (i, j) = ((u as usize).min(w - 2), (v as usize).min(h - 2));
            let (a, b) = (u - i as f32, v - j as f32);
            let upper = j * w + i;
            let (Some(&[p, q]), Some(&[r, s])) =
                (luma.pixels[upper..].first_chunk::<2>(), luma.pixels[upper + w..].first_chunk::<2>())
            else {
                continue;
            };
            let [p, q, r, s] = [p, q, r, s].map(f32::from);
            let (above, below) = (p + a * (q - p), r + a * (s - r));
            *value = above + b * (below - above);
        }
    }
}

/// Brightness between pixels; beyond the edge the edge goes on.
fn bilinear(luma: &Luma, u_px: f32, v_px: f32) -> f32 {
    let (w, h) = (luma.size.width as i32, luma.size.height as i32);
    let u = u_px.clamp(0.0, (w - 1) as f32);
    let v = v_px.clamp(0.0, (h - 1) as f32);
    let (u0, v0) = (u as i32, v as i32);
    let (u1, v1) = ((u0 + 1).min(w - 1), (v0 + 1).min(h - 1));
    let (fu, fv) = (u - u0 as f32, v - v0 as f32);
    let at = |u: i32, v: i32| f32::from(luma.pixels[(v * w + u) as usize]);
    (at(u0, v0) * (1.0 - fu) + at(u1, v0) * fu) * (1.0 - fv) + (at(u0, v1) * (1.0 - fu) + at(u1, v1) * fu) * fv
}

//! A point's first patch found again in a later picture, to a fraction of a pixel.
//!
//! Inverse compositional Gauss-Newton on the shift alone (Baker and Matthews, "Lucas-Kanade 20
//! years on", 2004). The patch is warped as the points around it say that the branch has turned and
//! bent; patch and picture are brought to zero mean and unit variance, so that a leaf in the shade
//! is the same leaf; weights fall off from the middle, where the point is.

use crate::model::Luma;
use nalgebra::{Matrix2, Point2, Vector2};

/// Half the side of a patch, px: 11 x 11 pixels.
const HALF_PX: i32 = 5;
const SIDE: usize = 2 * HALF_PX as usize + 1;
const N: usize = SIDE * SIDE;
/// Sums are added up in so many lanes, always in the same order; arrays are filled up with zeros to
/// whole lanes.
const LANES: usize = 8;
const FILLED: usize = N.next_multiple_of(LANES);
/// Places between pixels in fixed point: a pixel is 2^16, of whose bits 11 are used to mix
/// brightness.
const PIXEL_BITS: u32 = 16;
const MIX_BITS: u32 = 11;
/// Pictures as wide as this no longer fit, px.
const WIDEST_PX: f32 = 32_000.0;
/// Standard deviation of the Gaussian weights, as a share of half the side.
const SIGMA: f32 = 0.6;
/// The search ends when a step is shorter than this, px, or after so many; no step is longer than
/// that, px.
const CLOSE_PX: f32 = 0.03;
const STEPS: usize = 12;
const LONGEST_STEP_PX: f32 = 1.5;
/// Variance of brightness below which there is nothing to be recognised.
const LEAST_VARIANCE: f32 = 1.0;

/// Takes offsets in a patch to offsets in the picture.
pub type Warp = Matrix2<f32>;
/// No turning, no bending.
pub const UPRIGHT: Warp = Matrix2::new(1.0, 0.0, 0.0, 1.0);

/// What a point looked like when it was detected, made ready to be compared with it.
pub struct Patch {
    /// Brightness with zero mean and unit variance under the weights, times the weights.
    values: [f32; FILLED],
    /// Its slopes along u and v less their means, times the weights.
    slopes: [[f32; FILLED]; 2],
    /// Weighted sum of its slopes times brightness.
    at_home: Vector2<f32>,
    /// Inverse of the weighted sum of products of slopes: xx, xy, yy.
    inverse: [f32; 3],
}

/// Where a patch was found.
#[derive(Clone, Copy, Debug)]
pub struct Match {
    pub at_px: Point2<f32>,
    /// Normalised cross-correlation under the weights there, and where the search began; -1 to 1.
    pub ncc: f32,
    pub ncc_at_start: f32,
    pub converged: bool,
}

/// Cuts out and finds patches.
pub struct Registration {
    /// Sum 1.
    weights: [f32; FILLED],
}

impl Default for Registration {
    fn default() -> Self {
        let sigma_px = SIGMA * HALF_PX as f32;
        let mut weights = [0.0; FILLED];
        for (w, offset) in weights.iter_mut().zip(offsets()) {
            *w = (-offset.norm_squared() / (2.0 * sigma_px * sigma_px)).exp();
        }
        let sum: f32 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
        Self { weights }
    }
}

impl Registration {
    /// The patch around `at` (px).
    pub fn patch(&self, luma: &Luma, at: Point2<f32>) -> Patch {
        let (mut values, mut slopes) = ([0.0; FILLED], [[0.0; FILLED]; 2]);
        sample(luma, at, &UPRIGHT, &mut values);
        self.remove_mean(&mut values);
        let scale = scale(self.mean(&values.map(|v| v * v)));
        values.iter_mut().for_each(|v| *v *= scale);
        for (k, offset) in offsets().enumerate() {
            let at = at + offset;
            let half = 0.5 * scale;
            slopes[0][k] =
                half * (bilinear(luma, at.x + 1.0, at.y) - bilinear(luma, at.x - 1.0, at.y));
            slopes[1][k] =
                half * (bilinear(luma, at.x, at.y + 1.0) - bilinear(luma, at.x, at.y - 1.0));
        }
        // Brightness is compared less its mean, so that its slopes count less their means, too.
        for slopes in &mut slopes {
            self.remove_mean(slopes);
        }
        let [x, y] = &slopes;
        let xx = self.product(x, x) + 1e-4;
        let xy = self.product(x, y);
        let yy = self.product(y, y) + 1e-4;
        let determinant = (xx * yy - xy * xy).max(1e-8);
        let at_home = Vector2::new(self.product(x, &values), self.product(y, &values));
        for of in [&mut values].into_iter().chain(&mut slopes) {
            of.iter_mut().zip(&self.weights).for_each(|(v, w)| *v *= w);
        }
        Patch {
            values,
            slopes,
            at_home,
            inverse: [yy / determinant, -xy / determinant, xx / determinant],
        }
    }

    /// Weighted mean.
    fn mean(&self, of: &[f32; FILLED]) -> f32 {
        self.weights.iter().zip(of).map(|(w, v)| w * v).sum()
    }

    fn remove_mean(&self, of: &mut [f32; FILLED]) {
        let mean = self.mean(of);
        of[..N].iter_mut().for_each(|v| *v -= mean);
    }

    /// Weighted scalar product.
    fn product(&self, a: &[f32; FILLED], b: &[f32; FILLED]) -> f32 {
        let pairs = self.weights.iter().zip(a).zip(b);
        pairs.map(|((w, a), b)| w * a * b).sum()
    }

    /// Normalised cross-correlation of `patch` and the picture around `at`, -1 to 1.
    pub fn ncc(&self, patch: &Patch, luma: &Luma, at: Point2<f32>, warp: &Warp) -> f32 {
        let mut values = [0.0; FILLED];
        sample(luma, at, warp, &mut values);
        self.compare(patch, &values).0
    }

    /// Looks for `patch` in `luma` from `start` (px) on.
    pub fn find(&self, patch: &Patch, luma: &Luma, start: Point2<f32>, warp: &Warp) -> Match {
        let mut values = [0.0; FILLED];
        let mut found = Match {
            at_px: start,
            ncc: 0.0,
            ncc_at_start: 0.0,
            converged: false,
        };
        for k in 0..STEPS {
            sample(luma, found.at_px, warp, &mut values);
            let (ncc, right) = self.compare(patch, &values);
            found.ncc = ncc;
            if k == 0 {
                found.ncc_at_start = ncc;
            }
            let [xx, xy, yy] = patch.inverse;
            let mut step = warp * (Matrix2::new(xx, xy, xy, yy) * right);
            let length = step.norm();
            if length > LONGEST_STEP_PX {
                step = step * LONGEST_STEP_PX / length;
            }
            found.at_px += step;
            if length < CLOSE_PX {
                found.converged = true;
                break;
            }
        }
        found
    }

    /// Correlation of patch and `values`, and the weighted sum of the patch's slopes times what it
    /// is brighter by, both at zero mean and unit variance. Patch and slopes have no mean, so that
    /// those of `values` need not be taken out first: all sums come from one pass.
    fn compare(&self, patch: &Patch, values: &[f32; FILLED]) -> (f32, Vector2<f32>) {
        // From a value near the mean, or the variance would be lost in the digits.
        let near = values[N / 2];
        let mut sums = [[0.0f32; LANES]; 5];
        for k in (0..FILLED).step_by(LANES) {
            let (w, v) = (lanes(&self.weights, k), lanes(values, k).map(|v| v - near));
            let (p, x, y) = (
                lanes(&patch.values, k),
                lanes(&patch.slopes[0], k),
                lanes(&patch.slopes[1], k),
            );
            for l in 0..LANES {
                let weighted = w[l] * v[l];
                sums[0][l] += weighted;
                sums[1][l] += weighted * v[l];
                sums[2][l] += p[l] * v[l];
                sums[3][l] += x[l] * v[l];
                sums[4][l] += y[l] * v[l];
            }
        }
        let [mean, square, alike, x, y] = sums.map(|s| s.iter().sum::<f32>());
        let scale = scale(square - mean * mean);
        (scale * alike, patch.at_home - scale * Vector2::new(x, y))
    }
}

/// The values from number `k` on.
#[inline]
fn lanes(of: &[f32; FILLED], k: usize) -> [f32; LANES] {
    std::array::from_fn(|l| of[k + l])
}

/// What brings brightness to unit variance; 0 where there is no texture: that is like nothing.
fn scale(variance: f32) -> f32 {
    if variance < LEAST_VARIANCE {
        0.0
    } else {
        1.0 / variance.sqrt()
    }
}

/// Offsets of a patch's pixels from its middle, row by row.
fn offsets() -> impl Iterator<Item = Vector2<f32>> {
    (-HALF_PX..=HALF_PX)
        .flat_map(|y| (-HALF_PX..=HALF_PX).map(move |x| Vector2::new(x as f32, y as f32)))
}

/// Brightness of the picture under the patch's pixels.
fn sample(luma: &Luma, at: Point2<f32>, warp: &Warp, into: &mut [f32; FILLED]) {
    if lies_inside(luma, at, warp) {
        sample_inside(luma, at, warp, into);
        return;
    }
    for (value, offset) in into.iter_mut().zip(offsets()) {
        let to = at + warp.column(0) * offset.x + warp.column(1) * offset.y;
        *value = bilinear(luma, to.x, to.y);
    }
}

/// Whether the whole patch lies within the picture, and fixed point holds its places.
fn lies_inside(luma: &Luma, at: Point2<f32>, warp: &Warp) -> bool {
    let size = Vector2::new(luma.size.width as f32, luma.size.height as f32);
    let half = HALF_PX as f32;
    let inside = [0, 1].map(|c| {
        let reach = half * (warp[(c, 0)].abs() + warp[(c, 1)].abs());
        // Rounding may put the outermost a hair farther out.
        at[c] - reach >= 1.0 && at[c] + reach < (size[c] - 2.0).min(WIDEST_PX)
    });
    inside == [true; 2]
}

/// [`sample`] of a patch that lies inside the picture, in fixed point.
fn sample_inside(luma: &Luma, at: Point2<f32>, warp: &Warp, into: &mut [f32; FILLED]) {
    let half = HALF_PX as f32;
    let step = [0, 1].map(|c| to_fixed(warp[(c, 0)]));
    let width = luma.size.width as usize;
    for (row, y) in into[..N].chunks_exact_mut(SIDE).zip(-HALF_PX..=HALF_PX) {
        let first = at + warp.column(1) * y as f32 - warp.column(0) * half;
        let (mut u, mut v) = (to_fixed(first.x), to_fixed(first.y));
        for value in row {
            let upper = (v >> PIXEL_BITS) as usize * width + (u >> PIXEL_BITS) as usize;
            let (Some(above), Some(below)) = (
                pixel_pair(&luma.pixels, upper),
                pixel_pair(&luma.pixels, upper + width),
            ) else {
                continue;
            };
            let (a, b) = (mix_bits(u), mix_bits(v));
            let [above, below] = [above, below].map(|p| {
                let [left, right] = p.map(i32::from);
                (left << MIX_BITS) + a * (right - left)
            });
            *value = ((above << MIX_BITS) + b * (below - above)) as f32
                * (1.0 / (1 << (2 * MIX_BITS)) as f32);
            (u, v) = (u + step[0], v + step[1]);
        }
    }
}

/// A place, px, in fixed point.
#[inline]
fn to_fixed(px: f32) -> i32 {
    (px * (1 << PIXEL_BITS) as f32) as i32
}

/// The bits of a place between two pixels that brightness is mixed by.
#[inline]
fn mix_bits(place: i32) -> i32 {
    (place >> (PIXEL_BITS - MIX_BITS)) & ((1 << MIX_BITS) - 1)
}

/// A pixel and the next one.
#[inline]
fn pixel_pair(pixels: &[u8], at: usize) -> Option<&[u8; 2]> {
    pixels.get(at..)?.first_chunk()
}

/// Brightness between pixels; beyond the edge the edge goes on.
pub(super) fn bilinear(luma: &Luma, u_px: f32, v_px: f32) -> f32 {
    let (w, h) = (luma.size.width as i32, luma.size.height as i32);
    let u = u_px.clamp(0.0, (w - 1) as f32);
    let v = v_px.clamp(0.0, (h - 1) as f32);
    let (u0, v0) = (u as i32, v as i32);
    let (u1, v1) = ((u0 + 1).min(w - 1), (v0 + 1).min(h - 1));
    let (fu, fv) = (u - u0 as f32, v - v0 as f32);
    let [upper, lower] = [v0, v1].map(|row| {
        let [left, right] = [u0, u1].map(|u| f32::from(luma.pixels[(row * w + u) as usize]));
        left * (1.0 - fu) + right * fu
    });
    upper * (1.0 - fv) + lower * fv
}

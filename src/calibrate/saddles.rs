//! Where four squares of a chessboard meet: saddle points of the brightness.
//!
//! They are maxima of minus the determinant of its second derivatives, and their place is that of the
//! saddle of a quadratic surface (Lucchese & Mitra 2002, "Using saddle points for subpixel feature
//! detection in camera calibration targets").

use crate::model::Luma;
use nalgebra::{Matrix2, Matrix6, Point2, Vector2, Vector6};
use std::f64::consts::PI;

/// Standard deviation of the blur, px, in pictures so high and lower; larger in proportion in higher
/// ones, whose edges are less sharp.
const BLUR_PX: f64 = 1.5;
const BLUR_HEIGHT_PX: f64 = 720.0;
/// Saddles are no nearer to each other than so many standard deviations, and the surface is fitted as
/// far to each side.
const APART_SIGMAS: f64 = 2.0;
/// Rounds of fitting the surface about its own saddle.
const ROUNDS: usize = 4;
/// A saddle has this share of the strength of the weakest one that a board needs, if all of its corners
/// are the strongest of the picture.
const LEAST_STRENGTH: f32 = 0.1;

/// A saddle point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Saddle {
    pub at_px: Point2<f64>,
    strength: f32,
    /// Directions of the four edges that meet there, one after the other with y downwards, radians. From
    /// the first to the second the square is bright, from there to the third dark, and so on.
    pub edges_rad: [f64; 4],
}

/// The saddles of a picture that may be the `corners` corners of a board, or four times as many.
pub(super) fn saddles(luma: &Luma, corners: usize) -> Vec<Saddle> {
    let sigma = BLUR_PX * (f64::from(luma.size.height) / BLUR_HEIGHT_PX).max(1.0);
    let surface = Surface::of(luma, sigma);
    let reach = (APART_SIGMAS * sigma).ceil() as usize;
    let mut peaks = surface.peaks(reach);
    peaks.sort_by(|a, b| b.strength.total_cmp(&a.strength));
    let weakest = peaks
        .get(corners.saturating_sub(1))
        .map_or(0.0, |p| p.strength);
    peaks.retain(|p| p.strength >= LEAST_STRENGTH * weakest);
    peaks.truncate(4 * corners);
    let refined = peaks.iter().filter_map(|p| surface.refined(p, reach));
    refined.collect()
}

/// A place with the strongest response about it.
struct Peak {
    x: usize,
    y: usize,
    strength: f32,
}

/// A blurred picture.
struct Surface {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Surface {
    fn of(luma: &Luma, sigma: f64) -> Self {
        let (width, height) = (luma.size.width as usize, luma.size.height as usize);
        let values: Vec<f32> = luma.pixels.iter().map(|p| f32::from(*p)).collect();
        let kernel = gaussian(sigma);
        let mut surface = Self {
            width,
            height,
            values,
        };
        surface.blur_rows(&kernel);
        surface.transpose();
        surface.blur_rows(&kernel);
        surface.transpose();
        surface
    }

    fn blur_rows(&mut self, kernel: &[f32]) {
        let reach = kernel.len() / 2;
        let mut padded = vec![0.0; self.width + 2 * reach];
        for row in self.values.chunks_exact_mut(self.width) {
            padded[reach..reach + row.len()].copy_from_slice(row);
            padded[..reach].fill(row[0]);
            padded[reach + row.len()..].fill(row[row.len() - 1]);
            for (value, around) in row.iter_mut().zip(padded.windows(kernel.len())) {
                *value = around.iter().zip(kernel).map(|(a, k)| a * k).sum();
            }
        }
    }

    fn transpose(&mut self) {
        let mut turned = Vec::with_capacity(self.values.len());
        for x in 0..self.width {
            turned.extend((0..self.height).map(|y| self.values[y * self.width + x]));
        }
        self.values = turned;
        (self.width, self.height) = (self.height, self.width);
    }

    fn at(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.width + x]
    }

    /// Minus the determinant of the second derivatives at a place off the border.
    fn response(&self, x: usize, y: usize) -> f32 {
        let here = 2.0 * self.at(x, y);
        let xx = self.at(x + 1, y) + self.at(x - 1, y) - here;
        let yy = self.at(x, y + 1) + self.at(x, y - 1) - here;
        let falling = self.at(x + 1, y + 1) + self.at(x - 1, y - 1);
        let rising = self.at(x + 1, y - 1) + self.at(x - 1, y + 1);
        let xy = 0.25 * (falling - rising);
        xy * xy - xx * yy
    }

    /// The places with the largest response within `reach`, where it is more than none.
    fn peaks(&self, reach: usize) -> Vec<Peak> {
        let (width, height) = (self.width, self.height);
        let mut response = vec![0.0; width * height];
        for y in 1..height.saturating_sub(1) {
            for x in 1..width - 1 {
                response[y * width + x] = self.response(x, y);
            }
        }
        let mut peaks = Vec::new();
        for y in reach + 1..height.saturating_sub(reach + 1) {
            for x in reach + 1..width.saturating_sub(reach + 1) {
                let strength = response[y * width + x];
                // Less than a change of one grey level is noise.
                if strength <= 1.0 {
                    continue;
                }
                let mut rows = y - reach..=y + reach;
                let is_peak = rows.all(|row| {
                    let around = &response[row * width + x - reach..=row * width + x + reach];
                    around.iter().all(|other| *other <= strength)
                });
                if is_peak {
                    peaks.push(Peak { x, y, strength });
                }
            }
        }
        peaks
    }

    /// The saddle of the quadratic surface about a peak; `None` where there is none near it.
    fn refined(&self, peak: &Peak, reach: usize) -> Option<Saddle> {
        let (mut x, mut y) = (peak.x, peak.y);
        for _ in 0..ROUNDS {
            let quadratic = self.quadratic(x, y, reach);
            let off = quadratic.saddle()?;
            if off.amax() <= 0.5 + 1e-9 {
                return quadratic.saddle_at(Point2::new(x as f64, y as f64), off, peak.strength);
            }
            let [to_x, to_y] = [x as f64 + off.x, y as f64 + off.y].map(f64::round);
            let moved = (to_x - peak.x as f64)
                .abs()
                .max((to_y - peak.y as f64).abs());
            if moved.is_nan() || moved > reach as f64 || !self.holds(to_x, to_y, reach) {
                return None;
            }
            (x, y) = (to_x as usize, to_y as usize);
        }
        None
    }

    /// Whether a square of this reach lies in the picture.
    fn holds(&self, x: f64, y: f64, reach: usize) -> bool {
        let reach = reach as f64;
        let [width, height] = [self.width, self.height].map(|side| side as f64 - 1.0);
        x >= reach && y >= reach && x + reach <= width && y + reach <= height
    }

    /// The surface of least squares in a square of this reach.
    fn quadratic(&self, x: usize, y: usize, reach: usize) -> Quadratic {
        let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for row in y - reach..=y + reach {
            for column in x - reach..=x + reach {
                let (u, v) = (column as f64 - x as f64, row as f64 - y as f64);
                let terms = Vector6::new(u * u, u * v, v * v, u, v, 1.0);
                normal += terms * terms.transpose();
                right += terms * f64::from(self.at(column, row));
            }
        }
        let fitted = normal.cholesky().map(|c| c.solve(&right));
        Quadratic(fitted.unwrap_or_default())
    }
}

/// A surface by its coefficients of u^2, u v, v^2, u, v and 1.
struct Quadratic(Vector6<f64>);

impl Quadratic {
    fn hessian(&self) -> Matrix2<f64> {
        let c = &self.0;
        Matrix2::new(2.0 * c[0], c[1], c[1], 2.0 * c[2])
    }

    /// Where its slope is none, if that is a saddle.
    fn saddle(&self) -> Option<Vector2<f64>> {
        let hessian = self.hessian();
        if hessian.determinant() >= 0.0 {
            return None;
        }
        let slope = Vector2::new(self.0[3], self.0[4]);
        hessian.try_inverse().map(|inverse| -inverse * slope)
    }

    /// The saddle `off` from a place: along its edges the surface is neither above nor below it.
    fn saddle_at(&self, at: Point2<f64>, off: Vector2<f64>, strength: f32) -> Option<Saddle> {
        let hessian = self.hessian();
        let mean = 0.5 * hessian.trace();
        let (cos, sin) = (0.5 * (hessian[(0, 0)] - hessian[(1, 1)]), hessian[(0, 1)]);
        let size = cos.hypot(sin);
        // In the direction a it curves by mean + size cos(2a - bright).
        let bright = sin.atan2(cos);
        let half = (-mean / size).clamp(-1.0, 1.0).acos();
        let first = 0.5 * (bright - half);
        let second = 0.5 * (bright + half);
        let is_edges = (second - first) > 1e-3 && (second - first) < PI - 1e-3;
        is_edges.then_some(Saddle {
            at_px: at + off,
            strength,
            edges_rad: [first, second, first + PI, second + PI],
        })
    }
}

/// Weights of a blur, their sum 1.
fn gaussian(sigma: f64) -> Vec<f32> {
    let reach = (3.0 * sigma).ceil() as i32;
    let weights: Vec<f64> = (-reach..=reach)
        .map(|k| (-0.5 * (f64::from(k) / sigma).powi(2)).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| (w / sum) as f32).collect()
}

//! Likelihood of modes that wind drives, in the few directions that their shapes span.
//!
//! The motions' expected spectral matrix at one frequency is E = S F Fᴴ Sᵀ + σ² I: S has the modes'
//! shapes in its columns, F is what the gusts move of each mode, σ² is the power of the noise. With
//! S = Q R and Q orthonormal, E = Q (A Aᴴ + σ² I) Qᵀ + σ² (I - Q Qᵀ), where A = R F. So the matrix to
//! be factored is as large as there are modes, not motions (Au 2012). All is in units of the noise:
//! σ = 1 below.

use super::decay::Mode;
use super::driven_modes::{MOTIONS, Observed, Parameters, force_at};
use crate::signal::ln_product::LnProduct;
use crate::signal::qr::Qr;
use nalgebra::{Complex, DVector, SMatrix, SVector};
use std::array::from_fn;

type Square<const M: usize> = SMatrix<Complex<f64>, M, M>;
type Sizes<const M: usize> = SVector<Complex<f64>, M>;

/// Response of a mode's displacement to a force, in that to a steady one, with its derivatives by
/// the logarithms of frequency and damping ratio.
struct Response {
    value: Complex<f64>,
    by_ln_frequency: Complex<f64>,
    by_ln_damping: Complex<f64>,
}

impl Response {
    fn of(mode: &Mode, frequency_hz: f64) -> Self {
        let ratio = frequency_hz / mode.frequency_hz;
        let damped = Complex::new(0.0, 2.0 * mode.damping * ratio);
        let value = (Complex::from(1.0 - ratio * ratio) + damped).inv();
        let square = value * value;
        Self {
            value,
            by_ln_frequency: square * (damped - 2.0 * ratio * ratio),
            by_ln_damping: -square * damped,
        }
    }
}

/// M modes, and the coefficients that they are to explain.
pub(super) struct Spanned<'a, const M: usize> {
    observed: &'a Observed,
    modes: [Mode; M],
    /// Q: directions of length 1 among the motions.
    directions: SMatrix<f64, MOTIONS, M>,
    /// R: the modes' shapes along these, in the columns.
    shapes: SMatrix<f64, M, M>,
    lengths: [f64; M],
    /// The lower triangle of a factor of the forces' spectral matrix.
    forces: Square<M>,
    /// Root of the power of the noise.
    noise: f64,
}

/// What is expected at one frequency.
struct Expected<const M: usize> {
    responses: [Response; M],
    /// Root of the power of the gusts.
    gust: f64,
    /// F: what each part of the forces does to each mode.
    driven: Square<M>,
    /// A: what each part of the forces does along each direction.
    moved: Square<M>,
    factored: Factored<M>,
    /// What was seen along the directions, and the square of what was seen across all of them.
    along: Sizes<M>,
    across: f64,
}

/// A Aᴴ + I = L D Lᴴ.
struct Factored<const M: usize> {
    /// L, without its diagonal of ones.
    lower: Square<M>,
    /// D.
    pivots: [f64; M],
}

impl<const M: usize> Factored<M> {
    /// `None` where the numbers have grown beyond all bounds.
    fn of(moved: &Square<M>) -> Option<Self> {
        let mut lower = Square::zeros();
        let mut pivots = [0.0; M];
        for column in 0..M {
            for row in column..M {
                let mut sum = Complex::from(if row == column { 1.0 } else { 0.0 });
                for part in 0..M {
                    sum += moved[(row, part)] * moved[(column, part)].conj();
                }
                for before in 0..column {
                    let other: Complex<f64> = lower[(column, before)];
                    sum -= lower[(row, before)] * other.conj() * pivots[before];
                }
                if row == column {
                    pivots[column] = sum.re;
                } else {
                    lower[(row, column)] = sum / pivots[column];
                }
            }
            if !(pivots[column] > 0.0 && pivots[column].is_finite()) {
                return None;
            }
        }
        Some(Self { lower, pivots })
    }

    /// L⁻¹ `sizes`.
    fn solve_lower(&self, sizes: &Sizes<M>) -> Sizes<M> {
        let mut out = *sizes;
        for row in 1..M {
            for before in 0..row {
                let taken = self.lower[(row, before)] * out[before];
                out[row] -= taken;
            }
        }
        out
    }

    /// (L D Lᴴ)⁻¹ `sizes`.
    fn solve(&self, sizes: &Sizes<M>) -> Sizes<M> {
        let mut out = self.solve_lower(sizes);
        for row in (0..M).rev() {
            out[row] /= self.pivots[row];
            for after in row + 1..M {
                let taken = self.lower[(after, row)].conj() * out[after];
                out[row] -= taken;
            }
        }
        out
    }
}

impl<'a, const M: usize> Spanned<'a, M> {
    pub fn of(observed: &'a Observed, parameters: &Parameters) -> Self {
        let columns: [Vec<f64>; M] = from_fn(|m| parameters.shape(m).as_slice().to_vec());
        let qr = Qr::new(columns.to_vec());
        let mut forces = Square::zeros();
        for row in 0..M {
            for column in 0..=row {
                forces[(row, column)] = parameters.force(row, column);
            }
        }
        Self {
            observed,
            modes: from_fn(|m| parameters.mode(m)),
            directions: SMatrix::from_fn(|i, m| qr.q[m][i]),
            shapes: SMatrix::from_columns(&columns.map(|c| SVector::from_vec(qr.products(&c)))),
            lengths: from_fn(|m| parameters.length(m)),
            forces,
            noise: parameters.noise.sqrt(),
        }
    }

    fn expected(&self, k: usize) -> Option<Expected<M>> {
        let gust = self.observed.gusts[k] / self.noise;
        let frequency_hz = self.observed.frequencies_hz[k];
        let responses = from_fn(|m| Response::of(&self.modes[m], frequency_hz));
        let (mut driven, mut moved) = (Square::<M>::zeros(), Square::<M>::zeros());
        for part in 0..M {
            for mode in part..M {
                let by = responses[mode].value * self.forces[(mode, part)] * gust;
                driven[(mode, part)] = by;
                for direction in 0..=mode {
                    moved[(direction, part)] += by * self.shapes[(direction, mode)];
                }
            }
        }
        let coefficient = &self.observed.coefficients[k];
        let mut along = Sizes::<M>::zeros();
        for (size, direction) in along.iter_mut().zip(self.directions.column_iter()) {
            for (c, d) in coefficient.iter().zip(direction.iter()) {
                *size += c * *d;
            }
        }
        let across = (coefficient.norm_squared() - along.norm_squared()).max(0.0);
        Some(Expected {
            gust,
            factored: Factored::of(&moved)?,
            responses,
            driven,
            moved,
            along: along / Complex::from(self.noise),
            across: across / (self.noise * self.noise),
        })
    }

    /// Minus the logarithm of the likelihood; infinite where there is none.
    pub fn value(&self) -> f64 {
        let mut cost = 2.0 * self.observed.values() * self.noise.ln();
        let mut determinant = LnProduct::one();
        for k in 0..self.observed.coefficients.len() {
            let Some(expected) = self.expected(k) else {
                return f64::INFINITY;
            };
            let white = expected.factored.solve_lower(&expected.along);
            cost += expected.across;
            for (size, pivot) in white.iter().zip(&expected.factored.pivots) {
                cost += size.norm_sqr() / pivot;
                determinant.times(*pivot);
            }
        }
        cost + determinant.ln()
    }

    /// Adds the derivatives of the value by the parameters; no numbers where there is no likelihood.
    pub fn add_slopes(&self, slopes: &mut DVector<f64>) {
        let mut by_shapes = ByShapes {
            along: SMatrix::zeros(),
            across: SMatrix::zeros(),
        };
        for k in 0..self.observed.coefficients.len() {
            let Some(expected) = self.expected(k) else {
                slopes.fill(f64::NAN);
                return;
            };
            self.add_slopes_at(k, &expected, slopes, &mut by_shapes);
        }
        let across = by_shapes.across;
        let across = across - self.directions * (self.directions.transpose() * across);
        let by_shapes = self.directions * by_shapes.along + across;
        for mode in 0..M {
            // Along itself a shape changes nothing: its length is 1.
            let shape = self.directions * self.shapes.column(mode);
            let by_shape = by_shapes.column(mode);
            let turned = (by_shape - shape * shape.dot(&by_shape)) / self.lengths[mode];
            let at = 2 * M + mode * MOTIONS;
            slopes.rows_mut(at, MOTIONS).copy_from(&turned);
        }
    }

    /// Adds those of one frequency. With z what was seen and G = E⁻¹ - E⁻¹zzᴴE⁻¹, a change dE changes
    /// the value by tr(G dE).
    fn add_slopes_at(
        &self,
        k: usize,
        expected: &Expected<M>,
        slopes: &mut DVector<f64>,
        by_shapes: &mut ByShapes<M>,
    ) {
        let first_force = M * (2 + MOTIONS);
        let noise = slopes.len() - 1;
        let white = expected.factored.solve(&expected.along);
        slopes[noise] += MOTIONS as f64 - white.norm_squared() - expected.across;
        // By each mode, for what was seen across the directions.
        let mut by_modes = Sizes::<M>::zeros();
        for part in 0..M {
            let moved: Sizes<M> = expected.moved.column(part).into_owned();
            let solved = expected.factored.solve(&moved);
            slopes[noise] -= moved.dotc(&solved).re;
            // G times what this part of the forces moves is this along the directions, and across
            // them minus `seen` times what was seen there.
            let seen = white.dotc(&moved);
            let by_moved = (solved - white * seen).conjugate();
            for mode in part..M {
                let response = &expected.responses[mode];
                let driven = expected.driven[(mode, part)];
                let mut on_shape = Complex::from(0.0);
                for direction in 0..M {
                    on_shape += by_moved[direction] * self.shapes[(direction, mode)];
                    by_shapes.along[(direction, mode)] += 2.0 * (driven * by_moved[direction]).re;
                }
                by_modes[mode] += driven * seen.conj();
                let by_response = 2.0 * on_shape * self.forces[(mode, part)] * expected.gust;
                slopes[mode] += (by_response * response.by_ln_frequency).re;
                slopes[M + mode] += (by_response * response.by_ln_damping).re;
                let by_force = 2.0 * on_shape * response.value * expected.gust;
                if mode == part {
                    slopes[first_force + mode] += by_force.re;
                } else {
                    let at = first_force + force_at(M, mode, part);
                    slopes[at] += by_force.re;
                    slopes[at + 1] -= by_force.im;
                }
            }
        }
        for (mode, by) in by_modes.iter().enumerate() {
            let by = by * (2.0 / self.noise);
            let seen = self.observed.coefficients[k].iter();
            for (sum, seen) in by_shapes.across.column_mut(mode).iter_mut().zip(seen) {
                *sum -= seen.re * by.re + seen.im * by.im;
            }
        }
    }
}

/// Derivatives by the modes' shapes, in the columns.
struct ByShapes<const M: usize> {
    /// Along each direction.
    along: SMatrix<f64, M, M>,
    /// Among the motions; what of it is along the directions does not count.
    across: SMatrix<f64, MOTIONS, M>,
}

//! Variable projection: least squares of columns that depend on a few parameters, with factors that
//! are free in every signal.
//!
//! The factors come from a linear fit inside the nonlinear one (Golub and Pereyra 1973), with
//! Kaufman's Jacobian (1975): slopes of the columns, without what the columns span of them, times
//! factors. Products of columns with signals are all that is needed; the Jacobian itself is never
//! made.

use super::gram::GramCholesky;
use super::least_squares::NormalEquations;
use super::principal::symmetric;
use super::vectors::{dot, slices};
use nalgebra::DMatrix;

/// The columns of a fit, and how they change with its parameters.
#[derive(Default)]
pub struct Basis {
    pub columns: Vec<Vec<f64>>,
    pub slopes: Vec<Slope>,
}

/// How one column changes with one parameter.
pub struct Slope {
    pub parameter: usize,
    pub column: usize,
    pub values: Vec<f64>,
}

impl Basis {
    /// The columns, then their slopes.
    pub fn columns_and_slopes(&self) -> Vec<&[f64]> {
        let mut all = slices(&self.columns);
        all.extend(self.slopes.iter().map(|s| s.values.as_slice()));
        all
    }
}

/// What columns explain of one signal.
pub struct Explained {
    /// Products of all columns with the signal.
    pub products: Vec<f64>,
    /// Of the columns that were factored.
    pub factors: Vec<f64>,
    /// Squares that are left.
    pub left: f64,
}

impl Explained {
    /// Of `y` by the first of `columns`, as many as `factored` holds; the products are had of all.
    pub fn new(y: &[f64], columns: &[&[f64]], factored: &GramCholesky) -> Self {
        let products: Vec<f64> = columns.iter().map(|c| dot(c, y)).collect();
        let factors = factored.solve(&products);
        let left = (dot(y, y) - dot(&products[..factors.len()], &factors)).max(0.0);
        Self {
            products,
            factors,
            left,
        }
    }
}

/// A signal that is fitted, 0 where it was not seen, and what each of its squares counts.
#[derive(Clone, Copy)]
pub struct Weighted<'a> {
    pub values: &'a [f64],
    pub weight: f64,
}

impl NormalEquations {
    /// Adds the share of signals that were seen in the same frames: `gram` holds the products of
    /// the basis' columns and slopes there. Returns the squares that are left, weighted.
    pub fn add_signals<'a>(
        &mut self,
        basis: &Basis,
        gram: &DMatrix<f64>,
        signals: impl Iterator<Item = Weighted<'a>>,
    ) -> f64 {
        let n = basis.columns.len();
        let all = basis.columns_and_slopes();
        let factored = GramCholesky::new(gram, n);
        let mut left = 0.0;
        let mut explained: Vec<(Explained, f64)> = Vec::new();
        for signal in signals {
            let of = Explained::new(signal.values, &all, &factored);
            left += signal.weight * of.left;
            explained.push((of, signal.weight));
        }
        let factor_products = symmetric(n, |a, b| {
            let mut sum = 0.0;
            for (e, weight) in &explained {
                sum += weight * e.factors[a] * e.factors[b];
            }
            sum
        });
        for (s, slope) in basis.slopes.iter().enumerate() {
            let on_columns: Vec<f64> = (0..n).map(|c| gram[(c, n + s)]).collect();
            let spanned = factored.solve(&on_columns);
            for (t, other) in basis.slopes.iter().enumerate() {
                let both: f64 = (0..n).map(|c| spanned[c] * gram[(c, n + t)]).sum();
                self.hessian[(slope.parameter, other.parameter)] +=
                    (gram[(n + s, n + t)] - both) * factor_products[(slope.column, other.column)];
            }
            for (e, weight) in &explained {
                let unspanned = e.products[n + s] - dot(&on_columns, &e.factors);
                self.gradient[slope.parameter] += weight * e.factors[slope.column] * unspanned;
            }
        }
        left
    }
}

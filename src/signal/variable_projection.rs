//! Variable projection: least squares of columns that depend on a few parameters, with factors that
//! are free in every signal.
//!
//! The factors come from a linear fit inside the nonlinear one (Golub and Pereyra 1973), with
//! Kaufman's Jacobian (1975): slopes of the columns, without what the columns span of them, times
//! factors. Products of columns with signals are all that is needed; the Jacobian itself is never
//! made.

use super::gram::{GramCholesky, products, side_by_side};
use super::least_squares::NormalEquations;
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

/// Signals that were seen in the same frames.
pub struct SignalBlock {
    /// A column for each signal: its values in all frames, 0 where it was not seen.
    pub values: DMatrix<f64>,
    /// Sum of the squares of each.
    pub squares: Vec<f64>,
}

impl SignalBlock {
    /// Of signals of one length.
    pub fn new(signals: &[&[f64]]) -> Self {
        Self {
            values: side_by_side(signals),
            squares: signals.iter().map(|y| dot(y, y)).collect(),
        }
    }

    pub fn count(&self) -> usize {
        self.squares.len()
    }

    /// The signals one by one.
    pub fn each(&self) -> impl Iterator<Item = &[f64]> {
        let frames = self.values.nrows().max(1);
        self.values.as_slice().chunks_exact(frames)
    }
}

/// What columns explain of some signals.
pub struct Explained {
    /// Products of all columns, a row for each, with the signals.
    pub products: DMatrix<f64>,
    /// Of the columns that were factored, a row for each, in the signals.
    pub factors: DMatrix<f64>,
    /// Squares that are left of each signal.
    pub left: Vec<f64>,
}

impl Explained {
    /// Of `signals` by the first of `columns`, as many as `factored` holds; the products are had of
    /// all.
    pub fn new(signals: &SignalBlock, columns: &[&[f64]], factored: &GramCholesky) -> Self {
        let products = products(columns, &signals.values);
        let of_factored = products.rows(0, factored.columns()).into_owned();
        let factors = factored.solve_each(of_factored.clone());
        let mut left = Vec::with_capacity(signals.count());
        for (k, squares) in signals.squares.iter().enumerate() {
            let taken = of_factored.column(k).dot(&factors.column(k));
            left.push((squares - taken).max(0.0));
        }
        Self {
            products,
            factors,
            left,
        }
    }

    /// The factors of one signal after the other.
    pub fn factors_of_each(&self) -> impl Iterator<Item = &[f64]> {
        self.factors
            .as_slice()
            .chunks_exact(self.factors.nrows().max(1))
    }
}

impl NormalEquations {
    /// Adds the share of signals that were seen in the same frames, each square of which counts
    /// `weights`: `gram` holds the products of the basis' columns and slopes there. Returns the
    /// squares that are left, weighted.
    pub fn add_signals(
        &mut self,
        basis: &Basis,
        gram: &DMatrix<f64>,
        signals: &SignalBlock,
        weights: &[f64],
    ) -> f64 {
        let (n, slopes) = (basis.columns.len(), basis.slopes.len());
        let factored = GramCholesky::new(gram, n);
        let explained = Explained::new(signals, &basis.columns_and_slopes(), &factored);
        let factors = &explained.factors;
        let mut weighted = factors.clone();
        for (mut column, weight) in weighted.column_iter_mut().zip(weights) {
            column *= *weight;
        }
        let factor_products = &weighted * factors.transpose();
        let on_columns = gram.view((0, n), (n, slopes));
        let spanned = factored.solve_each(on_columns.into_owned());
        let unspanned = gram.view((n, n), (slopes, slopes)) - spanned.transpose() * on_columns;
        let rests = explained.products.rows(n, slopes) - on_columns.transpose() * factors;
        for (s, slope) in basis.slopes.iter().enumerate() {
            for (t, other) in basis.slopes.iter().enumerate() {
                self.hessian[(slope.parameter, other.parameter)] +=
                    unspanned[(s, t)] * factor_products[(slope.column, other.column)];
            }
            self.gradient[slope.parameter] += weighted.row(slope.column).dot(&rests.row(s));
        }
        let left = explained.left.iter().zip(weights);
        left.map(|(left, weight)| weight * left).sum()
    }
}

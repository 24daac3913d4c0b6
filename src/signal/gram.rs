//! Linear least squares by normal equations: what a few columns explain of many signals, from the
//! products of all with all.
//!
//! Signals that lack other frames than their neighbours do not need columns of their own: the
//! products over all frames are had once, and those over the frames that are lacking are taken off.
//!
//! Not nalgebra's Cholesky, which fails as a whole where a column depends on others: here that
//! column gets the factor 0. Where a matrix is definite, nalgebra's is used.

use super::principal::symmetric;
use super::vectors::dot;
use nalgebra::DMatrix;

/// Of a column whose square is less than this share of what it was before the others were taken off
/// nothing is left: the others span it.
const MIN_SQUARE_LEFT: f64 = 1e-10;

/// nalgebra multiplies matrices with no more rows or columns than this one vector at a time, which
/// takes longer than their products one by one.
const FEW: usize = 5;

/// Products of `columns` with each other.
pub fn gram(columns: &[&[f64]]) -> DMatrix<f64> {
    if columns.len() <= FEW {
        return symmetric(columns.len(), |i, k| dot(columns[i], columns[k]));
    }
    let matrix = side_by_side(columns);
    matrix.transpose() * &matrix
}

/// Products of `columns`, a row of them for each, with each column of `signals`.
pub fn products(columns: &[&[f64]], signals: &DMatrix<f64>) -> DMatrix<f64> {
    let (n, frames) = (columns.len(), signals.nrows());
    if n <= FEW || signals.ncols() <= FEW {
        let signals_of = signals.as_slice();
        return DMatrix::from_fn(n, signals.ncols(), |i, k| {
            dot(columns[i], &signals_of[k * frames..(k + 1) * frames])
        });
    }
    side_by_side(columns).transpose() * signals
}

/// Columns of one length as a matrix.
pub fn side_by_side(columns: &[&[f64]]) -> DMatrix<f64> {
    let rows = columns.first().map_or(0, |c| c.len());
    DMatrix::from_vec(rows, columns.len(), columns.concat())
}

/// The same without `rows`.
pub fn gram_without(all: &DMatrix<f64>, columns: &[&[f64]], rows: &[usize]) -> DMatrix<f64> {
    let mut out = all.clone();
    let n = columns.len();
    let mut lacking: Vec<Vec<f64>> = Vec::with_capacity(n);
    for column in columns {
        lacking.push(rows.iter().map(|&r| column[r]).collect());
    }
    for i in 0..n {
        for k in 0..=i {
            let product = out[(i, k)] - dot(&lacking[i], &lacking[k]);
            (out[(i, k)], out[(k, i)]) = (product, product);
        }
    }
    out
}

/// Products C = L Lᵀ of the first columns.
pub struct GramCholesky {
    l: DMatrix<f64>,
}

impl GramCholesky {
    /// Of the first `n` columns of `products`.
    pub fn new(products: &DMatrix<f64>, n: usize) -> Self {
        let mut l = DMatrix::<f64>::zeros(n, n);
        for k in 0..n {
            let left = products[(k, k)] - (0..k).map(|m| l[(k, m)] * l[(k, m)]).sum::<f64>();
            // A column that others span gets no factor: its part of L stays 0.
            if left.is_nan() || left <= MIN_SQUARE_LEFT * products[(k, k)] {
                continue;
            }
            l[(k, k)] = left.sqrt();
            for i in k + 1..n {
                let sum = products[(i, k)] - (0..k).map(|m| l[(i, m)] * l[(k, m)]).sum::<f64>();
                l[(i, k)] = sum / l[(k, k)];
            }
        }
        Self { l }
    }

    /// How many columns it is of.
    pub fn columns(&self) -> usize {
        self.l.nrows()
    }

    /// L⁻¹ x in place, of the columns that have factors; 0 for the others. Its squares are those that
    /// the columns explain of a signal whose products with them are `x`.
    pub fn forward(&self, x: &mut [f64]) {
        let (n, l) = (self.l.nrows(), &self.l);
        for k in 0..n {
            x[k] = if l[(k, k)] > 0.0 {
                (x[k] - (0..k).map(|m| l[(k, m)] * x[m]).sum::<f64>()) / l[(k, k)]
            } else {
                0.0
            };
        }
    }

    /// C⁻¹ x, of the columns that have factors; 0 for the others.
    pub fn solve(&self, x: &[f64]) -> Vec<f64> {
        let mut out = x[..self.l.nrows()].to_vec();
        self.solve_in_place(&mut out);
        out
    }

    /// C⁻¹ times each column of a matrix.
    pub fn solve_each(&self, mut columns: DMatrix<f64>) -> DMatrix<f64> {
        let n = self.l.nrows();
        for column in columns.as_mut_slice().chunks_exact_mut(n.max(1)) {
            self.solve_in_place(column);
        }
        columns
    }

    fn solve_in_place(&self, x: &mut [f64]) {
        let (n, l) = (self.l.nrows(), &self.l);
        self.forward(x);
        for k in (0..n).rev().filter(|&k| l[(k, k)] > 0.0) {
            x[k] = (x[k] - (k + 1..n).map(|m| l[(m, k)] * x[m]).sum::<f64>()) / l[(k, k)];
        }
    }

    /// Diagonal of C⁻¹: variances of the factors for noise of variance 1.
    pub fn variances(&self) -> Vec<f64> {
        let n = self.l.nrows();
        let mut unit = vec![0.0; n];
        let mut out = Vec::with_capacity(n);
        for k in 0..n {
            unit[k] = 1.0;
            out.push(self.solve(&unit)[k]);
            unit[k] = 0.0;
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_found_and_dependent_columns_get_none() {
        let (a, b) = (vec![1.0; 5], vec![0.0, 1.0, 2.0, 4.0, 9.0]);
        let twice: Vec<f64> = b.iter().map(|x| 2.0 * x).collect();
        let columns = [a.as_slice(), &b, &twice];
        // The last frame is lacking, and what stands there must not count.
        let y: Vec<f64> = b
            .iter()
            .map(|x| 3.0 - 0.5 * x)
            .take(4)
            .chain([0.0])
            .collect();
        let products = gram_without(&gram(&columns), &columns, &[4]);
        let by: Vec<f64> = columns.iter().map(|c| dot(c, &y)).collect();
        let factored = GramCholesky::new(&products, 3);
        let factors = factored.solve(&by);
        assert!(
            (factors[0] - 3.0).abs() < 1e-9 && (factors[1] + 0.5).abs() < 1e-9 && factors[2] == 0.0,
            "{factors:?}"
        );
        // Variance of a slope: 1 over the squares from the mean.
        let squares: f64 = b[..4].iter().map(|x| (x - 1.75) * (x - 1.75)).sum();
        assert!((factored.variances()[1] - 1.0 / squares).abs() < 1e-9);
    }
}

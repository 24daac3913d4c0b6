//! What further columns would explain of what a fit has left: the step of a greedy search.

use super::gram::{GramCholesky, gram, side_by_side};
use super::qr::Qr;
use super::vectors::{dot, slices};
use nalgebra::DMatrix;

/// A new column that keeps less than this share of its length, when the present ones are taken off,
/// adds nothing that could be told from them.
const MIN_LENGTH_LEFT: f64 = 0.02;

/// New columns that are tried beside the present ones of a fit, as many at a time.
pub struct Candidates {
    /// A row for each column, those of one candidate after the other.
    rows: DMatrix<f64>,
    /// Columns of a candidate.
    each: usize,
    /// Products of the columns of each candidate with each other.
    own: Vec<DMatrix<f64>>,
}

impl Candidates {
    /// Each is as many columns of `frames` values as the others.
    pub fn new(candidates: impl IntoIterator<Item = Vec<Vec<f64>>>, frames: usize) -> Self {
        let (mut values, mut own) = (Vec::new(), Vec::new());
        for candidate in candidates {
            own.push(gram(&slices(&candidate)));
            values.extend(candidate.into_iter().flatten());
        }
        let each = own.first().map_or(0, DMatrix::nrows);
        Self {
            rows: DMatrix::from_vec(frames, each * own.len(), values).transpose(),
            each,
            own,
        }
    }

    /// Squares that each candidate, a row for each, takes off what a fit of the columns `present` has
    /// left of each signal; 0 by what adds nothing that could be told from the present ones.
    pub fn explained(&self, present: &Qr, left: &DMatrix<f64>) -> DMatrix<f64> {
        let q = side_by_side(&slices(&present.q));
        let on_present = &self.rows * &q;
        // Not 0 where a signal has gaps.
        let rest = left - &q * (q.transpose() * left);
        let mut products = &self.rows * rest;
        let mut factored = Vec::with_capacity(self.own.len());
        for (k, own) in self.own.iter().enumerate() {
            let on_present = on_present.rows(k * self.each, self.each);
            factored.push(factor_without(own, &on_present.into_owned()));
        }
        let mut out = DMatrix::zeros(self.own.len(), left.ncols());
        let each_product = products.as_mut_slice().chunks_exact_mut(self.each.max(1));
        for (k, (of_candidate, out)) in each_product.zip(out.as_mut_slice()).enumerate() {
            factored[k % self.own.len()].forward(of_candidate);
            *out = dot(of_candidate, of_candidate);
        }
        out
    }
}

/// The products of the columns of a candidate without what the present ones span of them.
fn factor_without(own: &DMatrix<f64>, on_present: &DMatrix<f64>) -> GramCholesky {
    let mut products = own - on_present * on_present.transpose();
    for k in 0..own.nrows() {
        if products[(k, k)] <= MIN_LENGTH_LEFT * MIN_LENGTH_LEFT * own[(k, k)] {
            products.row_mut(k).fill(0.0);
            products.column_mut(k).fill(0.0);
        }
    }
    GramCholesky::new(&products, own.nrows())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_new_in_a_column_counts() {
        let present = Qr::new(vec![vec![1.0; 4]]);
        let signal = [5.0, 3.0, 5.0, 3.0];
        let left = DMatrix::from_vec(4, 1, present.solve(&signal).0);
        let one = [
            (vec![1.0, -1.0, 1.0, -1.0], 4.0),
            // A constant beside it adds nothing.
            (vec![3.0, 1.0, 3.0, 1.0], 4.0),
            (vec![2.0; 4], 0.0),
        ];
        let two = [
            (vec![vec![2.0; 4], vec![3.0, 1.0, 3.0, 1.0]], 4.0),
            (
                vec![vec![1.0, 1.0, 0.0, 0.0], vec![1.0, -1.0, 0.0, 0.0]],
                2.0,
            ),
        ];
        for candidates in [
            Vec::from(one.map(|(c, wanted)| (vec![c], wanted))),
            two.into(),
        ] {
            let (columns, wanted): (Vec<_>, Vec<f64>) = candidates.into_iter().unzip();
            let found = Candidates::new(columns, 4).explained(&present, &left);
            let off = found - DMatrix::from_vec(wanted.len(), 1, wanted);
            assert!(off.amax() < 1e-12, "off by {off}");
        }
    }

    /// What the present columns explain where a signal was seen is not what they explain of it as a
    /// whole.
    #[test]
    fn present_columns_are_taken_off_a_signal_with_a_gap() {
        let present = Qr::new(vec![vec![1.0; 4]]);
        let left = DMatrix::from_vec(4, 1, vec![1.0, -1.0, 2.0, 0.0]);
        let columns = vec![vec![vec![1.0, 0.0, 0.0, 0.0]]];
        let found = Candidates::new(columns, 4).explained(&present, &left)[(0, 0)];
        // (1 - 0.5)^2 / (1 - 0.25).
        assert!((found - 1.0 / 3.0).abs() < 1e-12, "{found}");
    }
}

//! What further columns would explain of what a fit has left: the step of a greedy search.

use super::gram::GramCholesky;
use super::principal::symmetric;
use super::qr::Qr;
use super::vectors::dot;

/// A new column that keeps less than this share of its length, when the present ones are taken off,
/// adds nothing that could be told from them.
const MIN_LENGTH_LEFT: f64 = 0.02;

/// What a fit has left of a signal.
pub struct Residual {
    values: Vec<f64>,
    /// Products with the present orthonormal columns: not all 0 where the signal has gaps.
    on_present: Vec<f64>,
}

/// New columns beside the present ones of a fit.
pub struct Extension<'a> {
    columns: &'a [Vec<f64>],
    /// Of each column: products with the present orthonormal columns.
    on_present: Vec<Vec<f64>>,
    factored: GramCholesky,
}

impl Residual {
    /// `values` are what a fit of the columns `present` has left.
    pub fn new(values: Vec<f64>, present: &Qr) -> Self {
        let on_present = present.products(&values);
        Self { values, on_present }
    }
}

impl<'a> Extension<'a> {
    /// Of the columns `present` by `columns`.
    pub fn new(columns: &'a [Vec<f64>], present: &Qr) -> Self {
        let n = columns.len();
        let on_present: Vec<Vec<f64>> = columns.iter().map(|c| present.products(c)).collect();
        let mut products = symmetric(n, |a, b| {
            dot(&columns[a], &columns[b]) - dot(&on_present[a], &on_present[b])
        });
        for (k, column) in columns.iter().enumerate() {
            let before = dot(column, column);
            if products[(k, k)] <= MIN_LENGTH_LEFT * MIN_LENGTH_LEFT * before {
                products.row_mut(k).fill(0.0);
                products.column_mut(k).fill(0.0);
            }
        }
        Self {
            columns,
            on_present,
            factored: GramCholesky::new(&products, n),
        }
    }

    /// Squares that the new columns take off a residual.
    pub fn explained(&self, residual: &Residual) -> f64 {
        let mut products = Vec::with_capacity(self.columns.len());
        for (column, on_present) in self.columns.iter().zip(&self.on_present) {
            products.push(dot(&residual.values, column) - dot(&residual.on_present, on_present));
        }
        self.factored.explained(&products)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_new_in_a_column_counts() {
        let present = Qr::new(vec![vec![1.0; 4]]);
        let signal = [5.0, 3.0, 5.0, 3.0];
        let residual = Residual::new(present.solve(&signal).0, &present);
        let cases = [
            (vec![vec![1.0, -1.0, 1.0, -1.0]], 4.0),
            // A constant beside it adds nothing.
            (vec![vec![3.0, 1.0, 3.0, 1.0]], 4.0),
            (vec![vec![2.0; 4]], 0.0),
            (vec![vec![2.0; 4], vec![3.0, 1.0, 3.0, 1.0]], 4.0),
        ];
        for (columns, wanted) in cases {
            let found = Extension::new(&columns, &present).explained(&residual);
            assert!((found - wanted).abs() < 1e-12, "{found}, not {wanted}");
        }
    }
}

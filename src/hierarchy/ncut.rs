//! The two-way normalised cut (Shi and Malik 2000; Zeng 2015 eq. 2.21-2.24).

use super::lanczos::second_eigenvector;
use nalgebra::{DMatrix, DVector};

/// A cut of a graph in two.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// For each vertex whether it is on the first side.
    pub first_side: Vec<bool>,
    /// Ncut(A, B) of Zeng 2015 eq. 2.22: 0 for parts without any tie, at most 2.
    pub ncut: f64,
}

/// The best threshold cut along the second eigenvector of D^-1/2 W D^-1/2 in which each side keeps
/// at least `min_side` vertices; `None` if there are too few. `w` is symmetric with positive
/// weights off the diagonal.
pub fn normalised_cut(w: &DMatrix<f32>, min_side: usize) -> Option<Cut> {
    let n = w.nrows();
    if n < 2 * min_side.max(1) {
        return None;
    }
    let degree = DVector::from_fn(n, |i, _| w.row(i).iter().sum::<f32>() - w[(i, i)]);
    if degree.iter().any(|&d| d <= 0.0 || d.is_nan()) {
        return None;
    }
    let root = degree.map(f32::sqrt);
    let scaled = DMatrix::from_fn(n, n, |i, j| {
        if i == j {
            0.0
        } else {
            w[(i, j)] / (root[i] * root[j])
        }
    });
    let fiedler = second_eigenvector(&scaled, &root).component_div(&root);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| fiedler[a].total_cmp(&fiedler[b]).then(a.cmp(&b)));

    // One sweep: moving a vertex over changes the cut by what it has left on its side less what it
    // joins.
    let total: f64 = degree.iter().map(|&d| f64::from(d)).sum();
    let (mut cut, mut volume) = (0.0f64, 0.0f64);
    let mut tie_to_first = vec![0.0f64; n];
    let (mut best, mut best_at) = (f64::INFINITY, 0);
    for (k, &i) in order.iter().enumerate() {
        cut += f64::from(degree[i]) - 2.0 * tie_to_first[i];
        volume += f64::from(degree[i]);
        for (j, tie) in tie_to_first.iter_mut().enumerate() {
            if j != i {
                *tie += f64::from(w[(i, j)]);
            }
        }
        let first = k + 1;
        if first >= min_side && n - first >= min_side {
            let ncut = cut / volume + cut / (total - volume);
            if ncut < best {
                (best, best_at) = (ncut, first);
            }
        }
    }
    let mut first_side = vec![false; n];
    for &i in &order[..best_at] {
        first_side[i] = true;
    }
    (best_at > 0).then_some(Cut {
        first_side,
        ncut: best,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two groups with weak ties between them must come apart whole, however unequal they are.
    #[test]
    fn weakly_tied_groups_are_separated() {
        for (n, split) in [(10, 5), (40, 8), (100, 63)] {
            let group: Vec<bool> = (0..n).map(|i| (i * 7 % n) < split).collect();
            let w = DMatrix::from_fn(n, n, |i, j| if group[i] == group[j] { 1.0 } else { 0.02 });
            let cut = normalised_cut(&w, 2).unwrap();
            let same = (0..n).all(|i| cut.first_side[i] == group[i]);
            let swapped = (0..n).all(|i| cut.first_side[i] != group[i]);
            assert!(
                same || swapped,
                "{n} points, {split} in the first group: {:?}",
                cut.first_side
            );
        }
    }

    /// The sweep's running value must be Ncut by its definition, or the wrong threshold wins.
    #[test]
    fn ncut_value_is_the_definition() {
        let n = 12;
        let w = DMatrix::from_fn(n, n, |i, j| {
            if i == j {
                0.0
            } else {
                1.0 / (1.0 + (i as f32 - j as f32).abs())
            }
        });
        let cut = normalised_cut(&w, 2).unwrap();
        let (mut across, mut a, mut b) = (0.0, 0.0, 0.0);
        for i in 0..n {
            for j in 0..n {
                let x = f64::from(w[(i, j)]);
                across += if cut.first_side[i] && !cut.first_side[j] {
                    x
                } else {
                    0.0
                };
                *(if cut.first_side[i] { &mut a } else { &mut b }) += x;
            }
        }
        assert!((cut.ncut - (across / a + across / b)).abs() < 1e-6);
    }

    #[test]
    fn too_few_points_are_not_cut() {
        assert_eq!(normalised_cut(&DMatrix::from_element(3, 3, 1.0), 2), None);
        assert_eq!(normalised_cut(&DMatrix::zeros(0, 0), 2), None);
    }
}

//! Principal components: the few motions that many signals are made of.

use super::vectors::{add_scaled, dot};
use nalgebra::{DMatrix, Point2, SymmetricEigen, Vector2};

/// Directions in all signals at once, of length 1, and the variance along each, the largest first.
pub struct PrincipalComponents {
    pub variances: Vec<f64>,
    pub directions: Vec<Vec<f64>>,
}

impl PrincipalComponents {
    /// Of the products of all signals with all, which is a symmetric matrix; none of none.
    pub fn of_products(products: DMatrix<f64>) -> Self {
        let n = products.nrows();
        if n == 0 {
            return Self {
                variances: Vec::new(),
                directions: Vec::new(),
            };
        }
        let eigen = SymmetricEigen::new(products);
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let mut out = Self {
            variances: Vec::with_capacity(n),
            directions: Vec::with_capacity(n),
        };
        for i in order {
            out.variances.push(eigen.eigenvalues[i].max(0.0));
            out.directions
                .push(eigen.eigenvectors.column(i).iter().copied().collect());
        }
        out
    }

    /// Of `signals` without gaps, by their mean products.
    pub fn of_signals(signals: &[Vec<f64>]) -> Self {
        let frames = signals.first().map_or(1, Vec::len).max(1) as f64;
        Self::of_products(symmetric(signals.len(), |a, b| {
            dot(&signals[a], &signals[b]) / frames
        }))
    }
}

/// The symmetric matrix of a product of each two of `n`, which is asked for once a pair.
pub fn symmetric(n: usize, product: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(n, n);
    for a in 0..n {
        for b in 0..=a {
            let product = product(a, b);
            (out[(a, b)], out[(b, a)]) = (product, product);
        }
    }
    out
}

/// The motion of `signals` along a direction in all of them.
pub fn along(signals: &[Vec<f64>], direction: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; signals.first().map_or(0, Vec::len)];
    for (signal, weight) in signals.iter().zip(direction) {
        add_scaled(&mut out, *weight, signal);
    }
    out
}

/// Mean removed, projected on the direction of the largest variance.
///
/// Of two coordinates the direction has a closed form, and unlike an eigenvector always the same
/// sign: within a right angle of the first axis.
pub fn along_principal_direction(places: &[Point2<f64>]) -> Vec<f64> {
    let n = places.len() as f64;
    let mut mean = Point2::origin();
    for place in places {
        mean += place.coords / n;
    }
    let centred: Vec<Vector2<f64>> = places.iter().map(|p| p - mean).collect();
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for off in &centred {
        xx += off.x * off.x;
        xy += off.x * off.y;
        yy += off.y * off.y;
    }
    let (sin, cos) = (0.5 * (2.0 * xy).atan2(xx - yy)).sin_cos();
    centred
        .iter()
        .map(|off| cos * off.x + sin * off.y)
        .collect()
}

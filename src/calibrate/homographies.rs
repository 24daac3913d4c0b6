//! From a board to each of its pictures, and the focal lengths that all of them agree on.

use nalgebra::{DMatrix, Matrix3, Matrix5, Point2, Vector3, Vector5};

/// The homography that takes `from` to `to`, four or more; `None` where it is not known. By the direct
/// linear transform of normalised points (Hartley 1997).
pub(super) fn homography(from: &[Point2<f64>], to: &[Point2<f64>]) -> Option<Matrix3<f64>> {
    let [of_from, of_to] = [normalising(from)?, normalising(to)?];
    let mut rows = DMatrix::zeros(2 * from.len(), 9);
    for (k, (from, to)) in from.iter().zip(to).enumerate() {
        let [a, b] = [of_from * homogeneous(from), of_to * homogeneous(to)];
        for axis in 0..3 {
            rows[(2 * k, axis)] = a[axis];
            rows[(2 * k, 6 + axis)] = -b.x * a[axis];
            rows[(2 * k + 1, 3 + axis)] = a[axis];
            rows[(2 * k + 1, 6 + axis)] = -b.y * a[axis];
        }
    }
    let eigen = (rows.transpose() * rows).symmetric_eigen();
    let least = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let normal = Matrix3::from_row_iterator(least.iter().copied());
    let found = of_to.try_inverse()? * normal * of_from;
    found.iter().all(|x| x.is_finite()).then_some(found)
}

fn homogeneous(at: &Point2<f64>) -> Vector3<f64> {
    Vector3::new(at.x, at.y, 1.0)
}

/// Shifts points about the origin, at a mean distance of the square root of 2.
fn normalising(points: &[Point2<f64>]) -> Option<Matrix3<f64>> {
    let count = points.len() as f64;
    let middle = points
        .iter()
        .map(|p| p.coords)
        .sum::<nalgebra::Vector2<f64>>()
        / count;
    let far = points
        .iter()
        .map(|p| (p.coords - middle).norm())
        .sum::<f64>()
        / count;
    let scale = std::f64::consts::SQRT_2 / far;
    (count >= 4.0 && scale.is_finite()).then(|| {
        Matrix3::new(
            scale,
            0.0,
            -scale * middle.x,
            0.0,
            scale,
            -scale * middle.y,
            0.0,
            0.0,
            1.0,
        )
    })
}

/// The camera matrix, without skew, by homographies of a plane (Zhang 2000 sect. 3.1 and app. B); `None`
/// where they do not say it.
pub(super) fn camera_matrix(homographies: &[Matrix3<f64>]) -> Option<Matrix3<f64>> {
    let mut normal = Matrix5::zeros();
    for h in homographies {
        let unit = h / h.norm();
        let both = constraint(&unit, 0, 1);
        let difference = constraint(&unit, 0, 0) - constraint(&unit, 1, 1);
        normal += both * both.transpose() + difference * difference.transpose();
    }
    let eigen = normal.symmetric_eigen();
    let b = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let [b11, b22, b13, b23, b33] = [b[0], b[1], b[2], b[3], b[4]];
    let (cx, cy) = (-b13 / b11, -b23 / b22);
    let scale = b33 - b13 * b13 / b11 - b23 * b23 / b22;
    let (fx, fy) = ((scale / b11).sqrt(), (scale / b22).sqrt());
    let is_sound = [fx, fy, cx, cy].iter().all(|x| x.is_finite()) && fx > 0.0 && fy > 0.0;
    is_sound.then(|| Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0))
}

/// Zhang 2000 eq. 7 without skew: what columns i and j of a homography demand of B11, B22, B13, B23, B33.
fn constraint(h: &Matrix3<f64>, i: usize, j: usize) -> Vector5<f64> {
    let (a, b) = (h.column(i), h.column(j));
    Vector5::new(
        a[0] * b[0],
        a[1] * b[1],
        a[2] * b[0] + a[0] * b[2],
        a[2] * b[1] + a[1] * b[2],
        a[2] * b[2],
    )
}

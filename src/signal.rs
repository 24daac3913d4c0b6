//! Small mathematics of signals that several stages need.

use std::cmp::Ordering;

/// The middle of `values` by `order`, which must be total: of an even number the upper of the two;
/// `None` of none.
pub fn median<T: Copy>(mut values: Vec<T>, order: impl Fn(&T, &T) -> Ordering) -> Option<T> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, order).1)
}

/// Mean removed, projected on the direction of the largest variance.
pub fn along_principal_direction(d: &[[f64; 2]]) -> Vec<f64> {
    let n = d.len() as f64;
    let mean = d
        .iter()
        .fold([0.0; 2], |m, p| [m[0] + p[0] / n, m[1] + p[1] / n]);
    let centred = || d.iter().map(|p| [p[0] - mean[0], p[1] - mean[1]]);
    let (xx, xy, yy) = centred().fold((0.0, 0.0, 0.0), |s, p| {
        (s.0 + p[0] * p[0], s.1 + p[0] * p[1], s.2 + p[1] * p[1])
    });
    let (sin, cos) = (0.5 * (2.0 * xy).atan2(xx - yy)).sin_cos();
    centred().map(|p| cos * p[0] + sin * p[1]).collect()
}

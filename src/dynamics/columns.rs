//! Columns of numbers over the frames: the little linear algebra that fits of a few columns to many
//! signals need.

/// Columns shorter than this share of what they were before the others were taken off count as
/// none: the others span them.
const SPANNED: f64 = 1e-5;

/// Sum of the products. In lanes, or the order of the sum would keep the processor from doing
/// several at once.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    let (whole_a, whole_b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f64 = whole_a
        .remainder()
        .iter()
        .zip(whole_b.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in whole_a.zip(whole_b) {
        for ((sum, x), y) in sums.iter_mut().zip(x).zip(y) {
            *sum += x * y;
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// Takes from `x` what the orthonormal `q` span of it, twice for accuracy, and adds the shares to
/// `into`.
fn take_off(x: &mut [f64], q: &[Vec<f64>], into: &mut [f64]) {
    for _ in 0..2 {
        for (column, share) in q.iter().zip(into.iter_mut()) {
            let s = dot(x, column);
            x.iter_mut().zip(column).for_each(|(x, c)| *x -= s * c);
            *share += s;
        }
    }
}

/// Columns B = Q R with Q orthonormal.
pub(super) struct Qr {
    pub q: Vec<Vec<f64>>,
    /// Column k of R in `r[k]`; its k-th number is 0 where column k of B depends on those before
    /// it.
    r: Vec<Vec<f64>>,
}

impl Qr {
    pub fn new(columns: Vec<Vec<f64>>) -> Self {
        let (mut q, mut r): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
        for mut column in columns {
            let before = dot(&column, &column).sqrt();
            let mut shares = vec![0.0; q.len()];
            take_off(&mut column, &q, &mut shares);
            let norm = dot(&column, &column).sqrt();
            if norm > SPANNED * before && norm.is_finite() {
                column.iter_mut().for_each(|x| *x /= norm);
                shares.push(norm);
            } else {
                column.iter_mut().for_each(|x| *x = 0.0);
                shares.push(0.0);
            }
            q.push(column);
            r.push(shares);
        }
        Self { q, r }
    }

    /// What the columns leave of `y`, and the factors of the columns.
    pub fn solve(&self, y: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut rest, mut factors) = (y.to_vec(), vec![0.0; self.q.len()]);
        take_off(&mut rest, &self.q, &mut factors);
        self.back(&mut factors);
        (rest, factors)
    }

    /// R⁻¹ times `x`, in place; 0 for columns that depend on others.
    fn back(&self, x: &mut [f64]) {
        for k in (0..x.len()).rev() {
            let pivot = self.r[k][k];
            x[k] = if pivot > 0.0 { x[k] / pivot } else { 0.0 };
            for i in 0..k {
                x[i] -= self.r[k][i] * x[k];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_found_and_dependent_columns_get_none() {
        let (a, b) = (vec![1.0, 1.0, 1.0, 1.0], vec![0.0, 1.0, 2.0, 4.0]);
        let twice: Vec<f64> = b.iter().map(|x| 2.0 * x).collect();
        let y: Vec<f64> = b.iter().map(|x| 3.0 - 0.5 * x).collect();
        let (rest, factors) = Qr::new(vec![a, b, twice]).solve(&y);
        assert!(rest.iter().all(|r| r.abs() < 1e-12));
        assert!(
            (factors[0] - 3.0).abs() < 1e-12
                && (factors[1] + 0.5).abs() < 1e-12
                && factors[2] == 0.0
        );
    }
}

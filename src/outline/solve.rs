//! Conjugate gradients with an incomplete Cholesky factor, for matrices of bands over a picture.
//!
//! Own code, because no well-kept crate has an incomplete factor, and because bands need no table
//! of indices. A direct factor of such a matrix takes too much memory (docs/method.md has the
//! figures).

use super::laplacian::{Banded, steps_back};

/// The factor may fill pixels up to two rows and four columns before each: half the iterations of
/// the matrix's own bands.
const ROWS: usize = 2;
const COLUMNS: usize = 4;
const FILLED: usize = COLUMNS + ROWS * (2 * COLUMNS + 1);
/// The Laplacian has positive entries off its diagonal, and what the factor leaves out may leave
/// nothing positive: the diagonal is raised by this share first, by more where it must be.
const RAISED: f64 = 0.01;
const RAISED_MORE: f64 = 4.0;
/// By so large a share the matrix is its diagonal.
const RAISED_MOST: f64 = 1e4;
const MOST_ITERATIONS: usize = 500;
/// Narrower pictures have bands that fall together.
pub const LEAST_SIDE: usize = 2 * COLUMNS + 2;

/// Lower triangular, with `1 / diagonal` of each row, and its entries before it.
struct Factor {
    steps: [usize; FILLED],
    before: Vec<[f32; FILLED]>,
    inverse: Vec<f64>,
}

/// Improves `x` until the residual is at most `enough`, or as small as rounding lets it be;
/// positive definite matrices only. With a warning it stops where it was after so many iterations.
pub fn conjugate_gradients(
    matrix: &Banded,
    right: &[f64],
    x: &mut [f64],
    width: usize,
    enough: f64,
) {
    let mut raised = RAISED;
    let factor = loop {
        match Factor::of(matrix, width, raised) {
            Some(factor) => break factor,
            None if raised < RAISED_MOST => raised *= RAISED_MORE,
            None => {
                tracing::warn!("the scribbles cannot be solved; draw more strokes");
                return;
            }
        }
    };
    let n = x.len();
    let (mut product, mut corrected) = (vec![0.0; n], vec![0.0; n]);
    matrix.times(x, &mut product);
    let mut residual: Vec<f64> = right.iter().zip(&product).map(|(b, y)| b - y).collect();
    factor.solve(&residual, &mut corrected);
    let mut direction = corrected.clone();
    let mut gain = dot(&residual, &corrected);
    for _ in 0..MOST_ITERATIONS {
        if dot(&residual, &residual).sqrt() <= enough {
            return;
        }
        matrix.times(&direction, &mut product);
        let step = gain / dot(&direction, &product);
        if !step.is_finite() {
            return; // as near as rounding lets it come
        }
        for i in 0..n {
            x[i] += step * direction[i];
            residual[i] -= step * product[i];
        }
        factor.solve(&residual, &mut corrected);
        let next = dot(&residual, &corrected);
        let keep = next / gain;
        gain = next;
        direction
            .iter_mut()
            .zip(&corrected)
            .for_each(|(d, z)| *d = z + keep * *d);
    }
    let left = dot(&residual, &residual).sqrt();
    tracing::warn!(
        "the scribbles are not solved to the end: {MOST_ITERATIONS} steps leave {left:.1e} of \
         {enough:.1e}; look at the outline, and draw more strokes if it is wrong"
    );
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The band in which the entries `step` before the diagonal are.
fn band(steps: &[usize; FILLED], step: usize) -> Option<usize> {
    steps.iter().position(|&s| s == step)
}

impl Factor {
    /// Column after column, what falls outside the bands left out; `None` where a pivot is not
    /// positive.
    fn of(matrix: &Banded, width: usize, raised: f64) -> Option<Self> {
        let n = matrix.diagonal.len();
        let steps: [usize; FILLED] = steps_back(width, ROWS, COLUMNS);
        let mut before = vec![[0f32; FILLED]; n];
        for (k, &step) in matrix.steps.iter().enumerate() {
            let Some(own) = band(&steps, step) else {
                continue;
            };
            for (to, from) in before.iter_mut().zip(&matrix.before) {
                to[own] = from[k] as f32;
            }
        }
        // The column's entries p and q < p meet in row p; in this band of it, or in none.
        let mut met: [Vec<(usize, usize)>; FILLED] = std::array::from_fn(|_| Vec::new());
        for p in 0..FILLED {
            for q in 0..p {
                if let Some(to) = band(&steps, steps[p] - steps[q]) {
                    met[p].push((q, to));
                }
            }
        }
        let mut diagonal: Vec<f64> = matrix.diagonal.iter().map(|d| d * (1.0 + raised)).collect();
        let mut inverse = vec![0.0; n];
        let mut column = [0f32; FILLED];
        for i in 0..n {
            if diagonal[i].is_nan()
                || diagonal[i] <= 1e-3 * matrix.diagonal[i]
                || diagonal[i] <= 0.0
            {
                return None;
            }
            inverse[i] = 1.0 / diagonal[i].sqrt();
            for (p, &step) in steps
                .iter()
                .enumerate()
                .take_while(|(_, step)| i + **step < n)
            {
                let row = &mut before[i + step];
                let entry = (f64::from(row[p]) * inverse[i]) as f32;
                (row[p], column[p]) = (entry, entry);
                if entry == 0.0 {
                    continue;
                }
                diagonal[i + step] -= f64::from(entry) * f64::from(entry);
                for &(q, to) in &met[p] {
                    row[to] -= entry * column[q];
                }
            }
        }
        Some(Self {
            steps,
            before,
            inverse,
        })
    }

    /// `into` = inverse of (factor times its transpose) times `right`.
    fn solve(&self, right: &[f64], into: &mut [f64]) {
        let reach = self.steps[FILLED - 1];
        for (i, row) in self.before.iter().enumerate() {
            let mut sum = right[i];
            if i >= reach {
                // The nearest last: it is the one that has only just been computed.
                for (entry, step) in row.iter().zip(&self.steps).rev() {
                    sum -= f64::from(*entry) * into[i - step];
                }
            } else {
                for (entry, step) in row
                    .iter()
                    .zip(&self.steps)
                    .take_while(|(_, step)| **step <= i)
                {
                    sum -= f64::from(*entry) * into[i - step];
                }
            }
            into[i] = sum * self.inverse[i];
        }
        for (i, row) in self.before.iter().enumerate().rev() {
            let x = into[i] * self.inverse[i];
            into[i] = x;
            for (entry, step) in row
                .iter()
                .zip(&self.steps)
                .take_while(|(_, step)| **step <= i)
            {
                into[i - step] -= f64::from(*entry) * x;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::laplacian;
    use super::super::scribbles::Mark;
    use super::*;

    /// The solver must solve: against elimination by the textbook, on a picture of noise, where the
    /// Laplacian is at its most uneven.
    #[test]
    fn the_solution_is_that_of_a_direct_solver() {
        let (width, height) = (14, 11);
        let n = width * height;
        let colours: Vec<[f64; 3]> = (0..n)
            .map(|i| [0, 1, 2].map(|c| ((i * 7919 + c * 104_729 + 31) as f64 * 0.618_034).fract()))
            .collect();
        let mut marks = vec![Mark::Undecided; n];
        for (i, mark) in marks.iter_mut().enumerate() {
            match i % 37 {
                0 => *mark = Mark::Tree,
                5 => *mark = Mark::Background,
                _ => {}
            }
        }
        let mut matrix = laplacian::of(&colours, &marks, width);
        let right = matrix.decide(&marks);
        let mut full = nalgebra::DMatrix::<f64>::zeros(n, n);
        for i in 0..n {
            full[(i, i)] = matrix.diagonal[i];
            for (entry, step) in matrix.before[i]
                .iter()
                .zip(matrix.steps)
                .filter(|(_, step)| *step <= i)
            {
                (full[(i, i - step)], full[(i - step, i)]) = (*entry, *entry);
            }
        }
        let expected = full
            .lu()
            .solve(&nalgebra::DVector::from_column_slice(&right))
            .expect("solution");
        let mut x = vec![0.0; n];
        conjugate_gradients(&matrix, &right, &mut x, width, 1e-11);
        for (i, (x, y)) in x.iter().zip(expected.iter()).enumerate() {
            assert!((x - y).abs() < 1e-4, "pixel {i}: {x} is not {y}");
        }
    }
}

//! The matting Laplacian as a matrix of bands (Levin et al. 2008; Zeng 2015 eq. 2.4 and 2.6).

use super::scribbles::Mark;

/// Regularisation of the colour line in a window; that of PyMatting, for colours from 0 to 1.
const EPSILON: f64 = 1e-7;
/// Two pixels that share a window of 3x3 are at most two columns and two rows apart: so many come
/// before a pixel.
pub const NEIGHBOURS: usize = 12;
/// Pixels of a window.
const WINDOW: usize = 9;

/// A symmetric matrix over the pixels of a picture, of which row `i` holds its diagonal and the
/// columns `i - steps[k]`.
pub struct Banded {
    /// Ascending.
    pub steps: [usize; NEIGHBOURS],
    pub before: Vec<[f64; NEIGHBOURS]>,
    pub diagonal: Vec<f64>,
}

/// How far back in the order of rows the pixels lie that are at most `rows` rows and `columns`
/// columns away, ascending.
pub fn steps_back<const N: usize>(width: usize, rows: usize, columns: usize) -> [usize; N] {
    let mut steps = [0; N];
    let same_row = 1..=columns;
    let above = (1..=rows).flat_map(|row| (row * width - columns)..=(row * width + columns));
    steps
        .iter_mut()
        .zip(same_row.chain(above))
        .for_each(|(to, step)| *to = step);
    steps
}

/// The Laplacian of a picture of `width` columns, colours from 0 to 1. Windows without an undecided
/// pixel are left out: nothing depends on them.
pub fn of(colours: &[[f64; 3]], marks: &[Mark], width: usize) -> Banded {
    let n = colours.len();
    let steps: [usize; NEIGHBOURS] = steps_back(width, 2, 2);
    let mut matrix = Banded {
        steps,
        before: vec![[0.0; NEIGHBOURS]; n],
        diagonal: vec![0.0; n],
    };
    let place: [usize; WINDOW] = std::array::from_fn(|p| p / 3 * width + p % 3);
    // For the pixels p and q < p of a window the band that holds their entry.
    let mut bands = [[0; WINDOW]; WINDOW];
    for p in 0..WINDOW {
        for (q, earlier) in place[..p].iter().enumerate() {
            let band = steps.iter().position(|&s| s == place[p] - earlier);
            bands[p][q] = band.unwrap_or(0);
        }
    }
    for v in 0..n / width - 2 {
        for u in 0..width - 2 {
            let at = place.map(|p| v * width + u + p);
            if at.iter().all(|&i| marks[i] != Mark::Undecided) {
                continue;
            }
            let share = shares(&at.map(|i| colours[i]));
            for p in 0..WINDOW {
                for q in 0..p {
                    matrix.before[at[p]][bands[p][q]] -= share[p][q];
                }
                matrix.diagonal[at[p]] += 1.0 - share[p][p];
            }
        }
    }
    matrix
}

/// What is taken off the Kronecker delta in Zeng 2015 eq. 2.4, for the pairs of a window:
/// (1 + (I_i - mu)' C^-1 (I_j - mu)) / 9, with C the covariance of its colours plus epsilon / 9.
/// Only the lower triangle is filled.
fn shares(colours: &[[f64; 3]; WINDOW]) -> [[f64; WINDOW]; WINDOW] {
    let ninth = 1.0 / WINDOW as f64;
    let mean: [f64; 3] = std::array::from_fn(|c| colours.iter().map(|p| p[c]).sum::<f64>() * ninth);
    let off =
        colours.map(|p| nalgebra::Vector3::new(p[0] - mean[0], p[1] - mean[1], p[2] - mean[2]));
    let covariance = off
        .iter()
        .map(|d| d * d.transpose())
        .sum::<nalgebra::Matrix3<f64>>()
        * ninth;
    let regular = covariance + nalgebra::Matrix3::identity() * (EPSILON * ninth);
    let inverse = regular
        .try_inverse()
        .unwrap_or_else(nalgebra::Matrix3::zeros);
    let mut share = [[0.0; WINDOW]; WINDOW];
    for p in 0..WINDOW {
        let weighted = inverse * off[p];
        for q in 0..=p {
            share[p][q] = (1.0 + weighted.dot(&off[q])) * ninth;
        }
    }
    share
}

/// Opacity of a decided pixel; 0 for the others.
fn value(mark: Mark) -> f64 {
    f64::from(u8::from(mark == Mark::Tree))
}

impl Banded {
    /// Takes the decided pixels out of the unknowns: their rows become those of the identity, and
    /// what they say of the others goes to the right-hand side, which is returned.
    pub fn decide(&mut self, marks: &[Mark]) -> Vec<f64> {
        let mut right: Vec<f64> = marks.iter().map(|&m| value(m)).collect();
        for i in 0..marks.len() {
            for (entry, step) in self.before[i].iter_mut().zip(self.steps) {
                let Some(j) = i.checked_sub(step) else { break };
                match (marks[i] == Mark::Undecided, marks[j] == Mark::Undecided) {
                    (true, true) => continue,
                    (true, false) => right[i] -= *entry * value(marks[j]),
                    (false, true) => right[j] -= *entry * value(marks[i]),
                    (false, false) => {}
                }
                *entry = 0.0;
            }
            if marks[i] != Mark::Undecided {
                self.diagonal[i] = 1.0;
            }
        }
        right
    }

    /// `into` = matrix times `x`.
    pub fn times(&self, x: &[f64], into: &mut [f64]) {
        into.iter_mut()
            .zip(&self.diagonal)
            .zip(x)
            .for_each(|((y, d), x)| *y = d * x);
        let reach = self.steps[NEIGHBOURS - 1];
        for (i, row) in self.before.iter().enumerate() {
            let mut sum = 0.0;
            if i >= reach {
                for (entry, step) in row.iter().zip(self.steps) {
                    sum += entry * x[i - step];
                    into[i - step] += entry * x[i];
                }
            } else {
                for (entry, step) in row
                    .iter()
                    .zip(self.steps)
                    .take_while(|(_, step)| *step <= i)
                {
                    sum += entry * x[i - step];
                    into[i - step] += entry * x[i];
                }
            }
            into[i] += sum;
        }
    }
}

//! Leaves in a film, by their green.

use super::blurred;
use crate::signal::statistics::otsu;
use opencv::core::{Mat, Vec3b};
use opencv::prelude::*;

/// Light that is added to a pixel's before its share of green is taken: dark pixels count as grey.
const DARK: f32 = 30.0;
/// No leaf is less green than this, see [`greenness`].
const GREEN: f64 = 125.0;

/// Which pixels are leaves.
pub(super) struct Leaves {
    pub is_leaf: Vec<bool>,
    /// Their share of what moves with the tree.
    pub share: f64,
}

impl Leaves {
    /// The greener of two groups of pixels (Otsu), as far as it is green.
    pub fn of(rest: &Mat, moves: &[bool]) -> opencv::Result<Self> {
        let evened = blurred(rest, 1.0)?;
        let pixels = evened.data_typed::<Vec3b>()?;
        let green: Vec<u8> = pixels.iter().map(greenness).collect();
        let least = f64::from(otsu(&histogram(&green, moves))).max(GREEN);
        let is_leaf: Vec<bool> = green.iter().map(|g| f64::from(*g) > least).collect();
        let n_moving = moves.iter().filter(|moves| **moves).count();
        let n_leaf = is_leaf
            .iter()
            .zip(moves)
            .filter(|(l, m)| **l && **m)
            .count();
        Ok(Self {
            is_leaf,
            share: n_leaf as f64 / n_moving.max(1) as f64,
        })
    }
}

/// How much green exceeds the mean of red and blue, 100 where it does not, 200 more for all of the
/// light.
fn greenness(pixel: &Vec3b) -> u8 {
    let [blue, green, red] = pixel.0.map(f32::from);
    let share = (2.0 * green - red - blue) / (red + green + blue + DARK);
    (100.0 + 200.0 * share).clamp(0.0, 255.0) as u8
}

/// How often each value occurs where something moves.
pub(super) fn histogram(values: &[u8], moves: &[bool]) -> [u32; 256] {
    let mut histogram = [0; 256];
    for (value, _) in values.iter().zip(moves).filter(|(_, moves)| **moves) {
        histogram[usize::from(*value)] += 1;
    }
    histogram
}

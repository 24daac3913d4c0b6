//! The colours of a part of a picture, counted in bins: what mixtures are learned from. As all pixels
//! count, a line that is drawn a little otherwise changes what is learned but little.

use crate::model::Rgb;
use nalgebra::{Matrix3, Vector3};

/// Grey levels of each channel that are one bin; moments within a bin are kept, so that this is no
/// limit to how narrow a mixture's parts are.
const BIN_LEVELS: usize = 8;
const BINS: usize = 256 / BIN_LEVELS;

/// Like colours (red, green, blue; 0 to 255): how many, their sum, and the sum of their squares.
#[derive(Clone, Debug, Default)]
pub struct Bin {
    pub count: f64,
    pub sum: Vector3<f64>,
    pub squares: Matrix3<f64>,
}

impl Bin {
    fn of(colour: Vector3<f64>) -> Self {
        Self {
            count: 1.0,
            sum: colour,
            squares: colour * colour.transpose(),
        }
    }

    pub fn mean(&self) -> Vector3<f64> {
        self.sum / self.count
    }

    pub fn covariance(&self) -> Matrix3<f64> {
        let mean = self.mean();
        self.squares / self.count - mean * mean.transpose()
    }

    /// Adds `share` of another one.
    pub fn add(&mut self, other: &Self, share: f64) {
        self.count += share * other.count;
        self.sum += share * other.sum;
        self.squares += share * other.squares;
    }
}

/// Counted colours.
#[derive(Clone, Debug)]
pub struct Colours {
    /// None of them is empty.
    pub bins: Vec<Bin>,
}

impl Colours {
    /// Those of the pixels that `is_wanted` holds for.
    pub fn of(picture: &Rgb, is_wanted: impl Fn(usize) -> bool) -> Self {
        let wanted = (0..picture.size.area()).filter(|i| is_wanted(*i));
        Self::counted(wanted.map(|i| colour_at(picture, i)))
    }

    pub fn counted(colours: impl Iterator<Item = Vector3<f64>>) -> Self {
        let mut bins = vec![Bin::default(); BINS.pow(3)];
        for colour in colours {
            let [red, green, blue] = [colour.x, colour.y, colour.z].map(bin_along);
            bins[(red * BINS + green) * BINS + blue].add(&Bin::of(colour), 1.0);
        }
        bins.retain(|bin| bin.count > 0.0);
        Self { bins }
    }

    pub fn count(&self) -> f64 {
        self.bins.iter().map(|bin| bin.count).sum()
    }
}

/// The bin of a value along a channel.
fn bin_along(value: f64) -> usize {
    (value as usize / BIN_LEVELS).min(BINS - 1)
}

/// The colour of a pixel, red first, 0 to 255.
pub fn colour_at(picture: &Rgb, i: usize) -> Vector3<f64> {
    Vector3::from_fn(|channel, _| f64::from(picture.pixels[3 * i + channel]))
}

//! Colours of wood and of all else, as mixtures of normal distributions (Tan et al. 2008
//! sect. 2.1), which OpenCV learns from pixels that are known.

use nalgebra::{Matrix3, Vector3};
use opencv::core::{Mat, Rect, Vec3b};
use opencv::imgproc::{GC_BGD, GC_FGD, GC_INIT_WITH_MASK, grab_cut};
use opencv::prelude::*;

/// Normal distributions of a mixture of OpenCV's.
const PARTS: usize = 5;
/// What one has: its weight, its mean, and its covariance, row by row; those of all follow upon
/// each other.
const MEANS: usize = PARTS;
const COVARIANCES: usize = MEANS + 3 * PARTS;
const NUMBERS: usize = COVARIANCES + 9 * PARTS;
/// Variance that is added to every colour, grey levels squared: they are whole numbers.
const ROUNDING: f64 = 1.0 / 12.0;
/// Fewer pixels than this make no mixture.
const LEAST_SEEDS: usize = 64;
/// Least density that is believed: a colour that was never seen.
const LEAST_DENSITY: f64 = 1e-30;

/// What is known of a pixel before its colour is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seed {
    Wood,
    Other,
    Unknown,
}

/// How wood is coloured, and all else.
pub struct Mixtures {
    wood: Mixture,
    other: Mixture,
}

impl Mixtures {
    /// Those of the seeds; `None` where wood or the rest has too few.
    ///
    /// # Errors
    /// OpenCV fails.
    pub fn of(pixels: &[Vec3b], seeds: &[Seed]) -> opencv::Result<Option<Self>> {
        let mut known = Vec::new();
        let mut labels = Vec::new();
        for (pixel, seed) in pixels.iter().zip(seeds) {
            let label = match seed {
                Seed::Wood => GC_FGD,
                Seed::Other => GC_BGD,
                Seed::Unknown => continue,
            };
            known.push(*pixel);
            labels.push(label as u8);
        }
        let n_wood = seeds.iter().filter(|seed| **seed == Seed::Wood).count();
        if n_wood < LEAST_SEEDS || known.len() - n_wood < LEAST_SEEDS {
            return Ok(None);
        }
        let (mut wood, mut other) = (Mat::default(), Mat::default());
        opencv::core::set_rng_seed(0)?;
        // Learned only: the cut is our own.
        grab_cut(
            &Mat::from_slice(&known)?,
            &mut Mat::from_slice(&labels)?.clone_pointee(),
            Rect::default(),
            &mut other,
            &mut wood,
            0,
            GC_INIT_WITH_MASK,
        )?;
        let wood = Mixture::of(wood.data_typed()?);
        let other = Mixture::of(other.data_typed()?);
        Ok(Some(Self { wood, other }))
    }

    /// The odds that a pixel of this colour is wood, as a logarithm, if wood is as frequent as all
    /// else.
    pub fn odds_of_wood(&self, pixel: &Vec3b) -> f64 {
        let colour = Vector3::from(pixel.0.map(f64::from));
        (self.wood.density(&colour) / self.other.density(&colour)).ln()
    }
}

/// A mixture of normal distributions.
struct Mixture {
    parts: Vec<Normal>,
}

/// A normal distribution and its share of a mixture.
struct Normal {
    /// Its share by the density at its mean, without the factor that all have.
    height: f64,
    mean: Vector3<f64>,
    precision: Matrix3<f64>,
}

impl Mixture {
    /// One of OpenCV's, whose numbers these are.
    fn of(numbers: &[f64]) -> Self {
        let mut parts = Vec::with_capacity(PARTS);
        if numbers.len() < NUMBERS {
            return Self { parts };
        }
        for k in 0..PARTS {
            let mean = Vector3::from_column_slice(&numbers[MEANS + 3 * k..][..3]);
            let covariance = Matrix3::from_row_slice(&numbers[COVARIANCES + 9 * k..][..9]);
            let covariance = covariance + ROUNDING * Matrix3::identity();
            let Some(precision) = covariance.try_inverse() else {
                continue;
            };
            parts.push(Normal {
                height: numbers[k] / covariance.determinant().max(f64::MIN_POSITIVE).sqrt(),
                mean,
                precision,
            });
        }
        Self { parts }
    }

    /// Without the factor that all mixtures have.
    fn density(&self, colour: &Vector3<f64>) -> f64 {
        let mut density = LEAST_DENSITY;
        for part in self.parts.iter().filter(|part| part.height > 0.0) {
            let off = colour - part.mean;
            density += part.height * (-0.5 * off.dot(&(part.precision * off))).exp();
        }
        density
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_speak_for_what_they_were_seen_in() {
        let (mut pixels, mut seeds) = (Vec::new(), Vec::new());
        for k in 0..300_u16 {
            let rough = (k * 7 % 23) as u8;
            pixels.push(Vec3b::from([70 + rough, 90 + rough / 2, 110 + rough]));
            seeds.push(Seed::Wood);
            pixels.push(Vec3b::from([200 + rough, 190 + rough, 180 + rough / 3]));
            seeds.push(Seed::Other);
            pixels.push(Vec3b::from([0, 255, 0]));
            seeds.push(Seed::Unknown);
        }
        let mixtures = Mixtures::of(&pixels, &seeds).expect("opencv").expect("two");
        let odds = |colour: [u8; 3]| mixtures.odds_of_wood(&Vec3b::from(colour));
        assert!(odds([80, 95, 120]) > 5.0 && odds([210, 200, 183]) < -5.0);
        // Never seen at all.
        assert!(odds([0, 255, 0]).abs() < 1e-6);
        let few = Mixtures::of(&pixels[..60], &seeds[..60]).expect("opencv");
        assert!(few.is_none());
    }
}

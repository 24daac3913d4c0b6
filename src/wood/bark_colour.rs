//! Where the trunk and its limbs are, by the colours of the low trunk.

use super::joined::{Parts, wide};
use super::leaves::Leaves;
use super::mask::{STILL, TREE, colour};
use super::part::Part;
use crate::model::Size;
use nalgebra::{Matrix3, Vector3};
use opencv::core::{Mat, Vec3b};
use opencv::prelude::*;

/// Bark has the colours of the low trunk within so many deviations, to which such a share of the
/// picture's contrast is added for other light.
const BARK_DEVIATIONS: f64 = 3.0;
const BARK_NOISE: f64 = 0.2;
/// Bark in the shade of the crown is darker than that of the low trunk by no more than this factor.
const SHADE: f64 = 0.5;
/// A colour is the trunk's if it is so many times as frequent there as beside it.
const TRUNK_COLOUR: f64 = 2.0;
/// Fewer pixels than this show no colour of bark.
const LEAST_BARK: usize = 64;

/// Which pixels have the colours of the low trunk, are no leaves and rather move than stand still,
/// as far as they are joined to some that surely move (hysteresis, Canny 1986); none where the
/// trunk is not seen.
pub(super) fn limbs(
    rest: &Mat,
    tree: &[f32],
    leaves: &Leaves,
    is_trunk: &[bool],
    size: Size,
) -> opencv::Result<Vec<bool>> {
    let pixels = rest.data_typed::<Vec3b>()?;
    let Some(bark) = BarkColour::of(pixels, is_trunk, BARK_NOISE * contrast(pixels)) else {
        return Ok(vec![false; pixels.len()]);
    };
    let mut mask = Vec::with_capacity(pixels.len());
    for (i, pixel) in pixels.iter().enumerate() {
        let is_bark = bark.is_like(pixel) && !leaves.is_leaf[i];
        mask.push(u8::from(is_trunk[i] || is_bark && tree[i] > -STILL));
    }
    let wide: Vec<u8> = wide(&mask, size)?.into_iter().map(u8::from).collect();
    let parts = Parts::of(&wide, size, 8)?;
    let mut is_sure = vec![false; parts.count];
    for (i, part) in parts.of_pixel.iter().enumerate() {
        is_sure[*part] |= is_trunk[i] || tree[i] > TREE;
    }
    is_sure[Parts::OUTSIDE] = false;
    Ok(parts.of_pixel.iter().map(|part| is_sure[*part]).collect())
}

/// The colour of bark, as a normal distribution.
struct BarkColour {
    mean: Vector3<f64>,
    precision: Matrix3<f64>,
}

impl BarkColour {
    /// That of the pixels on the trunk; `None` where there are too few.
    fn of(pixels: &[Vec3b], is_trunk: &[bool], noise: f64) -> Option<Self> {
        let mut colours = Vec::new();
        for (pixel, _) in pixels.iter().zip(is_trunk).filter(|(_, on)| **on) {
            colours.push(colour(pixel));
        }
        if colours.len() < LEAST_BARK {
            return None;
        }
        let count = colours.len() as f64;
        let mean = colours.iter().sum::<Vector3<f64>>() / count;
        let mut covariance = noise.powi(2) * Matrix3::identity();
        for colour in &colours {
            let off = colour - mean;
            covariance += off * off.transpose() / count;
        }
        let precision = covariance.try_inverse()?;
        Some(Self { mean, precision })
    }

    /// Whether a pixel has the colour of bark, in the light or in the shade.
    fn is_like(&self, pixel: &Vec3b) -> bool {
        let colour = colour(pixel);
        let light = colour.dot(&self.mean) / self.mean.norm_squared().max(f64::MIN_POSITIVE);
        let off = colour - light.clamp(SHADE, 1.0) * self.mean;
        off.dot(&(self.precision * off)) <= BARK_DEVIATIONS.powi(2)
    }
}

/// Deviation of a picture's colours from their mean, grey levels.
fn contrast(pixels: &[Vec3b]) -> f64 {
    let mut sum = Vector3::zeros();
    let mut squares = 0.0;
    for pixel in pixels {
        sum += colour(pixel);
        squares += colour(pixel).norm_squared();
    }
    let count = pixels.len().max(1) as f64;
    let variance = squares / count - (sum / count).norm_squared();
    // Of one component.
    (variance / 3.0).max(0.0).sqrt()
}

/// The pixels of `low` whose colours are found there much more often than beside it, and are not
/// those of leaves: the lowest part of a trunk hardly moves.
pub(super) fn low_trunk(
    rest: &Mat,
    low: Part,
    leaves: &Leaves,
    size: Size,
) -> opencv::Result<Vec<bool>> {
    let pixels = rest.data_typed::<Vec3b>()?;
    let (mut within, mut beside) = (Colours::default(), Colours::default());
    for (i, pixel) in pixels.iter().enumerate() {
        let (u, v) = (i as u32 % size.width, i as u32 / size.width);
        if low.holds(u, v) {
            within.add(pixel);
        } else if low.is_beside(u, v) {
            beside.add(pixel);
        }
    }
    let mut mask = Vec::with_capacity(pixels.len());
    for (i, pixel) in pixels.iter().enumerate() {
        let (u, v) = (i as u32 % size.width, i as u32 / size.width);
        let is_trunk = within.share(pixel) > TRUNK_COLOUR * beside.share(pixel);
        mask.push(u8::from(low.holds(u, v) && is_trunk && !leaves.is_leaf[i]));
    }
    wide(&mask, size)
}

/// How often colours occur, in 16 steps of each component.
struct Colours {
    counts: Vec<u32>,
    all: u32,
}

impl Default for Colours {
    fn default() -> Self {
        Self {
            counts: vec![0; 1 << 12],
            all: 0,
        }
    }
}

impl Colours {
    fn bin(pixel: &Vec3b) -> usize {
        let [blue, green, red] = pixel.0.map(|c| usize::from(c >> 4));
        (blue << 8) | (green << 4) | red
    }

    fn add(&mut self, pixel: &Vec3b) {
        self.counts[Self::bin(pixel)] += 1;
        self.all += 1;
    }

    fn share(&self, pixel: &Vec3b) -> f64 {
        f64::from(self.counts[Self::bin(pixel)]) / f64::from(self.all.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bark_in_the_shade_is_bark_and_brighter_or_other_colours_are_not() {
        let mut trunk = Vec::new();
        for k in 0..200_u8 {
            let rough = k % 9;
            trunk.push(Vec3b::from([88 + rough, 106 + rough, 120 + rough]));
        }
        let bark = BarkColour::of(&trunk, &vec![true; trunk.len()], 10.0).expect("enough pixels");
        for (colour, expected, name) in [
            ([92, 110, 124], true, "lit"),
            ([52, 62, 70], true, "in the shade"),
            ([14, 16, 18], false, "black"),
            ([140, 165, 185], false, "brighter"),
            ([60, 110, 70], false, "grass"),
        ] {
            assert_eq!(bark.is_like(&Vec3b::from(colour)), expected, "{name}");
        }
        assert!(BarkColour::of(&trunk[..10], &[true; 10], 10.0).is_none());
    }
}

//! How sure each pixel of the picture at rest is of being wood, or a leaf: the odds as probabilities,
//! at the size of the picture.
//!
//! The figures are those that fit the truth of 19 made films best; `docs/method.md` says how well
//! the probabilities hold on others.

use super::blurred;
use super::evidence::Evidence;
use super::mask::WoodMask;
use crate::model::{Luma, Masks, Size};
use opencv::core::Mat;
use opencv::prelude::*;

/// The odds of wood add up as if each clue were known alone. They are not: so much of the sum is
/// believed.
const BELIEVED: f32 = 0.5;
/// No odds of wood count more than this before that: what has the trunk's colours may not be it.
const MOST_ODDS: f32 = 8.0;

/// Odds of a leaf, as logarithms, where half of what is about a pixel is as green as leaves, and
/// nothing else is known.
const LEAF_ODDS: f32 = -2.6;
/// What the evidence adds where it is 1, and takes where it is -1; no evidence that a pixel stands
/// still takes more than the last.
const MOVING_ODDS: f32 = 3.0;
const STILL_ODDS: f32 = 40.0;
const MOST_STILL_ODDS: f32 = 3.0;
/// What it adds and takes where the mean of the evidence about a pixel is this, or more: a lawn
/// about the foot neither moves nor stands still; its green alone makes it leaves by 0.7 at most.
const MOVING_ABOUT: f32 = 0.05;
const ABOUT_ODDS: f32 = 3.0;
/// The share of green pixels is not believed to be nearer to none or to all than this.
const LEAST_SHARE: f32 = 0.03;
/// Leaves lie beside leaves: evidence and green are evened out by so much, px at 640 px picture
/// width, and the evidence about a pixel by the second.
const EVENED_PX: f64 = 2.0;
const ABOUT_PX: f64 = 6.0;

/// The masks of a tree of which `wood` was found in the picture of `evidence`.
///
/// # Errors
/// OpenCV fails.
pub fn masks(wood: &WoodMask, evidence: &Evidence) -> opencv::Result<Masks> {
    let size = evidence.rest.size;
    let tree = evened(&evidence.tree, size, EVENED_PX)?;
    let about = evened(&evidence.tree, size, ABOUT_PX)?;
    let green = evened(&share_of_leaves(wood, size), size, EVENED_PX)?;
    let (mut of_wood, mut of_leaves) = (Vec::new(), Vec::new());
    of_wood.reserve_exact(size.area());
    of_leaves.reserve_exact(size.area());
    for i in 0..size.area() {
        let pixels = wood.pixels_of(i, size);
        if pixels.clone().all(|pixel| wood.odds[pixel].is_infinite()) {
            of_wood.push(0);
            of_leaves.push(0);
            continue;
        }
        let is_wood = probability_of_wood(wood, pixels);
        let other = 1.0 - f32::from(is_wood) / 255.0;
        let leaf = odds_of_leaf(tree[i], about[i], green[i]);
        of_wood.push(is_wood);
        of_leaves.push(byte(other * sigmoid(leaf)));
    }
    Ok(Masks {
        wood: Luma {
            size,
            pixels: of_wood,
        },
        leaves: Luma {
            size,
            pixels: of_leaves,
        },
    })
}

/// The mask of wood alone, of a picture of this size.
pub fn mask_of_wood(wood: &WoodMask, size: Size) -> Luma {
    let mut pixels = Vec::with_capacity(size.area());
    for i in 0..size.area() {
        let own = wood.pixels_of(i, size);
        let is_sought = own.clone().any(|pixel| wood.odds[pixel].is_finite());
        pixels.push(if is_sought {
            probability_of_wood(wood, own)
        } else {
            0
        });
    }
    Luma { size, pixels }
}

/// The probability that the `pixels` of the mask, which are one pixel of the picture, are wood, in
/// 255ths: the mean of theirs, on the side that most of them were cut to.
fn probability_of_wood(wood: &WoodMask, pixels: impl Iterator<Item = usize>) -> u8 {
    let (mut sum, mut n_wood, mut count) = (0.0, 0, 0);
    for pixel in pixels {
        let is_wood = wood.mask[pixel] != 0;
        let believed = sigmoid(BELIEVED * wood.odds[pixel].min(MOST_ODDS));
        // The cut looked at the neighbours, too.
        sum += if is_wood {
            believed.max(0.5)
        } else {
            believed.min(0.5)
        };
        n_wood += usize::from(is_wood);
        count += 1;
    }
    let mean = byte(sum / count.max(1) as f32);
    match (2 * n_wood).cmp(&count) {
        std::cmp::Ordering::Greater => mean.max(Masks::MOST_OUTSIDE + 1),
        std::cmp::Ordering::Equal => mean,
        std::cmp::Ordering::Less => mean.min(Masks::MOST_OUTSIDE),
    }
}

/// The odds that what is no wood is a leaf, as a logarithm, by the evidence that it is tree, and that
/// what is `about` it is, and by the share of that which is as green as leaves.
fn odds_of_leaf(tree: f32, about: f32, green: f32) -> f32 {
    let by_motion = if tree > 0.0 {
        MOVING_ODDS * tree
    } else {
        (STILL_ODDS * tree).max(-MOST_STILL_ODDS)
    };
    let by_colour = ((green + LEAST_SHARE) / (1.0 - green + LEAST_SHARE)).ln();
    let by_motion_about = ABOUT_ODDS * (about / MOVING_ABOUT).clamp(-1.0, 1.0);
    LEAF_ODDS + by_motion + by_motion_about + by_colour
}

/// Which share of each pixel of the picture is as green as leaves.
fn share_of_leaves(wood: &WoodMask, size: Size) -> Vec<f32> {
    let mut shares = Vec::with_capacity(size.area());
    for i in 0..size.area() {
        let pixels = wood.pixels_of(i, size);
        let n_green = pixels.filter(|pixel| wood.is_leaf[*pixel]).count();
        shares.push(n_green as f32 / (wood.scale * wood.scale) as f32);
    }
    shares
}

/// A picture's values, blurred by `by_px` at 640 px picture width.
fn evened(values: &[f32], size: Size, by_px: f64) -> opencv::Result<Vec<f32>> {
    let mat = Mat::new_rows_cols_with_data(size.height as i32, size.width as i32, values)?;
    let by_px = by_px * f64::from(size.width) / 640.0;
    Ok(blurred(&mat, by_px)?.data_typed::<f32>()?.to_vec())
}

fn sigmoid(odds: f32) -> f32 {
    1.0 / (1.0 + (-odds).exp())
}

fn byte(probability: f32) -> u8 {
    (255.0 * probability).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Rgb;

    const SIZE: Size = Size {
        width: 40,
        height: 30,
    };

    /// The left half is cut out as wood, the right as something else. The upper half has odds for
    /// wood, the lower against it; nothing is sought in the last column.
    fn halves(scale: u32) -> WoodMask {
        let large = Size::new(scale * SIZE.width, scale * SIZE.height);
        let mut wood = WoodMask::made_up(large, &[], 0.0);
        wood.scale = scale;
        for pixel in 0..large.area() {
            let at = wood.place(pixel);
            let is_left = at.x < f64::from(large.width) / 2.0;
            let is_upper = at.y < f64::from(large.height) / 2.0;
            wood.mask[pixel] = if is_left { 255 } else { 0 };
            wood.is_leaf[pixel] = !is_left;
            wood.odds[pixel] = if at.x >= f64::from(large.width - scale) {
                f32::NEG_INFINITY
            } else if is_upper {
                6.0
            } else {
                -6.0
            };
        }
        wood
    }

    fn evidence(tree: f32) -> Evidence {
        Evidence {
            rest: Rgb {
                size: SIZE,
                pixels: vec![0; 3 * SIZE.area()],
            },
            tree: vec![tree; SIZE.area()],
        }
    }

    fn at(mask: &Luma, u: usize, v: usize) -> u8 {
        assert_eq!(mask.size, SIZE);
        mask.pixels[v * SIZE.width as usize + u]
    }

    #[test]
    fn probabilities_are_of_the_odds_and_on_the_side_of_the_cut() {
        for scale in [1, 2] {
            let masks = masks(&halves(scale), &evidence(0.5)).expect("opencv");
            // e^3 to 1 is 0.953.
            assert_eq!(at(&masks.wood, 3, 3), 243);
            assert_eq!(at(&masks.wood, 30, 25), 12);
            // The neighbours have overruled these.
            assert_eq!(at(&masks.wood, 3, 25), 128);
            assert!((127..=128).contains(&at(&masks.wood, 30, 3)));
            assert_eq!(at(&masks.wood, 39, 3), 0);
            assert_eq!(at(&masks.leaves, 39, 3), 0);
        }
    }

    #[test]
    fn green_that_moves_is_leaf_where_it_is_no_wood() {
        let wood = halves(2);
        let moving = masks(&wood, &evidence(0.5)).expect("opencv");
        assert!(at(&moving.leaves, 30, 25) > 220);
        assert!(at(&moving.leaves, 3, 3) < 10);
        let still = masks(&wood, &evidence(-0.2)).expect("opencv");
        assert!(at(&still.leaves, 30, 25) < 30);
        // A lawn about the foot: nothing is said of it but its colour.
        let lawn = masks(&wood, &evidence(0.0)).expect("opencv");
        assert!((100..200).contains(&at(&lawn.leaves, 30, 25)));
        for (wood, leaves) in moving.wood.pixels.iter().zip(&moving.leaves.pixels) {
            assert!(u32::from(*wood) + u32::from(*leaves) <= 255);
        }
    }

    /// Of four pixels of the mask two are wood: the odds say which it is.
    #[test]
    fn half_a_pixel_of_wood_is_as_likely_as_its_odds() {
        let mut wood = WoodMask::made_up(Size::new(2, 2), &[], 0.0);
        wood.scale = 2;
        wood.mask = vec![255, 255, 0, 0];
        for (odds, expected) in [
            ([8.0, 8.0, -1.0, -1.0], true),
            ([1.0, 1.0, -8.0, -8.0], false),
        ] {
            wood.odds = odds.to_vec();
            let is_wood = probability_of_wood(&wood, 0..4) > Masks::MOST_OUTSIDE;
            assert_eq!(is_wood, expected, "{odds:?}");
        }
    }
}

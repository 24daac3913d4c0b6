//! Where a picture on which nothing was drawn has the colour of leaves above the ground: what the crown of a
//! tree in leaf is looked for in (index of greenness: Woebbecke et al. 1995).

use super::colours::colour_at;
use super::foliage::{LEAST_SCORE, LeafColour};
use crate::model::Rgb;

/// Margins to the sides that show the ground and no tree, as a share of the picture's width.
const MARGIN: f64 = 0.15;
/// A row is the ground's if so great a share of its margins has the colour of leaves, in the mean of so many
/// rows.
const LAWN_SHARE: f64 = 0.5;
const EVEN_ROWS: usize = 5;

/// Which pixels have the colour of leaves and are not of a lawn, 255 or 0, row by row. A lawn reaches from the
/// picture's lower edge up to where its margins have another colour.
pub fn greenery(picture: &Rgb, colour: LeafColour) -> Vec<u8> {
    let mut mask = Vec::with_capacity(picture.size.area());
    for i in 0..picture.size.area() {
        let is_leaf = colour.score(&colour_at(picture, i)) > LEAST_SCORE;
        mask.push(if is_leaf { 255 } else { 0 });
    }
    let width = picture.size.width as usize;
    let n_above = rows_above_lawn(&mask, width);
    for pixel in mask.iter_mut().skip(n_above * width) {
        *pixel = 0;
    }
    mask
}

/// How many rows of a mask are above a lawn.
fn rows_above_lawn(mask: &[u8], width: usize) -> usize {
    let margin = ((MARGIN * width as f64) as usize).max(1);
    let mut shares = Vec::new();
    for row in mask.chunks_exact(width) {
        let sides = row.iter().take(margin).chain(row.iter().rev().take(margin));
        let n_leaf = sides.filter(|pixel| **pixel != 0).count();
        shares.push(n_leaf as f64 / (2 * margin) as f64);
    }
    let windows: Vec<&[f64]> = shares.windows(EVEN_ROWS).collect();
    let lawn = windows
        .iter()
        .rev()
        .take_while(|rows| rows.iter().sum::<f64>() > LAWN_SHARE * EVEN_ROWS as f64);
    match lawn.count() {
        0 => shares.len(),
        // The middle row of the highest window.
        n_lawn => windows.len() - n_lawn + EVEN_ROWS / 2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;

    #[test]
    fn leaves_are_found_above_a_lawn_and_the_lawn_is_not() {
        let size = Size::new(100, 80);
        let mut pixels = Vec::new();
        for i in 0..size.area() {
            let (u, v) = (i % 100, i / 100);
            let is_crown = (30..70).contains(&u) && (10..60).contains(&v);
            let colour: [u8; 3] = match is_crown || v >= 60 {
                true => [60, 120, 40],
                false => [150, 180, 220],
            };
            pixels.extend(colour);
        }
        let mut picture = Rgb { size, pixels };
        let leaves = |picture: &Rgb| greenery(picture, LeafColour::Green);
        let found = leaves(&picture).iter().filter(|m| **m != 0).count();
        assert!((1920..=2040).contains(&found), "{found}");
        for pixel in picture
            .pixels
            .as_chunks_mut::<3>()
            .0
            .iter_mut()
            .skip(60 * 100)
        {
            *pixel = [120, 120, 120];
        }
        let found = leaves(&picture).iter().filter(|m| **m != 0).count();
        assert_eq!(found, 2000);
    }
}

//! The texture of our own leaf, drawn by code.

use image::{ImageFormat, Rgb as Pixel, RgbImage};
use std::io::Cursor;

/// Side of the picture, texels.
const SIDE: u32 = 128;
/// Side veins to either side of the midrib.
const VEINS: f64 = 6.0;

/// A leaf from its base (v = 1) to its tip (v = 0) as a PNG, all but grey: colour comes from the
/// film. Its border is bled out, so that no seam is seen at the edge.
pub(super) fn png() -> Option<Vec<u8>> {
    let picture = RgbImage::from_fn(SIDE, SIDE, |x, y| {
        let s = shade(x, y).clamp(0.0, 1.0) * 255.0;
        Pixel([s as u8, s as u8, (0.96 * s) as u8])
    });
    let mut bytes = Vec::new();
    picture
        .write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png)
        .ok()?;
    Some(bytes)
}

/// Brightness of a texel, about 0 to 1.
fn shade(x: u32, y: u32) -> f64 {
    let across = ((f64::from(x) + 0.5) / f64::from(SIDE) - 0.5).abs() * 2.0;
    let along = 1.0 - (f64::from(y) + 0.5) / f64::from(SIDE);
    // Side veins leave the midrib upwards and bend towards the tip.
    let phase = (along - 0.35 * across - 0.1 * across * across) * VEINS;
    let from_vein = (phase - phase.round()).abs() / VEINS;
    let vein =
        (1.0 - from_vein / 0.014).max(0.0) * (1.0 - 0.6 * across) * (1.0 - along).min(0.25) * 4.0;
    let midrib = (1.0 - across / (0.05 * (1.25 - along))).max(0.0);
    let edge = ((across - 0.8) / 0.2).max(0.0);
    // Between two veins the blade bulges.
    let bulge = (from_vein * VEINS * 2.0 - 0.5) * 0.07;
    0.86 + bulge + 0.12 * vein.min(1.0).max(midrib) - 0.16 * edge
}

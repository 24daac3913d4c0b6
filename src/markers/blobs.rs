//! Blobs of one hue in a picture: where markers may be.

use super::area::PixelArea;
use super::hue::{HUES, Hsv};
use crate::config::{MAX_MARKERS, MarkerWindow, Markers};
use crate::model::Outline;
use nalgebra::{Point2, Vector2};
use opencv::core::{CV_8UC1, Mat};
use opencv::imgproc::{
    CC_STAT_AREA, CC_STAT_HEIGHT, CC_STAT_LEFT, CC_STAT_TOP, CC_STAT_WIDTH,
    connected_components_with_stats_def,
};
use opencv::prelude::*;

/// A blob of fewer pixels is noise; of more than this share of the picture it is no marker.
const LEAST_BLOB_PX: i32 = 12;
const MAX_BLOB_SHARE: f64 = 0.005;
/// A marker is round or square: its blob fills this share of its box, whose sides have at most this
/// ratio.
const LEAST_FILLED: f64 = 0.5;
const MAX_SIDE_RATIO: f64 = 2.2;
/// The window has so many times the side of the blob: it must hold the marker in the next frame, too.
const WINDOW_PER_BLOB: f64 = 2.0;
const LEAST_WINDOW_PX: f64 = 12.0;

/// Windows around the blobs of the hue that the settings say, within `region` if there is one, the
/// largest ones if there are too many, numbered from the bottom up.
///
/// # Errors
/// OpenCV fails.
pub fn find(
    hsv: &Hsv,
    region: Option<&Outline>,
    settings: &Markers,
) -> opencv::Result<Vec<MarkerWindow>> {
    let mut blobs = blobs(hsv, settings)?;
    blobs.retain(|blob| region.is_none_or(|region| region.contains(blob.at_px.x, blob.at_px.y)));
    blobs.sort_by_key(|blob| std::cmp::Reverse(blob.pixels));
    blobs.truncate(MAX_MARKERS);
    blobs.sort_by(|a, b| b.at_px.y.total_cmp(&a.at_px.y));
    let mut windows = Vec::with_capacity(blobs.len());
    for (k, blob) in blobs.iter().enumerate() {
        windows.push(MarkerWindow {
            name: format!("m{}", k + 1),
            window_px: window_px(blob.at_px, blob.side_px),
            parent: None,
        });
    }
    Ok(windows)
}

/// The window around a marker of this side, px.
pub fn window_px(at_px: Point2<f64>, side_px: f64) -> [f64; 4] {
    let side = (WINDOW_PER_BLOB * side_px).max(LEAST_WINDOW_PX);
    let area = PixelArea::around(at_px, Vector2::repeat(side));
    [area.u, area.v, area.width, area.height].map(f64::from)
}

struct ColouredBlob {
    at_px: Point2<f64>,
    pixels: i32,
    /// The longer side of its box.
    side_px: f64,
}

fn blobs(hsv: &Hsv, settings: &Markers) -> opencv::Result<Vec<ColouredBlob>> {
    let mask: Vec<u8> = hsv
        .pixels()
        .chunks_exact(3)
        .map(|p| has_hue(p, settings))
        .collect();
    let (rows, cols) = (hsv.size.height as i32, hsv.size.width as i32);
    let mask = Mat::new_rows_cols_with_data(rows, cols, &mask)?;
    debug_assert_eq!(mask.typ(), CV_8UC1);
    let (mut labels, mut stats, mut middles) = (Mat::default(), Mat::default(), Mat::default());
    let n = connected_components_with_stats_def(&mask, &mut labels, &mut stats, &mut middles)?;
    let mut found = Vec::new();
    // Label 0 is everything else.
    for label in 1..n {
        let [left, top, width, height, pixels] = [
            CC_STAT_LEFT,
            CC_STAT_TOP,
            CC_STAT_WIDTH,
            CC_STAT_HEIGHT,
            CC_STAT_AREA,
        ]
        .map(|column| stats.at_2d::<i32>(label, column).copied().unwrap_or(0));
        let touches_edge = left == 0 || top == 0 || left + width == cols || top + height == rows;
        let (long, short) = (
            f64::from(width.max(height)),
            f64::from(width.min(height).max(1)),
        );
        let is_marker = pixels >= LEAST_BLOB_PX
            && f64::from(pixels) <= MAX_BLOB_SHARE * hsv.size.area() as f64
            && f64::from(pixels) >= LEAST_FILLED * f64::from(width * height)
            && long <= MAX_SIDE_RATIO * short
            && !touches_edge;
        if is_marker {
            found.push(ColouredBlob {
                at_px: Point2::new(
                    *middles.at_2d::<f64>(label, 0)?,
                    *middles.at_2d::<f64>(label, 1)?,
                ),
                pixels,
                side_px: long,
            });
        }
    }
    Ok(found)
}

/// 255 where a pixel of hue, saturation and value has the hue of the settings, else 0.
fn has_hue(pixel: &[u8], settings: &Markers) -> u8 {
    let half_turn = f64::from(HUES) / 2.0;
    let apart = (f64::from(pixel[0]) - settings.hue_deg / 2.0).abs();
    let apart = half_turn - (apart % f64::from(HUES) - half_turn).abs();
    let coloured = u32::from(pixel[1]) >= settings.least_saturation
        && u32::from(pixel[2]) >= settings.least_value;
    if coloured && apart <= settings.hue_width_deg / 2.0 {
        255
    } else {
        0
    }
}

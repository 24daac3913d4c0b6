//! Markers that are not where they were: looked for where they may be.

use super::area::PixelArea;
use super::follow::LEAST_SEEN;
use super::hue::{Blob, Hsv, Likelihood};
use super::marker::{Marker, Sighting};
use super::shift::shifted;
use crate::config::MarkerMethod;
use nalgebra::{Point2, Vector2, center, distance};

/// A marker that is found again is not so many times larger than usual, and not so much less compact
/// than in its first frame: that is something else of its hue.
const MAX_SEEN: f64 = 2.5;
const LEAST_COMPACT: f64 = 0.7;
/// It is looked for no farther than so many sizes of its window.
const MAX_SIZES: f64 = 8.0;
/// So much of the disc of another marker is not looked at, in its radii, and px beyond that.
const OTHER_RADII: f64 = 1.5;
const OTHER_MARGIN_PX: f64 = 1.0;

/// All that may be a marker beside those that are seen, in windows that stand over each other by a half
/// all over where it may be. Hu et al. (sect. 5.1) enlarge the window to four sides; in a large window
/// the mean shift is drawn to all that is of the hue.
///
/// # Errors
/// OpenCV fails.
pub fn candidates(
    hsv: &Hsv,
    marker: &Marker,
    seen: &[Blob],
    time_s: f64,
    method: MarkerMethod,
) -> opencv::Result<Vec<Sighting>> {
    let size = marker.first.size_px();
    let (low, high) = marker.way.area(time_s);
    let expected = marker.way.expected(time_s);
    let (low, high) = (
        low.sup(&(expected - MAX_SIZES * size)),
        high.inf(&(expected + MAX_SIZES * size)),
    );
    let around = PixelArea::around(center(&low, &high), (high - low).abs() + 2.0 * size);
    let Some(mut likely) = marker.hue.likelihood(hsv, &around)? else {
        return Ok(Vec::new());
    };
    likely.without(|p| seen.iter().any(|other| covers(other, p)));
    let least_px = LEAST_SEEN * marker.usual.mass_px;
    let mut found: Vec<Sighting> = Vec::new();
    for window in windows(&likely.area, size) {
        if likely
            .blob(&window)
            .is_none_or(|blob| blob.mass_px < least_px)
        {
            continue;
        }
        let Some(sighting) = settled(&likely, &window, &marker.first, method)? else {
            continue;
        };
        let blob = sighting.blob;
        let is_marker = (least_px..=MAX_SEEN * marker.usual.mass_px).contains(&blob.mass_px)
            && likely.compact(&blob, &sighting.window, marker.usual.radius_px())
                >= LEAST_COMPACT * marker.compact
            && marker.way.may_be_at(blob.at_px, time_s);
        if is_marker {
            found.push(sighting);
        }
    }
    Ok(found)
}

/// Windows of a size that cover an area, each over the next by a half.
fn windows(area: &PixelArea, size: Vector2<f64>) -> Vec<PixelArea> {
    let [across, down] = [(area.width, size.x), (area.height, size.y)]
        .map(|(side, window)| (2.0 * f64::from(side) / window).ceil() as i32);
    let corner = Point2::new(f64::from(area.u), f64::from(area.v));
    let mut windows = Vec::new();
    for row in 0..down {
        for column in 0..across {
            let step = Vector2::new(f64::from(column), f64::from(row)).component_mul(&size);
            windows.push(PixelArea::around(corner + 0.5 * (step + size), size));
        }
    }
    windows
}

/// Where `window` comes to stand, and the blob in it.
///
/// # Errors
/// OpenCV fails.
pub fn settled(
    likely: &Likelihood,
    window: &PixelArea,
    first: &PixelArea,
    method: MarkerMethod,
) -> opencv::Result<Option<Sighting>> {
    let Some(window) = shifted(likely, window, first, method)? else {
        return Ok(None);
    };
    Ok(likely.blob(&window).map(|blob| Sighting { window, blob }))
}

/// Whether a place is on a marker.
fn covers(marker: &Blob, place_px: Point2<f64>) -> bool {
    distance(&marker.at_px, &place_px) < OTHER_RADII * marker.radius_px() + OTHER_MARGIN_PX
}

//! The bark of a tree: as the filmed trunk shows it, else a guess at its colour.

use super::seen::Seen;
use crate::geometry::{Bark, BarkSource};
use crate::model::{Outline, Rgb, Skeleton};
use nalgebra::Point2;

/// Where no picture has been seen (sRGB).
const PLAIN: [u8; 3] = [104, 84, 66];

/// Share of the trunk, from the foot up, that is looked at: above it twigs and sky come before it.
const LOWER: f64 = 0.3;
/// Share of the outline's width there: drawn by hand it is often twice as wide as the trunk.
const MIDDLE: f64 = 0.2;

/// Places that are looked at along it.
const PLACES: u32 = 50;

/// The bark that was seen. Where no wood was told from the rest, its colour is that of the picture
/// where the trunk should be, which may be another thing's.
pub fn of(seen: &Seen, skeleton: &Skeleton) -> Bark {
    if let Some(tile) = seen.bark
        && let Some(rgb) = tile.mean()
    {
        return Bark {
            rgb,
            tile: Some(tile.clone()),
            source: BarkSource::Trunk,
        };
    }
    let guess = colour(seen, skeleton);
    Bark {
        rgb: guess.unwrap_or(PLAIN),
        tile: None,
        source: guess.map_or(BarkSource::Nowhere, |_| BarkSource::Picture),
    }
}

/// Median colour of the picture along the lower trunk; `None` where no trunk is in it.
fn colour(seen: &Seen, skeleton: &Skeleton) -> Option<[u8; 3]> {
    let picture = seen
        .picture
        .filter(|p| p.pixels.len() == 3 * p.size.area())?;
    let top = skeleton.nodes.get(1)?.position;
    let top = seen
        .pose
        .and_then(|p| p.joints.get(1))
        .map_or(top, |joint| joint.position);
    let (foot, top) = (skeleton.foot_px, skeleton.image_from_model(&top));
    let mut places: Vec<Point2<f64>> = Vec::with_capacity(PLACES as usize);
    for k in 1..=PLACES {
        let share = f64::from(k) / f64::from(PLACES);
        places.push(foot + LOWER * share * (top - foot));
    }
    // The line from node to node may pass by the trunk; the middle of the outline does not.
    let drawn: Vec<Point2<f64>> = seen.outline.map_or(Vec::new(), |outline| {
        places
            .iter()
            .flat_map(|p| middle(outline, foot.x, p.y))
            .collect()
    });
    median(
        picture,
        skeleton,
        if drawn.is_empty() { &places } else { &drawn },
    )
}

/// The middle of the outline's row at `v_px`, where it is above the foot at `u_px`.
fn middle(outline: &Outline, u_px: f64, v_px: f64) -> Vec<Point2<f64>> {
    if !outline.contains(u_px, v_px) {
        return Vec::new();
    }
    let left = border(outline, u_px, v_px, -1.0);
    let right = border(outline, u_px, v_px, 1.0);
    let mut places = Vec::with_capacity(5);
    for k in 0..5 {
        let share = 0.5 + MIDDLE * (f64::from(k) / 4.0 - 0.5);
        places.push(Point2::new(left + (right - left) * share, v_px));
    }
    places
}

/// The first place in steps of `step_px` from a place in the outline that is outside of it, px.
fn border(outline: &Outline, u_px: f64, v_px: f64, step_px: f64) -> f64 {
    let mut u = u_px + step_px;
    let mut steps = 1;
    while outline.contains(u, v_px) {
        steps += 1;
        u = u_px + step_px * f64::from(steps);
    }
    u
}

fn median(picture: &Rgb, skeleton: &Skeleton, places: &[Point2<f64>]) -> Option<[u8; 3]> {
    let scale = f64::from(picture.size.width) / f64::from(skeleton.image_size.width.max(1));
    let mut channels: [Vec<u8>; 3] = Default::default();
    for at in places.iter().map(|p| (p * scale).map(f64::round)) {
        if picture.size.contains(at) {
            let colour = picture.at(at.x.max(0.0) as u32, at.y.max(0.0) as u32);
            for (channel, value) in channels.iter_mut().zip(colour) {
                channel.push(value);
            }
        }
    }
    let mut medians = [0; 3];
    for (median, channel) in medians.iter_mut().zip(&mut channels) {
        channel.sort_unstable();
        *median = *channel.get(channel.len() / 2)?;
    }
    Some(medians)
}

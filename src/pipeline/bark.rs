//! The colour of the bark.

use super::Seen;
use crate::model::{Outline, Rgb, Skeleton};

/// Where no picture has been seen (sRGB).
pub const PLAIN: [u8; 3] = [104, 84, 66];

/// Share of the trunk, from the foot up, that is looked at: above it twigs and sky come before it.
const LOWER: f64 = 0.3;
/// Share of the outline's width there: drawn by hand it is often twice as wide as the trunk.
const MIDDLE: f64 = 0.2;

/// Median colour of the picture along the lower trunk; `None` where no trunk is in it.
pub fn colour(seen: &Seen, skeleton: &Skeleton) -> Option<[u8; 3]> {
    let picture = seen
        .picture
        .filter(|p| p.pixels.len() == 3 * p.size.area())?;
    let top = skeleton.nodes.get(1)?.position;
    let top = seen
        .pose
        .and_then(|p| p.joints.get(1))
        .map_or(top, |joint| joint.position);
    let (foot, top) = (skeleton.foot_px, skeleton.image_from_model(&top));
    let along = |s: f64| [0, 1].map(|c| foot[c] + LOWER * s * (top[c] - foot[c]));
    let places: Vec<[f64; 2]> = (1..=50).map(|k| along(f64::from(k) / 50.0)).collect();
    // The line from node to node may pass by the trunk; the middle of the outline does not.
    let drawn: Vec<[f64; 2]> = seen.outline.map_or(Vec::new(), |outline| {
        places
            .iter()
            .flat_map(|p| middle(outline, foot[0], p[1]))
            .collect()
    });
    median(
        picture,
        skeleton,
        if drawn.is_empty() { &places } else { &drawn },
    )
}

/// The middle of the outline's row at `v_px`, where it is above the foot at `u_px`.
fn middle(outline: &Outline, u_px: f64, v_px: f64) -> Vec<[f64; 2]> {
    let inside = |u: f64| outline.contains(u, v_px);
    if !inside(u_px) {
        return Vec::new();
    }
    let reach = |step: f64| {
        (1..)
            .map(|k| u_px + step * f64::from(k))
            .find(|u| !inside(*u))
            .unwrap_or(u_px)
    };
    let (left, right) = (reach(-1.0), reach(1.0));
    let share = |k: i32| 0.5 + MIDDLE * (f64::from(k) / 4.0 - 0.5);
    (0..5)
        .map(|k| [left + (right - left) * share(k), v_px])
        .collect()
}

fn median(picture: &Rgb, skeleton: &Skeleton, places: &[[f64; 2]]) -> Option<[u8; 3]> {
    let scale = f64::from(picture.size.width) / f64::from(skeleton.image_size.width.max(1));
    let mut channels: [Vec<u8>; 3] = Default::default();
    for at in places.iter().map(|p| p.map(|x| (x * scale).round())) {
        if picture.size.contains(at[0], at[1]) {
            let colour = picture.at(at[0].max(0.0) as u32, at[1].max(0.0) as u32);
            channels.iter_mut().zip(colour).for_each(|(c, x)| c.push(x));
        }
    }
    channels.iter_mut().for_each(|c| c.sort_unstable());
    let median = |c: &Vec<u8>| c.get(c.len() / 2).copied();
    Some([
        median(&channels[0])?,
        median(&channels[1])?,
        median(&channels[2])?,
    ])
}

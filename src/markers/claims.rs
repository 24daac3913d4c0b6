//! Which of several markers a blob is: no two share one.

use super::marker::{Marker, Sighting};
use nalgebra::{Point2, distance, distance_squared};

/// Of two markers that are missing one is found where the other is expected so many times as far away.
const CLEARLY_NEARER: f64 = 2.0;

/// Whether a place is nearer to another marker than `k` that was just seen.
pub fn is_of_other(markers: &[Marker], k: usize, place_px: Point2<f64>) -> bool {
    let own = distance_squared(&markers[k].way.at_px(), &place_px);
    let others = markers.iter().enumerate();
    others
        .filter(|(other, marker)| *other != k && marker.way.is_seen())
        .any(|(_, marker)| distance_squared(&marker.way.at_px(), &place_px) < own)
}

/// Whether what is seen at a place may as well be another marker that is missing: it is not clearly
/// nearer to where `k` is expected. Both are missing on then, until one is at its own place.
pub fn may_be_another(
    markers: &[Marker],
    k: usize,
    place_px: Point2<f64>,
    missing: &[usize],
    time_s: f64,
) -> bool {
    let own_px = markers[k].way.off_px(place_px, time_s);
    missing.iter().any(|other| {
        let way = &markers[*other].way;
        *other != k
            && way.may_be_at(place_px, time_s)
            && way.off_px(place_px, time_s) < CLEARLY_NEARER * own_px
    })
}

/// Of two markers on one blob the one that has come from farther away gives way.
pub fn part(markers: &[Marker], sightings: &mut [Option<Sighting>]) {
    for j in 1..sightings.len() {
        for i in 0..j {
            let (Some(first), Some(second)) = (sightings[i], sightings[j]) else {
                continue;
            };
            if !first.blob.overlaps(&second.blob) {
                continue;
            }
            let giving_way = if came_px(&markers[i], &first) > came_px(&markers[j], &second) {
                i
            } else {
                j
            };
            sightings[giving_way] = None;
        }
    }
}

/// How far a marker has come, px.
fn came_px(marker: &Marker, sighting: &Sighting) -> f64 {
    distance(&marker.way.at_px(), &sighting.blob.at_px)
}

//! The wood that the kept frames show.

use super::film_log::{FilmLog, KeptFrame};
use crate::cancel::CancelToken;
use crate::config;
use crate::hierarchy;
use crate::model::{Foot, LogWindow, Outline, Rgb, Skeleton, TrackId, TrackSet, Wood};
use crate::source::Decoder;
use crate::wood::{self, Displacements, Shot, Stroke, View};
use nalgebra::Point2;
use std::collections::BTreeMap;

/// A point that was seen in less than this share of the frames has no rest place to rely on.
const SEEN_SHARE: f64 = 0.5;

/// Looks for the wood of the tree whose joints `skeleton` has, in the frames of `film` whose points
/// are in `window`, as `settings` say. `None` where frames cannot be decoded, or show no wood, and
/// where `cancel` ends the work before.
pub fn find_wood(
    film: &FilmLog,
    window: LogWindow,
    outline: &Outline,
    skeleton: &Skeleton,
    settings: &config::Skeleton,
    cancel: &CancelToken,
) -> Option<Wood> {
    let rest = rest_places(window);
    let mut frames = Vec::new();
    let mut cameras = Vec::new();
    let mut motions = Vec::new();
    for kept in film.frames() {
        if let Some(tracks) = window.sets().find(|set| set.frame == kept.frame) {
            frames.push(kept);
            cameras.push(tracks.camera);
            motions.push(displacements(tracks, &rest));
        }
    }
    let mut decoder = Decoder::new().ok()?;
    let mut pictures = Vec::new();
    for k in wood::choose(&motions) {
        if cancel.is_cancelled() {
            return None;
        }
        if let Some(picture) = in_colour(frames[k], &mut decoder, outline) {
            pictures.push((picture, k));
        }
    }
    let mut shots = Vec::with_capacity(pictures.len());
    for (picture, k) in &pictures {
        shots.push(Shot {
            picture,
            displacements: &motions[*k],
            camera: cameras[*k],
        });
    }
    let rest_px: Vec<Point2<f64>> = rest.values().copied().collect();
    let mut strokes: Vec<Stroke> = Vec::with_capacity(settings.strokes_px.len());
    for stroke in &settings.strokes_px {
        strokes.push(stroke.iter().map(|at| Point2::from(*at)).collect());
    }
    let view = View {
        shots: &shots,
        rest_px: &rest_px,
        outline,
        foot: Foot {
            position_px: skeleton.foot_px,
            ..Foot::of(outline, None)
        },
        strokes: &strokes,
        trace_by: settings.trace_by,
    };
    match wood::find(view, cancel) {
        Ok(wood) => wood,
        Err(e) => {
            tracing::warn!("the wood was not looked for: {e}");
            None
        }
    }
}

/// The whole frame, if it is of the outline's size.
fn in_colour(kept: &KeptFrame, decoder: &mut Decoder, outline: &Outline) -> Option<Rgb> {
    let picture = decoder.preview(&kept.raw, kept.raw.size.width).ok()?;
    (picture.size == outline.size).then_some(picture)
}

/// Rest places of the points that were seen for long enough, px.
fn rest_places(window: LogWindow) -> BTreeMap<TrackId, Point2<f64>> {
    let table = hierarchy::table(window);
    let mut rest = BTreeMap::new();
    for (row, id) in table.ids.iter().enumerate() {
        let seen = table.positions[row].iter().flatten().count();
        if seen as f64 >= SEEN_SHARE * table.times_s.len() as f64 {
            rest.insert(*id, hierarchy::rest_position_px(&table, row));
        }
    }
    rest
}

/// How far every point is from its rest place, in the order of `rest`, px.
fn displacements(tracks: &TrackSet, rest: &BTreeMap<TrackId, Point2<f64>>) -> Displacements {
    let mut at = BTreeMap::new();
    for observation in &tracks.observations {
        at.insert(observation.id, observation.at_px());
    }
    let displaced = rest.iter().map(|(id, rest)| at.get(id).map(|at| at - rest));
    displaced.collect()
}

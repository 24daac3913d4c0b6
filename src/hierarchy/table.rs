//! A window of the track log as a table, as the hierarchy wants it.

use super::accumulate::COMPARE_HZ;
use crate::model::{LogWindow, TrackId, TrackSet, TrackTable};
use crate::signal::median;
use nalgebra::Point2;
use std::collections::{BTreeMap, BTreeSet};

/// Share of a step by which frames may come early: sensor times jitter, and a step of three frames
/// is to stay one of three.
const STEP_TOLERANCE: f64 = 0.1;

/// The tracks that count in the newest frame of `window`, also from before they were confirmed, on
/// frames at the rate at which tracks are compared.
pub fn table(window: LogWindow) -> TrackTable {
    let frames = spaced_frames(window, 1.0 / COMPARE_HZ);
    let Some(newest) = frames.last() else {
        return TrackTable::default();
    };
    table_of(&frames, newest.counted().map(|o| o.id).collect())
}

/// The same of all tracks that count in any frame, those that have been lost since among them.
pub(super) fn every_track(window: LogWindow) -> TrackTable {
    let frames = spaced_frames(window, 1.0 / COMPARE_HZ);
    let any_passed = frames
        .iter()
        .any(|set| set.observations.iter().any(|o| o.confirmed));
    let mut ids = BTreeSet::new();
    for set in &frames {
        let counting = set
            .observations
            .iter()
            .filter(|o| o.confirmed || !any_passed);
        ids.extend(counting.map(|o| o.id));
    }
    table_of(&frames, ids)
}

fn table_of(frames: &[&TrackSet], ids: BTreeSet<TrackId>) -> TrackTable {
    let row: BTreeMap<TrackId, usize> = ids.into_iter().zip(0..).collect();
    let mut positions = vec![vec![None; frames.len()]; row.len()];
    let mut errors = vec![Vec::new(); row.len()];
    for (f, set) in frames.iter().enumerate() {
        for o in &set.observations {
            if let Some(&i) = row.get(&o.id) {
                positions[i][f] = Some(Point2::new(o.u_px, o.v_px));
                errors[i].push(o.fb_error_px);
            }
        }
    }
    TrackTable {
        ids: row.into_keys().collect(),
        times_s: frames.iter().map(|s| s.time_s).collect(),
        positions,
        fb_errors_px: errors
            .into_iter()
            .map(|e| median(e, f32::total_cmp).unwrap_or(0.0))
            .collect(),
    }
}

/// The sets that are at least `step_s` apart, oldest first, the newest always among them.
fn spaced_frames(window: LogWindow<'_>, step_s: f64) -> Vec<&TrackSet> {
    let mut frames: Vec<&TrackSet> = Vec::new();
    for set in window.sets().rev() {
        let is_next = match frames.last() {
            Some(later) => later.time_s - set.time_s >= (1.0 - STEP_TOLERANCE) * step_s,
            None => true,
        };
        if is_next {
            frames.push(set);
        }
    }
    frames.reverse();
    frames
}

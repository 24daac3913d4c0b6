//! The tracks of the last seconds, and their table as the hierarchy wants it.

use crate::model::{TrackId, TrackSet, TrackTable};
use crate::signal::median;
use std::collections::{BTreeMap, VecDeque};

/// The track sets of the last so many seconds; memory is bounded by the window.
pub struct TrackHistory {
    window_s: f64,
    sets: VecDeque<TrackSet>,
}

impl TrackHistory {
    pub fn new(window_s: f64) -> Self {
        Self {
            window_s,
            sets: VecDeque::new(),
        }
    }

    pub fn push(&mut self, set: TrackSet) {
        let oldest_s = set.time_s - self.window_s;
        self.sets.push_back(set);
        while self.sets.front().is_some_and(|s| s.time_s < oldest_s) {
            self.sets.pop_front();
        }
    }

    pub fn clear(&mut self) {
        self.sets.clear();
    }

    pub fn first(&self) -> Option<&TrackSet> {
        self.sets.front()
    }

    /// The sets, oldest first.
    pub fn sets(&self) -> impl Iterator<Item = &TrackSet> {
        self.sets.iter()
    }

    pub fn last(&self) -> Option<&TrackSet> {
        self.sets.back()
    }

    /// Number of frames held.
    pub fn len(&self) -> usize {
        self.sets.len()
    }

    pub fn is_empty(&self) -> bool {
        self.sets.is_empty()
    }

    /// Time between the first and the last frame held, s.
    pub fn span_s(&self) -> f64 {
        match (self.sets.front(), self.sets.back()) {
            (Some(first), Some(last)) => last.time_s - first.time_s,
            _ => 0.0,
        }
    }

    /// Confirmed tracks seen in the newest frame, also from before they were confirmed, on frames
    /// at least `step_s` apart.
    pub fn table(&self, step_s: f64) -> TrackTable {
        let mut frames: Vec<&TrackSet> = Vec::new();
        // From the newest backwards, so that the newest frame is always in.
        for set in self.sets.iter().rev() {
            // A tenth of tolerance: sensor times jitter, and a step of three frames is to stay one
            // of three.
            if frames
                .last()
                .is_none_or(|next| next.time_s - set.time_s >= 0.9 * step_s)
            {
                frames.push(set);
            }
        }
        frames.reverse();
        let Some(newest) = frames.last() else {
            return TrackTable::default();
        };
        let row: BTreeMap<TrackId, usize> = newest
            .counted()
            .enumerate()
            .map(|(i, o)| (o.id, i))
            .collect();
        let mut positions = vec![vec![None; frames.len()]; row.len()];
        let mut errors = vec![Vec::new(); row.len()];
        for (f, set) in frames.iter().enumerate() {
            for o in &set.observations {
                if let Some(&i) = row.get(&o.id) {
                    positions[i][f] = Some([o.u_px, o.v_px]);
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
}

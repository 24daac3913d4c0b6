//! Track sets held back until it is decided which of their points are kept.

use crate::model::{LONGEST_TRIAL_S, TrackId, TrackSet};
use std::collections::{BTreeSet, VecDeque};

/// Sets of the last seconds. Memory is bounded by the length of a trial.
#[derive(Debug, Default)]
pub struct HeldSets {
    sets: VecDeque<TrackSet>,
    rejected: BTreeSet<TrackId>,
}

impl HeldSets {
    /// Takes note of what a set rejects, without holding it.
    pub fn note(&mut self, set: &TrackSet) {
        self.rejected.extend(&set.rejected);
    }

    /// Takes the next set.
    pub fn push(&mut self, set: TrackSet) {
        self.note(&set);
        self.sets.push_back(set);
    }

    /// The next set that is decided, without the points that did not pass.
    pub fn decided(&mut self) -> Option<TrackSet> {
        let newest_s = self.sets.back()?.time_s;
        let due = self.sets.front().is_some_and(|s| newest_s - s.time_s >= LONGEST_TRIAL_S);
        if due { self.next() } else { None }
    }

    /// The next set, decided or not: there will be no more. What is not decided is kept.
    pub fn next(&mut self) -> Option<TrackSet> {
        let mut set = self.sets.pop_front()?;
        self.clean(&mut set);
        // Nothing later holds what was rejected here.
        set.rejected.iter().for_each(|id| {
            self.rejected.remove(id);
        });
        Some(set)
    }

    /// Takes out the points that did not pass, as far as it is known.
    pub fn clean(&self, set: &mut TrackSet) {
        set.observations.retain(|o| !self.rejected.contains(&o.id));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Observation;

    /// What a reader of `tracks.csv` would else take for a track of the tree.
    #[test]
    fn points_that_fail_their_trial_are_gone_from_all_frames() {
        let set = |k: u64| {
            let o = |id: u32| Observation {
                id: TrackId(id),
                u_px: 0.0,
                v_px: 0.0,
                fb_error_px: 0.0,
                error_px: None,
                confirmed: k > 50 && id != 2,
            };
            let seen: &[u32] = if k < 50 { &[0, 1] } else { &[0, 2] };
            let rejected = if k == 50 { vec![TrackId(1)] } else { Vec::new() };
            let observations = seen.iter().map(|id| o(*id)).collect();
            TrackSet { frame: k, time_s: k as f64 / 10.0, observations, rejected, ..TrackSet::default() }
        };
        let mut held = HeldSets::default();
        let mut out = Vec::new();
        for k in 0..100 {
            held.push(set(k));
            out.extend(std::iter::from_fn(|| held.decided()));
        }
        assert_eq!(out.len(), 40, "what is younger than a trial is held");
        out.extend(std::iter::from_fn(|| held.next()));
        assert_eq!(out.iter().map(|s| s.frame).collect::<Vec<_>>(), (0..100).collect::<Vec<_>>());
        let ids = |s: &TrackSet| s.observations.iter().map(|o| o.id.0).collect::<Vec<_>>();
        assert!(out[..50].iter().all(|s| ids(s) == [0]));
        assert!(out[50..].iter().all(|s| ids(s) == [0, 2]), "2 is on trial when the frames end, and is kept");
        assert!(held.rejected.is_empty());
    }
}

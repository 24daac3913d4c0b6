//! Track sets held back until it is decided which of their points are kept.

use crate::model::{LONGEST_TRIAL_S, TrackId, TrackSet};
use std::collections::{BTreeSet, VecDeque};

/// Which points are on trial.
#[derive(Clone, Debug, Default)]
pub struct OnTrial {
    ids: BTreeSet<TrackId>,
    /// Some have passed theirs.
    any_passed: bool,
}

impl OnTrial {
    /// Takes note of the next set.
    pub fn note(&mut self, set: &TrackSet) {
        for o in &set.observations {
            if o.confirmed {
                self.any_passed = true;
                self.ids.remove(&o.id);
            } else {
                self.ids.insert(o.id);
            }
        }
        set.rejected.iter().for_each(|id| {
            self.ids.remove(id);
        });
    }

    /// Points that do not count if there are no more frames: half of them are no good. Where none
    /// has passed, they are all that there is.
    pub fn void(&self) -> impl Iterator<Item = TrackId> {
        self.ids.iter().copied().filter(|_| self.any_passed)
    }
}

/// Sets of the last seconds. Memory is bounded by the length of a trial.
#[derive(Debug, Default)]
pub struct HeldSets {
    sets: VecDeque<TrackSet>,
    rejected: BTreeSet<TrackId>,
    on_trial: OnTrial,
}

impl HeldSets {
    /// Takes note of what a set rejects, without holding it.
    pub fn note(&mut self, set: &TrackSet) {
        self.rejected.extend(&set.rejected);
        self.on_trial.note(set);
    }

    /// There will be no more sets.
    pub fn close(&mut self) {
        self.rejected.extend(self.on_trial.void());
    }

    /// Takes the next set.
    pub fn push(&mut self, set: TrackSet) {
        self.note(&set);
        self.sets.push_back(set);
    }

    /// The next set that is decided, without the points that did not pass.
    pub fn decided(&mut self) -> Option<TrackSet> {
        let newest_s = self.sets.back()?.time_s;
        let due = self
            .sets
            .front()
            .is_some_and(|s| newest_s - s.time_s >= LONGEST_TRIAL_S);
        if due { self.next() } else { None }
    }

    /// The next set, decided or not, after [`close`](Self::close).
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
                confirmed: k > 50 && id == 0 || k > 70 && id == 3,
            };
            let seen: &[u32] = match k {
                0..50 => &[0, 1],
                50..60 => &[0, 3],
                _ => &[0, 2, 3],
            };
            let rejected = if k == 50 {
                vec![TrackId(1)]
            } else {
                Vec::new()
            };
            let observations = seen.iter().map(|id| o(*id)).collect();
            TrackSet {
                frame: k,
                time_s: k as f64 / 10.0,
                observations,
                rejected,
                ..TrackSet::default()
            }
        };
        let mut held = HeldSets::default();
        let mut out = Vec::new();
        for k in 0..100 {
            held.push(set(k));
            out.extend(std::iter::from_fn(|| held.decided()));
        }
        assert_eq!(out.len(), 40, "what is younger than a trial is held");
        held.close();
        out.extend(std::iter::from_fn(|| held.next()));
        assert_eq!(
            out.iter().map(|s| s.frame).collect::<Vec<_>>(),
            (0..100).collect::<Vec<_>>()
        );
        let ids = |s: &TrackSet| s.observations.iter().map(|o| o.id.0).collect::<Vec<_>>();
        assert!(out[..50].iter().all(|s| ids(s) == [0]));
        assert!(
            out[50..60].iter().all(|s| ids(s) == [0, 3]),
            "3 passes later"
        );
        assert!(
            out[60..].iter().all(|s| ids(s) == [0, 3]),
            "2 is on trial when the frames end"
        );
    }

    /// A capture that is over before any trial is has tracks all the same.
    #[test]
    fn where_no_trial_is_over_all_points_are_kept() {
        let o = Observation {
            id: TrackId(7),
            u_px: 0.0,
            v_px: 0.0,
            fb_error_px: 0.0,
            error_px: None,
            confirmed: false,
        };
        let mut held = HeldSets::default();
        held.push(TrackSet {
            observations: vec![o],
            ..TrackSet::default()
        });
        held.close();
        assert_eq!(held.next().map(|s| s.observations.len()), Some(1));
    }
}

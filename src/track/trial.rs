//! New points are on trial: twice as many as wanted are followed for a while, and the better half is kept.
//!
//! A third of all corners lie where two layers of motion meet in one window, a branch before a branch, a leaf over a
//! leaf. No patch can be followed there, and at first sight they cannot be told from the others; while the tree moves,
//! they can.

use super::Tracker;
use super::anchor::distance;
use super::point::{Point, Record};
use crate::model::TrackId;
use std::collections::BTreeSet;

/// So many candidates are followed for each point that is wanted.
pub const CANDIDATES: usize = 2;
/// A trial lasts until the points have moved for so long, s, and not longer than [`crate::model::LONGEST_TRIAL_S`],
/// whether they move or not.
const MOVED_S: f64 = 2.0;
/// Points count as moving while half of them are so far from where they were found, px.
const MOVED_PX: f32 = 1.0;
/// More than this between two frames is a gap, in which nobody saw them move, s.
const STEP_S: f64 = 0.2;
/// Points that move alike far compete with each other: else those of the trunk, which are easy, would drive out the twigs.
const CLASSES: usize = 4;
/// Later points must be as good as so great a share of those that were kept first.
const BAR: f64 = 0.75;

/// What is known of one point on trial.
#[derive(Debug, Default)]
pub struct Trial {
    pub record: Record,
    /// How far it has been from where it was found, px.
    pub reach_px: f32,
}

/// The trial that is going on.
#[derive(Debug)]
pub struct Trials {
    since_s: f64,
    last_s: f64,
    moved_s: f64,
}

impl Trials {
    pub fn new(time_s: f64) -> Self {
        Self { since_s: time_s, last_s: time_s, moved_s: 0.0 }
    }

    /// Takes the time of a frame and whether the points were away from where they were found; whether the trial is over.
    fn over(&mut self, time_s: f64, moving: bool) -> bool {
        if moving {
            self.moved_s += (time_s - self.last_s).clamp(0.0, STEP_S);
        }
        self.last_s = time_s;
        self.moved_s >= MOVED_S || time_s - self.since_s >= crate::model::LONGEST_TRIAL_S
    }
}

/// A point that may be kept.
#[derive(Clone, Copy)]
struct Candidate {
    id: TrackId,
    reach_px: f32,
    error_px: f32,
}

impl Tracker {
    /// Ends the trial if it is time; gives the points that are dropped for it, by id.
    pub(super) fn judge(&mut self, time_s: f64) -> Vec<TrackId> {
        let Some(trials) = &mut self.trials else { return Vec::new() };
        let mut moves: Vec<f32> = Vec::new();
        for p in &mut self.points {
            if let Some(trial) = &mut p.trial {
                let reach_px = distance(p.now_px, p.born_px);
                trial.reach_px = trial.reach_px.max(reach_px);
                moves.push(reach_px);
            }
        }
        moves.sort_unstable_by(f32::total_cmp);
        let moving = moves.get(moves.len() / 2).is_some_and(|d| *d > MOVED_PX);
        if !trials.over(time_s, moving) {
            return Vec::new();
        }
        self.trials = None;
        let candidate = |p: &Point| {
            let trial = p.trial.as_ref().filter(|_| p.coasting == 0)?;
            Some(Candidate { id: p.id, reach_px: trial.reach_px, error_px: trial.record.error_px()? })
        };
        let candidates: Vec<Candidate> = self.points.iter().filter_map(candidate).collect();
        let kept = match self.bar_px {
            None => {
                let (kept, bar_px) = better_half(candidates);
                self.bar_px = bar_px;
                kept
            }
            Some(bar_px) => candidates.iter().filter(|c| c.error_px <= bar_px).map(|c| c.id).collect(),
        };
        let mut dropped = Vec::new();
        self.points.retain_mut(|p| {
            let keep = p.trial.is_none() || kept.contains(&p.id);
            if !keep {
                dropped.push(p.id);
            }
            p.trial = None;
            keep
        });
        self.settled = self.points.len();
        dropped
    }
}

/// The half of each class of reach that is expected to err least, and the error that [`BAR`] of them keep below, px.
fn better_half(mut candidates: Vec<Candidate>) -> (BTreeSet<TrackId>, Option<f32>) {
    candidates.sort_by(|a, b| a.reach_px.total_cmp(&b.reach_px));
    let class = candidates.len().div_ceil(CLASSES).max(1);
    let (mut kept, mut errors) = (BTreeSet::new(), Vec::new());
    for class in candidates.chunks_mut(class) {
        class.sort_by(|a, b| a.error_px.total_cmp(&b.error_px));
        let best = &class[..class.len().div_ceil(CANDIDATES)];
        kept.extend(best.iter().map(|c| c.id));
        errors.extend(best.iter().map(|c| c.error_px));
    }
    errors.sort_unstable_by(f32::total_cmp);
    let bar_px = errors.get((errors.len() as f64 * BAR) as usize).copied();
    (kept, bar_px)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The trunk's points, which hardly move and are easy to follow, must not drive out those of the twigs.
    #[test]
    fn points_compete_with_those_that_move_alike_far() {
        let candidate = |k: u32| Candidate {
            id: TrackId(k),
            reach_px: k as f32,
            error_px: 0.1 * k as f32 + if k.is_multiple_of(2) { 0.0 } else { 5.0 },
        };
        let (kept, bar_px) = better_half((0..80).map(candidate).collect());
        let even: BTreeSet<TrackId> = (0..80).step_by(2).map(TrackId).collect();
        assert_eq!(kept, even);
        assert!(bar_px.is_some_and(|b| (b - 6.0).abs() < 0.5), "{bar_px:?}");
    }
}

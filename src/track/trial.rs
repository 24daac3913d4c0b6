//! New points are on trial: twice as many as wanted are followed for a while, and the better half
//! is kept.
//!
//! A third of all corners lie where two layers of motion meet in one window, a branch before a
//! branch, a leaf over a leaf. No patch can be followed there, and at first sight they cannot be
//! told from the others; while the tree moves, they can.

use super::point::Point;
use crate::model::{CameraMotion, LONGEST_TRIAL_S, TrackId};
use nalgebra::distance;
use std::collections::BTreeSet;

/// So many candidates are followed for each point that is wanted.
pub const CANDIDATES: usize = 2;
/// A trial lasts until the points have moved for so long, s, and not longer than
/// [`LONGEST_TRIAL_S`] from when the first of them have stirred.
const MOVED_S: f64 = 2.0;
/// Points count as moving while so great a share of them is so far from where they were found, px.
/// An outline may be wide, and more wall than tree.
const MOVING_SHARE: f64 = 0.25;
const MOVED_PX: f32 = 1.0;
/// They have stirred when so great a share is so far from there, px, or so many: in a wide outline
/// the tree may have but few, and half of what evidence of motion needs to count in full may make a
/// tree all the same.
const STIRRED_SHARE: f64 = 0.1;
const STIRRED: usize = 16;
const STIRRED_PX: f32 = 0.3;
/// More than this between two frames is a gap, in which nobody saw them move, s.
const STEP_S: f64 = 0.2;
/// Points that move alike far compete with each other: else those of the trunk, which are easy,
/// would drive out the twigs.
const CLASSES: usize = 4;
/// Later points must be as good as so great a share of those that were kept first.
const BAR: f64 = 0.75;
/// So many are kept that move, good or not, if so many are wanted: twice what evidence of motion
/// needs to count in full.
const NEEDED: usize = 64;

/// Decides which points are kept.
#[derive(Debug)]
pub struct Selection {
    /// Number of points that are wanted in all.
    wanted: usize,
    /// The trial that is going on.
    trial_round: Option<TrialRound>,
    /// Expected error that points of later trials must not exceed, px; known after the first.
    bar_px: Option<f32>,
    /// Number of points after the last trial, the wanted number before.
    settled: usize,
}

impl Selection {
    pub fn new(wanted: usize) -> Self {
        Self {
            wanted,
            trial_round: None,
            bar_px: None,
            settled: wanted,
        }
    }

    /// Number of points after the last trial, the wanted number before.
    pub fn settled(&self) -> usize {
        self.settled
    }

    /// Whether more points may be put on trial: while the tree rests, a trial may be long, and the
    /// light may take points away.
    pub fn is_open(&self) -> bool {
        self.trial_round.as_ref().is_none_or(TrialRound::at_rest)
    }

    /// Begins a trial of `started` points, if none is going on: those that are put on trial later
    /// join it.
    pub fn begin(&mut self, time_s: f64, started: usize) {
        let is_first = self.bar_px.is_none();
        self.trial_round
            .get_or_insert_with(|| TrialRound::new(time_s, is_first, started));
    }

    /// Ends the trial if it is time; gives the points that are dropped for it, by id.
    pub fn judge(
        &mut self,
        points: &mut Vec<Point>,
        time_s: f64,
        camera: &CameraMotion,
    ) -> Vec<TrackId> {
        let Some(trial_round) = &mut self.trial_round else {
            return Vec::new();
        };
        if !trial_round.over(time_s, &distances_from_start(points, camera)) {
            return Vec::new();
        }
        let on_trial = trial_round.started;
        self.trial_round = None;
        let kept = self.choose(points, on_trial);
        let mut dropped = Vec::new();
        points.retain_mut(|p| {
            let keep = p.trial.is_none() || kept.contains(&p.id);
            if !keep {
                dropped.push(p.id);
            }
            p.trial = None;
            keep
        });
        self.settled = points.len();
        dropped
    }

    /// Those of the points on trial that are kept; `on_trial` were there when it began.
    fn choose(&mut self, points: &[Point], on_trial: usize) -> BTreeSet<TrackId> {
        let mut candidates: Vec<Candidate> = points.iter().filter_map(Candidate::of).collect();
        let there = points.iter().filter(|p| p.trial.is_none()).count();
        let missing = self.wanted.saturating_sub(there);
        let kept = match self.bar_px {
            None => {
                let (kept, bar_px) = best(&mut candidates, on_trial.div_ceil(CANDIDATES));
                self.bar_px = bar_px;
                kept
            }
            Some(bar_px) => {
                candidates.sort_by(|a, b| a.error_px.total_cmp(&b.error_px));
                let good = candidates.iter().take_while(|c| c.error_px <= bar_px);
                good.take(missing).map(|c| c.id).collect()
            }
        };
        let needed = NEEDED.min(self.wanted).saturating_sub(there);
        fill_up(kept, candidates, needed, missing)
    }
}

/// How far the points on trial are from where they were found, px, in ascending order, without the
/// camera's motion; notes the largest of each.
fn distances_from_start(points: &mut [Point], camera: &CameraMotion) -> Vec<f32> {
    let mut away_px: Vec<f32> = Vec::new();
    for p in points {
        if let Some(trial) = &mut p.trial {
            let reach_px = distance(&camera.steady_px(p.now_px.cast()).cast(), &p.born_steady_px);
            trial.reach_px = trial.reach_px.max(reach_px);
            away_px.push(reach_px);
        }
    }
    away_px.sort_unstable_by(f32::total_cmp);
    away_px
}

/// A trial that is going on.
#[derive(Debug)]
struct TrialRound {
    /// From when on its length counts; `None` while everything is at rest, where nothing can be
    /// told.
    since_s: Option<f64>,
    last_s: f64,
    moved_s: f64,
    /// Number of points with which it began.
    started: usize,
}

impl TrialRound {
    /// The first points of a capture wait for the tree to move, however long that takes: until then
    /// there is nothing to be decided, and no tree to which they belong. Later ones have
    /// [`LONGEST_TRIAL_S`] in any case.
    fn new(time_s: f64, first: bool, started: usize) -> Self {
        Self {
            started,
            since_s: (!first).then_some(time_s),
            last_s: time_s,
            moved_s: 0.0,
        }
    }

    /// Nothing has stirred yet.
    fn at_rest(&self) -> bool {
        self.since_s.is_none()
    }

    /// Takes the time of a frame and how far points are from where they were found, sorted; whether
    /// the trial is over.
    fn over(&mut self, time_s: f64, away_px: &[f32]) -> bool {
        let stirred = count_beyond(away_px, STIRRED_PX) >= STIRRED
            || is_share_beyond(away_px, STIRRED_PX, STIRRED_SHARE);
        if self.since_s.is_none() && stirred {
            self.since_s = Some(time_s);
        }
        if is_share_beyond(away_px, MOVED_PX, MOVING_SHARE) {
            self.moved_s += (time_s - self.last_s).clamp(0.0, STEP_S);
        }
        self.last_s = time_s;
        self.moved_s >= MOVED_S
            || self
                .since_s
                .is_some_and(|since_s| time_s - since_s >= LONGEST_TRIAL_S)
    }
}

/// How many of the sorted distances are greater than `px`.
fn count_beyond(away_px: &[f32], px: f32) -> usize {
    away_px.len() - away_px.partition_point(|d| *d <= px)
}

/// Whether at least `share` of the sorted distances, and any at all, are greater than `px`.
fn is_share_beyond(away_px: &[f32], px: f32, share: f64) -> bool {
    let count = count_beyond(away_px, px);
    count > 0 && count as f64 >= share * away_px.len() as f64
}

/// A point that may be kept.
#[derive(Clone, Copy)]
struct Candidate {
    id: TrackId,
    reach_px: f32,
    error_px: f32,
}

impl Candidate {
    /// A point on trial that is seen and was compared with its first patch.
    fn of(p: &Point) -> Option<Self> {
        let trial = p.trial.as_ref().filter(|_| p.coasting == 0)?;
        Some(Self {
            id: p.id,
            reach_px: trial.reach_px,
            error_px: trial.record.error_px()?,
        })
    }

    fn moves(&self) -> bool {
        self.reach_px > MOVED_PX
    }
}

/// So many, the same share of each class of reach, that are expected to err least, and the error
/// that [`BAR`] of them keep below, px.
fn best(candidates: &mut [Candidate], wanted: usize) -> (BTreeSet<TrackId>, Option<f32>) {
    let share = (wanted as f64 / candidates.len().max(1) as f64).min(1.0);
    candidates.sort_by(|a, b| a.reach_px.total_cmp(&b.reach_px));
    let class = candidates.len().div_ceil(CLASSES).max(1);
    let (mut kept, mut errors) = (BTreeSet::new(), Vec::new());
    for class in candidates.chunks_mut(class) {
        class.sort_by(|a, b| a.error_px.total_cmp(&b.error_px));
        let best = &class[..(share * class.len() as f64).ceil() as usize];
        kept.extend(best.iter().map(|c| c.id));
        errors.extend(best.iter().map(|c| c.error_px));
    }
    errors.sort_unstable_by(f32::total_cmp);
    let bar_px = errors.get((errors.len() as f64 * BAR) as usize).copied();
    (kept, bar_px)
}

/// Adds the best of those that were not kept until `needed` are that move, and failing those, until
/// so many are at all: a tree from doubtful points is better than none. More than `wanted` are not
/// kept for it: the worst that rest go.
fn fill_up(
    mut kept: BTreeSet<TrackId>,
    mut candidates: Vec<Candidate>,
    needed: usize,
    wanted: usize,
) -> BTreeSet<TrackId> {
    candidates.sort_by(|a, b| a.error_px.total_cmp(&b.error_px));
    let moving = candidates.iter().filter(|c| c.moves());
    let missing = needed.saturating_sub(moving.clone().filter(|c| kept.contains(&c.id)).count());
    let more: Vec<TrackId> = moving
        .map(|c| c.id)
        .filter(|id| !kept.contains(id))
        .take(missing)
        .collect();
    kept.extend(more);
    for worst in candidates.iter().rev().filter(|c| !c.moves()) {
        if kept.len() <= wanted {
            break;
        }
        kept.remove(&worst.id);
    }
    let missing = needed.saturating_sub(kept.len());
    let more: Vec<TrackId> = candidates
        .iter()
        .map(|c| c.id)
        .filter(|id| !kept.contains(id))
        .take(missing)
        .collect();
    kept.extend(more);
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The trunk's points, which hardly move and are easy to follow, must not drive out those of
    /// the twigs.
    #[test]
    fn points_compete_with_those_that_move_alike_far() {
        let mut candidates: Vec<Candidate> = Vec::new();
        for k in 0..80 {
            candidates.push(Candidate {
                id: TrackId(k),
                reach_px: k as f32,
                error_px: 0.1 * k as f32 + if k.is_multiple_of(2) { 0.0 } else { 5.0 },
            });
        }
        let (kept, bar_px) = best(&mut candidates, 40);
        let even: BTreeSet<TrackId> = (0..80).step_by(2).map(TrackId).collect();
        assert_eq!(kept, even);
        assert!(bar_px.is_some_and(|b| (b - 6.0).abs() < 0.5), "{bar_px:?}");
    }

    fn one_in_six_moves(k: u32) -> Candidate {
        Candidate {
            id: TrackId(k),
            reach_px: if k.is_multiple_of(6) { 3.0 } else { 0.1 },
            error_px: 1.0 + 0.01 * k as f32,
        }
    }

    /// Half of few would be too few to build from.
    #[test]
    fn as_many_are_kept_as_a_tree_needs() {
        let mut few: Vec<Candidate> = (0..240).map(one_in_six_moves).collect();
        let moving: BTreeSet<TrackId> = (0..240).step_by(6).map(TrackId).collect();
        let (half, _) = best(&mut few, 120);
        assert!(
            half.intersection(&moving).count() < 35,
            "the half alone has too few"
        );
        let kept = fill_up(half, few, 64, 120);
        assert_eq!(
            (kept.intersection(&moving).count(), kept.len()),
            (40, 120),
            "all that move, and not more than wanted"
        );
        let still: Vec<Candidate> = (0..100)
            .map(|k| Candidate {
                reach_px: 0.0,
                ..one_in_six_moves(k)
            })
            .collect();
        let best: BTreeSet<TrackId> = (0..64).map(TrackId).collect();
        assert_eq!(
            fill_up(BTreeSet::new(), still, 64, 120),
            best,
            "where nothing moves, the best"
        );
    }

    /// A user who starts the camera, goes out and pulls at the tree must get the same choice as one
    /// who was quick.
    #[test]
    fn while_the_tree_rests_nothing_is_decided() {
        let mut first = TrialRound::new(0.0, true, 40);
        let (still, swaying) = ([0.05; 40], [0.1, 0.2, 3.0, 5.0]);
        assert!((1..400).all(|k| !first.over(f64::from(k) * 0.1, &still) && first.at_rest()));
        let over_s = (400..)
            .map(|k| f64::from(k) * 0.1)
            .find(|t| first.over(*t, &swaying));
        assert!(
            over_s.is_some_and(|s| (41.8..42.2).contains(&s)),
            "{over_s:?}"
        );
        let mut later = TrialRound::new(0.0, false, 40);
        let over_s = (1..)
            .map(|k| f64::from(k) * 0.1)
            .find(|t| later.over(*t, &still));
        assert!(
            over_s.is_some_and(|s| (s - LONGEST_TRIAL_S).abs() < 0.15),
            "later ones have a limit: {over_s:?}"
        );
    }
}

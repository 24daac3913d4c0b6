//! The one store of points over time.

use super::{Background, Observation, TrackId, TrackSet};
use nalgebra::Vector2;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

/// The followed points of the last seconds, frame by frame.
///
/// A point is on trial when it is found. The verdict is applied here, once: what a later set
/// rejects is taken out of all frames that are still held, so that no reader has to filter.
/// Memory is bounded by the time that is remembered; [`push`](Self::push) gives back what is older.
/// The sets are shared, so that a clone costs one count a frame and can be worked on elsewhere.
#[derive(Clone, Debug)]
pub struct TrackLog {
    remembered_s: f64,
    sets: VecDeque<Arc<TrackSet>>,
    /// Nothing that was pushed has been given back yet.
    is_whole: bool,
    tentative: Tentative,
}

impl TrackLog {
    /// A log that remembers `remembered_s` seconds.
    pub fn new(remembered_s: f64) -> Self {
        Self {
            remembered_s,
            sets: VecDeque::new(),
            is_whole: true,
            tentative: Tentative::default(),
        }
    }

    /// Takes the set of the next frame. Gives back the sets that have become too old, oldest first;
    /// where more than [`LONGEST_TRIAL_S`](super::LONGEST_TRIAL_S) is remembered they are final. A
    /// set of a camera that has lost its background shows nothing: it is not kept, nor are those
    /// before it in which that was not seen any more, and what is remembered grows no older by it.
    pub fn push(&mut self, set: TrackSet) -> Vec<Arc<TrackSet>> {
        self.tentative.note(&set);
        self.remove(&set.rejected.iter().copied().collect());
        if set.camera.background == Background::Lost {
            self.forget_unseen();
            return Vec::new();
        }
        let oldest_s = set.time_s - self.remembered_s;
        self.sets.push_back(Arc::new(set));
        let n_old = self.sets.iter().take_while(|s| s.time_s < oldest_s).count();
        self.is_whole &= n_old == 0;
        self.sets.drain(..n_old).collect()
    }

    /// Forgets the newest sets as far as their background was not seen.
    fn forget_unseen(&mut self) {
        let is_unseen = |set: &Arc<TrackSet>| set.camera.sd_px().is_none();
        while self.sets.back().is_some_and(is_unseen) {
            self.sets.pop_back();
        }
    }

    /// There are no more frames: points that are still on trial do not count. Gives back which
    /// those are.
    pub fn close(&mut self) -> BTreeSet<TrackId> {
        let void = self.tentative.void().collect();
        self.remove(&void);
        void
    }

    /// Gives back all sets that are held, oldest first.
    pub fn drain(&mut self) -> Vec<Arc<TrackSet>> {
        self.is_whole &= self.sets.is_empty();
        self.sets.drain(..).collect()
    }

    /// The set of the first frame that was ever pushed, while it is held.
    pub fn first_of_film(&self) -> Option<&TrackSet> {
        let first = self.sets.front().filter(|_| self.is_whole)?;
        Some(first)
    }

    fn remove(&mut self, ids: &BTreeSet<TrackId>) {
        if ids.is_empty() {
            return;
        }
        for set in &mut self.sets {
            if set.observations.iter().any(|o| ids.contains(&o.id)) {
                let set = Arc::make_mut(set);
                set.observations.retain(|o| !ids.contains(&o.id));
            }
        }
    }

    /// All that is remembered.
    pub fn all(&self) -> LogWindow<'_> {
        self.last(f64::INFINITY)
    }

    /// The last `span_s` seconds up to the newest frame.
    pub fn last(&self, span_s: f64) -> LogWindow<'_> {
        let newest_s = self.sets.back().map_or(0.0, |s| s.time_s);
        let from = self.sets.partition_point(|s| s.time_s < newest_s - span_s);
        LogWindow { log: self, from }
    }
}

/// A view of the newest part of a log.
#[derive(Clone, Copy, Debug)]
pub struct LogWindow<'a> {
    log: &'a TrackLog,
    from: usize,
}

impl<'a> LogWindow<'a> {
    /// The sets, oldest first.
    pub fn sets(&self) -> impl DoubleEndedIterator<Item = &'a TrackSet> + use<'a> {
        self.log.sets.range(self.from..).map(|set| &**set)
    }

    pub fn first(&self) -> Option<&'a TrackSet> {
        self.sets().next()
    }

    pub fn newest(&self) -> Option<&'a TrackSet> {
        self.sets().next_back()
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.log.sets.len() - self.from
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Time between the first and the newest frame, s.
    pub fn span_s(&self) -> f64 {
        match (self.first(), self.newest()) {
            (Some(first), Some(newest)) => newest.time_s - first.time_s,
            _ => 0.0,
        }
    }
}

/// Frames in which it is looked at how far points move; more say the same at a higher price.
const MOST_LOOKED_AT: usize = 120;
/// A point that was seen in fewer of them says nothing of how far it moves.
const LEAST_SEEN: u32 = 10;

impl LogWindow<'_> {
    /// How far each point moves, px, in no order: the amplitude of the sine with the same mean
    /// square about its mean place. Points that do not count if there are no more frames are left
    /// out. It costs the same however long the window is.
    pub fn amplitudes_px(&self) -> Vec<f64> {
        let mut points: BTreeMap<TrackId, Places> = BTreeMap::new();
        for set in self.looked_at() {
            for o in &set.observations {
                let at_px = Vector2::new(o.u_px, o.v_px).cast();
                points.entry(o.id).or_default().add(at_px);
            }
        }
        for void in self.log.tentative.void() {
            points.remove(&void);
        }
        let seen = points.values().filter(|places| places.n >= LEAST_SEEN);
        seen.map(Places::amplitude_px).collect()
    }

    /// One of each so many sets, and each time another one: of sets at even steps, a tree that
    /// sways once in a step would seem to stand still.
    fn looked_at(&self) -> impl Iterator<Item = &TrackSet> {
        let step = self.len().div_ceil(MOST_LOOKED_AT).max(1);
        let numbered = self.sets().enumerate();
        numbered.filter_map(move |(k, set)| (k % step == k / step % step).then_some(set))
    }
}

/// Mean and spread of the places of a point, by Welford's recursion.
#[derive(Clone, Copy, Debug, Default)]
struct Places {
    n: u32,
    mean_px: Vector2<f64>,
    sum_of_squares: f64,
}

impl Places {
    fn add(&mut self, at_px: Vector2<f64>) {
        self.n += 1;
        let off = at_px - self.mean_px;
        self.mean_px += off / f64::from(self.n);
        self.sum_of_squares += off.dot(&(at_px - self.mean_px));
    }

    fn amplitude_px(&self) -> f64 {
        (2.0 * self.sum_of_squares / f64::from(self.n)).sqrt()
    }
}

/// Which points are on trial.
#[derive(Clone, Debug, Default)]
pub struct Tentative {
    ids: BTreeSet<TrackId>,
    /// Some have passed theirs.
    any_passed: bool,
}

impl Tentative {
    /// Takes note of the next set.
    pub fn note(&mut self, set: &TrackSet) {
        for Observation { id, confirmed, .. } in &set.observations {
            if *confirmed {
                self.any_passed = true;
                self.ids.remove(id);
            } else {
                self.ids.insert(*id);
            }
        }
        for id in &set.rejected {
            self.ids.remove(id);
        }
    }

    /// Points that do not count if there are no more frames: about half of them would be rejected.
    /// Where none has passed, they are all that there is, and count.
    pub fn void(&self) -> impl Iterator<Item = TrackId> {
        self.ids.iter().copied().filter(|_| self.any_passed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Agreement, LONGEST_TRIAL_S};

    fn observation(id: u32, confirmed: bool) -> Observation {
        Observation {
            id: TrackId(id),
            u_px: 0.0,
            v_px: 0.0,
            fb_error_px: 0.0,
            error_px: None,
            confirmed,
            depth: None,
        }
    }

    /// Ten frames a second: point 0 passes its trial at once, 1 is rejected in frame 50, 3 passes
    /// in frame 70, 2 is still on trial at the end.
    fn set(k: u64) -> TrackSet {
        let seen: &[u32] = match k {
            0..50 => &[0, 1],
            50..60 => &[0, 3],
            _ => &[0, 2, 3],
        };
        let passed = |id: u32| k > 50 && id == 0 || k > 70 && id == 3;
        TrackSet {
            frame: k,
            time_s: k as f64 / 10.0,
            observations: seen
                .iter()
                .map(|id| observation(*id, passed(*id)))
                .collect(),
            rejected: if k == 50 {
                vec![TrackId(1)]
            } else {
                Vec::new()
            },
            ..TrackSet::default()
        }
    }

    fn ids(set: &TrackSet) -> Vec<u32> {
        set.observations.iter().map(|o| o.id.0).collect()
    }

    /// What a reader of `tracks.csv` would else take for a track of the tree.
    #[test]
    fn points_that_fail_their_trial_are_gone_from_all_frames() {
        let mut log = TrackLog::new(LONGEST_TRIAL_S);
        let mut out: Vec<Arc<TrackSet>> = (0..100).flat_map(|k| log.push(set(k))).collect();
        assert_eq!(out.len(), 40, "what is younger than a trial is held");
        log.close();
        out.extend(log.drain());
        assert!(out.iter().map(|s| s.frame).eq(0..100));
        assert!(out[..50].iter().all(|s| ids(s) == [0]));
        assert!(
            out[50..].iter().all(|s| ids(s) == [0, 3]),
            "3 passes later, 2 never does"
        );
    }

    /// A capture that is over before any trial is has tracks all the same.
    #[test]
    fn where_no_trial_is_over_all_points_are_kept() {
        let mut log = TrackLog::new(LONGEST_TRIAL_S);
        let observations = vec![observation(7, false)];
        log.push(TrackSet {
            observations,
            ..TrackSet::default()
        });
        log.close();
        assert_eq!(log.all().newest().map(ids), Some(vec![7]));
    }

    /// Who works on a clone elsewhere must not see it change.
    #[test]
    fn a_clone_stays_as_it_was() {
        let mut log = TrackLog::new(60.0);
        (0..50).for_each(|k| drop(log.push(set(k))));
        let before = log.clone();
        log.push(set(50));
        assert_eq!(before.all().newest().map(ids), Some(vec![0, 1]));
        assert_eq!(log.last(1.0).first().map(ids), Some(vec![0]));
        assert_eq!((log.last(1.0).len(), log.last(1.0).span_s()), (11, 1.0));
    }

    /// A camera that is turned away shows no tree that stands still.
    #[test]
    fn frames_of_a_camera_that_is_turned_away_do_not_count() {
        let mut log = TrackLog::new(10.0);
        for k in 0..50 {
            let mut seen = set(k);
            // The last second before it is lost it is not seen.
            if k < 40 {
                seen.camera.background = Background::Seen(Agreement::default());
            }
            log.push(seen);
        }
        for k in 50..500 {
            let mut away = set(k);
            away.observations.clear();
            away.camera.background = Background::Lost;
            assert!(log.push(away).is_empty());
        }
        assert_eq!(log.all().len(), 40);
        assert_eq!(
            log.all().newest().map(ids),
            Some(vec![0]),
            "1 was rejected meanwhile"
        );
        log.push(set(500));
        assert_eq!(log.all().newest().map(ids), Some(vec![0, 2, 3]));
    }

    #[test]
    fn a_point_moves_as_far_as_the_sine_with_its_mean_square() {
        let mut log = TrackLog::new(60.0);
        for k in 0..200 {
            let mut moving = observation(1, true);
            moving.u_px = 300.0 + 2.5 * (0.1 * std::f32::consts::TAU * k as f32).sin();
            let mut seen = vec![observation(0, true), moving];
            // Too short to say anything.
            seen.extend((k < 5).then(|| observation(2, true)));
            log.push(TrackSet {
                time_s: k as f64 / 10.0,
                observations: seen,
                ..TrackSet::default()
            });
        }
        let amplitudes_px = log.all().amplitudes_px();
        assert_eq!(amplitudes_px.len(), 2);
        assert!(amplitudes_px[0] == 0.0 && (amplitudes_px[1] - 2.5).abs() < 1e-3);
    }

    /// A minute at 30 frames a second, of which every 15th frame is looked at: a point that sways
    /// once in so many does not seem to stand still. One on trial does not count.
    #[test]
    fn of_a_long_film_some_frames_tell_how_far_points_move() {
        let mut log = TrackLog::new(60.0);
        for k in 0..1800 {
            let mut moving = observation(1, true);
            moving.u_px = 300.0 + 2.5 * (std::f32::consts::TAU * k as f32 / 15.0).sin();
            let mut on_trial = observation(2, false);
            on_trial.u_px = 9.0 * k as f32;
            log.push(TrackSet {
                time_s: k as f64 / 30.0,
                observations: vec![moving, on_trial],
                ..TrackSet::default()
            });
        }
        let amplitudes_px = log.all().amplitudes_px();
        assert_eq!(amplitudes_px.len(), 1);
        assert!((amplitudes_px[0] - 2.5).abs() < 0.05, "{amplitudes_px:?}");
        log.close();
        assert_eq!(log.all().amplitudes_px(), amplitudes_px);
    }

    #[test]
    fn memory_does_not_grow_with_the_film() {
        let mut log = TrackLog::new(10.0);
        (0..5000).for_each(|k| drop(log.push(set(k))));
        assert_eq!(log.all().len(), 101);
    }
}

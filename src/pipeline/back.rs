//! The back end: tracks to tree and poses.

use super::film_log::FilmLog;
use super::pose_tracker::{PoseTracker, Targets};
use super::refiner::{Refiner, SolveJob, Taken};
use crate::cancel::CancelToken;
use crate::config::{Config, ConfigError, check_strokes};
use crate::hierarchy::{self, Evidence};
use crate::model::{
    Outline, Phase, Pose, RawFrame, Rgb, StillNeeded, TrackLog, TrackSet, WoodSeen, WoodSight,
};
use crate::motion::Binding;
use crate::solve::{LEAST_MOVING, Model, identify_sub_branches, solve};
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Instant;

/// Time between two judgements of the evidence, s.
const JUDGE_EVERY_S: f64 = 0.5;
/// At the end of the frames no tree is built from less evidence than this (accumulation measure).
pub const LEAST_MEASURE: f64 = 0.1;
/// A stem without branches is a tree after so many times `accumulate.min_s`: until then some more
/// film may tell its branches apart.
const STEM_SPANS: f64 = 2.0;

/// A frame that has been through the front end.
#[derive(Clone, Debug)]
pub struct Followed {
    pub tracks: TrackSet,
    pub outline: Arc<Outline>,
    pub preview: Option<Arc<Rgb>>,
    /// The frame as it came, where it is known.
    pub raw: Option<Arc<RawFrame>>,
    pub received: Instant,
}

/// A frame that has been through the back end.
#[derive(Clone, Debug)]
pub struct Moved {
    pub tracks: TrackSet,
    pub outline: Arc<Outline>,
    pub preview: Option<Arc<Rgb>>,
    pub received: Instant,
    /// Where the tracks put each measured node, px; empty before the tree is built.
    pub targets_px: Targets,
    /// The posture in this frame, once there is a tree.
    pub pose: Option<Arc<Pose>>,
    /// In the frame with which a tree, or a refined one, comes into effect: poses and targets of
    /// the frames remembered from before, oldest first.
    pub before: Vec<(Pose, Targets)>,
}

/// Tracks to poses: logs the points, solves for the tree when enough motion has accumulated, then
/// poses it in every frame and solves again as motion goes on.
pub struct BackEnd {
    config: Config,
    log: TrackLog,
    film: FilmLog,
    evidence: Evidence,
    judged_s: Option<f64>,
    outline: Option<Arc<Outline>>,
    tracker: Option<PoseTracker>,
    refiner: Option<Refiner>,
    build_now: bool,
    /// The tree is built with the next frame.
    building: Option<Why>,
    /// A build was asked for, and there was too little to build from.
    refused: bool,
    /// The newest frame each time that the wood was to be looked for again.
    asked: BTreeSet<u64>,
    /// The same of the run whose log is worked off, as far as it is still to come.
    to_ask: BTreeSet<u64>,
}

/// What a build is due to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Why {
    /// The measure has reached its threshold.
    Enough,
    /// The user asked.
    Asked,
}

impl BackEnd {
    pub fn new(config: &Config) -> Self {
        Self {
            config: config.clone(),
            log: TrackLog::new(remembered_s(config)),
            film: FilmLog::new(config.accumulate.window_s),
            evidence: Evidence::default(),
            judged_s: None,
            outline: None,
            tracker: None,
            refiner: None,
            build_now: false,
            building: None,
            refused: false,
            asked: BTreeSet::new(),
            to_ask: BTreeSet::new(),
        }
    }

    /// Takes the tracks of a frame; gives its pose, once there is a tree.
    pub fn step(&mut self, followed: Followed) -> Moved {
        let Followed {
            tracks,
            outline,
            preview,
            raw,
            received,
        } = followed;
        self.outline = Some(outline.clone());
        if let Some(raw) = raw {
            self.film.push(raw, &tracks);
        }
        self.ask_as_then(Some(tracks.frame));
        self.log.push(tracks.clone());
        let before = match self.tracker {
            Some(_) => self.refine(),
            None => self.accumulate(tracks.time_s),
        };
        let (pose, targets_px) = match &mut self.tracker {
            Some(tracker) => {
                let (pose, targets_px) = tracker.step(&tracks);
                (Some(Arc::new(pose)), targets_px)
            }
            None => (None, Vec::new()),
        };
        Moved {
            tracks,
            outline,
            preview,
            received,
            targets_px,
            pose,
            before,
        }
    }

    /// Judges the evidence now and then. Where it suffices, or a build is asked for, the tree is
    /// built with the frame after this one, so that the screen can say that it is being built.
    fn accumulate(&mut self, time_s: f64) -> Vec<(Pose, Targets)> {
        let due = self.judged_s.is_none_or(|t| time_s - t >= JUDGE_EVERY_S);
        if !due && self.building.is_none() && !self.build_now {
            return Vec::new();
        }
        self.judged_s = Some(time_s);
        self.judge();
        let e = &self.evidence;
        let moving = e.moving.len();
        tracing::debug!(
            time_s,
            measure = e.measure,
            e.motion,
            e.stability,
            e.sway,
            moving,
            "evidence"
        );
        if let Some(why) = self.building.take() {
            let before = self.build(why);
            self.refused = why == Why::Asked && self.tracker.is_none();
            return before;
        }
        let settings = &self.config.accumulate;
        let window = self.log.last(settings.window_s);
        if e.measure >= settings.threshold && window.span_s() >= settings.min_s {
            self.building = Some(Why::Enough);
        } else if std::mem::take(&mut self.build_now) {
            self.building = Some(Why::Asked);
        }
        Vec::new()
    }

    /// Judges what is remembered.
    fn judge(&mut self) {
        let window = self.log.last(self.config.accumulate.window_s);
        (_, self.evidence) = hierarchy::seen(window, &self.config.accumulate);
    }

    /// Builds, and follows the pose through the remembered frames; gives their poses and targets.
    fn build(&mut self, why: Why) -> Vec<(Pose, Targets)> {
        let Some(outline) = &self.outline else {
            return Vec::new();
        };
        let Some(model) = solve(&self.log, outline, None, &self.config, &CancelToken::new()) else {
            return Vec::new();
        };
        let window = self.log.last(self.config.accumulate.window_s);
        let is_stem = model.hierarchy.clusters.len() < 2;
        let settings = &self.config.accumulate;
        let wait_s = (STEM_SPANS * settings.min_s).min(0.9 * settings.window_s);
        if why == Why::Enough && is_stem && window.span_s() < wait_s {
            return Vec::new();
        }
        let mut refiner = Refiner::new(model.time_s, window.span_s(), &self.config);
        let mut tracker = PoseTracker::new(Arc::new(model), &self.config);
        // The pose is followed from the first remembered frame, so that it does not jump where the
        // tree was built. The newest frame is left out: it is about to be worked off as every later
        // one is.
        let mut before = Vec::with_capacity(window.len());
        for tracks in window.sets().take(window.len() - 1) {
            before.push(tracker.step(tracks));
        }
        if self.config.skeleton.along_wood {
            refiner.seek_wood(&self.log, &self.film, &tracker, &self.config);
        }
        self.tracker = Some(tracker);
        self.refiner = Some(refiner);
        before
    }

    /// Solves anew where it is time to; in the frame with which a new model takes the old one's
    /// place gives poses and targets of the frames that it was followed through.
    fn refine(&mut self) -> Vec<(Pose, Targets)> {
        let (Some(mut refiner), Some(standing)) = (self.refiner.take(), &self.tracker) else {
            return Vec::new();
        };
        // In a log without frames, wood that was found with this one was looked for then: a camera's
        // run was late where its clock said so.
        let newest = self.log.all().newest().map(|set| set.frame);
        if self.film.frames().is_empty() && newest.is_some_and(|f| self.film.has_wood_of(f)) {
            refiner.ask();
        }
        let taken = refiner.step(&self.log, &self.film, standing, &self.config);
        self.refiner = Some(refiner);
        let Some(Taken { tracker, before }) = taken else {
            return Vec::new();
        };
        self.evidence = tracker.model().evidence.clone();
        self.take(tracker);
        before
    }

    /// A job that has to be worked out by the time that [`needs_model`](Self::needs_model) says.
    /// Who can do so meanwhile hands the result in with [`put_model`](Self::put_model); else it is
    /// done in that frame. The result is the same.
    pub fn job(&self) -> Option<&Arc<SolveJob>> {
        self.refiner.as_ref()?.job()
    }

    /// Whether a frame of this time needs the result of the job.
    pub fn needs_model(&self, time_s: f64) -> bool {
        self.refiner.as_ref().is_some_and(|r| r.is_due(time_s))
    }

    /// Lets frames up to this time do without the result. What comes of it then hangs on the clock:
    /// for a camera, which does not wait.
    pub fn put_off_model(&mut self, time_s: f64) {
        if let Some(refiner) = &mut self.refiner {
            refiner.put_off(time_s);
        }
    }

    /// Takes the result of [`job`](Self::job).
    pub fn put_model(&mut self, model: Option<Model>) {
        if let Some(refiner) = &mut self.refiner {
            refiner.put(model);
        }
    }

    /// The lines along branches that the wood is looked for with, px.
    pub fn strokes_px(&self) -> &[Vec<[f64; 2]>] {
        &self.config.skeleton.strokes_px
    }

    /// Looks for the wood with one more line along a branch, px; again and soon, where there is a
    /// tree. [`job`](Self::job) is another one then. Points and tree are kept.
    ///
    /// # Errors
    /// It leads from no place to another, or there are too many. Nothing is changed then.
    pub fn add_stroke(&mut self, stroke_px: Vec<[f64; 2]>) -> Result<(), ConfigError> {
        let strokes_px = &mut self.config.skeleton.strokes_px;
        strokes_px.push(stroke_px);
        if let Err(e) = check_strokes(strokes_px) {
            strokes_px.pop();
            return Err(e);
        }
        self.seek_wood_again();
        Ok(())
    }

    /// The same without the line that came last; `false` where there is none.
    pub fn take_back_stroke(&mut self) -> bool {
        let had_one = self.config.skeleton.strokes_px.pop().is_some();
        if had_one {
            self.seek_wood_again();
        }
        had_one
    }

    fn seek_wood_again(&mut self) {
        if let Some(refiner) = &mut self.refiner
            && self.config.skeleton.along_wood
        {
            refiner.ask();
            let newest = self.log.all().newest().map(|set| set.frame);
            self.asked.extend(newest);
        }
    }

    /// After which frames the wood was to be looked for again, as the user had drawn.
    pub fn asked(&self) -> &BTreeSet<u64> {
        &self.asked
    }

    /// Takes those of the run whose log is worked off: the wood is looked for again when it was
    /// then.
    pub fn put_asked(&mut self, asked: BTreeSet<u64>) {
        self.to_ask = asked;
    }

    /// Asks for what the run had asked for before the frame `next`, or after its last one.
    fn ask_as_then(&mut self, next: Option<u64>) {
        let later = next.map_or(BTreeSet::new(), |next| self.to_ask.split_off(&next));
        if !std::mem::replace(&mut self.to_ask, later).is_empty() {
            self.seek_wood_again();
        }
    }

    /// Whether there is a tree along wood that is still to be looked for with what the user drew.
    pub fn has_unused_strokes(&self) -> bool {
        let has_wood = self.model().is_some_and(|model| model.wood.is_some());
        has_wood && self.refiner.as_ref().is_some_and(Refiner::seeks_wood)
    }

    /// Build with the next frame, whatever the measure says.
    pub fn build_now(&mut self) {
        self.build_now = true;
    }

    /// Whether a build was asked for since the last call and there was too little to build from.
    pub fn take_refusal(&mut self) -> bool {
        std::mem::take(&mut self.refused)
    }

    /// No more frames: if nothing has been built, builds from what there is, unless that is next to
    /// nothing. The wood is looked for where that is still due. A tree that was never refined gets
    /// the sub-branches that a refinement would put on it, if there is enough motion in what is
    /// remembered. `cancel` ends both before.
    pub fn finish(&mut self, cancel: &CancelToken) {
        self.ask_as_then(None);
        self.log.close();
        if self.tracker.is_none() && !self.log.all().is_empty() {
            self.judge();
            let asked = self.build_now || self.building.is_some();
            if asked || self.evidence.measure >= LEAST_MEASURE {
                self.build(Why::Asked);
            }
        }
        // A tree that is there already is not given up for one that may not come.
        if self.refiner.as_ref().is_some_and(Refiner::is_following) {
            self.end_refinement(cancel);
        }
        if let (Some(refiner), Some(standing)) = (&mut self.refiner, &self.tracker) {
            refiner.begin_asked(&self.log, &self.film, standing, &self.config);
        }
        self.end_refinement(cancel);
        self.identify_sub_branches(cancel);
    }

    /// Takes what the end is not to come without.
    fn end_refinement(&mut self, cancel: &CancelToken) {
        let refiner = self.refiner.as_mut();
        if let Some(model) = refiner.and_then(|refiner| refiner.end(cancel)) {
            self.take(PoseTracker::new(Arc::new(model), &self.config));
        }
    }

    /// A new model takes effect.
    fn take(&mut self, tracker: PoseTracker) {
        let model = tracker.model();
        if let Some(wood) = &model.wood {
            self.film.note_wood(model.frame, wood.clone());
        }
        self.tracker = Some(tracker);
    }

    /// Whether the wood of the tree is seen.
    pub fn wood_sight(&self) -> WoodSight {
        let Some(model) = self.model().filter(|_| self.config.skeleton.along_wood) else {
            return WoodSight::NotSought;
        };
        if model.wood.is_some() {
            WoodSight::Seen
        } else if self.refiner.as_ref().is_some_and(Refiner::seeks_wood) {
            WoodSight::Sought
        } else {
            WoodSight::NotSeen
        }
    }

    /// The wood that was found in this film when it was there.
    pub fn put_wood(&mut self, wood: WoodSeen) {
        self.film.put_wood(wood);
    }

    /// The wood that was found.
    pub fn wood(&self) -> &WoodSeen {
        self.film.wood()
    }

    fn identify_sub_branches(&mut self, cancel: &CancelToken) {
        let Some(tracker) = &self.tracker else {
            return;
        };
        let standing = tracker.model();
        if standing.refinements > 0 || self.config.accumulate.refine_s <= 0.0 {
            return;
        }
        let prior = standing.joined_by(tracker.binding());
        if let Some(model) = identify_sub_branches(&self.log, &prior, &self.config, cancel) {
            let model = Model {
                // The capture's poses are followed as those of the tree without them were shown.
                followed_from: standing.followed_from,
                shown_from: standing.shown_from,
                // Built just now from the same film, it is no other tree.
                refinements: u32::from(model.frame != standing.frame),
                ..model
            };
            self.tracker = Some(PoseTracker::new(Arc::new(model), &self.config));
        }
    }

    /// Forgets tracks and tree.
    pub fn restart(&mut self) {
        *self = Self::new(&self.config);
    }

    /// The points of the last seconds.
    pub fn log(&self) -> &TrackLog {
        &self.log
    }

    pub fn model(&self) -> Option<&Arc<Model>> {
        self.tracker.as_ref().map(PoseTracker::model)
    }

    /// The binding of tracks to nodes, later tracks included.
    pub fn binding(&self) -> Option<&Binding> {
        self.tracker.as_ref().map(PoseTracker::binding)
    }

    /// The outline of the newest frame.
    pub fn outline(&self) -> Option<&Arc<Outline>> {
        self.outline.as_ref()
    }

    pub fn evidence(&self) -> &Evidence {
        &self.evidence
    }

    /// What is being done, and how far it is, 0 to 1.
    pub fn phase(&self) -> (Phase, f64) {
        match &self.tracker {
            Some(_) => (Phase::Live, 1.0),
            None if self.log.all().len() < 2 => (Phase::Detect, 0.0),
            None if self.building.is_some() => (Phase::Build, 1.0),
            None => (Phase::Accumulate, self.gathered()),
        }
    }

    /// Share of the motion that has been seen of that which the tree takes, 0 to 1.
    fn gathered(&self) -> f64 {
        let threshold = self.config.accumulate.threshold.max(f64::MIN_POSITIVE);
        (self.evidence.measure / threshold).min(1.0)
    }

    /// What the tree still waits for; nothing where it stands.
    pub fn still_needed(&self) -> StillNeeded {
        if self.tracker.is_some() {
            return StillNeeded::default();
        }
        let settings = &self.config.accumulate;
        let seen_s = self.log.last(settings.window_s).span_s();
        StillNeeded {
            motion: self.evidence.moving.len() < LEAST_MOVING,
            before_tree_s: (settings.min_s - seen_s).max(0.0),
            for_sway_s: 0.0,
        }
    }
}

/// Film that is remembered, s: what trees are built from, and what the sway is analysed in.
fn remembered_s(config: &Config) -> f64 {
    config.accumulate.window_s.max(config.dynamics.window_s)
}

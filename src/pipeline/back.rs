//! The back end: tracks to tree and poses.

use super::refiner::Refiner;
use super::{Moment, Poser, Refinement, Targets, Tree, build};
use crate::cancel::CancelToken;
use crate::config::Config;
use crate::hierarchy::{self, Evidence, TrackHistory};
use crate::model::{Outline, Phase, Pose, Rgb, TrackSet, TrackTable};
use crate::motion::Binding;
use std::sync::Arc;
use std::time::Instant;

/// Time between two judgements of the evidence, s.
const JUDGE_EVERY_S: f64 = 0.5;
/// At the end of the frames no tree is built from less evidence than this (accumulation measure).
pub const LEAST_MEASURE: f64 = 0.1;

/// A frame that has been through the front end.
#[derive(Clone, Debug)]
pub struct Followed {
    pub tracks: TrackSet,
    pub outline: Arc<Outline>,
    pub preview: Option<Arc<Rgb>>,
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

/// Tracks to poses: gathers motion, builds the tree, then poses it in every frame and refines it as
/// motion goes on.
pub struct BackEnd {
    config: Config,
    history: TrackHistory,
    evidence: Evidence,
    judged_s: Option<f64>,
    outline: Option<Arc<Outline>>,
    live: Option<Live>,
    refiner: Option<Refiner>,
    build_now: bool,
    /// The tree is built with the next frame.
    building: Option<Why>,
    /// A build was asked for, and there was too little to build from.
    refused: bool,
}

/// What a build is due to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Why {
    /// The measure has reached its threshold.
    Enough,
    /// The user asked.
    Asked,
}

/// A tree and the pose that it has come to.
pub(super) struct Live {
    pub tree: Arc<Tree>,
    pub poser: Poser,
}

impl BackEnd {
    pub fn new(config: &Config) -> Self {
        Self {
            config: config.clone(),
            history: TrackHistory::new(config.accumulate.window_s),
            evidence: Evidence::default(),
            judged_s: None,
            outline: None,
            live: None,
            refiner: None,
            build_now: false,
            building: None,
            refused: false,
        }
    }

    /// Takes the tracks of a frame; gives its pose, once there is a tree.
    pub fn step(&mut self, followed: Followed) -> Moved {
        let Followed {
            tracks,
            outline,
            preview,
            received,
        } = followed;
        self.outline = Some(outline.clone());
        let mut before = Vec::new();
        if self.live.is_none() {
            self.history.push(tracks.clone());
            before = self.accumulate(tracks.time_s);
        } else if self.refiner.is_some() {
            self.history.push(tracks.clone());
            before = self.refine();
        }
        let (targets_px, pose) = match &mut self.live {
            Some(live) => {
                let (pose, targets_px) = live.poser.step(&tracks);
                (targets_px, Some(Arc::new(pose)))
            }
            None => (Vec::new(), None),
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
        let table = self.judge();
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
            let before = self.build(&table, why == Why::Asked);
            self.refused = why == Why::Asked && self.live.is_none();
            return before;
        }
        let settings = &self.config.accumulate;
        if e.measure >= settings.threshold && self.history.span_s() >= settings.min_s {
            self.building = Some(Why::Enough);
        } else if std::mem::take(&mut self.build_now) {
            self.building = Some(Why::Asked);
        }
        Vec::new()
    }

    /// Judges what is remembered; gives the table of tracks whose rows the evidence names.
    fn judge(&mut self) -> Arc<TrackTable> {
        let table = Arc::new(self.history.table(1.0 / hierarchy::COMPARE_HZ));
        self.evidence = hierarchy::evidence(&table, &self.config.accumulate);
        table
    }

    /// Builds, and follows the pose through the remembered frames; gives their poses and targets.
    fn build(&mut self, table: &Arc<TrackTable>, forced: bool) -> Vec<(Pose, Targets)> {
        let (Some(outline), Some(moment)) = (&self.outline, Moment::of(&self.history, forced))
        else {
            return Vec::new();
        };
        let Some(tree) = build(table, self.evidence.clone(), outline, &self.config, moment) else {
            return Vec::new();
        };
        let mut live = Live {
            poser: tree.poser(&self.config),
            tree: Arc::new(tree),
        };
        // The pose is followed from the first remembered frame, so that it does not jump where the
        // tree was built. The newest frame is left out: it is about to be worked off as every later
        // one is.
        let mut before = Vec::with_capacity(self.history.len());
        for tracks in self.history.sets().take(self.history.len() - 1) {
            before.push(live.poser.step(tracks));
        }
        self.live = Some(live);
        let refiner = Refiner::new(moment.time_s, self.history.span_s(), &self.config);
        self.keep_on(refiner);
        before
    }

    /// Goes on with `refiner`, and remembers for as long as it is not over.
    fn keep_on(&mut self, refiner: Refiner) {
        self.refiner = Some(refiner).filter(|r| !r.is_over());
        if self.refiner.is_none() {
            self.history.clear();
        }
    }

    /// Refines the tree where it is time to; in the frame with which a new one takes the old one's
    /// place gives poses and targets of the frames that it was followed through.
    fn refine(&mut self) -> Vec<(Pose, Targets)> {
        let (Some(mut refiner), Some(live)) = (self.refiner.take(), &self.live) else {
            return Vec::new();
        };
        let taken = refiner.step(&self.history, live, &self.config);
        self.keep_on(refiner);
        let Some((live, before)) = taken else {
            return Vec::new();
        };
        self.evidence = live.tree.evidence.clone();
        self.live = Some(live);
        before
    }

    /// A refinement that has to be worked out by the time that
    /// [`needs_refinement`](Self::needs_refinement) tells. Who can do so meanwhile hands it in with
    /// [`put_refinement`](Self::put_refinement); else it is done in that frame. The result is the
    /// same.
    pub fn refinement(&self) -> Option<&Arc<Refinement>> {
        self.refiner.as_ref()?.work()
    }

    /// Whether a frame of this time needs the result of the refinement.
    pub fn needs_refinement(&self, time_s: f64) -> bool {
        self.refiner.as_ref().is_some_and(|r| r.is_due(time_s))
    }

    /// Lets frames up to this time do without the result. What comes of it then hangs on the clock:
    /// for a camera, which does not wait.
    pub fn put_off_refinement(&mut self, time_s: f64) {
        if let Some(refiner) = &mut self.refiner {
            refiner.put_off(time_s);
        }
    }

    /// Takes the result of [`refinement`](Self::refinement).
    pub fn put_refinement(&mut self, tree: Option<Tree>) {
        if let Some(refiner) = &mut self.refiner {
            refiner.put(tree);
        }
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
    /// nothing; and a tree that was never refined gets the shoots that a refinement would put on
    /// it, if there is enough motion in what is remembered, and
    /// `cancel` does not end it before.
    pub fn finish(&mut self, cancel: &CancelToken) {
        if self.live.is_none() && !self.history.is_empty() {
            let table = self.judge();
            let asked = self.build_now || self.building.is_some();
            if asked || self.evidence.measure >= LEAST_MEASURE {
                self.build(&table, true);
            }
        }
        self.shoot(cancel);
    }

    fn shoot(&mut self, cancel: &CancelToken) {
        let Some(live) = self.live.as_ref().filter(|live| live.tree.refinements == 0) else {
            return;
        };
        let Some(work) = Refinement::of(&self.history, live, &self.config) else {
            return;
        };
        if let Some(mut tree) = work.shoots_while(cancel) {
            let standing = &live.tree;
            // The capture's poses are followed as those of the tree without them were shown.
            (tree.followed_from, tree.shown_from) = (standing.followed_from, standing.shown_from);
            // Built just now from the same film, it is no other tree.
            tree.refinements -= u32::from(tree.frame == standing.frame);
            self.live = Some(Live {
                poser: tree.poser(&self.config),
                tree: Arc::new(tree),
            });
        }
    }

    /// Forgets tracks and tree.
    pub fn restart(&mut self) {
        *self = Self::new(&self.config);
    }

    pub fn tree(&self) -> Option<&Arc<Tree>> {
        self.live.as_ref().map(|l| &l.tree)
    }

    /// The binding of tracks to nodes, later tracks included.
    pub fn binding(&self) -> Option<&Binding> {
        self.live.as_ref().map(|l| &l.poser.binding)
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
        match &self.live {
            Some(_) => (Phase::Live, 1.0),
            None if self.history.len() < 2 => (Phase::Detect, 0.0),
            None if self.building.is_some() => (Phase::Build, 1.0),
            None => (Phase::Accumulate, self.evidence.measure),
        }
    }
}

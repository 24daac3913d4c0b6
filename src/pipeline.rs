//! The whole algorithm on one screen: what arborcam means, one synchronous step per frame.
//!
//! The front end finds the outline and follows points; the back end gathers their motion, builds the tree once, and
//! from then on poses it. `runtime` runs the same two halves on threads of their own.

use crate::config::Config;
use crate::hierarchy::{self, Evidence};
use crate::model::{Frame, Luma, MotionHierarchy, NodeId, Outline, Phase, Pose, Rgb, Skeleton, TrackId, TrackSet};
use crate::motion::{Binding, PoseEstimator};
use crate::outline::{AutoOutline, Found};
use crate::track::{TrackHistory, TrackTable, Tracker};
use crate::{shape, skeleton};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Instant;

/// Frames kept while the outline is not known yet take at most so many bytes; beyond that the oldest is let go.
const HELD_BYTES: usize = 48 << 20;
/// Frames worked off in one step while held ones remain: catches up without a long pause.
const FRAMES_PER_STEP: usize = 3;
/// Time between two judgements of the evidence, s.
const JUDGE_EVERY_S: f64 = 0.5;
/// Fewer moving points than this make no tree, whatever is asked.
pub const LEAST_MOVING: usize = 16;
/// Share of the outline's width at the foot that is trunk: outlines are drawn wide.
const TRUNK_SHARE: f64 = 0.6;
/// Radius of the last twig, px.
const TIP_RADIUS_PX: f64 = 0.6;

/// Both halves in one thread.
pub struct Pipeline {
    pub front: FrontEnd,
    pub back: BackEnd,
}

impl Pipeline {
    pub fn new(config: &Config, outline: Option<Outline>) -> Self {
        Self { front: FrontEnd::new(config, outline), back: BackEnd::new(config) }
    }

    /// One frame in; what became of it and of frames held back before, in order.
    pub fn step(&mut self, frame: Frame) -> Vec<Moved> {
        self.front.step(frame).into_iter().map(|followed| self.back.step(followed)).collect()
    }

    /// No more frames: works off what is held and builds from what there is.
    pub fn finish(&mut self) -> Vec<Moved> {
        let moved = self.front.flush().into_iter().map(|followed| self.back.step(followed)).collect();
        self.back.finish();
        moved
    }
}

/// A frame that has been through the front end.
#[derive(Clone, Debug)]
pub struct Followed {
    pub tracks: TrackSet,
    pub outline: Arc<Outline>,
    pub preview: Option<Arc<Rgb>>,
    pub received: Instant,
}

/// Frame to tracks: outline, detection, tracking.
pub struct FrontEnd {
    config: Config,
    /// What the user gave; `None` finds it by motion.
    given: Option<Arc<Outline>>,
    search: AutoOutline,
    found: Option<(Arc<Outline>, Tracker)>,
    held: VecDeque<Frame>,
    next_id: u32,
    spare: Option<Luma>,
    progress: f64,
    /// Frames that went by before there was an outline.
    pub let_go: u64,
    pub no_motion: bool,
}

impl FrontEnd {
    pub fn new(config: &Config, outline: Option<Outline>) -> Self {
        Self {
            config: config.clone(),
            given: outline.map(Arc::new),
            search: AutoOutline::new(&config.outline),
            found: None,
            held: VecDeque::new(),
            next_id: 0,
            spare: None,
            progress: 0.0,
            let_go: 0,
            no_motion: false,
        }
    }

    /// Takes a frame; gives back up to three that are done, none while the outline is being looked for.
    pub fn step(&mut self, frame: Frame) -> Vec<Followed> {
        if self.found.is_none() {
            match &self.given {
                Some(outline) => self.settle(outline.clone()),
                None => match self.search.step(&frame.luma, frame.time_s) {
                    Found::NotYet(progress) => self.progress = progress,
                    Found::Tree(outline) => self.settle(Arc::new(outline)),
                    Found::NoMotion(outline) => {
                        self.no_motion = true;
                        self.settle(Arc::new(outline));
                    }
                },
            }
        }
        self.held.push_back(frame);
        if self.found.is_none() {
            while self.held.iter().map(|f| f.luma.pixels.len()).sum::<usize>() > HELD_BYTES {
                self.held.pop_front();
                self.let_go += 1;
            }
            return Vec::new();
        }
        let n = self.held.len().min(FRAMES_PER_STEP);
        (0..n).filter_map(|_| self.follow_next()).collect()
    }

    /// Works off all held frames; an outline that was still looked for is what the frames so far show.
    pub fn flush(&mut self) -> Vec<Followed> {
        if self.found.is_none()
            && let Some(size) = self.held.back().map(|f| f.luma.size)
        {
            let outline = self.search.conclude(size);
            self.no_motion = outline.is_none();
            self.settle(Arc::new(outline.unwrap_or_else(|| crate::outline::whole(size))));
        }
        std::iter::from_fn(|| self.follow_next()).collect()
    }

    /// Starts again, with a new outline if one is given. Track ids go on.
    pub fn restart(&mut self, outline: Option<Outline>) {
        if let Some((_, tracker)) = self.found.take() {
            self.next_id = tracker.next_id();
        }
        self.given = outline.map(Arc::new).or(self.given.take());
        self.search = AutoOutline::new(&self.config.outline);
        self.held.clear();
        (self.progress, self.no_motion) = (0.0, false);
    }

    /// How far the search for the outline is, 0 to 1; `None` when it is over.
    pub fn searching(&self) -> Option<f64> {
        self.found.is_none().then_some(self.progress)
    }

    /// A picture buffer that is no longer needed, to decode the next frame into.
    pub fn spare(&mut self) -> Option<Luma> {
        self.spare.take()
    }

    fn settle(&mut self, outline: Arc<Outline>) {
        let tracker = Tracker::new(&self.config.detect, &self.config.track, &outline, self.next_id);
        self.found = Some((outline, tracker));
    }

    fn follow_next(&mut self) -> Option<Followed> {
        let (outline, tracker) = self.found.as_mut()?;
        let frame = self.held.pop_front()?;
        let tracks = tracker.step(&frame);
        self.spare = Some(frame.luma);
        Some(Followed { tracks, outline: outline.clone(), preview: frame.preview, received: frame.received })
    }
}

/// The built tree and what it was built from.
#[derive(Clone, Debug)]
pub struct Tree {
    pub hierarchy: MotionHierarchy,
    pub skeleton: Arc<Skeleton>,
    /// Rest position of every track that was there when the tree was built, px.
    pub rest_px: BTreeMap<TrackId, [f64; 2]>,
    pub outline: Arc<Outline>,
    /// Frame after which it was built, and its time.
    pub frame: u64,
    pub time_s: f64,
    pub evidence: Evidence,
    /// Built before the measure reached its threshold: asked for, or at the end of the frames.
    pub forced: bool,
}

impl Tree {
    pub fn binding(&self) -> Binding {
        Binding::new(&self.hierarchy, &self.rest_px, &self.skeleton)
    }

    pub fn estimator(&self, config: &Config) -> PoseEstimator {
        PoseEstimator::new(self.skeleton.clone(), &config.motion)
    }
}

/// Tracks to tree: evidence, hierarchy, 2D skeleton, 3D skeleton. `None` if too few points move.
pub fn build(
    table: &TrackTable,
    evidence: Evidence,
    outline: &Arc<Outline>,
    config: &Config,
    (frame, time_s, forced): (u64, f64, bool),
) -> Option<Tree> {
    if evidence.moving.len() < LEAST_MOVING {
        return None;
    }
    let hierarchy = hierarchy::build(table, &evidence.moving, &config.hierarchy);
    if hierarchy.clusters.first().is_none_or(|all| all.members.len() < LEAST_MOVING) {
        return None;
    }
    let flat = skeleton::build(&hierarchy, outline, &config.skeleton);
    let points = |n: &skeleton::Node2d| n.cluster.map_or(0, |c| c.0 as usize);
    let tracks: Vec<u32> = flat.iter().map(|n| hierarchy.clusters[points(n)].members.len() as u32).collect();
    let mut skeleton = shape::build(&flat, &tracks, outline, &config.shape);
    let trunk_px = TRUNK_SHARE * skeleton::foot_half_width_px(outline);
    shape::pipe_model(&mut skeleton, trunk_px.max(2.0 * TIP_RADIUS_PX), TIP_RADIUS_PX);
    let rest = |row: usize| (table.ids[row], hierarchy::rest_position_px(table, row));
    Some(Tree {
        rest_px: (0..table.ids.len()).map(rest).collect(),
        hierarchy,
        skeleton: Arc::new(skeleton),
        outline: outline.clone(),
        frame,
        time_s,
        evidence,
        forced,
    })
}

/// A frame that has been through the back end.
#[derive(Clone, Debug)]
pub struct Moved {
    pub tracks: TrackSet,
    pub outline: Arc<Outline>,
    pub preview: Option<Arc<Rgb>>,
    pub received: Instant,
    /// Where the tracks put each measured node, px; empty before the tree is built.
    pub targets_px: Vec<Option<[f64; 2]>>,
    /// The posture in this frame, once there is a tree.
    pub pose: Option<Arc<Pose>>,
}

/// Tracks to poses: gathers motion, builds the tree, then poses it in every frame.
pub struct BackEnd {
    config: Config,
    history: TrackHistory,
    evidence: Evidence,
    judged_s: Option<f64>,
    outline: Option<Arc<Outline>>,
    live: Option<Live>,
    build_now: bool,
}

struct Live {
    tree: Arc<Tree>,
    binding: Binding,
    estimator: PoseEstimator,
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
            build_now: false,
        }
    }

    /// Takes the tracks of a frame; gives its pose, once there is a tree.
    pub fn step(&mut self, followed: Followed) -> Moved {
        let Followed { tracks, outline, preview, received } = followed;
        self.outline = Some(outline.clone());
        if self.live.is_none() {
            self.history.push(tracks.clone());
            self.accumulate(tracks.time_s);
        }
        let (targets_px, pose) = match &mut self.live {
            Some(live) => {
                let targets = live.binding.targets_px(&tracks);
                let pose = live.estimator.step(tracks.frame, tracks.time_s, &targets);
                (targets, Some(Arc::new(pose)))
            }
            None => (Vec::new(), None),
        };
        Moved { tracks, outline, preview, received, targets_px, pose }
    }

    /// Judges the evidence now and then, and builds when it suffices or when asked.
    fn accumulate(&mut self, time_s: f64) {
        let due = self.judged_s.is_none_or(|t| time_s - t >= JUDGE_EVERY_S);
        if !due && !self.build_now {
            return;
        }
        self.judged_s = Some(time_s);
        self.evidence = hierarchy::evidence_of(&self.history, &self.config.accumulate);
        let e = &self.evidence;
        tracing::debug!(time_s, measure = e.measure, e.motion, e.stability, e.sway, moving = e.moving.len(), "evidence");
        let settings = &self.config.accumulate;
        let enough = self.evidence.measure >= settings.threshold && self.history.span_s() >= settings.min_s;
        if enough || self.build_now {
            self.build(!enough);
        }
        self.build_now = false;
    }

    fn build(&mut self, forced: bool) {
        let (Some(outline), Some(last)) = (self.outline.clone(), self.history.last()) else { return };
        let moment = (last.frame, last.time_s, forced);
        let table = self.history.table(1.0 / hierarchy::COMPARE_HZ);
        let Some(tree) = build(&table, self.evidence.clone(), &outline, &self.config, moment) else { return };
        self.live =
            Some(Live { binding: tree.binding(), estimator: tree.estimator(&self.config), tree: Arc::new(tree) });
        self.history.clear();
    }

    /// Build with the next frame, whatever the measure says.
    pub fn build_now(&mut self) {
        self.build_now = true;
    }

    /// No more frames: if nothing has been built, builds from what there is.
    pub fn finish(&mut self) {
        if self.live.is_none() && !self.history.is_empty() {
            self.evidence = hierarchy::evidence_of(&self.history, &self.config.accumulate);
            self.build(true);
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
        self.live.as_ref().map(|l| &l.binding)
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
            None if self.build_now => (Phase::Build, 1.0),
            None => (Phase::Accumulate, self.evidence.measure),
        }
    }
}

/// Poses of frames that are over, as they were or would have been live: frames up to the build start from the rest
/// pose, and so do those after it.
pub struct Retrace {
    tree: Arc<Tree>,
    before: (Binding, PoseEstimator),
    after: (Binding, PoseEstimator),
}

impl Retrace {
    pub fn new(tree: &Arc<Tree>, config: &Config) -> Self {
        let fresh = || (tree.binding(), tree.estimator(config));
        Self { tree: tree.clone(), before: fresh(), after: fresh() }
    }

    /// The pose in the next frame, and where its tracks put the measured nodes (px); frames must come in their order.
    pub fn step(&mut self, tracks: &TrackSet) -> (Pose, Vec<Option<[f64; 2]>>) {
        let live = tracks.frame >= self.tree.frame;
        let (binding, estimator) = if live { &mut self.after } else { &mut self.before };
        let targets = binding.targets_px(tracks);
        let pose = estimator.step(tracks.frame, tracks.time_s, &targets);
        (pose, targets)
    }

    /// The deepest node that a track belongs to, as known after the last step.
    pub fn node_of(&self, track: TrackId) -> Option<NodeId> {
        self.after.0.node_of(track)
    }
}

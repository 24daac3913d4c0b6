//! When the model is solved anew, and how the new one takes the old one's place without a pause or
//! a jump.

use super::film_log::FilmLog;
use super::pose_tracker::{PoseTracker, Targets};
#[cfg(all(feature = "camera", feature = "opencv"))]
use super::wood::find_wood;
use crate::cancel::CancelToken;
use crate::config::{self, Config};
use crate::model::{LogWindow, Outline, Pose, Skeleton, TrackLog, Wood};
use crate::solve::{Model, solve, with_wood};
use std::sync::Arc;

/// The tree is built anew each time that film has grown by this factor: the error of a correlation
/// falls with the square root of the time, so equal steps would bring ever less.
const GROWTH: f64 = 1.25;
/// Less film than this does not grow by factors, s.
const LEAST_SPAN_S: f64 = 1.0;
/// Film after which a refinement of up to [`POINTS`] points is ready, s. More points take longer by
/// the square of their number. It is a matter of film and not of the clock, so that threads change
/// nothing.
const READY_S: f64 = 0.5;
const POINTS: f64 = 400.0;
/// Film that has to go by, besides, for the wood of a picture of up to [`PIXELS`] pixels, s. Larger
/// ones take longer by their number of pixels.
const WOOD_READY_S: f64 = 1.5;
const PIXELS: f64 = 640.0 * 360.0;
/// Remembered frames through which the new tree's pose is followed in the time of one frame.
const FRAMES_PER_STEP: usize = 30;

/// All that a better model needs, apart from everything that goes on meanwhile: it can be worked
/// out on any thread.
pub struct SolveJob {
    aim: Aim,
    log: TrackLog,
    film: FilmLog,
    outline: Arc<Outline>,
    prior: Model,
    config: Config,
}

/// What a model is worked out for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Aim {
    /// The tree that was just built, along the wood that is seen.
    Wood,
    /// The tree from all that was seen since.
    Refinement,
    /// The same, as the user has drawn along branches: along wood that is looked for with what he
    /// drew, even where the tree stays what it is.
    Strokes,
}

impl SolveJob {
    fn new(
        aim: Aim,
        log: &TrackLog,
        film: &FilmLog,
        standing: &PoseTracker,
        config: &Config,
    ) -> Self {
        Self {
            aim,
            log: log.clone(),
            film: film.clone(),
            outline: standing.model().outline.clone(),
            prior: standing.model().joined_by(standing.binding()),
            config: config.clone(),
        }
    }

    /// Film after which the result is due, s.
    fn ready_s(&self) -> f64 {
        let newest = self.log.all().newest();
        let n_points = newest.map_or(0, |set| set.counted().count());
        let solved_s = READY_S * (n_points as f64 / POINTS).powi(2).max(1.0);
        let n_pixels = self.outline.size.area() as f64;
        // Not a matter of the frames: a capture that is finished from its log has none.
        let wood_s = if self.config.skeleton.along_wood {
            WOOD_READY_S * (n_pixels / PIXELS).max(1.0)
        } else {
            0.0
        };
        solved_s + wood_s
    }

    /// The better model, if there is one; `None`, too, where `cancel` ends the work before.
    pub fn run(&self, cancel: &CancelToken) -> Option<Model> {
        match self.aim {
            Aim::Wood => {
                let wood = self.wood(cancel)?;
                Some(with_wood(&self.prior, Some(wood), None, &self.config))
            }
            Aim::Refinement | Aim::Strokes => self.refined(cancel),
        }
    }

    /// The model from all that was seen. It runs along the wood that the kept frames show; where
    /// none was found yet and some is now, or it was looked for in another way, the prior model
    /// along that is the better one.
    fn refined(&self, cancel: &CancelToken) -> Option<Model> {
        let solved = solve(
            &self.log,
            &self.outline,
            Some(&self.prior),
            &self.config,
            cancel,
        );
        if cancel.is_cancelled() {
            return None;
        }
        let wood = self.wood(cancel);
        let is_other_wood = self.prior.wood.is_none() || self.aim == Aim::Strokes;
        let model = match solved {
            Some(model) => model,
            None if is_other_wood && wood.is_some() => self.followed_anew()?,
            None => return None,
        };
        let wood = wood.or_else(|| self.prior.wood.clone());
        Some(with_wood(&model, wood, Some(&self.prior), &self.config))
    }

    /// The prior model as one that was built just now.
    fn followed_anew(&self) -> Option<Model> {
        let window = self.log.last(self.config.accumulate.window_s);
        let (first, newest) = (window.first()?, window.newest()?);
        Some(Model {
            followed_from: first.frame,
            frame: newest.frame,
            time_s: newest.time_s,
            shown_from: newest.frame,
            refinements: self.prior.refinements + 1,
            kept: self.prior.plain.measured(),
            ..self.prior.clone()
        })
    }

    /// The wood that the kept frames show; where they are gone, what was found in them.
    fn wood(&self, cancel: &CancelToken) -> Option<Arc<Wood>> {
        if self.film.frames().is_empty() {
            return self.wood_found_then();
        }
        let window = self.log.last(self.config.accumulate.window_s);
        let prior = &self.prior.plain;
        let settings = &self.config.skeleton;
        wood_in(&self.film, window, &self.outline, prior, settings, cancel).map(Arc::new)
    }

    /// Of a log without frames: the wood that was found when they were there. The prior tree's own
    /// is none that was found anew, unless it was found with the newest frame.
    fn wood_found_then(&self) -> Option<Arc<Wood>> {
        let newest = self.log.all().newest()?.frame;
        let wood = self.film.wood_by(newest)?;
        let standing = self.prior.wood.as_ref();
        let is_new = standing.is_none_or(|standing| standing.branches != wood.branches);
        (is_new || self.film.has_wood_of(newest)).then(|| wood.clone())
    }
}

#[cfg(all(feature = "camera", feature = "opencv"))]
fn wood_in(
    film: &FilmLog,
    window: LogWindow,
    outline: &Outline,
    prior: &Skeleton,
    settings: &config::Skeleton,
    cancel: &CancelToken,
) -> Option<Wood> {
    find_wood(film, window, outline, prior, settings, cancel)
}

/// Frames are decoded by the camera's crates and looked at by OpenCV. Without them no wood is seen.
#[cfg(not(all(feature = "camera", feature = "opencv")))]
fn wood_in(
    _film: &FilmLog,
    _window: LogWindow,
    _outline: &Outline,
    _prior: &Skeleton,
    _settings: &config::Skeleton,
    _cancel: &CancelToken,
) -> Option<Wood> {
    None
}

/// Looks after the standing model.
pub(super) struct Refiner {
    /// When the tree was built, and how much film it was built from, s.
    built_s: f64,
    span_s: f64,
    stage: Stage,
    /// Wood is being looked for that the tree is not to end without, or the tree along it followed:
    /// the first tree's, or that with what the user has drawn.
    seeks_wood: bool,
    /// The user has drawn, and the wood is still to be looked for with it.
    is_asked: bool,
}

enum Stage {
    /// Until there is more film, s.
    Waiting(f64),
    Solving(Solving),
    Following(Box<Following>),
    Over,
}

/// A job that is due at some time of film, s; with the result where somebody has worked it out
/// before.
struct Solving {
    job: Arc<SolveJob>,
    due_s: f64,
    done: Option<Option<Box<Model>>>,
}

/// A new model whose pose is being followed.
struct Following {
    tracker: PoseTracker,
    /// Frames before this one have been followed; their poses and targets.
    next: u64,
    before: Vec<(Pose, Targets)>,
}

/// A model that takes the place of another, and poses and targets of the frames that it was
/// followed through.
pub(super) struct Taken {
    pub tracker: PoseTracker,
    pub before: Vec<(Pose, Targets)>,
}

impl Refiner {
    /// For a tree that was built at `built_s` from the last `span_s` of film, s.
    pub fn new(built_s: f64, span_s: f64, config: &Config) -> Self {
        let mut refiner = Self {
            built_s,
            span_s: span_s.max(LEAST_SPAN_S),
            stage: Stage::Over,
            seeks_wood: false,
            is_asked: false,
        };
        refiner.wait(built_s, config);
        refiner
    }

    /// Begins to look for the wood of the tree that was just built.
    pub fn seek_wood(
        &mut self,
        log: &TrackLog,
        film: &FilmLog,
        standing: &PoseTracker,
        config: &Config,
    ) {
        self.solve(SolveJob::new(Aim::Wood, log, film, standing, config));
        self.seeks_wood = true;
    }

    /// Whether wood is looked for that the tree is not to end without: the first tree's, or that
    /// with what the user has drawn.
    pub fn seeks_wood(&self) -> bool {
        self.seeks_wood || self.is_asked
    }

    /// Whether a new tree is there, and its pose is being followed.
    pub fn is_following(&self) -> bool {
        matches!(self.stage, Stage::Following(_))
    }

    /// Has the wood looked for again from the next frame on: the user has drawn along branches.
    pub fn ask(&mut self) {
        self.is_asked = true;
    }

    /// Begins what was [asked](Self::ask) for, if anything was, in place of what is being worked
    /// out without it.
    pub fn begin_asked(
        &mut self,
        log: &TrackLog,
        film: &FilmLog,
        standing: &PoseTracker,
        config: &Config,
    ) {
        if !std::mem::take(&mut self.is_asked) {
            return;
        }
        let aim = match &self.stage {
            Stage::Solving(solving) if solving.job.aim == Aim::Wood => Aim::Wood,
            _ => Aim::Strokes,
        };
        self.solve(SolveJob::new(aim, log, film, standing, config));
        self.seeks_wood = true;
    }

    fn solve(&mut self, job: SolveJob) {
        let now_s = job.log.all().newest().map_or(0.0, |set| set.time_s);
        self.stage = Stage::Solving(Solving {
            due_s: now_s + job.ready_s(),
            job: Arc::new(job),
            done: None,
        });
    }

    /// No more frames: the tree along wood that it is not to end without, if that has not taken
    /// effect yet, and `cancel` does not end the work before.
    pub fn end(&mut self, cancel: &CancelToken) -> Option<Model> {
        let stage = std::mem::replace(&mut self.stage, Stage::Over);
        if !self.seeks_wood {
            return None;
        }
        let model = match stage {
            Stage::Solving(Solving {
                done: Some(model), ..
            }) => model.map(|model| *model),
            Stage::Solving(solving) => solving.job.run(cancel),
            Stage::Following(following) => Some(following.tracker.model().as_ref().clone()),
            Stage::Waiting(_) | Stage::Over => None,
        };
        self.seeks_wood = model.is_none() && cancel.is_cancelled();
        model
    }

    /// Waits for the next time after `now_s` by which film has grown enough, if there is one.
    fn wait(&mut self, now_s: f64, config: &Config) {
        self.seeks_wood = false;
        self.stage = Stage::Over;
        let mut growth = GROWTH;
        loop {
            let after_s = self.span_s * (growth - 1.0);
            if after_s > config.accumulate.refine_s {
                return;
            }
            if self.built_s + after_s > now_s {
                self.stage = Stage::Waiting(self.built_s + after_s);
                return;
            }
            growth *= GROWTH;
        }
    }

    /// Takes the next frame, the newest of `log`. Gives the model that takes the place of
    /// `standing` with it, its pose followed up to the frame before.
    pub fn step(
        &mut self,
        log: &TrackLog,
        film: &FilmLog,
        standing: &PoseTracker,
        config: &Config,
    ) -> Option<Taken> {
        let now_s = log.all().newest()?.time_s;
        // To follow a new model takes only some frames.
        if !matches!(self.stage, Stage::Following(_)) {
            self.begin_asked(log, film, standing, config);
        }
        match std::mem::replace(&mut self.stage, Stage::Over) {
            Stage::Waiting(due_s) if now_s >= due_s => {
                let aim = Aim::Refinement;
                self.solve(SolveJob::new(aim, log, film, standing, config));
                None
            }
            Stage::Solving(solving) if now_s >= solving.due_s => {
                let model = match solving.done {
                    Some(model) => model.map(|model| *model),
                    None => solving.job.run(&CancelToken::new()),
                };
                self.begin_to_follow(model, log, config)
            }
            Stage::Following(following) => self.follow(*following, log, config),
            stage => {
                self.stage = stage;
                None
            }
        }
    }

    fn begin_to_follow(
        &mut self,
        model: Option<Model>,
        log: &TrackLog,
        config: &Config,
    ) -> Option<Taken> {
        let window = log.last(config.accumulate.window_s);
        let (first, newest) = (window.first()?, window.newest()?);
        // After a long pause nothing is remembered by which a new model's pose could be followed:
        // it would jump. There will be a better one; but the wood is not left out for that.
        let is_in_time = |model: &Model| self.seeks_wood || first.frame <= model.frame;
        let Some(mut model) = model.filter(is_in_time) else {
            self.wait(newest.time_s, config);
            return None;
        };
        // What has been forgotten meanwhile cannot be followed.
        model.followed_from = model.followed_from.max(first.frame);
        let following = Following {
            tracker: PoseTracker::new(Arc::new(model), config),
            next: 0,
            before: Vec::new(),
        };
        self.follow(following, log, config)
    }

    /// Follows the new model's pose through some of the remembered frames; gives it when only the
    /// newest is left.
    fn follow(
        &mut self,
        mut following: Following,
        log: &TrackLog,
        config: &Config,
    ) -> Option<Taken> {
        let newest = log.all().newest()?;
        let from = following.tracker.model().followed_from.max(following.next);
        let mut left = log
            .all()
            .sets()
            .filter(|set| set.frame >= from && set.frame < newest.frame);
        for set in left.by_ref().take(FRAMES_PER_STEP) {
            following.before.push(following.tracker.step(set));
            following.next = set.frame + 1;
        }
        if left.next().is_some() {
            self.stage = Stage::Following(Box::new(following));
            return None;
        }
        self.wait(newest.time_s, config);
        following.tracker.set_shown_from(newest.frame);
        Some(Taken {
            tracker: following.tracker,
            before: following.before,
        })
    }

    /// A job to be worked out, which the caller may do meanwhile; else it is done when it is due.
    pub fn job(&self) -> Option<&Arc<SolveJob>> {
        match &self.stage {
            Stage::Solving(Solving {
                job, done: None, ..
            }) => Some(job),
            _ => None,
        }
    }

    /// Whether a frame of this time needs the result.
    pub fn is_due(&self, time_s: f64) -> bool {
        matches!(&self.stage, Stage::Solving(s) if s.done.is_none() && time_s >= s.due_s)
    }

    /// Makes the result due after the frame of this time.
    pub fn put_off(&mut self, time_s: f64) {
        if let Stage::Solving(Solving {
            due_s, done: None, ..
        }) = &mut self.stage
        {
            *due_s = due_s.max(time_s.next_up());
        }
    }

    /// The result of [`job`](Self::job).
    pub fn put(&mut self, model: Option<Model>) {
        if let Stage::Solving(solving) = &mut self.stage {
            solving.done = Some(model.map(Box::new));
        }
    }
}

//! When the tree is built anew, and how the new one takes the old one's place without a pause or a
//! jump.

use super::back::Live;
use super::refine::Refinement;
use super::{Poser, Targets, Tree};
use crate::config::Config;
use crate::hierarchy::TrackHistory;
use crate::model::Pose;
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
/// Remembered frames through which the new tree's pose is followed in the time of one frame.
const FRAMES_PER_STEP: usize = 30;

/// Looks after the standing tree.
pub(super) struct Refiner {
    /// When the tree was built, and how much film it was built from, s.
    built_s: f64,
    span_s: f64,
    stage: Stage,
}

enum Stage {
    /// Until there is more film, s.
    Waiting(f64),
    /// Until it is due, s; with the result where somebody has worked it out before.
    Building(Arc<Refinement>, f64, Option<Box<Option<Tree>>>),
    Following(Box<Following>),
    Over,
}

/// A new tree whose pose is being followed.
struct Following {
    tree: Tree,
    poser: Poser,
    /// Frames before this one have been followed; their poses and targets.
    next: u64,
    before: Vec<(Pose, Targets)>,
}

/// A tree that takes the place of another, and poses and targets of the frames that it was followed
/// through.
pub(super) type Taken = (Live, Vec<(Pose, Targets)>);

impl Refiner {
    /// For a tree that was built at `built_s` from the last `span_s` of film, s.
    pub fn new(built_s: f64, span_s: f64, config: &Config) -> Self {
        let mut refiner = Self {
            built_s,
            span_s: span_s.max(LEAST_SPAN_S),
            stage: Stage::Over,
        };
        refiner.wait(built_s, config);
        refiner
    }

    /// No more refinements: nothing has to be remembered.
    pub fn is_over(&self) -> bool {
        matches!(self.stage, Stage::Over)
    }

    /// Waits for the next time after `now_s` by which film has grown enough, if there is one.
    fn wait(&mut self, now_s: f64, config: &Config) {
        let refined_for_s = config.accumulate.refine_s;
        let growths = std::iter::successors(Some(GROWTH), |g| Some(g * GROWTH));
        let mut times = growths
            .map(|g| self.span_s * (g - 1.0))
            .take_while(|&after_s| after_s <= refined_for_s);
        let next = times.find(|after_s| self.built_s + after_s > now_s);
        self.stage = next.map_or(Stage::Over, |after_s| {
            Stage::Waiting(self.built_s + after_s)
        });
    }

    /// Takes the next frame, the newest of `history`. Gives the tree that takes the place of `live`
    /// with it, its pose followed up to the frame before.
    pub fn step(&mut self, history: &TrackHistory, live: &Live, config: &Config) -> Option<Taken> {
        let (first, newest) = (history.first()?, history.last()?);
        let now_s = newest.time_s;
        match std::mem::replace(&mut self.stage, Stage::Over) {
            Stage::Waiting(due_s) if now_s >= due_s => {
                let work = Refinement::of(history, live, config)?;
                let ready_s = READY_S * (work.points() as f64 / POINTS).powi(2).max(1.0);
                self.stage = Stage::Building(Arc::new(work), now_s + ready_s, None);
            }
            Stage::Building(work, due_s, done) if now_s >= due_s => {
                match done.map_or_else(|| work.run(), |tree| *tree) {
                    // After a long pause nothing is remembered by which its pose could be followed:
                    // it would jump. There will be a better one.
                    Some(tree) if first.frame > tree.frame => self.wait(now_s, config),
                    Some(mut tree) => {
                        // What has been forgotten meanwhile cannot be followed.
                        tree.followed_from = tree.followed_from.max(first.frame);
                        let poser = tree.poser(config);
                        return self.follow(
                            Following {
                                tree,
                                poser,
                                next: 0,
                                before: Vec::new(),
                            },
                            history,
                            config,
                        );
                    }
                    None => self.wait(now_s, config),
                }
            }
            Stage::Following(following) => return self.follow(*following, history, config),
            stage => self.stage = stage,
        }
        None
    }

    /// Follows the new tree's pose through some of the remembered frames; gives it when only the
    /// newest is left.
    fn follow(
        &mut self,
        mut on: Following,
        history: &TrackHistory,
        config: &Config,
    ) -> Option<Taken> {
        let newest = history.last()?;
        let from = on.tree.followed_from.max(on.next);
        let mut left = history
            .sets()
            .filter(|set| set.frame >= from && set.frame < newest.frame);
        for set in left.by_ref().take(FRAMES_PER_STEP) {
            on.before.push(on.poser.step(set));
            on.next = set.frame + 1;
        }
        if left.next().is_some() {
            self.stage = Stage::Following(Box::new(on));
            return None;
        }
        self.wait(newest.time_s, config);
        on.tree.shown_from = newest.frame;
        Some((
            Live {
                tree: Arc::new(on.tree),
                poser: on.poser,
            },
            on.before,
        ))
    }

    /// A refinement to be worked out, which whoever asks may do meanwhile; else it is done when it
    /// is due.
    pub fn work(&self) -> Option<&Arc<Refinement>> {
        match &self.stage {
            Stage::Building(work, _, None) => Some(work),
            _ => None,
        }
    }

    /// Whether a frame of this time needs the result.
    pub fn is_due(&self, time_s: f64) -> bool {
        matches!(&self.stage, Stage::Building(_, due_s, None) if time_s >= *due_s)
    }

    /// Makes the result due after the frame of this time.
    pub fn put_off(&mut self, time_s: f64) {
        if let Stage::Building(_, due_s, None) = &mut self.stage {
            *due_s = due_s.max(time_s.next_up());
        }
    }

    /// The result of [`work`](Self::work).
    pub fn put(&mut self, tree: Option<Tree>) {
        if let Stage::Building(_, _, done) = &mut self.stage {
            *done = Some(Box::new(tree));
        }
    }
}

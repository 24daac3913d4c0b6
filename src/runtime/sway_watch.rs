//! The sway during the film, for the screen and the stream.

use super::background::Background;
use super::shared::Shared;
use super::swaying::Swaying;
use crate::config::Dynamics;
use crate::model::{Angles, SwayNow};
use crate::pipeline::{BackEnd, Moved, SwayJob, SwayStage};
use std::sync::Arc;

/// The angles that a screen is shown, s.
const SHOWN_S: f64 = 20.0;

/// The stage, and when it is asked.
pub struct SwayWatch {
    stage: SwayStage,
    swaying: Swaying,
}

impl SwayWatch {
    /// `waits` for results where they are due, as a replay without a pace of its own does.
    pub fn new(
        settings: &Dynamics,
        waits: bool,
        background: Background,
        shared: Arc<Shared>,
    ) -> Self {
        Self {
            stage: SwayStage::new(settings),
            swaying: Swaying::new(settings.every_s, waits, SwayJob::run, background, shared),
        }
    }

    /// Takes the next frame; gives the sway that takes effect with it, of the branches of the
    /// present tree.
    pub fn step(&mut self, moved: &Moved, back: &BackEnd) -> Option<Arc<SwayNow>> {
        let model = back.model()?;
        self.stage.step(moved, back);
        let stage = &self.stage;
        let mut found = self
            .swaying
            .step(moved.tracks.time_s, || stage.job(moved, back))?;
        // It was asked for by a tree that may have been refined since.
        let there = &model.skeleton.nodes[..model.skeleton.measured()];
        found
            .branches
            .retain(|name, _| there.iter().any(|n| n.name == *name));
        for mode in &mut found.modes {
            if !there.iter().any(|n| Some(n.name) == mode.node) {
                mode.forget_branch();
            }
        }
        Some(Arc::new(found))
    }

    /// Forgets tracks and tree.
    pub fn restart(&mut self) {
        self.swaying.restart();
        self.stage.restart();
    }

    /// The angles that the screen shows.
    pub fn shown(&self) -> Angles {
        self.stage.angles(SHOWN_S)
    }

    /// Nobody is asked before the end.
    pub fn is_at_end(&self) -> bool {
        self.stage.settings().every_s <= 0.0
    }

    /// How often a request was due and the last one was still under way.
    pub fn passed_over(&self) -> u64 {
        self.swaying.passed_over()
    }

    /// No more frames.
    pub fn end(&mut self) {
        self.swaying.end();
    }
}

//! The sway while it films: when it is analysed, and the angles of the last seconds.

use super::angles::AngleWindow;
use super::background::Background;
use super::shared::Shared;
use super::swaying::{Request, Swaying, analyse};
use crate::config::Dynamics;
use crate::model::{Angles, Skeleton, SwayNow};
use crate::pipeline::{BackEnd, Moved};
use std::sync::Arc;

/// The angles that a screen is shown, s.
const SHOWN_S: f64 = 20.0;

/// Keeps the window and asks when it is time.
pub struct SwayWatch {
    settings: Dynamics,
    angles: AngleWindow,
    skeleton: Option<Arc<Skeleton>>,
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
            settings: settings.clone(),
            angles: AngleWindow::new(settings.window_s),
            skeleton: None,
            swaying: Swaying::new(settings.every_s, waits, analyse, background, shared),
        }
    }

    /// Takes the next frame; gives the sway that takes effect with it, of the branches of the
    /// present tree.
    pub fn step(&mut self, moved: &Moved, back: &BackEnd) -> Option<Arc<SwayNow>> {
        let skeleton = back.model()?.skeleton.clone();
        if self
            .skeleton
            .as_ref()
            .is_none_or(|s| !Arc::ptr_eq(s, &skeleton))
        {
            self.angles.begin(&skeleton);
            self.skeleton = Some(skeleton.clone());
        }
        moved
            .before
            .iter()
            .for_each(|(pose, _)| self.angles.push(pose));
        if let Some(pose) = &moved.pose {
            self.angles.push(pose);
        }
        let (angles, settings, set) = (&self.angles, &self.settings, &moved.tracks);
        let request = || Request {
            frame: set.frame,
            time_s: set.time_s,
            skeleton: skeleton.clone(),
            log: back.log().clone(),
            nodes: back
                .binding()
                .into_iter()
                .flat_map(|binding| binding.bound())
                .map(|(id, node, _)| (id, node))
                .collect(),
            angles: angles.last(f64::INFINITY),
            settings: settings.clone(),
        };
        let mut found = self.swaying.step(set.time_s, request)?;
        // It was asked for by a tree that may have been refined since.
        let there = &skeleton.nodes[..skeleton.measured()];
        found
            .branches
            .retain(|name, _| there.iter().any(|n| n.name == *name));
        Some(Arc::new(found))
    }

    /// Forgets tracks and tree.
    pub fn restart(&mut self) {
        self.swaying.restart();
        self.angles = AngleWindow::new(self.settings.window_s);
        self.skeleton = None;
    }

    /// The angles that the screen shows.
    pub fn shown(&self) -> Angles {
        self.angles.last(SHOWN_S)
    }

    /// Nobody is asked before the end.
    pub fn is_at_end(&self) -> bool {
        self.settings.every_s <= 0.0
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

//! What the sway is told from while it films: the points and the angles of the last seconds.

use super::angles::AngleWindow;
use super::shared::Shared;
use super::swaying::{Ending, Request, Swaying, analyse};
use crate::config::Dynamics;
use crate::dynamics::FilmLog;
use crate::model::{Angles, Skeleton, SwayNow, TrackId, TrackSet};
use crate::pipeline::{BackEnd, Moved};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The angles that a screen is shown, s.
const SHOWN_S: f64 = 20.0;

/// Keeps the window and asks when it is time.
pub struct SwayWatch {
    settings: Dynamics,
    log: FilmLog,
    angles: AngleWindow,
    /// Points that did not pass their trial, and when: what was seen of them is void.
    void: BTreeMap<TrackId, f64>,
    skeleton: Option<Arc<Skeleton>>,
    swaying: Swaying,
}

impl SwayWatch {
    /// `waits` for results where they are due, as a replay without a pace of its own does.
    pub fn new(settings: &Dynamics, waits: bool, shared: Arc<Shared>) -> Self {
        Self {
            settings: settings.clone(),
            log: FilmLog::new(settings.window_s),
            angles: AngleWindow::new(settings.window_s),
            void: BTreeMap::new(),
            skeleton: None,
            swaying: Swaying::new(settings.every_s, waits, analyse, shared),
        }
    }

    /// Takes the next frame; gives the sway that takes effect with it, of the branches of the
    /// present tree.
    pub fn step(&mut self, moved: &Moved, back: &BackEnd) -> Option<Arc<SwayNow>> {
        if self.settings.every_s > 0.0 {
            self.remember(&moved.tracks);
        }
        let skeleton = back.tree()?.skeleton.clone();
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
        let (log, angles, void, settings) = (&self.log, &self.angles, &self.void, &self.settings);
        let set = &moved.tracks;
        let request = || Request {
            frame: set.frame,
            time_s: set.time_s,
            skeleton: skeleton.clone(),
            log: log.clone(),
            nodes: back
                .binding()
                .into_iter()
                .flat_map(|b| b.bound())
                .filter(|(id, ..)| !void.contains_key(id))
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

    fn remember(&mut self, set: &TrackSet) {
        self.log.push(set);
        self.void
            .extend(set.rejected.iter().map(|id| (*id, set.time_s)));
        if !set.rejected.is_empty() {
            // Nothing is left of them in the log by then.
            let oldest_s = set.time_s - self.settings.window_s;
            self.void.retain(|_, at_s| *at_s >= oldest_s);
        }
    }

    /// Forgets tracks and tree.
    pub fn restart(&mut self) {
        self.swaying.restart();
        self.log = FilmLog::new(self.settings.window_s);
        self.angles = AngleWindow::new(self.settings.window_s);
        self.void.clear();
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

    /// How often a request was due and the thread was busy.
    pub fn passed_over(&self) -> u64 {
        self.swaying.passed_over()
    }

    /// No more frames.
    pub fn end(&mut self) -> Ending {
        self.swaying.end()
    }
}

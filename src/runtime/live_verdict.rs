//! What the capture would be worth if it ended now, once a second of film.

use super::finish::Quality;
use super::judge::{JudgedFilm, mean_grey};
use crate::config::Dynamics;
use crate::model::{CameraState, Judgement, Picture, SwayFacts, SwayNow, Unidentified, Verdict};
use crate::pipeline::BackEnd;
use crate::solve::Model;
use std::sync::Arc;

/// Film between two verdicts, s: who reads it sees no more, and each costs milliseconds.
const EVERY_S: f64 = 1.0;

/// The newest verdict, and what it takes beside tracks and tree.
///
/// It rests on nothing but the frames that were worked off, and not on the clock: a replay that
/// waits for the sway gives the same verdicts in the same frames.
#[derive(Default)]
pub struct LiveVerdict {
    judged_s: Option<f64>,
    had_tree: bool,
    brightness: Option<f64>,
    sway: Option<Arc<SwayNow>>,
    newest: Option<Arc<Verdict>>,
    missing_s: f64,
    /// What was last said in the stream.
    streamed: Option<Arc<Verdict>>,
}

impl LiveVerdict {
    /// Takes the picture of the film.
    pub fn see(&mut self, picture: &Picture) {
        self.brightness = mean_grey(picture);
    }

    /// Takes an answer of the sway, if there is one.
    pub fn take_sway(&mut self, sway: Option<Arc<SwayNow>>) {
        self.sway = sway.or(self.sway.take());
    }

    /// Judges anew where a second of film has passed, or the tree was built. `camera`: when it was
    /// away.
    pub fn step(
        &mut self,
        quality: &Quality,
        back: &BackEnd,
        settings: &Dynamics,
        camera: &CameraState,
    ) {
        let time_s = quality.last_s();
        let judged_s = *self.judged_s.get_or_insert(time_s);
        let model = back.model();
        // A tree that is shown must not be called missing.
        let is_built = model.is_some() && !self.had_tree;
        if time_s - judged_s < EVERY_S && !is_built {
            return;
        }
        self.judged_s = Some(time_s);
        self.had_tree = model.is_some();
        let film = JudgedFilm {
            is_filming: true,
            length: quality.length(camera),
            quality,
            log: back.log(),
            settings,
            brightness: self.brightness,
            foot: model.map(|model| model.foot),
            sway: model.and_then(|model| self.sway_facts(model)),
            cut: None,
        };
        let Judgement { verdict, facts } = Judgement::of(film.facts());
        self.missing_s = facts.missing_s();
        if self.newest.as_deref() != Some(&verdict) {
            self.newest = Some(Arc::new(verdict));
        }
    }

    /// What the newest answer says of the branches that the tree has now.
    pub fn sway_facts(&self, model: &Model) -> Option<SwayFacts> {
        let sway = self.sway.as_deref()?;
        let mut sways = Vec::with_capacity(model.skeleton.nodes.len());
        for node in &model.skeleton.nodes {
            let branch = sway.branches.get(&node.name);
            sways.push(branch.map_or(Err(Unidentified::NotMeasured), |branch| branch.swaying));
        }
        let facts = SwayFacts::of(&model.skeleton, &sways, sway.modes.iter().map(Into::into))?;
        Some(SwayFacts {
            looked_at_s: Some(sway.span_s),
            ..facts
        })
    }

    /// `None` in the first second.
    pub fn newest(&self) -> Option<&Arc<Verdict>> {
        self.newest.as_ref()
    }

    /// Film that is still missing for the frequencies of the branches, s.
    pub fn missing_s(&self) -> f64 {
        self.missing_s
    }

    /// The newest verdict, if the stream has not said it yet; it counts as said then.
    pub fn take_unsaid(&mut self) -> Option<Arc<Verdict>> {
        let newest = self.newest.clone()?;
        let is_said = self.streamed.replace(newest.clone());
        (is_said.as_ref() != Some(&newest)).then_some(newest)
    }

    /// Forgets tracks and tree.
    pub fn restart(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
#[path = "tests/live_verdict.rs"]
mod tests;

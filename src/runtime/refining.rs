//! The tree is worked out anew in the background, while poses go on.

use super::background::{Background, LOOK_EVERY, Pending};
use super::shared::Shared;
use crate::cancel::CancelToken;
use crate::pipeline::BackEnd;
use crate::solve::Model;
use crossbeam_channel::RecvTimeoutError;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Why there is no result.
enum Missing {
    NotBegun,
    NotReady,
    NotWanted,
    Failed,
}

/// A refinement under way, if there is one.
pub struct Refining {
    background: Background,
    shared: Arc<Shared>,
    work: Option<Pending<Option<Model>>>,
}

impl Refining {
    pub fn new(background: Background, shared: Arc<Shared>) -> Self {
        Self {
            background,
            shared,
            work: None,
        }
    }

    /// Begins what `back` wants worked out. Where it cannot be begun, `back` does it itself when it
    /// is due.
    pub fn begin(&mut self, back: &BackEnd) {
        if let (Some(job), None) = (back.job(), &self.work) {
            let job = job.clone();
            let work = move |cancel: &CancelToken| job.run(cancel);
            self.work = self.background.begin(CancelToken::new(), work);
        }
    }

    /// Hands the result in before the frame at `time_s` (s) that needs it. Where the end is wanted,
    /// the standing tree has to do: to wait may take as long as a build. A camera is not made to
    /// wait (`live`): the frame does without.
    pub fn hand_in(&mut self, back: &mut BackEnd, time_s: f64, live: bool) {
        if self.is_in_a_hurry() {
            self.give_up();
        }
        if !back.needs_model(time_s) {
            return;
        }
        match self.result(live) {
            Ok(model) => back.put_model(model),
            // What has failed once would fail again; the standing tree has to do.
            Err(Missing::Failed | Missing::NotWanted) => back.put_model(None),
            Err(Missing::NotReady) => back.put_off_model(time_s),
            // `back` does it itself, with the same result.
            Err(Missing::NotBegun) => self.give_up(),
        }
    }

    /// Waits for the result, unless frames are `live`.
    fn result(&mut self, live: bool) -> Result<Option<Model>, Missing> {
        loop {
            if self.is_in_a_hurry() {
                return Err(Missing::NotWanted);
            }
            let work = self.work.take_if(|work| live || work.has_begun());
            let Some(work) = work else {
                return Err(if live {
                    Missing::NotReady
                } else {
                    Missing::NotBegun
                });
            };
            let patience = if live { Duration::ZERO } else { LOOK_EVERY };
            match work.answer(patience) {
                Ok(model) => return Ok(model),
                Err(RecvTimeoutError::Disconnected) => return Err(Missing::Failed),
                Err(RecvTimeoutError::Timeout) => self.work = Some(work),
            }
            if live {
                return Err(Missing::NotReady);
            }
        }
    }

    fn is_in_a_hurry(&self) -> bool {
        self.shared.hurry.load(Ordering::Relaxed)
    }

    /// Nobody waits for it any more.
    pub fn give_up(&mut self) {
        self.work = None;
    }
}

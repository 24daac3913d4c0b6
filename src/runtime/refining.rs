//! The tree is worked out anew in the background, while poses go on.

use super::background::{Background, Pending};
use crate::cancel::CancelToken;
use crate::pipeline::BackEnd;
use crate::solve::Model;
use crossbeam_channel::RecvTimeoutError;
use std::time::Duration;

/// A refinement under way, if there is one.
pub struct Refining {
    background: Background,
    work: Option<Pending<Option<Model>>>,
}

impl Refining {
    pub fn new(background: Background) -> Self {
        Self {
            background,
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

    /// Hands the result in before the frame at `time_s` (s) that needs it. In a `hurry` the
    /// standing tree has to do: to wait may take as long as a build. A camera is not made to wait
    /// (`live`): the frame does without.
    pub fn hand_in(&mut self, back: &mut BackEnd, time_s: f64, live: bool, hurry: bool) {
        if hurry {
            self.give_up();
        }
        if !back.needs_model(time_s) {
            return;
        }
        if hurry {
            back.put_model(None);
            return;
        }
        // Where it has not begun, `back` is faster.
        let Some(work) = self.work.take_if(|work| live || work.has_begun()) else {
            self.give_up();
            return;
        };
        let patience = if live { Duration::ZERO } else { Duration::MAX };
        match work.answer(patience) {
            Ok(model) => back.put_model(model),
            Err(RecvTimeoutError::Timeout) => {
                self.work = Some(work);
                back.put_off_model(time_s);
            }
            Err(RecvTimeoutError::Disconnected) => {}
        }
    }

    /// Nobody waits for it any more.
    pub fn give_up(&mut self) {
        self.work = None;
    }
}

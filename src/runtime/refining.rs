//! The tree is worked out anew in the background, while poses go on.

use super::background::{Background, Missing, Pending};
use super::shared::Shared;
use crate::cancel::CancelToken;
use crate::pipeline::BackEnd;
use crate::solve::Model;
use std::sync::Arc;
use std::sync::atomic::Ordering;

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

    /// Begins what `back` wants worked out.
    pub fn begin(&mut self, back: &BackEnd) {
        if let (Some(job), None) = (back.job(), &self.work) {
            let job = job.clone();
            let work = move |cancel: &CancelToken| job.run(cancel);
            self.work = self.background.begin(CancelToken::new(), work);
        }
    }

    /// Hands the result in before the frame at `time_s` (s) that needs it. Where the end is wanted,
    /// the standing tree has to do: to wait may take as long as a build. A camera is not made to
    /// wait (`live`): the frame does without. Where the work has not begun, any other frame is
    /// served by `back` itself, with the same result.
    pub fn hand_in(&mut self, back: &mut BackEnd, time_s: f64, live: bool) {
        let is_in_a_hurry = self.shared.hurry.load(Ordering::Relaxed);
        if is_in_a_hurry {
            self.give_up();
        }
        if !back.needs_model(time_s) {
            return;
        }
        let work = self.work.as_ref().filter(|work| live || work.has_begun());
        match work.map(|work| work.answer(!live, &self.shared)) {
            Some(Err(Missing::NotReady)) => return back.put_off_model(time_s),
            Some(Ok(model)) => back.put_model(model),
            // What has failed once would fail again; the standing tree has to do.
            Some(Err(Missing::Failed)) => back.put_model(None),
            // At the end it is known what came too late.
            Some(Err(Missing::NotWanted)) => back.put_off_model(time_s),
            None if is_in_a_hurry => back.put_off_model(time_s),
            None if live => back.put_off_model(time_s),
            None => {}
        }
        self.give_up();
    }

    /// Nobody waits for it any more.
    pub fn give_up(&mut self) {
        self.work = None;
    }
}

//! The tree is worked out anew on a thread of its own, while poses go on.

use crate::cancel::CancelToken;
use crate::pipeline::BackEnd;
use crate::solve::Model;
use std::thread::JoinHandle;

/// A refinement under way, if there is one.
#[derive(Default)]
pub struct Refining {
    work: Option<JoinHandle<Option<Model>>>,
    /// Nobody waits for it any more: it shall leave the computer to others.
    given_up: CancelToken,
}

impl Refining {
    /// Begins what `back` wants worked out. Where no thread can be had, `back` does it itself when
    /// it is due.
    pub fn begin(&mut self, back: &BackEnd) {
        if let (Some(work), None) = (back.job(), &self.work) {
            let (work, given_up) = (work.clone(), self.given_up.clone());
            let run = move || work.run(&given_up);
            self.work = std::thread::Builder::new()
                .name("refine".into())
                .spawn(run)
                .ok();
        }
    }

    /// Hands the result in before the frame at `time_s` (s) that needs it. In a `hurry` the
    /// standing tree has to do: to wait may take as long as a build. A camera is not made to wait
    /// (`live`): the frame does without.
    pub fn hand_in(&mut self, back: &mut BackEnd, time_s: f64, live: bool, hurry: bool) {
        if hurry {
            self.given_up.cancel();
        }
        if !back.needs_model(time_s) {
            return;
        }
        if live && !hurry && self.work.as_ref().is_some_and(|work| !work.is_finished()) {
            back.put_off_model(time_s);
            return;
        }
        match self.work.take().filter(|_| !hurry).map(JoinHandle::join) {
            Some(Ok(tree)) => back.put_model(tree),
            _ if hurry => back.put_model(None),
            _ => {}
        }
    }
}

impl Drop for Refining {
    fn drop(&mut self) {
        self.given_up.cancel();
    }
}

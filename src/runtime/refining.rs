//! The tree is worked out anew on a thread of its own, while poses go on.

use crate::pipeline::{BackEnd, Tree};
use std::thread::JoinHandle;

/// A refinement under way, if there is one.
#[derive(Default)]
pub struct Refining(Option<JoinHandle<Option<Tree>>>);

impl Refining {
    /// Begins what `back` wants worked out. Where no thread can be had, `back` does it itself when it is due.
    pub fn begin(&mut self, back: &BackEnd) {
        if let (Some(work), None) = (back.refinement(), &self.0) {
            let work = work.clone();
            self.0 = std::thread::Builder::new().name("refine".into()).spawn(move || work.run()).ok();
        }
    }

    /// Hands the result in before the frame at `time_s` (s) that needs it. In a `hurry` the standing tree has to do: to
    /// wait may take as long as a build. A camera is not made to wait (`live`): the frame does without.
    pub fn hand_in(&mut self, back: &mut BackEnd, time_s: f64, live: bool, hurry: bool) {
        if !back.needs_refinement(time_s) {
            return;
        }
        if live && !hurry && self.0.as_ref().is_some_and(|work| !work.is_finished()) {
            back.put_off_refinement(time_s);
            return;
        }
        match self.0.take().filter(|_| !hurry).map(JoinHandle::join) {
            Some(Ok(tree)) => back.put_refinement(tree),
            _ if hurry => back.put_refinement(None),
            _ => {}
        }
    }
}

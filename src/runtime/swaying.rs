//! The sway is analysed again and again in the background, while the film goes on.
//!
//! At moments so far apart in the film a request is made where the film has grown by enough since
//! the last one, and the result of that takes effect: at a moment of film, not of the clock. A fast
//! replay waits for it there, so that the same recording gives the same answers at the same frames
//! whatever the machine. A camera, or a recording at its own pace, waits for nobody: what is not
//! ready is looked at again at the next moment, and the request that finds the last one under way is
//! passed over and counted.

use super::background::{Background, Missing, Pending};
use super::pulse::{Pulse, Worker};
use super::shared::Shared;
use crate::cancel::CancelToken;
use crate::model::SwayNow;
use crate::pipeline::SwayJob;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// A film is analysed again when there is so much more of it, as a share of what the last analysis
/// had: a longer one takes more time and changes the answers less.
const MIN_GROWTH: f64 = 0.1;

/// Works a job off; asks again and again whether to go on, which is its sign of life, too.
pub type Analyser = fn(&SwayJob, &CancelToken) -> SwayNow;

/// When an analysis is begun, and when its result takes effect.
pub struct Swaying {
    every_s: f64,
    /// Results are waited for where they are due.
    waits: bool,
    analyser: Analyser,
    shared: Arc<Shared>,
    background: Background,
    pending: Option<Pending<SwayNow>>,
    /// Time of film of the next moment, and of the next request, s.
    next_s: f64,
    due_s: f64,
    passed_over: u64,
}

impl Swaying {
    /// Asks every `every_s` seconds of film at most, never if that is 0.
    pub fn new(
        every_s: f64,
        waits: bool,
        analyser: Analyser,
        background: Background,
        shared: Arc<Shared>,
    ) -> Self {
        Self {
            every_s,
            waits,
            analyser,
            shared,
            background,
            pending: None,
            next_s: f64::NEG_INFINITY,
            due_s: f64::NEG_INFINITY,
            passed_over: 0,
        }
    }

    /// How often a request was due and the last one was still under way.
    pub fn passed_over(&self) -> u64 {
        self.passed_over
    }

    /// Forgets what is under way.
    pub fn restart(&mut self) {
        self.pending = None;
        self.next_s = f64::NEG_INFINITY;
        self.due_s = f64::NEG_INFINITY;
    }

    /// At the frame of this time: the result that takes effect with it, if there is one, and the
    /// next request, if one is due.
    pub fn step(&mut self, time_s: f64, job: impl FnOnce() -> Option<SwayJob>) -> Option<SwayNow> {
        if self.every_s <= 0.0 || time_s < self.next_s || self.shared.hurry.load(Ordering::Relaxed)
        {
            return None;
        }
        self.next_s = time_s + self.every_s;
        let found = self.take();
        if time_s < self.due_s {
            return found;
        }
        if self.pending.is_some() {
            self.passed_over += 1;
        } else if let Some(job) = job() {
            self.due_s = time_s + MIN_GROWTH * job.span_s();
            self.ask(job);
        }
        found
    }

    /// The result of the last request, if it is there or waited for.
    fn take(&mut self) -> Option<SwayNow> {
        let pending = self.pending.take()?;
        let answer = pending.answer(self.waits, &self.shared);
        if answer.as_ref().is_err_and(|e| *e == Missing::NotReady) {
            self.pending = Some(pending);
        }
        answer.ok()
    }

    fn ask(&mut self, job: SwayJob) {
        let wanted = self.shared.pulse.sway_work.child();
        let (analyser, shared) = (self.analyser, self.shared.clone());
        let work = move |cancel: &CancelToken| {
            let _at_work = AtWork::new(&shared.pulse);
            analyser(&job, cancel)
        };
        self.pending = self.background.begin(wanted, work);
        if self.pending.is_none() {
            self.passed_over += 1;
        }
    }

    /// Gives up what is under way. It ends with the step of a fit that it is at, after a release
    /// with the branch.
    pub fn end(&mut self) {
        self.pending = None;
        self.every_s = 0.0;
    }
}

/// There is work until this is dropped, by a panic too: the capture goes on without it, and
/// must not be taken for one that stalls.
struct AtWork<'a>(&'a Pulse);

impl<'a> AtWork<'a> {
    fn new(pulse: &'a Pulse) -> Self {
        pulse.give(Worker::Sway);
        Self(pulse)
    }
}

impl Drop for AtWork<'_> {
    fn drop(&mut self) {
        self.0.done(Worker::Sway);
    }
}

#[cfg(test)]
#[path = "tests/swaying.rs"]
mod tests;

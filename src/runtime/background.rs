//! Work that no frame waits for, on a thread beside: the tree is worked out anew, the tables of the
//! capture are brought up to date, a capture is exported. The sway is analysed on a second one.

use super::job::Job;
use super::shared::{Failure, Shared};
use super::source_thread::Pace;
use super::spawn::spawn;
use crate::cancel::CancelToken;
use crate::caught::caught;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, TryRecvError, bounded};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Pieces of work that may wait. Each of those who hand in work wants one piece at a time; pieces
/// that were given up keep their place until their turn, and take no time then.
const QUEUE: usize = 16;

/// A wait for an answer ends within this time when the end of the capture is wanted.
const LOOK_EVERY: Duration = Duration::from_millis(20);

type Work = Box<dyn FnOnce() + Send>;

/// Where work is handed in; when the last of these is dropped, the thread ends.
#[derive(Clone)]
pub struct Background(Sender<Work>);

impl Background {
    /// Starts the thread `name`. If it `stands_back`, all others go first where there is too little
    /// processor for all: what is handed in then may take very long.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(name: &str, stands_back: bool, shared: Arc<Shared>) -> Result<Self, Failure> {
        let (sender, queue) = bounded(QUEUE);
        let run = move || {
            if stands_back {
                stand_back();
            }
            work_off(&queue, &shared);
        };
        spawn(name, run)?;
        Ok(Self(sender))
    }

    /// Hands in work that `wanted` can end; `None` where too much waits already.
    pub fn begin<T: Send + 'static>(
        &self,
        wanted: CancelToken,
        work: impl FnOnce(&CancelToken) -> T + Send + 'static,
    ) -> Option<Pending<T>> {
        let (answer, answered) = bounded(1);
        let begun = Arc::new(AtomicBool::new(false));
        let (cancel, begins) = (wanted.clone(), begun.clone());
        let run = move || {
            begins.store(true, Ordering::Relaxed);
            if !cancel.is_cancelled() {
                // Nobody may be waiting any more.
                drop(answer.send(work(&cancel)));
            }
        };
        self.0.try_send(Box::new(run)).ok()?;
        Some(Pending {
            wanted,
            begun,
            answer: answered,
        })
    }
}

/// The threads that work beside those of the frames.
pub struct Beside {
    pub background: Background,
    /// Only where somebody looks: it has work without a pause, and a camera's frames come first.
    pub sway: Option<Background>,
}

impl Beside {
    /// # Errors
    /// A thread cannot be started.
    pub fn start(job: &Job, shared: &Arc<Shared>) -> Result<Self, Failure> {
        let stands_back = job.pace != Pace::Fast;
        let sway = if job.is_watched() {
            Some(Background::start("sway", stands_back, shared.clone())?)
        } else {
            None
        };
        Ok(Self {
            background: Background::start("background", false, shared.clone())?,
            sway,
        })
    }
}

/// Why there is no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    NotReady,
    /// The end of the capture is wanted.
    NotWanted,
    /// Nothing will come any more: the work has panicked, or was cancelled before its turn.
    Failed,
}

/// Work that was handed in; dropped, it is given up.
pub struct Pending<T> {
    wanted: CancelToken,
    begun: Arc<AtomicBool>,
    answer: Receiver<T>,
}

impl<T> Pending<T> {
    /// What came of it, once; it is waited for if the caller `waits`.
    ///
    /// # Errors
    /// There is no answer, see [`Missing`].
    pub fn answer(&self, waits: bool, shared: &Shared) -> Result<T, Missing> {
        let patience = if waits { LOOK_EVERY } else { Duration::ZERO };
        while !shared.hurry.load(Ordering::Relaxed) {
            match self.answer.recv_timeout(patience) {
                Ok(answer) => return Ok(answer),
                Err(RecvTimeoutError::Disconnected) => return Err(Missing::Failed),
                Err(RecvTimeoutError::Timeout) if waits => {}
                Err(RecvTimeoutError::Timeout) => return Err(Missing::NotReady),
            }
        }
        Err(Missing::NotWanted)
    }

    /// Whether its turn has come.
    pub fn has_begun(&self) -> bool {
        self.begun.load(Ordering::Relaxed)
    }

    /// Waits until it is done; `None` if it has failed.
    pub fn wait(self) -> Option<T> {
        self.answer.recv().ok()
    }
}

impl Pending<()> {
    /// Whether it is still to be done.
    pub fn is_under_way(&self) -> bool {
        self.answer.try_recv() == Err(TryRecvError::Empty)
    }
}

impl<T> Drop for Pending<T> {
    fn drop(&mut self) {
        self.wanted.cancel();
    }
}

/// The thread: one piece after the other until nobody can hand in any. The capture goes on after a
/// panic, and its end reports it.
fn work_off(queue: &Receiver<Work>, shared: &Shared) {
    for work in queue {
        if caught(work).is_none() {
            shared.background_failed();
        }
    }
}

/// Lets all other threads go first where there is too little processor for all. Where that is
/// refused, it is not needed for the result.
fn stand_back() {
    const NICE: libc::c_int = 10;
    // SAFETY: it takes numbers only; 0 is the calling thread, as Linux has it.
    let _ = unsafe { libc::setpriority(libc::PRIO_PROCESS, 0, NICE) };
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What has not come after so long hangs.
    const HANGS: Duration = Duration::from_secs(20);

    fn begun(background: &Background, gate: Receiver<()>) -> Pending<bool> {
        let work = move |cancel: &CancelToken| {
            let _ = gate.recv();
            cancel.is_cancelled()
        };
        background.begin(CancelToken::new(), work).expect("room")
    }

    /// Work that was given up before its turn takes no time, and what is too much is refused.
    #[test]
    fn the_queue_is_bounded_and_given_up_work_is_left_out() {
        let background = Background::start("test", false, Arc::default()).expect("a thread");
        let (open, gate) = bounded(1);
        let first = begun(&background, gate);
        while !first.has_begun() {
            std::thread::yield_now();
        }
        let (never, shut) = bounded(1);
        let waiting: Vec<_> = (0..QUEUE)
            .map(|_| begun(&background, shut.clone()))
            .collect();
        assert!(background.begin(CancelToken::new(), |_| ()).is_none());
        assert!(waiting.iter().all(|w| !w.has_begun()));
        drop(waiting);
        open.send(()).expect("it waits");
        assert_eq!(first.answer.recv_timeout(HANGS), Ok(false));
        // None of those that would have waited for ever was begun.
        let mut last = None;
        while last.is_none() {
            last = background.begin(CancelToken::new(), |_| 7);
        }
        assert_eq!(last.expect("room").answer.recv_timeout(HANGS), Ok(7));
        drop(never);
    }
}

//! Whether a capture is alive: every thread leaves marks as it works, and [`Vigil`] reads them.
//!
//! A supervisor that is fed by a timer learns only that the timer lives. So a sign of life is given
//! for work alone: frames that came in and went through every thread, or a source that says itself
//! that it waits for its camera.

use crate::cancel::CancelToken;
use std::sync::atomic::{AtomicU64, Ordering};

/// The threads that are given work by another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Worker {
    Track,
    Model,
    /// Works only where a recording is made.
    Record,
    /// Works only where somebody looks. It marks branch by branch, as it may be given all of them
    /// at once.
    Sway,
}

impl Worker {
    const ALL: [Worker; 4] = [Worker::Track, Worker::Model, Worker::Record, Worker::Sway];

    fn name(self) -> &'static str {
        match self {
            Worker::Track => "track",
            Worker::Model => "model",
            Worker::Record => "record",
            Worker::Sway => "sway",
        }
    }
}

/// Marks of all threads; each only counts up, save what is taken back.
#[derive(Default)]
pub struct Pulse {
    given: [AtomicU64; Worker::ALL.len()],
    done: [AtomicU64; Worker::ALL.len()],
    waits: AtomicU64,
    written: AtomicU64,
    /// What the sway is analysed with is a child of this token: each look at it is a piece done.
    pub sway_work: CancelToken,
    /// The work of the end that nobody waits for who asks for the end, and the work that he gives
    /// some seconds. Each look at them is a sign of life, as a frame written is.
    pub optional_work: CancelToken,
    /// Writing the capture; nobody cancels it but who does not want the capture.
    pub writing: CancelToken,
    pub closing_work: CancelToken,
}

impl Pulse {
    /// A piece of work is about to be put into the queue of `worker`.
    pub fn give(&self, worker: Worker) {
        self.given[worker as usize].fetch_add(1, Ordering::Relaxed);
    }

    /// It was taken out of the queue again by somebody else: what is dropped is no work that was
    /// done.
    pub fn take_back(&self, worker: Worker) {
        self.given[worker as usize].fetch_sub(1, Ordering::Relaxed);
    }

    /// `worker` has finished a piece, whatever came of it.
    pub fn done(&self, worker: Worker) {
        self.done[worker as usize].fetch_add(1, Ordering::Relaxed);
    }

    /// The source has no frames, for a reason that it knows, and has just looked again.
    pub fn waits(&self) {
        self.waits.fetch_add(1, Ordering::Relaxed);
    }

    /// A frame's worth of the capture has been written.
    pub fn wrote(&self) {
        self.written.fetch_add(1, Ordering::Relaxed);
    }

    /// All marks as they are now; `frames` were taken from the source so far, and `ending` says
    /// that no more are wanted.
    pub fn marks(&self, frames: u64, ending: bool) -> Marks {
        let read = |counts: &[AtomicU64; Worker::ALL.len()]| {
            counts.each_ref().map(|c| c.load(Ordering::Relaxed))
        };
        // What is done is read first, lest more be done than was given.
        let (mut done, mut given) = (read(&self.done), read(&self.given));
        let steps = self.sway_work.checks();
        done[Worker::Sway as usize] += steps;
        given[Worker::Sway as usize] += steps;
        let [waits, written] = [&self.waits, &self.written].map(|c| c.load(Ordering::Relaxed));
        let tokens = [&self.optional_work, &self.closing_work, &self.writing];
        let written = written + tokens.map(CancelToken::checks).iter().sum::<u64>();
        Marks {
            frames,
            waits,
            written,
            given,
            done,
            ending,
        }
    }
}

/// The marks at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Marks {
    frames: u64,
    waits: u64,
    written: u64,
    given: [u64; Worker::ALL.len()],
    done: [u64; Worker::ALL.len()],
    ending: bool,
}

impl Marks {
    /// No more frames are wanted, or there are none.
    pub fn ends(&self) -> bool {
        self.ending
    }

    /// A frame has gone through every thread.
    pub fn flowed(&self) -> bool {
        self.done[Worker::Model as usize] > 0
    }
}

/// What the marks say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Frames came, and no thread keeps another waiting.
    Flows,
    /// No frames, and the source says why; all that came before is worked off.
    Waits,
    /// No more frames are wanted; what there is is worked off and written.
    Ends,
    /// The named thread has work and does not get on with it.
    Stalls(&'static str),
}

/// Compares the marks with those of the last sign of life.
#[derive(Debug, Default)]
pub struct Vigil {
    last: Marks,
}

impl Vigil {
    /// What has happened since the last call that was not answered with [`Sign::Stalls`]: slow work
    /// is alive as soon as it is done, however often it was looked at before.
    pub fn look(&mut self, now: Marks) -> Sign {
        let sign = self.compare(&now);
        if !matches!(sign, Sign::Stalls(_)) {
            self.last = now;
        }
        sign
    }

    fn compare(&self, now: &Marks) -> Sign {
        let last = &self.last;
        if now.ending {
            let moved = now.written > last.written || now.done != last.done || !last.ending;
            return if moved {
                Sign::Ends
            } else {
                Sign::Stalls("writer")
            };
        }
        let stuck = Worker::ALL.into_iter().find(|&w| {
            let w = w as usize;
            now.given[w] > now.done[w] && now.done[w] == last.done[w]
        });
        match stuck {
            Some(worker) => Sign::Stalls(worker.name()),
            None if now.frames > last.frames => Sign::Flows,
            None if now.waits > last.waits => Sign::Waits,
            None => Sign::Stalls("source"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One frame through source and tracker to the model.
    fn flow(pulse: &Pulse) {
        for worker in Worker::ALL {
            pulse.give(worker);
            pulse.done(worker);
        }
    }

    #[test]
    fn frames_that_go_all_the_way_are_life() {
        let (pulse, mut vigil) = (Pulse::default(), Vigil::default());
        assert!(!pulse.marks(0, false).flowed(), "nothing has come yet");
        flow(&pulse);
        assert_eq!(vigil.look(pulse.marks(1, false)), Sign::Flows);
        assert!(pulse.marks(1, false).flowed());
        assert_eq!(
            vigil.look(pulse.marks(1, false)),
            Sign::Stalls("source"),
            "the same frame is no new life"
        );
    }

    /// A camera goes on delivering while a thread hangs: what it drops must not look like work.
    #[test]
    fn a_thread_that_hangs_is_named_although_frames_come() {
        for (hangs, name) in [
            (Worker::Track, "track"),
            (Worker::Model, "model"),
            (Worker::Record, "record"),
            (Worker::Sway, "sway"),
        ] {
            let (pulse, mut vigil) = (Pulse::default(), Vigil::default());
            flow(&pulse);
            assert_eq!(vigil.look(pulse.marks(1, false)), Sign::Flows);
            for frames in 2..20 {
                for worker in Worker::ALL.into_iter().filter(|w| *w != hangs) {
                    pulse.give(worker);
                    pulse.done(worker);
                }
                pulse.give(hangs);
                if frames > 5 {
                    pulse.take_back(hangs);
                }
                assert_eq!(vigil.look(pulse.marks(frames, false)), Sign::Stalls(name));
            }
            pulse.done(hangs);
            assert_eq!(
                vigil.look(pulse.marks(20, false)),
                Sign::Flows,
                "slow is not dead"
            );
        }
    }

    #[test]
    fn waiting_is_life_only_as_long_as_nobody_else_hangs() {
        let (pulse, mut vigil) = (Pulse::default(), Vigil::default());
        flow(&pulse);
        assert_eq!(vigil.look(pulse.marks(1, false)), Sign::Flows);
        pulse.waits();
        assert_eq!(vigil.look(pulse.marks(1, false)), Sign::Waits);
        assert_eq!(
            vigil.look(pulse.marks(1, false)),
            Sign::Stalls("source"),
            "the waiting loop hangs"
        );
        pulse.waits();
        pulse.give(Worker::Model);
        assert_eq!(vigil.look(pulse.marks(1, false)), Sign::Stalls("model"));
    }

    #[test]
    fn the_end_is_alive_as_long_as_something_is_written() {
        let (pulse, mut vigil) = (Pulse::default(), Vigil::default());
        assert_eq!(vigil.look(pulse.marks(1, true)), Sign::Ends);
        assert_eq!(vigil.look(pulse.marks(1, true)), Sign::Stalls("writer"));
        pulse.wrote();
        assert_eq!(vigil.look(pulse.marks(1, true)), Sign::Ends);
    }
}

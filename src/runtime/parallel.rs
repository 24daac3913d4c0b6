//! Independent pieces of work on several threads.

use crate::caught::{catching, caught};
use crate::pipeline::Both;
use std::panic::resume_unwind;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;

/// Why not all pieces were done.
#[derive(Debug)]
pub enum Undone<E> {
    /// The flag was set.
    Stopped,
    /// A piece failed: of those that did the one with the lowest number.
    Failed(E),
}

/// Does the pieces of work 1 to `count` on up to `threads` threads, each once and in any order, and
/// calls `done` after each with how many are done. No further piece is begun after one has failed
/// or `stop` is set; those under way come to their end.
///
/// # Errors
/// A piece failed, or `stop` was set before all were done.
pub fn in_parallel<E: Send>(
    count: u64,
    threads: usize,
    stop: &AtomicBool,
    work: &(impl Fn(u64) -> Result<(), E> + Sync),
    done: &(impl Fn(u64) + Sync),
) -> Result<(), Undone<E>> {
    let pieces = Pieces {
        count,
        next: AtomicU64::new(1),
        finished: AtomicU64::new(0),
        failed: Mutex::new(None),
    };
    let threads = threads.clamp(1, usize::try_from(count.max(1)).unwrap_or(usize::MAX));
    thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(|| pieces.work_off(stop, work, done));
        }
        pieces.work_off(stop, work, done);
    });
    let finished = pieces.finished.load(Ordering::SeqCst);
    match pieces.failed.into_inner() {
        Ok(None) if finished == count => Ok(()),
        Ok(Some(failure)) => Err(Undone::Failed(failure.error)),
        // A thread that panicked ends the scope with its panic, before this.
        _ => Err(Undone::Stopped),
    }
}

/// Does both at the same time, the first on a thread of this name, or one after the other where
/// there is none to be had.
pub fn beside<A: Send, B>(
    name: &str,
    first: impl Fn() -> A + Sync,
    second: impl FnOnce() -> B,
) -> (A, B) {
    let is_caught = catching();
    thread::scope(|scope| {
        let thread =
            thread::Builder::new()
                .name(name.into())
                .spawn_scoped(scope, || match is_caught {
                    true => caught(&first),
                    false => Some(first()),
                });
        let b = second();
        match thread.map(thread::ScopedJoinHandle::join) {
            Ok(Ok(Some(a))) => (a, b),
            // It is caught where its caller's would be.
            Ok(Ok(None)) => resume_unwind(Box::new("the work beside has panicked")),
            Ok(Err(panic)) => resume_unwind(panic),
            Err(_) => (first(), b),
        }
    })
}

/// Two pieces of work at the same time.
#[derive(Clone, Copy, Debug)]
pub struct AtOnce;

impl Both for AtOnce {
    fn both<A: Send, B>(&self, first: impl Fn() -> A + Sync, second: impl FnOnce() -> B) -> (A, B) {
        beside("beside", first, second)
    }
}

/// The pieces, shared by all threads.
struct Pieces<E> {
    count: u64,
    /// The next that nobody has begun.
    next: AtomicU64,
    finished: AtomicU64,
    failed: Mutex<Option<Failure<E>>>,
}

struct Failure<E> {
    piece: u64,
    error: E,
}

impl<E> Pieces<E> {
    /// Does one piece after the other until there are none, one has failed, or `stop` is set.
    fn work_off(
        &self,
        stop: &AtomicBool,
        work: &impl Fn(u64) -> Result<(), E>,
        done: &impl Fn(u64),
    ) {
        while !stop.load(Ordering::SeqCst) && !self.has_failed() {
            let piece = self.next.fetch_add(1, Ordering::SeqCst);
            if piece > self.count {
                return;
            }
            match work(piece) {
                Ok(()) => done(self.finished.fetch_add(1, Ordering::SeqCst) + 1),
                Err(error) => self.fail(Failure { piece, error }),
            }
        }
    }

    fn has_failed(&self) -> bool {
        self.failed.lock().is_ok_and(|failed| failed.is_some())
    }

    fn fail(&self, failure: Failure<E>) {
        if let Ok(mut failed) = self.failed.lock()
            && failed.as_ref().is_none_or(|f| failure.piece < f.piece)
        {
            *failed = Some(failure);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    static GO_ON: AtomicBool = AtomicBool::new(false);

    #[test]
    fn every_piece_is_done_once_on_any_number_of_threads() {
        for threads in [0, 1, 2, 7] {
            let seen: Vec<AtomicU64> = (0..20).map(|_| AtomicU64::new(0)).collect();
            let most = AtomicU64::new(0);
            let work = |k: u64| -> Result<(), ()> {
                seen[k as usize - 1].fetch_add(1, Ordering::SeqCst);
                Ok(())
            };
            let done = |n| {
                most.fetch_max(n, Ordering::SeqCst);
            };
            assert!(in_parallel(20, threads, &GO_ON, &work, &done).is_ok());
            assert!(seen.iter().all(|n| n.load(Ordering::SeqCst) == 1));
            assert_eq!(most.load(Ordering::SeqCst), 20);
        }
    }

    #[test]
    fn the_first_failure_ends_it_and_so_does_the_flag() {
        let failing = |k: u64| if k >= 3 { Err(k) } else { Ok(()) };
        let failed = in_parallel(50, 2, &GO_ON, &failing, &|_| {});
        assert!(matches!(failed, Err(Undone::Failed(3 | 4))), "{failed:?}");
        let stop = AtomicBool::new(false);
        let stopping = |k: u64| -> Result<(), ()> {
            stop.store(k == 5, Ordering::SeqCst);
            Ok(())
        };
        let stopped = in_parallel(50, 1, &stop, &stopping, &|_| {});
        assert!(matches!(stopped, Err(Undone::Stopped)), "{stopped:?}");
    }
}

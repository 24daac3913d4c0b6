//! Work that a screen asks for and does not wait for: it stays awake, and what was asked last counts.

use super::shared::Failure;
use super::spawn::spawn;
use crate::cancel::CancelToken;
use crate::caught::caught;
use crossbeam_channel::{Receiver, TryRecvError, bounded};

/// Work on a thread of its own; dropped, it is given up.
pub struct Asked<T> {
    wanted: CancelToken,
    answer: Receiver<T>,
}

/// What has come of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer<T> {
    NotReady,
    Ready(T),
    /// Nothing will come any more: it has panicked, or the answer was taken before.
    Failed,
}

impl<T: Send + 'static> Asked<T> {
    /// Begins work that ends early where its token is cancelled.
    ///
    /// # Errors
    /// The thread `name` cannot be started.
    pub fn begin(
        name: &str,
        work: impl FnOnce(&CancelToken) -> T + Send + 'static,
    ) -> Result<Self, Failure> {
        let (sender, answer) = bounded(1);
        let wanted = CancelToken::new();
        let cancel = wanted.clone();
        let run = move || {
            if let Some(done) = caught(|| work(&cancel)) {
                // Nobody may be waiting any more.
                drop(sender.send(done));
            }
        };
        spawn(name, run)?;
        Ok(Self { wanted, answer })
    }

    /// What has come of it by now.
    pub fn answer(&self) -> Answer<T> {
        match self.answer.try_recv() {
            Ok(done) => Answer::Ready(done),
            Err(TryRecvError::Empty) => Answer::NotReady,
            Err(TryRecvError::Disconnected) => Answer::Failed,
        }
    }
}

impl<T> Drop for Asked<T> {
    fn drop(&mut self) {
        self.wanted.cancel();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The answer once it is there, or nothing.
    fn awaited(asked: &Asked<u8>) -> Option<u8> {
        loop {
            match asked.answer() {
                Answer::Ready(answer) => return Some(answer),
                Answer::Failed => return None,
                Answer::NotReady => std::thread::yield_now(),
            }
        }
    }

    #[test]
    fn nobody_waits_for_what_was_asked() {
        let (open, gate) = bounded(1);
        let asked = Asked::begin("test", move |_| gate.recv().unwrap_or(0)).expect("a thread");
        assert_eq!(asked.answer(), Answer::NotReady);
        open.send(7).expect("it waits");
        assert_eq!(awaited(&asked), Some(7));
        let fails = Asked::begin("test", |_| -> u8 { panic!("on purpose") }).expect("a thread");
        assert_eq!(awaited(&fails), None);
    }

    #[test]
    fn what_is_dropped_is_given_up() {
        let (ended, end) = bounded(1);
        let asked = Asked::begin("test", move |cancel: &CancelToken| {
            while !cancel.is_cancelled() {
                std::thread::yield_now();
            }
            ended.send(())
        });
        drop(asked);
        assert_eq!(end.recv(), Ok(()));
    }
}

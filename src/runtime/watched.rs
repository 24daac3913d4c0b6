//! A source that may wait for ever, on a thread of its own, behind one that gives up in time.

use super::nap::NAP;
use crate::config;
use crate::model::RawFrame;
use crate::source::{Health, Source, SourceError, SourceInfo};
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

enum Ask {
    Next,
    Reopen,
}

enum Answer {
    Next(Result<Option<RawFrame>, SourceError>, Health),
    Reopened(Result<(), SourceError>),
}

/// One question at a time goes to the thread; an answer that does not come in time is waited for
/// before the next one.
pub struct Watched {
    ask: Sender<Ask>,
    answers: Receiver<Answer>,
    /// A question has not been answered yet.
    hanging: bool,
    /// The thread has ended, and nothing will ever answer.
    ended: bool,
    info: SourceInfo,
    health: Health,
    limit: Duration,
    stop: Arc<AtomicBool>,
}

impl Watched {
    /// The source itself where it keeps to its own limits of time, else behind one that does.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn if_needed(source: Box<dyn Source>) -> std::io::Result<Box<dyn Source>> {
        Ok(match source.waits_without_limit() {
            Some(limit) => Box::new(Self::start(source, limit)?),
            None => source,
        })
    }

    /// Takes the source to a thread of its own, which ends with this value, or with the call that
    /// it hangs in.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(mut source: Box<dyn Source>, limit: Duration) -> std::io::Result<Self> {
        let (ask, asked) = bounded(1);
        let (answer, answers) = bounded(1);
        let (info, health) = (source.describe(), source.health());
        let run = move || {
            for question in asked {
                let reply = match question {
                    Ask::Next => {
                        let next = source.next_frame();
                        Answer::Next(next, source.health())
                    }
                    Ask::Reopen => Answer::Reopened(source.reopen()),
                };
                if answer.send(reply).is_err() {
                    break;
                }
            }
        };
        std::thread::Builder::new()
            .name("camera".into())
            .spawn(run)?;
        Ok(Self {
            ask,
            answers,
            hanging: false,
            ended: false,
            info,
            health,
            limit,
            stop: Arc::default(),
        })
    }

    fn silent(&self) -> SourceError {
        SourceError::Timeout {
            input: self.info.name.clone(),
            seconds: self.limit.as_secs_f64(),
        }
    }

    fn ended(&mut self) -> SourceError {
        self.ended = true;
        SourceError::Disconnected {
            input: self.info.name.clone(),
            reason: "its thread has ended".into(),
        }
    }

    /// Asks, unless an answer is still awaited, and waits for it; `Ok(None)` when asked to stop.
    fn question(&mut self, ask: Ask) -> Result<Option<Answer>, SourceError> {
        if !self.hanging && self.ask.send(ask).is_err() {
            return Err(self.ended());
        }
        self.hanging = true;
        let until = Instant::now() + self.limit;
        loop {
            match self.answers.recv_timeout(NAP) {
                Ok(answer) => {
                    self.hanging = false;
                    return Ok(Some(answer));
                }
                Err(RecvTimeoutError::Disconnected) => return Err(self.ended()),
                Err(RecvTimeoutError::Timeout) if self.stop.load(Ordering::Relaxed) => {
                    return Ok(None);
                }
                Err(RecvTimeoutError::Timeout) if Instant::now() >= until => {
                    return Err(self.silent());
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }
}

impl Source for Watched {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        loop {
            match self.question(Ask::Next)? {
                Some(Answer::Next(next, health)) => {
                    self.health = health;
                    return next;
                }
                // The late answer to an older question.
                Some(Answer::Reopened(done)) => done?,
                None => return Ok(None),
            }
        }
    }

    fn describe(&self) -> SourceInfo {
        self.info.clone()
    }

    fn stop_when(&mut self, stop: Arc<AtomicBool>) {
        self.stop = stop;
    }

    fn adopt(&mut self, config: &config::Camera) {
        self.limit = config.time_limit();
    }

    fn returns(&self) -> bool {
        !self.ended
    }

    fn reopen(&mut self) -> Result<(), SourceError> {
        if self.hanging {
            // The call that hangs holds the device: only its own return can free it. A frame means
            // that it is well again.
            return match self.question(Ask::Reopen)? {
                Some(Answer::Next(next, health)) => {
                    self.health = health;
                    next.map(drop)
                }
                Some(Answer::Reopened(done)) => done,
                None => Err(self.silent()),
            };
        }
        match self.question(Ask::Reopen)? {
            Some(Answer::Reopened(done)) => done,
            _ => Err(self.silent()),
        }
    }

    fn health(&self) -> Health {
        self.health
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{FormatNote, PixelFormat, Size};

    /// Hangs at its third frame until it is let go, fails at the fifth, and can be opened again.
    struct Hanging {
        next: u64,
        go_on: Receiver<()>,
    }

    impl Source for Hanging {
        fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
            let n = self.next;
            self.next += 1;
            if n == 2 {
                let _ = self.go_on.recv();
            }
            if n == 4 {
                return Err(SourceError::Disconnected {
                    input: "fake".into(),
                    reason: "test".into(),
                });
            }
            let (size, format) = (Size::new(2, 2), PixelFormat::Grey);
            Ok(Some(RawFrame {
                sequence: None,
                sensor_time_s: n as f64,
                size,
                format,
                bytes: vec![0; 4],
            }))
        }

        fn describe(&self) -> SourceInfo {
            let (format, size) = (FormatNote::default(), Size::new(2, 2));
            SourceInfo {
                name: "fake".into(),
                format,
                size,
                nominal_rate_hz: None,
                frames_total: None,
                live: true,
            }
        }

        fn reopen(&mut self) -> Result<(), SourceError> {
            Ok(())
        }
    }

    #[test]
    fn a_call_that_hangs_is_given_up_and_its_return_is_a_return() {
        let (go_on_in, go_on) = bounded(1);
        let limit = Duration::from_millis(60);
        let mut watched =
            Watched::start(Box::new(Hanging { next: 0, go_on }), limit).expect("a thread");
        let time = |w: &mut Watched| w.next_frame().map(|f| f.map(|f| f.sensor_time_s));
        assert!(matches!(time(&mut watched), Ok(Some(0.0))));
        assert!(matches!(time(&mut watched), Ok(Some(1.0))));
        assert!(matches!(
            time(&mut watched),
            Err(SourceError::Timeout { .. })
        ));
        assert!(
            matches!(watched.reopen(), Err(SourceError::Timeout { .. })),
            "it hangs still"
        );
        go_on_in.send(()).expect("it waits");
        assert!(watched.reopen().is_ok());
        assert!(matches!(time(&mut watched), Ok(Some(3.0))));
        assert!(matches!(
            time(&mut watched),
            Err(SourceError::Disconnected { .. })
        ));
        assert!(watched.reopen().is_ok());
        assert!(matches!(time(&mut watched), Ok(Some(5.0))));
    }

    #[test]
    fn a_wish_to_stop_is_heard_while_it_hangs() {
        let (_go_on_in, go_on) = bounded(1);
        let mut watched = Watched::start(
            Box::new(Hanging { next: 2, go_on }),
            Duration::from_secs(60),
        )
        .expect("a thread");
        let stop = Arc::new(AtomicBool::new(true));
        watched.stop_when(stop);
        let since = Instant::now();
        assert!(matches!(watched.next_frame(), Ok(None)));
        assert!(since.elapsed() < Duration::from_secs(5));
    }
}

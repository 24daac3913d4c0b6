//! A camera on a thread of its own, behind one that gives up in time.
//!
//! Any call to a driver may block for ever: opening, closing, waiting for a frame. The kernel may
//! even end the thread inside such a call, where it has a fault of its own. So the capture waits
//! for an answer with a limit of time, and where none comes it leaves the thread behind and goes on
//! with the [`Successor`] of its source on a new one. A thread that was left behind closes its
//! device and ends when its call returns; nobody waits for it, not even the end of the program.

use super::nap::NAP;
use crate::config::{self, Config};
use crate::model::RawFrame;
use crate::source::{self, Health, Source, SourceError, SourceInfo, Successor};
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};

/// A source that keeps to the limit of time by itself answers so much later at the latest.
const ANSWERS_AFTER: Duration = Duration::from_millis(100);
/// A camera that was lost or is no longer wanted is closed within so long, or left behind. Longer
/// than a healthy driver takes, and well below the two seconds within which a capture goes on.
const CLOSES_WITHIN: Duration = Duration::from_millis(1500);
/// Opening may take so many times the limit for a frame before it is left behind: a camera that has
/// to wake up takes seconds, and one behind a bad hub lets every request time out.
const OPENING_LIMITS: u32 = 3;
/// Threads left behind at a time. Each holds a device and its buffers, some 7 MB at 1280x720. With
/// so many of them hanging another attempt would hang as well: none is made until one returns.
const LEFT_BEHIND: usize = 8;

/// Opens `input` as [`source::open`] does, but gives a camera up whose driver hangs.
///
/// # Errors
/// As those of [`source::open`], or the camera has not been opened in time.
pub fn open(
    input: &Path,
    config: &Config,
    fps: Option<f64>,
) -> Result<Box<dyn Source>, SourceError> {
    if input.is_file() || input.is_dir() {
        return source::open(input, config, fps);
    }
    let name = input.display().to_string();
    let limit = config.camera.time_limit() * OPENING_LIMITS;
    let (opened_in, opened) = bounded(0);
    let (path, config) = (input.to_owned(), config.clone());
    let started = std::thread::Builder::new()
        .name("camera".into())
        .spawn(move || drop(opened_in.send(source::open(&path, &config, fps))));
    if let Err(e) = started {
        let reason = format!("a thread cannot be started: {e}");
        return Err(SourceError::Disconnected {
            input: name,
            reason,
        });
    }
    match opened.recv_timeout(limit) {
        Ok(result) => result,
        Err(RecvTimeoutError::Timeout) => Err(SourceError::Timeout {
            input: name,
            seconds: limit.as_secs_f64(),
        }),
        Err(RecvTimeoutError::Disconnected) => Err(SourceError::Disconnected {
            input: name,
            reason: "its thread has ended".into(),
        }),
    }
}

#[derive(Clone, Copy)]
enum Call {
    Next,
    Reopen,
    Close,
}

/// What a call came to.
enum Outcome {
    Next(Result<Option<RawFrame>, SourceError>),
    Reopened(Result<(), SourceError>),
    Closed,
}

/// Why a call has not come to anything.
enum NoOutcome {
    Stopped,
    Late,
    /// Its thread has ended.
    Ended,
}

/// A thread that makes calls, one at a time. The source goes to it with each call and comes back
/// with the outcome.
struct Caller {
    calls: Sender<(Call, Box<dyn Source>)>,
    returns: Receiver<(Outcome, Box<dyn Source>)>,
    thread: Thread,
}

/// Whether a thread lives still, without waiting for it.
struct Thread {
    /// Held by the thread; what the kernel ends does not let it go.
    alive: Weak<()>,
    /// Its folder below /proc; `None` where the system does not tell.
    folder: Option<PathBuf>,
}

impl Caller {
    fn start() -> std::io::Result<Self> {
        let (calls, called) = bounded::<(Call, Box<dyn Source>)>(1);
        // Handed over and never stored: a source that comes back too late must be dropped, and with
        // it closed, on its own thread.
        let (answers, returns) = bounded(0);
        let (folder_in, folder) = bounded(1);
        let token = Arc::new(());
        let alive = Arc::downgrade(&token);
        let run = move || {
            let _alive = token;
            let _ = folder_in.send(std::fs::read_link("/proc/thread-self").ok());
            make_calls(&called, &answers);
        };
        std::thread::Builder::new()
            .name("camera".into())
            .spawn(run)?;
        let folder = folder.recv().ok().flatten();
        let folder = folder.map(|name| Path::new("/proc").join(name));
        Ok(Self {
            calls,
            returns,
            thread: Thread { alive, folder },
        })
    }
}

/// Works calls off until nobody waits for the answer any more.
fn make_calls(
    called: &Receiver<(Call, Box<dyn Source>)>,
    answers: &Sender<(Outcome, Box<dyn Source>)>,
) {
    for (call, mut source) in called {
        let outcome = match call {
            Call::Next => Outcome::Next(source.next_frame()),
            Call::Reopen => Outcome::Reopened(source.reopen()),
            Call::Close => {
                source.close();
                Outcome::Closed
            }
        };
        if answers.send((outcome, source)).is_err() {
            break;
        }
    }
}

impl Thread {
    fn lives(&self) -> bool {
        self.alive.strong_count() > 0 && self.folder.as_ref().is_none_or(|folder| folder.exists())
    }
}

/// A source whose calls are made on a thread that may be left behind.
pub struct Watched {
    /// `None` while a call is under way.
    source: Option<Box<dyn Source>>,
    /// The last call, and when it was begun.
    last: (Call, Instant),
    /// `None` when its thread has ended, and nothing will ever answer.
    caller: Option<Caller>,
    left_behind: Vec<Thread>,
    successor: Option<Successor>,
    info: SourceInfo,
    health: Health,
    limit: Duration,
    /// Settings that came after the start.
    settings: Option<config::Camera>,
    stop: Arc<AtomicBool>,
}

impl Watched {
    /// The source itself where it reads files, else a camera on a thread of its own; silence of
    /// `limit` is a failure.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn if_live(source: Box<dyn Source>, limit: Duration) -> std::io::Result<Box<dyn Source>> {
        Ok(if source.describe().live {
            Box::new(Self::start(source, limit)?)
        } else {
            source
        })
    }

    /// # Errors
    /// The thread cannot be started.
    pub fn start(source: Box<dyn Source>, limit: Duration) -> std::io::Result<Self> {
        Ok(Self {
            caller: Some(Caller::start()?),
            left_behind: Vec::new(),
            successor: source.successor(),
            info: source.describe(),
            health: source.health(),
            source: Some(source),
            last: (Call::Close, Instant::now()),
            limit,
            settings: None,
            stop: Arc::default(),
        })
    }

    fn disconnected(&self, reason: String) -> SourceError {
        SourceError::Disconnected {
            input: self.info.name.clone(),
            reason,
        }
    }

    fn error(&self, why: &NoOutcome) -> SourceError {
        match why {
            NoOutcome::Stopped | NoOutcome::Late => SourceError::Timeout {
                input: self.info.name.clone(),
                seconds: self.limit.as_secs_f64(),
            },
            NoOutcome::Ended => self.disconnected("its thread has ended".into()),
        }
    }

    /// Begins a call if the source is at hand; [`wait`](Self::wait) for what it comes to.
    fn begin(&mut self, call: Call) {
        self.last = (call, Instant::now());
        if let Some(caller) = &self.caller
            && let Some(source) = self.source.take()
            && caller.calls.send((call, source)).is_err()
        {
            self.caller = None;
        }
    }

    /// Waits for the call under way, `limit` at most.
    fn wait(&mut self, limit: Duration) -> Result<Outcome, NoOutcome> {
        let until = Instant::now() + limit;
        loop {
            let Some(caller) = &self.caller else {
                return Err(NoOutcome::Ended);
            };
            let left = until.saturating_duration_since(Instant::now());
            match caller.returns.recv_timeout(left.min(NAP)) {
                Ok((outcome, source)) => {
                    self.health = source.health();
                    self.source = Some(source);
                    return Ok(outcome);
                }
                Err(RecvTimeoutError::Disconnected) => self.caller = None,
                Err(RecvTimeoutError::Timeout) if self.stop.load(Ordering::Relaxed) => {
                    return Err(NoOutcome::Stopped);
                }
                Err(RecvTimeoutError::Timeout) if left.is_zero() => return Err(NoOutcome::Late),
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// How much longer the call under way may take before it is left behind.
    fn patience(&self) -> Duration {
        let (call, begun) = self.last;
        let whole = match call {
            Call::Next => self.limit + CLOSES_WITHIN,
            Call::Reopen => self.limit * OPENING_LIMITS,
            Call::Close => CLOSES_WITHIN,
        };
        whole.saturating_sub(begun.elapsed())
    }

    /// Goes on with the successor of a source that hangs, or whose thread has ended.
    fn leave_behind(&mut self, why: &NoOutcome) -> Result<(), SourceError> {
        let Some(successor) = &self.successor else {
            return Err(self.error(why));
        };
        self.left_behind.retain(Thread::lives);
        if self.left_behind.len() >= LEFT_BEHIND {
            return Err(self.disconnected(format!(
                "{LEFT_BEHIND} calls to its driver have not returned"
            )));
        }
        let caller = Caller::start()
            .map_err(|e| self.disconnected(format!("a thread cannot be started: {e}")))?;
        let mut source = successor();
        source.stop_when(self.stop.clone());
        self.successor = source.successor();
        self.source = Some(source);
        if let Some(left) = self.caller.replace(caller) {
            self.left_behind.push(left.thread);
        }
        Ok(())
    }
}

impl Source for Watched {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        loop {
            self.begin(Call::Next);
            match self.wait(self.limit + ANSWERS_AFTER) {
                Ok(Outcome::Next(next)) => {
                    if next.is_err() {
                        // The loss is reported while the device is closed.
                        self.begin(Call::Close);
                    }
                    return next;
                }
                // The late answer to an older call.
                Ok(Outcome::Reopened(done)) => done?,
                Ok(Outcome::Closed) => {}
                Err(NoOutcome::Stopped) => return Ok(None),
                Err(why) => return Err(self.error(&why)),
            }
        }
    }

    fn describe(&self) -> SourceInfo {
        self.source
            .as_ref()
            .map_or_else(|| self.info.clone(), |source| source.describe())
    }

    fn stop_when(&mut self, stop: Arc<AtomicBool>) {
        if let Some(source) = &mut self.source {
            source.stop_when(stop.clone());
        }
        self.stop = stop;
    }

    fn adopt(&mut self, config: &config::Camera) {
        self.limit = config.time_limit();
        self.settings = Some(config.clone());
        if let Some(source) = &mut self.source {
            source.adopt(config);
        }
    }

    fn returns(&self) -> bool {
        match &self.source {
            Some(source) => source.returns(),
            None => self.caller.is_some() || self.successor.is_some(),
        }
    }

    fn reopen(&mut self) -> Result<(), SourceError> {
        if self.source.is_none() {
            match self.wait(self.patience().min(self.limit)) {
                // A call that hung has returned with a frame: the camera is well again.
                Ok(Outcome::Next(Ok(_)) | Outcome::Reopened(Ok(()))) => return Ok(()),
                Ok(_) => {}
                Err(why @ NoOutcome::Stopped) => return Err(self.error(&why)),
                Err(why @ NoOutcome::Late) if !self.patience().is_zero() => {
                    return Err(self.error(&why));
                }
                Err(why) => self.leave_behind(&why)?,
            }
        }
        if let (Some(source), Some(settings)) = (&mut self.source, &self.settings) {
            source.adopt(settings);
        }
        self.begin(Call::Reopen);
        match self.wait(self.limit + ANSWERS_AFTER) {
            Ok(Outcome::Reopened(Err(SourceError::Busy { .. })))
                if self.left_behind.iter().any(Thread::lives) =>
            {
                Err(self.disconnected("an earlier call to its driver has not returned".into()))
            }
            Ok(Outcome::Reopened(done)) => done,
            Ok(_) => Err(self.error(&NoOutcome::Late)),
            Err(why) => Err(self.error(&why)),
        }
    }

    fn health(&self) -> Health {
        self.health
    }

    fn warnings(&mut self) -> Vec<String> {
        self.source
            .as_mut()
            .map_or_else(Vec::new, |source| source.warnings())
    }
}

impl Drop for Watched {
    /// Closes the device, but waits for that no longer than is reasonable.
    fn drop(&mut self) {
        // What was asked to stop is waited for all the same.
        self.stop = Arc::default();
        let until = Instant::now() + CLOSES_WITHIN;
        if self.source.is_none() && self.wait(CLOSES_WITHIN).is_err() {
            return;
        }
        self.begin(Call::Close);
        let left = until.saturating_duration_since(Instant::now());
        let _ = self.wait(left);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{FormatNote, PixelFormat, Size};

    /// Hangs at its third frame until it is released, fails at the fifth, and can be opened again.
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
                depth: None,
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
                depth: None,
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

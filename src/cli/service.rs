//! Notifications to a service manager (sd_notify): ready at the first frame, alive while frames
//! come, and a line of status.
//!
//! Every capture runs this; without the environment variable `NOTIFY_SOCKET` nothing is sent.

use super::output::eprint_line;
use crate::model::Snapshot;
use crate::runtime::{Running, Sign, Vigil};
use sd_notify::NotifyState;
use std::time::{Duration, Instant};

/// Interval of notifications, unless a watchdog needs a shorter one.
const NOTIFY_INTERVAL: Duration = Duration::from_secs(1);
/// The manager's time limit for start or stop is extended by this with every notification.
const EXTENSION: Duration = Duration::from_secs(30);

/// Longest text of the verdict in the line of status, characters.
const VERDICT_LENGTH: usize = 100;

/// Connection to the service manager.
pub struct Service {
    watchdog: Option<Duration>,
    every: Duration,
    next: Instant,
    vigil: Vigil,
    ready: bool,
    stopping: bool,
    stalled: bool,
    status: String,
}

impl Service {
    /// `None` without a service manager. `timeout_s` is `camera.timeout_s`.
    pub fn from_env(timeout_s: f64) -> Option<Self> {
        std::env::var_os("NOTIFY_SOCKET")?;
        let watchdog = sd_notify::watchdog_enabled();
        let every = watchdog.map_or(NOTIFY_INTERVAL, |limit| NOTIFY_INTERVAL.min(limit / 4));
        let service = Self {
            watchdog,
            every,
            next: Instant::now(),
            vigil: Vigil::default(),
            ready: false,
            stopping: false,
            stalled: false,
            status: "opening the camera".to_owned(),
        };
        service.warn_of_limit(timeout_s);
        Some(service)
    }

    /// Warns if the watchdog's limit is not above `timeout_s`: the manager would then take a silent
    /// camera for a program that hangs.
    pub fn warn_of_limit(&self, timeout_s: f64) {
        if let Some(limit) = self
            .watchdog
            .filter(|limit| limit.as_secs_f64() <= timeout_s)
        {
            eprint_line(&format!(
                "arborcam: warning: the watchdog's limit of {} s is not above camera.timeout_s = \
                 {timeout_s}; a silent camera will look like a hung program: raise WatchdogSec, \
                 or lower camera.timeout_s",
                limit.as_secs_f64()
            ));
        }
    }

    /// Notifies the manager when it is time to; to be called often.
    pub fn tick(&mut self, running: &Running, snapshot: Option<&Snapshot>) {
        if let Some(snapshot) = snapshot {
            self.status = status(snapshot);
        }
        let marks = running.marks();
        let begins = !self.ready && marks.flowed();
        let ends = !self.stopping && marks.ends();
        if Instant::now() < self.next && !begins && !ends {
            return;
        }
        self.next = Instant::now() + self.every;
        let flowed = marks.flowed();
        let sign = self.vigil.look(marks);
        self.notify(sign, flowed);
    }

    /// Sends the notifications for `sign`; `flowed`: there has been an undamaged frame.
    fn notify(&mut self, sign: Sign, flowed: bool) {
        let extend = NotifyState::ExtendTimeoutUsec(EXTENSION.as_micros() as u32);
        match sign {
            Sign::Flows if flowed => {
                if !self.ready {
                    self.ready = true;
                    send(&[NotifyState::Ready]);
                }
                send(&[NotifyState::Watchdog, NotifyState::Status(&self.status)]);
            }
            // All frames so far were damaged: alive, but not ready.
            Sign::Flows => send(&[NotifyState::Status("no whole frame yet")]),
            Sign::Waits => {
                let waiting = NotifyState::Status("waiting for the camera");
                send(&[NotifyState::Watchdog, waiting]);
                if !self.ready {
                    send(&[extend]);
                }
            }
            Sign::Ends => {
                if !self.stopping {
                    self.stopping = true;
                    let writing = NotifyState::Status("writing the capture");
                    send(&[NotifyState::Stopping, writing]);
                }
                send(&[extend]);
            }
            Sign::Stalls(thread) if !self.stalled => {
                tracing::debug!("no sign of life: {thread} does not get on");
            }
            Sign::Stalls(_) => {}
        }
        self.stalled = matches!(sign, Sign::Stalls(_));
    }

    /// Runs `reload`; the manager counts the program as not ready meanwhile.
    pub fn reloading(&self, reload: impl FnOnce()) {
        if let (true, Ok(now)) = (self.ready, NotifyState::monotonic_usec_now()) {
            send(&[NotifyState::Reloading, now]);
            reload();
            send(&[NotifyState::Ready]);
        } else {
            reload();
        }
    }
}

/// Sends a notification. Errors are ignored: filming goes on without a manager.
fn send(state: &[NotifyState]) {
    let _ = sd_notify::notify(state);
}

/// The line of status.
fn status(s: &Snapshot) -> String {
    let lost = s.lost_in_camera + s.dropped_before_tracker + s.undecodable;
    let frames = format!(
        "frame {}, {:.1} a second, {lost} lost, {} points",
        s.frame, s.sensor_rate_hz, s.tracks_alive
    );
    let status = format!("{}: {frames}", s.phase.name());
    match &s.verdict {
        Some(verdict) => format!("{status}; {}", verdict.line_within(VERDICT_LENGTH)),
        None => status,
    }
}

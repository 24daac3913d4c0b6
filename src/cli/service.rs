//! What is reported to a service manager (sd_notify): ready when frames flow, alive as long as they
//! do, one line of state.
//!
//! Nothing is sent where nobody asked for it (`NOTIFY_SOCKET`), so this runs in every capture.

use super::output::say;
use crate::model::Snapshot;
use crate::runtime::{Running, Sign, Vigil};
use sd_notify::NotifyState;
use std::time::{Duration, Instant};

/// Time between two looks where no watchdog asks for more.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// A time limit of the manager for start or end is extended by this with every sign of life.
const EXTENSION: Duration = Duration::from_secs(30);

/// The line to the service manager.
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
    /// `None` where no service manager listens. `timeout_s` is the silence that a camera is
    /// allowed.
    pub fn from_env(timeout_s: f64) -> Option<Self> {
        std::env::var_os("NOTIFY_SOCKET")?;
        let watchdog = sd_notify::watchdog_enabled();
        let every = watchdog.map_or(LOOK_EVERY, |limit| LOOK_EVERY.min(limit / 4));
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

    /// Says so if the manager takes a camera that is silent for as long as it may be for a program
    /// that hangs.
    pub fn warn_of_limit(&self, timeout_s: f64) {
        if let Some(limit) = self
            .watchdog
            .filter(|limit| limit.as_secs_f64() <= timeout_s)
        {
            say(&format!(
                "arborcam: warning: the watchdog's limit of {} s is not above camera.timeout_s = {timeout_s}; a silent \
                 camera will look like a hung program: raise WatchdogSec, or lower camera.timeout_s",
                limit.as_secs_f64()
            ));
        }
    }

    /// To be called again and again; looks at the capture when it is time to.
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

    /// Sends what the manager is to know of this `sign`; `flowed`: there has been a whole frame.
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
            // Every frame so far was damaged: alive, and of no use yet.
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

    /// Settings are read again: between the two messages the manager does not count us as ready.
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

/// A manager that does not listen any more is no reason to stop filming.
fn send(state: &[NotifyState]) {
    let _ = sd_notify::notify(state);
}

fn status(s: &Snapshot) -> String {
    let lost = s.lost_in_camera + s.dropped_before_tracker + s.undecodable;
    let frames = format!(
        "frame {}, {:.1} a second, {lost} lost, {} points",
        s.frame, s.sensor_rate_hz, s.tracks_alive
    );
    format!("{}: {frames}", s.phase.name())
}

//! Waits for a camera that was lost, and goes on with it.

use super::nap::NAP;
use super::shared::Shared;
use crate::config;
use crate::model::{GapCause, RawFrame};
use crate::source::{Source, SourceError};
use std::time::{Duration, Instant};

/// Time between two looks whether the camera is there. It costs next to nothing, and is a small
/// part of the two seconds within which a capture has to go on.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// A node belongs to root alone until udev has given it its group, a moment after it has appeared.
const SETTLES: Duration = Duration::from_secs(2);

/// What the loss is called in `capture.json`.
pub fn cause(e: &SourceError) -> GapCause {
    match e {
        SourceError::Timeout { .. } => GapCause::Silent,
        _ => GapCause::Disconnected,
    }
}

/// How a wait ended.
pub enum Waited {
    /// With the first frame of the source, which delivers again.
    Back(RawFrame),
    /// Asked to stop.
    Stopped,
    /// Waiting was switched off meanwhile.
    Unwanted,
    /// It will never be back.
    Hopeless(SourceError),
}

/// Tries until the source delivers again; `returned` is when it did so the last time.
pub fn wait(
    source: &mut dyn Source,
    lost: &SourceError,
    camera: &mut config::Camera,
    returned: Option<Instant>,
    shared: &Shared,
) -> Waited {
    let since = Instant::now();
    let at_s = shared.last_time_s();
    let reason = lost.brief();
    shared.news(format!(
        "the camera was lost at {at_s:.1} s ({reason}); waiting for it, what was captured is kept"
    ));
    shared.camera(|c| c.away = Some(reason.clone()));
    let mut attempts = Attempts {
        said: reason,
        denied_since: None,
    };
    // One that delivers a frame and fails, over and over, is not opened more often than one that
    // never delivers.
    let pause = returned.map_or(Duration::ZERO, |at| {
        retry_delay(camera).saturating_sub(at.elapsed())
    });
    let waited = attempts.until_back(source, camera, pause, shared);
    let is_back = matches!(waited, Waited::Back(_));
    shared.camera(|c| {
        c.away = None;
        c.reconnects += u64::from(is_back);
    });
    if is_back {
        let away_s = since.elapsed().as_secs_f64();
        shared.news(format!(
            "the camera is back after {away_s:.1} s; the capture goes on"
        ));
    }
    waited
}

/// The attempts of one wait.
struct Attempts {
    /// Why the camera cannot go on, as it was last told.
    said: String,
    denied_since: Option<Instant>,
}

impl Attempts {
    /// The first attempt is made after `pause`.
    fn until_back(
        &mut self,
        source: &mut dyn Source,
        camera: &mut config::Camera,
        mut pause: Duration,
        shared: &Shared,
    ) -> Waited {
        loop {
            if !sleep(pause, shared) {
                return Waited::Stopped;
            }
            adopt_new_settings(source, camera, shared);
            if !camera.reconnect {
                return Waited::Unwanted;
            }
            // It is back when it delivers: one that starts and falls silent again is not.
            let e = match source.reopen().and_then(|()| source.next_frame()) {
                Ok(Some(first)) => return Waited::Back(first),
                Ok(None) => return Waited::Stopped,
                Err(e) => e,
            };
            if !source.returns() {
                return Waited::Hopeless(e);
            }
            pause = if self.is_on_its_way(&e) {
                LOOK_EVERY
            } else {
                self.tell(&e, shared);
                retry_delay(camera)
            };
        }
    }

    /// Not there yet, or not yet given to its group: nothing to tell.
    fn is_on_its_way(&mut self, e: &SourceError) -> bool {
        if !matches!(e, SourceError::Denied { .. }) {
            self.denied_since = None;
            return matches!(e, SourceError::Absent { .. });
        }
        let since = self.denied_since.get_or_insert_with(Instant::now);
        since.elapsed() < SETTLES
    }

    fn tell(&mut self, e: &SourceError, shared: &Shared) {
        // An attempt that a request to stop has cut short says nothing of the camera.
        let why = e.brief();
        if why != self.said && !shared.stopped() {
            shared.news(format!("the camera cannot go on yet: {why}"));
            self.said = why;
        }
    }
}

fn retry_delay(camera: &config::Camera) -> Duration {
    Duration::from_secs_f64(camera.retry_delay_s.clamp(0.05, 3600.0))
}

/// Takes over settings that were read again while the capture runs.
pub fn adopt_new_settings(source: &mut dyn Source, camera: &mut config::Camera, shared: &Shared) {
    if let Some(config) = shared.newly_reloaded() {
        source.adopt(&config.camera);
        *camera = config.camera;
    }
}

/// `false` when asked to stop meanwhile. New settings end it early: they may shorten or forbid the
/// wait.
fn sleep(length: Duration, shared: &Shared) -> bool {
    let until = Instant::now() + length;
    while !shared.stopped() {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() || shared.has_new_settings() {
            return true;
        }
        std::thread::sleep(left.min(NAP));
        shared.pulse.waits();
    }
    false
}

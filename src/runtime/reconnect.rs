//! Waits for a camera that was lost, and goes on with it.

use super::shared::Shared;
use crate::config;
use crate::export::capture::GapCause;
use crate::model::RawFrame;
use crate::source::{Source, SourceError};
use std::time::{Duration, Instant};

/// Time between two looks whether the camera is there. It costs next to nothing, and is a small part of the two seconds
/// within which a capture has to go on.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Longest sleep after which a wish to stop is heard.
const NAP: Duration = Duration::from_millis(20);

/// What the loss is called in `capture.json`.
pub fn cause(e: &SourceError) -> GapCause {
    match e {
        SourceError::Timeout { .. } => GapCause::Silent,
        _ => GapCause::Disconnected,
    }
}

/// Tries until the source delivers again; gives its first frame. `None` when asked to stop.
pub fn wait(
    source: &mut dyn Source,
    lost: &SourceError,
    camera: &mut config::Camera,
    shared: &Shared,
) -> Option<RawFrame> {
    let since = Instant::now();
    let at_s = shared.last_time_s();
    let reason = lost.brief();
    shared.news(format!("the camera was lost at {at_s:.1} s ({reason}); waiting for it, what was captured is kept"));
    shared.camera(|c| c.away = Some(reason.clone()));
    let mut said = reason.clone();
    let first = loop {
        adopt_new_settings(source, camera, shared);
        // It is back when it delivers: one that starts and falls silent again is not.
        let attempt = source.reopen().and_then(|()| source.next_frame());
        let e = match attempt {
            Ok(first) => break first,
            Err(e) => e,
        };
        let absent = matches!(e, SourceError::Absent { .. });
        let why = e.brief();
        if !absent && why != said {
            shared.news(format!("the camera cannot go on yet: {why}"));
            said = why;
        }
        if !sleep(
            if absent { LOOK_EVERY } else { Duration::from_secs_f64(camera.retry_delay_s.clamp(0.05, 3600.0)) },
            shared,
        ) {
            break None;
        }
    };
    shared.camera(|c| {
        c.away = None;
        c.reconnects += u64::from(first.is_some());
    });
    if first.is_some() {
        let away_s = since.elapsed().as_secs_f64();
        shared.news(format!("the camera is back after {away_s:.1} s; the capture goes on"));
    }
    first
}

/// Takes over settings that were read again while the capture runs.
pub fn adopt_new_settings(source: &mut dyn Source, camera: &mut config::Camera, shared: &Shared) {
    if let Some(config) = shared.newly_reloaded() {
        source.adopt(&config.camera);
        *camera = config.camera;
    }
}

/// `false` when asked to stop meanwhile.
fn sleep(length: Duration, shared: &Shared) -> bool {
    let until = Instant::now() + length;
    while !shared.stopped() {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return true;
        }
        std::thread::sleep(left.min(NAP));
        shared.pulse.waits();
    }
    false
}

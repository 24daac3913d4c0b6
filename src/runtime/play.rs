//! Frames of any source into a loopback device, at the pace at which they were taken.

use super::nap;
use crate::source::{Loopback, Source, SourceError};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// What was played.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Played {
    pub frames: u64,
    /// Ended by `stop` rather than by the end of the frames.
    pub stopped: bool,
}

/// Plays `source` once; `open` makes the output for the first frame, or gives the one that is open
/// already.
///
/// # Errors
/// The source fails, or the device.
pub fn play(
    source: &mut dyn Source,
    output: &mut Option<Loopback>,
    open: impl FnOnce(&crate::model::RawFrame) -> Result<Loopback, SourceError>,
    stop: &AtomicBool,
) -> Result<Played, SourceError> {
    let mut played = Played::default();
    let Some(mut waiting) = source.next_frame()? else {
        return Ok(played);
    };
    let output = match output {
        Some(open) => open,
        None => output.insert(open(&waiting)?),
    };
    let (start, start_s) = (Instant::now(), waiting.sensor_time_s);
    let mut interval = Duration::ZERO;
    loop {
        let due =
            start + Duration::from_secs_f64((waiting.sensor_time_s - start_s).clamp(0.0, 1e6));
        if !nap::until(due, stop) {
            return Ok(Played {
                stopped: true,
                ..played
            });
        }
        output.put(&waiting)?;
        played.frames += 1;
        match source.next_frame()? {
            Some(raw) => {
                interval = Duration::from_secs_f64(
                    (raw.sensor_time_s - waiting.sensor_time_s).clamp(0.0, 1e6),
                );
                waiting = raw;
            }
            // The last frame has its time as well, before another round begins.
            None => {
                return Ok(Played {
                    stopped: !nap::until(due + interval, stop),
                    ..played
                });
            }
        }
    }
}

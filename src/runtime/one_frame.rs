//! One frame of a film, a recording or a camera, as a picture.

use super::watched::Watched;
use crate::config;
use crate::model::{Picture, RawFrame};
use crate::source::{DecodeError, Decoder, Source, SourceError};
use std::sync::Arc;

/// Why there is no such frame. Each message is one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    #[error(transparent)]
    Source(#[from] SourceError),
    #[error("it has {frames} frames, counted from 0; give a smaller number")]
    TooShort { frames: u64 },
    #[error("frame {frame} of it: {source}; take another")]
    Damaged { frame: u64, source: DecodeError },
    #[error("a thread cannot be started: {0}")]
    Thread(std::io::Error),
}

/// The frame of this number, counted from 0, in colour and in its own size. A camera that says nothing for
/// as long as `camera` allows is given up.
///
/// # Errors
/// The source fails or has fewer frames, or the frame is damaged.
pub fn one_frame(
    source: Box<dyn Source>,
    number: u64,
    camera: &config::Camera,
) -> Result<Picture, FrameError> {
    let mut source = Watched::if_live(source, camera.time_limit()).map_err(FrameError::Thread)?;
    let mut raw = frame(&mut *source, 0)?;
    let first_s = raw.sensor_time_s;
    for k in 1..=number {
        raw = frame(&mut *source, k)?;
    }
    let damaged = |source| FrameError::Damaged {
        frame: number,
        source,
    };
    let mut decoder = Decoder::new().map_err(damaged)?;
    let rgb = decoder.preview(&raw, raw.size.width).map_err(damaged)?;
    Ok(Picture {
        rgb: Arc::new(rgb),
        frame: number,
        time_s: raw.sensor_time_s - first_s,
    })
}

/// The next frame, of this number.
fn frame(source: &mut dyn Source, number: u64) -> Result<RawFrame, FrameError> {
    let next = source.next_frame()?;
    next.ok_or(FrameError::TooShort { frames: number })
}

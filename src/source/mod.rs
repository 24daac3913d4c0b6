//! Where frames come from: a camera, a recording, a video file or a folder of pictures, all behind one trait.
//!
//! A source hands frames out as they left the camera or the file, with their own number and time; [`Decoder`] turns
//! them into the pictures that the tracker and the screen want.

mod clock;
mod decode;
mod devices;
mod error;
mod images;
mod loopback;
mod probe;
mod recording;
mod v4l2;
mod video;

pub use decode::{DecodeError, Decoder};
pub use devices::{Device, list};
pub use error::SourceError;
pub use loopback::Loopback;

use crate::config;
use crate::model::{FormatNote, RawFrame, Size};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// What was opened and what is to be expected of it.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceInfo {
    /// The input as the user named it; for a camera its own name as well.
    pub name: String,
    pub format: FormatNote,
    pub size: Size,
    /// What camera or file says of itself; the frames' own times are what counts.
    pub nominal_rate_hz: Option<f64>,
    pub frames_total: Option<u64>,
    /// A live source does not wait for its reader; any other does.
    pub live: bool,
}

/// A sequence of frames.
pub trait Source: Send {
    /// Waits for the next frame; `None` is the end, and stays it.
    ///
    /// # Errors
    /// The source has failed and will not deliver again; open it anew.
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError>;

    fn describe(&self) -> SourceInfo;

    /// A source that may wait long gives up, and returns `None`, soon after this has been set.
    fn stop_when(&mut self, _stop: Arc<AtomicBool>) {}

    /// Lines to show to the user since the last call, e.g. that a clip ends early; complete after the end.
    fn warnings(&mut self) -> Vec<String> {
        Vec::new()
    }
}

/// Opens whatever `input` is; `fps` is the rate of a folder of pictures (30 if not given), nothing else needs it.
///
/// # Errors
/// There is nothing that can be read as frames; the error says why and what to do.
pub fn open(input: &Path, config: &config::Camera, fps: Option<f64>) -> Result<Box<dyn Source>, SourceError> {
    let name = input.display().to_string();
    let kind = std::fs::metadata(input).map_err(|e| SourceError::of_file(input, &e))?.file_type();
    if kind.is_char_device() {
        Ok(Box::new(v4l2::Camera::open(input, config)?))
    } else if kind.is_dir() {
        Ok(Box::new(images::Images::open(input, fps.unwrap_or(30.0))?))
    } else if !kind.is_file() {
        let what = "it is neither a camera, nor a video file, nor a folder of pictures".to_owned();
        Err(SourceError::BadFormat { input: name, what })
    } else if input.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap")) {
        Ok(Box::new(recording::Recording::open(input)?))
    } else {
        Ok(Box::new(video::Video::open(input)?))
    }
}

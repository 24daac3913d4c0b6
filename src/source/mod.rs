//! Where frames come from: a camera, a recording, a video file or a folder of pictures, all behind
//! one trait.
//!
//! A source hands frames out as they left the camera or the file, with their own number and time;
//! [`Decoder`] turns them into the pictures that the tracker and the screen want.

mod choice;
mod clock;
mod decode;
mod devices;
mod error;
mod identity;
mod images;
mod loopback;
mod opened;
mod probe;
mod recording;
#[cfg(feature = "nokhwa")]
mod through_nokhwa;
mod v4l2;
mod video;

pub use choice::Mode;
pub use clock::ClockKind;
pub use decode::{DecodeError, Decoder};
pub use devices::{Device, list, list_for};
pub use error::{SourceError, group_name};
pub use identity::{Identity, Places};
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

/// What a source knows beyond its frames. The counts only ever grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Health {
    /// Frames that came damaged, short or with the driver's error flag, and were left out.
    pub damaged: u64,
    /// Frames that were not later than the one before, and were left out.
    pub stale: u64,
    /// What the frames' times are by.
    pub clock: ClockKind,
}

/// Makes the same camera once more: closed, and with the counts and the clock of the first one as
/// they are at that moment.
pub type Successor = Box<dyn Fn() -> Box<dyn Source> + Send>;

/// A sequence of frames. Any call to a live one may block for as long as its driver does, or for
/// ever; `runtime` makes them on a thread that it can leave behind.
pub trait Source: Send {
    /// Waits for the next frame; `None` is the end, and stays it.
    ///
    /// # Errors
    /// The source has failed and will not deliver again, unless it [`returns`](Self::returns) and
    /// is opened anew.
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError>;

    fn describe(&self) -> SourceInfo;

    /// A source that may wait long gives up, and returns `None`, soon after this has been set.
    fn stop_when(&mut self, _stop: Arc<AtomicBool>) {}

    /// Takes over what can be changed of `config` while frames flow: the limits of time.
    fn adopt(&mut self, _config: &config::Camera) {}

    /// Whether it may come back after a failure, as a camera does that is plugged in again.
    fn returns(&self) -> bool {
        false
    }

    /// One attempt to go on after a failure: the same camera, the same format. Whoever calls
    /// decides when to try again; the source only says why it is not yet. Its frames go on with
    /// times that fit those before.
    ///
    /// # Errors
    /// It is not back: `Absent` where it is not even there, which costs next to nothing to find
    /// out.
    fn reopen(&mut self) -> Result<(), SourceError> {
        Err(SourceError::Absent {
            input: self.describe().name,
            hint: "it cannot be opened again",
        })
    }

    /// Gives the device back after a failure, so that it can go and come back.
    fn close(&mut self) {}

    /// How to go on with the same camera if a call to its driver never returns; `None` where there
    /// is no other way than to wait for that call.
    fn successor(&self) -> Option<Successor> {
        None
    }

    fn health(&self) -> Health {
        Health::default()
    }

    /// Lines to show to the user since the last call, e.g. that a clip ends early; complete after
    /// the end.
    fn warnings(&mut self) -> Vec<String> {
        Vec::new()
    }
}

/// Opens whatever `input` is, a path or the identity of a camera; `fps` is the rate of a folder of
/// pictures (30 if not given), nothing else needs it.
///
/// # Errors
/// There is nothing that can be read as frames; the error says why and what to do.
pub fn open(
    input: &Path,
    config: &config::Camera,
    fps: Option<f64>,
) -> Result<Box<dyn Source>, SourceError> {
    let name = input.display().to_string();
    let named;
    let input = if devices::is_identity(&name) && !input.exists() {
        named = devices::by_identity(&name, &Places::default())?;
        &named
    } else {
        input
    };
    let kind = std::fs::metadata(input)
        .map_err(|e| SourceError::of_file(input, &e))?
        .file_type();
    if kind.is_char_device() {
        open_camera(input, config)
    } else if kind.is_dir() {
        Ok(Box::new(images::Images::open(input, fps.unwrap_or(30.0))?))
    } else if !kind.is_file() {
        let what = "it is neither a camera, nor a video file, nor a folder of pictures".to_owned();
        Err(SourceError::BadFormat { input: name, what })
    } else if input
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("mcap"))
    {
        Ok(Box::new(recording::Recording::open(input)?))
    } else {
        Ok(Box::new(video::Video::open(input)?))
    }
}

fn open_camera(path: &Path, config: &config::Camera) -> Result<Box<dyn Source>, SourceError> {
    match config.backend {
        config::Backend::V4l2 => Ok(Box::new(v4l2::Camera::open(path, config)?)),
        #[cfg(feature = "nokhwa")]
        config::Backend::Nokhwa => Ok(Box::new(through_nokhwa::NokhwaCamera::open(path, config)?)),
        #[cfg(not(feature = "nokhwa"))]
        config::Backend::Nokhwa => Err(SourceError::BadFormat {
            input: path.display().to_string(),
            what: "the backend \"nokhwa\" was left out of this build; use --backend v4l2, \
                   or build with the cargo feature nokhwa"
                .to_owned(),
        }),
    }
}

#[cfg(all(test, not(feature = "nokhwa")))]
mod tests {
    use super::*;
    use crate::config::{Backend, Config};

    #[test]
    fn a_backend_that_was_left_out_is_named() {
        let camera = config::Camera {
            backend: Backend::Nokhwa,
            ..Config::default().camera
        };
        // Any character device; it is not even opened.
        let refused = open(Path::new("/dev/null"), &camera, None).err();
        let said = refused.map(|e| e.to_string()).unwrap_or_default();
        assert!(
            said.contains("\"nokhwa\" was left out of this build"),
            "{said}"
        );
    }
}

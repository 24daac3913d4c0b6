//! What every source offers, whatever its frames come from.

use super::clock::ClockKind;
use super::error::SourceError;
use crate::config;
use crate::model::{DepthFormat, FormatNote, Origin, RawFrame, Size};
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
    /// Of the depth images beside its pictures; `None` where there are none.
    pub depth: Option<DepthFormat>,
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
///
/// A source around another one gives it in [`wrapped`](Self::wrapped) and
/// [`wrapped_mut`](Self::wrapped_mut): what it does not answer itself, the other one is asked for.
pub trait Source: Send {
    /// Waits for the next frame; `None` is the end, and stays it.
    ///
    /// # Errors
    /// The source has failed and will not deliver again, unless it [`returns`](Self::returns) and
    /// is opened anew.
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError>;

    fn describe(&self) -> SourceInfo;

    /// The source that this one is put around.
    fn wrapped(&self) -> Option<&dyn Source> {
        None
    }

    /// The same, to be changed.
    fn wrapped_mut(&mut self) -> Option<&mut dyn Source> {
        None
    }

    /// What a file says of the making of its film. A camera knows nothing of it: its first frame
    /// is from now.
    fn origin(&self) -> Origin {
        self.wrapped().map_or_else(Origin::default, Source::origin)
    }

    /// A source that may wait long gives up, and returns `None`, soon after this has been set.
    fn stop_when(&mut self, stop: Arc<AtomicBool>) {
        if let Some(source) = self.wrapped_mut() {
            source.stop_when(stop);
        }
    }

    /// Takes over what can be changed of `config` while frames flow: the limits of time.
    fn adopt(&mut self, config: &config::Camera) {
        if let Some(source) = self.wrapped_mut() {
            source.adopt(config);
        }
    }

    /// Whether it may come back after a failure, as a camera does that is plugged in again.
    fn returns(&self) -> bool {
        self.wrapped().is_some_and(Source::returns)
    }

    /// One attempt to go on after a failure: the same camera, the same format. The caller
    /// decides when to try again; the source only says why it is not yet. Its frames go on with
    /// times that fit those before.
    ///
    /// # Errors
    /// It is not back: `Absent` where it is not even there, which costs next to nothing to find
    /// out.
    fn reopen(&mut self) -> Result<(), SourceError> {
        if let Some(source) = self.wrapped_mut() {
            return source.reopen();
        }
        Err(SourceError::Absent {
            input: self.describe().name,
            hint: "it cannot be opened again",
        })
    }

    /// Gives the device back after a failure, so that it can go and come back.
    fn close(&mut self) {
        if let Some(source) = self.wrapped_mut() {
            source.close();
        }
    }

    /// How to go on with the same camera if a call to its driver never returns; `None` where there
    /// is no other way than to wait for that call. That of a wrapped source would lack what is around
    /// it, and is not given.
    fn successor(&self) -> Option<Successor> {
        None
    }

    /// The depth camera beside this camera, once: its frames have depth images and no pictures. To be
    /// read on a thread of its own.
    fn take_depth_camera(&mut self) -> Option<Box<dyn Source>> {
        None
    }

    fn health(&self) -> Health {
        self.wrapped().map_or_else(Health::default, Source::health)
    }

    /// Lines to show to the user since the last call, e.g. that a clip ends early; complete after
    /// the end.
    fn warnings(&mut self) -> Vec<String> {
        self.wrapped_mut().map_or_else(Vec::new, Source::warnings)
    }
}

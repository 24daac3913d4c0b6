//! What a capture is to do, and what came out of it.

use super::finish::Written;
use super::recorder_thread::{RecordTo, Recorded};
use super::source_thread::Pace;
use crate::config::Config;
use crate::model::{UserNotes, Verdict};
use crate::outline::Given;
use crate::solve::Model;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// What is to be done with a source.
pub struct Job {
    pub config: Config,
    /// `None` finds it by motion.
    pub outline: Option<Given>,
    pub pace: Pace,
    /// Length of film after which it ends, s.
    pub length_s: Option<f64>,
    /// Gets a JSON line per pose.
    pub stream: Option<Box<dyn Write + Send>>,
    /// Folder of the capture; must not exist.
    pub out: Option<PathBuf>,
    /// Recording of the frames and of what is found in them.
    pub record: Option<RecordTo>,
    /// What the user notes on the film, for all files of the capture.
    pub notes: UserNotes,
    /// Time between two pictures for the screen; `None` where there is none.
    pub preview_every: Option<Duration>,
}

impl Job {
    /// Whether there is a screen, or a reader of the stream.
    pub fn is_watched(&self) -> bool {
        self.stream.is_some() || self.preview_every.is_some()
    }
}

/// What came out.
#[derive(Clone, Debug)]
pub struct Summary {
    pub frames: u64,
    pub tracks_total: u64,
    /// Points that moved when evidence was last judged, and the accumulation measure then.
    pub moving: usize,
    pub accumulation: f64,
    /// The one that was written, or where nothing was, the last one.
    pub tree: Option<Arc<Model>>,
    pub written: Option<Written>,
    /// What it is worth; `None` where nothing was filmed.
    pub verdict: Option<Verdict>,
    pub recorded: Option<Recorded>,
    /// Frames that should have been recorded and were not.
    pub not_recorded: u64,
}

//! Why a command did not succeed, and its exit status.

use crate::config::ConfigError;
use crate::document::DocumentError;
use crate::export::ExportError;
use crate::files::WriteError;
use crate::grow::GrowError;
use crate::recording::RecordingError;
use crate::runtime::Failure;
use crate::views::PrepareError;

/// Exit statuses, as documented for users.
pub const FAILED: u8 = 1;
pub const BAD_USAGE: u8 = 2;
pub const NO_INPUT: u8 = 3;
pub const STOPPED: u8 = 130;

/// Why a command did not succeed; the variant decides the exit status.
pub enum CommandError {
    /// The work failed: [`FAILED`].
    Failed(anyhow::Error),
    /// An argument, a setting or a file given with an option is wrong: [`BAD_USAGE`].
    BadUsage(anyhow::Error),
    /// The camera, recording or capture cannot be used: [`NO_INPUT`].
    NoInput(anyhow::Error),
    /// A signal stopped the command: [`STOPPED`], without a message.
    Stopped,
}

impl CommandError {
    pub fn failed(e: impl Into<anyhow::Error>) -> Self {
        Self::Failed(e.into())
    }

    pub fn bad_usage(e: impl Into<anyhow::Error>) -> Self {
        Self::BadUsage(e.into())
    }

    pub fn no_input(e: impl Into<anyhow::Error>) -> Self {
        Self::NoInput(e.into())
    }
}

impl From<ConfigError> for CommandError {
    fn from(e: ConfigError) -> Self {
        Self::bad_usage(e)
    }
}

impl From<Failure> for CommandError {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::NothingDecoded(_) => Self::no_input(failure),
            Failure::Recording(e) => e.into(),
            other => Self::failed(other),
        }
    }
}

impl From<RecordingError> for CommandError {
    fn from(e: RecordingError) -> Self {
        match e {
            RecordingError::Exists { .. } => Self::bad_usage(e),
            _ => Self::failed(e),
        }
    }
}

impl From<DocumentError> for CommandError {
    fn from(e: DocumentError) -> Self {
        match e {
            // The capture is sound, but no tree was found in its film.
            DocumentError::NoTree { .. } => Self::failed(e),
            _ => Self::no_input(e),
        }
    }
}

impl From<PrepareError> for CommandError {
    fn from(e: PrepareError) -> Self {
        match e {
            PrepareError::Document(e) => e.into(),
            PrepareError::Export(e) => e.into(),
            PrepareError::Shape(e) => Self::bad_usage(e),
            PrepareError::Planting(e) => Self::bad_usage(e),
            PrepareError::NoPose { .. } | PrepareError::NotDense { .. } => Self::bad_usage(e),
            PrepareError::Grow(GrowError::NoSpace | GrowError::OffTree) => Self::bad_usage(e),
            e => Self::failed(e),
        }
    }
}

impl From<ExportError> for CommandError {
    fn from(e: ExportError) -> Self {
        match e {
            ExportError::Write(e) => e.into(),
            e => Self::failed(e),
        }
    }
}

impl From<WriteError> for CommandError {
    fn from(e: WriteError) -> Self {
        match e {
            WriteError::Stopped => Self::Stopped,
            e => Self::failed(e),
        }
    }
}

//! How a command ends that did not do what it was asked for.

use crate::config::ConfigError;
use crate::document::DocumentError;
use crate::export::ExportError;
use crate::files::WriteError;
use crate::recording::RecordingError;
use crate::runtime::Failure;
use crate::views::PrepareError;

/// Exit status of the contract.
pub const FAILED: u8 = 1;
pub const BAD_USAGE: u8 = 2;
pub const NO_INPUT: u8 = 3;
pub const STOPPED: u8 = 130;

/// Why a command did not end well; decides the exit status.
pub enum Ended {
    Failed(anyhow::Error),
    BadUsage(anyhow::Error),
    NoInput(anyhow::Error),
    Stopped,
}

impl From<ConfigError> for Ended {
    fn from(e: ConfigError) -> Self {
        Ended::BadUsage(e.into())
    }
}

impl From<Failure> for Ended {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::NothingDecoded(_) => Ended::NoInput(failure.into()),
            Failure::Recording(e) => unbegun(e),
            other => Ended::Failed(other.into()),
        }
    }
}

impl From<DocumentError> for Ended {
    fn from(e: DocumentError) -> Self {
        match e {
            // A sound document of a film in which there was no tree.
            DocumentError::NoTree { .. } => Ended::Failed(e.into()),
            _ => Ended::NoInput(e.into()),
        }
    }
}

impl From<PrepareError> for Ended {
    fn from(e: PrepareError) -> Self {
        match e {
            PrepareError::Document(e) => e.into(),
            PrepareError::Export(e) => failed(e),
            PrepareError::Shape(e) => Ended::BadUsage(e.into()),
            PrepareError::NoPose { .. } => Ended::BadUsage(e.into()),
            e => Ended::Failed(e.into()),
        }
    }
}

/// How a command ends whose files could not be made.
pub fn failed(e: ExportError) -> Ended {
    match e {
        ExportError::Write(e) => unwritten(e),
        e => Ended::Failed(e.into()),
    }
}

/// How a command ends whose files could not be written.
pub fn unwritten(e: WriteError) -> Ended {
    match e {
        WriteError::Stopped => Ended::Stopped,
        e => Ended::Failed(e.into()),
    }
}

/// A recording that could not be begun.
pub fn unbegun(e: RecordingError) -> Ended {
    match e {
        RecordingError::Exists { .. } => Ended::BadUsage(e.into()),
        _ => Ended::Failed(e.into()),
    }
}

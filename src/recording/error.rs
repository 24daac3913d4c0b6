//! Why a recording cannot be written or read, by what the caller can do about it.

use std::io;
use std::path::{Path, PathBuf};

/// Each message is one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// Nothing is ever overwritten.
    #[error("{} exists already; name another file, or remove it first", .path.display())]
    Exists { path: PathBuf },
    /// The folder is not there, or may not be written to.
    #[error("cannot make {}: {source}; name a place that is there and that you may write to", .path.display())]
    Place { path: PathBuf, source: io::Error },
    /// No more room, a quota or a limit on files: what was written until then is whole.
    #[error("the disk is full: recording {} ends here and what it holds is readable; free some space", .path.display())]
    Full { path: PathBuf },
    /// The disk fails: what was written until then is as whole as the disk gives it back.
    #[error("recording {} ends here: {what}; what it holds until now is readable, check the disk", .path.display())]
    Disk { path: PathBuf, what: String },
    /// It is no recording, or nothing of it can be used.
    #[error("{} cannot be used: {what}", .path.display())]
    Unusable { path: PathBuf, what: String },
    /// It cannot be opened at all.
    #[error("cannot read {}: {source}", .path.display())]
    Unreadable { path: PathBuf, source: io::Error },
}

impl RecordingError {
    pub(super) fn unreadable(path: &Path, source: io::Error) -> Self {
        Self::Unreadable {
            path: path.to_owned(),
            source,
        }
    }

    pub(super) fn unusable(path: &Path, what: impl Into<String>) -> Self {
        Self::Unusable {
            path: path.to_owned(),
            what: what.into(),
        }
    }

    pub(super) fn of_place(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            io::ErrorKind::AlreadyExists => Self::Exists { path },
            _ if is_full(&source) => Self::Full { path },
            _ => Self::Place { path, source },
        }
    }

    pub(super) fn of_write(path: &Path, error: &mcap::McapError) -> Self {
        let path = path.to_owned();
        match error {
            mcap::McapError::Io(e) if is_full(e) => Self::Full { path },
            other => Self::Disk {
                path,
                what: other.to_string(),
            },
        }
    }
}

/// No space, no quota left, or the largest file that is allowed.
pub(super) fn is_full(e: &io::Error) -> bool {
    matches!(
        e.kind(),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge
    )
}

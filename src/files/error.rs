//! Why something could not be written, by what the caller can do about it.

use std::io;
use std::path::PathBuf;

/// Each message is one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// Nothing is ever overwritten unasked.
    #[error("{} exists already; choose another name, or remove it first", .path.display())]
    Exists { path: PathBuf },
    /// Some part of the path is a file.
    #[error("{} cannot be a folder: part of the path is a file or no name; choose another", .path.display())]
    NotAFolder { path: PathBuf },
    /// `bytes` is how much was to be written in all, as far as is known at this point.
    #[error(
        "the disk is full: {what} needs at least {} of free space; free some, or choose another \
         disk",
        size(*.bytes)
    )]
    DiskFull { what: String, bytes: u64 },
    #[error(
        "not allowed to write {what}; choose a place of your own, or ask for the right to write there"
    )]
    Denied { what: String },
    #[error("cannot write {what}: {source}")]
    Io { what: String, source: io::Error },
    /// The caller does not want it any more.
    #[error("stopped before it was complete; nothing is written")]
    Stopped,
}

impl WriteError {
    /// Sorts an I/O error; `what` names the file, `bytes` how much had to be written to it so far
    /// or in all.
    pub fn from_io(what: impl Into<String>, bytes: u64, source: io::Error) -> Self {
        let what = what.into();
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                Self::DiskFull { what, bytes }
            }
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                Self::Denied { what }
            }
            io::ErrorKind::NotADirectory => Self::NotAFolder { path: what.into() },
            _ => Self::Io { what, source },
        }
    }

    /// `what` has no form in its file format.
    pub fn no_form(what: impl Into<String>, why: impl std::fmt::Display) -> Self {
        Self::Io {
            what: what.into(),
            source: io::Error::other(why.to_string()),
        }
    }
}

/// Bytes for people.
fn size(bytes: u64) -> String {
    match bytes {
        0..1_000 => format!("{bytes} bytes"),
        1_000..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        _ => format!("{:.1} MB", bytes as f64 / 1e6),
    }
}

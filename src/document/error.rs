//! Why a document could not be read, by what the caller can do about it.

use crate::files::WriteError;
use std::io;
use std::path::{Path, PathBuf};

/// Each message is one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum DocumentError {
    #[error("{} is not there; check the name", .dir.display())]
    NotThere { dir: PathBuf },
    /// A folder that `grow` or another command has filled.
    #[error("{} holds several trees; give the folder of one, such as {}", .dir.display(), .one.display())]
    SeveralTrees { dir: PathBuf, one: PathBuf },
    #[error("{} is no capture: there is no capture.json in it; give a folder that `--out` has made", .dir.display())]
    NotACapture { dir: PathBuf },
    #[error(
        "{} is no capture but a file; give the folder that `--out` has made (a file of an option follows `=`, as in \
         --markers=FILE)",
        .path.display()
    )]
    AFile { path: PathBuf },
    /// A table without which there is nothing to show.
    #[error("{} lacks {file}; copy the capture with all its files, or make it anew", .dir.display())]
    Missing { dir: PathBuf, file: &'static str },
    #[error("{}: {what}; the file is damaged or was edited: make the capture anew", .file.display())]
    BadNote { file: PathBuf, what: String },
    #[error("{} was written by a newer version of arborcam ({what}); use that version", .file.display())]
    Newer { file: PathBuf, what: String },
    #[error("{}, line {line}: {what}; the file is damaged or was edited: make the capture anew", .file.display())]
    BadRow {
        file: PathBuf,
        line: u64,
        what: String,
    },
    /// A capture that is sound, of a film in which no tree was built.
    #[error("{} holds tracks but no tree; film for longer or in more wind, and make the capture anew", .dir.display())]
    NoTree { dir: PathBuf },
    /// A tree without the film that a command needs.
    #[error("{} lacks {file}: it holds no film; give a capture with its film", .dir.display())]
    NoFilm { dir: PathBuf, file: &'static str },
    #[error("{} has no coloured markers in this part of its film; follow some with `replay --markers`", .dir.display())]
    NoMarkers { dir: PathBuf },
    #[error("{} has no marker {name}; its markers are in capture.json (config.markers.windows)", .dir.display())]
    UnknownMarker { dir: PathBuf, name: String },
    #[error(transparent)]
    Unwritten(#[from] WriteError),
    #[error("cannot read {}: {source}", .file.display())]
    Unreadable { file: PathBuf, source: io::Error },
}

impl DocumentError {
    /// What a path is at which there is no document, the file `note` of which every one has.
    pub(super) fn no_document(path: &Path, note: &str) -> Self {
        let dir = path.to_owned();
        if !path.exists() {
            return Self::NotThere { dir };
        }
        if path.is_file() {
            return Self::AFile { path: dir };
        }
        let inside = std::fs::read_dir(path).into_iter().flatten().flatten();
        let trees = inside
            .map(|entry| entry.path())
            .filter(|one| one.join(note).is_file());
        match trees.min() {
            Some(one) => Self::SeveralTrees { dir, one },
            None => Self::NotACapture { dir },
        }
    }

    pub(super) fn note(file: &Path, what: impl Into<String>) -> Self {
        Self::BadNote {
            file: file.to_owned(),
            what: what.into(),
        }
    }

    pub(super) fn row(file: &Path, line: u64, what: impl Into<String>) -> Self {
        Self::BadRow {
            file: file.to_owned(),
            line,
            what: what.into(),
        }
    }
}

//! Why something was not exported, by what the caller can do about it.

use crate::files::WriteError;

/// Each message is one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Or it is there without the encoder, as some builds are.
    #[error(
        "ffmpeg is not installed, or lacks libx264, and videos are written with it; run `sudo apt install ffmpeg`"
    )]
    NoFfmpeg,
    /// The page of `--format html` is put into the program when it is built, where npm is there.
    #[error(
        "this arborcam was built without the HTML viewer; install npm and run `make build`, or export another format"
    )]
    NoViewer,
    /// The model itself cannot be put into the format.
    #[error("cannot export this tree: {why}")]
    Unfit { why: String },
}

impl ExportError {
    /// The model has no form in the format.
    pub fn unfit(why: impl Into<String>) -> Self {
        Self::Unfit { why: why.into() }
    }
}

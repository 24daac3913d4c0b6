//! Why an outline was not taken.

use crate::model::Size;

/// Why an outline was not taken.
#[derive(Debug, thiserror::Error)]
pub enum OutlineError {
    #[error(
        "cannot read outline {name}: {source}; check the name, or leave --outline out to find the tree by its motion"
    )]
    Unreadable {
        name: String,
        source: std::io::Error,
    },
    #[error(
        "outline {name}: {what}; draw it on a frame of this clip, as a polygon (JSON) or a mask (PNG), or leave \
         --outline out"
    )]
    BadFile { name: String, what: String },
    #[error(
        "outline {name} is for {found}, the picture is {wanted}; draw it on a frame of this clip"
    )]
    WrongSize {
        name: String,
        found: Size,
        wanted: Size,
    },
    #[error("the outline is no usable polygon: {what}")]
    BadPolygon { what: String },
}

impl OutlineError {
    /// The file `name` holds no outline that can be used: `what` says why.
    pub(super) fn bad_file(name: &str, what: impl ToString) -> Self {
        Self::BadFile {
            name: name.to_owned(),
            what: what.to_string(),
        }
    }

    /// The corners are no outline: `what` says why.
    pub(super) fn bad_polygon(what: impl ToString) -> Self {
        Self::BadPolygon {
            what: what.to_string(),
        }
    }
}

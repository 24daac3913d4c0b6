//! Why a tree could not be prepared or written.

use crate::document::DocumentError;
use crate::export::ExportError;
use crate::files::WriteError;
use crate::grow::{GrowError, PlantingError};
use crate::pipeline::MOST_RESHAPED;
use crate::shape::TopiaryError;
use std::path::PathBuf;

/// Each message is one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    #[error(transparent)]
    Document(#[from] DocumentError),
    #[error(transparent)]
    Export(#[from] ExportError),
    #[error("{} holds no outline, which a new shape is made from", .dir.display())]
    NoOutline { dir: PathBuf },
    #[error(
        "another shape would have {nodes} nodes, and at most {MOST_RESHAPED} can be given one; take fewer --planes, \
         or leave all options of the shape out"
    )]
    TooManyNodes { nodes: usize },
    #[error("there is nothing to be drawn of this tree")]
    NothingToDraw,
    #[error("there is no pose at {at_s} s: the film is {last_s:.1} s long; give less with --at")]
    NoPose { at_s: f64, last_s: f64 },
    /// No new tree can be grown from an example.
    #[error(transparent)]
    Grow(#[from] GrowError),
    #[error(
        "no angle between branches has a density of {threshold} per rad: the highest is {highest:.3}; give less \
         --threshold"
    )]
    NotDense { threshold: f64, highest: f64 },
    #[error(
        "the film of {} shows no motion that could be learned; give --motion wind or none", .dir.display()
    )]
    NoSway { dir: PathBuf },
    /// A forest has no room, or its plot is too large.
    #[error(transparent)]
    Planting(#[from] PlantingError),
    /// The drawn shape is none for this tree.
    #[error(transparent)]
    Shape(#[from] TopiaryError),
}

impl From<WriteError> for PrepareError {
    fn from(e: WriteError) -> Self {
        Self::Export(e.into())
    }
}

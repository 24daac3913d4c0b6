//! Why a file gives no tree.

const NO_SKELETON: &str = "give a glTF with joints or nodes in a tree, an OBJ with lines, a PLY with \
                           edges, a table of cylinders, or a treefile";

/// Each message is one line that says what to do. The name of the file is put before it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImportError {
    /// It is not of the format that it seems to be, or is damaged.
    #[error("{what}; the file is damaged or of another format: export it anew")]
    BadFormat { what: String },
    /// It uses something of its format that is not read.
    #[error("{what}; {instead}")]
    Unsupported { what: String, instead: String },
    /// Its bytes cannot be read.
    #[error("it cannot be read: {why}; give another file")]
    Unreadable { why: String },
    #[error("it holds no strokes; draw trunk, branches or a crown as lines or paths")]
    NoStrokes,
    #[error("its line is open, as one along a branch is; draw a closed line round the crown")]
    OpenCrown,
    #[error("it holds no crown; draw one closed line round it, and mark it `crown`")]
    NoCrown,
    #[error("{what}: {why}; correct it")]
    BadStroke { what: String, why: String },
    #[error("its picture is {width}x{height} px, and must have 64 to 12288 px a side; scale it")]
    BadSize { width: f64, height: f64 },
    #[error("{first} and {second} are both marked as the trunk; mark one stroke")]
    TwoTrunks { first: String, second: String },
    /// A stroke that begins nowhere.
    #[error(
        "{stroke} meets no other stroke: it is {off_px:.0} px off the nearest, and {reach_px:.0} px are allowed; draw \
         it from the branch that carries it"
    )]
    Apart {
        stroke: String,
        off_px: f64,
        reach_px: f64,
    },
    #[error("it holds no skeleton; {}", NO_SKELETON)]
    NoSkeleton,
    #[error(
        "its skeleton goes round in a circle; open it, so that each branch is joined to one other"
    )]
    Cyclic,
    #[error(
        "its skeleton is in pieces: {joined} of {all} places are joined to the foot; join them, or leave one tree in it"
    )]
    InPieces { joined: usize, all: usize },
    #[error(
        "its skeleton has no height: nothing of it is above the foot; turn it so that it stands upright"
    )]
    NoHeight,
    #[error("pieces of it have no radius; give a table with all radii")]
    NoRadius,
    #[error(
        "a piece of it has a radius of {thickest:.3}, and all of it is {height:.3} high; give radii in the unit of the \
         places"
    )]
    TooThick { thickest: f64, height: f64 },
    #[error("it has {found} {what}, and at most {most} are read; simplify it")]
    TooMany {
        found: usize,
        what: &'static str,
        most: usize,
    },
}

impl ImportError {
    /// The file is damaged or of another format: `what` says why.
    pub(super) fn bad_format(what: impl ToString) -> Self {
        Self::BadFormat {
            what: what.to_string().replace('\n', " "),
        }
    }

    /// Its bytes cannot be read; one that ends too early, or names a place that no file has, is damaged.
    pub(super) fn unreadable(e: &std::io::Error) -> Self {
        match e.kind() {
            std::io::ErrorKind::UnexpectedEof => Self::bad_format("it is cut off"),
            std::io::ErrorKind::InvalidInput => {
                Self::bad_format("its header names a place that is not in it")
            }
            _ => Self::Unreadable { why: e.to_string() },
        }
    }

    /// `what` is not read; `instead` says what to do.
    pub(super) fn unsupported(what: impl Into<String>, instead: &str) -> Self {
        Self::Unsupported {
            what: what.into(),
            instead: instead.to_owned(),
        }
    }
}

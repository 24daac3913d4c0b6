//! Why markers cannot be followed, and what becomes of them on the way.

use crate::model::Size;
use std::fmt;

/// Why a marker, or all of them, cannot be followed from the first frame on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MarkerError {
    #[error(
        "the window of marker {name} lies off the picture, which is {size}; give it where the marker \
         is in the first frame"
    )]
    OffPicture { name: String, size: Size },
    #[error(
        "marker {name} has no colour in its window: it is grey or too dark there; move its window, or \
         lower markers.least_saturation or markers.least_value"
    )]
    Grey { name: String },
    #[error(
        "the windows of markers {first} and {second} show the same blob; give each marker a window of \
         its own"
    )]
    SameBlob { first: String, second: String },
    #[error(
        "no blob of hue {hue_deg:.0} degrees is in the first frame; set markers.hue_deg to the colour \
         of the markers, or give their windows (--markers FILE)"
    )]
    NoneFound { hue_deg: f64 },
    #[error("the place of marker {name} in frame {frame} lies off the picture, which is {size}")]
    CorrectionOffPicture {
        name: String,
        frame: u64,
        size: Size,
    },
    #[error("the film is grey: markers can be followed in colour only")]
    NoColour,
    #[error("OpenCV could not look for markers: {what}")]
    OpenCv { what: String },
}

impl From<opencv::Error> for MarkerError {
    fn from(e: opencv::Error) -> Self {
        Self::OpenCv { what: e.message }
    }
}

/// What became of a marker.
#[derive(Clone, Debug, PartialEq)]
pub enum MarkerEvent {
    Hidden {
        name: String,
        time_s: f64,
    },
    FoundAgain {
        name: String,
        time_s: f64,
        hidden_s: f64,
    },
    /// It was last seen at the edge.
    LeftPicture {
        name: String,
        time_s: f64,
    },
    /// It was not found again until the end of the film.
    Lost {
        name: String,
        time_s: f64,
    },
    /// No frame that was looked at was the one of a correction.
    CorrectionUnused {
        name: String,
        frame: u64,
    },
    /// What the user says hangs on what, each on the one before.
    Hung {
        names: Vec<String>,
    },
    /// What he says cannot be: why.
    NotHung {
        why: String,
    },
    /// One that was picked in the picture is not followed.
    NotTaken {
        why: MarkerError,
    },
}

impl MarkerEvent {
    /// Whether the user should know it before trusting the result.
    pub fn is_warning(&self) -> bool {
        !matches!(
            self,
            Self::Hidden { .. } | Self::FoundAgain { .. } | Self::Hung { .. }
        )
    }
}

impl fmt::Display for MarkerEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Hidden { name, time_s } => write!(f, "marker {name} is hidden at {time_s:.1} s"),
            Self::FoundAgain {
                name,
                time_s,
                hidden_s,
            } => {
                write!(
                    f,
                    "marker {name} is found again at {time_s:.1} s, after {hidden_s:.1} s"
                )
            }
            Self::LeftPicture { name, time_s } => write!(
                f,
                "marker {name} leaves the picture at {time_s:.1} s; it is looked for at that edge"
            ),
            Self::Lost { name, time_s } => write!(
                f,
                "marker {name} is not found again after {time_s:.1} s; give its place in a later frame \
                 (corrections in the file of --markers)"
            ),
            Self::CorrectionUnused { name, frame } => write!(
                f,
                "the correction of marker {name} in frame {frame} changes nothing: no frame with that number was \
                 followed after the first; give one of the frames in tracks.csv"
            ),
            Self::Hung { names } => {
                write!(f, "markers from the foot on: {}", names.join(", "))
            }
            Self::NotHung { why } => write!(f, "markers do not hang on each other so: {why}"),
            Self::NotTaken { why } => write!(f, "{why}"),
        }
    }
}

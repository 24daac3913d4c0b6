//! What is kept: the track log of a capture ([`TrackFile`]), and recordings of what the camera
//! delivered (MCAP).
//!
//! A recording is written by [`Series`], which makes one file after another where a limit is set,
//! and read by [`Reader`], as bags of ROS 1 are. `docs/recordings.md` says what is in the files.

mod bag;
mod channel;
mod contents;
mod cursor;
mod disk;
mod error;
mod foreign;
mod image;
mod pairing;
mod reader;
mod records;
mod ros;
mod scene;
mod schema;
mod series;
mod track_file;
mod transforms;
mod walk;
mod wire;
mod writer;

pub use contents::About;
pub use disk::SpaceReserve;
pub use error::RecordingError;
pub use image::{Encoding, Picture};
pub use pairing::{AwaitsDepth, Pairing};
pub use reader::Reader;
pub use series::{Head, Limits, Series};
pub use track_file::{Sets, TrackFile, TrackFileReader};

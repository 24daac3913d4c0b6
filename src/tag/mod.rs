//! A printed square tag beside the trunk (AprilTag, family 36h11): how large a pixel is at the tree, which
//! way is up, and whether the camera moves.
//!
//! Dark pieces by a local threshold, quadrilaterals around them, edges to parts of a pixel, and the code of
//! 6x6 cells (Wang and Olson 2016, "AprilTag 2: Efficient and robust fiducial detection").

mod camera;
mod codes;
mod decode;
mod homography;
mod pose;
mod quads;
mod scale;
mod threshold;

pub use camera::TagCamera;
pub use decode::{Tag, find_tags};
pub use scale::{TagSeen, scale_of};

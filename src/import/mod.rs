//! Trees that were not filmed, from the files of other programs: sketches and modelled trees.
//!
//! A sketch ([`read_sketch`]) is a set of strokes. Where they meet they are joined to a flat tree
//! ([`joined`]), which is stood up in space as a captured one is (Li 2011 sect. 6 and fig. 9).
//!
//! The branches that a photograph shows are such strokes, too ([`traced`]); [`read_strokes`] reads the
//! lines that a user draws round a crown and along branches.
//!
//! [`read_cloud`] reads the points of a scan.
//!
//! A modelled tree ([`read_model`]) is the skeleton of a glTF file with its motion, or the lines of
//! an OBJ, PLY, treefile or table of cylinders. Its forks and tips are the example ([`StandingModel`]).

mod cloud;
mod cylinders;
mod error;
mod flat_tree;
mod gltf_file;
mod gltf_motion;
mod gltf_skeleton;
mod join;
mod lens_profile;
mod model_file;
mod model_tree;
mod obj;
mod ply;
mod ply_rows;
mod segments;
mod sketch;
mod sketch_json;
mod standing;
mod svg;
mod svg_path;
mod svg_place;
mod traced;
mod treefile;
mod wood_table;

pub use cloud::{CloudFormat, CloudRead, TooFewSaid, Units, read_cloud};
pub use error::ImportError;
pub use flat_tree::{FlatTree, cover_px};
pub use gltf_skeleton::MovingModel;
pub use join::joined;
pub use lens_profile::read_lens_profile;
pub use model_file::{is_wood_table, read_model};
pub use model_tree::{ModelNode, ModelTree, TALL_M, Wood};
pub use sketch::{Sketch, Stroke, read_sketch, read_strokes};
pub use standing::StandingModel;
pub use traced::traced;

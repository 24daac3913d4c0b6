//! Files for other programs. What goes into a file is made as pure bytes or over any writer; only
//! [`OutputFolder`] and [`files`] touch the disk.

mod appear;
pub mod capture;
pub mod csv;
pub mod cylinders;
mod error;
mod file;
mod film;
pub mod folder;
mod followed;
pub mod glb_notes;
pub mod gltf;
mod gltf_animation;
mod gltf_buffer;
mod gltf_check;
mod gltf_look;
mod gltf_mesh;
pub mod html;
mod html_data;
mod joints;
mod number;
pub mod picture;
mod planned_keys;
mod renewed;
mod replace;
mod skinning;
mod sparse_keys;
pub mod still;
pub mod sway;
mod template;
mod template_bytes;
mod thin_keys;
mod tracks;

pub use appear::refuse_taken;
pub use error::ExportError;
pub use file::{OutputFile, write_files};
pub use film::Film;
pub use folder::OutputFolder;
pub use renewed::renewed;
pub use replace::replace;
pub use template::{TemplateError, read_template};
pub use tracks::tracks_of;

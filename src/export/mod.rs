//! Views of a tree for other programs, as pure bytes; only [`Film`] writes to the disk itself.

pub mod cylinders;
mod error;
mod film;
mod followed;
pub mod forest;
mod forest_meshes;
pub mod gltf;
mod gltf_animation;
mod gltf_buffer;
mod gltf_check;
mod gltf_look;
mod gltf_mesh;
mod gltf_model;
pub mod html;
mod html_data;
mod joints;
pub mod lens_profile;
mod motion_modes;
pub mod picture;
pub mod qsm;
mod skinning;
pub mod still;
pub mod sway;
mod template;
mod template_bytes;
mod template_error;
mod thin_keys;

pub use error::ExportError;
pub use film::Film;
pub use template::read_template;
pub use template_error::TemplateError;

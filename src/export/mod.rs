//! Files for other programs. What goes into a file is made as pure bytes or over any writer; [`OutputFolder`] alone
//! touches the disk.

pub mod capture;
pub mod csv;
mod error;
pub mod folder;
pub mod gltf;
mod gltf_buffer;
mod gltf_mesh;
mod joints;
mod number;
mod template;
mod thin_keys;

pub use error::ExportError;
pub use folder::OutputFolder;
pub use template::{TemplateError, read_template};

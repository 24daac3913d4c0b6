//! Files for other programs. What goes into a file is made as pure bytes or over any writer; [`OutputFolder`] alone
//! touches the disk.

pub mod capture;
pub mod csv;
mod error;
mod file;
mod film;
pub mod folder;
pub mod glb_notes;
pub mod gltf;
mod gltf_buffer;
mod gltf_mesh;
pub mod html;
mod html_data;
mod joints;
mod number;
pub mod picture;
mod thin_keys;

pub use error::ExportError;
pub use file::OutputFile;
pub use film::Film;
pub use folder::OutputFolder;

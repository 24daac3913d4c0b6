//! Files and folders on the disk: what appears only when it is complete, and what is replaced at
//! once.

mod bounded;
mod error;
mod file;
mod folder;
mod name;
mod place;
mod replace;
mod table_fault;
mod text;

pub use bounded::{LARGEST_NOTE, read_bounded};
pub use error::WriteError;
pub use file::{OutputFile, write_files};
pub use folder::{OutputFolder, write_folder};
pub use name::is_named_film;
pub use place::check_place;
pub use replace::replace;
pub use table_fault::TableFault;
pub use text::without_byte_order_mark;

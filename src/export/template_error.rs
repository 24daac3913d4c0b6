//! Why a file is no leaf template.

use crate::geometry::TemplateFault;
use std::path::PathBuf;

/// Larger files are refused, and so are larger files that they refer to, bytes.
pub(super) const LARGEST: u64 = 16 << 20;

/// Why a file is no leaf template; each message is one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum TemplateError {
    #[error("cannot read leaf template {}: {source}; check the name", .path.display())]
    Unreadable {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error(
        "leaf template {} is too large: at most {LARGEST} bytes are taken of a file, and three \
         times that in all; make its texture smaller",
        .path.display()
    )]
    TooLarge { path: PathBuf },
    #[error(
        "leaf template {} is no glTF 2.0 file that can be used: {what}; export it as GLB with its \
         texture inside",
        .path.display()
    )]
    NoGltf { path: PathBuf, what: String },
    #[error("leaf template {} has no mesh of triangles; export a leaf or a small cluster of leaves", .path.display())]
    NoMesh { path: PathBuf },
    #[error("leaf template {} cannot be used: {fault}; export a leaf or a small cluster of leaves", .path.display())]
    Unfit { path: PathBuf, fault: TemplateFault },
}

//! What `arborcam analyze` writes to files.

use crate::files::{WriteError, write_files};
use crate::model::{Skeleton, Swaying};
use crate::report::Study;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// The results for the tables, by node index: those of the analysis with the amplitudes of the
/// printed table.
pub fn with_amplitudes(skeleton: &Skeleton, analysed: Vec<Swaying>, study: &Study) -> Vec<Swaying> {
    let mut sway = analysed;
    for (node, sway) in skeleton.nodes.iter().zip(&mut sway) {
        let branch = study.branches.iter().find(|b| b.name == node.name.0);
        if let (Ok(sway), Some(branch)) = (sway, branch) {
            sway.amplitude_deg = branch.amplitude_deg;
        }
    }
    sway
}

/// Writes a new file.
///
/// # Errors
/// It cannot be written, or writing was stopped; no file is left then.
pub fn write_file(path: &Path, bytes: Vec<u8>, stop: &AtomicBool) -> Result<(), WriteError> {
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let folder = path.parent().unwrap_or(Path::new(""));
    write_files(folder, &[(name, bytes)], stop)
}

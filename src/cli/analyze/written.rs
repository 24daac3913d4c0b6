//! What `arborcam analyze` leaves in files.

use crate::files::{WriteError, write_files};
use crate::model::{Skeleton, Swaying};
use crate::report::Study;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// The answers for the document, by node index: the amplitudes are those of the printed table.
pub fn answers(skeleton: &Skeleton, analysed: Vec<Swaying>, study: &Study) -> Vec<Swaying> {
    let mut sway = analysed;
    for (node, sway) in skeleton.nodes.iter().zip(&mut sway) {
        let branch = study.branches.iter().find(|b| b.name == node.name.0);
        if let (Ok(sway), Some(branch)) = (sway, branch) {
            sway.amplitude_deg = branch.amplitude_deg;
        }
    }
    sway
}

/// The report as a new file.
///
/// # Errors
/// It cannot be written, or was stopped; there is then none.
pub fn put_beside(path: &Path, html: String, stop: &AtomicBool) -> Result<(), WriteError> {
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let folder = path.parent().unwrap_or(Path::new(""));
    write_files(folder, &[(name, html.into_bytes())], stop)
}

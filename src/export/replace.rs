//! A file that takes the place of another one at once.

use super::ExportError;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Writes the file beside the one at `path` and gives it that name when it is complete, with the
/// permissions of the one that was there: whoever reads it has the old bytes or the new ones. A
/// link stays a link.
///
/// # Errors
/// It may not be written there, the disk is full, or it was stopped; the old file is then as it
/// was.
pub fn replace(path: &Path, bytes: &[u8], stop: &AtomicBool) -> Result<(), ExportError> {
    let explain = |e| ExportError::from_io(path.display().to_string(), bytes.len() as u64, e);
    let path = &fs::canonicalize(path).map_err(explain)?;
    let rights = fs::metadata(path).map_err(explain)?.permissions();
    // To a name beside it a read-only file could be replaced all the same, which nobody wants who
    // made it so.
    File::options().write(true).open(path).map_err(explain)?;
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let partial = path.with_file_name(format!(".{name}.partial-{}", std::process::id()));
    let write = || -> io::Result<bool> {
        let mut file = File::create(&partial)?;
        file.write_all(bytes)?;
        file.set_permissions(rights)?;
        file.sync_all()?;
        if stop.load(Ordering::SeqCst) {
            return Ok(false);
        }
        fs::rename(&partial, path)?;
        // The rename is on the disk once the folder is; some file systems cannot sync folders.
        let _ = path
            .parent()
            .map(|folder| File::open(folder).and_then(|f| f.sync_all()));
        Ok(true)
    };
    let written = write();
    if !matches!(written, Ok(true)) {
        // Nobody is left who could act on a failure here.
        let _ = fs::remove_file(&partial);
    }
    match written {
        Ok(true) => Ok(()),
        Ok(false) => Err(ExportError::Stopped),
        Err(e) => Err(explain(e)),
    }
}

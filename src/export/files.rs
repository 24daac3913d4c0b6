//! Files that appear only when all of them are whole.

use super::ExportError;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Writes files beside each other into `dir`, under hidden names first. The last one is what the others belong to, and
/// appears last. Nothing is overwritten, and nothing is left behind if it fails.
///
/// # Errors
/// One of the names is taken, there is no such folder, it may not be written, or the disk is full.
pub fn write_files(dir: &Path, files: &[(String, Vec<u8>)]) -> Result<(), ExportError> {
    let dir = if dir.as_os_str().is_empty() { Path::new(".") } else { dir };
    refuse_taken(dir, files.iter().map(|(name, _)| name.as_str()))?;
    let mut partial = Partial(Vec::new());
    let total: u64 = files.iter().map(|(_, bytes)| bytes.len() as u64).sum();
    for (name, bytes) in files {
        let path = dir.join(format!(".{name}.partial-{}", std::process::id()));
        let explain = |e: io::Error| match e.kind() {
            io::ErrorKind::NotFound => ExportError::NoFolder { path: dir.to_owned() },
            _ => ExportError::from_io(dir.join(name).display().to_string(), total, e),
        };
        let mut file = File::create(&path).map_err(explain)?;
        partial.0.push((path, None));
        // Some file systems find out only now that there is no space.
        file.write_all(bytes).and_then(|()| file.sync_all()).map_err(explain)?;
    }
    // Taken meanwhile: a rename would replace it.
    refuse_taken(dir, files.iter().map(|(name, _)| name.as_str()))?;
    for (place, (name, _)) in partial.0.iter_mut().zip(files) {
        let to = dir.join(name);
        fs::rename(&place.0, &to).map_err(|e| ExportError::from_io(to.display().to_string(), total, e))?;
        place.1 = Some(to);
    }
    partial.0.clear();
    Ok(())
}

/// # Errors
/// There is something of one of these names in `dir`, be it a link that leads nowhere.
pub fn refuse_taken<'a>(dir: &Path, names: impl Iterator<Item = &'a str>) -> Result<(), ExportError> {
    let taken = names.map(|name| dir.join(name)).find(|path| fs::symlink_metadata(path).is_ok());
    taken.map_or(Ok(()), |path| Err(ExportError::Exists { path }))
}

/// Files on their way to their names; those that are here when it is dropped go.
struct Partial(Vec<(PathBuf, Option<PathBuf>)>);

impl Drop for Partial {
    fn drop(&mut self) {
        for (hidden, named) in &self.0 {
            // Nobody is left who could act on a failure here.
            let _ = fs::remove_file(named.as_ref().unwrap_or(hidden));
        }
    }
}

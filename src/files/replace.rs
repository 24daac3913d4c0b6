//! A file that takes the place of another one at once.

use super::WriteError;
use std::fs::{self, File, Permissions};
use std::io::{self, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use tempfile::NamedTempFile;

/// Mode of a new file before the user's mask is taken off.
const NEW_FILE: u32 = 0o666;

/// Writes a fresh file beside `path` and renames it to `path` when it is complete: a reader has the
/// old bytes or the new ones. The fresh file has a random name, is made only where nothing has that
/// name, and has the permissions of any new file. A link at `path` is replaced, not followed: in a
/// folder from somebody else it may lead to any file of the user.
///
/// # Errors
/// The file at `path` is read-only or not there, it may not be written beside it, the disk is full,
/// or it was stopped; the old file is then as it was.
pub fn replace(path: &Path, bytes: &[u8], stop: &AtomicBool) -> Result<(), WriteError> {
    write(path, bytes, stop)
        .map_err(|e| WriteError::from_io(path.display().to_string(), bytes.len() as u64, e))?
        .then_some(())
        .ok_or(WriteError::Stopped)
}

/// Whether it was written; not if it was stopped.
fn write(path: &Path, bytes: &[u8], stop: &AtomicBool) -> io::Result<bool> {
    let old = fs::symlink_metadata(path)?;
    // A rename could replace a read-only file, against the will of the user who made it so.
    if old.is_file() && old.permissions().readonly() {
        return Err(io::ErrorKind::PermissionDenied.into());
    }
    let folder = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let mut file: NamedTempFile = tempfile::Builder::new()
        .prefix(".arborcam-")
        .permissions(Permissions::from_mode(NEW_FILE))
        .tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    if stop.load(Ordering::SeqCst) {
        return Ok(false);
    }
    file.persist(path).map_err(|e| e.error)?;
    // The rename is on the disk once the folder is; some file systems cannot sync folders.
    let _ = File::open(folder).and_then(|f| f.sync_all());
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    static GO_ON: AtomicBool = AtomicBool::new(false);

    #[test]
    fn what_a_link_leads_to_stays_as_it_was() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::write(at("mine"), "mine").unwrap();
        std::os::unix::fs::symlink(at("mine"), at("table")).unwrap();
        replace(&at("table"), b"new", &GO_ON).unwrap();
        assert_eq!(fs::read(at("mine")).unwrap(), b"mine");
        assert!(fs::symlink_metadata(at("table")).unwrap().is_file());
        assert_eq!(fs::read(at("table")).unwrap(), b"new");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 2);
    }

    #[test]
    fn a_replaced_file_has_the_permissions_of_a_fresh_one() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let mode = |name: &str| fs::metadata(at(name)).unwrap().permissions().mode();
        fs::write(at("old"), "old").unwrap();
        fs::set_permissions(at("old"), Permissions::from_mode(0o4777)).unwrap();
        replace(&at("old"), b"new", &GO_ON).unwrap();
        fs::write(at("fresh"), "").unwrap();
        assert_eq!(mode("old"), mode("fresh"));
    }

    #[test]
    fn a_file_that_is_stopped_or_read_only_stays() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("table");
        fs::write(&path, "old").unwrap();
        let stopped = replace(&path, b"new", &AtomicBool::new(true));
        assert!(matches!(stopped, Err(WriteError::Stopped)));
        fs::set_permissions(&path, Permissions::from_mode(0o444)).unwrap();
        let denied = replace(&path, b"new", &GO_ON);
        assert!(matches!(denied, Err(WriteError::Denied { .. })));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}

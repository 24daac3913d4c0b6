//! Things that appear under their name only when they are complete: what files and folders have in
//! common.

use super::WriteError;
use std::ffi::CString;
use std::fs::{self, File};
use std::io;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

/// A place that is not taken. Until it appears, the thing lies hidden beside it as
/// `.NAME.partial-PID`, so that appearing is one rename on one file system. Dropped before
/// [`Place::keep`], it leaves nothing behind.
#[derive(Debug)]
pub(super) struct Place {
    path: PathBuf,
    /// Where it lies now; empty before there is anything.
    at: PathBuf,
    /// Folders above `path` that were made for it, the highest first.
    made: Vec<PathBuf>,
    remove: fn(&Path) -> io::Result<()>,
    kept: bool,
}

impl Place {
    /// Makes the thing hidden, by `make`, which must fail where there is something already, and the
    /// folders above it where they are missing. `remove` takes it away again.
    ///
    /// # Errors
    /// `path` is taken or is no name, part of it is a file, or it may not be written there.
    pub fn prepare(
        path: &Path,
        make: fn(&Path) -> io::Result<()>,
        remove: fn(&Path) -> io::Result<()>,
    ) -> Result<Self, WriteError> {
        refuse_taken(path)?;
        let name = path
            .file_name()
            .ok_or_else(|| no_name(path))?
            .to_string_lossy()
            .into_owned();
        let above = above(path);
        let missing = above
            .ancestors()
            .take_while(|a| !a.as_os_str().is_empty() && !a.exists());
        let mut made: Vec<PathBuf> = missing.map(Path::to_path_buf).collect();
        made.reverse();
        // From here on a failure must take away what was made, which is what dropping does.
        let mut place = Self {
            path: path.to_path_buf(),
            at: PathBuf::new(),
            made,
            remove,
            kept: false,
        };
        fs::create_dir_all(above).map_err(|e| match e.kind() {
            io::ErrorKind::AlreadyExists | io::ErrorKind::NotADirectory => no_name(path),
            _ => failed(path, e),
        })?;
        let pid = std::process::id();
        let mut partial = above.join(format!(".{name}.partial-{pid}"));
        // A name can be taken by a second export of this process, or by one that was killed.
        for attempt in 1..=100 {
            match make(&partial) {
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists && attempt < 100 => {
                    partial = above.join(format!(".{name}.partial-{pid}-{attempt}"));
                }
                Err(e) => return Err(failed(path, e)),
                Ok(()) => break,
            }
        }
        place.at = partial;
        Ok(place)
    }

    /// Where it is to appear.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where it lies now.
    pub fn at(&self) -> &Path {
        &self.at
    }

    /// Gives it its name; if it is dropped, it still goes.
    ///
    /// # Errors
    /// Something else has taken the name meanwhile, or it cannot be renamed.
    pub fn appear(&mut self) -> io::Result<()> {
        rename_new(&self.at, &self.path)?;
        self.at.clone_from(&self.path);
        // The rename itself is on the disk once the folder above is; some file systems cannot sync
        // folders.
        let _ = File::open(above(&self.path)).and_then(|f| f.sync_all());
        Ok(())
    }

    /// It stays.
    pub fn keep(&mut self) {
        self.kept = true;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        if self.kept {
            return;
        }
        // Nobody is left who could act on a failure here.
        if !self.at.as_os_str().is_empty() {
            let _ = (self.remove)(&self.at);
        }
        for folder in self.made.iter().rev() {
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Whether something can be written at `path`, to be known before any work is done for it.
///
/// # Errors
/// There is something: a file, a folder, or a link, be it one that leads nowhere. Or nothing may be
/// written in the folder above, or in the first one above that which is there.
pub fn check_place(path: &Path) -> Result<(), WriteError> {
    refuse_taken(path)?;
    let folder = above(path).ancestors().find(|folder| folder.is_dir());
    // Permissions alone do not tell: a file system may be read-only, or no place for files.
    match tempfile::tempfile_in(folder.unwrap_or(Path::new("."))) {
        Ok(_) => Ok(()),
        Err(e) => Err(failed(path, e)),
    }
}

fn refuse_taken(path: &Path) -> Result<(), WriteError> {
    // Not `exists()`: that is false for a link to nowhere.
    match fs::symlink_metadata(path) {
        Ok(_) => Err(WriteError::Exists {
            path: path.to_path_buf(),
        }),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(e) => Err(failed(path, e)),
    }
}

fn no_name(path: &Path) -> WriteError {
    WriteError::NotAFolder {
        path: path.to_path_buf(),
    }
}

fn failed(path: &Path, e: io::Error) -> WriteError {
    WriteError::from_io(path.display().to_string(), 0, e)
}

fn above(path: &Path) -> &Path {
    path.parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}

/// Renames without ever replacing what has taken the name meanwhile.
fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    let from_c = CString::new(from.as_os_str().as_bytes())?;
    let to_c = CString::new(to.as_os_str().as_bytes())?;
    let here = libc::AT_FDCWD;
    // SAFETY: both are strings that end with a zero, and outlive the call, which keeps neither.
    let done = unsafe {
        libc::renameat2(
            here,
            from_c.as_ptr(),
            here,
            to_c.as_ptr(),
            libc::RENAME_NOREPLACE,
        )
    };
    if done == 0 {
        return Ok(());
    }
    let e = io::Error::last_os_error();
    match e.raw_os_error() {
        // Not every file system can; there a moment remains in which another file would be
        // replaced.
        Some(libc::EINVAL | libc::ENOSYS) if fs::symlink_metadata(to).is_ok() => {
            Err(io::ErrorKind::AlreadyExists.into())
        }
        Some(libc::EINVAL | libc::ENOSYS) => fs::rename(from, to),
        _ => Err(e),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_where_nothing_can_be_written_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        assert!(check_place(&dir.path().join("new")).is_ok());
        assert!(check_place(&dir.path().join("not/there/yet")).is_ok());
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
        assert!(matches!(
            check_place(dir.path()),
            Err(WriteError::Exists { .. })
        ));
        assert!(check_place(Path::new("/proc/new")).is_err());
    }

    /// What another program has put there since the name was looked at must not be lost.
    #[test]
    fn what_has_taken_the_name_meanwhile_stays() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::write(at("mine"), "mine").unwrap();
        fs::write(at("theirs"), "theirs").unwrap();
        assert_eq!(
            rename_new(&at("mine"), &at("theirs")).unwrap_err().kind(),
            io::ErrorKind::AlreadyExists
        );
        assert_eq!(fs::read(at("theirs")).unwrap(), b"theirs");
        // An ordinary rename replaces an empty folder in silence.
        fs::create_dir(at("my folder")).unwrap();
        fs::create_dir(at("their folder")).unwrap();
        assert!(rename_new(&at("my folder"), &at("their folder")).is_err());
        rename_new(&at("mine"), &at("new")).unwrap();
        assert_eq!(fs::read(at("new")).unwrap(), b"mine");
    }
}

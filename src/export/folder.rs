//! A folder that appears only when it is complete.

use super::ExportError;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Files are gathered in a hidden folder `.NAME.partial-PID` beside the wanted one, so that publishing is one rename
/// on one file system. Dropped without [`OutputFolder::publish`], it leaves nothing behind.
#[derive(Debug)]
pub struct OutputFolder {
    dir: PathBuf,
    partial: PathBuf,
    /// Folders above `dir` that were made for it, the highest first; they go again if nothing is published.
    made: Vec<PathBuf>,
    published: bool,
}

impl OutputFolder {
    /// Prepares the folder `dir`, and those above it where they are missing.
    ///
    /// # Errors
    /// `dir` exists, be it as a file, a folder or a link; it cannot be a folder; it may not be written; the disk is
    /// full.
    pub fn create(dir: &Path) -> Result<Self, ExportError> {
        let not_a_folder = || ExportError::NotAFolder { path: dir.to_path_buf() };
        // Not `exists()`: that is false for a link to nowhere, which a rename would fail on much later.
        match fs::symlink_metadata(dir) {
            Ok(_) => return Err(ExportError::Exists { path: dir.to_path_buf() }),
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(e) => return Err(ExportError::from_io(dir.display().to_string(), 0, e)),
        }
        let name = dir.file_name().ok_or_else(not_a_folder)?.to_string_lossy().into_owned();
        let parent = match dir.parent() {
            Some(p) if !p.as_os_str().is_empty() => p.to_path_buf(),
            _ => PathBuf::from("."),
        };
        let mut made: Vec<PathBuf> = parent
            .ancestors()
            .take_while(|a| !a.as_os_str().is_empty() && !a.exists())
            .map(Path::to_path_buf)
            .collect();
        made.reverse();
        // From here on a failure must take away what was made, which is what dropping does.
        let mut folder = Self { dir: dir.to_path_buf(), partial: PathBuf::new(), made, published: false };
        fs::create_dir_all(&parent).map_err(|e| match e.kind() {
            io::ErrorKind::AlreadyExists | io::ErrorKind::NotADirectory => not_a_folder(),
            _ => ExportError::from_io(parent.display().to_string(), 0, e),
        })?;
        folder.partial = make_partial(&parent, &name)?;
        Ok(folder)
    }

    /// Where the file `name` is to be written until the folder is published.
    pub fn path(&self, name: &str) -> PathBuf {
        self.partial.join(name)
    }

    /// Opens a new file in the folder, for data that comes bit by bit.
    ///
    /// # Errors
    /// The file cannot be made.
    pub fn file(&self, name: &str) -> Result<io::BufWriter<File>, ExportError> {
        let file = File::create(self.path(name)).map_err(|e| self.explain(name, 0, e))?;
        Ok(io::BufWriter::with_capacity(1 << 16, file))
    }

    /// Writes a whole file into the folder.
    ///
    /// # Errors
    /// The file cannot be made or not be written to its end.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), ExportError> {
        let write = || File::create(self.path(name))?.write_all(bytes);
        write().map_err(|e| self.explain(name, bytes.len() as u64, e))
    }

    /// Copies a file into the folder under the same name.
    ///
    /// # Errors
    /// It cannot be read or not be written to its end.
    pub fn copy(&self, name: &str, from: &Path) -> Result<(), ExportError> {
        fs::copy(from.join(name), self.path(name)).map(drop).map_err(|e| self.explain(name, 0, e))
    }

    /// Puts everything on the disk and gives the folder its name, which it returns.
    ///
    /// # Errors
    /// The disk is full, or something else has taken the name meanwhile; then nothing is left of the folder.
    pub fn publish(mut self) -> Result<PathBuf, ExportError> {
        let entries = fs::read_dir(&self.partial).map_err(|e| self.explain("the folder", 0, e))?;
        for entry in entries {
            let entry = entry.map_err(|e| self.explain("the folder", 0, e))?;
            let name = entry.file_name().to_string_lossy().into_owned();
            // Some file systems find out only now that there is no space.
            File::open(entry.path()).and_then(|f| f.sync_all()).map_err(|e| self.explain(&name, 0, e))?;
        }
        // A rename would silently replace an empty folder of that name.
        if fs::symlink_metadata(&self.dir).is_ok() {
            return Err(ExportError::Exists { path: self.dir.clone() });
        }
        fs::rename(&self.partial, &self.dir).map_err(|e| match e.kind() {
            io::ErrorKind::AlreadyExists | io::ErrorKind::DirectoryNotEmpty | io::ErrorKind::NotADirectory => {
                ExportError::Exists { path: self.dir.clone() }
            }
            _ => self.explain("the folder", 0, e),
        })?;
        self.published = true;
        // The rename itself is on the disk once the folder above is; some file systems cannot sync folders.
        for folder in [Some(self.dir.as_path()), self.dir.parent().filter(|p| !p.as_os_str().is_empty())] {
            let _ = File::open(folder.unwrap_or(Path::new("."))).and_then(|f| f.sync_all());
        }
        Ok(self.dir.clone())
    }

    /// Adds what is written already, because all of it is what the disk must have room for.
    fn explain(&self, name: &str, bytes: u64, e: io::Error) -> ExportError {
        let others = fs::read_dir(&self.partial).into_iter().flatten().flatten();
        let written: u64 =
            others.filter(|f| f.file_name() != name).filter_map(|f| f.metadata().ok()).map(|m| m.len()).sum();
        ExportError::from_io(self.dir.join(name).display().to_string(), written + bytes, e)
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        if self.published {
            return;
        }
        // Nobody is left who could act on a failure here.
        if !self.partial.as_os_str().is_empty() {
            let _ = fs::remove_dir_all(&self.partial);
        }
        for folder in self.made.iter().rev() {
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Makes the hidden folder; a name can be taken by a second export of this process or by one that was killed.
fn make_partial(parent: &Path, name: &str) -> Result<PathBuf, ExportError> {
    let pid = std::process::id();
    let mut partial = parent.join(format!(".{name}.partial-{pid}"));
    for attempt in 1..=100 {
        match fs::create_dir(&partial) {
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists && attempt < 100 => {
                partial = parent.join(format!(".{name}.partial-{pid}-{attempt}"));
            }
            Err(e) => return Err(ExportError::from_io(parent.display().to_string(), 0, e)),
            Ok(()) => break,
        }
    }
    Ok(partial)
}

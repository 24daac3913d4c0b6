//! A single file that appears only when it is complete.

use super::ExportError;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Is written as a hidden file `.NAME.partial-PID` beside the wanted one, so that publishing is one rename on one file
/// system. Dropped without [`OutputFile::publish`], it leaves nothing behind.
#[derive(Debug)]
pub struct OutputFile {
    path: PathBuf,
    partial: PathBuf,
    /// Folders above `path` that were made for it, the highest first; they go again if nothing is published.
    made: Vec<PathBuf>,
    published: bool,
}

impl OutputFile {
    /// Prepares the file `path`, and the folders above it where they are missing.
    ///
    /// # Errors
    /// `path` exists, be it as a file, a folder or a link; it may not be written; the disk is full.
    pub fn create(path: &Path) -> Result<Self, ExportError> {
        let failed = |e: io::Error| ExportError::from_io(path.display().to_string(), 0, e);
        // Not `exists()`: that is false for a link to nowhere.
        match fs::symlink_metadata(path) {
            Ok(_) => return Err(ExportError::Exists { path: path.to_path_buf() }),
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(e) => return Err(failed(e)),
        }
        let no_name = || ExportError::NotAFolder { path: path.to_path_buf() };
        let name = path.file_name().ok_or_else(no_name)?.to_string_lossy().into_owned();
        let above = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let missing = above.ancestors().take_while(|a| !a.as_os_str().is_empty() && !a.exists());
        let mut made: Vec<PathBuf> = missing.map(Path::to_path_buf).collect();
        made.reverse();
        // From here on a failure must take away what was made, which is what dropping does.
        let mut file = Self { path: path.to_path_buf(), partial: PathBuf::new(), made, published: false };
        fs::create_dir_all(above).map_err(|e| match e.kind() {
            io::ErrorKind::AlreadyExists | io::ErrorKind::NotADirectory => no_name(),
            _ => failed(e),
        })?;
        let partial = above.join(format!(".{name}.partial-{}", std::process::id()));
        OpenOptions::new().write(true).create(true).truncate(true).open(&partial).map_err(failed)?;
        file.partial = partial;
        Ok(file)
    }

    /// Where the bytes are to be written until the file is published.
    pub fn partial(&self) -> &Path {
        &self.partial
    }

    /// Writes the whole file.
    ///
    /// # Errors
    /// It cannot be written to its end.
    pub fn write(&self, bytes: &[u8]) -> Result<(), ExportError> {
        let write = || File::create(&self.partial)?.write_all(bytes);
        write().map_err(|e| self.explain(bytes.len() as u64, e))
    }

    /// Puts everything on the disk and gives the file its name.
    ///
    /// # Errors
    /// The disk is full, or something else has taken the name meanwhile; then nothing is left of the file.
    pub fn publish(mut self) -> Result<(), ExportError> {
        // Some file systems find out only now that there is no space.
        File::open(&self.partial).and_then(|f| f.sync_all()).map_err(|e| self.explain(0, e))?;
        if fs::symlink_metadata(&self.path).is_ok() {
            return Err(ExportError::Exists { path: self.path.clone() });
        }
        fs::rename(&self.partial, &self.path).map_err(|e| self.explain(0, e))?;
        self.published = true;
        Ok(())
    }

    /// Sorts an error of writing; `bytes` is how much was to be written, 0 if only what lies there already is known.
    pub fn explain(&self, bytes: u64, e: io::Error) -> ExportError {
        let written = fs::metadata(&self.partial).map_or(0, |m| m.len());
        ExportError::from_io(self.path.display().to_string(), bytes.max(written), e)
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        if self.published {
            return;
        }
        // Nobody is left who could act on a failure here.
        if !self.partial.as_os_str().is_empty() {
            let _ = fs::remove_file(&self.partial);
        }
        for folder in self.made.iter().rev() {
            let _ = fs::remove_dir(folder);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn appears_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("new/picture.png");
        let file = OutputFile::create(&path).unwrap();
        file.write(b"abc").unwrap();
        assert!(!path.exists());
        drop(file);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
        let file = OutputFile::create(&path).unwrap();
        file.write(b"abc").unwrap();
        file.publish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"abc");
        assert!(matches!(OutputFile::create(&path), Err(ExportError::Exists { .. })));
        assert!(matches!(OutputFile::create(&path.join("below.png")), Err(ExportError::NotAFolder { .. })));
    }
}

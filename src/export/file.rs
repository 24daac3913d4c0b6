//! Files that appear only when they are complete.

use super::ExportError;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Is written as a hidden file `.NAME.partial-PID` beside the wanted one, so that publishing is one rename on one file
/// system. Dropped without [`OutputFile::publish`], it leaves nothing behind.
#[derive(Debug)]
pub struct OutputFile {
    path: PathBuf,
    /// Where the bytes lie now; empty before there are any.
    at: PathBuf,
    /// Folders above `path` that were made for it, the highest first; they go again if nothing is published.
    made: Vec<PathBuf>,
    published: bool,
}

/// Writes files beside each other into `dir`, which is made where it is missing. All of them appear or none.
///
/// # Errors
/// One of the names is taken; they may not be written; the disk is full.
pub fn write_files(dir: &Path, files: &[(String, Vec<u8>)]) -> Result<(), ExportError> {
    let mut prepared = Vec::with_capacity(files.len());
    let mut write = || {
        for (name, bytes) in files {
            let file = OutputFile::create(&dir.join(name))?;
            prepared.push(file);
            prepared.last().map_or(Ok(()), |file| file.write(bytes))?;
        }
        prepared.iter_mut().try_for_each(OutputFile::show)
    };
    let written = write();
    match written {
        Ok(()) => prepared.iter_mut().for_each(|file| file.published = true),
        // The first one has made the folder, and can take it away when the others have gone.
        Err(_) => while prepared.pop().is_some() {},
    }
    written
}

/// # Errors
/// There is something at `path`: a file, a folder, or a link, be it one that leads nowhere.
pub fn refuse_taken(path: &Path) -> Result<(), ExportError> {
    // Not `exists()`: that is false for a link to nowhere.
    match fs::symlink_metadata(path) {
        Ok(_) => Err(ExportError::Exists { path: path.to_path_buf() }),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(e) => Err(ExportError::from_io(path.display().to_string(), 0, e)),
    }
}

impl OutputFile {
    /// Prepares the file `path`, and the folders above it where they are missing.
    ///
    /// # Errors
    /// `path` exists, be it as a file, a folder or a link; it may not be written; the disk is full.
    pub fn create(path: &Path) -> Result<Self, ExportError> {
        refuse_taken(path)?;
        let failed = |e: io::Error| ExportError::from_io(path.display().to_string(), 0, e);
        let no_name = || ExportError::NotAFolder { path: path.to_path_buf() };
        let name = path.file_name().ok_or_else(no_name)?.to_string_lossy().into_owned();
        let above = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let missing = above.ancestors().take_while(|a| !a.as_os_str().is_empty() && !a.exists());
        let mut made: Vec<PathBuf> = missing.map(Path::to_path_buf).collect();
        made.reverse();
        // From here on a failure must take away what was made, which is what dropping does.
        let mut file = Self { path: path.to_path_buf(), at: PathBuf::new(), made, published: false };
        fs::create_dir_all(above).map_err(|e| match e.kind() {
            io::ErrorKind::AlreadyExists | io::ErrorKind::NotADirectory => no_name(),
            _ => failed(e),
        })?;
        let partial = above.join(format!(".{name}.partial-{}", std::process::id()));
        OpenOptions::new().write(true).create(true).truncate(true).open(&partial).map_err(failed)?;
        file.at = partial;
        Ok(file)
    }

    /// Where the bytes are to be written until the file is published.
    pub fn partial(&self) -> &Path {
        &self.at
    }

    /// Writes the whole file.
    ///
    /// # Errors
    /// It cannot be written to its end.
    pub fn write(&self, bytes: &[u8]) -> Result<(), ExportError> {
        let write = || File::create(&self.at)?.write_all(bytes);
        write().map_err(|e| self.explain(bytes.len() as u64, e))
    }

    /// Puts everything on the disk and gives the file its name.
    ///
    /// # Errors
    /// The disk is full, or something else has taken the name meanwhile; then nothing is left of the file.
    pub fn publish(mut self) -> Result<(), ExportError> {
        self.show()?;
        self.published = true;
        Ok(())
    }

    /// Under its name, and still to go if it is dropped.
    fn show(&mut self) -> Result<(), ExportError> {
        // Some file systems find out only now that there is no space.
        File::open(&self.at).and_then(|f| f.sync_all()).map_err(|e| self.explain(0, e))?;
        // Taken meanwhile: a rename would replace it.
        refuse_taken(&self.path)?;
        fs::rename(&self.at, &self.path).map_err(|e| self.explain(0, e))?;
        self.at.clone_from(&self.path);
        Ok(())
    }

    /// Sorts an error of writing; `bytes` is how much was to be written, 0 if only what lies there already is known.
    pub fn explain(&self, bytes: u64, e: io::Error) -> ExportError {
        let written = fs::metadata(&self.at).map_or(0, |m| m.len());
        ExportError::from_io(self.path.display().to_string(), bytes.max(written), e)
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        if self.published {
            return;
        }
        // Nobody is left who could act on a failure here.
        if !self.at.as_os_str().is_empty() {
            let _ = fs::remove_file(&self.at);
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

    #[test]
    fn of_files_that_belong_together_all_appear_or_none() {
        let dir = tempfile::tempdir().unwrap();
        let below = dir.path().join("new");
        let files = |second: &str| [("a.bin".to_owned(), vec![1]), (second.to_owned(), vec![2])];
        // The second name is no name of a file, so the first one and its folder must go again.
        assert!(write_files(&below, &files("..")).is_err());
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
        write_files(&below, &files("a.gltf")).unwrap();
        assert_eq!(fs::read(below.join("a.gltf")).unwrap(), [2]);
        fs::remove_file(below.join("a.bin")).unwrap();
        assert!(matches!(write_files(&below, &files("a.gltf")), Err(ExportError::Exists { .. })));
        assert_eq!(fs::read_dir(&below).unwrap().count(), 1);
    }
}

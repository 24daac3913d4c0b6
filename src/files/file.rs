//! Files that appear only when they are complete.

use super::WriteError;
use super::folder::write_pieces;
use super::place::Place;
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Is written hidden beside the wanted place. Dropped without [`OutputFile::publish`], it leaves
/// nothing behind.
#[derive(Debug)]
pub struct OutputFile(Place);

/// Writes files beside each other into `dir`, which is made where it is missing. All of them appear
/// or none: also where
/// `stop` is set meanwhile.
///
/// # Errors
/// One of the names is taken; they may not be written; the disk is full; it was stopped.
pub fn write_files(
    dir: &Path,
    files: &[(String, Vec<u8>)],
    stop: &AtomicBool,
) -> Result<(), WriteError> {
    let mut prepared = Vec::with_capacity(files.len());
    let written = show_files(dir, files, stop, &mut prepared);
    match written {
        Ok(()) => prepared.iter_mut().for_each(|file| file.0.keep()),
        // The first one has made the folder, and can take it away when the others have gone.
        Err(_) => while prepared.pop().is_some() {},
    }
    written
}

/// Writes them all before the first appears; `prepared` takes what was made.
fn show_files(
    dir: &Path,
    files: &[(String, Vec<u8>)],
    stop: &AtomicBool,
    prepared: &mut Vec<OutputFile>,
) -> Result<(), WriteError> {
    for (name, bytes) in files {
        let file = OutputFile::create(&dir.join(name))?;
        let written = file.write(bytes, stop);
        prepared.push(file);
        written?;
    }
    for file in prepared {
        file.show()?;
    }
    Ok(())
}

impl OutputFile {
    /// Prepares the file `path`, and the folders above it where they are missing.
    ///
    /// # Errors
    /// `path` exists, be it as a file, a folder or a link; it may not be written; the disk is full.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        Place::prepare(
            path,
            |p| File::create_new(p).map(drop),
            |p| fs::remove_file(p),
        )
        .map(Self)
    }

    /// Where the bytes are to be written until the file is published.
    pub fn partial(&self) -> &Path {
        self.0.at()
    }

    /// Writes the whole file, unless `stop` is set meanwhile.
    ///
    /// # Errors
    /// It cannot be written to its end, or was stopped.
    pub fn write(&self, bytes: &[u8], stop: &AtomicBool) -> Result<(), WriteError> {
        match self.write_pieces(bytes, stop) {
            Ok(true) => Ok(()),
            Ok(false) => Err(WriteError::Stopped),
            Err(e) => Err(self.explain(bytes.len() as u64, e)),
        }
    }

    /// `false` if `stop` was set before all was written.
    fn write_pieces(&self, bytes: &[u8], stop: &AtomicBool) -> io::Result<bool> {
        // What has taken its hidden name meanwhile is not followed.
        let mut file = File::options()
            .write(true)
            .truncate(true)
            .custom_flags(libc::O_NOFOLLOW)
            .open(self.0.at())?;
        write_pieces(&mut file, bytes, stop)
    }

    /// Puts everything on the disk and gives the file its name.
    ///
    /// # Errors
    /// The disk is full, or something else has taken the name meanwhile; then nothing is left of
    /// the file.
    pub fn publish(mut self) -> Result<(), WriteError> {
        self.show()?;
        self.0.keep();
        Ok(())
    }

    /// Under its name, and still to go if it is dropped.
    fn show(&mut self) -> Result<(), WriteError> {
        // Some file systems find out only now that there is no space.
        File::open(self.0.at())
            .and_then(|f| f.sync_all())
            .map_err(|e| self.explain(0, e))?;
        self.0.appear().map_err(|e| match e.kind() {
            io::ErrorKind::AlreadyExists => WriteError::Exists {
                path: self.0.path().to_path_buf(),
            },
            _ => self.explain(0, e),
        })
    }

    /// Sorts an error of writing; `bytes` is how much was to be written, 0 if only what lies there
    /// already is known.
    pub fn explain(&self, bytes: u64, e: io::Error) -> WriteError {
        let written = fs::metadata(self.0.at()).map_or(0, |m| m.len());
        WriteError::from_io(self.0.path().display().to_string(), bytes.max(written), e)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    static GO_ON: AtomicBool = AtomicBool::new(false);

    #[test]
    fn appears_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("new/picture.png");
        let file = OutputFile::create(&path).unwrap();
        file.write(b"abc", &GO_ON).unwrap();
        assert!(!path.exists());
        drop(file);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
        let file = OutputFile::create(&path).unwrap();
        file.write(b"abc", &GO_ON).unwrap();
        file.publish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"abc");
        assert!(matches!(
            OutputFile::create(&path),
            Err(WriteError::Exists { .. })
        ));
        assert!(matches!(
            OutputFile::create(&path.join("below.png")),
            Err(WriteError::NotAFolder { .. })
        ));
    }

    #[test]
    fn of_files_that_belong_together_all_appear_or_none() {
        let dir = tempfile::tempdir().unwrap();
        let below = dir.path().join("new");
        let files = |second: &str| [("a.bin".to_owned(), vec![1]), (second.to_owned(), vec![2])];
        // The second name is no name of a file, so the first one and its folder must go again.
        assert!(write_files(&below, &files(".."), &GO_ON).is_err());
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
        write_files(&below, &files("a.gltf"), &GO_ON).unwrap();
        assert_eq!(fs::read(below.join("a.gltf")).unwrap(), [2]);
        fs::remove_file(below.join("a.bin")).unwrap();
        assert!(matches!(
            write_files(&below, &files("a.gltf"), &GO_ON),
            Err(WriteError::Exists { .. })
        ));
        assert_eq!(fs::read_dir(&below).unwrap().count(), 1);
    }

    /// Ctrl-C while several files are written: none of them is left, nor what was made for them.
    #[test]
    fn what_is_stopped_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let files = [
            ("a.bin".to_owned(), vec![1]),
            ("a.gltf".to_owned(), vec![2]),
        ];
        let stopped = write_files(&dir.path().join("new"), &files, &AtomicBool::new(true));
        assert!(matches!(stopped, Err(WriteError::Stopped)));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}

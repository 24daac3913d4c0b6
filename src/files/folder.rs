//! A folder that appears only when it is complete.

use super::WriteError;
use super::place::Place;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Bytes that are copied between two looks at whether to go on.
const PIECE: u64 = 1 << 20;

/// Files are gathered in a hidden folder beside the wanted one. Dropped without
/// [`OutputFolder::publish`], it leaves nothing behind.
#[derive(Debug)]
pub struct OutputFolder(Place);

impl OutputFolder {
    /// Prepares the folder `dir`, and those above it where they are missing.
    ///
    /// # Errors
    /// `dir` exists, be it as a file, a folder or a link; it cannot be a folder; it may not be
    /// written; the disk is full.
    pub fn create(dir: &Path) -> Result<Self, WriteError> {
        Place::prepare(dir, |p| fs::create_dir(p), |p| fs::remove_dir_all(p)).map(Self)
    }

    /// Where the file `name` is to be written until the folder is published.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.at().join(name)
    }

    /// Opens a new file in the folder, for data that comes bit by bit.
    ///
    /// # Errors
    /// The file cannot be made.
    pub fn file(&self, name: &str) -> Result<io::BufWriter<File>, WriteError> {
        let file = File::create(self.path(name)).map_err(|e| self.explain(name, 0, e))?;
        Ok(io::BufWriter::with_capacity(1 << 16, file))
    }

    /// Writes a whole file into the folder.
    ///
    /// # Errors
    /// The file cannot be made or not be written to its end.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), WriteError> {
        let created = File::create(self.path(name));
        created
            .and_then(|mut file| file.write_all(bytes))
            .map_err(|e| self.explain(name, bytes.len() as u64, e))
    }

    /// Copies a file into the folder under the same name, unless `stop` is set meanwhile.
    ///
    /// # Errors
    /// It cannot be read or not be written to its end, or was stopped.
    pub fn copy(&self, name: &str, from: &Path, stop: &AtomicBool) -> Result<(), WriteError> {
        let mut to = self.file(name)?;
        let copied = File::open(from.join(name)).and_then(|from| copy(&from, &mut to, stop));
        match copied {
            Ok(true) => Ok(()),
            Ok(false) => Err(WriteError::Stopped),
            Err(e) => Err(self.explain(name, 0, e)),
        }
    }

    /// Puts everything on the disk and gives the folder its name, which it returns.
    ///
    /// # Errors
    /// The disk is full, or something else has taken the name meanwhile; then nothing is left of
    /// the folder.
    pub fn publish(mut self) -> Result<PathBuf, WriteError> {
        let entries = fs::read_dir(self.0.at()).map_err(|e| self.explain("the folder", 0, e))?;
        for entry in entries {
            let entry = entry.map_err(|e| self.explain("the folder", 0, e))?;
            let name = entry.file_name().to_string_lossy().into_owned();
            // Some file systems find out only now that there is no space.
            File::open(entry.path())
                .and_then(|f| f.sync_all())
                .map_err(|e| self.explain(&name, 0, e))?;
        }
        let dir = self.0.path().to_path_buf();
        self.0.appear().map_err(|e| match e.kind() {
            io::ErrorKind::AlreadyExists
            | io::ErrorKind::DirectoryNotEmpty
            | io::ErrorKind::NotADirectory => WriteError::Exists { path: dir.clone() },
            _ => self.explain("the folder", 0, e),
        })?;
        self.0.keep();
        let _ = File::open(&dir).and_then(|f| f.sync_all());
        Ok(dir)
    }

    /// Size of its files up to now, without `except`, bytes.
    fn bytes_without(&self, except: Option<&str>) -> u64 {
        let files = fs::read_dir(self.0.at()).into_iter().flatten().flatten();
        files
            .filter(|f| except.is_none_or(|name| f.file_name() != name))
            .filter_map(|f| f.metadata().ok())
            .map(|m| m.len())
            .sum()
    }

    /// Size of its files up to now, bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes_without(None)
    }

    /// Adds what is written already, because all of it is what the disk must have room for.
    pub fn explain(&self, name: &str, bytes: u64, e: io::Error) -> WriteError {
        let written = self.bytes_without(Some(name));
        WriteError::from_io(
            self.0.path().join(name).display().to_string(),
            written + bytes,
            e,
        )
    }
}

/// Copies a file to its end; `false` if `stop` was set before.
fn copy(from: &File, to: &mut impl Write, stop: &AtomicBool) -> io::Result<bool> {
    while !stop.load(Ordering::SeqCst) {
        if io::copy(&mut from.take(PIECE), to)? == 0 {
            to.flush()?;
            return Ok(true);
        }
    }
    Ok(false)
}

//! A folder that appears only when it is complete.

use super::WriteError;
use super::place::Place;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Bytes that are copied or written between two looks at whether to go on.
const PIECE: u64 = 1 << 20;

/// Writes a folder with these files, whose names may hold a folder in it. It appears when it is complete, or not
/// at all: also where `stop` is set meanwhile.
///
/// # Errors
/// `dir` is taken; it may not be written; the disk is full; it was stopped.
pub fn write_folder(
    dir: &Path,
    files: &[(String, Vec<u8>)],
    stop: &AtomicBool,
) -> Result<(), WriteError> {
    let folder = OutputFolder::create(dir)?;
    for (name, bytes) in files {
        folder.write_unless(name, bytes, stop)?;
    }
    folder.sync(stop)?;
    folder.appear()?;
    Ok(())
}

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

    /// Writes a whole file into the folder, and the folder in it that its name begins with, unless `stop` is
    /// set meanwhile.
    fn write_unless(&self, name: &str, bytes: &[u8], stop: &AtomicBool) -> Result<(), WriteError> {
        let path = self.path(name);
        let above = path.parent().unwrap_or(self.0.at());
        let written = fs::create_dir_all(above)
            .and_then(|()| File::create(&path))
            .and_then(|mut file| write_pieces(&mut file, bytes, stop));
        match written {
            Ok(true) => Ok(()),
            Ok(false) => Err(WriteError::Stopped),
            Err(e) => Err(self.explain(name, bytes.len() as u64, e)),
        }
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
    pub fn publish(self) -> Result<PathBuf, WriteError> {
        self.sync(&AtomicBool::new(false))?;
        self.appear()
    }

    /// Puts everything on the disk, unless `stop` is set meanwhile.
    fn sync(&self, stop: &AtomicBool) -> Result<(), WriteError> {
        let files = files_below(self.0.at()).map_err(|e| self.explain("the folder", 0, e))?;
        for file in &files {
            if stop.load(Ordering::SeqCst) {
                return Err(WriteError::Stopped);
            }
            // Some file systems find out only now that there is no space.
            let synced = File::open(file).and_then(|f| f.sync_all());
            synced.map_err(|e| self.explain(&self.name_of(file), 0, e))?;
        }
        let folders: BTreeSet<&Path> = files.iter().filter_map(|file| file.parent()).collect();
        for folder in folders {
            // Some file systems cannot sync folders.
            let _ = File::open(folder).and_then(|f| f.sync_all());
        }
        match stop.load(Ordering::SeqCst) {
            true => Err(WriteError::Stopped),
            false => Ok(()),
        }
    }

    /// Gives the folder its name, which it returns.
    fn appear(mut self) -> Result<PathBuf, WriteError> {
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
        let files = files_below(self.0.at()).unwrap_or_default();
        files
            .iter()
            .filter(|file| except.is_none_or(|name| self.name_of(file) != name))
            .filter_map(|file| fs::metadata(file).ok())
            .map(|m| m.len())
            .sum()
    }

    /// The name of a file in the folder.
    fn name_of(&self, file: &Path) -> String {
        let name = file.strip_prefix(self.0.at()).unwrap_or(file);
        name.to_string_lossy().into_owned()
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

/// All files in a folder and in those in it.
fn files_below(dir: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut folders = vec![dir.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            match entry.file_type()?.is_dir() {
                true => folders.push(entry.path()),
                false => files.push(entry.path()),
            }
        }
    }
    Ok(files)
}

/// Writes all bytes; `false` if `stop` was set before.
pub(super) fn write_pieces(file: &mut File, bytes: &[u8], stop: &AtomicBool) -> io::Result<bool> {
    for piece in bytes.chunks(PIECE as usize) {
        if stop.load(Ordering::SeqCst) {
            return Ok(false);
        }
        file.write_all(piece)?;
    }
    Ok(true)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Ctrl-C while a folder is written: nothing of it is left.
    #[test]
    fn a_folder_with_folders_appears_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("new/wood");
        let files = [
            ("tree-0001/nodes.csv".to_owned(), vec![1]),
            ("forest.csv".to_owned(), vec![2, 3]),
        ];
        let stopped = write_folder(&out, &files, &AtomicBool::new(true));
        assert!(matches!(stopped, Err(WriteError::Stopped)));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
        let go_on = AtomicBool::new(false);
        write_folder(&out, &files, &go_on).unwrap();
        for (name, bytes) in &files {
            assert_eq!(&fs::read(out.join(name)).unwrap(), bytes);
        }
        let again = write_folder(&out, &files, &go_on);
        assert!(matches!(again, Err(WriteError::Exists { .. })));
        let above = fs::read_dir(dir.path().join("new")).unwrap();
        assert_eq!(above.count(), 1);
    }
}

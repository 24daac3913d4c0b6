//! A file whose room is taken from the disk ahead of what is written to it, so that there is enough
//! left to close it properly when the disk is full.

use super::error::is_full;
use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::os::fd::AsRawFd;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Room is taken in steps of so many bytes.
const STEP: u64 = 16 << 20;

/// What the writer of the format writes to. It keeps its own place, so that it can be cut back from
/// outside.
pub(super) struct Disk {
    file: Arc<File>,
    at: u64,
    end: Arc<AtomicU64>,
}

/// The same file from outside.
pub(super) struct Room {
    file: Arc<File>,
    end: Arc<AtomicU64>,
    taken: u64,
    /// Not every file system can take room ahead; there, writing tells when it is over.
    can_take: bool,
}

/// Makes a new file.
///
/// # Errors
/// It is there already, or the file system says no.
pub(super) fn create(path: &Path) -> io::Result<(Disk, Room)> {
    let file = Arc::new(OpenOptions::new().write(true).create_new(true).open(path)?);
    let end = Arc::new(AtomicU64::new(0));
    let room = Room {
        file: file.clone(),
        end: end.clone(),
        taken: 0,
        can_take: true,
    };
    Ok((Disk { file, at: 0, end }, room))
}

/// Space on the disk that is held back by a file without contents.
pub struct SpaceReserve(Room);

impl SpaceReserve {
    /// Holds back at least `bytes` in the new file `path`.
    ///
    /// # Errors
    /// The disk has not so much, or the file cannot be made.
    pub fn create(path: &Path, bytes: u64) -> io::Result<Self> {
        let (_, mut room) = create(path)?;
        room.reserve(bytes)?;
        Ok(Self(room))
    }

    /// Holds back at least `bytes` in all.
    ///
    /// # Errors
    /// The disk has not so much.
    pub fn grow_to(&mut self, bytes: u64) -> io::Result<()> {
        self.0.reserve(bytes)
    }

    /// Gives the space back.
    pub fn release(&mut self) {
        self.0.can_take = false;
        // Where that fails, removing the file gives it back.
        let _ = self.0.cut(0);
    }
}

impl Room {
    /// Makes sure that the file can grow to `upto` bytes.
    ///
    /// # Errors
    /// It cannot: the disk is full.
    pub fn reserve(&mut self, upto: u64) -> io::Result<()> {
        if !self.can_take || upto <= self.taken {
            return Ok(());
        }
        // A step less than wanted is better than none.
        match self.take(upto + STEP).or_else(|_| self.take(upto)) {
            Ok(()) => Ok(()),
            Err(e) if is_full(&e) => Err(e),
            Err(_) => {
                self.can_take = false;
                Ok(())
            }
        }
    }

    fn take(&mut self, upto: u64) -> io::Result<()> {
        let (from, to) = (self.taken as libc::off_t, upto as libc::off_t);
        // SAFETY: the descriptor is open for as long as `file` is; the call takes no pointers.
        let failed = unsafe {
            libc::fallocate(
                self.file.as_raw_fd(),
                libc::FALLOC_FL_KEEP_SIZE,
                from,
                to - from,
            )
        } != 0;
        if failed {
            return Err(io::Error::last_os_error());
        }
        self.taken = upto;
        Ok(())
    }

    /// Bytes written so far.
    pub fn end(&self) -> u64 {
        self.end.load(Ordering::Relaxed)
    }

    /// Ends the file at `end` and gives back what was taken beyond.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn cut(&self, end: u64) -> io::Result<()> {
        self.file.set_len(end)
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write_at(bytes, self.at)?;
        self.at += written as u64;
        self.end.fetch_max(self.at, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Disk {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let place = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
            SeekFrom::End(by) => self.end.load(Ordering::Relaxed).checked_add_signed(by),
        };
        self.at = place.ok_or_else(|| io::Error::from(io::ErrorKind::InvalidInput))?;
        Ok(self.at)
    }
}

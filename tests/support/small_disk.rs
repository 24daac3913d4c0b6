//! A disk that is soon full.

use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// A file system of its own in a temporary folder; it goes when this is dropped.
pub struct SmallDisk(TempDir);

impl SmallDisk {
    /// Of this size, as `mount` takes it (`200k`). `None` where only root may mount one; the test then
    /// says why it skips.
    pub fn mount(size: &str) -> Option<Self> {
        let dir = tempfile::tempdir().expect("tempdir");
        let mount = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &format!("size={size}"), "arborcam"])
            .arg(dir.path())
            .output();
        if !mount.is_ok_and(|o| o.status.success()) {
            eprintln!("SKIPPED: full disk: a small disk can be mounted by root only");
            return None;
        }
        Some(Self(dir))
    }

    pub fn dir(&self) -> &Path {
        self.0.path()
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.dir().join(name)
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.0.path()).status();
    }
}

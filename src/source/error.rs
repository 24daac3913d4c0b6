//! Why a source gives no frames, in words that say what to do.

use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Each variant is something else that the caller can do about it; the text is one line for the
/// user.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// Nothing of this name: name something else, or plug it in.
    #[error("{input} is not there; {hint}")]
    Absent { input: String, hint: &'static str },
    /// Somebody else films with it: wait, or close the other program.
    #[error(
        "{input} is in use by {holder}; close that program (`fuser -v {input}` lists who holds the device)"
    )]
    Busy { input: String, holder: String },
    /// The user may not read it.
    #[error("no permission to read {input}; {remedy}")]
    Denied { input: String, remedy: String },
    /// It was there and is no more: wait for it to come back.
    #[error("{input} was disconnected ({reason}); check the cable and plug it in again")]
    Disconnected { input: String, reason: String },
    /// It is there but silent.
    #[error(
        "{input} has delivered no frame for {seconds} s; unplug it and plug it in again, \
         or raise camera.timeout_s if it is that slow"
    )]
    Timeout { input: String, seconds: f64 },
    /// It is something that cannot be read as frames.
    #[error("{input} cannot be used: {what}")]
    BadFormat { input: String, what: String },
    /// It is of the right kind and holds no frame.
    #[error("{input} is empty: {what}")]
    Empty { input: String, what: &'static str },
    /// A still picture: there is nothing to follow.
    #[error(
        "{input} has one frame only, and motion is seen from the second one on; film for at least 5 s"
    )]
    SingleFrame { input: String },
    /// A program that we need is not installed.
    #[error(
        "{tool} is not installed, and video files are read with it; run `sudo apt install ffmpeg`"
    )]
    MissingTool { tool: String },
}

impl SourceError {
    /// `path` cannot be read as frames; `what` says why, and what to do.
    pub(super) fn bad_format(path: &Path, what: impl Into<String>) -> Self {
        SourceError::BadFormat {
            input: path.display().to_string(),
            what: what.into(),
        }
    }

    /// What it means that the file, folder or device `path` could not be opened or read.
    pub(super) fn of_file(path: &Path, e: &std::io::Error) -> Self {
        let input = path.display().to_string();
        match e.raw_os_error() {
            Some(libc::ENOENT | libc::ENOTDIR) if path.starts_with("/dev") => SourceError::Absent {
                input,
                hint: "plug the camera in; `arborcam devices` lists those that are there",
            },
            Some(libc::ENOENT | libc::ENOTDIR) => SourceError::Absent {
                input,
                hint: "check the name, and the folder that you are in",
            },
            Some(libc::EACCES | libc::EPERM) => SourceError::Denied {
                input,
                remedy: remedy(path),
            },
            _ => SourceError::BadFormat {
                input,
                what: format!("reading it fails: {e}"),
            },
        }
    }

    /// The reason alone, for a caller that knows already which camera it is and waits for it.
    pub fn brief(&self) -> String {
        match self {
            SourceError::Timeout { seconds, .. } => format!("no frame for {seconds} s"),
            SourceError::Disconnected { reason, .. } => reason.clone(),
            SourceError::BadFormat { what, .. } => what.clone(),
            SourceError::Absent { .. } => "it is not there".to_owned(),
            other => other.to_string(),
        }
    }

    /// [`of_driver`](Self::of_driver) for a `map_err`.
    pub(super) fn refused(path: &Path, doing: &'static str) -> impl Fn(std::io::Error) -> Self {
        move |e| SourceError::of_driver(path, doing, &e)
    }

    /// What it means that the driver of `path` refused while we were `doing` something.
    pub(super) fn of_driver(path: &Path, doing: &str, e: &std::io::Error) -> Self {
        let input = path.display().to_string();
        match e.raw_os_error() {
            Some(libc::EBUSY) => {
                let holder = holder(path).unwrap_or_else(|| "another program".to_owned());
                SourceError::Busy { input, holder }
            }
            Some(libc::ENODEV | libc::ENXIO | libc::EIO) => SourceError::Disconnected {
                input,
                reason: format!("{doing}: {e}"),
            },
            Some(libc::ENOTTY) => SourceError::BadFormat {
                input,
                what: "it is no camera".to_owned(),
            },
            Some(libc::ENOENT | libc::EACCES | libc::EPERM) => SourceError::of_file(path, e),
            _ => SourceError::BadFormat {
                input,
                what: format!("{doing} fails: {e}"),
            },
        }
    }
}

/// How to come by the right to read `path`.
fn remedy(path: &Path) -> String {
    let Ok(meta) = std::fs::metadata(path) else {
        return "ask its owner to let you into the folder".to_owned();
    };
    if !path.starts_with("/dev") {
        return format!("run `chmod +r {}`, or ask its owner to", path.display());
    }
    let group_may = meta.mode() & 0o060 == 0o060;
    if !group_may || meta.gid() == 0 {
        let shown = path.display();
        return format!(
            "run `sudo chgrp video {shown} && sudo chmod 660 {shown}`, and be in the group video"
        );
    }
    let group = group_name(meta.gid()).unwrap_or_else(|| meta.gid().to_string());
    format!("run `sudo usermod -aG {group} $USER`, log out and log in again")
}

/// What `/etc/group` calls the group of this number.
pub fn group_name(gid: u32) -> Option<String> {
    let groups = std::fs::read_to_string("/etc/group").ok()?;
    groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(gid)).then(|| name.to_owned())
    })
}

/// Another program that has `path` open, as far as we may see: `ffmpeg (process 1234)`.
fn holder(path: &Path) -> Option<String> {
    let device = std::fs::metadata(path).ok()?.rdev();
    let own = std::process::id();
    for process in std::fs::read_dir("/proc").ok()?.flatten() {
        let Some(pid) = process
            .file_name()
            .to_str()
            .and_then(|n| n.parse::<u32>().ok())
        else {
            continue;
        };
        let Ok(open) = std::fs::read_dir(process.path().join("fd")) else {
            continue;
        };
        if pid != own && open.flatten().any(|fd| leads_to(&fd.path(), device)) {
            let name = std::fs::read_to_string(process.path().join("comm")).unwrap_or_default();
            return Some(format!("{} (process {pid})", name.trim()));
        }
    }
    None
}

/// Whether this open file is the device. Only what is named like one is looked at: asking a dead
/// network file system could hang.
fn leads_to(fd: &Path, device: u64) -> bool {
    std::fs::read_link(fd).is_ok_and(|target| target.starts_with("/dev"))
        && std::fs::metadata(fd).is_ok_and(|m| m.rdev() == device)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_group_of_the_device_is_named() {
        assert_eq!(group_name(0).as_deref(), Some("root"));
        let error = SourceError::of_file(
            Path::new("/dev/null"),
            &std::io::Error::from_raw_os_error(libc::EACCES),
        );
        assert!(matches!(error, SourceError::Denied { .. }));
        // Root's group is nothing to join.
        assert!(
            error.to_string().contains("sudo chgrp video /dev/null"),
            "{error}"
        );
    }

    #[test]
    fn what_the_driver_says_is_told_apart() {
        let of = |code| {
            SourceError::of_driver(
                Path::new("/dev/null"),
                "starting",
                &std::io::Error::from_raw_os_error(code),
            )
        };
        assert!(matches!(of(libc::EBUSY), SourceError::Busy { .. }));
        assert!(matches!(of(libc::ENODEV), SourceError::Disconnected { .. }));
        assert!(matches!(of(libc::EIO), SourceError::Disconnected { .. }));
        assert!(matches!(of(libc::ENOTTY), SourceError::BadFormat { .. }));
        for code in [
            libc::EBUSY,
            libc::ENODEV,
            libc::ENOTTY,
            libc::EINVAL,
            libc::EACCES,
        ] {
            assert!(!of(code).to_string().contains('\n'), "one line");
        }
    }

    #[test]
    fn the_program_that_holds_a_device_is_named() {
        let Ok(device) = std::fs::File::open("/dev/full") else {
            return;
        };
        let mut child = std::process::Command::new("sleep")
            .arg("60")
            .stdin(device)
            .spawn()
            .expect("sleep");
        let found = holder(Path::new("/dev/full"));
        child
            .kill()
            .and_then(|()| child.wait())
            .expect("end of sleep");
        assert_eq!(found, Some(format!("sleep (process {})", child.id())));
    }
}

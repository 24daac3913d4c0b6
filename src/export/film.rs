//! Pictures as a video, through ffmpeg as a child process (H.264 in MP4, which everything plays).

use super::{ExportError, OutputFile};
use crate::model::Size;
use std::ffi::OsString;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, Write};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};

/// A video while it is written. Dropped without [`Film::finish`], it leaves nothing behind.
#[derive(Debug)]
pub struct Film {
    /// `None` once it has its name.
    file: Option<OutputFile>,
    child: Child,
    input: Option<ChildStdin>,
    /// What ffmpeg complains about; a file, for a pipe would want to be read.
    log: File,
    bytes: usize,
}

impl Film {
    /// Begins a video of pictures of one size at `fps` pictures a second. An odd side gets a black
    /// line, as H.264 wants.
    ///
    /// # Errors
    /// ffmpeg is not there; the file exists or cannot be written.
    pub fn begin(path: &Path, size: Size, fps: f64) -> Result<Self, ExportError> {
        Self::begin_with(path, size, fps, "ffmpeg")
    }

    fn begin_with(path: &Path, size: Size, fps: f64, ffmpeg: &str) -> Result<Self, ExportError> {
        let file = OutputFile::create(path)?;
        let log = tempfile::tempfile().map_err(|e| file.explain(0, e))?;
        let mut command = Command::new(ffmpeg);
        command.args([
            "-hide_banner",
            "-v",
            "error",
            "-y",
            "-f",
            "rawvideo",
            "-pix_fmt",
            "rgb24",
        ]);
        command.args([
            "-s",
            &size.to_string(),
            "-r",
            &fps.to_string(),
            "-i",
            "pipe:0",
        ]);
        command.args([
            "-vf",
            "pad=ceil(iw/2)*2:ceil(ih/2)*2",
            "-c:v",
            "libx264",
            "-crf",
            "20",
            "-pix_fmt",
            "yuv420p",
        ]);
        // With more threads, and with the version in the file, the bytes would depend on the
        // machine.
        command.args([
            "-threads",
            "1",
            "-fflags",
            "+bitexact",
            "-flags:v",
            "+bitexact",
        ]);
        let mut target = OsString::from("file:");
        target.push(file.partial());
        command
            .args(["-movflags", "+faststart", "-f", "mp4"])
            .arg(target);
        let errors = log.try_clone().map_err(|e| file.explain(0, e))?;
        command
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(errors);
        // A group of its own: Ctrl-C at the terminal is for us.
        command.process_group(0);
        let mut child = command.spawn().map_err(|e| match e.kind() {
            io::ErrorKind::NotFound => ExportError::NoFfmpeg,
            _ => file.explain(0, e),
        })?;
        let input = child.stdin.take();
        Ok(Self {
            file: Some(file),
            child,
            input,
            log,
            bytes: 3 * size.area(),
        })
    }

    /// Adds a picture: three bytes a pixel, red first, row by row.
    ///
    /// # Errors
    /// The picture is of another size, or ffmpeg has ended, for a full disk as a rule.
    pub fn frame(&mut self, rgb: &[u8]) -> Result<(), ExportError> {
        if rgb.len() != self.bytes {
            return Err(ExportError::unfit("its pictures are not of one size"));
        }
        let written = self
            .input
            .as_mut()
            .map_or(Ok(()), |input| input.write_all(rgb));
        written.map_err(|e| self.failure(e))
    }

    /// Ends the video and gives it its name.
    ///
    /// # Errors
    /// ffmpeg failed, or the disk is full.
    pub fn finish(mut self) -> Result<(), ExportError> {
        // ffmpeg ends with its input.
        drop(self.input.take());
        let status = match self.child.wait() {
            Ok(status) => status,
            Err(e) => return Err(self.failure(e)),
        };
        if !status.success() {
            return Err(self.failure(io::Error::other(format!("ffmpeg ended with {status}"))));
        }
        self.file.take().map_or(Ok(()), OutputFile::publish)
    }

    /// What went wrong: what ffmpeg said, else `e`.
    fn failure(&mut self, e: io::Error) -> ExportError {
        drop(self.input.take());
        let _ = self.child.wait();
        let _ = self.log.rewind();
        let lines = BufReader::new((&self.log).take(1 << 16))
            .lines()
            .map_while(Result::ok);
        let said: Vec<String> = lines.filter(|l| !l.trim().is_empty()).collect();
        let holds = |words: &str| said.iter().any(|l| l.contains(words));
        let full = holds("No space left") || holds("Disk quota");
        if holds("Unknown encoder") {
            return ExportError::NoFfmpeg;
        }
        // `[libx264 @ 0x5581] ...`: the address tells nobody anything.
        let line = said.first().map(|l| {
            l.split_once("] ")
                .map_or(l.as_str(), |(_, rest)| rest)
                .trim()
                .to_owned()
        });
        let said = line.map_or(e, |said| io::Error::other(format!("ffmpeg: {said}")));
        let e = if full {
            io::ErrorKind::StorageFull.into()
        } else {
            said
        };
        self.file
            .as_ref()
            .map_or(ExportError::NoFfmpeg, |file| file.explain(0, e))
    }
}

impl Drop for Film {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_ffmpeg_the_remedy_is_named_and_nothing_is_left() {
        let dir = tempfile::tempdir().unwrap();
        let error = Film::begin_with(
            &dir.path().join("a.mp4"),
            Size::new(4, 4),
            30.0,
            "no-such-ffmpeg",
        )
        .unwrap_err();
        assert!(error.to_string().contains("apt install ffmpeg"), "{error}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_video_that_is_given_up_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let mut film = Film::begin(&dir.path().join("a.mp4"), Size::new(16, 16), 30.0).unwrap();
        film.frame(&[7; 3 * 256]).unwrap();
        assert!(film.frame(&[7; 3]).is_err());
        drop(film);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}

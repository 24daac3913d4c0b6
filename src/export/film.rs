//! Pictures as a video, through ffmpeg as a child process (H.264 in MP4, which everything plays).

use super::ExportError;
use crate::ffmpeg::{Ffmpeg, plain};
use crate::files::OutputFile;
use crate::model::Size;
use std::ffi::OsString;
use std::io::{self, Write};
use std::path::Path;
use std::process::{ChildStdin, Command, Stdio};

/// The pictures come as they are; their number a second and their size are told before.
const INPUT: [&str; 8] = [
    "-hide_banner",
    "-v",
    "error",
    "-y",
    "-f",
    "rawvideo",
    "-pix_fmt",
    "rgb24",
];
const ENCODER: [&str; 8] = [
    "-vf",
    "pad=ceil(iw/2)*2:ceil(ih/2)*2",
    "-c:v",
    "libx264",
    "-crf",
    "20",
    "-pix_fmt",
    "yuv420p",
];
/// With more threads, and with the version in the file, the bytes would depend on the machine.
const REPRODUCIBLE: [&str; 6] = [
    "-threads",
    "1",
    "-fflags",
    "+bitexact",
    "-flags:v",
    "+bitexact",
];
const CONTAINER: [&str; 4] = ["-movflags", "+faststart", "-f", "mp4"];

/// A video while it is written. Dropped without [`Film::finish`], it leaves nothing behind.
#[derive(Debug)]
pub struct Film {
    // In this order they are dropped: ffmpeg must have ended when its file is taken away.
    ffmpeg: Ffmpeg,
    input: Option<ChildStdin>,
    /// `None` once it has its name.
    file: Option<OutputFile>,
    /// Of a picture.
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

    fn begin_with(path: &Path, size: Size, fps: f64, program: &str) -> Result<Self, ExportError> {
        let file = OutputFile::create(path)?;
        let mut target = OsString::from("file:");
        target.push(file.partial());
        let (side, rate) = (size.to_string(), fps.to_string());
        let mut command = Command::new(program);
        command
            .args(INPUT)
            .args(["-s", &side, "-r", &rate, "-i", "pipe:0"])
            .args(ENCODER)
            .args(REPRODUCIBLE)
            .args(CONTAINER)
            .arg(target)
            .stdin(Stdio::piped())
            .stdout(Stdio::null());
        let started = Ffmpeg::start(&mut command);
        let mut ffmpeg = started.map_err(|e| match e.kind() {
            io::ErrorKind::NotFound => ExportError::NoFfmpeg,
            _ => file.explain(0, e).into(),
        })?;
        Ok(Self {
            file: Some(file),
            input: ffmpeg.input(),
            ffmpeg,
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
        let status = match self.ffmpeg.wait() {
            Ok(status) => status,
            Err(e) => return Err(self.failure(e)),
        };
        if !status.success() {
            return Err(self.failure(io::Error::other(format!("ffmpeg ended with {status}"))));
        }
        match self.file.take() {
            Some(file) => Ok(file.publish()?),
            None => Ok(()),
        }
    }

    /// What went wrong: what ffmpeg said, else `e`.
    fn failure(&mut self, e: io::Error) -> ExportError {
        drop(self.input.take());
        let _ = self.ffmpeg.wait();
        let said = self.ffmpeg.complaints();
        if mentions(&said, "Unknown encoder") {
            return ExportError::NoFfmpeg;
        }
        let e = match said.first() {
            _ if mentions(&said, "No space left") || mentions(&said, "Disk quota") => {
                io::ErrorKind::StorageFull.into()
            }
            Some(line) => io::Error::other(format!("ffmpeg: {}", plain(line))),
            None => e,
        };
        match &self.file {
            Some(file) => file.explain(0, e).into(),
            None => ExportError::NoFfmpeg,
        }
    }
}

fn mentions(said: &[String], words: &str) -> bool {
    said.iter().any(|line| line.contains(words))
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

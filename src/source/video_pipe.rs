//! The frames of one stream of a video file, through ffmpeg as a child process.
//!
//! ffmpeg writes two things: one line of text a frame with its time and length (`framecrc`), and
//! the frame's bytes. Each is flushed frame by frame and the line goes first, so that reading a
//! line and then that many bytes, in turns, can never wait for something that ffmpeg has not
//! written: no thread and no polling is needed.

use super::error::SourceError;
use super::probe::{file_url, ratio, spawn_error};
use crate::ffmpeg::{Ffmpeg, plain};
use crate::model::{PixelFormat, Size, nanoseconds, seconds};
use std::io::{BufRead, BufReader, PipeReader, Read};
use std::path::Path;
use std::process::{ChildStdout, Command, Stdio};

/// No frame of a size that we can work with is longer; what is comes from a broken file.
const MAX_FRAME_BYTES: usize = 1 << 30;

/// The line goes to the pipe that is the child's descriptor 0, before the frame goes to its
/// standard output.
const OUTPUTS: &str = "[f=framecrc:flush_packets=1]pipe:0|[f=rawvideo:flush_packets=1]pipe:1";

/// What it means that the child's pipes cannot be made.
fn no_pipe(ffmpeg: &str, path: &Path, e: &std::io::Error) -> SourceError {
    // Never the kind of a program that is not there.
    spawn_error(ffmpeg, path, &std::io::Error::other(e.to_string()))
}

/// Writes the frames of a stream in `format`, and a line for each.
fn reader(path: &Path, ffmpeg: &str, stream: &str, format: PixelFormat) -> Command {
    let mut command = Command::new(ffmpeg);
    command
        .args(["-nostdin", "-hide_banner", "-v", "error"])
        .args(["-protocol_whitelist", "file"])
        .args(["-fflags", "+discardcorrupt", "-copyts", "-i"])
        .arg(file_url(path))
        .args(["-map", stream]);
    match format {
        PixelFormat::Mjpeg => command.args(["-c:v", "copy"]),
        format if format.is_depth() => command.args(["-c:v", "rawvideo", "-pix_fmt", "gray16le"]),
        // Two pixels share their colour in YUYV: an odd column at the right is cut off.
        _ => command
            .args(["-vf", "format=yuyv422,crop=trunc(iw/2)*2:ih:0:0"])
            .args(["-c:v", "rawvideo", "-pix_fmt", "yuyv422"]),
    };
    if format != PixelFormat::Mjpeg {
        // Otherwise the times would be rounded to a nominal rate.
        command.args(["-vsync", "passthrough", "-enc_time_base", "-1"]);
    }
    command.args(["-f", "tee", OUTPUTS]);
    command
}

/// A stream that is being read.
pub(super) struct VideoPipe {
    lines: BufReader<PipeReader>,
    data: ChildStdout,
    child: Ffmpeg,
    size: Size,
    tick_s: f64,
}

/// A frame of it.
pub(super) struct VideoPipeFrame {
    /// By the file, s; a whole number of nanoseconds.
    pub time_s: f64,
    pub size: Size,
    pub bytes: Vec<u8>,
}

/// A frame that is announced.
struct Announced {
    ticks: i64,
    length: usize,
}

impl VideoPipe {
    /// Starts to read `stream` (as `-map` of ffmpeg names it) in `format`.
    ///
    /// # Errors
    /// The program is not there, or does not start.
    pub fn start(
        path: &Path,
        ffmpeg: &str,
        stream: &str,
        format: PixelFormat,
    ) -> Result<Self, SourceError> {
        let (lines, lines_end) = std::io::pipe().map_err(|e| no_pipe(ffmpeg, path, &e))?;
        let mut command = reader(path, ffmpeg, stream, format);
        command.stdin(lines_end).stdout(Stdio::piped());
        let mut child = Ffmpeg::start(&mut command).map_err(|e| spawn_error(ffmpeg, path, &e))?;
        // The command still holds the pipe's other end, and with it the end of the stream.
        drop(command);
        let Some(data) = child.output() else {
            return Err(no_pipe(ffmpeg, path, &std::io::Error::other("no pipe")));
        };
        Ok(Self {
            lines: BufReader::new(lines),
            data,
            child,
            size: Size::new(0, 0),
            tick_s: 0.0,
        })
    }

    /// The next frame; `None` at the end, and where the file is damaged beyond reading.
    pub fn next_frame(&mut self) -> Option<VideoPipeFrame> {
        let Announced { ticks, length } = self.announced()?;
        let mut bytes = Vec::with_capacity(length);
        let mut data = self.data.by_ref().take(length as u64);
        let read = data.read_to_end(&mut bytes);
        if read.is_err() || bytes.len() < length {
            return None;
        }
        Some(VideoPipeFrame {
            time_s: seconds(nanoseconds(ticks as f64 * self.tick_s)),
            size: self.size,
            bytes,
        })
    }

    /// Time and length of the next frame; the head before the first one is taken in on the way.
    fn announced(&mut self) -> Option<Announced> {
        let mut line = String::new();
        loop {
            line.clear();
            if self.lines.read_line(&mut line).ok()? == 0 {
                return None;
            }
            if let Some(tick) = line.strip_prefix("#tb 0:") {
                self.tick_s = ratio(tick)?;
            } else if let Some(size) = line.strip_prefix("#dimensions 0:") {
                let (width, height) = size.trim().split_once('x')?;
                self.size = Size::new(width.parse().ok()?, height.parse().ok()?);
            } else if !line.starts_with('#') {
                // stream, decoding time, presentation time, duration, length, checksum
                let mut fields = line.split(',').skip(1).map(str::trim);
                let decoded: i64 = fields.next()?.parse().ok()?;
                let shown: i64 = fields.next()?.parse().ok()?;
                let length: usize = fields.nth(1)?.parse().ok()?;
                let known = self.tick_s > 0.0 && self.size.area() > 0 && length <= MAX_FRAME_BYTES;
                // AVI has no presentation times; there the two are the same.
                let ticks = if shown == i64::MIN { decoded } else { shown };
                return known.then_some(Announced { ticks, length });
            }
        }
    }

    /// The first thing that ffmpeg complained about. Ends the child if it runs.
    pub fn complaint(&mut self) -> Option<String> {
        self.child.kill();
        let said = self.child.complaints();
        said.first().map(|line| plain(line).to_owned())
    }
}

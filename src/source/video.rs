//! Video files, through ffmpeg as a child process.
//!
//! ffmpeg writes two things: one line of text a frame with its time and length (`framecrc`), and
//! the frame's bytes. Each is flushed frame by frame and the line goes first, so that reading a
//! line and then that many bytes, in turns, can never wait for something that ffmpeg has not
//! written: no thread and no polling is needed.
//!
//! MJPEG is only taken out of its container, every other codec is decoded to YUYV. Times are those
//! in the file.

use super::error::SourceError;
use super::interface::{Source, SourceInfo};
use super::probe::{Probe, file_url, probe, ratio, spawn_error};
use crate::ffmpeg::{Ffmpeg, plain};
use crate::model::{FormatNote, Origin, PixelFormat, RawFrame, Size, nanoseconds, seconds};
use std::collections::VecDeque;
use std::io::{BufRead, BufReader, PipeReader, Read};
use std::path::{Path, PathBuf};
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

/// Writes the frames of `path` in `format`, and a line for each.
fn reader(path: &Path, ffmpeg: &str, format: PixelFormat) -> Command {
    let mut command = Command::new(ffmpeg);
    command
        .args(["-nostdin", "-hide_banner", "-v", "error"])
        .args(["-protocol_whitelist", "file"])
        .args(["-fflags", "+discardcorrupt", "-copyts", "-i"])
        .arg(file_url(path))
        .args(["-map", "0:V:0"]);
    match format {
        PixelFormat::Mjpeg => command.args(["-c:v", "copy"]),
        // Two pixels share their colour in YUYV: an odd column at the right is cut off. Without
        // `-enc_time_base` and `-vsync` the times would be rounded to a nominal rate.
        _ => command
            .args(["-vf", "format=yuyv422,crop=trunc(iw/2)*2:ih:0:0"])
            .args(["-c:v", "rawvideo", "-pix_fmt", "yuyv422"])
            .args(["-vsync", "passthrough", "-enc_time_base", "-1"]),
    };
    command.args(["-f", "tee", OUTPUTS]);
    command
}

/// A video file that is being read.
pub(super) struct Video {
    path: PathBuf,
    probe: Probe,
    lines: BufReader<PipeReader>,
    data: ChildStdout,
    child: Ffmpeg,
    size: Size,
    format: PixelFormat,
    tick_s: f64,
    /// The first two frames are read when the file is opened: only then it is known that there are
    /// any, and motion.
    pending: VecDeque<RawFrame>,
    frames: u64,
    out_of_order: u64,
    first_time_s: f64,
    last_time_s: f64,
    interval_s: f64,
    ended: bool,
    warnings: Vec<String>,
}

impl Video {
    pub(super) fn open(path: &Path) -> Result<Self, SourceError> {
        Self::open_with(path, "ffmpeg", "ffprobe")
    }

    fn open_with(path: &Path, ffmpeg: &str, ffprobe: &str) -> Result<Self, SourceError> {
        let probe = probe(path, ffprobe)?;
        let format = if probe.codec == "mjpeg" {
            PixelFormat::Mjpeg
        } else {
            PixelFormat::Yuyv
        };
        let (lines, lines_end) = std::io::pipe().map_err(|e| no_pipe(ffmpeg, path, &e))?;
        let mut command = reader(path, ffmpeg, format);
        command.stdin(lines_end).stdout(Stdio::piped());
        let mut child = Ffmpeg::start(&mut command).map_err(|e| spawn_error(ffmpeg, path, &e))?;
        // The command still holds the pipe's other end, and with it the end of the stream.
        drop(command);
        let Some(data) = child.output() else {
            return Err(no_pipe(ffmpeg, path, &std::io::Error::other("no pipe")));
        };
        let mut video = Self {
            path: path.to_owned(),
            probe,
            lines: BufReader::new(lines),
            data,
            child,
            size: Size::new(0, 0),
            format,
            tick_s: 0.0,
            pending: VecDeque::new(),
            frames: 0,
            out_of_order: 0,
            first_time_s: 0.0,
            last_time_s: f64::NEG_INFINITY,
            interval_s: 0.0,
            ended: false,
            warnings: Vec::new(),
        };
        video.pending = std::iter::from_fn(|| video.read_frame()).take(2).collect();
        match video.pending.len() {
            0 => Err(video.unreadable()),
            1 => Err(SourceError::SingleFrame {
                input: path.display().to_string(),
            }),
            _ => Ok(video),
        }
    }

    /// Why there is no frame at all.
    fn unreadable(&mut self) -> SourceError {
        match self.complaint() {
            None => SourceError::Empty {
                input: self.path.display().to_string(),
                what: "the video has no frame; film again, or name another file",
            },
            Some(what) => {
                let what = format!("no frame of it can be read (ffmpeg: {what})");
                SourceError::bad_format(&self.path, what)
            }
        }
    }

    /// The next frame whose time is later than the last one's, `None` at the end.
    fn read_frame(&mut self) -> Option<RawFrame> {
        while let Some((ticks, length)) = self.read_line() {
            let mut bytes = Vec::with_capacity(length);
            let read = self
                .data
                .by_ref()
                .take(length as u64)
                .read_to_end(&mut bytes);
            if read.is_err() || bytes.len() < length {
                return None;
            }
            let sequence = self.frames;
            self.frames += 1;
            let sensor_time_s = seconds(nanoseconds(ticks as f64 * self.tick_s));
            if sensor_time_s <= self.last_time_s {
                self.out_of_order += 1;
                continue;
            }
            if self.last_time_s.is_finite() {
                self.interval_s = sensor_time_s - self.last_time_s;
            } else {
                self.first_time_s = sensor_time_s;
            }
            self.last_time_s = sensor_time_s;
            return Some(RawFrame {
                sequence: Some(sequence),
                sensor_time_s,
                size: self.size,
                format: self.format,
                bytes,
                depth: None,
            });
        }
        None
    }

    /// Time in ticks and length of the next frame; the head before the first one is taken in on the
    /// way.
    fn read_line(&mut self) -> Option<(i64, usize)> {
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
                return known.then_some((if shown == i64::MIN { decoded } else { shown }, length));
            }
        }
    }

    /// The first thing that ffmpeg complained about. Ends the child if it runs.
    fn complaint(&mut self) -> Option<String> {
        self.child.kill();
        let said = self.child.complaints();
        said.first().map(|line| plain(line).to_owned())
    }

    /// Works out what is to be said when no more frames come.
    fn finish(&mut self) {
        let complaint = self.complaint();
        let name = self.path.display();
        let read_s = self.last_time_s - self.first_time_s + self.interval_s;
        let frames = self.frames;
        let promised_s = self
            .probe
            .duration_s
            .filter(|d| d - read_s > f64::max(0.5, 3.0 * self.interval_s));
        let cut = self.probe.cut
            || complaint
                .as_ref()
                .is_some_and(|c| c.contains("prematurely") || c.contains("partial file"));
        if let Some(promised_s) = promised_s {
            let text = format!(
                "{name}: clip ends early: {read_s:.1} s ({frames} frames) of {promised_s:.1} s are readable"
            );
            self.warnings.push(format!("{text}; they are used"));
        } else if cut {
            self.warnings.push(format!(
                "{name}: clip ends early: the {frames} frames before the cut are used"
            ));
        } else if let Some(complaint) = complaint {
            self.warnings.push(format!(
                "{name}: parts of the clip are damaged (ffmpeg: {complaint})"
            ));
        }
        if self.out_of_order > 0 {
            let text = "frames left out because they were not later than the one before";
            self.warnings
                .push(format!("{name}: {text}: {}", self.out_of_order));
        }
    }
}

impl Source for Video {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        if self.ended {
            return Ok(None);
        }
        let frame = self.pending.pop_front().or_else(|| self.read_frame());
        if frame.is_none() {
            self.ended = true;
            self.finish();
        }
        Ok(frame)
    }

    fn describe(&self) -> SourceInfo {
        let rate = self.probe.rate_hz.map_or(String::new(), |hz| {
            format!(" @ {}", (hz * 100.0).round() / 100.0)
        });
        let given = match self.format {
            PixelFormat::Mjpeg => format!("{} {}{rate}", self.format, self.size),
            _ => format!(
                "{} {}{rate}, decoded to {}",
                self.probe.codec, self.size, self.format
            ),
        };
        SourceInfo {
            name: self.path.display().to_string(),
            format: FormatNote {
                asked: given.clone(),
                given,
            },
            size: self.size,
            nominal_rate_hz: self.probe.rate_hz,
            frames_total: self.probe.frames,
            live: false,
            depth: None,
        }
    }

    fn origin(&self) -> Origin {
        Origin {
            captured_at: self.probe.created_at,
            ..Origin::default()
        }
    }

    fn warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_ffmpeg_is_named_with_the_remedy() {
        let clip = Path::new("recordings/sparse_winter.mkv");
        for (ffmpeg, ffprobe) in [("ffmpeg", "no-such-ffprobe"), ("no-such-ffmpeg", "ffprobe")] {
            let Err(error) = Video::open_with(clip, ffmpeg, ffprobe) else {
                panic!("opened without ffmpeg")
            };
            assert!(matches!(error, SourceError::MissingTool { .. }), "{error}");
            assert!(error.to_string().contains("apt install ffmpeg"));
        }
    }
}

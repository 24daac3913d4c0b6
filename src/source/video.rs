//! Video files, through ffmpeg as a child process. MJPEG is only taken out of its container, every
//! other codec is decoded to YUYV. Times are those in the file.

use super::error::SourceError;
use super::interface::{Source, SourceInfo};
use super::probe::{Probe, probe};
use super::video_pipe::{VideoPipe, VideoPipeFrame};
use crate::model::{FormatNote, Origin, PixelFormat, RawFrame, Size};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};

/// The first stream of moving pictures.
const FIRST: &str = "0:V:0";

/// A video file that is being read.
pub(super) struct Video {
    path: PathBuf,
    probe: Probe,
    pipe: VideoPipe,
    size: Size,
    format: PixelFormat,
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
        let pipe = VideoPipe::start(path, ffmpeg, FIRST, format)?;
        let mut video = Self {
            path: path.to_owned(),
            probe,
            pipe,
            size: Size::new(0, 0),
            format,
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
        match self.pipe.complaint() {
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
        while let Some(VideoPipeFrame {
            time_s: sensor_time_s,
            size,
            bytes,
        }) = self.pipe.next_frame()
        {
            self.size = size;
            let sequence = self.frames;
            self.frames += 1;
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

    /// Works out what is to be said when no more frames come.
    fn finish(&mut self) {
        let complaint = self.pipe.complaint();
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

//! A recording as a source: its own frames, numbers and times.

use super::depth_format::{KnownDepth, SaidOfDepth};
use super::depth_tally::DepthTally;
use super::error::SourceError;
use super::images::picture;
use super::interface::{Source, SourceInfo};
use crate::config;
use crate::model::{DepthImage, FormatNote, Origin, PixelFormat, RawFrame, Size, seconds};
use crate::recording::{Encoding, Picture, Reader, RecordingError};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// So many frames are looked at for the camera of their depth.
const FRAMES_FOR_CAMERA: usize = 8;

/// A recording that is being read.
pub(super) struct Recording {
    path: PathBuf,
    reader: Reader,
    /// The first two frames are read when the file is opened: only then it is known that there are
    /// any, and motion.
    pending: VecDeque<RawFrame>,
    size: Option<Size>,
    frames: u64,
    last_ns: Option<i64>,
    out_of_order: u64,
    unreadable: u64,
    ended: bool,
    /// `None` where it has no depth, or none is wanted.
    depth: Option<KnownDepth>,
    tally: DepthTally,
}

impl Recording {
    pub(super) fn open(path: &Path, settings: &config::Depth) -> Result<Self, SourceError> {
        let input = path.display().to_string();
        let mut reader = Reader::open(path).map_err(|e| match e {
            RecordingError::Unreadable { source, .. } => SourceError::of_file(path, &source),
            RecordingError::Unusable { what, .. } => SourceError::BadFormat {
                input: input.clone(),
                what,
            },
            other => SourceError::BadFormat {
                input: input.clone(),
                what: other.to_string(),
            },
        })?;
        if !settings.read {
            reader.leave_depth_out();
        }
        reader.set_depth_late(settings.late_s);
        let mut recording = Self {
            path: path.to_owned(),
            reader,
            pending: VecDeque::new(),
            size: None,
            frames: 0,
            last_ns: None,
            out_of_order: 0,
            unreadable: 0,
            ended: false,
            depth: None,
            tally: DepthTally::default(),
        };
        while recording.pending.len() < recording.frames_at_first()
            && let Some(frame) = recording.read_frame()
        {
            recording.pending.push_back(frame);
        }
        match recording.pending.len() {
            0 => {}
            1 => return Err(SourceError::SingleFrame { input }),
            _ => {
                recording.take_depth(settings)?;
                return Ok(recording);
            }
        }
        let mut what = "no picture in it can be read".to_owned();
        let topics = recording.reader.topics();
        if !topics.is_empty() {
            what = format!("{what}; it holds {}", topics.join(", "));
        }
        for warning in recording.reader.warnings() {
            what = format!(
                "{what}; {}",
                warning.trim_start_matches(&format!("{input}: "))
            );
        }
        Err(SourceError::BadFormat { input, what })
    }

    /// So many frames are read before the first is given out: two, more while the camera of their depth
    /// is not known.
    fn frames_at_first(&self) -> usize {
        let waits = self.size.is_some_and(|size| {
            let is_known = self.reader.depth_camera(size).is_some()
                && (self.reader.depth_misfit().is_none() || self.reader.depth_rig().is_some());
            self.reader.has_depth() && !is_known
        });
        if waits { FRAMES_FOR_CAMERA } else { 2 }
    }

    fn take_depth(&mut self, settings: &config::Depth) -> Result<(), SourceError> {
        let Some(size) = self.size.filter(|_| self.reader.has_depth()) else {
            return Ok(());
        };
        let said = SaidOfDepth {
            camera: self.reader.depth_camera(size),
            unit_m: self.reader.depth_unit_m(),
            is_in_metres: self.reader.is_depth_in_metres(),
            rig: self.reader.depth_rig(),
        };
        let misfit = self.reader.depth_misfit();
        let is_placed = said.rig.is_some() || !settings.own_camera.is_empty();
        if let Some(why) = misfit.filter(|_| !is_placed) {
            let what = format!(
                "its depth is not registered with its pictures ({why}), and nothing says where its camera \
                 is; record the depth that is, e.g. aligned_depth_to_color, say it with --depth-camera \
                 FILE, or give --no-depth"
            );
            return Err(SourceError::bad_format(&self.path, what));
        }
        let known = said.known(&self.path, settings, size)?;
        let first = self.pending.iter().find_map(|frame| frame.depth.as_ref());
        if let Some(image) = first {
            let usable = known.usable((**image).clone());
            usable.map_err(|what| SourceError::bad_format(&self.path, what))?;
        }
        self.depth = Some(known);
        Ok(())
    }

    /// A depth image of the file as it is used; one that cannot be is counted.
    fn usable(&mut self, image: Arc<DepthImage>) -> Option<Arc<DepthImage>> {
        let known = self.depth.as_ref()?;
        match known.usable(Arc::unwrap_or_clone(image)) {
            Ok(image) => Some(Arc::new(image)),
            Err(why) => {
                self.tally.unreadable(why);
                None
            }
        }
    }

    /// The next frame whose time is later than the last one's.
    fn read_frame(&mut self) -> Option<RawFrame> {
        loop {
            let Picture {
                sequence,
                sensor_time_ns,
                encoding,
                bytes,
                depth,
            } = self.reader.next_picture()?;
            if self.last_ns.is_some_and(|last| sensor_time_ns <= last) {
                self.out_of_order += 1;
                continue;
            }
            let Some((size, format, bytes)) = self.unpack(encoding, bytes) else {
                self.unreadable += 1;
                continue;
            };
            self.last_ns = Some(sensor_time_ns);
            self.size = Some(size);
            self.frames += 1;
            return Some(RawFrame {
                sequence,
                sensor_time_s: seconds(sensor_time_ns),
                size,
                format,
                bytes,
                depth,
            });
        }
    }

    /// A length that the recording's own head says.
    fn pixels(&self, key: &str) -> Option<u32> {
        self.reader.about().get(key)?.parse().ok()
    }

    /// Size, format and bytes as a camera gives them.
    fn unpack(&self, encoding: Encoding, bytes: Vec<u8>) -> Option<(Size, PixelFormat, Vec<u8>)> {
        if let Encoding::Pixels(format, size) = encoding {
            return Some((size, format, bytes));
        }
        // A picture that was damaged before it was recorded is counted where a camera's is: by the
        // decoder.
        let known = self
            .pixels("width")
            .zip(self.pixels("height"))
            .map(|(w, h)| Size::new(w, h))
            .or(self.size);
        match known {
            Some(size) if bytes.starts_with(&[0xff, 0xd8]) => {
                Some((size, PixelFormat::Mjpeg, bytes))
            }
            _ => picture(bytes).ok(),
        }
    }
}

impl Source for Recording {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        if self.ended {
            return Ok(None);
        }
        let mut frame = self.pending.pop_front().or_else(|| self.read_frame());
        self.ended = frame.is_none();
        if let Some(frame) = &mut frame {
            let depth = frame.depth.take();
            frame.depth = depth.and_then(|depth| self.usable(depth));
        }
        if let (Some(frame), true) = (&frame, self.depth.is_some()) {
            self.tally
                .frame(frame.sensor_time_s, frame.depth.as_deref());
        }
        Ok(frame)
    }

    fn describe(&self) -> SourceInfo {
        let about = self.reader.about();
        let size = self.size.unwrap_or(Size::new(0, 0));
        let first = self
            .pending
            .front()
            .map_or(PixelFormat::Mjpeg, |f| f.format);
        let given = about
            .get("format_given")
            .filter(|f| !f.is_empty())
            .cloned()
            .unwrap_or_else(|| format!("{first} {size}"));
        SourceInfo {
            name: self.path.display().to_string(),
            format: FormatNote {
                asked: given.clone(),
                given,
            },
            size,
            nominal_rate_hz: about
                .get("nominal_rate_hz")
                .and_then(|hz| hz.parse().ok())
                .filter(|hz: &f64| *hz > 0.0),
            frames_total: self.reader.pictures_total(),
            live: false,
            depth: self.depth.as_ref().map(|depth| depth.format),
        }
    }

    fn origin(&self) -> Origin {
        self.reader.origin()
    }

    fn warnings(&mut self) -> Vec<String> {
        let name = self.path.display();
        let kinds = [
            (&mut self.out_of_order, "were not later than the one before"),
            (&mut self.unreadable, "are no picture that can be read"),
        ];
        let mut lines: Vec<String> = kinds
            .into_iter()
            .filter(|(count, _)| **count > 0)
            .map(|(count, what)| {
                format!(
                    "{name}: frames left out because they {what}: {}",
                    std::mem::take(count)
                )
            })
            .collect();
        lines.extend(self.reader.warnings());
        lines.extend(self.tally.take_warnings(&name.to_string()));
        lines
    }
}

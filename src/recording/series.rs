//! A recording: one file, or several in turn where a limit is set. Each file stands on its own.

use super::error::RecordingError;
use super::schema::{
    CAPTURED_AT, CLOCK, DEPTH_CAMERA_PX, DEPTH_DISTORTION, DEPTH_UNIT_M, FIRST_SEQUENCE, NOTE,
    SHIFT_NS, Topic,
};
use super::writer::{Times, Writer};
use super::{image, scene};
use crate::model::{
    DepthFormat, FormatNote, LocalTime, Origin, Outline, Pose, RawFrame, Size, Skeleton, TrackSet,
    nanoseconds,
};
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Frames whose times are remembered for what is computed from them later.
const REMEMBERED: usize = 4096;

/// What is recorded, for the head of each file.
#[derive(Clone, Debug, Default)]
pub struct Head {
    /// The input as the user named it, and its own name; for a camera also what tells it from
    /// others.
    pub source: String,
    pub format: FormatNote,
    pub size: Option<Size>,
    pub nominal_rate_hz: Option<f64>,
    /// What the frames' times come from, e.g. `monotonic`, `file`.
    pub clock: String,
    /// Of a camera, when the first frame was filmed is known only with that frame, see
    /// [`Series::set_captured_at`].
    pub origin: Origin,
    /// Of the depth images beside the frames; `None` where there are none.
    pub depth: Option<DepthFormat>,
}

/// When a file is ended and the next one begun.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Bytes of a file; a frame and the end of the file may go beyond it a little.
    pub max_bytes: Option<u64>,
    /// Time between the first and the last frame of a file, ns.
    pub max_time_ns: Option<u64>,
}

/// Sensor time to the times in the file. All files of a series share it, so that differences are
/// exact across them.
#[derive(Clone, Copy, Debug)]
struct Clock {
    log_minus_sensor_ns: i64,
    publish_minus_sensor_ns: i64,
    /// Time of the first frame.
    start_ns: i64,
}

impl Clock {
    fn times(self, sensor_ns: i64) -> Times {
        Times {
            log: shifted_ns(sensor_ns, self.log_minus_sensor_ns),
            publish: shifted_ns(sensor_ns, self.publish_minus_sensor_ns),
        }
    }
}

/// A time of the file, which has no negative ones.
fn shifted_ns(sensor_ns: i64, offset_ns: i64) -> u64 {
    u64::try_from(sensor_ns.saturating_add(offset_ns)).unwrap_or(0)
}

/// A recording that is being written.
pub struct Series {
    base: PathBuf,
    head: Head,
    limits: Limits,
    /// Nanoseconds since 1970, now.
    now_ns: fn() -> u64,
    writer: Writer,
    clock: Option<Clock>,
    /// Number of the file, and the time of its first frame.
    part: u32,
    part_start_ns: Option<i64>,
    files: u32,
    /// Frames in the chunk that is open, which a failure takes with it.
    open_frames: u64,
    closed_bytes: u64,
    frames: u64,
    recent: VecDeque<(u64, i64)>,
    outline: Option<Arc<Outline>>,
    tree: Option<FoundTree>,
    buffer: Vec<u8>,
}

/// The newest tree, and the frame from which on it is there.
#[derive(Clone)]
struct FoundTree {
    skeleton: Arc<Skeleton>,
    frame: u64,
    time_s: f64,
}

impl Series {
    /// Makes the first file, which must not be there.
    ///
    /// # Errors
    /// There is a file of that name, or none can be made.
    pub fn create(
        path: &Path,
        head: Head,
        limits: Limits,
        now_ns: fn() -> u64,
    ) -> Result<Self, RecordingError> {
        Ok(Self {
            base: path.to_owned(),
            head,
            limits,
            now_ns,
            writer: Writer::create(path)?,
            clock: None,
            part: 0,
            part_start_ns: None,
            files: 1,
            open_frames: 0,
            closed_bytes: 0,
            frames: 0,
            recent: VecDeque::new(),
            outline: None,
            tree: None,
            buffer: Vec::new(),
        })
    }

    /// Frames written.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Files begun.
    pub fn files(&self) -> u32 {
        self.files
    }

    /// Frames that were written since the last chunk was closed: where writing fails, they are
    /// lost.
    pub fn open_frames(&self) -> u64 {
        self.open_frames
    }

    /// Bytes of all files so far.
    pub fn bytes(&self) -> u64 {
        self.closed_bytes + self.writer.bytes()
    }

    /// Bytes that would be lost now if the program were killed.
    pub fn unflushed(&self) -> u64 {
        self.writer.unflushed()
    }

    /// The file that is being written.
    pub fn path(&self) -> &Path {
        self.writer.path()
    }

    /// Says when the first frame was filmed; to be said before that frame.
    pub fn set_captured_at(&mut self, at: LocalTime) {
        self.head.origin.captured_at = Some(at);
    }

    /// Appends a frame; `index` is its place in the capture, by which results name it.
    ///
    /// # Errors
    /// The disk is full or broken; nothing further can be written.
    pub fn frame(&mut self, raw: &RawFrame, index: u64) -> Result<(), RecordingError> {
        let sensor_ns = nanoseconds(raw.sensor_time_s);
        if self.is_over(raw, sensor_ns) {
            self.next_file()?;
        }
        let clock = match self.clock {
            Some(clock) => clock,
            None => {
                let now = i64::try_from((self.now_ns)()).unwrap_or(i64::MAX);
                let clock = Clock {
                    log_minus_sensor_ns: now.saturating_sub(sensor_ns),
                    publish_minus_sensor_ns: sensor_ns.min(0).saturating_neg(),
                    start_ns: sensor_ns,
                };
                *self.clock.insert(clock)
            }
        };
        if self.part_start_ns.is_none() {
            self.part_start_ns = Some(sensor_ns);
            self.begin(clock, raw)?;
        }
        let times = clock.times(sensor_ns);
        let number = raw.sequence.unwrap_or(self.frames) as u32;
        if let Some(depth) = &raw.depth {
            image::encode_depth(depth, times.log, &mut self.buffer);
            self.writer
                .message(Topic::Depth, number, times, &self.buffer)?;
        }
        image::encode(raw, times.log, &mut self.buffer);
        self.writer
            .message(image::topic(raw), number, times, &self.buffer)?;
        if self.frames == 0 {
            // Whatever happens now, there is a picture.
            self.writer.flush()?;
        } else {
            self.open_frames += 1;
        }
        self.frames += 1;
        if self.recent.len() == REMEMBERED {
            self.recent.pop_front();
        }
        self.recent.push_back((index, sensor_ns));
        Ok(())
    }

    /// Whether a limit says that this frame begins another file.
    fn is_over(&self, raw: &RawFrame, sensor_ns: i64) -> bool {
        let Some(start_ns) = self.part_start_ns else {
            return false;
        };
        let bytes = self.writer.bytes() + raw.all_bytes() as u64;
        let time_ns = u64::try_from(sensor_ns.saturating_sub(start_ns)).unwrap_or(0);
        self.limits.max_bytes.is_some_and(|max| bytes > max)
            || self.limits.max_time_ns.is_some_and(|max| time_ns >= max)
    }

    /// The head of a file, and what was found out before it began.
    fn begin(&mut self, clock: Clock, first: &RawFrame) -> Result<(), RecordingError> {
        let head = &self.head;
        let size = head.size.unwrap_or(first.size);
        let software = concat!("arborcam ", env!("CARGO_PKG_VERSION"));
        let mut entries = vec![
            ("software", software.to_owned()),
            ("source", head.source.clone()),
            ("format_asked", head.format.asked.clone()),
            ("format_given", head.format.given.clone()),
            ("fourcc", first.format.fourcc().to_owned()),
            ("width", size.width.to_string()),
            ("height", size.height.to_string()),
            (CLOCK, head.clock.clone()),
            (
                "log_time_minus_sensor_time_ns",
                clock.log_minus_sensor_ns.to_string(),
            ),
            (SHIFT_NS, clock.publish_minus_sensor_ns.to_string()),
            ("file", self.part.to_string()),
        ];
        if let Some(hz) = head.nominal_rate_hz {
            entries.push(("nominal_rate_hz", hz.to_string()));
        }
        if let Some(depth) = &head.depth {
            let (focal_px, middle_px) = (depth.pinhole.focal_px, depth.pinhole.middle_px);
            let camera_px = [focal_px.x, focal_px.y, middle_px.x, middle_px.y];
            entries.push((DEPTH_UNIT_M, depth.unit_m.to_string()));
            for (key, px) in DEPTH_CAMERA_PX.into_iter().zip(camera_px) {
                entries.push((key, px.to_string()));
            }
            if depth.distortion.iter().any(|k| *k != 0.0) {
                let numbers = depth.distortion.map(|k| k.to_string());
                entries.push((DEPTH_DISTORTION, numbers.join(" ")));
            }
        }
        if let Some(number) = first.sequence {
            entries.push((FIRST_SEQUENCE, number.to_string()));
        }
        if let Some(at) = head.origin.captured_at {
            // Each file says when its own first frame was filmed.
            let sensor_ns = nanoseconds(first.sensor_time_s);
            let at = at.later_by_ns(sensor_ns.saturating_sub(clock.start_ns));
            entries.push((CAPTURED_AT, at.to_string()));
        }
        let notes = head.origin.notes.iter();
        let notes = notes.map(|(key, value)| (format!("{NOTE}{key}"), value.to_owned()));
        let entries = entries.into_iter();
        let entries: BTreeMap<String, String> = entries
            .map(|(key, value)| (key.to_owned(), value))
            .chain(notes)
            .collect();
        self.writer.about(entries)?;
        let times = clock.times(nanoseconds(first.sensor_time_s));
        if let Some(outline) = &self.outline {
            scene::outline(outline, times.log, &mut self.buffer);
            self.writer
                .message(Topic::Outline, 0, times, &self.buffer)?;
        }
        if let Some(tree) = self.tree.clone() {
            self.write_skeleton(&tree, times)?;
        }
        Ok(())
    }

    fn next_file(&mut self) -> Result<(), RecordingError> {
        self.close()?;
        let next = loop {
            self.part += 1;
            match Writer::create(&numbered(&self.base, self.part)) {
                // Somebody else's file is left alone.
                Err(RecordingError::Exists { .. }) => {}
                other => break other?,
            }
        };
        self.closed_bytes += self.writer.bytes();
        self.writer = next;
        self.files += 1;
        self.part_start_ns = None;
        Ok(())
    }

    /// Appends what was found in a frame: its points, and the outline where it is another one than
    /// before.
    ///
    /// # Errors
    /// As for [`Series::frame`].
    pub fn tracks(
        &mut self,
        tracks: &TrackSet,
        outline: &Arc<Outline>,
    ) -> Result<(), RecordingError> {
        let Some(times) = self.times_of(tracks.frame, tracks.time_s) else {
            return Ok(());
        };
        if self
            .outline
            .as_ref()
            .is_none_or(|o| !Arc::ptr_eq(o, outline) && **o != **outline)
        {
            self.outline = Some(outline.clone());
            scene::outline(outline, times.log, &mut self.buffer);
            self.writer
                .message(Topic::Outline, tracks.frame as u32, times, &self.buffer)?;
        }
        scene::points(tracks, times.log, &mut self.buffer);
        self.writer
            .message(Topic::Points, tracks.frame as u32, times, &self.buffer)?;
        // Numbers only; that cannot fail.
        if scene::tracks_json(tracks, &mut self.buffer).is_ok() {
            self.writer
                .message(Topic::Tracks, tracks.frame as u32, times, &self.buffer)?;
        }
        Ok(())
    }

    /// Appends the tree's posture, and the tree itself where it is another one than before.
    ///
    /// # Errors
    /// As for [`Series::frame`].
    pub fn pose(&mut self, pose: &Pose, skeleton: &Arc<Skeleton>) -> Result<(), RecordingError> {
        let Some(times) = self.times_of(pose.frame, pose.time_s) else {
            return Ok(());
        };
        if self
            .tree
            .as_ref()
            .is_none_or(|known| !Arc::ptr_eq(&known.skeleton, skeleton))
        {
            let tree = FoundTree {
                skeleton: skeleton.clone(),
                frame: pose.frame,
                time_s: pose.time_s,
            };
            self.tree = Some(tree.clone());
            self.write_skeleton(&tree, times)?;
        }
        scene::scene(skeleton, pose, times.log, &mut self.buffer);
        self.writer
            .message(Topic::Scene, pose.frame as u32, times, &self.buffer)?;
        scene::transforms(skeleton, pose, times.log, &mut self.buffer);
        self.writer
            .message(Topic::Transforms, pose.frame as u32, times, &self.buffer)
    }

    fn write_skeleton(&mut self, tree: &FoundTree, times: Times) -> Result<(), RecordingError> {
        match scene::skeleton_json(&tree.skeleton, tree.frame, tree.time_s, &mut self.buffer) {
            Ok(()) => self
                .writer
                .message(Topic::Skeleton, tree.frame as u32, times, &self.buffer),
            Err(_) => Ok(()),
        }
    }

    /// The times of the frame with this place in the capture, to the nanosecond those of its
    /// picture.
    fn times_of(&self, index: u64, time_s: f64) -> Option<Times> {
        let clock = self.clock?;
        let at = self.recent.partition_point(|(i, _)| *i < index);
        let known = self
            .recent
            .get(at)
            .filter(|(i, _)| *i == index)
            .map(|(_, ns)| *ns);
        // Its picture was not recorded, or long ago: by the time since the first.
        Some(
            clock
                .times(known.unwrap_or_else(|| clock.start_ns.saturating_add(nanoseconds(time_s)))),
        )
    }

    /// Closes the chunk and hands it to the system: from here on it survives the program.
    ///
    /// # Errors
    /// As for [`Series::frame`].
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.writer.flush()?;
        self.open_frames = 0;
        Ok(())
    }

    /// Ends the last file.
    ///
    /// # Errors
    /// As for [`Series::frame`].
    pub fn close(&mut self) -> Result<(), RecordingError> {
        self.writer.close()?;
        self.open_frames = 0;
        Ok(())
    }
}

/// `name.mcap`, `name-1.mcap`, `name-2.mcap`, …
fn numbered(base: &Path, part: u32) -> PathBuf {
    let stem = base
        .file_stem()
        .map(|s| s.to_string_lossy().into_owned())
        .unwrap_or_default();
    let ending = base
        .extension()
        .map(|e| format!(".{}", e.to_string_lossy()))
        .unwrap_or_default();
    base.with_file_name(format!("{stem}-{part}{ending}"))
}

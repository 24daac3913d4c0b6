//! The recorder's thread. It takes what it is offered out of a bounded queue; who offers never
//! waits for the disk while a camera films. What does not fit is counted, and the count
//! is reported.

use super::pulse::Worker;
use super::shared::{Failure, Shared};
use super::spawn::spawn;
use crate::model::{Outline, Pose, RawFrame, Skeleton, TrackSet};
use crate::recording::{Head, Limits, RecordingError, Series};
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// What may wait for the disk: as many entries, and as many bytes of pictures (some seconds of a
/// fast camera).
const QUEUE: usize = 512;
pub const QUEUE_BYTES: usize = 96 << 20;
/// What has been written for longer than this is handed to the system: a quarter of the second that
/// may be lost, the rest is for a machine that is busy.
const FLUSH_EVERY: Duration = Duration::from_millis(250);

/// A source that can wait looks again after so long.
const NAP: Duration = Duration::from_millis(2);

/// What is to be recorded, and where.
#[derive(Clone, Debug)]
pub struct RecordTo {
    /// First file; must not exist.
    pub path: PathBuf,
    pub limits: Limits,
    pub head: Head,
    /// Pictures that may wait for the disk, bytes; usually [`QUEUE_BYTES`].
    pub queue_bytes: usize,
}

enum Item {
    Frame(Arc<RawFrame>, u64),
    Result(Box<Found>),
}

/// What was found in a frame.
pub struct Found {
    pub tracks: TrackSet,
    pub outline: Arc<Outline>,
    pub pose: Option<(Arc<Pose>, Arc<Skeleton>)>,
}

/// The end of the queue into which frames and results are put.
#[derive(Clone)]
pub struct Recorder {
    queue: Sender<Item>,
    waiting: Arc<AtomicUsize>,
    queue_bytes: usize,
    shared: Arc<Shared>,
    /// A camera is not made to wait; a file is, and loses nothing.
    live: bool,
}

/// What was recorded.
#[derive(Clone, Debug, Default)]
pub struct Recorded {
    pub frames: u64,
    pub files: u32,
    pub bytes: u64,
    pub last: PathBuf,
    /// It ended before the frames did, e.g. on a full disk.
    pub stopped: bool,
}

/// Makes the file and starts the thread.
///
/// # Errors
/// There is a file of that name already, none can be made, or no thread can be started.
pub fn start(
    to: RecordTo,
    live: bool,
    shared: &Arc<Shared>,
) -> Result<(Recorder, JoinHandle<Recorded>), Failure> {
    let (recorder, thread, items) = two_ends(to, live, shared)?;
    let handle = spawn("record", move || thread.run(&items))?;
    shared.recording.store(true, Ordering::Relaxed);
    Ok((recorder, handle))
}

/// Makes the file; the two ends of the queue, before anybody takes out of it.
fn two_ends(
    to: RecordTo,
    live: bool,
    shared: &Arc<Shared>,
) -> Result<(Recorder, Thread, Receiver<Item>), RecordingError> {
    let series = Series::create(&to.path, to.head, to.limits, now_ns)?;
    let (queue, items) = bounded(QUEUE);
    let waiting = Arc::new(AtomicUsize::new(0));
    let recorder = Recorder {
        queue,
        waiting: waiting.clone(),
        queue_bytes: to.queue_bytes,
        shared: shared.clone(),
        live,
    };
    let thread = Thread {
        series,
        waiting,
        shared: shared.clone(),
        broken: false,
        oldest: None,
    };
    Ok((recorder, thread, items))
}

fn now_ns() -> u64 {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

impl Recorder {
    /// Whether there is no room for so many bytes more. What is larger than the whole queue is let
    /// in alone.
    fn is_full(&self, bytes: usize) -> bool {
        self.waiting.load(Ordering::Relaxed) + bytes > self.queue_bytes && !self.queue.is_empty()
    }

    /// Offers a frame with its place in the capture.
    pub fn offer(&self, raw: &Arc<RawFrame>, index: u64) {
        let bytes = raw.all_bytes();
        while !self.live && self.is_full(bytes) && !self.shared.stopped() {
            std::thread::sleep(NAP);
        }
        let refused = self.live && self.is_full(bytes);
        self.waiting.fetch_add(bytes, Ordering::Relaxed);
        self.shared.pulse.give(Worker::Record);
        if refused || !self.put(Item::Frame(raw.clone(), index)) {
            self.shared.pulse.take_back(Worker::Record);
            self.waiting.fetch_sub(bytes, Ordering::Relaxed);
            if self
                .shared
                .counts
                .not_recorded
                .fetch_add(1, Ordering::Relaxed)
                == 0
            {
                self.shared.warn(
                    "the recording does not keep up, frames are missing in it; see the count"
                        .into(),
                );
            }
        }
    }

    /// Offers what was found in a frame. It can be computed again; frames cannot, and go first.
    pub fn found(&self, found: impl FnOnce() -> Found) {
        if (self.live && self.queue.len() > QUEUE / 2) || !self.put(Item::Result(Box::new(found())))
        {
            self.shared
                .counts
                .results_not_recorded
                .fetch_add(1, Ordering::Relaxed);
        }
    }

    fn put(&self, item: Item) -> bool {
        if self.live {
            return self.queue.try_send(item).is_ok();
        }
        let mut item = item;
        loop {
            match self.queue.send_timeout(item, NAP) {
                Ok(()) => return true,
                Err(e) if e.is_disconnected() || self.shared.stopped() => return false,
                Err(e) => item = e.into_inner(),
            }
        }
    }
}

struct Thread {
    series: Series,
    waiting: Arc<AtomicUsize>,
    shared: Arc<Shared>,
    /// Nothing can be written any more. Frames are taken and counted all the same, until the
    /// capture ends.
    broken: bool,
    /// When the oldest thing was written that has not been handed to the system.
    oldest: Option<Instant>,
}

impl Thread {
    fn run(mut self, items: &Receiver<Item>) -> Recorded {
        loop {
            let wait = self.oldest.map_or(FLUSH_EVERY, |since| {
                FLUSH_EVERY.saturating_sub(since.elapsed())
            });
            match items.recv_timeout(wait) {
                Ok(item) => self.take(item),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if self.series.unflushed() == 0 {
                self.oldest = None;
            } else if self
                .oldest
                .is_some_and(|since| since.elapsed() >= FLUSH_EVERY)
            {
                let done = self.series.flush();
                self.note(done);
                self.oldest = None;
            }
        }
        let stopped = self.broken;
        if !self.broken {
            let done = self.series.close();
            self.note(done);
        }
        let last = self.series.path().to_owned();
        let frames = self.series.frames()
            - if stopped {
                self.series.open_frames()
            } else {
                0
            };
        Recorded {
            frames,
            files: self.series.files(),
            bytes: self.series.bytes(),
            last,
            stopped,
        }
    }

    fn take(&mut self, item: Item) {
        self.oldest.get_or_insert_with(Instant::now);
        match item {
            Item::Frame(raw, index) => {
                if self.series.frames() == 0
                    && let Some(at) = self.shared.origin().captured_at
                {
                    self.series.set_captured_at(at);
                }
                let done = if self.broken {
                    Ok(())
                } else {
                    self.series.frame(&raw, index)
                };
                let failed = self.broken || done.is_err();
                self.note(done);
                self.waiting.fetch_sub(raw.all_bytes(), Ordering::Relaxed);
                let counts = &self.shared.counts;
                let count = if failed {
                    &counts.not_recorded
                } else {
                    &counts.recorded
                };
                count.fetch_add(1, Ordering::Relaxed);
                self.shared.pulse.done(Worker::Record);
            }
            Item::Result(_) if self.broken => {
                self.shared
                    .counts
                    .results_not_recorded
                    .fetch_add(1, Ordering::Relaxed);
            }
            Item::Result(found) => {
                let Found {
                    tracks,
                    outline,
                    pose,
                } = *found;
                let mut done = self.series.tracks(&tracks, &outline);
                if let (Ok(()), Some((pose, skeleton))) = (&done, pose) {
                    done = self.series.pose(&pose, &skeleton);
                }
                self.note(done);
            }
        }
    }

    /// The first failure ends the recording, and is reported; the capture goes on.
    fn note(&mut self, done: Result<(), RecordingError>) {
        if let Err(e) = done
            && !std::mem::replace(&mut self.broken, true)
        {
            self.shared.recording_ended.store(true, Ordering::Relaxed);
            // What stood in the open chunk is cut off with it.
            let counts = &self.shared.counts;
            counts
                .recorded
                .fetch_sub(self.series.open_frames(), Ordering::Relaxed);
            counts
                .not_recorded
                .fetch_add(self.series.open_frames(), Ordering::Relaxed);
            self.shared.warn(e.to_string());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{PixelFormat, Size};
    use crate::recording::Reader;

    /// A camera is not made to wait for a disk that takes nothing for a while: what does not fit
    /// into the queue is missing, and every one is counted.
    #[test]
    fn what_finds_no_room_is_counted_and_the_rest_is_recorded() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("full.mcap");
        let size = Size::new(10, 10);
        let to = RecordTo {
            path: path.clone(),
            limits: Limits::default(),
            head: Head::default(),
            // Room for two.
            queue_bytes: 2 * size.area(),
        };
        let shared = Arc::new(Shared::default());
        let (recorder, thread, items) = two_ends(to, true, &shared).expect("a file");
        for index in 0..7 {
            let raw = RawFrame {
                sequence: Some(index),
                sensor_time_s: index as f64 / 30.0,
                size,
                format: PixelFormat::Grey,
                bytes: vec![index as u8; size.area()],
                depth: None,
            };
            recorder.offer(&Arc::new(raw), index);
        }
        drop(recorder);
        let recorded = thread.run(&items);
        assert_eq!((recorded.frames, recorded.stopped), (2, false));
        assert_eq!(shared.counts.not_recorded.load(Ordering::Relaxed), 5);
        let warnings = shared.warnings();
        assert!(
            warnings.len() == 1 && warnings[0].contains("does not keep up"),
            "{warnings:?}"
        );
        let mut reader = Reader::open(&path).expect("opened");
        assert_eq!(std::iter::from_fn(|| reader.next_picture()).count(), 2);
    }
}

//! Frames into a file and nothing else: source and recorder, without tracker and model.

use super::depth_camera::WithDepth;
use super::recorder_thread::{self, RecordTo, Recorded};
use super::shared::{Failure, Shared, StopAll};
use super::source_thread::{self, FRAME_QUEUE, Pace};
use super::spawn::spawn;
use super::watched::Watched;
use crate::config;
use crate::model::TimedFrame;
use crate::source::Source;
use crossbeam_channel::bounded;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;

/// What is to be recorded.
pub struct RecordJob {
    pub to: RecordTo,
    pub pace: Pace,
    pub camera: config::Camera,
}

/// A recording under way.
pub struct RunningRecord {
    shared: Arc<Shared>,
    source: JoinHandle<()>,
    drain: JoinHandle<()>,
    recording: JoinHandle<Recorded>,
}

/// Starts the threads.
///
/// # Errors
/// The file cannot be made, or a thread cannot be started.
pub fn record(mut source: Box<dyn Source>, job: RecordJob) -> Result<RunningRecord, Failure> {
    let depth = source.take_depth_camera();
    let source = Watched::if_live(source, job.camera.time_limit()).map_err(Failure::Thread)?;
    let shared = Arc::new(Shared::default());
    let source = WithDepth::if_there(source, depth, &job.camera, &shared)?;
    shared.set_origin(source.origin());
    let (recorder, recording) = recorder_thread::start(job.to, source.describe().live, &shared)?;
    let (frames_in, frames_out) = bounded::<TimedFrame>(FRAME_QUEUE);
    // Nobody looks at the frames; the source hands them on as ever.
    let drain = {
        let frames = frames_out.clone();
        spawn("drain", move || frames.iter().for_each(drop))?
    };
    let source = {
        let shared = shared.clone();
        let run = move || {
            let _ends_all = StopAll(&shared);
            let queue = source_thread::Queue {
                into: frames_in,
                out_of: frames_out,
            };
            let (pace, recorder) = (job.pace, Some(recorder));
            source_thread::run(source, pace, None, job.camera, queue, recorder, &shared);
        };
        spawn("source", run)?
    };
    Ok(RunningRecord {
        shared,
        source,
        drain,
        recording,
    })
}

impl RunningRecord {
    /// Take no more frames and end the file.
    pub fn stop(&self) {
        self.shared.stop.store(true, Ordering::Relaxed);
    }

    /// Lines that cannot wait for the end, since the last call.
    pub fn news(&self) -> Vec<String> {
        self.shared.take_news()
    }

    /// Nothing more can be written; there is no use in taking more frames.
    pub fn broken(&self) -> bool {
        self.shared.recording_ended.load(Ordering::Relaxed)
    }

    /// All is over.
    pub fn finished(&self) -> bool {
        self.recording.is_finished()
    }

    /// Frames seen and lost before us, sensor time from the first to the last, s, and frames
    /// missing in the recording.
    pub fn counts(&self) -> (u64, u64, f64, u64) {
        let counts = &self.shared.counts;
        (
            counts.seen.load(Ordering::Relaxed),
            counts.lost_in_camera.load(Ordering::Relaxed),
            self.shared.last_time_s(),
            counts.not_recorded.load(Ordering::Relaxed),
        )
    }

    /// What there is to be told so far.
    pub fn warnings(&self) -> Vec<String> {
        self.shared.warnings()
    }

    /// Waits for the end: what was recorded, and why it ended early if it did.
    pub fn join(self) -> (Option<Recorded>, Option<Failure>) {
        // A recorder that has died takes nothing more, and the source would go on for ever.
        self.stop();
        let ends = [self.source.join(), self.drain.join()];
        let recorded = self.recording.join().ok();
        if ends.iter().any(Result::is_err) || recorded.is_none() {
            self.shared.fail(Failure::Panicked);
        }
        (recorded, self.shared.take_failure())
    }
}

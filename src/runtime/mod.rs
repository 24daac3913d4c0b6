//! The pipeline on threads: source, tracker, model. Queues between them are bounded.
//!
//! ```text
//! depth camera --(8 images; newest kept)--> source, where there is one beside the camera
//! source --(4 frames; live: newest kept)--> track --(64 track sets)--> model --(newest state only)--> screen
//!        \--(512 entries, 96 MB; live: what does not fit is counted)--> record <--/
//! ```
//!
//! What no frame waits for, the model hands in to `background`, and where somebody looks to `sway`
//! (16 pieces each).
//!
//! A dropped sender ends the stream: when the source is done, the tracker works off its queue and
//! ends, then the model does and writes the capture.

mod announce;
mod asked;
mod background;
mod capture_tables;
mod depth_camera;
mod depth_scale;
mod finish;
mod first_picture;
mod job;
mod judge;
mod latest;
mod live_verdict;
mod losses;
mod meter;
mod model_thread;
mod nap;
mod one_frame;
mod parallel;
mod play;
mod pulse;
mod rate;
mod reconnect;
mod record;
mod recorder_thread;
mod refining;
mod shaking;
mod shared;
mod source_thread;
mod spawn;
mod status;
mod stream;
mod sway_watch;
mod swaying;
mod table_writer;
mod track_thread;
mod unfinished;
mod watched;

pub use asked::{Answer, Asked};
pub use depth_scale::scales_differ;
pub use finish::Written;
pub use job::{Job, Summary};
pub use one_frame::{FrameError, one_frame};
pub use parallel::{AtOnce, Undone, in_parallel};
pub use play::{Played, play};
pub use pulse::{Marks, Sign, Vigil};
pub use record::{RecordJob, RunningRecord, record};
pub use recorder_thread::{QUEUE_BYTES, RecordTo, Recorded};
pub use shared::Failure;
pub use source_thread::Pace;
pub use spawn::in_background;
pub use unfinished::{finish_unfinished, unfinished_dir};
pub use watched::open;

use crate::config::Config;
use crate::depth;
use crate::model::{Control, Origin, Outline, Snapshot};
use crate::outline::{Given, Scribbles};
use crate::pipeline::{DecodeStage, FrontEnd};
use crate::source::Source;
use background::Beside;
use crossbeam_channel::{Sender, bounded, unbounded};
use depth_camera::WithDepth;
use model_thread::ModelThread;
use shared::{Shared, StopAll};
use source_thread::FRAME_QUEUE;
use spawn::spawn;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use track_thread::TrackThread;
use watched::Watched;

/// Track sets that may wait for the model: two seconds at 30 a second, more than a build takes.
const MODEL_QUEUE: usize = 64;

/// A capture under way.
pub struct Running {
    shared: Arc<Shared>,
    controls: Sender<Control>,
    source: Option<JoinHandle<()>>,
    track: Option<JoinHandle<()>>,
    model: Option<JoinHandle<Summary>>,
}

/// Starts the threads.
///
/// # Errors
/// A thread cannot be started, there is no decoder, or the recording cannot be made.
pub fn start(mut source: Box<dyn Source>, mut job: Job) -> Result<Running, Failure> {
    let settings = &job.config.camera;
    let depth = source.take_depth_camera();
    let source = Watched::if_live(source, settings.time_limit()).map_err(Failure::Thread)?;
    let shared = Arc::new(Shared::default());
    let source = WithDepth::if_there(source, depth, settings, &shared)?;
    shared.set_origin(Origin {
        captured_at: source.origin().captured_at,
        notes: job.notes.clone(),
    });
    let info = source.describe();
    job.config.depth = depth::settings_of_run(&job.config.depth, info.depth.as_ref());
    let (frames_in, frames_out) = bounded(FRAME_QUEUE);
    let (model_in, model_out) = bounded(MODEL_QUEUE);
    // Wishes are typed by a person; they cannot pile up.
    let (controls, wishes) = unbounded();
    let (region, scribbles) = parted(job.outline.take());
    let mut decode = DecodeStage::new(info.live, job.preview_every).map_err(Failure::NoDecoder)?;
    decode.set_wants_colour(job.config.markers.are_wanted());
    let front = FrontEnd::new(&job.config, region);
    let (pace, length_s, camera) = (job.pace, job.length_s, job.config.camera.clone());

    let recording = match job.record.take() {
        Some(to) => Some(recorder_thread::start(to, info.live, &shared)?),
        None => None,
    };
    let beside = Beside::start(&job, &shared)?;
    let recorder = recording.as_ref().map(|(recorder, _)| recorder.clone());

    let model = {
        let model = ModelThread::new(job, info, shared.clone(), beside, recording);
        let on_end = shared.clone();
        let run = move || {
            let _ends_all = StopAll(&on_end);
            model.run(&model_out)
        };
        spawn("model", run)?
    };
    let track = {
        let (shared, frames_out) = (shared.clone(), frames_out.clone());
        let run = move || {
            let _ends_all = StopAll(&shared);
            TrackThread::new(decode, front, scribbles, model_in, &shared).run(&frames_out, &wishes);
        };
        spawn("track", run)?
    };
    let source = {
        let shared = shared.clone();
        let queue = source_thread::Queue {
            into: frames_in,
            out_of: frames_out,
        };
        let run = move || {
            source_thread::run(source, pace, length_s, camera, queue, recorder, &shared);
        };
        spawn("source", run)?
    };
    Ok(Running {
        shared,
        controls,
        source: Some(source),
        track: Some(track),
        model: Some(model),
    })
}

/// A region, or scribbles that have to be solved on a picture first.
fn parted(outline: Option<Given>) -> (Option<Outline>, Option<Scribbles>) {
    match outline {
        Some(Given::Region(region)) => (Some(region), None),
        Some(Given::Scribbles(scribbles)) => (None, Some(scribbles)),
        None => (None, None),
    }
}

impl Running {
    /// Newest state for the screen, `None` if there is none newer than the last one taken.
    pub fn latest(&self) -> Option<Arc<Snapshot>> {
        self.shared.screen.take()
    }

    /// Passes a wish on; pausing and quitting take effect at once, whatever the tracker is busy
    /// with.
    pub fn send(&self, wish: Control) {
        match wish {
            Control::Quit => self.stop(),
            Control::Pause(on) => self.shared.paused.store(on, Ordering::Relaxed),
            other => drop(self.controls.send(other)),
        }
    }

    /// Goes on with other settings; they may differ from the former ones in what can be changed
    /// while frames flow ([`Config::reload`] sees to that).
    pub fn reload(&self, config: Config) {
        self.shared.reload(config);
    }

    /// Take no more frames and finish, without waiting for what is not needed.
    pub fn stop(&self) {
        self.shared.stop_at_once();
    }

    /// Take no more frames and finish, as at the end of a film: as much as was wanted has been
    /// filmed, and nobody waits.
    pub fn end(&self) {
        self.shared.stop.store(true, Ordering::Relaxed);
    }

    /// The capture is over and written.
    pub fn finished(&self) -> bool {
        self.model.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// How far every thread has come, for a [`Vigil`].
    pub fn marks(&self) -> Marks {
        let over = self.source.as_ref().is_none_or(JoinHandle::is_finished);
        let ending = over || self.shared.stop.load(Ordering::Relaxed);
        self.shared
            .pulse
            .marks(self.shared.counts.seen.load(Ordering::Relaxed), ending)
    }

    /// What there is to be told since the last call, warnings among it. The screen shows it by
    /// itself.
    pub fn news(&self) -> Vec<String> {
        self.shared.take_news()
    }

    /// Tells something that only the screen knows.
    pub fn warn(&self, warning: &str) {
        self.shared.warn(warning.to_owned());
    }

    /// What there is to be told so far.
    pub fn warnings(&self) -> Vec<String> {
        self.shared.warnings()
    }

    /// Waits for the end: the result, and what went wrong on the way, if anything did. What had
    /// been captured until then is in the result all the same.
    pub fn join(mut self) -> (Option<Summary>, Option<Failure>) {
        let ends = [self.source.take(), self.track.take()];
        let panicked = ends
            .into_iter()
            .flatten()
            .any(|handle| handle.join().is_err());
        let summary = self.model.take().and_then(|handle| handle.join().ok());
        let panicked = panicked || self.shared.panicked.load(Ordering::Relaxed);
        if panicked || summary.is_none() {
            self.shared.fail(Failure::Panicked);
        }
        (summary, self.shared.take_failure())
    }
}

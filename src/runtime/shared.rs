//! What the threads of a capture have in common: flags, counts, warnings and the first failure.

use super::latest::Latest;
use super::pulse::Pulse;
use crate::config::Config;
use crate::files::WriteError;
use crate::markers::MarkerError;
use crate::model::{CameraState, DepthCameraState, Gap, LocalTime, Origin, Snapshot, Timing};
use crate::recording::RecordingError;
use crate::source::{ClockKind, DecodeError, SourceError};
use crate::views::PrepareError;
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// What is only made better by more time, or can be had from the capture afterwards, ends so long
/// after somebody asked for the end: everything else takes a second, and a service is killed if it
/// does not end. A film that ends by itself is not hurried: the same recording gives the same
/// capture however slow the machine is.
const ENDS_WITHIN: Duration = Duration::from_secs(5);

/// Warnings that are kept; the oldest give way.
const WARNINGS_KEPT: usize = 50;

/// Why a capture did not end as it should.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    #[error(transparent)]
    Source(SourceError),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error(transparent)]
    Document(#[from] PrepareError),
    #[error("cannot keep the tracks: {0}; free some space, or choose another disk with --out")]
    Log(std::io::Error),
    #[error("{} is there: a run that was cut; complete it with `arborcam finish`, or remove it", .dir.display())]
    UnfinishedIsThere { dir: PathBuf },
    #[error("there is nothing to finish: no {}", .dir.display())]
    NothingUnfinished { dir: PathBuf },
    #[error("{} is still being filmed; wait for its end", .dir.display())]
    StillFilming { dir: PathBuf },
    #[error("{} cannot be finished: {what}", .dir.display())]
    DamagedUnfinished { dir: PathBuf, what: String },
    /// The results could not be written; what was filmed is there.
    #[error("{why}; what was filmed is kept in {}: then run `arborcam finish {}`", .dir.display(), .out.display())]
    Kept {
        why: Box<Failure>,
        dir: PathBuf,
        out: PathBuf,
    },
    #[error("stopped before it was complete; what was filmed is still there")]
    Stopped,
    /// The recording could not be begun; one that breaks off later is a warning.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error("a thread cannot be started: {0}; close other programs")]
    Thread(std::io::Error),
    #[error("{0}")]
    NoDecoder(DecodeError),
    /// The pictures changed their size.
    #[error("frame {frame}: {error}")]
    Frame { frame: u64, error: DecodeError },
    #[error("--markers: {0}")]
    Markers(MarkerError),
    #[error("no frame could be decoded; the last error was: {0}")]
    NothingDecoded(DecodeError),
    #[error("a worker thread of the capture ended unexpectedly; please report this")]
    Panicked,
}

impl Failure {
    /// Whether it may go away by itself when there is room on the disk.
    pub fn is_full_disk(&self) -> bool {
        match self {
            Failure::Write(WriteError::DiskFull { .. }) => true,
            Failure::Log(e) => matches!(
                e.kind(),
                std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded
            ),
            _ => false,
        }
    }
}

/// Monotonic counts.
#[derive(Default)]
pub struct Counts {
    pub seen: AtomicU64,
    pub lost_in_camera: AtomicU64,
    pub dropped_before_tracker: AtomicU64,
    pub undecodable: AtomicU64,
    pub before_outline: AtomicU64,
    /// Frames in the recording, frames that should be in it and are not, and results of frames that
    /// are not.
    pub recorded: AtomicU64,
    pub not_recorded: AtomicU64,
    pub results_not_recorded: AtomicU64,
}

/// Shared by all threads of one capture.
#[derive(Default)]
pub struct Shared {
    /// Take no more frames, finish.
    pub stop: Arc<AtomicBool>,
    /// The user, or the service manager in his place, wants it over: what is not needed is not
    /// waited for.
    pub hurry: AtomicBool,
    pub paused: AtomicBool,
    pub ended: AtomicBool,
    /// The disk is full, and the capture is written when there is room.
    pub waits_for_room: AtomicBool,
    /// There is a recorder.
    pub recording: AtomicBool,
    /// It can write no more; frames are counted as missing from here on.
    pub recording_ended: AtomicBool,
    pub counts: Counts,
    pub pulse: Pulse,
    pub screen: Latest<Arc<Snapshot>>,
    /// Only the gaps in it are kept up to date; the rest is filled in when the capture is written.
    timing: Mutex<Timing>,
    warnings: Mutex<VecDeque<String>>,
    notice: Mutex<Notices>,
    failure: Mutex<Option<Failure>>,
    /// A piece of work in the background has panicked.
    pub panicked: AtomicBool,
    last_time_s: Mutex<f64>,
    origin: Mutex<Origin>,
    reloaded: Mutex<Reloaded>,
    camera: Mutex<CameraState>,
    news: Mutex<Vec<String>>,
}

/// Settings that came while the capture ran.
#[derive(Default)]
struct Reloaded {
    config: Option<Config>,
    /// The source has not taken them yet.
    is_new: bool,
}

impl Shared {
    /// The state that a run has left in its note.
    pub fn restored(timing: &Timing, warnings: &[String], origin: Origin) -> Self {
        let shared = Self::default();
        shared.set_origin(origin);
        let counts = &shared.counts;
        for (count, value) in [
            (&counts.seen, timing.frames_seen),
            (&counts.lost_in_camera, timing.frames_dropped_camera),
            (
                &counts.dropped_before_tracker,
                timing.frames_dropped_tracker,
            ),
            (&counts.undecodable, timing.frames_undecodable),
            (&counts.before_outline, timing.frames_before_outline),
            (&counts.not_recorded, timing.frames_not_recorded),
        ] {
            count.store(value, Ordering::Relaxed);
        }
        let clocks = ClockKind::ALL.map(ClockKind::name);
        shared.camera(|camera| {
            camera.lost_by_sequence = timing.frames_dropped_by_sequence;
            camera.lost_by_time = timing.frames_dropped_by_time;
            camera.damaged = timing.frames_damaged;
            camera.stale = timing.frames_stale;
            camera.reconnects = timing.reconnects;
            camera.away_s = timing.away_s;
            camera.depth = timing
                .depth
                .map(|counts| DepthCameraState { away: None, counts });
            camera.clock = clocks
                .into_iter()
                .find(|c| *c == timing.clock)
                .unwrap_or_default();
        });
        *shared
            .last_time_s
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = timing.duration_s;
        *shared.timing.lock().unwrap_or_else(PoisonError::into_inner) = timing.clone();
        warnings
            .iter()
            .for_each(|warning| shared.note(warning.clone()));
        shared
    }

    pub fn reload(&self, config: Config) {
        *self.reloaded.lock().unwrap_or_else(PoisonError::into_inner) = Reloaded {
            config: Some(config),
            is_new: true,
        };
    }

    /// The settings as they are now, where they are not those of the start.
    pub fn reloaded(&self) -> Option<Config> {
        self.reloaded
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .config
            .clone()
    }

    /// The same, once, for the source.
    pub fn newly_reloaded(&self) -> Option<Config> {
        let mut reloaded = self.reloaded.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut reloaded.is_new)
            .then(|| reloaded.config.clone())
            .flatten()
    }

    /// Whether [`newly_reloaded`](Self::newly_reloaded) has something to give.
    pub fn has_new_settings(&self) -> bool {
        self.reloaded
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .is_new
    }

    pub fn fail(&self, failure: Failure) {
        self.failure
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .get_or_insert(failure);
    }

    /// Whether what was asked for turned out wrong with the first frames.
    pub fn is_refused(&self) -> bool {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        matches!(*failure, Some(Failure::Markers(_)))
    }

    /// The capture could not be written: the user must read where it is. An earlier failure becomes
    /// a warning beside it.
    pub fn fail_at_end(&self, failure: Failure) {
        if let Some(earlier) = self.take_failure() {
            self.warn(earlier.to_string());
        }
        self.fail(failure);
    }

    pub fn take_failure(&self) -> Option<Failure> {
        self.failure
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take()
    }

    /// A piece of work in the background has panicked; the capture goes on without it.
    pub fn background_failed(&self) {
        if !self.panicked.swap(true, Ordering::Relaxed) {
            self.warn(Failure::Panicked.to_string());
        }
    }

    /// Tells at once, and keeps it for the capture.
    pub fn warn(&self, warning: String) {
        if self
            .warnings
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .back()
            != Some(&warning)
        {
            self.push_news(format!("warning: {warning}"));
        }
        self.note(warning);
    }

    /// Keeps for the capture what has been told already.
    pub fn note(&self, warning: String) {
        tracing::debug!("{warning}");
        let mut warnings = self.warnings.lock().unwrap_or_else(PoisonError::into_inner);
        if warnings.back() != Some(&warning) {
            if warnings.len() == WARNINGS_KEPT {
                warnings.pop_front();
            }
            warnings.push_back(warning);
        }
    }

    /// What was warned of has been made up for.
    pub fn withdraw(&self, warning: &str) {
        self.warnings
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .retain(|w| w != warning);
    }

    /// Shows a line on the screen that is no warning and does not go into the capture.
    pub fn tell(&self, line: String) {
        self.notice
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(line, false);
    }

    /// The same for the answer to a wish, which stays until the next one: what the capture tells of
    /// itself meanwhile must not take its place.
    pub fn answer(&self, line: String) {
        self.notice
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(line, true);
    }

    /// What the screen is to show: the warnings and the newest notices.
    pub fn messages(&self) -> Vec<String> {
        let notices = self
            .notice
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .0
            .clone();
        self.warnings()
            .into_iter()
            .chain(notices.into_iter().map(|(line, _)| line))
            .collect()
    }

    pub fn warnings(&self) -> Vec<String> {
        self.warnings
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .iter()
            .cloned()
            .collect()
    }

    pub fn gap(&self, gap: Gap) {
        self.timing
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push_gap(gap);
    }

    /// Changes what is known of the camera.
    pub fn camera(&self, change: impl FnOnce(&mut CameraState)) {
        change(&mut self.camera.lock().unwrap_or_else(PoisonError::into_inner));
    }

    pub fn camera_state(&self) -> CameraState {
        self.camera
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Tells at once, on the screen or without one, what cannot wait for the end.
    pub fn news(&self, line: String) {
        self.tell(line.clone());
        self.push_news(line);
    }

    fn push_news(&self, line: String) {
        let mut news = self.news.lock().unwrap_or_else(PoisonError::into_inner);
        if news.len() < WARNINGS_KEPT {
            news.push(line);
        }
    }

    pub fn take_news(&self) -> Vec<String> {
        std::mem::take(&mut self.news.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Whether no more frames are wanted.
    pub fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Ends the capture because somebody wants it.
    pub fn stop_at_once(&self) {
        self.hurry.store(true, Ordering::Relaxed);
        self.pulse.optional_work.cancel();
        self.pulse
            .closing_work
            .cancel_at(Instant::now() + ENDS_WITHIN);
        self.stop.store(true, Ordering::Relaxed);
    }

    /// The gaps so far, all else at its default.
    pub fn gaps(&self) -> Timing {
        self.timing
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Ends the capture for a reason; what has been captured until now is written.
    pub fn abort(&self, failure: Failure) {
        self.fail(failure);
        self.stop.store(true, Ordering::Relaxed);
    }

    pub fn frame_seen(&self, time_s: f64) {
        self.counts.seen.fetch_add(1, Ordering::Relaxed);
        *self
            .last_time_s
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = time_s;
    }

    /// When the film was made and what the user noted on it.
    pub fn origin(&self) -> Origin {
        self.origin
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    pub fn set_origin(&self, origin: Origin) {
        *self.origin.lock().unwrap_or_else(PoisonError::into_inner) = origin;
    }

    /// The first frame of a camera came now.
    pub fn begins_at(&self, now: LocalTime) {
        self.origin
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .captured_at = Some(now);
    }

    /// Sensor time of the newest frame, s since the first.
    pub fn last_time_s(&self) -> f64 {
        *self
            .last_time_s
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

/// The newest notice, and the newest answer to a wish if the user may not have read it yet; the
/// newest last.
#[derive(Debug, Default)]
struct Notices(Vec<(String, bool)>);

impl Notices {
    fn push(&mut self, line: String, answer: bool) {
        // An answer takes the place of all, another line that of others.
        self.0.retain(|(_, is_answer)| *is_answer && !answer);
        self.0.push((line, answer));
    }
}

/// Stops the source when the tracker or the model is done for, be it by a panic: the source holds
/// both ends of its queue, and would never learn otherwise that nobody takes from it.
pub struct StopAll<'a>(pub &'a Shared);

impl Drop for StopAll<'_> {
    fn drop(&mut self) {
        self.0.stop.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_answer_to_a_wish_outlives_what_the_capture_tells_of_itself() {
        let mut notices = Notices::default();
        let told = |notices: &Notices| {
            notices
                .0
                .iter()
                .map(|(line, _)| line.clone())
                .collect::<Vec<_>>()
                .join(", ")
        };
        for (line, answer, expected) in [
            ("cut out", false, "cut out"),
            ("written to a", true, "written to a"),
            ("refined", false, "written to a, refined"),
            ("refined again", false, "written to a, refined again"),
            ("written to b", true, "written to b"),
        ] {
            notices.push(line.into(), answer);
            assert_eq!(told(&notices), expected);
        }
    }
}

//! The source's own thread: takes frames, paces a replay, and hands them on. A camera is never made to wait: where the
//! tracker is late, the oldest waiting frame is dropped and counted.

use super::recorder_thread::Recorder;
use super::shared::{Failure, Shared};
use crate::model::{RawFrame, nanoseconds, seconds};
use crate::source::Source;
use crossbeam_channel::{Receiver, Sender, TrySendError};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// A raw frame with its place in this capture.
pub struct Timed {
    pub raw: Arc<RawFrame>,
    /// Frames since the first, losses before us included; seconds since the first, by the sensor.
    pub index: u64,
    pub time_s: f64,
    pub received: Instant,
}

/// How a source is worked off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// A camera: frames come when they come, and the newest matter.
    Live,
    /// A recording at its own pace; nothing is dropped.
    Recorded,
    /// A recording as fast as the machine allows; nothing is dropped.
    Fast,
}

/// A pause longer than this is waited for in pieces, so that a wish to stop is heard.
const NAP: Duration = Duration::from_millis(20);

/// Runs until the source ends or fails, or `shared.stop` is set. `queue_end` is the other end of `queue`, from which the
/// oldest frame is taken when a live source finds it full.
pub fn run(
    mut source: Box<dyn Source>,
    pace: Pace,
    (queue, queue_end): (Sender<Timed>, Receiver<Timed>),
    recorder: Option<Recorder>,
    shared: &Shared,
) {
    let mut clock = Clock::default();
    source.stop_when(shared.stop.clone());
    while !shared.stop.load(Ordering::Relaxed) {
        if pace != Pace::Live && shared.paused.load(Ordering::Relaxed) {
            std::thread::sleep(NAP);
            clock.pause();
            continue;
        }
        let raw = match source.next_frame() {
            Ok(Some(raw)) => raw,
            Ok(None) => break,
            Err(e) => {
                // Asked to stop meanwhile: that is the reason for the end, not a camera that fell silent.
                if !shared.stop.load(Ordering::Relaxed) {
                    shared.fail(Failure::Source(e));
                }
                break;
            }
        };
        let mut timed = clock.stamp(raw, shared);
        recorder.iter().for_each(|recorder| recorder.offer(&timed.raw, timed.index));
        if pace == Pace::Recorded {
            clock.wait_for(&timed, shared);
            timed.received = Instant::now();
        }
        if pace == Pace::Live {
            if shared.paused.load(Ordering::Relaxed) {
                shared.counts.dropped_before_tracker.fetch_add(1, Ordering::Relaxed);
                continue;
            }
            let mut timed = timed;
            while let Err(TrySendError::Full(again)) = queue.try_send(timed) {
                timed = again;
                if queue_end.try_recv().is_ok() {
                    shared.counts.dropped_before_tracker.fetch_add(1, Ordering::Relaxed);
                }
            }
        } else if !send_blocking(&queue, timed, shared) {
            break;
        }
    }
    for warning in source.warnings() {
        shared.warn(warning);
    }
}

/// Waits for room, but not beyond a wish to stop; `false` when the frame could not be handed on.
fn send_blocking(queue: &Sender<Timed>, mut timed: Timed, shared: &Shared) -> bool {
    loop {
        match queue.send_timeout(timed, NAP) {
            Ok(()) => return true,
            Err(e) if e.is_disconnected() || shared.stop.load(Ordering::Relaxed) => return false,
            Err(e) => timed = e.into_inner(),
        }
    }
}

/// Sequence numbers and sensor times relative to the first frame, and the pace of a replay.
#[derive(Default)]
struct Clock {
    first_time_s: Option<f64>,
    last: Option<(Option<u64>, u64, f64)>,
    /// Moment at which the time `time_s` was due.
    pace: Option<(Instant, f64)>,
}

impl Clock {
    fn stamp(&mut self, mut raw: RawFrame, shared: &Shared) -> Timed {
        // A recording keeps whole nanoseconds; what is worked with must be what is kept, whatever the source gave.
        raw.sensor_time_s = seconds(nanoseconds(raw.sensor_time_s));
        let time_s = raw.sensor_time_s - *self.first_time_s.get_or_insert(raw.sensor_time_s);
        let index = match self.last {
            None => 0,
            Some((sequence, index, last_s)) => {
                // Without a count nothing is known but that this is the next.
                let step = raw.sequence.zip(sequence).map_or(1, |(now, before)| now.saturating_sub(before).max(1));
                if step > 1 {
                    shared.gap(index, last_s, step - 1);
                }
                index + step
            }
        };
        self.last = Some((raw.sequence, index, time_s));
        shared.frame_seen(time_s);
        Timed { raw: Arc::new(raw), index, time_s, received: Instant::now() }
    }

    fn pause(&mut self) {
        self.pace = None;
    }

    fn wait_for(&mut self, timed: &Timed, shared: &Shared) {
        let (start, start_s) = *self.pace.get_or_insert((Instant::now(), timed.time_s));
        let due = start + Duration::from_secs_f64((timed.time_s - start_s).clamp(0.0, 1e6));
        while !shared.stop.load(Ordering::Relaxed) {
            let left = due.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            std::thread::sleep(left.min(NAP));
        }
    }
}

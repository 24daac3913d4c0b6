//! The source's own thread: takes frames, paces a replay, and hands them on. A camera is never made
//! to wait: where the tracker is late, the oldest waiting frame is dropped and counted. A camera
//! that is lost is waited for.

use super::losses::Losses;
use super::nap::{self, NAP};
use super::pulse::Worker;
use super::rate::RateWatch;
use super::reconnect::{self, Waited};
use super::recorder_thread::Recorder;
use super::shared::{Failure, Shared};
use crate::config;
use crate::model::{Gap, GapCause, LocalTime, RawFrame, TimedFrame, nanoseconds, seconds};
use crate::source::{Source, SourceError};
use crossbeam_channel::{Receiver, Sender, TrySendError};
use jiff::ZonedDateTime;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Frames that may wait for the tracker.
pub const FRAME_QUEUE: usize = 4;

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

/// Both ends of the queue to the tracker: where a live source finds it full, the oldest frame is
/// taken out again.
pub struct Queue {
    pub into: Sender<TimedFrame>,
    pub out_of: Receiver<TimedFrame>,
}

/// Runs until the source ends or fails for good, `length_s` of film have come, or `shared.stop` is
/// set.
pub fn run(
    mut source: Box<dyn Source>,
    pace: Pace,
    length_s: Option<f64>,
    mut camera: config::Camera,
    queue: Queue,
    recorder: Option<Recorder>,
    shared: &Shared,
) {
    let info = source.describe();
    source.stop_when(shared.stop.clone());
    let live = pace == Pace::Live;
    let mut feed = Feed {
        pace,
        is_camera: info.live,
        length_s: length_s.unwrap_or(f64::INFINITY),
        queue,
        recorder,
        shared,
        losses: Losses::new(live, info.nominal_rate_hz),
        rate: RateWatch::new(info.nominal_rate_hz.filter(|_| live)),
        first_time_s: None,
        last_frame: None,
        returned: None,
        broken: 0,
        due: None,
    };
    while let Err(lost) = feed.run_once(&mut *source, &mut camera) {
        if shared.stopped() {
            // Asked to stop meanwhile: that is the reason for the end, not a camera that fell
            // silent.
            break;
        }
        // One that never delivered is no camera that could come back.
        if !(live && camera.reconnect && source.returns() && feed.first_time_s.is_some()) {
            shared.fail(Failure::Source(lost));
            break;
        }
        feed.away(reconnect::cause(&lost));
        let failure = match reconnect::wait(&mut *source, &lost, &mut camera, feed.returned, shared)
        {
            Waited::Back(first) => {
                feed.back(first, &*source, &lost);
                continue;
            }
            Waited::Stopped => break,
            Waited::Unwanted => lost,
            Waited::Hopeless(e) => e,
        };
        shared.fail(Failure::Source(failure));
        break;
    }
    feed.end();
    for warning in source.warnings() {
        shared.warn(warning);
    }
}

/// Frames on their way from the source to the tracker.
struct Feed<'a> {
    pace: Pace,
    /// What it delivers is filmed now.
    is_camera: bool,
    /// The first frame that is so long after the first one of all is the last, s.
    length_s: f64,
    queue: Queue,
    recorder: Option<Recorder>,
    shared: &'a Shared,
    losses: Losses,
    rate: RateWatch,
    first_time_s: Option<f64>,
    /// When the last frame came, and when a source that was lost last came back.
    last_frame: Option<Instant>,
    returned: Option<Instant>,
    /// Frames of no use so far.
    broken: u64,
    /// Moment at which a time of the recording was due, and that time.
    due: Option<(Instant, f64)>,
}

impl Feed<'_> {
    /// Hands on what the source delivers until it ends or fails, or nothing further is wanted.
    fn run_once(
        &mut self,
        source: &mut dyn Source,
        camera: &mut config::Camera,
    ) -> Result<(), SourceError> {
        while !self.shared.stopped() {
            reconnect::adopt_new_settings(source, camera, self.shared);
            if self.pace != Pace::Live && self.shared.paused.load(Ordering::Relaxed) {
                std::thread::sleep(NAP);
                self.due = None;
                self.shared.pulse.waits();
                continue;
            }
            let next = source.next_frame();
            let Some(raw) = next? else { break };
            let timed = self.stamp(raw, source);
            if !self.hand_on(timed) {
                break;
            }
        }
        Ok(())
    }

    /// Gives a frame its place in the capture and counts what was lost before it.
    fn stamp(&mut self, mut raw: RawFrame, source: &dyn Source) -> TimedFrame {
        // A recording keeps whole nanoseconds; what is worked with must be what is kept, whatever
        // the source gave.
        raw.sensor_time_s = seconds(nanoseconds(raw.sensor_time_s));
        if self.is_camera && self.first_time_s.is_none() {
            self.shared.begins_at(LocalTime::from(ZonedDateTime::now()));
        }
        let first_s = *self.first_time_s.get_or_insert(raw.sensor_time_s);
        let time_s = raw.sensor_time_s - first_s;
        let health = source.health();
        let broken = (health.damaged + health.stale).saturating_sub(self.broken);
        self.broken += broken;
        let arrival = self.losses.arrived(raw.sequence, time_s, broken);
        self.note(&arrival.gaps);
        if let Some(line) = self.rate.look(time_s, self.losses.interval_s()) {
            self.shared.warn(line);
        }
        let rate_off = self.rate.is_off();
        self.shared.camera(|c| {
            (c.damaged, c.stale, c.clock, c.rate_off) =
                (health.damaged, health.stale, health.clock.name(), rate_off);
        });
        self.shared.frame_seen(time_s);
        let raw = Arc::new(raw);
        self.recorder
            .iter()
            .for_each(|recorder| recorder.offer(&raw, arrival.index));
        let timed = TimedFrame::new(raw, arrival.index, first_s, Instant::now());
        self.last_frame = Some(timed.received);
        timed
    }

    /// `false` when no further frame is wanted.
    fn hand_on(&mut self, timed: TimedFrame) -> bool {
        let is_last = timed.time_s >= self.length_s;
        self.give_to_tracker(timed) && !is_last
    }

    /// `false` when nobody takes frames any more.
    fn give_to_tracker(&mut self, mut timed: TimedFrame) -> bool {
        if self.pace == Pace::Recorded {
            self.wait_for(&timed);
            timed.received = Instant::now();
        }
        if self.pace != Pace::Live {
            return self.send_blocking(timed);
        }
        let dropped = &self.shared.counts.dropped_before_tracker;
        if self.shared.paused.load(Ordering::Relaxed) {
            dropped.fetch_add(1, Ordering::Relaxed);
            return true;
        }
        self.shared.pulse.give(Worker::Track);
        while let Err(TrySendError::Full(again)) = self.queue.into.try_send(timed) {
            timed = again;
            if self.queue.out_of.try_recv().is_ok() {
                self.shared.pulse.take_back(Worker::Track);
                dropped.fetch_add(1, Ordering::Relaxed);
            }
        }
        true
    }

    /// Waits for room, but not beyond a wish to stop; `false` when the frame could not be handed
    /// on.
    fn send_blocking(&self, mut timed: TimedFrame) -> bool {
        self.shared.pulse.give(Worker::Track);
        loop {
            match self.queue.into.send_timeout(timed, NAP) {
                Ok(()) => return true,
                Err(e) if e.is_disconnected() || self.shared.stopped() => return false,
                Err(e) => timed = e.into_inner(),
            }
        }
    }

    fn wait_for(&mut self, timed: &TimedFrame) {
        let (start, start_s) = *self.due.get_or_insert((Instant::now(), timed.time_s));
        let due = start + Duration::from_secs_f64((timed.time_s - start_s).clamp(0.0, 1e6));
        nap::until(due, &self.shared.stop);
    }

    fn away(&mut self, cause: GapCause) {
        let gaps = self.losses.away(cause);
        self.note(&gaps);
    }

    /// The first frame after an absence, which is kept as a warning as well: the result shows
    /// nothing of that time.
    fn back(&mut self, first: RawFrame, source: &dyn Source, lost: &SourceError) {
        let before_s = self.shared.last_time_s();
        self.returned = Some(Instant::now());
        let timed = self.stamp(first, source);
        let away_s = timed.time_s - before_s;
        self.shared.camera(|c| c.away_s += away_s);
        self.shared.note(format!(
            "the camera was away for {away_s:.1} s from {before_s:.1} s on ({})",
            lost.brief()
        ));
        self.hand_on(timed);
    }

    fn end(&mut self) {
        let mut gaps = self.losses.finish();
        // No frame says when an absence ended that lasts to the end: our own clock does.
        let away_s = self.last_frame.map_or(0.0, |at| at.elapsed().as_secs_f64());
        if let Some(gap) = self.losses.ended_away(away_s) {
            self.shared.camera(|c| c.away_at_end_s = away_s);
            gaps.push(gap);
        }
        self.note(&gaps);
    }

    fn note(&self, gaps: &[Gap]) {
        gaps.iter().for_each(|gap| self.shared.gap(*gap));
        let totals = self.losses.totals();
        self.shared
            .counts
            .lost_in_camera
            .store(totals.reconciled, Ordering::Relaxed);
        self.shared.camera(|c| {
            (c.lost_by_sequence, c.lost_by_time) = (totals.by_sequence, totals.by_time)
        });
    }
}

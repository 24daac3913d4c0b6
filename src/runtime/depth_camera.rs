//! A depth camera beside a camera, on a thread of its own. The camera never waits for it: a picture
//! gets the depth image of its time if that is there when the next pictures come, and goes on without
//! depth where the depth camera is lost or falls silent. That is said, and it is looked for again.

use super::losses::Losses;
use super::nap;
use super::shared::{Failure, Shared};
use super::spawn::spawn;
use super::watched::Watched;
use crate::config;
use crate::model::{DepthCameraState, DepthCounts, RawFrame, nanoseconds};
use crate::recording::Pairing;
use crate::source::{DepthTally, Health, Source, SourceError, SourceInfo};
use crossbeam_channel::{Receiver, Sender, TrySendError, bounded};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Depth images that may wait for their pictures: half a megabyte each at 640x400.
const DEPTH_QUEUE: usize = 8;
/// Time between two attempts to open a lost depth camera again.
const LOOK_EVERY: Duration = Duration::from_millis(500);
/// After so many pictures without any depth the clocks do not meet.
const NEVER_MET: u64 = 150;

/// A camera with a depth camera beside it.
pub struct WithDepth {
    camera: Box<dyn Source>,
    images: Receiver<RawFrame>,
    pairing: Pairing<RawFrame>,
    /// What was known of the camera's health when each of the pictures came that wait, and when the
    /// one came that was given out last.
    healths: VecDeque<Health>,
    health: Health,
    /// What came of the camera while pictures still waited.
    end: Option<Result<Option<RawFrame>, SourceError>>,
    is_there: Arc<AtomicBool>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    tally: DepthTally,
    given: u64,
    with_depth: u64,
    shared: Arc<Shared>,
}

impl WithDepth {
    /// The camera itself where none is beside it, else both.
    ///
    /// # Errors
    /// A thread cannot be started.
    pub fn if_there(
        camera: Box<dyn Source>,
        depth: Option<Box<dyn Source>>,
        settings: &config::Camera,
        shared: &Arc<Shared>,
    ) -> Result<Box<dyn Source>, Failure> {
        match depth {
            None => Ok(camera),
            Some(depth) => Ok(Box::new(Self::start(camera, depth, settings, shared)?)),
        }
    }

    fn start(
        camera: Box<dyn Source>,
        depth: Box<dyn Source>,
        settings: &config::Camera,
        shared: &Arc<Shared>,
    ) -> Result<Self, Failure> {
        shared.camera(|camera| camera.depth = Some(DepthCameraState::default()));
        let late_s = depth.describe().depth.map_or(0.0, |format| format.late_s);
        let mut depth = Watched::if_live(depth, settings.time_limit()).map_err(Failure::Thread)?;
        let stop = Arc::new(AtomicBool::new(false));
        depth.stop_when(stop.clone());
        let is_there = Arc::new(AtomicBool::new(true));
        let (into, images) = bounded(DEPTH_QUEUE);
        let reader = Reader {
            losses: Losses::new(true, depth.describe().nominal_rate_hz),
            depth,
            into,
            out_of: images.clone(),
            is_there: is_there.clone(),
            stop: stop.clone(),
            reconnects: settings.reconnect,
            first_s: None,
            broken: 0,
            shared: shared.clone(),
        };
        let thread = spawn("depth", move || reader.run())?;
        Ok(Self {
            camera,
            images,
            pairing: Pairing::late_by(late_s),
            healths: VecDeque::new(),
            health: Health::default(),
            end: None,
            is_there,
            stop,
            thread: Some(thread),
            tally: DepthTally::default(),
            given: 0,
            with_depth: 0,
            shared: shared.clone(),
        })
    }

    /// The oldest picture that waits, if its depth image is known or not to be had.
    fn ready(&mut self) -> Option<RawFrame> {
        for frame in self.images.try_iter() {
            if let Some(image) = frame.depth {
                self.pairing.depth(nanoseconds(frame.sensor_time_s), image);
            }
        }
        let nothing_comes = self.end.is_some() || !self.is_there.load(Ordering::Relaxed);
        match self.pairing.ready() {
            None if nothing_comes => self.pairing.oldest(),
            ready => ready,
        }
    }

    /// Counts a picture that is given out.
    fn count(&mut self, frame: &RawFrame) {
        self.health = self.healths.pop_front().unwrap_or(self.health);
        let has_depth = frame.depth.is_some();
        self.given += 1;
        self.with_depth += u64::from(has_depth);
        self.tally
            .frame(frame.sensor_time_s, frame.depth.as_deref());
        let counts = change(&self.shared, |counts| {
            counts.frames_without += u64::from(!has_depth);
        });
        if self.given == NEVER_MET && self.with_depth == 0 && counts.images >= NEVER_MET / 2 {
            self.shared.warn(
                "no depth image is of the time of a picture: the clocks of the two cameras do not \
                 meet, and depth is not used"
                    .to_owned(),
            );
        }
    }
}

/// Changes the counts of the depth camera, and gives them.
fn change(shared: &Shared, change: impl FnOnce(&mut DepthCounts)) -> DepthCounts {
    let mut counts = DepthCounts::default();
    shared.camera(|camera| {
        let depth = camera.depth.get_or_insert_default();
        change(&mut depth.counts);
        counts = depth.counts;
    });
    counts
}

impl Source for WithDepth {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        loop {
            if let Some(frame) = self.ready() {
                self.count(&frame);
                return Ok(Some(frame));
            }
            if let Some(end) = self.end.take() {
                return end;
            }
            match self.camera.next_frame() {
                Ok(Some(frame)) => {
                    self.healths.push_back(self.camera.health());
                    self.pairing.picture(frame);
                }
                end => self.end = Some(end),
            }
        }
    }

    fn describe(&self) -> SourceInfo {
        self.camera.describe()
    }

    fn wrapped(&self) -> Option<&dyn Source> {
        Some(&*self.camera)
    }

    fn wrapped_mut(&mut self) -> Option<&mut dyn Source> {
        Some(&mut *self.camera)
    }

    fn health(&self) -> Health {
        self.health
    }

    fn warnings(&mut self) -> Vec<String> {
        let mut lines = self.camera.warnings();
        let name = self.camera.describe().name;
        if self.with_depth > 0 {
            lines.extend(self.tally.take_warnings(&name));
        }
        lines
    }
}

impl Drop for WithDepth {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // It hears that soon: all calls to its driver are watched over.
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Reads the depth camera.
struct Reader {
    depth: Box<dyn Source>,
    /// Both ends of the queue: where it is full, the oldest image is taken out again.
    into: Sender<RawFrame>,
    out_of: Receiver<RawFrame>,
    is_there: Arc<AtomicBool>,
    stop: Arc<AtomicBool>,
    reconnects: bool,
    losses: Losses,
    first_s: Option<f64>,
    broken: u64,
    shared: Arc<Shared>,
}

impl Reader {
    fn run(mut self) {
        let mut next = self.depth.next_frame();
        while !self.is_over() {
            match next {
                Ok(Some(frame)) => self.hand_on(frame),
                Ok(None) => break,
                Err(lost) => {
                    next = self.wait_for_return(&lost);
                    continue;
                }
            }
            next = self.depth.next_frame();
        }
        self.is_there.store(false, Ordering::Relaxed);
    }

    fn is_over(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.shared.stopped()
    }

    fn hand_on(&mut self, frame: RawFrame) {
        let first_s = *self.first_s.get_or_insert(frame.sensor_time_s);
        let health = self.depth.health();
        let broken = (health.damaged + health.stale).saturating_sub(self.broken);
        self.broken += broken;
        let time_s = frame.sensor_time_s - first_s;
        self.losses.arrived(frame.sequence, time_s, broken);
        let mut dropped = 0;
        let mut waiting = frame;
        while let Err(TrySendError::Full(again)) = self.into.try_send(waiting) {
            waiting = again;
            dropped += u64::from(self.out_of.try_recv().is_ok());
        }
        let lost = self.losses.totals().reconciled + self.broken;
        change(&self.shared, |counts| {
            counts.images += 1;
            counts.images_lost = lost;
            counts.images_dropped += dropped;
        });
    }

    /// Goes on without depth until the depth camera delivers again; its first image, or `None` where
    /// it is not waited for any longer.
    fn wait_for_return(&mut self, lost: &SourceError) -> Result<Option<RawFrame>, SourceError> {
        if self.is_over() {
            return Ok(None);
        }
        self.is_there.store(false, Ordering::Relaxed);
        let since = Instant::now();
        self.say_lost(&lost.brief());
        while self.reconnects && self.depth.returns() {
            if !nap::until(Instant::now() + LOOK_EVERY, &self.stop) || self.is_over() {
                return Ok(None);
            }
            let back = self.depth.reopen().and_then(|()| self.depth.next_frame());
            let Ok(Some(first)) = back else { continue };
            self.shared.camera(|camera| {
                camera.depth.get_or_insert_default().away = None;
            });
            let away_s = since.elapsed().as_secs_f64();
            self.shared
                .news(format!("the depth camera is back after {away_s:.1} s"));
            self.is_there.store(true, Ordering::Relaxed);
            return Ok(Some(first));
        }
        Ok(None)
    }

    /// The first loss is kept as a warning, too.
    fn say_lost(&mut self, why: &str) {
        let counts = change(&self.shared, |counts| counts.absences += 1);
        self.shared.camera(|camera| {
            camera.depth.get_or_insert_default().away = Some(why.to_owned());
        });
        let at_s = self.shared.last_time_s();
        let line = format!(
            "the depth camera was lost at {at_s:.1} s ({why}); the capture goes on without depth"
        );
        match counts.absences {
            1 => self.shared.warn(line),
            _ => self.shared.news(line),
        }
    }
}

#[cfg(test)]
#[path = "tests/depth_camera.rs"]
mod tests;

//! The model's thread: runs the back end, keeps the tracks, streams the poses, tells the screen,
//! and writes the capture at the end.

use super::announce::Announced;
use super::behind::BehindTree;
use super::finish::{self, CaptureJob, Quality};
use super::pulse::Worker;
use super::recorder_thread::{Found, Recorded, Recorder};
use super::refining::Refining;
use super::shared::{Failure, Shared};
use super::status::{Status, median_error_px, median_fb_error_px};
use super::stream;
use super::sway_watch::SwayWatch;
use super::swaying::Ending;
use super::track_thread::ToModel;
use super::{Job, Pace, Summary};
use crate::model::{Phase, Picture, Pose, SwayNow};
use crate::pipeline::{BackEnd, Followed, LEAST_MOVING, Moved};
use crate::recording::Spool;
use crate::source::SourceInfo;
use crossbeam_channel::{Receiver, RecvTimeoutError};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time between two states for the screen.
const SCREEN_EVERY: Duration = Duration::from_millis(40);
/// Without frames the screen is shown a new state at this interval: a camera that is gone must be
/// seen to be.
const IDLE_EVERY: Duration = Duration::from_millis(200);
/// Film after which the tables of the capture are brought up to date, s.
const BEHIND_EVERY_S: f64 = 1.0;

/// State of the thread.
pub struct ModelThread {
    back: BackEnd,
    job: Job,
    info: SourceInfo,
    shared: Arc<Shared>,
    status: Status,
    spool: Option<Spool>,
    behind: BehindTree,
    refining: Refining,
    /// Only where somebody looks: a screen, or a reader of the stream.
    sway: Option<SwayWatch>,
    /// Sensor time up to which the tables have been asked for, s.
    behind_s: f64,
    picture: Option<Picture>,
    quality: Quality,
    last_screen: Option<Instant>,
    exports: Vec<JoinHandle<()>>,
    /// Number of the last export; its folder may not be there yet.
    exported: u32,
    announced: Announced,
    recorder: Option<(Recorder, JoinHandle<Recorded>)>,
}

impl ModelThread {
    pub fn new(
        job: Job,
        info: SourceInfo,
        shared: Arc<Shared>,
        recorder: Option<(Recorder, JoinHandle<Recorded>)>,
    ) -> Self {
        let status = Status::new(info.name.clone(), info.format.clone(), info.frames_total);
        let back = BackEnd::new(&job.config);
        let looked_at = job.stream.is_some() || job.preview_every < Duration::MAX;
        let sway = looked_at
            .then(|| SwayWatch::new(&job.config.dynamics, job.pace == Pace::Fast, shared.clone()));
        let mut thread = Self {
            back,
            job,
            info,
            shared,
            status,
            spool: None,
            behind: BehindTree::default(),
            refining: Refining::default(),
            sway,
            behind_s: f64::NEG_INFINITY,
            picture: None,
            quality: Quality::default(),
            last_screen: None,
            exports: Vec::new(),
            exported: 0,
            announced: Announced::default(),
            recorder,
        };
        thread.new_spool();
        if thread.job.out.is_none() {
            thread
                .shared
                .tell("no --out: nothing is written unless you press e".into());
        }
        thread
    }

    /// Runs until the tracker is done, then writes the capture.
    pub fn run(mut self, queue: &Receiver<ToModel>) -> Summary {
        let mut last: Option<Moved> = None;
        loop {
            let message = match queue.recv_timeout(IDLE_EVERY) {
                Ok(message) => message,
                Err(RecvTimeoutError::Timeout) => {
                    self.show(last.as_ref(), false);
                    continue;
                }
                Err(RecvTimeoutError::Disconnected) => break,
            };
            match message {
                ToModel::Picture(picture) => self.picture = Some(picture),
                ToModel::Followed(followed) => last = Some(self.step(followed)),
                ToModel::Searching {
                    progress,
                    preview,
                    size,
                    frame,
                    time_s,
                } => {
                    self.status
                        .searching(progress, preview, size, (frame, time_s));
                    self.show(None, false);
                }
                ToModel::Restart => {
                    self.back.restart();
                    self.status.restart();
                    std::mem::take(&mut self.behind).give_up();
                    self.refining = Refining::default();
                    self.sway.iter_mut().for_each(SwayWatch::restart);
                    self.behind_s = f64::NEG_INFINITY;
                    self.new_spool();
                    (self.quality, self.announced, last) =
                        (Quality::default(), Announced::default(), None);
                    self.picture = None;
                }
                ToModel::BuildNow if self.back.tree().is_some() => {
                    self.shared
                        .tell("the tree is built already; r starts again".into());
                }
                ToModel::BuildNow => {
                    self.back.build_now();
                    self.shared
                        .tell("building the tree from what has been seen so far".into());
                }
                ToModel::Export => self.export_now(),
            }
            self.shared.pulse.done(Worker::Model);
        }
        let swaying = self.sway.as_mut().map(SwayWatch::end);
        // Shown while the tree is finished and the capture is written.
        self.shared.ended.store(true, Ordering::Relaxed);
        self.show(last.as_ref(), true);
        // No frame is left that could need what is under way.
        self.refining = Refining::default();
        self.back.finish(&self.shared.pulse.optional_work);
        self.announce();
        self.show(None, true);
        let summary = self.finish();
        if swaying.is_some_and(Ending::panicked) {
            self.shared.fail(Failure::Panicked);
        }
        summary
    }

    fn step(&mut self, followed: Followed) -> Moved {
        let hurry = self.shared.hurry.load(Ordering::Relaxed);
        self.refining.hand_in(
            &mut self.back,
            followed.tracks.time_s,
            self.job.pace == Pace::Live,
            hurry,
        );
        let moved = self.back.step(followed);
        if !hurry {
            self.refining.begin(&self.back);
        }
        if let Some(spool) = &mut self.spool
            && let Err(e) = spool.push(&moved.tracks)
        {
            // What follows would be lost, and that ends the capture.
            self.shared.abort(Failure::Spool(e));
        }
        self.write_behind(moved.tracks.time_s);
        let tracks = &moved.tracks;
        self.quality
            .note(tracks, median_fb_error_px(tracks), median_error_px(tracks));
        if let Some((recorder, _)) = &self.recorder {
            recorder.found(|| Found {
                tracks: moved.tracks.clone(),
                outline: moved.outline.clone(),
                pose: moved
                    .pose
                    .clone()
                    .zip(self.back.tree().map(|tree| tree.skeleton.clone())),
            });
        }
        let sway = self
            .sway
            .as_mut()
            .and_then(|sway| sway.step(&moved, &self.back));
        if let Some(pose) = &moved.pose {
            self.stream(pose, sway.as_deref());
        }
        if self.back.take_refusal() {
            let moving = self.back.evidence().moving.len();
            self.shared.tell(format!(
                "no tree yet: {moving} points move, and {LEAST_MOVING} that agree must"
            ));
        }
        self.status.moved(&moved, &self.back);
        self.status.sways(sway);
        self.announce();
        self.show(Some(&moved), self.back.phase().0 == Phase::Build);
        moved
    }

    /// Has the tables of the capture written up to here, now and then.
    fn write_behind(&mut self, time_s: f64) {
        if time_s - self.behind_s < BEHIND_EVERY_S {
            return;
        }
        self.behind_s = time_s;
        let (Some(tree), Some(dir), Some(spool)) =
            (self.back.tree(), &self.job.out, &mut self.spool)
        else {
            return;
        };
        if let Ok(reader) = spool.reader() {
            let pictured = self.picture.as_ref().map(|p| p.frame);
            self.behind.catch_up(
                tree,
                reader,
                (dir, &self.job.config, pictured),
                &self.shared,
            );
        }
    }

    fn announce(&mut self) {
        if let Some(tree) = self.back.tree() {
            self.announced
                .tell(tree, self.job.config.accumulate.threshold, &self.shared);
        }
    }

    fn stream(&mut self, pose: &Pose, sway: Option<&SwayNow>) {
        let Some(out) = &mut self.job.stream else {
            return;
        };
        let Some(tree) = self.back.tree() else { return };
        let lost = self.info.live.then_some(&*self.shared);
        let line = stream::line(
            pose,
            &tree.skeleton,
            self.job.config.export.metres_per_px,
            sway,
            lost,
        );
        if let Err(e) = out.write_all(line.as_bytes()).and_then(|()| out.flush()) {
            // The reader has gone (`| head`): nobody listens any more, and that ends the capture in
            // good order.
            if e.kind() != std::io::ErrorKind::BrokenPipe {
                self.shared
                    .warn(format!("the stream of poses has ended: {e}"));
            }
            self.job.stream = None;
            self.shared.stop.store(true, Ordering::Relaxed);
        }
    }

    fn show(&mut self, moved: Option<&Moved>, at_once: bool) {
        if !at_once && self.last_screen.is_some_and(|t| t.elapsed() < SCREEN_EVERY) {
            return;
        }
        self.last_screen = Some(Instant::now());
        let snapshot = self
            .status
            .snapshot(moved, &self.back, self.sway.as_ref(), &self.shared);
        self.shared.screen.put(snapshot);
    }

    fn new_spool(&mut self) {
        let folder = self
            .job
            .out
            .as_deref()
            .and_then(nearest_folder)
            .unwrap_or_else(std::env::temp_dir);
        self.spool = match Spool::create(&folder) {
            Ok(spool) => Some(spool),
            Err(e) => {
                self.shared.abort(Failure::Spool(e));
                None
            }
        };
    }

    fn capture_job(&mut self) -> Result<CaptureJob, Failure> {
        let Some(spool) = &mut self.spool else {
            return Err(Failure::Spool(std::io::Error::other(
                "it could not be created",
            )));
        };
        Ok(CaptureJob {
            tree: self.back.tree().cloned(),
            outline: self.back.outline().cloned(),
            tracks: spool.reader().map_err(Failure::Spool)?,
            config: self
                .shared
                .reloaded()
                .unwrap_or_else(|| self.job.config.clone()),
            info: self.info.clone(),
            quality: self.quality.clone(),
            picture: self.picture.clone(),
            shared: self.shared.clone(),
        })
    }

    /// Writes the capture as it is now beside the final one, on a thread of its own: frames go on.
    fn export_now(&mut self) {
        let wanted = self
            .job
            .out
            .clone()
            .unwrap_or_else(|| PathBuf::from("capture"));
        let dir = free_name(&wanted, &mut self.exported);
        match self.capture_job() {
            Ok(job) => {
                let shared = self.shared.clone();
                let write = move || match finish::write(&job, &dir) {
                    Ok(_) => shared.answer(format!("capture written to {}", dir.display())),
                    Err(e) => shared.warn(e.to_string()),
                };
                match std::thread::Builder::new()
                    .name("export".into())
                    .spawn(write)
                {
                    Ok(handle) => self.exports.push(handle),
                    Err(e) => self.shared.warn(format!("export: {e}")),
                }
            }
            Err(e) => self.shared.warn(e.to_string()),
        }
    }

    fn finish(&mut self) -> Summary {
        // The source has gone; with this end of the queue the recorder works off what is left and
        // ends its file. Only then it is known what is missing in it.
        let recorded = self.recorder.take().and_then(|(recorder, thread)| {
            drop(recorder);
            thread.join().ok()
        });
        for export in self.exports.drain(..) {
            let _ = export.join();
        }
        // Without a single frame there is nothing to keep.
        let seen = self.shared.counts.seen.load(Ordering::Relaxed);
        let hurry = self.shared.hurry.load(Ordering::Relaxed);
        if !hurry {
            // A tree that was refined in the last second counts.
            self.write_behind(f64::INFINITY);
        }
        let behind = std::mem::take(&mut self.behind);
        let written = match (
            self.job.out.clone().filter(|_| seen > 0),
            self.capture_job(),
        ) {
            (Some(dir), Ok(job)) => match behind.join(hurry).map_or_else(
                || finish::write(&job, &dir),
                |tables| finish::complete(&job, tables),
            ) {
                Ok(written) => Some(written),
                Err(e) => {
                    self.shared.fail(e);
                    None
                }
            },
            (Some(_), Err(e)) => {
                self.shared.fail(e);
                None
            }
            (None, _) => None,
        };
        Summary {
            frames: seen,
            tracks_total: self.quality.tracks_total(),
            moving: self.back.evidence().moving.len(),
            accumulation: self.back.evidence().measure,
            // The one that is in the folder, where there is a folder.
            tree: written
                .as_ref()
                .map_or_else(|| self.back.tree().cloned(), |w| w.tree.clone()),
            written,
            recorded,
            not_recorded: self.shared.counts.not_recorded.load(Ordering::Relaxed),
        }
    }
}

/// The folder in which `path` will lie, if it is there already, else the nearest one above it that
/// is.
fn nearest_folder(path: &Path) -> Option<PathBuf> {
    let absolute = std::path::absolute(path).ok()?;
    absolute
        .ancestors()
        .skip(1)
        .find(|a| a.is_dir())
        .map(Path::to_path_buf)
}

/// `wanted-1`, `wanted-2`, ...: the first after number `last` that is not there yet; `last` becomes
/// its number.
fn free_name(wanted: &Path, last: &mut u32) -> PathBuf {
    loop {
        *last += 1;
        let numbered = PathBuf::from(format!("{}-{last}", wanted.display()));
        if !numbered.exists() {
            return numbered;
        }
    }
}

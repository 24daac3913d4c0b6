//! The model's thread: runs the back end, keeps the tracks, streams the poses, tells the screen,
//! and writes the capture at the end.

use super::announce::Announced;
use super::background::{Background, Beside, Pending};
use super::capture_tables::CaptureTables;
use super::depth_scale::{doubt_of_depth, take_scale_of_depth};
use super::finish::{self, CaptureJob, Quality, Written};
use super::job::{Job, Summary};
use super::judge::judge;
use super::live_verdict::LiveVerdict;
use super::pulse::Worker;
use super::recorder_thread::{Found, Recorded, Recorder};
use super::refining::Refining;
use super::shared::{Failure, Shared};
use super::source_thread::Pace;
use super::status::{Status, median_error_px, median_fb_error_px};
use super::stream;
use super::sway_watch::SwayWatch;
use super::table_writer::TableWriter;
use super::track_thread::ToModel;
use super::unfinished::Unfinished;
use crate::cancel::CancelToken;
use crate::config::{Config, MarkerWindow};
use crate::dynamics::Take;
use crate::model::{CaptureFacts, Phase, Picture, Pose, SwayNow, TagScale, Verdict};
use crate::pipeline::{BackEnd, Followed, Moved};
use crate::recording::TrackFile;
use crate::solve::{LEAST_MOVING, Model};
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
const TABLES_EVERY_S: f64 = 1.0;

/// For so long a disk that is full is tried again, and at this interval.
const FULL_DISK_FOR: Duration = Duration::from_secs(20);
const FULL_DISK_EVERY: Duration = Duration::from_millis(500);

/// The warning where the end came before the wood was looked for with what the user drew.
const STROKES_TOO_LATE: &str = "the line along a branch that was drawn or taken back last came too \
                                late: the end was wanted before the wood was looked for again";

/// State of the thread.
pub struct ModelThread {
    back: BackEnd,
    job: Job,
    info: SourceInfo,
    shared: Arc<Shared>,
    background: Background,
    status: Status,
    /// The track log on disk, in the folder of the unfinished capture if there will be one.
    file: Option<TrackFile>,
    unfinished: Option<Unfinished>,
    tables: Option<TableWriter>,
    refining: Refining,
    /// Only where somebody looks: a screen, or a reader of the stream.
    sway: Option<SwayWatch>,
    verdict: LiveVerdict,
    /// Sensor time up to which the tables have been asked for, s.
    tables_s: f64,
    picture: Option<Picture>,
    tag: Option<TagScale>,
    quality: Quality,
    last_screen: Option<Instant>,
    export: Option<Pending<()>>,
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
        beside: Beside,
        recorder: Option<(Recorder, JoinHandle<Recorded>)>,
    ) -> Self {
        let status = Status::new(&info);
        let back = BackEnd::new(&job.config);
        let Beside { background, sway } = beside;
        let waits = job.pace == Pace::Fast;
        let sway =
            sway.map(|sway| SwayWatch::new(&job.config.dynamics, waits, sway, shared.clone()));
        let refining = Refining::new(background.clone(), shared.clone());
        let mut thread = Self {
            back,
            job,
            info,
            shared,
            background,
            status,
            file: None,
            unfinished: None,
            tables: None,
            refining,
            sway,
            verdict: LiveVerdict::default(),
            tables_s: f64::NEG_INFINITY,
            picture: None,
            tag: None,
            quality: Quality::default(),
            last_screen: None,
            export: None,
            exported: 0,
            announced: Announced::default(),
            recorder,
        };
        thread.new_log();
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
                    self.keep();
                    self.show(last.as_ref(), false);
                    continue;
                }
                Err(RecvTimeoutError::Disconnected) => break,
            };
            self.handle(message, &mut last);
            self.shared.pulse.done(Worker::Model);
        }
        self.end(last.as_ref())
    }

    /// Takes a message of the tracker; `last` is the newest frame that was posed.
    fn handle(&mut self, message: ToModel, last: &mut Option<Moved>) {
        match message {
            ToModel::Picture(picture) => {
                self.verdict.see(&picture);
                self.picture = Some(picture);
            }
            ToModel::Tag(scale) => self.take_tag(scale),
            ToModel::NoTag => self.job.config.tag.size_m = 0.0,
            ToModel::Markers(markers) => self.take_markers(markers),
            ToModel::Followed(followed) => *last = Some(self.step(followed)),
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
                self.restart();
                *last = None;
            }
            ToModel::AddStroke(stroke_px) => match self.back.add_stroke(stroke_px) {
                Ok(()) => self.strokes_changed(),
                Err(e) => self.shared.warn(e.to_string()),
            },
            ToModel::TakeBackStroke if self.back.take_back_stroke() => self.strokes_changed(),
            ToModel::TakeBackStroke => self.shared.tell("there is no line to take back".into()),
            ToModel::BuildNow if self.back.model().is_some() => {
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
    }

    /// A tag gives the scale: the first sights fix it for the whole capture, whose files have one unit.
    fn take_tag(&mut self, scale: TagScale) {
        if self.tag.is_none() && self.job.config.tag.size_m > 0.0 {
            self.job.config.export.metres_per_px = scale.metres_per_px;
        }
        self.tag = Some(scale);
    }

    fn take_scale_of_depth(&mut self) {
        let said = take_scale_of_depth(&mut self.job.config, self.back.model().map(|m| &**m));
        if let Some(said) = said {
            self.shared.tell(said);
        }
    }

    /// Markers were found, picked, or hung on each other: the capture is to name them.
    fn take_markers(&mut self, markers: Vec<MarkerWindow>) {
        let n = markers.len();
        let before = &self.job.config.markers.windows;
        // Where others have become parents, that has been said.
        if n != before.len() || markers == *before {
            self.shared.tell(match n {
                1 => "1 marker is followed".to_owned(),
                n => format!("{n} markers are followed"),
            });
        }
        self.job.config.markers.windows = markers;
    }

    /// The user has drawn a line along a branch, or taken one back.
    fn strokes_changed(&mut self) {
        if self.job.config.skeleton.along_wood {
            // What is being worked out is without it.
            self.refining.give_up();
        }
        let lines = match self.back.strokes_px().len() {
            0 => "no line along a branch".to_owned(),
            1 => "1 line along a branch".to_owned(),
            n => format!("{n} lines along branches"),
        };
        self.shared.tell(
            match (self.job.config.skeleton.along_wood, self.back.model()) {
                (false, _) => format!("{lines}; not used: skeleton.along_wood is false"),
                (true, None) => format!("{lines}; the wood is looked for with the tree"),
                (true, Some(_)) => {
                    format!("{lines}; the wood is looked for again with the next frames")
                }
            },
        );
    }

    /// Forgets tracks and tree.
    fn restart(&mut self) {
        self.back.restart();
        self.status.restart();
        self.tables = None;
        self.refining.give_up();
        if let Some(sway) = &mut self.sway {
            sway.restart();
        }
        self.verdict.restart();
        self.tables_s = f64::NEG_INFINITY;
        self.new_log();
        self.quality = Quality::default();
        self.announced.restart(&self.shared);
        self.picture = None;
    }

    /// No more frames: finishes the tree and writes the capture.
    fn end(mut self, last: Option<&Moved>) -> Summary {
        if let Some(sway) = &mut self.sway {
            sway.end();
        }
        // Shown while the tree is finished and the capture is written.
        self.shared.ended.store(true, Ordering::Relaxed);
        self.show(last, true);
        // No frame is left that could need what is under way.
        self.refining.give_up();
        self.back.finish(&self.shared.pulse.optional_work);
        self.take_scale_of_depth();
        let model = self.back.model().map(|model| &**model);
        if let Some(doubt) = doubt_of_depth(&self.job.config, model) {
            self.shared.warn(doubt);
        }
        if self.back.has_unused_strokes() {
            self.shared.warn(STROKES_TOO_LATE.into());
        }
        self.announce();
        self.show(None, true);
        self.finish()
    }

    fn step(&mut self, followed: Followed) -> Moved {
        let hurry = self.shared.hurry.load(Ordering::Relaxed);
        self.refining.hand_in(
            &mut self.back,
            followed.tracks.time_s,
            self.job.pace == Pace::Live,
        );
        let moved = self.back.step(followed);
        self.take_scale_of_depth();
        if !hurry {
            self.refining.begin(&self.back);
        }
        if let Some(file) = &mut self.file
            && let Err(e) = file.push(&moved.tracks)
        {
            // What follows would be lost, and that ends the capture.
            self.shared.abort(Failure::Log(e));
        }
        self.keep();
        self.write_tables(moved.tracks.time_s);
        let tracks = &moved.tracks;
        if self.quality.frames() == 0 {
            self.quality = Quality::from_now(&self.shared.camera_state());
        }
        self.quality
            .note(tracks, median_fb_error_px(tracks), median_error_px(tracks));
        self.announced
            .tell_of_camera(tracks, self.quality.shaking(), &self.shared);
        self.status.shakes(self.quality.shaking().newest());
        if let Some((recorder, _)) = &self.recorder {
            recorder.found(|| Found {
                tracks: moved.tracks.clone(),
                outline: moved.outline.clone(),
                pose: moved
                    .pose
                    .clone()
                    .zip(self.back.model().map(|tree| tree.skeleton.clone())),
            });
        }
        let sway = self
            .sway
            .as_mut()
            .and_then(|sway| sway.step(&moved, &self.back));
        self.verdict.take_sway(sway.clone());
        self.verdict.step(
            &self.quality,
            &self.back,
            &self.job.config.dynamics,
            &self.shared.camera_state(),
        );
        if let Some(pose) = &moved.pose {
            self.stream(pose, sway.as_deref());
        }
        if self.back.take_refusal() {
            let moving = self.back.evidence().moving.len();
            self.shared.tell(format!(
                "no tree yet: {moving} points move, and {LEAST_MOVING} that agree must"
            ));
        }
        self.status.moved(&moved, &self.back, &self.verdict);
        self.status.sways(sway);
        self.announce();
        self.show(Some(&moved), self.back.phase().0 == Phase::Build);
        moved
    }

    /// Has the tables of the capture written up to here, now and then, once there is a model.
    fn write_tables(&mut self, time_s: f64) {
        if time_s - self.tables_s < TABLES_EVERY_S {
            return;
        }
        self.tables_s = time_s;
        let Some(model) = self.back.model().cloned() else {
            return;
        };
        // Those of a model that was replaced are discarded.
        self.tables = self.tables.take().filter(|tables| tables.is_of(&model));
        if self.tables.is_none() {
            self.tables = self.begin_tables(&model);
        }
        if let (Some(tables), Some(Ok(log))) =
            (&mut self.tables, self.file.as_mut().map(TrackFile::reader))
        {
            tables.catch_up(log);
        }
    }

    /// `None` where they cannot be begun; the end will say why.
    fn begin_tables(&self, model: &Arc<Model>) -> Option<TableWriter> {
        let dir = self.job.out.as_ref()?;
        let pictured = self.picture.as_ref().map(|p| p.frame);
        let tables = CaptureTables::create(dir, model, &self.job.config, pictured).ok()?;
        let background = self.background.clone();
        Some(TableWriter::new(
            tables,
            model,
            background,
            self.shared.clone(),
        ))
    }

    fn announce(&mut self) {
        if let Some(tree) = self.back.model() {
            self.announced
                .tell(tree, self.job.config.accumulate.threshold, &self.shared);
            let ended = self.shared.ended.load(Ordering::Relaxed);
            self.announced
                .tell_of_wood(self.back.wood_sight(), ended, &self.shared);
        }
    }

    fn stream(&mut self, pose: &Pose, sway: Option<&SwayNow>) {
        let Some(out) = &mut self.job.stream else {
            return;
        };
        let Some(tree) = self.back.model() else {
            return;
        };
        let verdict = self.verdict.take_unsaid();
        let line = stream::line(
            pose,
            &tree.skeleton,
            self.job.config.export.metres_per_px,
            &stream::Beside {
                sway,
                verdict: verdict.as_deref(),
                lost: self.info.live.then_some(&*self.shared),
            },
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

    fn new_log(&mut self) {
        match self.opened_log() {
            Ok(file) => self.file = Some(file),
            Err(e) => {
                self.file = None;
                self.shared.abort(e);
            }
        }
    }

    fn opened_log(&mut self) -> Result<TrackFile, Failure> {
        if let Some(unfinished) = &mut self.unfinished {
            return unfinished.restart();
        }
        let Some(out) = &self.job.out else {
            return TrackFile::nameless(&std::env::temp_dir()).map_err(Failure::Log);
        };
        let (unfinished, file) = Unfinished::create(out)?;
        self.unfinished = Some(unfinished);
        Ok(file)
    }

    /// Brings to disk what a crash would lose, now and then.
    fn keep(&mut self) {
        if self.unfinished.as_ref().is_none_or(|u| !u.is_due()) {
            return;
        }
        let kept = self.capture_job().and_then(|job| {
            let tables_bytes = self.tables.as_ref().map_or(0, TableWriter::bytes);
            match &mut self.unfinished {
                Some(unfinished) => unfinished.keep(&job, tables_bytes),
                None => Ok(()),
            }
        });
        if let Err(e) = kept {
            // What follows would be lost, or could not be written; that ends the capture.
            self.shared.abort(e);
        }
    }

    fn capture_job(&mut self) -> Result<CaptureJob, Failure> {
        let Some(file) = &mut self.file else {
            return Err(Failure::Log(std::io::Error::other(
                "it could not be created",
            )));
        };
        Ok(CaptureJob {
            tree: self.back.model().cloned(),
            outline: self.back.outline().cloned(),
            tracks: file.reader().map_err(Failure::Log)?,
            log: self.back.log().clone(),
            wood: self.back.wood().clone(),
            asked: self.back.asked().clone(),
            config: self.effective_config(),
            info: self.info.clone(),
            quality: self.quality.clone(),
            picture: self.picture.clone(),
            tag: self.tag,
            shared: self.shared.clone(),
        })
    }

    /// The settings as they are by now: reloaded, and with what the user drew.
    fn effective_config(&self) -> Config {
        let reloaded = self.shared.reloaded();
        let mut config = reloaded.unwrap_or_else(|| self.job.config.clone());
        config.export.metres_per_px = self.job.config.export.metres_per_px;
        config.markers.windows = self.job.config.markers.windows.clone();
        config.tag.size_m = self.job.config.tag.size_m;
        config.depth = self.job.config.depth.clone();
        config.skeleton.strokes_px = self.back.strokes_px().to_vec();
        config
    }

    /// Writes the capture as it is now beside the final one, in the background: frames go on.
    fn export_now(&mut self) {
        if self.export.as_ref().is_some_and(Pending::is_under_way) {
            self.shared
                .tell("the last export is still being written; press e again after it".into());
            return;
        }
        let wanted = self
            .job
            .out
            .clone()
            .unwrap_or_else(|| PathBuf::from("capture"));
        let dir = free_name(&wanted, &mut self.exported);
        match self.capture_job() {
            Ok(job) => {
                let shared = self.shared.clone();
                let write = move |_: &CancelToken| match finish::write(&job, &dir) {
                    Ok(_) => shared.answer(format!("capture written to {}", dir.display())),
                    Err(e) => shared.warn(e.to_string()),
                };
                self.export = self.background.begin(CancelToken::new(), write);
            }
            Err(e) => self.shared.warn(e.to_string()),
        }
    }

    /// Writes the capture; if that cannot be done, what was filmed is kept.
    fn write_capture(&mut self, out: &Path) -> Result<Written, Failure> {
        let written = self.try_to_write(out);
        let Some(unfinished) = self.unfinished.take() else {
            return written;
        };
        match written {
            Ok(written) => {
                unfinished.remove();
                Ok(written)
            }
            Err(why) => Err(Failure::Kept {
                why: Box::new(why),
                dir: unfinished.dir().to_owned(),
                out: out.to_owned(),
            }),
        }
    }

    /// Writes the capture. A disk that is full is tried again for a while.
    fn try_to_write(&mut self, out: &Path) -> Result<Written, Failure> {
        if let Some(unfinished) = &mut self.unfinished {
            unfinished.release_space();
        }
        let until = Instant::now() + FULL_DISK_FOR;
        loop {
            let written = self.write_once(out);
            let is_full = matches!(&written, Err(e) if e.is_full_disk());
            self.shared.waits_for_room.store(is_full, Ordering::Relaxed);
            if !is_full || Instant::now() >= until {
                return written;
            }
            self.shared
                .warn("the disk is full; the capture is written when there is room".into());
            self.shared.pulse.wrote();
            self.show(None, true);
            std::thread::sleep(FULL_DISK_EVERY);
        }
    }

    /// Writes the capture, from the tables as far as they have come.
    fn write_once(&mut self, out: &Path) -> Result<Written, Failure> {
        let job = self.capture_job()?;
        if let Some(unfinished) = &mut self.unfinished {
            unfinished.keep_wood(&job)?;
        }
        let is_current =
            |tables: &TableWriter| job.tree.as_ref().is_some_and(|model| tables.is_of(model));
        let tables = self.tables.take().filter(is_current);
        match tables.and_then(TableWriter::into_tables) {
            Some(tables) => finish::complete(&job, tables),
            None => finish::write(&job, out),
        }
    }

    /// What a capture is worth of which nothing was written. As the sway is analysed anew for the
    /// files only, it is judged by the newest answer from while it was filmed, if there is one.
    fn verdict_unwritten(&mut self) -> Option<Verdict> {
        let job = self.capture_job().ok()?;
        if self.shared.counts.seen.load(Ordering::Relaxed) == 0 {
            return None;
        }
        let tree = job.tree.as_deref();
        let judged = judge(&job, tree, &Take::default()).facts;
        let sway = tree.and_then(|tree| self.verdict.sway_facts(tree));
        Some(Verdict::of(&CaptureFacts { sway, ..judged }))
    }

    fn finish(&mut self) -> Summary {
        // The source has gone; with this end of the queue the recorder works off what is left and
        // ends its file. Only then it is known what is missing in it.
        let recorded = self.recorder.take().and_then(|(recorder, thread)| {
            drop(recorder);
            thread.join().ok()
        });
        if let Some(export) = self.export.take() {
            export.wait();
        }
        let seen = self.shared.counts.seen.load(Ordering::Relaxed);
        let written = match self.job.out.clone() {
            Some(out) if seen > 0 && self.file.is_some() && !self.shared.is_refused() => self
                .write_capture(&out)
                .map_err(|e| self.shared.fail_at_end(e))
                .ok(),
            // Without a single frame, or without a log, there is nothing to keep, nor of what was asked for in vain.
            _ => {
                if let Some(unfinished) = self.unfinished.take() {
                    unfinished.remove();
                }
                None
            }
        };
        let verdict = match &written {
            Some(written) => Some(written.verdict.clone()),
            None => self.verdict_unwritten(),
        };
        Summary {
            verdict,
            frames: seen,
            tracks_total: self.quality.tracks_total(),
            moving: self.back.evidence().moving.len(),
            accumulation: self.back.evidence().measure,
            // The one that is in the folder, where there is a folder.
            tree: written
                .as_ref()
                .map_or_else(|| self.back.model().cloned(), |w| w.tree.clone()),
            written,
            recorded,
            not_recorded: self.shared.counts.not_recorded.load(Ordering::Relaxed),
        }
    }
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

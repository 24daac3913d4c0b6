//! Writes a capture: the files of the contract, from the tracks on disk and the tree.

use super::announce::little_motion;
use super::capture_tables::{CaptureTables, Done};
use super::judge::{FilmLength, judge};
use super::meter::Histogram;
use super::parallel::beside;
use super::shaking::ShakeMeter;
use super::shared::{Failure, Shared};
use crate::config::Config;
use crate::depth;
use crate::document::note::{
    BarkNote, Build, MasksNote, ModelNote, OutlineNote, PictureNote, Quality as QualityNote,
    Refinement, Software, Source, json,
};
use crate::document::{
    BARK_FILE, CAMERA_FILE, CameraCsv, CaptureNote, DepthNote, Document, LEAVES_MASK_FILE,
    MotionCsv, PICTURE_FILE, REST_FILE, SCHEMA_VERSION, TracksCsv, WOOD_MASK_FILE, film_as_read,
    jpeg, nodes,
};
use crate::dynamics::Take;
use crate::files::OutputFolder;
use crate::model::{
    AtRest, Background, CameraState, GapCause, Origin, Outline, Picture, Pose, Rgb, Skeleton,
    TagScale, Tentative, Timing, TrackLog, TrackSet, Unidentified, Verdict, WoodSeen,
};
use crate::recording::TrackFileReader;
use crate::solve::{Model, with_modes};
use crate::source::SourceInfo;
use crate::views::{DocumentWriter, Draft, PrepareError, SwayFound};
use nalgebra::Point2;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Figures of the tracking, gathered frame by frame.
#[derive(Clone, Debug, Default)]
pub struct Quality {
    born: u64,
    frames: u64,
    rejected: u64,
    on_trial: Tentative,
    lost: u64,
    alive: u64,
    first: Option<(u64, f64)>,
    last_s: f64,
    fb_error_px: Histogram,
    error_px: Histogram,
    shaking: ShakeMeter,
    away_before: Absences,
}

/// How often, and how long in all, the camera was away.
#[derive(Clone, Copy, Debug, Default)]
struct Absences {
    count: u64,
    seconds: f64,
}

impl Absences {
    fn of(camera: &CameraState) -> Self {
        Self {
            count: camera.reconnects,
            seconds: camera.away_s,
        }
    }
}

impl Quality {
    /// For points that are followed from now on: what `camera` was away before is not theirs.
    pub fn from_now(camera: &CameraState) -> Self {
        Self {
            away_before: Absences::of(camera),
            ..Self::default()
        }
    }

    /// For points that were followed from `time_s` of a film on that has been filmed, s since its first
    /// frame.
    pub fn since(time_s: f64, timing: &Timing) -> Self {
        let gaps = timing.gaps.iter();
        let before = gaps.filter(|gap| gap.cause != GapCause::Dropped && gap.time_s < time_s);
        Self {
            away_before: Absences {
                count: before.clone().count() as u64,
                seconds: before.map(|gap| gap.length_s).sum(),
            },
            ..Self::default()
        }
    }

    /// Takes the tracks of a frame and the medians of their forward-backward and of their expected
    /// error, px.
    pub fn note(&mut self, tracks: &TrackSet, fb_error_px: f64, error_px: Option<f64>) {
        self.shaking.note(tracks);
        self.frames += 1;
        self.rejected += tracks.rejected.len() as u64;
        self.on_trial.note(tracks);
        self.born += u64::from(tracks.born);
        self.lost += u64::from(tracks.lost);
        if tracks.camera.background != Background::Lost {
            self.alive = tracks.counted().count() as u64;
        }
        self.first.get_or_insert((tracks.frame, tracks.time_s));
        self.last_s = tracks.time_s;
        self.fb_error_px.add(fb_error_px);
        if let Some(error_px) = error_px {
            self.error_px.add(error_px);
        }
    }

    /// The figures as the capture has them.
    pub(super) fn figures(&self, tree: Option<&Model>) -> QualityNote {
        let shaking = self.shaking.so_far();
        QualityNote {
            camera_shake_px: shaking.shake.map(|shake| shake.rms_px),
            camera_shake_hz: shaking.shake.and_then(|shake| shake.frequency_hz),
            camera_seen_share: Some(shaking.seen_share),
            camera_by_foot_share: Some(shaking.by_foot_share),
            camera_lost_share: Some(shaking.lost_share),
            tracks_total: self.tracks_total(),
            tracks_rejected: self.rejected,
            tracks_left_out: tree.map_or(0, |tree| tree.left_out.len() as u64),
            tracks_alive_end: self.alive,
            median_fb_error_px: self.fb_error_px.median(),
            median_error_px: self.error_px.median(),
            lost_per_s: self.lost_per_s(),
            median_certainty: tree.and_then(|tree| tree.hierarchy.median_certainty()),
            median_reprojection_px: None,
        }
    }

    /// Points lost a second.
    pub fn lost_per_s(&self) -> Option<f64> {
        let followed_s = self.followed_s();
        (followed_s > 0.0).then(|| self.lost as f64 / followed_s)
    }

    /// Frames in which points were followed.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Time from the first of them to the last, s.
    pub fn followed_s(&self) -> f64 {
        self.last_s - self.first.map_or(self.last_s, |(_, s)| s)
    }

    /// Time of the last one, s since the first of the film.
    pub fn last_s(&self) -> f64 {
        self.last_s
    }

    /// The film in which points were followed, where `camera` says how often the camera was away by now.
    pub fn length(&self, camera: &CameraState) -> FilmLength {
        let away = Absences::of(camera);
        let seconds = self.followed_s() - (away.seconds - self.away_before.seconds);
        let absences = away.count.saturating_sub(self.away_before.count);
        // Each absence is one of the steps from frame to frame.
        let steps = self.frames.saturating_sub(1 + absences);
        FilmLength {
            seconds: seconds.max(0.0),
            rate_hz: (steps > 0 && seconds > 0.0).then(|| steps as f64 / seconds),
        }
    }

    /// Points that were still followed in it.
    pub fn tracks_alive(&self) -> u64 {
        self.alive
    }

    /// How the camera moved.
    pub fn shaking(&self) -> &ShakeMeter {
        &self.shaking
    }

    /// Points followed that count: those that have passed their trial, or all while none has.
    pub fn tracks_total(&self) -> u64 {
        self.born
            .saturating_sub(self.rejected + self.on_trial.void().count() as u64)
    }
}

/// Everything that a capture is made of; owned, so that it can be written on any thread while
/// frames go on.
pub struct CaptureJob {
    pub tree: Option<Arc<Model>>,
    pub outline: Option<Arc<Outline>>,
    pub tracks: TrackFileReader,
    /// The last seconds of the same.
    pub log: TrackLog,
    /// The wood that was found in its frames.
    pub wood: WoodSeen,
    /// After which of them it was to be looked for again, as the user had drawn.
    pub asked: BTreeSet<u64>,
    pub config: Config,
    pub info: SourceInfo,
    pub quality: Quality,
    pub picture: Option<Picture>,
    /// What a tag beside the trunk says of the scale.
    pub tag: Option<TagScale>,
    pub shared: Arc<Shared>,
}

/// What was written, for the closing lines.
#[derive(Clone, Debug)]
pub struct Written {
    pub dir: PathBuf,
    /// The model of its files.
    pub tree: Option<Arc<Model>>,
    pub verdict: Verdict,
}

/// Writes the capture to `dir`, which appears only when it is complete.
///
/// # Errors
/// `dir` is there already, the disk is full, or whatever else the file system says.
pub fn write(job: &CaptureJob, dir: &Path) -> Result<Written, Failure> {
    match &job.tree {
        Some(tree) => complete(
            job,
            CaptureTables::create(
                dir,
                tree,
                &job.config,
                job.picture.as_ref().map(|p| p.frame),
            )?,
        ),
        None => without_tree(job, dir),
    }
}

/// Writes what the tables lack, and all other files.
///
/// # Errors
/// As for [`write`].
pub fn complete(job: &CaptureJob, mut tables: CaptureTables) -> Result<Written, Failure> {
    let cancel = &job.shared.pulse.writing;
    tables.catch_up(&job.tracks, cancel)?;
    let mut done = tables.finish(&job.tracks, cancel)?;
    let model = done.replay.model().clone();
    let note = note_of(job, &done);
    let read = skeleton_as_read(&note, &model)?;
    let take = take(job, &done, &read);
    let poses = std::mem::take(&mut done.poses);
    // Most of the document needs no sway, and the user who has asked for the end is waiting.
    let cancel = &job.shared.pulse.closing_work;
    let (model, writer) = beside(
        "sway",
        || with_modes(&model, &read, &take.film, &job.config, cancel),
        || draft(job, &done, note, poses),
    );
    warn_of_unanalysed(job, &model);
    if let Some(warning) = take.warning() {
        job.shared.warn(warning);
    }
    let warnings = warnings(job, Some(&model));
    let judgement = judge(job, Some(&model), &take);
    let verdict = judgement.verdict.clone();
    let found = SwayFound {
        sway: &model.modes,
        modes: &model.tree_modes,
        cut: take.cut(),
    };
    writer?.write(&done.folder, found, warnings, Some(judgement))?;
    let dir = done.folder.publish()?;
    Ok(Written {
        dir,
        tree: Some(Arc::new(model)),
        verdict,
    })
}

/// The tree as the files of the capture give it back.
fn skeleton_as_read(note: &CaptureNote, tree: &Model) -> Result<Arc<Skeleton>, Failure> {
    let read = Document::as_read(note, &tree.skeleton, &[], None);
    Ok(read.map_err(PrepareError::from)?.skeleton)
}

/// The points of the last seconds on the nodes of the tree, as the files of the capture give them back,
/// and as far as they are in one piece.
fn take(job: &CaptureJob, done: &Done, skeleton: &Skeleton) -> Take {
    let mut log = job.log.clone();
    log.close();
    let window = log.last(job.config.dynamics.window_s);
    Take::of(film_as_read(window, skeleton, |id| done.replay.node_of(id)))
}

/// What is known of the capture before its sway.
fn note_of(job: &CaptureJob, done: &Done) -> CaptureNote {
    let tree = &**done.replay.model();
    let model = ModelNote {
        push: Some(tree.push_figures(&job.config)),
        bare: tree.is_bare(),
        ..ModelNote::of(&tree.skeleton, job.config.export.metres_per_px)
    };
    let mut note = describe(job, Some(tree), Some(model));
    note.quality.median_reprojection_px = done.misses.median();
    note
}

/// The document but for its sway.
fn draft(
    job: &CaptureJob,
    done: &Done,
    note: CaptureNote,
    poses: Vec<Pose>,
) -> Result<DocumentWriter, Failure> {
    let tree = &**done.replay.model();
    Ok(DocumentWriter::new(Draft {
        note,
        skeleton: &tree.skeleton,
        picture: job.picture.as_ref(),
        bark: bark_of(tree),
        at_rest: at_rest_of(tree),
        poses,
        pose_in_picture: done.pose_in_picture.as_ref(),
    })?)
}

/// The bark that the film shows of a tree.
fn bark_of(tree: &Model) -> Option<&Arc<Rgb>> {
    tree.wood.as_ref()?.bark.as_ref()
}

/// The tree at rest, and which pixels are its wood and leaves.
fn at_rest_of(tree: &Model) -> Option<&Arc<AtRest>> {
    tree.wood.as_ref()?.at_rest.as_ref()
}

/// Says how many branches were not analysed because the end was wanted.
fn warn_of_unanalysed(job: &CaptureJob, tree: &Model) {
    let missing = tree
        .modes
        .iter()
        .filter(|s| matches!(s, Err(Unidentified::NotInTime)))
        .count();
    if missing > 0 {
        let of = tree.skeleton.measured_branches().count();
        job.shared.warn(format!(
            "the sway of {missing} of {of} branches was not looked at, as the end was wanted: \
             `arborcam analyze DIR --update` adds it"
        ));
    }
}

/// Tables without rows and no model: a reader finds every table, and no tree that was never seen.
fn without_tree(job: &CaptureJob, dir: &Path) -> Result<Written, Failure> {
    let folder = OutputFolder::create(dir)?;
    let metres_per_px = job.config.export.metres_per_px;
    let camera = CameraCsv::new(folder.file(CAMERA_FILE)?, job.info.size)?;
    let has_depth = depth::format(&job.config.depth).is_some();
    let tracks = TracksCsv::new(folder.file("tracks.csv")?, has_depth)?;
    write_tracks(job, tracks, camera)?;
    let foot_only = Arc::new(Skeleton {
        nodes: Vec::new(),
        foot_px: Point2::origin(),
        image_size: job.info.size,
    });
    nodes(folder.file("nodes.csv")?, &foot_only, &[], metres_per_px)?;
    MotionCsv::new(folder.file("motion.csv")?, &foot_only, metres_per_px)?.finish()?;
    let judgement = judge(job, None, &Take::default());
    let verdict = judgement.verdict.clone();
    let mut note = describe(job, None, None);
    note.take_judgement(judgement);
    write_without_tree(job, &folder, &note)?;
    let dir = folder.publish()?;
    let tree = None;
    Ok(Written { dir, tree, verdict })
}

fn write_without_tree(
    job: &CaptureJob,
    folder: &OutputFolder,
    note: &CaptureNote,
) -> Result<(), Failure> {
    if let Some(picture) = &job.picture {
        folder.write(PICTURE_FILE, &jpeg(&picture.rgb)?)?;
    }
    Ok(folder.write("capture.json", &json(note)?)?)
}

/// The points of a film in which no tree was built, those that have passed their trial, and the
/// camera's motion.
fn write_tracks(
    job: &CaptureJob,
    mut table: TracksCsv<impl std::io::Write>,
    mut camera: CameraCsv<impl std::io::Write>,
) -> Result<(), Failure> {
    // Which points are void is known for sure only at the end: where the tree did not move, a trial
    // may last for long.
    let (mut rejected, mut tentative) = (BTreeSet::new(), Tentative::default());
    for set in job.tracks.sets() {
        let set = set.map_err(Failure::Log)?;
        tentative.note(&set);
        rejected.extend(set.rejected);
        job.shared.pulse.wrote();
    }
    rejected.extend(tentative.void());
    for set in job.tracks.sets() {
        let mut set = set.map_err(Failure::Log)?;
        camera.set(&set)?;
        set.observations.retain(|o| !rejected.contains(&o.id));
        table.set(&set, |_| None)?;
        job.shared.pulse.wrote();
    }
    camera.finish()?;
    table.finish()?;
    Ok(())
}

/// What goes into `capture.json`, but for what is known only when the model's file is made.
pub(super) fn describe(
    job: &CaptureJob,
    tree: Option<&Model>,
    model: Option<ModelNote>,
) -> CaptureNote {
    let Origin { captured_at, notes } = job.shared.origin();
    CaptureNote {
        schema_version: SCHEMA_VERSION,
        software: Software::default(),
        captured_at,
        notes,
        source: Source {
            name: job.info.name.clone(),
            format_asked: job.info.format.asked.clone(),
            format_given: job.info.format.given.clone(),
            width: job.info.size.width,
            height: job.info.size.height,
        },
        timing: timing(job),
        config: job.config.clone(),
        outline: job.outline.as_ref().map(|outline| {
            let frame = job.quality.first.map_or(0, |(frame, _)| frame);
            OutlineNote::of(frame, outline, tree.map(|tree| &*tree.outline_at_rest))
        }),
        picture: job.picture.as_ref().map(|p| PictureNote {
            file: PICTURE_FILE.into(),
            frame: p.frame,
            time_s: p.time_s,
        }),
        tag: job.tag,
        depth: tree.and_then(depth_note),
        leaves: None,
        scan: None,
        found: None,
        bark: tree.and_then(bark_of).map(|_| BarkNote {
            file: BARK_FILE.into(),
        }),
        masks: tree.and_then(at_rest_of).map(|_| MasksNote {
            wood: WOOD_MASK_FILE.into(),
            leaves: LEAVES_MASK_FILE.into(),
            rest: REST_FILE.into(),
        }),
        build: tree.map(first_build),
        refinement: tree.and_then(refinement),
        quality: job.quality.figures(tree),
        verdict: None,
        judged_by: None,
        model,
        animation: None,
        warnings: warnings(job, tree),
    }
}

/// `None` in a film without depth.
fn depth_note(tree: &Model) -> Option<DepthNote> {
    let depths = tree.depths.as_ref()?;
    Some(DepthNote {
        foot_m: depths.foot_m,
        metres_per_px: depths.metres_per_px,
        points: depths.tracks.len() as u64,
        nodes: tree.seen.len().saturating_sub(1) as u64,
        nodes_seen: tree.seen.iter().flatten().count() as u64,
    })
}

fn count(counter: &AtomicU64) -> u64 {
    counter.load(Ordering::Relaxed)
}

/// The frames of a capture in time.
fn timing(job: &CaptureJob) -> Timing {
    let counts = &job.shared.counts;
    let (seen, duration_s) = (count(&counts.seen), job.shared.last_time_s());
    let camera = job.shared.camera_state();
    // Each absence is one of the steps from frame to frame.
    let steps = seen.saturating_sub(1 + camera.reconnects);
    let filmed_s = duration_s - camera.away_s;
    Timing {
        nominal_rate_hz: job.info.nominal_rate_hz,
        measured_rate_hz: (steps > 0 && filmed_s > 0.0).then(|| steps as f64 / filmed_s),
        frames_seen: seen,
        frames_dropped_camera: count(&counts.lost_in_camera),
        frames_dropped_by_sequence: camera.lost_by_sequence,
        frames_dropped_by_time: camera.lost_by_time,
        frames_damaged: camera.damaged,
        frames_stale: camera.stale,
        clock: camera.clock.into(),
        reconnects: camera.reconnects,
        away_s: camera.away_s + camera.away_at_end_s,
        frames_dropped_tracker: count(&counts.dropped_before_tracker),
        frames_undecodable: count(&counts.undecodable),
        frames_before_outline: count(&counts.before_outline),
        frames_not_recorded: count(&counts.not_recorded),
        depth: camera.depth.map(|depth| depth.counts),
        duration_s,
        ..job.shared.gaps()
    }
}

/// What the user should know before trusting the result.
fn warnings(job: &CaptureJob, tree: Option<&Model>) -> Vec<String> {
    let mut warnings = job.shared.warnings();
    // Withdrawn when the tree was refined, and this may be the one before.
    let little = tree.and_then(|tree| little_motion(tree, job.config.accumulate.threshold));
    if let Some(little) = little.filter(|w| !warnings.contains(w)) {
        warnings.push(little);
    }
    warnings
}

fn first_build(tree: &Model) -> Build {
    Build {
        frame: tree.first.frame,
        time_s: tree.first.time_s,
        accumulation: tree.first.measure,
        moving_points: tree.first.moving as u32,
        forced: tree.first.forced,
    }
}

/// `None` for the tree that was built first.
fn refinement(tree: &Model) -> Option<Refinement> {
    (tree.refinements > 0).then_some(Refinement {
        count: tree.refinements,
        frame: tree.frame,
        time_s: tree.time_s,
        accumulation: tree.evidence.measure,
        moving_points: tree.evidence.moving.len() as u32,
        shown_from: tree.shown_from,
        nodes_kept: tree.kept as u32,
    })
}

//! Writes a capture: the files of the contract, from the tracks on disk and the tree.

use super::announce::little_motion;
use super::capture_tables::{CaptureTables, Done};
use super::held_sets::{HeldSets, OnTrial};
use super::meter::Histogram;
use super::shared::{Failure, Shared};
use crate::config::Config;
use crate::dynamics::{Depth, analyse};
use crate::export::capture::{
    AnimationNote, Build, Capture, ModelNote, OutlineNote, PictureNote, Quality as QualityNote,
    Refinement, Software, Source, Timing, json,
};
use crate::export::csv::{MotionCsv, TracksCsv, nodes};
use crate::export::gltf::{KEY_TOLERANCE_PX, Model, glb, provenance};
use crate::export::picture::{PICTURE_FILE, jpeg};
use crate::export::{ExportError, OutputFolder};
use crate::model::{Outline, Picture, Pose, Skeleton, TrackSet, Unidentified};
use crate::pipeline::{Seen, Tree, dress, flutter};
use crate::recording::SpoolReader;
use crate::source::SourceInfo;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Joints times frames up to which the fewest keys of the animation are looked for: a service is
/// given two seconds to stop.
const THOROUGH_UP_TO: usize = 100_000;

/// Figures of the tracking, gathered frame by frame.
#[derive(Clone, Debug, Default)]
pub struct Quality {
    born: u64,
    rejected: u64,
    on_trial: OnTrial,
    lost: u64,
    alive: u64,
    first: Option<(u64, f64)>,
    last_s: f64,
    fb_error_px: Histogram,
    error_px: Histogram,
}

impl Quality {
    /// Takes the tracks of a frame and the medians of their forward-backward and of their expected
    /// error, px.
    pub fn note(&mut self, tracks: &TrackSet, fb_error_px: f64, error_px: Option<f64>) {
        self.rejected += tracks.rejected.len() as u64;
        self.on_trial.note(tracks);
        self.born += u64::from(tracks.born);
        self.lost += u64::from(tracks.lost);
        self.alive = tracks.counted().count() as u64;
        self.first.get_or_insert((tracks.frame, tracks.time_s));
        self.last_s = tracks.time_s;
        self.fb_error_px.add(fb_error_px);
        if let Some(error_px) = error_px {
            self.error_px.add(error_px);
        }
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
    pub tree: Option<Arc<Tree>>,
    pub outline: Option<Arc<Outline>>,
    pub tracks: SpoolReader,
    pub config: Config,
    pub info: SourceInfo,
    pub quality: Quality,
    pub picture: Option<Picture>,
    pub shared: Arc<Shared>,
}

/// What was written, for the closing lines.
#[derive(Clone, Debug)]
pub struct Written {
    pub dir: PathBuf,
    /// The tree of its files. After a stop shortly after a refinement it is the one before.
    pub tree: Option<Arc<Tree>>,
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
    let wrote = || {
        job.shared.pulse.wrote();
        true
    };
    tables.catch_up(&job.tracks, wrote)?;
    let Done {
        folder,
        tree,
        poses,
        pose_in_picture,
        misses,
        film,
    } = tables.finish(&job.tracks, wrote)?;
    let metres_per_px = job.config.export.metres_per_px;
    // The sway and the model need nothing of each other, and whoever has asked for the end is
    // waiting.
    let (sway, (model, push)) = beside(
        "sway",
        || {
            let cancel = &job.shared.pulse.closing_work;
            analyse(
                &tree.skeleton,
                &film,
                &job.config.dynamics,
                Depth::Full,
                cancel,
            )
            .sway
        },
        || {
            (
                model_of(job, &tree, &poses, pose_in_picture.as_ref()),
                tree.push_figures(&job.config),
            )
        },
    );
    let (bytes, animation) = model?;
    let untold = sway
        .iter()
        .filter(|s| matches!(s, Err(Unidentified::NotInTime)))
        .count();
    if untold > 0 {
        let of = tree.skeleton.measured() - 1;
        job.shared.warn(format!(
            "the sway of {untold} of {of} branches was not looked at, as the end was wanted: `arborcam analyze DIR` tells it"
        ));
    }
    nodes(
        folder.file("nodes.csv")?,
        &tree.skeleton,
        &sway,
        metres_per_px,
    )?;
    folder.write("tree.glb", &bytes)?;
    let push = Some(push);
    let model = ModelNote {
        push,
        ..ModelNote::of(&tree.skeleton, metres_per_px)
    };
    let capture = describe(job, Some(&tree), Some((model, animation)), misses.median());
    publish(job, folder, capture, Some(tree))
}

/// Does both at the same time, the first on a thread of this name, or one after the other where
/// there is none to be had.
fn beside<A: Send, B>(
    name: &str,
    first: impl Fn() -> A + Sync,
    second: impl FnOnce() -> B,
) -> (A, B) {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new()
            .name(name.into())
            .spawn_scoped(scope, &first);
        let b = second();
        match thread.map(std::thread::ScopedJoinHandle::join) {
            Ok(Ok(a)) => (a, b),
            Ok(Err(panic)) => std::panic::resume_unwind(panic),
            Err(_) => (first(), b),
        }
    })
}

/// Tables without rows and no model: a reader finds every table, and no tree that was never seen.
fn without_tree(job: &CaptureJob, dir: &Path) -> Result<Written, Failure> {
    let folder = OutputFolder::create(dir)?;
    let metres_per_px = job.config.export.metres_per_px;
    let mut tracks = TracksCsv::new(folder.file("tracks.csv")?)?;
    // Which points are void is known for sure only at the end: where the tree did not move, a trial
    // may last for long.
    let mut held = HeldSets::default();
    for set in job.tracks.sets() {
        held.note(&set.map_err(Failure::Spool)?);
        job.shared.pulse.wrote();
    }
    held.close();
    for set in job.tracks.sets() {
        let mut set = set.map_err(Failure::Spool)?;
        held.clean(&mut set);
        tracks.set(&set, |_| None)?;
        job.shared.pulse.wrote();
    }
    tracks.finish()?;
    let foot_only = Arc::new(Skeleton {
        nodes: Vec::new(),
        foot_px: [0.0; 2],
        image_size: job.info.size,
    });
    nodes(folder.file("nodes.csv")?, &foot_only, &[], metres_per_px)?;
    MotionCsv::new(folder.file("motion.csv")?, &foot_only, metres_per_px)?.finish()?;
    publish(job, folder, describe(job, None, None, None), None)
}

fn publish(
    job: &CaptureJob,
    folder: OutputFolder,
    capture: Capture,
    tree: Option<Arc<Tree>>,
) -> Result<Written, Failure> {
    if let Some(picture) = &job.picture {
        folder.write(PICTURE_FILE, &jpeg(&picture.rgb)?)?;
    }
    folder.write("capture.json", &json(&capture)?)?;
    let dir = folder.publish()?;
    Ok(Written { dir, tree })
}

fn model_of(
    job: &CaptureJob,
    tree: &Tree,
    poses: &[Pose],
    pose_in_picture: Option<&Pose>,
) -> Result<(Vec<u8>, AnimationNote), ExportError> {
    let skeleton = &tree.skeleton;
    let picture = job.picture.as_ref().map(|p| &*p.rgb);
    let seen = Seen {
        picture,
        pose: pose_in_picture,
        outline: Some(&tree.outline),
        ..Seen::default()
    };
    let dressed = dress(skeleton, seen, &job.config);
    let flutter = flutter(&dressed, poses, skeleton, &job.config);
    let provenance = provenance(&job.info.name, &Software::default(), poses);
    let large = skeleton.nodes.len() * poses.len() > THOROUGH_UP_TO;
    glb(&Model {
        skeleton,
        dressed: &dressed,
        poses,
        flutter: &flutter,
        all_levels: false,
        metres_per_px: job.config.export.metres_per_px,
        tolerance_px: KEY_TOLERANCE_PX,
        thorough: &|| !large && !job.shared.pulse.closing_work.is_cancelled(),
        node_extras: &[],
        provenance: &provenance,
    })
}

fn describe(
    job: &CaptureJob,
    tree: Option<&Tree>,
    notes: Option<(ModelNote, AnimationNote)>,
    median_reprojection_px: Option<f64>,
) -> Capture {
    let (model, animation) = notes.unzip();
    let counts = &job.shared.counts;
    let count = |c: &std::sync::atomic::AtomicU64| c.load(Ordering::Relaxed);
    let (seen, duration_s) = (count(&counts.seen), job.shared.last_time_s());
    let camera = job.shared.camera_state();
    // Each absence is one of the steps from frame to frame.
    let (steps, filmed_s) = (
        seen.saturating_sub(1 + camera.reconnects),
        duration_s - camera.away_s,
    );
    let timing = Timing {
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
        duration_s,
        ..job.shared.gaps()
    };
    let quality = &job.quality;
    let mut warnings = job.shared.warnings();
    // Withdrawn when the tree was refined, and this may be the one before.
    let little = tree.and_then(|tree| little_motion(tree, job.config.accumulate.threshold));
    warnings.extend(little.filter(|w| !job.shared.warnings().contains(w)));
    let tracked_s = quality.last_s - quality.first.map_or(quality.last_s, |(_, s)| s);
    Capture {
        schema_version: crate::export::capture::SCHEMA_VERSION,
        software: Software::default(),
        captured_at: None,
        source: Source {
            name: job.info.name.clone(),
            format_asked: job.info.format.asked.clone(),
            format_given: job.info.format.given.clone(),
            width: job.info.size.width,
            height: job.info.size.height,
        },
        timing,
        config: job.config.clone(),
        outline: job.outline.as_ref().map(|o| OutlineNote {
            frame: quality.first.map_or(0, |(frame, _)| frame),
            width: o.size.width,
            height: o.size.height,
            polygon_px: o.polygon_px.clone(),
        }),
        picture: job.picture.as_ref().map(|p| PictureNote {
            file: PICTURE_FILE.into(),
            frame: p.frame,
            time_s: p.time_s,
        }),
        build: tree.map(|tree| Build {
            frame: tree.first.frame,
            time_s: tree.first.time_s,
            accumulation: tree.first.measure,
            moving_points: tree.first.moving as u32,
            forced: tree.first.forced,
        }),
        refinement: tree
            .filter(|tree| tree.refinements > 0)
            .map(|tree| Refinement {
                count: tree.refinements,
                frame: tree.frame,
                time_s: tree.time_s,
                accumulation: tree.evidence.measure,
                moving_points: tree.evidence.moving.len() as u32,
                shown_from: tree.shown_from,
                nodes_kept: tree.kept as u32,
            }),
        quality: QualityNote {
            tracks_total: quality.tracks_total(),
            tracks_rejected: quality.rejected,
            tracks_alive_end: quality.alive,
            median_fb_error_px: quality.fb_error_px.median(),
            median_error_px: quality.error_px.median(),
            lost_per_s: (tracked_s > 0.0).then(|| quality.lost as f64 / tracked_s),
            median_certainty: tree.and_then(|tree| tree.hierarchy.median_certainty()),
            median_reprojection_px,
        },
        model,
        animation,
        warnings,
    }
}

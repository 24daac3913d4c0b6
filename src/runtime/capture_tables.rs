//! `tracks.csv`, `left_out.csv`, `motion.csv` and `camera.csv`, written from the log as far as it goes.

use super::meter::Histogram;
use super::shared::Failure;
use crate::cancel::CancelToken;
use crate::config::Config;
use crate::depth;
use crate::document::{CAMERA_FILE, CameraCsv, LEFT_OUT_FILE, MotionCsv, TRACKS_FILE, TracksCsv};
use crate::files::OutputFolder;
use crate::model::{LONGEST_TRIAL_S, Pose, TrackId, TrackLog, TrackSet};
use crate::pipeline::PoseReplay;
use crate::recording::{Sets, TrackFileReader};
use crate::solve::Model;
use std::collections::{BTreeSet, VecDeque};
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

/// So much more of the film is kept than its animation shows, s: which poses are in that is decided
/// by the times as they are written.
const SLACK_S: f64 = 1.0;

/// The tables as far as they are written. What is in them does not depend on when and in how many
/// pieces that is done.
pub struct CaptureTables {
    folder: OutputFolder,
    replay: PoseReplay,
    motion: MotionCsv<BufWriter<File>>,
    camera: CameraCsv<BufWriter<File>>,
    tracks: TracksCsv<BufWriter<File>>,
    /// The points that the model leaves out.
    left_out: TracksCsv<BufWriter<File>>,
    sets: Option<Sets>,
    /// Sets whose poses are written and whose points are not yet: some of those may still be on
    /// trial.
    undecided: TrackLog,
    /// Points that did not pass their trial, until the rows from before the tree are written.
    rejected: BTreeSet<TrackId>,
    early: EarlyRows,
    /// Sets whose points are decided and not written yet.
    decided: VecDeque<Arc<TrackSet>>,
    /// Poses of the last [`kept_s`](Self::kept_s), for the animation.
    poses: VecDeque<Pose>,
    kept_s: f64,
    /// The frame of the capture's picture, and the tree's pose in it.
    pictured: Option<u64>,
    pose_in_picture: Option<Pose>,
    misses: Histogram,
}

/// Whether the frames up to the one in which the tree was built have their rows.
#[derive(Default)]
enum EarlyRows {
    #[default]
    NotBegun,
    /// Those that follow lack theirs.
    Cut(Sets),
    Written,
}

/// What is left when the tables are complete.
pub struct Done {
    pub folder: OutputFolder,
    /// Knows the node of every track.
    pub replay: PoseReplay,
    pub poses: Vec<Pose>,
    /// In the frame of the capture's picture.
    pub pose_in_picture: Option<Pose>,
    /// How far the projected nodes lie from where their tracks put them, px.
    pub misses: Histogram,
}

impl CaptureTables {
    /// Begins the files in what becomes the folder `dir`; `pictured` is the frame of the capture's
    /// picture.
    ///
    /// # Errors
    /// `dir` is there already, or whatever the file system says.
    pub fn create(
        dir: &Path,
        model: &Arc<Model>,
        config: &Config,
        pictured: Option<u64>,
    ) -> Result<Self, Failure> {
        let folder = OutputFolder::create(dir)?;
        let motion = MotionCsv::new(
            folder.file("motion.csv")?,
            &model.skeleton,
            config.export.metres_per_px,
        )?;
        let camera = CameraCsv::new(folder.file(CAMERA_FILE)?, model.skeleton.image_size)?;
        let has_depth = depth::format(&config.depth).is_some();
        let tracks = TracksCsv::new(folder.file(TRACKS_FILE)?, has_depth)?;
        let left_out = TracksCsv::of_left_out(folder.file(LEFT_OUT_FILE)?, has_depth)?;
        Ok(Self {
            folder,
            replay: PoseReplay::new(model, config),
            motion,
            camera,
            tracks,
            left_out,
            sets: None,
            undecided: TrackLog::new(LONGEST_TRIAL_S),
            rejected: BTreeSet::new(),
            early: EarlyRows::default(),
            decided: VecDeque::new(),
            poses: VecDeque::new(),
            kept_s: config.export.animation_s + SLACK_S,
            pictured,
            pose_in_picture: None,
            misses: Histogram::default(),
        })
    }

    /// Writes all rows up to where `log` ends, or until `cancel` ends it.
    ///
    /// # Errors
    /// Whatever the file system says, a full disk among it.
    pub fn catch_up(&mut self, log: &TrackFileReader, cancel: &CancelToken) -> Result<(), Failure> {
        // Where the last call was cut.
        self.decided_rows(log, cancel)?;
        let mut sets = self.sets.take().unwrap_or_else(|| log.sets());
        sets.until(log);
        let built = self.replay.model().frame;
        while !cancel.is_cancelled() {
            let Some(set) = sets.next() else { break };
            let set = set.map_err(Failure::Log)?;
            self.pose(&set)?;
            if !matches!(self.early, EarlyRows::Written) {
                self.rejected.extend(&set.rejected);
            }
            // A track's node is known when it has passed its trial; of those that were there when
            // the tree was built, then.
            let mut decided = self.undecided.push(set);
            decided.retain(|set| set.frame > built);
            self.decided.extend(decided);
            self.decided_rows(log, cancel)?;
        }
        self.sets = Some(sets);
        Ok(())
    }

    /// Size of the files up to now, bytes.
    pub fn bytes(&self) -> u64 {
        self.folder.bytes()
    }

    /// Ends the tables, the last rows of which are those that [`catch_up`](Self::catch_up) has
    /// written.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn finish(mut self, log: &TrackFileReader, cancel: &CancelToken) -> Result<Done, Failure> {
        self.rejected.extend(self.undecided.close());
        let built = self.replay.model().frame;
        let rest = self.undecided.drain().into_iter();
        self.decided.extend(rest.filter(|set| set.frame > built));
        if self.early_rows(log, cancel)? {
            self.decided_rows(log, cancel)?;
        }
        self.tracks.finish()?;
        self.left_out.finish()?;
        self.motion.finish()?;
        self.camera.finish()?;
        Ok(Done {
            folder: self.folder,
            replay: self.replay,
            poses: self.poses.into(),
            pose_in_picture: self.pose_in_picture,
            misses: self.misses,
        })
    }

    /// The points of a frame in which it is decided which are kept.
    fn rows(&mut self, set: &TrackSet) -> Result<(), Failure> {
        for o in &set.observations {
            let is_left_out = self.replay.model().left_out.contains(&o.id);
            let table = if is_left_out {
                &mut self.left_out
            } else {
                &mut self.tracks
            };
            let node = self.replay.node_name_of(o.id);
            table.row(set, o, node)?;
        }
        Ok(())
    }

    fn pose(&mut self, set: &TrackSet) -> Result<(), Failure> {
        let (pose, targets_px) = self.replay.step(set);
        self.motion.pose(&pose)?;
        self.camera.set(set)?;
        // The foot is where it is by definition.
        for (joint, target) in pose.joints.iter().zip(&targets_px).skip(1) {
            if let Some(t) = target {
                let skeleton = &self.replay.model().skeleton;
                let miss_px = skeleton.image_from_model(&joint.position) - t;
                self.misses.add(miss_px.x.hypot(miss_px.y));
            }
        }
        if self.pictured == Some(pose.frame) {
            self.pose_in_picture = Some(pose.clone());
        }
        let oldest_s = pose.time_s - self.kept_s;
        self.poses.push_back(pose);
        while self.poses.front().is_some_and(|p| p.time_s < oldest_s) {
            self.poses.pop_front();
        }
        Ok(())
    }

    /// The rows of all sets that are decided.
    fn decided_rows(&mut self, log: &TrackFileReader, cancel: &CancelToken) -> Result<(), Failure> {
        if self.decided.is_empty() || !self.early_rows(log, cancel)? {
            return Ok(());
        }
        while let Some(set) = self.decided.pop_front() {
            self.rows(&set)?;
        }
        Ok(())
    }

    /// The rows of the frames up to the one in which the tree was built, once that has been gone
    /// through: which tracks of that time are on the tree is known only then. Whether all of them
    /// are written; if `cancel` has cut them, the next call goes on there.
    fn early_rows(&mut self, log: &TrackFileReader, cancel: &CancelToken) -> Result<bool, Failure> {
        let mut sets = match std::mem::take(&mut self.early) {
            EarlyRows::NotBegun => log.sets(),
            EarlyRows::Cut(sets) => sets,
            EarlyRows::Written => {
                self.early = EarlyRows::Written;
                return Ok(true);
            }
        };
        sets.until(log);
        let built = self.replay.model().frame;
        while !cancel.is_cancelled() {
            let next = sets.next().transpose().map_err(Failure::Log)?;
            let Some(mut set) = next.filter(|set| set.frame <= built) else {
                self.rejected.clear();
                self.early = EarlyRows::Written;
                return Ok(true);
            };
            set.observations.retain(|o| !self.rejected.contains(&o.id));
            self.rows(&set)?;
        }
        self.early = EarlyRows::Cut(sets);
        Ok(false)
    }
}

#[cfg(test)]
#[path = "tests/capture_tables.rs"]
mod tests;

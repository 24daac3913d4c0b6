//! `tracks.csv` and `motion.csv`, written behind the capture while it runs, so that little is left
//! to do at its end: a service is given two seconds to stop.

use super::held_sets::HeldSets;
use super::meter::Histogram;
use super::shared::Failure;
use crate::config::Config;
use crate::document::{MotionCsv, TracksCsv};
use crate::dynamics::{Film, FilmLog};
use crate::files::OutputFolder;
use crate::model::{NodeId, NodeName, Pose, TrackId, TrackSet};
use crate::pipeline::{Retrace, Tree};
use crate::recording::{Sets, SpoolReader};
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

/// So much more of the film is kept than its animation shows, s: which poses are in that is decided
/// by the times as they are written.
const SLACK_S: f64 = 1.0;

/// Both tables as far as they are written. What is in them does not depend on when and in how many
/// pieces that is done.
pub struct CaptureTables {
    folder: OutputFolder,
    tree: Arc<Tree>,
    retrace: Retrace,
    motion: MotionCsv<BufWriter<File>>,
    tracks: TracksCsv<BufWriter<File>>,
    sets: Option<Sets>,
    /// Sets whose poses are written and whose points are not yet: some of those may still be on
    /// trial.
    held: HeldSets,
    /// Whether the tracks from before the tree was built have their rows.
    early: bool,
    /// Poses of the last [`kept_s`](Self::kept_s), for the animation.
    poses: VecDeque<Pose>,
    kept_s: f64,
    /// The frame of the capture's picture, and the tree's pose in it.
    pictured: Option<u64>,
    pose_in_picture: Option<Pose>,
    misses: Histogram,
    /// The points of the last seconds, for the sway.
    log: FilmLog,
}

/// What is left when both tables are complete.
pub struct Done {
    pub folder: OutputFolder,
    pub tree: Arc<Tree>,
    pub poses: Vec<Pose>,
    /// In the frame of the capture's picture.
    pub pose_in_picture: Option<Pose>,
    /// How far the projected nodes lie from where their tracks put them, px.
    pub misses: Histogram,
    /// The points of the last `dynamics.window_s`.
    pub film: Film,
}

impl CaptureTables {
    /// Begins both files in what becomes the folder `dir`; `pictured` is the frame of the capture's
    /// picture.
    ///
    /// # Errors
    /// `dir` is there already, or whatever the file system says.
    pub fn create(
        dir: &Path,
        tree: &Arc<Tree>,
        config: &Config,
        pictured: Option<u64>,
    ) -> Result<Self, Failure> {
        let folder = OutputFolder::create(dir)?;
        let motion = MotionCsv::new(
            folder.file("motion.csv")?,
            &tree.skeleton,
            config.export.metres_per_px,
        )?;
        let tracks = TracksCsv::new(folder.file("tracks.csv")?)?;
        Ok(Self {
            folder,
            tree: tree.clone(),
            retrace: Retrace::new(tree, config),
            motion,
            tracks,
            sets: None,
            held: HeldSets::default(),
            early: false,
            poses: VecDeque::new(),
            kept_s: config.export.animation_s + SLACK_S,
            pictured,
            pose_in_picture: None,
            misses: Histogram::default(),
            log: FilmLog::new(config.dynamics.window_s),
        })
    }

    /// Writes all rows up to where `spool` ends; each set calls `wrote`, which may answer `false`
    /// to have it given up.
    ///
    /// # Errors
    /// Whatever the file system says, a full disk among it.
    pub fn catch_up(
        &mut self,
        spool: &SpoolReader,
        wrote: impl Fn() -> bool,
    ) -> Result<(), Failure> {
        let mut sets = self.sets.take().unwrap_or_else(|| spool.sets());
        sets.until(spool);
        for set in sets.by_ref() {
            let set = set.map_err(Failure::Spool)?;
            self.pose(&set)?;
            // A track's node is decided when it has passed its trial; of those that were there when
            // the tree was built, then.
            if set.frame > self.tree.frame {
                self.held.push(set);
            } else {
                self.held.note(&set);
            }
            while let Some(set) = self.held.decided() {
                self.early_rows(spool, &wrote)?;
                self.rows(&set)?;
            }
            if !wrote() {
                break;
            }
        }
        self.sets = Some(sets);
        Ok(())
    }

    /// Whether nothing is left that grows with the length of the film: `tracks.csv` begins only
    /// when the last trial from before the tree is over.
    pub fn is_abreast(&self) -> bool {
        self.early
    }

    /// Ends both tables, the last rows of which are those that [`catch_up`](Self::catch_up) has
    /// written; each set calls
    /// `wrote` as there.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn finish(
        mut self,
        spool: &SpoolReader,
        wrote: impl Fn() -> bool,
    ) -> Result<Done, Failure> {
        self.held.close();
        self.early_rows(spool, &wrote)?;
        while let Some(set) = self.held.next() {
            wrote();
            self.rows(&set)?;
        }
        self.tracks.finish()?;
        self.motion.finish()?;
        let (poses, pose_in_picture) = (self.poses.into(), self.pose_in_picture);
        let film = film(&self.log, &self.tree, |id| self.retrace.node_of(id));
        Ok(Done {
            folder: self.folder,
            tree: self.tree,
            poses,
            pose_in_picture,
            misses: self.misses,
            film,
        })
    }

    /// The points of a frame in which it is decided which are kept.
    fn rows(&mut self, set: &TrackSet) -> Result<(), Failure> {
        self.log.push(set);
        Ok(self.tracks.set(set, |id| self.retrace.node_of(id))?)
    }

    fn pose(&mut self, set: &TrackSet) -> Result<(), Failure> {
        let (pose, targets_px) = self.retrace.step(set);
        self.motion.pose(&pose)?;
        // The foot is where it is by definition.
        for (joint, target) in pose.joints.iter().zip(&targets_px).skip(1) {
            if let Some(t) = target {
                let [u, v] = self.tree.skeleton.image_from_model(&joint.position);
                self.misses.add((u - t[0]).hypot(v - t[1]));
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

    /// The rows of the frames up to the one in which the tree was built, once that has been gone
    /// through.
    fn early_rows(
        &mut self,
        spool: &SpoolReader,
        wrote: &impl Fn() -> bool,
    ) -> Result<(), Failure> {
        if std::mem::replace(&mut self.early, true) {
            return Ok(());
        }
        for set in spool.sets() {
            let mut set = set.map_err(Failure::Spool)?;
            if set.frame > self.tree.frame || !wrote() {
                break;
            }
            self.held.clean(&mut set);
            self.rows(&set)?;
        }
        Ok(())
    }
}

/// The points of `log` on the nodes of `tree`.
fn film(log: &FilmLog, tree: &Tree, name_of: impl Fn(TrackId) -> Option<NodeName>) -> Film {
    let names = tree
        .skeleton
        .nodes
        .iter()
        .enumerate()
        .map(|(i, n)| (n.name, NodeId(i as u32)));
    let by_name: BTreeMap<NodeName, NodeId> = names.collect();
    log.film(&tree.skeleton, |id| by_name.get(&name_of(id)?).copied())
}

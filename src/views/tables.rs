//! The tables of a prepared tree, and its wood as cylinders.

use super::{PrepareError, PreparedTree};
use crate::document::{
    CAMERA_FILE, LEFT_OUT_FILE, MODES_FILE, MotionCsv, TRACKS_FILE, nodes, tracks_of,
};
use crate::export::cylinders::cylinders;
use crate::export::qsm::Qsm;
use crate::files::{OutputFolder, WriteError};
use crate::geometry::cylinders_by_branch;
use crate::model::NodeName;
use nalgebra::Point3;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// What was written.
#[derive(Clone, Debug)]
pub struct TablesWritten {
    pub dir: PathBuf,
    pub cylinders: usize,
    /// Whether the tables of a film are among them.
    pub film: bool,
}

impl PreparedTree {
    /// Writes the tables to the folder `dir`, which appears when it is complete. Those of the
    /// document are copied where nothing was changed.
    ///
    /// # Errors
    /// `dir` is there already, a table cannot be read or written, or `stop` was set.
    pub fn write_tables(
        &self,
        dir: &Path,
        stop: &AtomicBool,
    ) -> Result<TablesWritten, PrepareError> {
        let folder = OutputFolder::create(dir)?;
        self.write_tracks(&folder, stop)?;
        if self.has_own_tables() {
            folder.copy("nodes.csv", &self.document.dir, stop)?;
        } else {
            nodes(
                folder.file("nodes.csv")?,
                &self.skeleton,
                &self.sway,
                self.config.export.metres_per_px,
            )?;
        }
        self.write_modes(&folder, stop)?;
        self.write_motion(&folder, stop)?;
        let rows = cylinders_by_branch(&self.dressed.limbs, &self.skeleton);
        let metres_per_px = self.config.export.metres_per_px;
        cylinders(folder.file("cylinders.csv")?, &rows, metres_per_px)?;
        Ok(TablesWritten {
            dir: folder.publish()?,
            cylinders: rows.len(),
            film: self.document.has_motion(),
        })
    }

    /// The wood as the tools of quantitative structure models have it; of a scanned tree where it
    /// stands in the scan.
    pub fn qsm(&self) -> Qsm {
        let scan = self
            .document
            .note
            .scan
            .as_ref()
            .filter(|_| self.config.export.metres_per_px > 0.0);
        Qsm::new(
            &cylinders_by_branch(&self.dressed.limbs, &self.skeleton),
            &self.dressed.limbs,
            &self.skeleton,
            &self.sway,
            self.config.export.metres_per_px,
            scan.map_or(Point3::origin(), |scan| scan.foot_m.into()),
        )
    }

    /// Whether the document's tables are those of this tree.
    fn has_own_tables(&self) -> bool {
        !self.reshaped && self.config.export.metres_per_px == self.document.metres_per_px()
    }

    fn write_tracks(&self, folder: &OutputFolder, stop: &AtomicBool) -> Result<(), WriteError> {
        if !self.document.has_tracks() {
            return Ok(());
        }
        let names: BTreeSet<NodeName> = self.skeleton.nodes.iter().map(|n| n.name).collect();
        let own = &self.document.skeleton;
        // Nothing was measured on copies.
        let mut measured = own.nodes[..own.measured()].iter();
        let all_there = measured.all(|n| names.contains(&n.name));
        let dir = &self.document.dir;
        // Older captures have none.
        if dir.join(CAMERA_FILE).exists() {
            folder.copy(CAMERA_FILE, dir, stop)?;
        }
        for file in [TRACKS_FILE, LEFT_OUT_FILE] {
            // Older captures have left nothing out.
            if !dir.join(file).exists() {
                continue;
            }
            if all_there {
                folder.copy(file, dir, stop)?;
            } else {
                tracks_of(folder, file, dir, &names, stop)?;
            }
        }
        Ok(())
    }

    /// A capture made before there was such a table has none, and that of another tree would be
    /// another one.
    fn write_modes(&self, folder: &OutputFolder, stop: &AtomicBool) -> Result<(), WriteError> {
        let dir = &self.document.dir;
        if self.reshaped || !dir.join(MODES_FILE).exists() {
            return Ok(());
        }
        folder.copy(MODES_FILE, dir, stop)
    }

    fn write_motion(&self, folder: &OutputFolder, stop: &AtomicBool) -> Result<(), PrepareError> {
        if !self.document.has_motion() {
            return Ok(());
        }
        if self.has_own_tables() {
            return Ok(folder.copy("motion.csv", &self.document.dir, stop)?);
        }
        let file = folder.file("motion.csv")?;
        let metres_per_px = self.config.export.metres_per_px;
        let mut motion = MotionCsv::new(file, &self.skeleton, metres_per_px)?;
        // Not only the poses of the animation: `tracks.csv` beside it is of the whole film.
        for pose in self.film()? {
            if stop.load(Ordering::SeqCst) {
                return Err(WriteError::Stopped.into());
            }
            motion.pose(&pose?)?;
        }
        motion.finish()?;
        Ok(())
    }
}

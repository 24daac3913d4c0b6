//! `motion.csv`: the places of all nodes in every frame.

use super::error::DocumentError;
use super::table::{TableReader, TableWriter, px_in_unit, unit};
use crate::files::WriteError;
use crate::model::{Pose, Skeleton};
use crate::motion::PoseEstimator;
use nalgebra::Point3;
use std::collections::VecDeque;
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::Arc;

pub const FILE: &str = "motion.csv";
pub const MOTION_HEADER: &str = "frame,time_s,node_id,x,y,z,u_px,v_px";

const COLUMNS: [&str; 6] = ["frame", "time_s", "node_id", "x", "y", "z"];

/// Writes `motion.csv`.
pub struct MotionCsv<W: Write> {
    table: TableWriter<W>,
    skeleton: Arc<Skeleton>,
    scale: f64,
    decimals: usize,
}

impl<W: Write> MotionCsv<W> {
    /// `metres_per_px` 0 leaves pixels.
    ///
    /// # Errors
    /// The header cannot be written.
    pub fn new(out: W, skeleton: &Arc<Skeleton>, metres_per_px: f64) -> Result<Self, WriteError> {
        let (scale, more) = unit(metres_per_px);
        // One decimal more than other lengths: rounding must not stretch a branch of a few pixels
        // by a thousandth.
        let decimals = 5 + more;
        Ok(Self {
            table: TableWriter::new(FILE, MOTION_HEADER, out)?,
            skeleton: skeleton.clone(),
            scale,
            decimals,
        })
    }

    /// Every node in one frame.
    ///
    /// # Errors
    /// A row cannot be written.
    pub fn pose(&mut self, pose: &Pose) -> Result<(), WriteError> {
        for (joint, node) in pose.joints.iter().zip(&self.skeleton.nodes) {
            self.table.count(pose.frame);
            self.table.number(pose.time_s, 6);
            self.table.count(node.name.0);
            joint
                .position
                .iter()
                .for_each(|x| self.table.number(x * self.scale, self.decimals));
            self.skeleton
                .image_from_model(&joint.position)
                .iter()
                .for_each(|x| self.table.number(*x, 3));
            self.table.end_row()?;
        }
        Ok(())
    }

    /// Ends the file and gives the writer back; without this, errors of the last rows would be
    /// lost.
    ///
    /// # Errors
    /// The last rows cannot be written.
    pub fn finish(self) -> Result<W, WriteError> {
        self.table.finish()
    }
}

/// Places of all nodes in one frame.
pub(super) struct Posture {
    frame: u64,
    time_s: f64,
    places: Vec<Point3<f64>>,
}

impl Posture {
    pub fn pose(&self, estimator: &PoseEstimator) -> Pose {
        estimator.recover(self.frame, self.time_s, &self.places)
    }
}

/// The table frame by frame.
pub(super) struct PoseReader<R: Read> {
    table: TableReader<R, 6>,
    skeleton: Arc<Skeleton>,
    /// Pixels in the unit of the file.
    px: f64,
    /// Frame and time of the one before.
    last: Option<(u64, f64)>,
}

impl PoseReader<File> {
    /// # Errors
    /// The table is missing or damaged.
    pub fn open(
        dir: &Path,
        skeleton: &Arc<Skeleton>,
        metres_per_px: f64,
    ) -> Result<Self, DocumentError> {
        let table = TableReader::open(dir, FILE, COLUMNS)?;
        Ok(Self::of(table, skeleton, metres_per_px))
    }
}

impl<R: Read> PoseReader<R> {
    fn of(table: TableReader<R, 6>, skeleton: &Arc<Skeleton>, metres_per_px: f64) -> Self {
        Self {
            table,
            skeleton: skeleton.clone(),
            px: px_in_unit(metres_per_px),
            last: None,
        }
    }

    /// The next frame; `None` at the end.
    ///
    /// # Errors
    /// The table is damaged, or is of another tree.
    pub fn next(&mut self) -> Result<Option<Posture>, DocumentError> {
        let Some(posture) = self.rows_of_frame()? else {
            return Ok(None);
        };
        if self
            .last
            .is_some_and(|(frame, time_s)| posture.frame <= frame || posture.time_s < time_s)
        {
            return Err(self.table.bad(format!(
                "frame {} does not come after the one before it",
                posture.frame
            )));
        }
        self.last = Some((posture.frame, posture.time_s));
        Ok(Some(posture))
    }

    /// The rows of the next frame: every node of the skeleton, in its order.
    fn rows_of_frame(&mut self) -> Result<Option<Posture>, DocumentError> {
        let mut posture: Option<Posture> = None;
        for i in 0..self.skeleton.nodes.len() {
            if !self.table.next()? {
                return match posture {
                    Some(p) => Err(self
                        .table
                        .bad_end(format!("the table ends in the middle of frame {}", p.frame))),
                    None => Ok(None),
                };
            }
            let (frame, place) = self.row(i)?;
            match &mut posture {
                None => {
                    posture = Some(Posture {
                        frame,
                        time_s: self.table.number(1, "time_s")?,
                        places: vec![place],
                    });
                }
                Some(p) if p.frame == frame => p.places.push(place),
                Some(p) => {
                    return Err(self.table.bad(format!(
                        "frame {} has rows for {i} of {} nodes",
                        p.frame,
                        self.skeleton.nodes.len()
                    )));
                }
            }
        }
        Ok(posture)
    }

    /// Frame and place, px, of the present row, which must be that of node `i`.
    fn row(&self, i: usize) -> Result<(u64, Point3<f64>), DocumentError> {
        let frame = self.table.whole(0, "frame")?;
        let name: u32 = self.table.whole(2, "node_id")?;
        let expected = self.skeleton.nodes[i].name.0;
        if name != expected {
            return Err(self.table.bad(format!(
                "here stands node {name}, where nodes.csv has node {expected}"
            )));
        }
        Ok((frame, self.table.place_px([3, 4, 5], self.px)?))
    }
}

/// What is read of a film: the poses of its end, and the one in the picture.
#[derive(Clone, Debug, Default)]
pub(super) struct FilmEnd {
    pub poses: Vec<Pose>,
    pub pose_in_picture: Option<Pose>,
}

/// The poses of the last `animation_s` of the film, and the one in frame `pictured`. The table goes
/// by row by row, so that a film of hours takes no more room than what is kept of it.
///
/// # Errors
/// The table is damaged, or is of another tree.
pub(super) fn read_end<R: Read>(
    mut reader: PoseReader<R>,
    estimator: &PoseEstimator,
    animation_s: f64,
    pictured: Option<u64>,
) -> Result<FilmEnd, DocumentError> {
    let mut kept: VecDeque<Posture> = VecDeque::new();
    let mut pose_in_picture = None;
    while let Some(posture) = reader.next()? {
        if pictured == Some(posture.frame) {
            pose_in_picture = Some(posture.pose(estimator));
        }
        let oldest_s = posture.time_s - animation_s;
        kept.push_back(posture);
        while kept.front().is_some_and(|p| p.time_s < oldest_s) {
            kept.pop_front();
        }
    }
    Ok(FilmEnd {
        poses: kept.iter().map(|p| p.pose(estimator)).collect(),
        pose_in_picture,
    })
}

/// A pose of `skeleton` as reading it from a file gives it: rounded, its rotations recovered from
/// the places. `None` if a node is at no place that a table can hold.
pub(super) fn as_read(
    pose: &Pose,
    skeleton: &Arc<Skeleton>,
    metres_per_px: f64,
    estimator: &PoseEstimator,
) -> Option<Pose> {
    let mut written = MotionCsv::new(Vec::new(), skeleton, metres_per_px).ok()?;
    written.pose(pose).ok()?;
    let bytes = written.finish().ok()?;
    let table = TableReader::new(FILE.into(), &*bytes, COLUMNS).ok()?;
    let read = PoseReader::of(table, skeleton, metres_per_px).next();
    read.ok().flatten().map(|p| p.pose(estimator))
}

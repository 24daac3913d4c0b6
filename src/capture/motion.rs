//! `motion.csv` back to poses.

use super::CaptureError;
use super::table::Table;
use crate::model::{Pose, Skeleton};
use crate::motion::PoseEstimator;
use nalgebra::Point3;
use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;

const COLUMNS: [&str; 6] = ["frame", "time_s", "node_id", "x", "y", "z"];

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
pub(super) struct Postures {
    table: Table<6>,
    skeleton: Arc<Skeleton>,
    px: f64,
    /// Frame and time of the one before.
    last: Option<(u64, f64)>,
}

impl Postures {
    /// # Errors
    /// The table is missing or damaged.
    pub fn open(
        dir: &Path,
        skeleton: &Arc<Skeleton>,
        metres_per_px: f64,
    ) -> Result<Self, CaptureError> {
        let px = if metres_per_px > 0.0 {
            1.0 / metres_per_px
        } else {
            1.0
        };
        Ok(Self {
            table: Table::open(dir, "motion.csv", COLUMNS)?,
            skeleton: skeleton.clone(),
            px,
            last: None,
        })
    }

    /// The next frame; `None` at the end.
    ///
    /// # Errors
    /// The table is damaged, or is of another tree.
    pub fn next(&mut self) -> Result<Option<Posture>, CaptureError> {
        let Some(posture) = next(&mut self.table, &self.skeleton, self.px)? else {
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
}

/// The poses of the last `animation_s` of the capture, and the one in frame `pictured`. The table
/// goes by row by row, so that a capture of hours takes no more room than what is kept of it.
///
/// # Errors
/// The table is damaged, or is of another tree.
pub(super) fn read(
    mut postures: Postures,
    estimator: &PoseEstimator,
    animation_s: f64,
    pictured: Option<u64>,
) -> Result<(Vec<Pose>, Option<Pose>), CaptureError> {
    let mut kept: VecDeque<Posture> = VecDeque::new();
    let mut in_picture = None;
    while let Some(posture) = postures.next()? {
        if pictured == Some(posture.frame) {
            in_picture = Some(posture.pose(estimator));
        }
        let oldest_s = posture.time_s - animation_s;
        kept.push_back(posture);
        while kept.front().is_some_and(|p| p.time_s < oldest_s) {
            kept.pop_front();
        }
    }
    Ok((kept.iter().map(|p| p.pose(estimator)).collect(), in_picture))
}

/// The rows of the next frame: every node of the skeleton, in its order.
fn next(
    table: &mut Table<6>,
    skeleton: &Skeleton,
    px: f64,
) -> Result<Option<Posture>, CaptureError> {
    let mut posture: Option<Posture> = None;
    for (i, node) in skeleton.nodes.iter().enumerate() {
        if !table.next()? {
            return match posture {
                Some(p) => {
                    Err(table.bad_end(format!("the table ends in the middle of frame {}", p.frame)))
                }
                None => Ok(None),
            };
        }
        let frame: u64 = table.whole(0, "frame")?;
        let name: u32 = table.whole(2, "node_id")?;
        let expected = node.name.0;
        if name != expected {
            return Err(table.bad(format!(
                "here stands node {name}, where nodes.csv has node {expected}"
            )));
        }
        let place = table.place_px([3, 4, 5], px)?;
        match &mut posture {
            None => {
                posture = Some(Posture {
                    frame,
                    time_s: table.number(1, "time_s")?,
                    places: vec![place],
                })
            }
            Some(p) if p.frame == frame => p.places.push(place),
            Some(p) => {
                return Err(table.bad(format!(
                    "frame {} has rows for {i} of {} nodes",
                    p.frame,
                    skeleton.nodes.len()
                )));
            }
        }
    }
    Ok(posture)
}

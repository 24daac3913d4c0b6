//! The swing of leaves on a tree whose motion is a loop.

use crate::config::Config;
use crate::geometry::Dressed;
use crate::model::{LeafSwing, Pose, Skeleton};
use crate::pipeline::flutter;

/// How far each group of leaves swings in every pose of a loop, the last of which is the first
/// again: the leaves come round too.
pub(super) fn looped_flutter(
    dressed: &Dressed,
    poses: &[Pose],
    skeleton: &Skeleton,
    config: &Config,
) -> Vec<Vec<LeafSwing>> {
    let Some(laps) = Laps::of(poses) else {
        return flutter(dressed, poses, skeleton, config);
    };
    let mut config = config.clone();
    // Whole swings in a lap.
    let swings = (config.leaves.frequency_hz * laps.lap_s).round().max(1.0);
    config.leaves.frequency_hz = swings / laps.lap_s;
    let of_lap = poses.len() - 1..2 * poses.len() - 1;
    flutter(dressed, &laps.poses, skeleton, &config)
        .into_iter()
        .map(|all| all[of_lap.clone()].to_vec())
        .collect()
}

/// The poses of a loop with the lap before and the one after: nothing begins or ends in it.
struct Laps {
    poses: Vec<Pose>,
    /// How long one is.
    lap_s: f64,
}

impl Laps {
    /// `None` where there are not two poses.
    fn of(poses: &[Pose]) -> Option<Self> {
        let (first, rest) = poses.split_first()?;
        let lap_s = rest.last()?.time_s - first.time_s;
        let mut all = Vec::with_capacity(3 * poses.len());
        for pose in &poses[..rest.len()] {
            all.push(moved(pose, -lap_s));
        }
        all.extend_from_slice(poses);
        for pose in rest {
            all.push(moved(pose, lap_s));
        }
        Some(Self { poses: all, lap_s })
    }
}

fn moved(pose: &Pose, by_s: f64) -> Pose {
    Pose {
        time_s: pose.time_s + by_s,
        ..pose.clone()
    }
}

//! How far leaves swing in every frame (Li 2011 app. B.2).

use crate::config::Leaves;
use crate::model::{LeafSwing, NodeId, Pose, Skeleton};
use std::f64::consts::TAU;

/// Speeds are means over so long: leaves do not jerk with the noise of single frames.
const SMOOTHED_S: f64 = 0.2;

/// How far each group of leaves swings in every pose.
///
/// A grows with the speed of the group's branches, those above `groups[k]`, and stays below
/// `settings.swing_deg`. A pose of another tree or with a place or a time that is no number counts
/// as still.
pub fn flutter(
    poses: &[Pose],
    skeleton: &Skeleton,
    groups: &[NodeId],
    settings: &Leaves,
) -> Vec<Vec<LeafSwing>> {
    let height = height(skeleton);
    let mut of_groups = Vec::with_capacity(groups.len());
    for group in groups {
        let members = above(skeleton, *group);
        let speeds: Vec<f64> = (0..poses.len())
            .map(|k| speed(poses, k, &members) / height)
            .collect();
        let mut weights = Vec::with_capacity(poses.len());
        for (k, pose) in poses.iter().enumerate() {
            let amplitude = amplitude(smoothed(poses, &speeds, k), settings);
            let phase = TAU * settings.frequency_hz * (pose.time_s - poses[0].time_s);
            weights.push(if phase.is_finite() && amplitude.is_finite() {
                LeafSwing {
                    sine: (amplitude * phase.sin()) as f32,
                    cosine: (amplitude * phase.cos()) as f32,
                }
            } else {
                LeafSwing::default()
            });
        }
        of_groups.push(weights);
    }
    of_groups
}

/// Of leaves on branches that move at `speed` tree heights per second, radians.
fn amplitude(speed: f64, settings: &Leaves) -> f64 {
    // tanh 0.973 = 3/4; beyond it grows no more than leaves can turn.
    settings.swing_deg.to_radians() * (0.973 * speed / settings.swing_speed.max(1e-6)).tanh()
}

/// The node and all above it; all nodes for one that is not there.
fn above(skeleton: &Skeleton, node: NodeId) -> Vec<usize> {
    let mut inside = vec![false; skeleton.nodes.len()];
    for (i, n) in skeleton.nodes.iter().enumerate() {
        inside[i] =
            i == node.index() || n.parent.is_some_and(|p| p.index() < i && inside[p.index()]);
    }
    (0..inside.len()).filter(|&i| inside[i]).collect()
}

/// Mean speed of the nodes from the pose before to pose `k`, px/s.
fn speed(poses: &[Pose], k: usize, members: &[usize]) -> f64 {
    let Some(before) = k.checked_sub(1).map(|b| &poses[b]) else {
        return 0.0;
    };
    let elapsed_s = poses[k].time_s - before.time_s;
    let mut sum_px = 0.0;
    for &i in members {
        if let (Some(is), Some(was)) = (poses[k].joints.get(i), before.joints.get(i)) {
            sum_px += (is.position - was.position).norm();
        }
    }
    let speed = sum_px / members.len().max(1) as f64 / elapsed_s;
    if elapsed_s > 0.0 && speed.is_finite() {
        speed
    } else {
        0.0
    }
}

/// Mean of the speeds of the poses near pose `k`.
fn smoothed(poses: &[Pose], speeds: &[f64], k: usize) -> f64 {
    let before = (0..k).rev().take_while(|&j| near(poses, j, k));
    let after = (k + 1..speeds.len()).take_while(|&j| near(poses, j, k));
    let (mut sum, mut count) = (speeds[k], 1.0);
    for j in before.chain(after) {
        sum += speeds[j];
        count += 1.0;
    }
    sum / count
}

/// Whether poses `j` and `k` are within half of [`SMOOTHED_S`] of each other.
fn near(poses: &[Pose], j: usize, k: usize) -> bool {
    (poses[j].time_s - poses[k].time_s).abs() <= 0.5 * SMOOTHED_S + 1e-9
}

fn height(skeleton: &Skeleton) -> f64 {
    let ys = skeleton
        .nodes
        .iter()
        .map(|n| n.position.y)
        .filter(|y| y.is_finite());
    let (low, high) = ys.fold((f64::MAX, f64::MIN), |(low, high), y| {
        (low.min(y), high.max(y))
    });
    (high - low).max(1e-6)
}

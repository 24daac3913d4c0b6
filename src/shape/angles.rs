//! Branching angles and how likely they are (Li 2011 eq. 4).

use crate::config;
use crate::model::Skeleton;
use nalgebra::Point3;
use std::f64::consts::{FRAC_PI_2, PI};

/// The normal distribution of eq. 4 over branching angles, wider near the root.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Angles {
    /// mu, radians.
    pub expected: f64,
    /// d_max.
    deepest: u8,
    /// Factor on the paper's sigma.
    tolerance: f64,
}

impl Angles {
    /// As they are in `skeleton`, which still lies in its planes.
    pub fn of(skeleton: &Skeleton, settings: &config::Shape) -> Self {
        let deepest = skeleton.deepest_level();
        Self {
            expected: expected_branching_angle(skeleton),
            deepest,
            tolerance: settings.angle_tolerance,
        }
    }

    /// ln of eq. 4 for a branch that ends at `level`, at `angle` (radians) to the one that it grows
    /// from.
    pub fn ln_likelihood(&self, level: u8, angle: f64) -> f64 {
        // sigma_i = pi (d_max - d_i) / d_max; a tip would get 0 and could not move at all, so tips
        // get half a step.
        let above = f64::from(self.deepest.saturating_sub(level)).max(0.5);
        let sigma = self.tolerance * PI * above / f64::from(self.deepest.max(1));
        -(angle - self.expected).powi(2) / (2.0 * sigma * sigma)
    }

    /// Geometric mean of eq. 4 over all branches of `skeleton` above the trunk, 0 to 1: how likely
    /// its angles are.
    pub fn likelihood(&self, skeleton: &Skeleton) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for (i, node) in skeleton.nodes.iter().enumerate() {
            if node.level < 2 {
                continue;
            }
            if let Some(angle) = branching_angle(skeleton, i) {
                sum += self.ln_likelihood(node.level, angle);
                count += 1;
            }
        }
        if count == 0 {
            1.0
        } else {
            (sum / f64::from(count)).exp()
        }
    }
}

/// Angle between the branch a-b and the branch b-c that goes on from it, radians; 0 goes straight
/// on, and is the answer where one of them has no length.
pub(super) fn angle_between(a: &Point3<f64>, b: &Point3<f64>, c: &Point3<f64>) -> f64 {
    (b - a).angle(&(c - b))
}

/// mu of eq. 4: the median of all branching angles of the measured branches, each by the length of
/// the shorter branch, radians; 45 degrees where there are none. The paper's is the mean; but a
/// fork that was found some pixels off turns a short branch right round, and a few such angles of
/// 150 degrees and more would make zigzags the likeliest of branches.
pub fn expected_branching_angle(skeleton: &Skeleton) -> f64 {
    let mut angles: Vec<(f64, f64)> = Vec::new();
    for (i, node) in skeleton.nodes.iter().enumerate() {
        if node.copy_of.is_some() {
            continue;
        }
        let (Some(angle), Some(parent)) = (branching_angle(skeleton, i), node.parent) else {
            continue;
        };
        let shorter = length(skeleton, i).min(length(skeleton, parent.index()));
        if shorter > 0.0 {
            angles.push((angle, shorter));
        }
    }
    angles.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half: f64 = angles.iter().map(|a| a.1).sum::<f64>() / 2.0;
    let mut below = 0.0;
    for (angle, weight) in angles {
        below += weight;
        if below >= half {
            return angle;
        }
    }
    PI / 4.0
}

/// Of branch `i`, px; 0 for the foot.
fn length(skeleton: &Skeleton, i: usize) -> f64 {
    let node = &skeleton.nodes[i];
    node.parent.map_or(0.0, |p| {
        (node.position - skeleton.nodes[p.index()].position).norm()
    })
}

/// By how much branches turn by more than a right angle, in the mean over all of them, radians. Eq.
/// 4 is wide near the root, where the thick limbs are, and does not mind.
pub(super) fn turning_back(skeleton: &Skeleton) -> f64 {
    let all: Vec<f64> = (0..skeleton.nodes.len())
        .filter_map(|i| branching_angle(skeleton, i))
        .collect();
    all.iter()
        .map(|angle| (angle - FRAC_PI_2).max(0.0))
        .sum::<f64>()
        / all.len().max(1) as f64
}

/// Angle at which branch `i` leaves the one that it grows from; `None` for what grows from the
/// ground.
fn branching_angle(skeleton: &Skeleton, i: usize) -> Option<f64> {
    let nodes = &skeleton.nodes;
    let parent = &nodes[nodes[i].parent?.index()];
    let grand = &nodes[parent.parent?.index()];
    Some(angle_between(
        &grand.position,
        &parent.position,
        &nodes[i].position,
    ))
}

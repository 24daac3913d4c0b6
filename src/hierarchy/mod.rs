//! From tracks to the motion hierarchy: recursive two-way normalised cuts on nearness and likeness of motion
//! (Li et al. appendix A, Zeng section 5.4.1).

mod accumulate;
mod affinity;
mod lanczos;
mod ncut;
mod persist;
mod support;

pub use accumulate::{COMPARE_HZ, Evidence, evidence, evidence_of};
pub use ncut::{Cut, normalised_cut};
pub use persist::persisting;
pub use support::{Gain, OnBoth, gain};

use crate::config::Hierarchy;
use crate::model::{Cluster, ClusterId, MotionHierarchy};
use crate::track::TrackTable;
use affinity::{Velocities, affinity, centroid, in_agreement};

/// Fewest points on either side of a cut: one alone is more likely a bad track than a branch.
const MIN_SIDE: usize = 2;

/// Cuts those of the points `moving` (rows of `table`) that agree with their neighbours into a hierarchy; empty if
/// there are none.
pub fn build(table: &TrackTable, moving: &[usize], settings: &Hierarchy) -> MotionHierarchy {
    let rho = Velocities::new(table, moving, |_| true).correlations();
    let rest_px: Vec<[f64; 2]> = moving.iter().map(|&row| rest_position_px(table, row)).collect();
    let cluster = |parent, level, members: &[usize]| Cluster {
        parent,
        level,
        members: members.iter().map(|&i| table.ids[moving[i]]).collect(),
        centroid_px: centroid(&rest_px, members),
    };
    // Breadth first, so that a parent stands before its children and levels follow each other.
    let all = in_agreement(&rho, &rest_px, settings.agreement);
    if all.is_empty() {
        return MotionHierarchy::default();
    }
    let mut clusters = vec![cluster(None, 0, &all)];
    let mut members = vec![all];
    let mut next = 0;
    while next < clusters.len() {
        let level = clusters[next].level;
        let points = &members[next];
        let mut parts: Vec<Vec<usize>> = Vec::new();
        if u32::from(level) + 1 < settings.levels && points.len() >= settings.min_points as usize {
            let w = affinity(&rho, &rest_px, points, settings.distance_scale, settings.correlation_power);
            if let Some(cut) = normalised_cut(&w, MIN_SIDE) {
                let side = |first: bool| points.iter().zip(&cut.first_side).filter(move |(_, s)| **s == first);
                parts = [true, false].map(|first| side(first).map(|(&i, _)| i).collect()).into();
            }
        }
        for part in parts {
            clusters.push(cluster(Some(ClusterId(next as u32)), level + 1, &part));
            members.push(part);
        }
        next += 1;
    }
    MotionHierarchy { clusters }
}

/// Median position of a track: where the tree rests, whatever pose it was first seen in.
pub fn rest_position_px(table: &TrackTable, row: usize) -> [f64; 2] {
    let median = |c: usize| {
        let mut values: Vec<f32> = table.positions[row].iter().flatten().map(|p| p[c]).collect();
        values.sort_unstable_by(f32::total_cmp);
        values.get(values.len() / 2).copied().map_or(0.0, f64::from)
    };
    [median(0), median(1)]
}

//! From tracks to the motion hierarchy: which points move together, and where they part.
//!
//! By default average linkage over the affinity of [`path`]. `affinity = "zeng"` is the papers'
//! method: recursive two-way normalised cuts on nearness and correlation of motion (Li 2011 app. A,
//! Zeng 2015 sect. 5.4.1).

mod accumulate;
mod agreement;
mod axis;
mod certainty;
mod cut;
mod dendrogram;
mod ends;
mod lanczos;
mod left_out;
mod linkage;
mod ncut;
mod own_motion;
mod path;
mod persist;
mod rest;
mod root_paths;
mod signals;
mod support;
mod table;
mod zeng;

pub use accumulate::{COMPARE_HZ, Evidence, evidence, seen};
pub use left_out::left_out;
pub use ncut::{Cut, normalised_cut};
pub use persist::persisting;
pub use rest::rest_position_px;
pub use support::{Gain, OnBoth, gain};
pub use table::table;

use crate::config::{Affinity, Hierarchy};
use crate::model::{Cluster, ClusterId, MotionHierarchy, TrackId, TrackTable};
use agreement::in_agreement;
use cut::{MIN_SIDE, cut_dendrogram};
use dendrogram::Dendrogram;
use nalgebra::Point2;
use rest::centroid;
use signals::Signals;

/// Puts those of the points `moving` (rows of `table`) that agree with their neighbours into a
/// hierarchy; empty if there are none. `foot_px` is where the tree leaves the ground.
pub fn build(
    table: &TrackTable,
    moving: &[usize],
    foot_px: Point2<f64>,
    settings: &Hierarchy,
) -> MotionHierarchy {
    let points = Points::in_agreement(table, moving, settings.agreement);
    if points.rows.is_empty() {
        return MotionHierarchy::default();
    }
    let displacements = Signals::displacements(table, &points.rows);
    let (tree, paths) = match settings.affinity {
        Affinity::Path => {
            let (affinity, paths) =
                path::affinity(&displacements, &points.rest_px, foot_px, settings);
            let merges = linkage::average_linkage(affinity);
            (Dendrogram::merged(points.rows.len(), &merges), Some(paths))
        }
        Affinity::Zeng => {
            let velocities = Signals::velocities(table, &points.rows, |_| true);
            (cut_in_two(&velocities, &points.rest_px, settings), None)
        }
    };
    let axis = match &paths {
        Some(paths) => axis::axis_parts(&tree, &paths.shared),
        None => vec![false; tree.parts.len()],
    };
    let certain = certainty::certainties(&tree, &displacements, &table.times_s);
    let nodes = cut_dendrogram(&tree, &certain, &axis, settings);
    let ends_px = match &paths {
        Some(paths) => {
            let ends_px = ends::ends_px(&nodes, &tree, &paths.edges, &points.rest_px, foot_px);
            ends_px.into_iter().map(Some).collect()
        }
        None => vec![None; nodes.len()],
    };
    let mut clusters = Vec::with_capacity(nodes.len());
    for (node, end_px) in nodes.into_iter().zip(ends_px) {
        let of_node = tree.points(node.part);
        clusters.push(Cluster {
            parent: node.parent.map(|p| ClusterId(p as u32)),
            level: node.level,
            members: points.ids(of_node, table),
            centroid_px: centroid(&points.rest_px, of_node),
            end_px,
            certainty: node.certainty,
        });
    }
    MotionHierarchy { clusters }
}

/// The points that a hierarchy is built from.
struct Points {
    /// Their rows of the table.
    rows: Vec<usize>,
    rest_px: Vec<Point2<f64>>,
}

impl Points {
    /// Those of the rows `moving` that move as their neighbours do, see [`in_agreement`].
    fn in_agreement(table: &TrackTable, moving: &[usize], agreement: f64) -> Self {
        let rest_px: Vec<Point2<f64>> = moving
            .iter()
            .map(|&row| rest_position_px(table, row))
            .collect();
        let velocities = Signals::velocities(table, moving, |_| true);
        let kept = in_agreement(&velocities, &rest_px, agreement);
        Self {
            rows: kept.iter().map(|&i| moving[i]).collect(),
            rest_px: kept.iter().map(|&i| rest_px[i]).collect(),
        }
    }

    /// Ids of some of them, in ascending order.
    fn ids(&self, points: &[usize], table: &TrackTable) -> Vec<TrackId> {
        let mut ids: Vec<TrackId> = points.iter().map(|&i| table.ids[self.rows[i]]).collect();
        ids.sort_unstable();
        ids
    }
}

/// The papers' recursive normalised cuts.
fn cut_in_two(velocities: &Signals, rest_px: &[Point2<f64>], settings: &Hierarchy) -> Dendrogram {
    let rho = velocities.correlations();
    Dendrogram::divided((0..rest_px.len()).collect(), |points, depth| {
        if depth + 1 >= settings.levels || points.len() < settings.min_points as usize {
            return None;
        }
        let w = zeng::affinity(
            &rho,
            rest_px,
            points,
            settings.distance_scale,
            settings.correlation_power,
        );
        normalised_cut(&w, MIN_SIDE).map(|cut| cut.first_side)
    })
}

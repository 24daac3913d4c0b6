//! From tracks to the motion hierarchy: which points move together, and where they part.
//!
//! By default average linkage over the likeness of [`path`]. `affinity = "zeng"` is the papers'
//! method: recursive two-way normalised cuts on nearness and likeness of motion (Li et al. appendix
//! A, Zeng section 5.4.1).

mod accumulate;
mod agreement;
mod arrange;
mod binary;
mod certainty;
mod common_way;
mod ends;
mod lanczos;
mod linkage;
mod ncut;
mod path;
mod persist;
mod rest;
mod signals;
mod stems;
mod support;
mod table;
mod zeng;

pub use accumulate::{COMPARE_HZ, Evidence, evidence};
pub use ncut::{Cut, normalised_cut};
pub use persist::persisting;
pub use rest::rest_position_px;
pub use support::{Gain, OnBoth, gain};
pub use table::table;

use crate::config::{Affinity, Hierarchy};
use crate::model::TrackTable;
use crate::model::{Cluster, ClusterId, MotionHierarchy};
use agreement::in_agreement;
use arrange::arranged;
use binary::Binary;
use rest::centroid;
use signals::Signals;

/// Fewest points on either side of a cut: one alone is more likely a bad track than a branch.
const MIN_SIDE: usize = 2;

/// Puts those of the points `moving` (rows of `table`) that agree with their neighbours into a
/// hierarchy; empty if there are none. `foot_px` is where the tree leaves the ground.
pub fn build(
    table: &TrackTable,
    moving: &[usize],
    foot_px: [f64; 2],
    settings: &Hierarchy,
) -> MotionHierarchy {
    let rest_px: Vec<[f64; 2]> = moving
        .iter()
        .map(|&row| rest_position_px(table, row))
        .collect();
    let velocities = Signals::velocities(table, moving, |_| true);
    // Indices into `moving`.
    let kept = in_agreement(&velocities, &rest_px, settings.agreement);
    if kept.is_empty() {
        return MotionHierarchy::default();
    }
    let rows: Vec<usize> = kept.iter().map(|&i| moving[i]).collect();
    let rest_px: Vec<[f64; 2]> = kept.iter().map(|&i| rest_px[i]).collect();
    let displacements = Signals::displacements(table, &rows);
    let (tree, stems, reached) = match settings.affinity {
        Affinity::Path => {
            let (likeness, ways) = path::likeness(&displacements, &rest_px, foot_px, settings);
            let tree = Binary::merged(rows.len(), &linkage::average_linkage(likeness));
            let stems = stems::stems(&tree, &ways.common);
            (tree, stems, ways.reached)
        }
        Affinity::Zeng => {
            let tree = cut_in_two(
                &Signals::velocities(table, &rows, |_| true),
                &rest_px,
                settings,
            );
            let stems = vec![false; tree.parts.len()];
            (tree, stems, Vec::new())
        }
    };
    let certain = certainty::certainties(&tree, &displacements, &table.times_s);
    let nodes = arranged(&tree, &certain, &stems, settings);
    let ends_px = match settings.affinity {
        Affinity::Path => ends::ends_px(&nodes, &tree, &reached, &rest_px, foot_px)
            .into_iter()
            .map(Some)
            .collect(),
        Affinity::Zeng => vec![None; nodes.len()],
    };
    let cluster = |(node, end_px): (arrange::Node, Option<[f64; 2]>)| {
        let points = tree.points(node.part);
        let mut members: Vec<_> = points.iter().map(|&i| table.ids[rows[i]]).collect();
        members.sort_unstable();
        Cluster {
            parent: node.parent.map(|p| ClusterId(p as u32)),
            level: node.level,
            members,
            centroid_px: centroid(&rest_px, points),
            end_px,
            certainty: node.certainty,
        }
    };
    MotionHierarchy {
        clusters: nodes.into_iter().zip(ends_px).map(cluster).collect(),
    }
}

/// The papers' recursive normalised cuts.
fn cut_in_two(velocities: &Signals, rest_px: &[[f64; 2]], settings: &Hierarchy) -> Binary {
    let rho = velocities.correlations();
    Binary::divided((0..rest_px.len()).collect(), |points, depth| {
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

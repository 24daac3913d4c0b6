//! Settings of the hierarchy.

use serde::{Deserialize, Serialize};

/// Which points move together: average linkage, or recursive normalised cuts (Li 2011 app. A, Zeng
/// 2015 sect. 5.4.1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Hierarchy {
    /// Levels of the hierarchy, the whole tree included, 2 to 10; the papers take 4 to 7.
    pub levels: u32,
    /// `path`, or `zeng` as in the papers.
    pub affinity: Affinity,
    /// `path`: power of the likeness of motion.
    pub motion_power: f64,
    /// `path`: weight of the way from the foot that two points share.
    pub path_weight: f64,
    /// `zeng`: reach of the distance affinity, as a share of the cluster's own extent.
    pub distance_scale: f64,
    /// `zeng`: power of the velocity correlation; 1 is the paper's.
    pub correlation_power: f64,
    /// Branches that may leave at one place, where it is not sure which leaves first; 2 is the
    /// papers'.
    pub max_children: u32,
    /// Splits less sure than this are not made, 0 to 1.
    pub min_certainty: f64,
    /// Points whose motion correlates less than this with that of the points around them are left
    /// out, -1 to 1.
    pub agreement: f64,
    /// Clusters of fewer points are not cut.
    pub min_points: u32,
}

/// How points are put together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Affinity {
    Path,
    Zeng,
}

impl Default for Hierarchy {
    fn default() -> Self {
        Self {
            levels: 7,
            affinity: Affinity::Path,
            motion_power: 4.0,
            path_weight: 4.0,
            distance_scale: 1.0,
            correlation_power: 1.0,
            max_children: 4,
            min_certainty: 0.5,
            agreement: 0.7,
            min_points: 4,
        }
    }
}

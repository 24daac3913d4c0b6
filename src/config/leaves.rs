//! Settings of the leaves.

use serde::{Deserialize, Serialize};

/// Leaves: where, how many, how they swing (Li 2011 app. B and sect. 6).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Leaves {
    /// Whether the tree is drawn in leaf.
    pub show: LeafShow,
    /// Harris points that are looked for in the picture as seeds of leaf clusters.
    pub seeds: u32,
    /// Triangles of all leaves at most. Fewer clusters are drawn larger, so that the area stays
    /// (section 6).
    pub triangles: u32,
    /// How fast leaf clusters oscillate, Hz: omega / 2 pi of B.2.
    pub frequency_hz: f64,
    /// Amplitude A of B.2 that is never exceeded, degrees.
    pub swing_deg: f64,
    /// Speed of a branch at which its leaves swing three quarters as far as that, heights of the
    /// tree a second.
    pub swing_speed: f64,
}

/// Whether leaves are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LeafShow {
    /// Where the picture shows a tree in leaf.
    Auto,
    On,
    Off,
}

impl Default for Leaves {
    fn default() -> Self {
        Self {
            show: LeafShow::Auto,
            seeds: 1500,
            triangles: 20_000,
            frequency_hz: 3.0,
            swing_deg: 20.0,
            swing_speed: 0.3,
        }
    }
}

impl Leaves {
    /// Key, value, and the range that is allowed, in words as well.
    pub(super) fn rules(&self) -> Vec<(&'static str, f64, (f64, f64, &'static str))> {
        vec![
            (
                "leaves.seeds",
                self.seeds.into(),
                (400.0, 5000.0, "400 to 5000"),
            ),
            (
                "leaves.triangles",
                self.triangles.into(),
                (1000.0, 200_000.0, "1000 to 200000"),
            ),
            (
                "leaves.frequency_hz",
                self.frequency_hz,
                (0.1, 10.0, "0.1 to 10"),
            ),
            ("leaves.swing_deg", self.swing_deg, (0.0, 60.0, "0 to 60")),
            (
                "leaves.swing_speed",
                self.swing_speed,
                (0.01, 10.0, "0.01 to 10"),
            ),
        ]
    }
}

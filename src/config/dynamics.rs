//! Settings of the sway: frequency and damping.

use serde::{Deserialize, Serialize};

/// Sway frequency and damping of every branch (Hu et al. sect. 5).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Dynamics {
    /// What made the tree sway.
    pub excitation: Excited,
    /// The last seconds of a film that are analysed, s.
    pub window_s: f64,
    /// While it films the sway is told anew after so much film, s; 0 only at the end.
    pub every_s: f64,
    /// Highest frequency that a branch of the tree may have, Hz.
    pub highest_hz: f64,
    /// Half the 95 % interval of a frequency at most, as a share of it; what is less sure counts as
    /// not identified.
    pub widest: f64,
}

/// What is said to have made the tree sway.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Excited {
    /// The signal tells.
    Auto,
    /// Pulled and let go.
    Release,
    Wind,
}

impl Default for Dynamics {
    fn default() -> Self {
        Self {
            excitation: Excited::Auto,
            window_s: 60.0,
            every_s: 1.0,
            highest_hz: 5.0,
            widest: 0.05,
        }
    }
}

impl Dynamics {
    /// Key, value, and the range that is allowed, in words as well.
    pub(super) fn rules(&self) -> Vec<(&'static str, f64, (f64, f64, &'static str))> {
        vec![
            ("dynamics.window_s", self.window_s, (5.0, 600.0, "5 to 600")),
            (
                "dynamics.every_s",
                self.every_s,
                (0.0, 600.0, "0 (only at the end) to 600"),
            ),
            (
                "dynamics.highest_hz",
                self.highest_hz,
                (0.5, 20.0, "0.5 to 20"),
            ),
            ("dynamics.widest", self.widest, (0.001, 0.5, "0.001 to 0.5")),
        ]
    }
}

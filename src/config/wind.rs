//! Settings of the wind that a tree is animated in.

use serde::{Deserialize, Serialize};

/// Wind, and how a tree answers to it (Hu et al. sect. 6).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Wind {
    /// Strength on the Beaufort scale; 0 is still.
    pub force: f64,
    /// Where it blows to, degrees about the trunk: 0 to the right of the picture, 90 away from the
    /// camera.
    pub direction_deg: f64,
    /// Standard deviation of its speed, as a share of the mean.
    pub gusts: f64,
    /// How long gusts last, s: below one in so many seconds the spectrum is flat.
    pub gust_s: f64,
    /// The power of a gust falls with its frequency to the minus beta (1/f^beta noise).
    pub beta: f64,
    /// Height of the tree where the model has no scale, m: gusts need their time to travel across
    /// it.
    pub tree_height_m: f64,
    /// Sway of the trunk where the capture has no frequency at all, Hz.
    pub trunk_hz: f64,
    /// Damping ratio where the capture has none.
    pub damping_ratio: f64,
    /// How far a branch leans against the one that carries it in steady wind of force 6, degrees:
    /// the median.
    pub bend_deg: f64,
    /// A branch turns at most so far against the one that carries it, degrees.
    pub max_bend_deg: f64,
    /// Another number gives other gusts.
    pub seed: u32,
}

impl Default for Wind {
    fn default() -> Self {
        Self {
            force: 4.0,
            direction_deg: 0.0,
            gusts: 0.35,
            gust_s: 6.0,
            beta: 5.0 / 3.0,
            tree_height_m: 10.0,
            trunk_hz: 0.7,
            damping_ratio: 0.06,
            bend_deg: 1.5,
            max_bend_deg: 40.0,
            seed: 1,
        }
    }
}

impl Wind {
    /// Key, value, and the range that is allowed, in words as well.
    pub(super) fn rules(&self) -> Vec<(&'static str, f64, (f64, f64, &'static str))> {
        vec![
            ("wind.force", self.force, (0.0, 12.0, "0 (still) to 12")),
            (
                "wind.direction_deg",
                self.direction_deg,
                (-360.0, 360.0, "-360 to 360"),
            ),
            ("wind.gusts", self.gusts, (0.0, 1.0, "0 (steady) to 1")),
            ("wind.gust_s", self.gust_s, (0.5, 60.0, "0.5 to 60")),
            ("wind.beta", self.beta, (0.0, 4.0, "0 to 4")),
            (
                "wind.tree_height_m",
                self.tree_height_m,
                (0.1, 100.0, "0.1 to 100"),
            ),
            ("wind.trunk_hz", self.trunk_hz, (0.02, 10.0, "0.02 to 10")),
            (
                "wind.damping_ratio",
                self.damping_ratio,
                (0.001, 1.0, "0.001 to 1"),
            ),
            ("wind.bend_deg", self.bend_deg, (0.01, 20.0, "0.01 to 20")),
            (
                "wind.max_bend_deg",
                self.max_bend_deg,
                (1.0, 80.0, "1 to 80"),
            ),
        ]
    }
}

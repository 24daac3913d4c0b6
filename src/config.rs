//! Settings: plain structs whose defaults are the documented ones. A file overrides a default, the
//! command line a file.

mod dynamics;
mod hierarchy;
mod leaves;
mod overlay;
mod reload;
mod shape;
mod wind;
mod wood;

pub use dynamics::{Dynamics, Excited};
pub use hierarchy::{Affinity, Hierarchy};
pub use leaves::{LeafShow, Leaves};
pub use reload::{Change, EFFECTS, Effect, effect};
pub use shape::{EnvelopeKind, Leader, Shape};
pub use wind::Wind;
pub use wood::Wood;

use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Duration;

/// Everything that can be set, one section a stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    pub camera: Camera,
    pub outline: Outline,
    pub detect: Detect,
    pub track: Track,
    pub accumulate: Accumulate,
    pub hierarchy: Hierarchy,
    pub skeleton: Skeleton,
    pub shape: Shape,
    pub wood: Wood,
    pub leaves: Leaves,
    pub motion: Motion,
    pub dynamics: Dynamics,
    pub wind: Wind,
    pub export: Export,
}

/// What is asked of a V4L2 camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Camera {
    /// `auto` (the best that the camera lists at that size and rate), or one of the formats.
    pub format: CameraFormat,
    pub width: u32,
    pub height: u32,
    pub rate_hz: u32,
    /// Take what the camera gives instead of what was asked for.
    pub accept_format: bool,
    /// Silence after which the camera counts as hung, s.
    pub timeout_s: f64,
    /// Wait for a camera that was lost and go on; else the capture ends.
    pub reconnect: bool,
    /// Time between two attempts to start a lost camera that is there again, s.
    pub retry_delay_s: f64,
    /// What the camera is read through.
    pub backend: Backend,
}

impl Camera {
    /// [`timeout_s`](Self::timeout_s) as a duration.
    pub fn time_limit(&self) -> Duration {
        Duration::from_secs_f64(self.timeout_s.clamp(0.001, 1e6))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    V4l2,
    Nokhwa,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraFormat {
    Auto,
    Mjpeg,
    Yuyv,
    Uyvy,
    Nv12,
    Grey,
    Rgb24,
}

/// Automatic outline: where motion energy concentrates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Outline {
    /// Time over which motion energy is gathered before the region is closed, s.
    pub gather_s: f64,
    /// Time after which the whole picture is taken for lack of motion, s.
    pub give_up_s: f64,
}

/// Harris corners (Li 2011 app. A, Zeng 2015 sect. 5.3.2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Detect {
    /// Number of points to look for.
    pub points: u32,
    /// Least distance between two points, px at 640 px picture width; grows with the picture.
    pub min_distance_px: f64,
    /// Least corner response, as a share of the strongest corner's.
    pub quality: f64,
    /// Points nearer to the outline's border than this are not taken, px at 640 px picture width.
    pub border_px: f64,
}

/// Pyramidal Lucas-Kanade with forward-backward check.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Track {
    /// Side of the window, px, odd.
    pub window_px: u32,
    /// Pyramid levels above the picture itself.
    pub levels: u32,
    /// Largest distance between a point and itself tracked forward and back, px.
    pub fb_limit_px: f64,
    /// Every point is compared with the picture it was detected in once in so many frames; 0 never.
    pub anchor_every: u32,
    /// Least normalised cross-correlation with that picture for the point to be put back on it.
    pub anchor_ncc: f64,
    /// Time for which a point that is not seen may ride on its neighbours before it is given up, s.
    pub coast_s: f64,
}

/// When enough motion has been seen to build.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Accumulate {
    /// Tracks are remembered for so long, s.
    pub window_s: f64,
    /// The tree is not built before so much has been seen, s.
    pub min_s: f64,
    /// Measure from which on the tree is built, 0 to 1.
    pub threshold: f64,
    /// A point moves if its displacement is so many times the tracking noise.
    pub moving_snr: f64,
    /// For so long after it was built the tree is refined as more is seen, s; 0 never.
    pub refine_s: f64,
}

/// 2D skeleton (Li 2011 app. A).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Skeleton {
    /// Share of the way to its parent by which a node is folded.
    pub fold: f64,
}

/// 3D pose (Li 2011 sect. 4).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Motion {
    /// `probabilistic` (section 4.2) or `deterministic` (section 4.1).
    pub method: MotionMethod,
    /// Standard deviation of the observed positions, px (eq. 8).
    pub sigma_track_px: f64,
    /// Standard deviation of the branching angle at the root and at the tips, degrees (eq. 10).
    pub sigma_shape_root_deg: f64,
    pub sigma_shape_tip_deg: f64,
    /// How fast a branch is expected to lean towards the viewer or away, degrees a second (standard
    /// deviation): the picture hardly shows it, so tracking noise would else make the tree tremble
    /// in depth.
    pub depth_rate_deg_s: f64,
    /// Largest rotation of a branch against its parent from one frame to the next (in 1/30 s, where
    /// frames are rarer), degrees.
    pub max_step_deg: f64,
    /// Largest accumulated rotation of a branch against its parent, degrees.
    pub max_total_deg: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MotionMethod {
    Probabilistic,
    Deterministic,
}

/// Files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Export {
    /// Length of the animation in the model at most, s; the last so many seconds are taken.
    pub animation_s: f64,
    /// Metres in a pixel at the tree; 0 leaves the model in pixels.
    pub metres_per_px: f64,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            format: CameraFormat::Auto,
            width: 1280,
            height: 720,
            rate_hz: 30,
            accept_format: false,
            timeout_s: 3.0,
            reconnect: true,
            retry_delay_s: 0.5,
            backend: Backend::V4l2,
        }
    }
}
impl Default for Outline {
    fn default() -> Self {
        Self {
            gather_s: 2.0,
            give_up_s: 20.0,
        }
    }
}
impl Default for Detect {
    fn default() -> Self {
        Self {
            points: 400,
            min_distance_px: 5.0,
            quality: 0.0005,
            border_px: 5.0,
        }
    }
}
impl Default for Track {
    fn default() -> Self {
        Self {
            window_px: 15,
            levels: 3,
            fb_limit_px: 1.0,
            anchor_every: 2,
            anchor_ncc: 0.6,
            coast_s: 5.0,
        }
    }
}
impl Default for Accumulate {
    fn default() -> Self {
        Self {
            window_s: 20.0,
            min_s: 8.0,
            threshold: 0.4,
            moving_snr: 4.0,
            refine_s: 120.0,
        }
    }
}
impl Default for Skeleton {
    fn default() -> Self {
        Self { fold: 0.4 }
    }
}
impl Default for Motion {
    fn default() -> Self {
        Self {
            method: MotionMethod::Probabilistic,
            sigma_track_px: 1.0,
            sigma_shape_root_deg: 10.0,
            sigma_shape_tip_deg: 30.0,
            depth_rate_deg_s: 60.0,
            max_step_deg: 20.0,
            max_total_deg: 70.0,
        }
    }
}
impl Default for Export {
    fn default() -> Self {
        Self {
            animation_s: 60.0,
            metres_per_px: 0.0,
        }
    }
}

/// Why a configuration was not taken; the text names file, line and key.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    #[error("cannot read configuration {path}: {source}; check the name")]
    Unreadable {
        path: String,
        source: std::io::Error,
    },
    #[error("configuration {path}, line {line}: {what}")]
    BadEntry {
        path: String,
        line: usize,
        what: String,
    },
    #[error("configuration: {key} = {value} is out of range; allowed: {allowed}")]
    OutOfRange {
        key: &'static str,
        value: f64,
        allowed: &'static str,
    },
}

impl Config {
    /// Reads a TOML file over the defaults.
    ///
    /// # Errors
    /// The file cannot be read, is no TOML, has an unknown key or a value of the wrong kind or out
    /// of range.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let shown = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| ConfigError::Unreadable {
            path: shown.clone(),
            source,
        })?;
        Self::parse(&text, &shown)
    }

    /// Takes the text of a TOML file over the defaults; `name` is for messages.
    ///
    /// # Errors
    /// As for [`Config::load`].
    pub fn parse(text: &str, name: &str) -> Result<Self, ConfigError> {
        let config: Config = toml::from_str(text).map_err(|e| {
            let at = e.span().map_or(0, |s| s.start);
            let line = text[..at.min(text.len())].matches('\n').count() + 1;
            ConfigError::BadEntry {
                path: name.into(),
                line,
                what: e.message().replace('\n', " "),
            }
        })?;
        config.check()?;
        Ok(config)
    }

    /// Refuses values with which a stage could not work.
    ///
    /// # Errors
    /// The first value that is out of its range.
    pub fn check(&self) -> Result<(), ConfigError> {
        let positive = (f64::MIN_POSITIVE, 1e9, "greater than 0");
        let share = (0.0, 1.0, "0 to 1");
        let rules = vec![
            (
                "camera.width",
                self.camera.width.into(),
                (16.0, 16384.0, "16 to 16384"),
            ),
            (
                "camera.height",
                self.camera.height.into(),
                (16.0, 16384.0, "16 to 16384"),
            ),
            (
                "camera.rate_hz",
                self.camera.rate_hz.into(),
                (1.0, 1000.0, "1 to 1000"),
            ),
            (
                "camera.timeout_s",
                self.camera.timeout_s,
                (0.05, 3600.0, "0.05 to 3600"),
            ),
            (
                "camera.retry_delay_s",
                self.camera.retry_delay_s,
                (0.05, 3600.0, "0.05 to 3600"),
            ),
            (
                "outline.gather_s",
                self.outline.gather_s,
                (0.1, 60.0, "0.1 to 60"),
            ),
            (
                "outline.give_up_s",
                self.outline.give_up_s,
                (0.1, 3600.0, "0.1 to 3600"),
            ),
            (
                "detect.points",
                self.detect.points.into(),
                (16.0, 2000.0, "16 to 2000"),
            ),
            (
                "detect.min_distance_px",
                self.detect.min_distance_px,
                (1.0, 100.0, "1 to 100"),
            ),
            (
                "detect.quality",
                self.detect.quality,
                (1e-9, 1.0, "above 0, at most 1"),
            ),
            (
                "detect.border_px",
                self.detect.border_px,
                (0.0, 100.0, "0 to 100"),
            ),
            (
                "track.window_px",
                self.track.window_px.into(),
                (5.0, 61.0, "5 to 61"),
            ),
            (
                "track.levels",
                self.track.levels.into(),
                (0.0, 6.0, "0 to 6"),
            ),
            ("track.fb_limit_px", self.track.fb_limit_px, positive),
            ("track.anchor_ncc", self.track.anchor_ncc, share),
            ("track.coast_s", self.track.coast_s, (0.0, 60.0, "0 to 60")),
            (
                "accumulate.window_s",
                self.accumulate.window_s,
                (1.0, 120.0, "1 to 120"),
            ),
            (
                "accumulate.min_s",
                self.accumulate.min_s,
                (0.2, 100.0, "0.2 to 100"),
            ),
            ("accumulate.threshold", self.accumulate.threshold, share),
            (
                "accumulate.moving_snr",
                self.accumulate.moving_snr,
                positive,
            ),
            (
                "accumulate.refine_s",
                self.accumulate.refine_s,
                (0.0, 3600.0, "0 (never) to 3600"),
            ),
            (
                "hierarchy.levels",
                self.hierarchy.levels.into(),
                (2.0, 10.0, "2 to 10"),
            ),
            (
                "hierarchy.motion_power",
                self.hierarchy.motion_power,
                (0.1, 32.0, "0.1 to 32"),
            ),
            (
                "hierarchy.path_weight",
                self.hierarchy.path_weight,
                (0.0, 100.0, "0 to 100"),
            ),
            (
                "hierarchy.max_children",
                self.hierarchy.max_children.into(),
                (2.0, 64.0, "2 to 64"),
            ),
            (
                "hierarchy.min_certainty",
                self.hierarchy.min_certainty,
                share,
            ),
            (
                "hierarchy.distance_scale",
                self.hierarchy.distance_scale,
                positive,
            ),
            (
                "hierarchy.correlation_power",
                self.hierarchy.correlation_power,
                (0.1, 32.0, "0.1 to 32"),
            ),
            (
                "hierarchy.agreement",
                self.hierarchy.agreement,
                (-1.0, 1.0, "-1 to 1"),
            ),
            (
                "hierarchy.min_points",
                self.hierarchy.min_points.into(),
                (2.0, 1000.0, "2 to 1000"),
            ),
            (
                "skeleton.fold",
                self.skeleton.fold,
                (0.0, 0.95, "0 to 0.95"),
            ),
            (
                "shape.planes",
                self.shape.planes.into(),
                (1.0, 8.0, "1 to 8"),
            ),
            (
                "shape.attractors",
                self.shape.attractors.into(),
                (8.0, 5000.0, "8 to 5000"),
            ),
            (
                "shape.push_options",
                self.shape.push_options.into(),
                (1.0, 1001.0, "1 to 1001"),
            ),
            (
                "shape.push_range",
                self.shape.push_range,
                (0.0, 2.0, "0 to 2"),
            ),
            (
                "shape.passes",
                self.shape.passes.into(),
                (1.0, 20.0, "1 to 20"),
            ),
            (
                "shape.angle_tolerance",
                self.shape.angle_tolerance,
                (0.01, 100.0, "0.01 to 100"),
            ),
            ("wood.curl", self.wood.curl, share),
            (
                "wood.twig_px",
                self.wood.twig_px,
                (0.0, 500.0, "0 (no twigs) to 500"),
            ),
            (
                "wood.max_twigs",
                self.wood.max_twigs.into(),
                (0.0, 50_000.0, "0 to 50000"),
            ),
            (
                "wood.trunk_width_px",
                self.wood.trunk_width_px,
                (0.0, 1000.0, "0 (measured) to 1000"),
            ),
            (
                "wood.triangles",
                self.wood.triangles.into(),
                (100.0, 1e6, "100 to 1000000"),
            ),
        ];
        let motion = &self.motion;
        let more = [
            ("motion.sigma_track_px", motion.sigma_track_px, positive),
            (
                "motion.sigma_shape_root_deg",
                motion.sigma_shape_root_deg,
                positive,
            ),
            (
                "motion.sigma_shape_tip_deg",
                motion.sigma_shape_tip_deg,
                positive,
            ),
            ("motion.depth_rate_deg_s", motion.depth_rate_deg_s, positive),
            (
                "motion.max_step_deg",
                motion.max_step_deg,
                (0.01, 180.0, "0.01 to 180"),
            ),
            (
                "motion.max_total_deg",
                motion.max_total_deg,
                (0.01, 180.0, "0.01 to 180"),
            ),
            (
                "export.animation_s",
                self.export.animation_s,
                (0.1, 3600.0, "0.1 to 3600"),
            ),
            (
                "export.metres_per_px",
                self.export.metres_per_px,
                (0.0, 1e6, "0 (pixels) or more"),
            ),
        ];
        for (key, value, (low, high, allowed)) in rules
            .into_iter()
            .chain(more)
            .chain(self.leaves.rules())
            .chain(self.dynamics.rules())
            .chain(self.wind.rules())
        {
            if !(low..=high).contains(&value) {
                return Err(ConfigError::OutOfRange {
                    key,
                    value,
                    allowed,
                });
            }
        }
        if self.accumulate.min_s > 0.9 * self.accumulate.window_s {
            // The memory would never span that time, and the tree never be built.
            let value = self.accumulate.min_s;
            let allowed = "at most nine tenths of accumulate.window_s";
            return Err(ConfigError::OutOfRange {
                key: "accumulate.min_s",
                value,
                allowed,
            });
        }
        if self.track.window_px.is_multiple_of(2) {
            let value = self.track.window_px.into();
            return Err(ConfigError::OutOfRange {
                key: "track.window_px",
                value,
                allowed: "an odd number",
            });
        }
        Ok(())
    }
}

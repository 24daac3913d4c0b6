//! `capture.json`: what was filmed, with what, how well. No date of today, so that a replay gives
//! the same file.

use super::ExportError;
use crate::config::Config;
use serde::{Deserialize, Serialize};

/// Grows when a reader of older files would misread a newer one.
pub const SCHEMA_VERSION: u32 = 1;

/// At most so many gaps are listed; the counts in [`Timing`] are complete.
pub const MAX_GAPS: usize = 1000;

/// The whole of `capture.json`. Numbers that are not known are `null`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Capture {
    pub schema_version: u32,
    pub software: Software,
    /// When the capture began, RFC 3339, if the caller wants it in the file; a replay leaves it
    /// out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub captured_at: Option<String>,
    pub source: Source,
    pub timing: Timing,
    /// The whole effective configuration: defaults, file and command line together.
    pub config: Config,
    /// The region that was tracked, in the form of an outline file, so that it can be used again.
    pub outline: Option<OutlineNote>,
    /// `None` where nothing was tracked, or no frame could be decoded in colour.
    #[serde(default)]
    pub picture: Option<PictureNote>,
    /// `None` if the capture ended before the tree was built.
    pub build: Option<Build>,
    /// `None` if the tree is the one that was built first.
    #[serde(default)]
    pub refinement: Option<Refinement>,
    pub quality: Quality,
    pub model: Option<ModelNote>,
    pub animation: Option<AnimationNote>,
    /// What the user should know before trusting the result, one sentence each.
    pub warnings: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Software {
    pub name: String,
    pub version: String,
}

impl Default for Software {
    fn default() -> Self {
        Self {
            name: "arborcam".into(),
            version: env!("CARGO_PKG_VERSION").into(),
        }
    }
}

/// Where the frames came from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    pub name: String,
    /// E.g. `MJPG 1280x720 @ 30`.
    pub format_asked: String,
    pub format_given: String,
    /// Size of the picture, px.
    pub width: u32,
    pub height: u32,
}

/// Frames and time, by the sensor's own clock.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// What the source says, and what its timestamps say of the time in which it filmed, Hz.
    pub nominal_rate_hz: Option<f64>,
    pub measured_rate_hz: Option<f64>,
    pub frames_seen: u64,
    /// Lost before us: what is to be believed of the two counts that follow. The driver's numbers
    /// where it numbers its frames; the times where it does not, starts anew, or numbers only what
    /// it delivers.
    pub frames_dropped_camera: u64,
    /// Holes in the driver's numbers; `None` where it does not number its frames.
    #[serde(default)]
    pub frames_dropped_by_sequence: Option<u64>,
    /// Holes in the frames' times, jitter and changes of the rate left out.
    #[serde(default)]
    pub frames_dropped_by_time: u64,
    /// Came damaged, short or with the driver's error flag, and were left out.
    #[serde(default)]
    pub frames_damaged: u64,
    /// Came with a time that was not later than the one before, and were left out.
    #[serde(default)]
    pub frames_stale: u64,
    /// What the times are by: `file`, `monotonic` (the system's clock, read by the driver),
    /// `copied` (from whoever feeds the device), `unknown`, or `received` (the moment of
    /// reception).
    #[serde(default)]
    pub clock: String,
    /// How often the camera was lost and came back, and for how long it was away, s.
    #[serde(default)]
    pub reconnects: u64,
    #[serde(default)]
    pub away_s: f64,
    /// Not taken by the tracker, which was busy.
    pub frames_dropped_tracker: u64,
    pub frames_undecodable: u64,
    /// Seen before there was an outline, and not tracked.
    pub frames_before_outline: u64,
    /// Missing in the recording that was made meanwhile; 0 where none was.
    #[serde(default)]
    pub frames_not_recorded: u64,
    /// The first [`MAX_GAPS`] holes, in the order in which they were found.
    pub gaps: Vec<Gap>,
    pub gaps_not_listed: u64,
    /// From the first frame to the last, s.
    pub duration_s: f64,
}

impl Timing {
    /// Notes a hole; the list stays bounded however long the capture runs.
    pub fn push_gap(&mut self, gap: Gap) {
        if self.gaps.len() < MAX_GAPS {
            self.gaps.push(gap);
        } else {
            self.gaps_not_listed += 1;
        }
    }
}

/// A time from which there are no frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// The last frame before the hole, and its time, s.
    pub after_frame: u64,
    pub time_s: f64,
    /// Number of frames missing; where the camera was away, as many as it would have delivered, and
    /// 0 where it did not come back.
    pub missing: u64,
    #[serde(default)]
    pub cause: GapCause,
    /// From the last frame before the hole to the first after it, or to the end of the capture, s.
    #[serde(default)]
    pub length_s: f64,
}

/// Why frames are missing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GapCause {
    /// Lost on the way from the sensor to us.
    #[default]
    Dropped,
    /// The camera was unplugged or its driver failed.
    Disconnected,
    /// The camera was there and delivered nothing.
    Silent,
}

/// An outline file: `{"frame": 0, "width": W, "height": H, "polygon_px": [[u, v], ...]}`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OutlineNote {
    /// First frame that was tracked with it.
    pub frame: u64,
    pub width: u32,
    pub height: u32,
    pub polygon_px: Vec<[i32; 2]>,
}

/// The picture in the folder: the first frame that was tracked, whole.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PictureNote {
    pub file: String,
    pub frame: u64,
    pub time_s: f64,
}

/// When and on what the tree was first built.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Build {
    pub frame: u64,
    pub time_s: f64,
    /// The accumulation measure at that time, 0 to 1.
    pub accumulation: f64,
    pub moving_points: u32,
    /// Built by order of the user or by the end of the source, not because enough had been seen.
    pub forced: bool,
}

/// How the tree was built anew as more was seen: what the tree in the files was built on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Refinement {
    /// How often, and when last.
    pub count: u32,
    pub frame: u64,
    pub time_s: f64,
    /// The accumulation measure at that time, 0 to 1.
    pub accumulation: f64,
    pub moving_points: u32,
    /// First frame in which the screen and the stream showed this tree; the tables have it in all
    /// frames.
    pub shown_from: u64,
    /// Measured nodes that were in the tree before, and kept their numbers.
    pub nodes_kept: u32,
}

/// How well the points were followed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    pub tracks_total: u64,
    /// Candidates that turned out not to be points that can be followed; they are not in the
    /// tables.
    #[serde(default)]
    pub tracks_rejected: u64,
    pub tracks_alive_end: u64,
    /// Distance by which tracking forward and back misses the start, px.
    pub median_fb_error_px: Option<f64>,
    /// How far a point is expected to be from the one that it was when it was found, by its
    /// likeness to that and by what its neighbours say, px: the median over the frames of the
    /// median over the points.
    #[serde(default)]
    pub median_error_px: Option<f64>,
    pub lost_per_s: Option<f64>,
    /// How sure the forks of the tree are, 0 to 1: the median over the forks.
    #[serde(default)]
    pub median_certainty: Option<f64>,
    /// Median distance between where the points put a node in the picture and where the 3D pose
    /// does, px.
    pub median_reprojection_px: Option<f64>,
}

/// The tree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelNote {
    pub nodes: u32,
    /// Those of them that repeat a measured node on another plane.
    pub copies: u32,
    pub axes: String,
    /// `px` or `m`.
    pub unit: String,
    /// 0 where the model is in pixels.
    pub metres_per_px: f64,
    /// The trunk's foot in the picture, px: the origin of the model.
    pub foot_px: [f64; 2],
    /// What the push out of the picture's plane has achieved; `None` in a capture of an older
    /// version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub push: Option<crate::shape::PushFigures>,
    /// What every copy repeats; by their numbers in `nodes.csv`. Empty in captures of older
    /// versions.
    #[serde(default)]
    pub copied: Vec<Copied>,
}

/// A node that repeats a measured one on another plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Copied {
    pub node: u32,
    pub original: u32,
    /// By which the plane is turned about the y axis, degrees.
    pub plane_angle_deg: f64,
}

impl ModelNote {
    /// The note for a skeleton that is written with this scale (0: pixels).
    pub fn of(skeleton: &crate::model::Skeleton, metres_per_px: f64) -> Self {
        let nodes = skeleton.nodes.len();
        let copied = skeleton.nodes.iter().filter_map(|n| {
            let original = skeleton.name_of(n.copy_of?)?.0;
            Some(Copied {
                node: n.name.0,
                original,
                plane_angle_deg: n.plane_angle.to_degrees(),
            })
        });
        Self {
            nodes: nodes as u32,
            copies: (nodes - skeleton.measured()) as u32,
            axes: "x right, y up, z towards the viewer, right-handed; origin at the trunk's foot"
                .into(),
            unit: if metres_per_px > 0.0 { "m" } else { "px" }.into(),
            metres_per_px,
            foot_px: skeleton.foot_px,
            push: None,
            copied: copied.collect(),
        }
    }
}

/// The animation in `tree.glb`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct AnimationNote {
    /// Frame that stands at time 0 of the animation.
    pub first_frame: u64,
    pub frames: u64,
    /// Rotation keys that were left after thinning, and how many there were before: a key a joint
    /// that moves and frame.
    pub keys: u64,
    #[serde(default)]
    pub raw_keys: u64,
}

/// The text of `capture.json`.
///
/// # Errors
/// None in practice: every field has a JSON form.
pub fn json(capture: &Capture) -> Result<Vec<u8>, ExportError> {
    let mut text =
        serde_json::to_vec_pretty(capture).map_err(|e| ExportError::unfit(e.to_string()))?;
    text.push(b'\n');
    Ok(text)
}

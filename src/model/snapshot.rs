//! What the screen shows of a running capture: one immutable picture of its state, replaced, never
//! changed.

use super::{
    Angles, Background, DepthCounts, NodeName, Pose, Rgb, Shake, Size, Skeleton, SwayNow, TagState,
    Verdict, Wood, WoodSight,
};
use nalgebra::Point2;
use std::sync::Arc;

/// How far the capture has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Phase {
    /// Looking for the tree in the picture.
    #[default]
    Outline,
    /// Looking for points in the outline.
    Detect,
    /// Following points until enough motion has been seen.
    Accumulate,
    /// Cutting the hierarchy and building the skeleton.
    Build,
    /// The tree stands and moves.
    Live,
}

impl Phase {
    pub const ALL: [Phase; 5] = [
        Phase::Outline,
        Phase::Detect,
        Phase::Accumulate,
        Phase::Build,
        Phase::Live,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Phase::Outline => "outline",
            Phase::Detect => "detect",
            Phase::Accumulate => "accumulate",
            Phase::Build => "build",
            Phase::Live => "live",
        }
    }
}

/// What was asked of the camera and what it gave, both ready to print, e.g. `MJPG 1280x720 @ 30`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FormatNote {
    pub asked: String,
    pub given: String,
}

/// How the camera does, apart from its frames. The counts only ever grow.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraState {
    /// Why it is gone, while it is waited for.
    pub away: Option<String>,
    /// How often it has come back, and for how long it was away, s.
    pub reconnects: u64,
    pub away_s: f64,
    /// For how long it was away when the capture ended while it was waited for, s.
    pub away_at_end_s: f64,
    /// Frames lost before us by the driver's numbers (`None` where it has none) and by the times.
    pub lost_by_sequence: Option<u64>,
    pub lost_by_time: u64,
    /// Frames that came and were of no use: damaged, and not later than the one before.
    pub damaged: u64,
    pub stale: u64,
    /// What the times are by, one word.
    pub clock: &'static str,
    /// It has delivered at another rate than it promised for seconds.
    pub rate_off: bool,
    /// Of the depth camera beside it; `None` where there is none.
    pub depth: Option<DepthCameraState>,
    /// The tag beside the trunk, once it has given the scale.
    pub tag: Option<TagState>,
}

/// How a depth camera beside the camera does. The counts only ever grow.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthCameraState {
    /// Why it is gone.
    pub away: Option<String>,
    pub counts: DepthCounts,
}

/// One line of the table of branches.
#[derive(Clone, Debug, PartialEq)]
pub struct BranchRow {
    pub node: NodeName,
    /// What its piece of a botanical branch is called, as in [`Snapshot::piece_names`].
    pub name: String,
    /// The number of its main branch, as in [`Snapshot::node_colour`].
    pub colour: Option<u8>,
    pub level: u8,
    pub n_tracks: u32,
    /// Root mean square of the node's displacement in the picture over the last seconds, px.
    pub amplitude_px: f64,
}

/// What has still to be seen before there is a tree, and before there are frequencies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StillNeeded {
    /// Fewer points move than a tree is made of.
    pub motion: bool,
    /// Film before the tree can be built, however much moves, s.
    pub before_tree_s: f64,
    /// Film before every branch that moves should have a frequency, s.
    pub for_sway_s: f64,
}

/// State of a capture after some frame.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    pub source: String,
    pub format: FormatNote,
    pub phase: Phase,
    /// Progress of the phase, 0 to 1; in `Accumulate` the share of the motion that the tree takes.
    pub progress: f64,
    pub still_needed: StillNeeded,
    /// What the capture would be worth if it ended now; `None` while no second of it was followed.
    pub verdict: Option<Arc<Verdict>>,
    /// The source is a camera: what is in front of it can be changed.
    pub is_live: bool,
    /// What the program wants to tell, newest last; e.g. why nothing is built yet.
    pub messages: Vec<String>,
    pub frame: u64,
    pub time_s: f64,
    /// Frames that the source will deliver, where it knows.
    pub frames_total: Option<u64>,
    /// Rate by the sensor's clock over the last seconds, and rate at which frames are worked off,
    /// Hz.
    pub sensor_rate_hz: f64,
    pub work_rate_hz: f64,
    pub camera: CameraState,
    /// How the camera's own motion is known in this frame; `None` before the first one.
    pub background: Option<Background>,
    /// How it trembled in the last seconds; `None` while that is not known.
    pub shake: Option<Shake>,
    /// Frames lost before us (what is to be believed of both counts), between camera and tracker,
    /// undecodable, and not shown.
    pub lost_in_camera: u64,
    pub dropped_before_tracker: u64,
    pub undecodable: u64,
    pub not_shown: u64,
    /// Frames in the recording and frames missing in it; `None` where none is made.
    pub recorded: Option<(u64, u64)>,
    /// Time from reception of a frame to its pose, ms.
    pub latency_p50_ms: f64,
    pub latency_p99_ms: f64,
    pub tracks_alive: u32,
    pub lost_per_s: f64,
    /// Median forward-backward error of this frame, px, and its history, oldest first.
    pub fb_error_px: f64,
    pub fb_history_px: Vec<f64>,
    /// Median distance at which the points are expected to be from those that they were when they
    /// were found, px.
    pub error_px: Option<f64>,
    pub image_size: Option<Size>,
    pub preview: Option<Arc<Rgb>>,
    pub outline_px: Vec<Point2<i32>>,
    /// Lines along branches that the user drew, px.
    pub strokes_px: Vec<Vec<[f64; 2]>>,
    /// Points of this frame, px, each with the number of its main branch, `None` before the tree is
    /// built.
    pub points: Vec<(Point2<f32>, Option<u8>)>,
    /// Points on trial, px.
    pub candidates_px: Vec<Point2<f32>>,
    pub skeleton: Option<Arc<Skeleton>>,
    pub pose: Option<Arc<Pose>>,
    /// The wood that the film shows, and whether it was looked for.
    pub wood: Option<Arc<Wood>>,
    pub wood_sight: WoodSight,
    /// Main branch of every node of the skeleton, by node index; the same numbers as in `points`.
    pub node_colour: Arc<Vec<Option<u8>>>,
    /// What the pieces of the tree are called, by node index: `trunk`, `limb_1.2`, ...
    pub piece_names: Arc<Vec<String>>,
    pub branches: Vec<BranchRow>,
    /// The newest answer of the sway; `None` while there is none.
    pub sway: Option<Arc<SwayNow>>,
    /// Nobody analyses the sway before the end.
    pub sway_at_end: bool,
    /// How often the sway was not analysed anew because the last time was not over.
    pub sway_passed_over: u64,
    /// The last seconds of every branch's angle to the one that carries it.
    pub angles: Angles,
    pub paused: bool,
    /// The source has ended or the user has quit: what is shown is the last state.
    pub ended: bool,
    /// The disk is full, and the capture is written when there is room.
    pub waits_for_room: bool,
}

impl Snapshot {
    /// Shows this tree, its main branches each in a colour of its own, and its branches by their
    /// names.
    pub fn show_tree(&mut self, skeleton: Arc<Skeleton>) {
        self.node_colour = Arc::new(skeleton.main_branches());
        self.piece_names = Arc::new(skeleton.botanical_branches().piece_names());
        self.skeleton = Some(skeleton);
    }
}

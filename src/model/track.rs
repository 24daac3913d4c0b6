//! Points followed from frame to frame.

use super::{CameraMotion, DepthSeen};
use nalgebra::Point2;

/// Names one tracked point for good: an id is never given to a second point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TrackId(pub u32);

/// The id of the first coloured marker among the tracks; points never get so many.
const FIRST_MARKER_ID: u32 = 1_000_000_000;

impl TrackId {
    /// The id of marker `k`, in the order in which the markers were given or found.
    pub fn of_marker(k: usize) -> Self {
        Self(FIRST_MARKER_ID.saturating_add(u32::try_from(k).unwrap_or(u32::MAX)))
    }

    /// Which marker it is; `None` for a point.
    pub fn marker(self) -> Option<usize> {
        self.0.checked_sub(FIRST_MARKER_ID).map(|k| k as usize)
    }
}

/// Within this time of its birth it is decided whether a point is kept, s; for the first of a
/// capture, within this time of the tree's first stirring. What has not stirred makes no tree, and
/// rows are written only after a build.
pub const LONGEST_TRIAL_S: f64 = 6.0;

/// One point as seen in one frame, at its steady place, see [`CameraMotion`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    pub id: TrackId,
    pub u_px: f32,
    pub v_px: f32,
    /// Distance by which tracking forward and back again missed the start, px; 0 in the frame of
    /// birth.
    pub fb_error_px: f32,
    /// How far it is expected to be from the point that it was when it was found (median), px;
    /// `None` where it was never compared with that.
    pub error_px: Option<f32>,
    /// Its trial is over; of those on trial about half will be dropped.
    pub confirmed: bool,
    /// How far away it is, where a depth camera has seen that.
    pub depth: Option<DepthSeen>,
}

impl Observation {
    /// Its steady place, px.
    pub fn at_px(&self) -> Point2<f64> {
        Point2::new(self.u_px, self.v_px).cast()
    }
}

/// All points seen in one frame, ordered by id.
#[derive(Clone, Debug, Default)]
pub struct TrackSet {
    /// Frame index and sensor time of the picture.
    pub frame: u64,
    pub time_s: f64,
    /// The camera's motion, which is taken off the observations.
    pub camera: CameraMotion,
    pub observations: Vec<Observation>,
    /// Points given up in this frame, and points newly detected in it.
    pub lost: u32,
    pub born: u32,
    /// Points that did not pass their trial: whatever was seen of them before is void.
    pub rejected: Vec<TrackId>,
}

impl TrackSet {
    /// Where a point was filmed in this frame, px.
    pub fn filmed_px(&self, observation: &Observation) -> Point2<f64> {
        self.camera.filmed_px(observation.at_px())
    }

    /// The points that count: those that have passed their trial, or all while none has.
    pub fn counted(&self) -> impl Iterator<Item = &Observation> {
        let passed = self.observations.iter().any(|o| o.confirmed);
        self.observations
            .iter()
            .filter(move |o| o.confirmed || !passed)
    }
}

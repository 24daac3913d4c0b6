//! Points followed from frame to frame.

/// Names one tracked point for good: an id is never given to a second point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TrackId(pub u32);

/// One point as seen in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    pub id: TrackId,
    pub u_px: f32,
    pub v_px: f32,
    /// Distance by which tracking forward and back again missed the start, px; 0 in the frame of birth.
    pub fb_error_px: f32,
}

/// All points seen in one frame, ordered by id.
#[derive(Clone, Debug, Default)]
pub struct TrackSet {
    /// Frame index and sensor time of the picture.
    pub frame: u64,
    pub time_s: f64,
    pub observations: Vec<Observation>,
    /// Points given up in this frame, and points newly detected in it.
    pub lost: u32,
    pub born: u32,
}

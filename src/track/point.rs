//! One followed point and what is known of it.

use super::neighbours::Fit;
use super::register::Patch;
use crate::model::TrackId;

/// Share that one more comparison has in the running likeness.
const NEWEST: f32 = 0.1;
/// Likeness below which a neighbour is hardly believed.
const DOUBTFUL: f32 = 0.5;

/// One followed point.
pub struct Point {
    pub id: TrackId,
    /// Number of the keyframe in which it was detected; the keyframe itself may be gone.
    pub keyframe: u32,
    pub born_px: [f32; 2],
    pub now_px: [f32; 2],
    /// What it looked like.
    pub patch: Patch,
    pub fb_error_px: f32,
    /// Frames since it was last seen; 0 when seen in this frame.
    pub coasting: u32,
    /// Not seen since a gap: whatever flow finds where it is thought to be may be another point.
    pub unsure: bool,
    /// Points nearest to it at birth, and where they were then.
    pub neighbours: Vec<(TrackId, [f32; 2])>,
    /// Running mean of its likeness to its first patch, -1 to 1.
    pub likeness: f32,
}

impl Point {
    /// How far its motion is believed when it is asked about a neighbour's, above 0 to 1.
    pub fn trust(&self) -> f64 {
        f64::from(((self.likeness - DOUBTFUL) / (1.0 - DOUBTFUL)).clamp(0.02, 1.0))
    }

    /// Where its neighbours say that it is, px.
    pub fn predicted_px(&self, fit: &Fit) -> [f32; 2] {
        [0, 1].map(|c| self.born_px[c] + fit.displacement[c] as f32)
    }

    /// Takes note of a comparison with its first patch.
    pub fn compared(&mut self, likeness: f32) {
        self.likeness += NEWEST * (likeness - self.likeness);
    }
}

use super::TrackId;
use nalgebra::Point2;

/// Positions of all tracks on common frames.
#[derive(Clone, Debug, Default)]
pub struct TrackTable {
    pub ids: Vec<TrackId>,
    /// Sensor time of each frame, s.
    pub times_s: Vec<f64>,
    /// `positions[track][frame]`, px; `None` where the track was not seen.
    pub positions: Vec<Vec<Option<Point2<f32>>>>,
    /// Median forward-backward error of each track, px.
    pub fb_errors_px: Vec<f32>,
}

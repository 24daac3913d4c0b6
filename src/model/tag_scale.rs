//! What a printed tag beside the trunk says of the scale.

use serde::{Deserialize, Serialize};

/// What all sights of a tag say together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TagScale {
    /// Its number in the AprilTag family 36h11.
    pub id: u16,
    /// Side of its black square, m.
    pub size_m: f64,
    /// Frames in which it was seen.
    pub frames: usize,
    /// Metres of a pixel at the tag, with the 95 % interval.
    pub metres_per_px: f64,
    pub metres_per_px_lo: f64,
    pub metres_per_px_hi: f64,
    /// Angle from the upright of the picture to that of the tag, clockwise, degrees.
    pub roll_deg: f64,
    /// The standard deviation of that, by the edges of the tag and the ways in which it may be turned. How
    /// upright it hangs is not in it.
    #[serde(default)]
    pub roll_sd_deg: f64,
    /// How much shorter it is along the direction in which it is seen aslant: 1 where it faces the camera.
    pub foreshortened: f64,
    /// How far its middle moves, px: root mean square about its mean place. It hangs still, so that this is
    /// how far the camera moves.
    pub moves_px: f64,
}

impl TagScale {
    /// Half of the interval, as a share of the scale.
    pub fn relative_error(&self) -> f64 {
        0.5 * (self.metres_per_px_hi - self.metres_per_px_lo) / self.metres_per_px
    }
}

/// A tag as it is seen in a live capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TagState {
    pub scale: TagScale,
    /// Whether it was seen when it was last looked for.
    pub is_seen: bool,
}

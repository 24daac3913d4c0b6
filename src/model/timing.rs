//! How the frames of a film lie in time, and which are missing.

use serde::{Deserialize, Serialize};

/// At most so many gaps are listed; the counts in [`Timing`] are complete.
pub const MAX_GAPS: usize = 1000;

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
    pub frames_dropped_by_sequence: Option<u64>,
    /// Holes in the frames' times, jitter and changes of the rate left out.
    pub frames_dropped_by_time: u64,
    /// Came damaged, short or with the driver's error flag, and were left out.
    pub frames_damaged: u64,
    /// Came with a time that was not later than the one before, and were left out.
    pub frames_stale: u64,
    /// What the times are by: `file`, `monotonic` (the system's clock, read by the driver),
    /// `copied` (from the program that feeds the device), `unknown`, or `received` (the moment of
    /// reception).
    pub clock: String,
    /// How often the camera was lost and came back, and for how long it was away, s.
    pub reconnects: u64,
    pub away_s: f64,
    /// Not taken by the tracker, which was busy.
    pub frames_dropped_tracker: u64,
    pub frames_undecodable: u64,
    /// Seen before there was an outline, and not tracked.
    pub frames_before_outline: u64,
    /// Missing in the recording that was made meanwhile; 0 where none was.
    pub frames_not_recorded: u64,
    /// The first [`MAX_GAPS`] holes, in the order in which they were found.
    pub gaps: Vec<Gap>,
    pub gaps_not_listed: u64,
    /// Of the depth camera beside the camera; `None` where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<DepthCounts>,
    /// From the first frame to the last, s.
    pub duration_s: f64,
}

impl Timing {
    /// Whether there is a film; a tree that was drawn, grown or photographed has none.
    pub fn is_of_film(&self) -> bool {
        self.frames_seen > 0
    }
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

/// Images of a depth camera beside the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DepthCounts {
    /// That came.
    pub images: u64,
    /// Lost before us or damaged, by the driver's numbers or by the times.
    pub images_lost: u64,
    /// That came and were not taken in time.
    pub images_dropped: u64,
    /// Frames of the camera without a depth image of their time.
    pub frames_without: u64,
    /// How often it was lost.
    pub absences: u64,
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
    pub cause: GapCause,
    /// From the last frame before the hole to the first after it, or to the end of the capture, s.
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

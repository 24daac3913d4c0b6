//! One followed point and what is known of it.

use super::anchor::distance;
use super::neighbours::Fit;
use super::register::Patch;
use super::trial::Trial;
use crate::model::TrackId;

/// Share that one more comparison has at least in a [`Record`].
const NEWEST: f32 = 0.1;
/// Likeness below which a neighbour is hardly believed.
const DOUBTFUL: f32 = 0.5;
/// A point is hidden where it looks less like its first patch than this share of what is usual for
/// it, and there again from that share on.
const HIDDEN: f32 = 0.2;
const THERE_AGAIN: f32 = 0.8;
/// The same where no neighbour vouches for the place: the share of what is usual, and not less than
/// is asked of all.
const SURELY_THERE: f32 = 0.9;
/// Expected error = 4.7 px exp(-1.9 likeness) sqrt(distance from the neighbours' place + 0.2 px):
/// least squares on the logarithms of true errors on two rendered clips of known motion, all points
/// that were tried. Of those kept it tells good from bad only roughly (docs/method.md).
const ERROR_PX: f32 = 4.7;
const PER_LIKENESS: f32 = -1.9;
const APART_FLOOR_PX: f32 = 0.2;

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
    /// When it was last seen, s; moved on while there is nothing to be seen at all.
    pub seen_s: f64,
    /// Points nearest to it at birth, and where they were then.
    pub neighbours: Vec<(TrackId, [f32; 2])>,
    /// How it did lately.
    pub record: Record,
    /// While it is not decided whether it is kept.
    pub trial: Option<Trial>,
}

impl Point {
    /// How far its motion is believed when it is asked about a neighbour's, above 0 to 1.
    pub fn trust(&self) -> f64 {
        f64::from(((self.usual_likeness() - DOUBTFUL) / (1.0 - DOUBTFUL)).clamp(0.02, 1.0))
    }

    /// Whether it is compared with its first patch in frame `frame`, where each is in one of
    /// `every`; 0 is never.
    pub fn in_turn(&self, every: u32, frame: u64) -> bool {
        every > 0 && u64::from(self.id.0) % u64::from(every) == frame % u64::from(every)
    }

    /// Likeness below which something else is before it.
    pub fn hidden_below(&self) -> f32 {
        HIDDEN * self.usual_likeness()
    }

    /// Likeness above which it is found again. Not more than `enough`, for foliage never looks the
    /// same twice; but not less than nearly usual where it is hidden and no neighbour vouches for
    /// the place.
    pub fn found_above(&self, enough: f32, vouched: bool) -> f32 {
        let usual = self.usual_likeness();
        if self.coasting > 0 && !vouched {
            enough.max(SURELY_THERE * usual)
        } else {
            enough.min(THERE_AGAIN * usual)
        }
    }

    fn usual_likeness(&self) -> f32 {
        if self.record.comparisons == 0 {
            1.0
        } else {
            self.record.likeness
        }
    }

    /// Where its neighbours say that it is, px.
    pub fn predicted_px(&self, fit: &Fit) -> [f32; 2] {
        [0, 1].map(|c| self.born_px[c] + fit.displacement[c] as f32)
    }

    /// Takes note of a comparison with its first patch.
    pub fn compared(&mut self, likeness: f32, fit: Option<&Fit>) {
        let apart_px = fit.map_or(0.0, |fit| distance(self.now_px, self.predicted_px(fit)));
        self.record.note(likeness, apart_px, NEWEST);
        if let Some(trial) = &mut self.trial {
            trial.record.note(likeness, apart_px, 0.0);
        }
    }
}

/// How a point compared with its first patch and with its neighbours.
#[derive(Clone, Copy, Debug, Default)]
pub struct Record {
    comparisons: u32,
    /// Mean correlation with its first patch, -1 to 1.
    likeness: f32,
    /// Mean logarithm of its distance from where the neighbours say that it is.
    ln_apart: f32,
}

impl Record {
    /// Adds a comparison; it counts as much as each of the others, but at least `newest`.
    fn note(&mut self, likeness: f32, apart_px: f32, newest: f32) {
        self.comparisons = self.comparisons.saturating_add(1);
        let share = (1.0 / self.comparisons as f32).max(newest);
        self.likeness += share * (likeness - self.likeness);
        self.ln_apart += share * ((apart_px + APART_FLOOR_PX).ln() - self.ln_apart);
    }

    /// How far the point is expected to be from the one that it was (median), px; `None` before the
    /// first comparison.
    pub fn error_px(&self) -> Option<f32> {
        (self.comparisons > 0)
            .then(|| ERROR_PX * (PER_LIKENESS * self.likeness + 0.5 * self.ln_apart).exp())
    }
}

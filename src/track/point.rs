//! One followed point and what is known of it.

use super::register::Patch;
use crate::model::TrackId;
use crate::signal::Fit;
use nalgebra::{Point2, distance};

/// Share that one more comparison has at least in a [`Record`].
const NEWEST: f32 = 0.1;
/// Correlation with its first patch below which a neighbour hardly counts.
const DOUBTFUL: f32 = 0.5;
/// A point is hidden where it looks less like its first patch than this share of what is usual for
/// it, and there again from that share on.
const HIDDEN: f32 = 0.2;
const THERE_AGAIN: f32 = 0.8;
/// The same where there are no neighbours to confirm the place: the share of what is usual, and not
/// less than is asked of all.
const SURELY_THERE: f32 = 0.9;
/// Expected error = 4.7 px exp(-1.9 ncc) sqrt(distance from the neighbours' place + 0.2 px), with
/// ncc the correlation with the first patch:
/// least squares on the logarithms of true errors on two rendered clips of known motion, all points
/// that were tried. Of those kept it tells good from bad only roughly (docs/method.md).
const ERROR_PX: f32 = 4.7;
const PER_NCC: f32 = -1.9;
const APART_FLOOR_PX: f32 = 0.2;

/// One followed point.
pub struct Point {
    pub id: TrackId,
    /// Number of the keyframe in which it was detected; the keyframe itself may be gone.
    pub keyframe: u32,
    pub born_px: Point2<f32>,
    /// The same without the camera's motion.
    pub born_steady_px: Point2<f32>,
    pub now_px: Point2<f32>,
    /// What it looked like.
    pub patch: Patch,
    pub fb_error_px: f32,
    /// Frames since it was last seen; 0 when seen in this frame.
    pub coasting: u32,
    /// When it was last seen, s; moved on while there is nothing to be seen at all.
    pub seen_s: f64,
    /// Points nearest to it at birth, and where they were then.
    pub neighbours: Vec<(TrackId, Point2<f32>)>,
    /// How it did lately.
    pub record: Record,
    /// While it is not decided whether it is kept.
    pub trial: Option<Trial>,
}

impl Point {
    /// Weight of its motion in what it says of a neighbour's, above 0 to 1.
    pub fn weight(&self) -> f64 {
        f64::from(((self.usual_ncc() - DOUBTFUL) / (1.0 - DOUBTFUL)).clamp(0.02, 1.0))
    }

    /// Whether it is compared with its first patch in frame `frame`, where each is in one of
    /// `every`; 0 is never.
    pub fn in_turn(&self, every: u32, frame: u64) -> bool {
        every > 0 && u64::from(self.id.0) % u64::from(every) == frame % u64::from(every)
    }

    /// Correlation below which something else is before it.
    pub fn hidden_below(&self) -> f32 {
        HIDDEN * self.usual_ncc()
    }

    /// Correlation above which it is found again. Not more than `enough`, for foliage never looks
    /// the same twice; but not less than nearly usual where it is hidden and the place is not
    /// `confirmed` by its neighbours.
    pub fn found_above(&self, enough: f32, confirmed: bool) -> f32 {
        let usual = self.usual_ncc();
        if self.coasting > 0 && !confirmed {
            enough.max(SURELY_THERE * usual)
        } else {
            enough.min(THERE_AGAIN * usual)
        }
    }

    fn usual_ncc(&self) -> f32 {
        if self.record.comparisons == 0 {
            1.0
        } else {
            self.record.mean_ncc
        }
    }

    /// Where its neighbours say that it is, px.
    pub fn predicted_px(&self, fit: &Fit) -> Point2<f32> {
        self.born_px + fit.displacement.map(|x| x as f32)
    }

    /// Takes note of a comparison with its first patch, of which `ncc` is the correlation.
    pub fn compared(&mut self, ncc: f32, fit: Option<&Fit>) {
        let apart_px = fit.map_or(0.0, |fit| distance(&self.now_px, &self.predicted_px(fit)));
        self.record.note(ncc, apart_px, NEWEST);
        if let Some(trial) = &mut self.trial {
            trial.record.note(ncc, apart_px, 0.0);
        }
    }
}

/// What is known of one point on trial.
#[derive(Debug, Default)]
pub struct Trial {
    pub record: Record,
    /// How far it has been from where it was found, px.
    pub reach_px: f32,
}

/// How a point compared with its first patch and with its neighbours.
#[derive(Clone, Copy, Debug, Default)]
pub struct Record {
    comparisons: u32,
    /// Mean correlation with its first patch, -1 to 1.
    mean_ncc: f32,
    /// Mean logarithm of its distance from where the neighbours say that it is.
    ln_apart: f32,
}

impl Record {
    /// Adds a comparison; it counts as much as each of the others, but at least `newest`.
    fn note(&mut self, ncc: f32, apart_px: f32, newest: f32) {
        self.comparisons = self.comparisons.saturating_add(1);
        let share = (1.0 / self.comparisons as f32).max(newest);
        self.mean_ncc += share * (ncc - self.mean_ncc);
        self.ln_apart += share * ((apart_px + APART_FLOOR_PX).ln() - self.ln_apart);
    }

    /// How far the point is expected to be from the one that it was (median), px; `None` before the
    /// first comparison.
    pub fn error_px(&self) -> Option<f32> {
        (self.comparisons > 0)
            .then(|| ERROR_PX * (PER_NCC * self.mean_ncc + 0.5 * self.ln_apart).exp())
    }
}

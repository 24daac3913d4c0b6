//! After a gap: points are found again by the pictures they were first seen in.
//!
//! Following them from the last picture before the gap would not do. The tree has swayed on, and
//! points slide onto others that look alike; a camera that has just started shows pictures that are
//! too dark or too bright to be compared at all.

use super::Tracker;
use super::point::Point;
use crate::model::Frame;

/// A step is a gap when it is longer than this, s, and than so many of the steps before.
const GAP_S: f64 = 0.5;
const GAP_STEPS: f64 = 5.0;
/// Points are looked for in this way until so great a share of them is found, or for so long, s.
const ENOUGH: f64 = 0.5;
const PATIENCE_S: f64 = 5.0;

/// Notices gaps by the frames' times.
#[derive(Debug, Default)]
pub struct Gaps {
    last_s: Option<f64>,
    step_s: Option<f64>,
    until_s: Option<f64>,
}

impl Gaps {
    /// Takes the time of the next frame; whether points are to be found again in it.
    pub fn regaining(&mut self, time_s: f64) -> bool {
        if let Some(last_s) = self.last_s.replace(time_s) {
            let step_s = time_s - last_s;
            if self
                .step_s
                .is_some_and(|usual_s| step_s > (GAP_STEPS * usual_s).max(GAP_S))
            {
                self.until_s = Some(time_s + PATIENCE_S);
            } else {
                self.step_s = Some(step_s);
            }
        }
        self.until_s = self.until_s.filter(|until_s| time_s < *until_s);
        self.until_s.is_some()
    }
}

impl Tracker {
    /// Looks for every point by its first picture; those that are not found ride on those that are.
    pub(super) fn regain(&mut self, frame: &Frame) {
        // One that was not seen for a while is not given up for it: it had no chance.
        self.points
            .iter_mut()
            .for_each(|p| (p.coasting, p.seen_s) = (1, frame.time_s));
        for (number, keyframe) in &self.keyframes {
            let indices: Vec<usize> = (0..self.points.len())
                .filter(|&i| self.points[i].keyframe == *number)
                .collect();
            let points: Vec<&Point> = indices.iter().map(|&i| &self.points[i]).collect();
            let found = self.anchoring.search(
                keyframe,
                (&frame.luma, &self.present),
                &points,
                self.settings.levels,
            );
            for (i, at) in indices.into_iter().zip(found) {
                if let Some(at) = at {
                    let p = &mut self.points[i];
                    (p.now_px, p.coasting, p.fb_error_px) = (at, 0, 0.0);
                }
            }
        }
        self.ask_neighbours();
        self.ride();
        let seen = self.points.iter().filter(|p| p.coasting == 0).count();
        if seen as f64 >= ENOUGH * self.points.len() as f64 {
            self.gaps.until_s = None;
        }
    }
}

//! After a gap: points are found again by the pictures they were first seen in.
//!
//! Following them from the last picture before the gap would not do. The tree has swayed on, and
//! points slide onto others that look alike; a camera that has just started shows pictures that are
//! too dark or too bright to be compared at all.

/// A step is a gap when it is longer than this, s, and than so many of the steps before.
const GAP_S: f64 = 0.5;
const GAP_STEPS: f64 = 5.0;
/// Points are looked for in this way until so great a share of them is found, or for so long, s.
const ENOUGH: f64 = 0.5;
const LIMIT_S: f64 = 5.0;

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
                self.until_s = Some(time_s + LIMIT_S);
            } else {
                self.step_s = Some(step_s);
            }
        }
        self.until_s = self.until_s.filter(|until_s| time_s < *until_s);
        self.until_s.is_some()
    }

    /// Takes how many of the `wanted` points were found in the frame; the search ends when they
    /// are enough.
    pub fn found(&mut self, found: usize, wanted: usize) {
        if found as f64 >= ENOUGH * wanted as f64 {
            self.until_s = None;
        }
    }
}

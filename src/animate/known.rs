//! What is known of a branch's sway when it is to be animated.

use crate::model::Swaying;

/// Measured values of one branch; `None` where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Known {
    /// Undamped natural frequency of the sway against the branch that carries it, Hz.
    pub frequency_hz: Option<f64>,
    pub damping_ratio: Option<f64>,
}

impl Known {
    /// What an analysis found.
    pub fn of(sway: &Swaying) -> Self {
        sway.as_ref().map_or_else(
            |_| Self::default(),
            |s| Self {
                frequency_hz: Some(s.frequency_hz.value),
                damping_ratio: s.damping_ratio.map(|d| d.value),
            },
        )
    }
}

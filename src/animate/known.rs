//! What is known of a branch's sway when it is to be animated.

/// Measured values of one branch; `None` where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Known {
    /// Undamped natural frequency of the sway against the branch that carries it, Hz.
    pub frequency_hz: Option<f64>,
    pub damping_ratio: Option<f64>,
}

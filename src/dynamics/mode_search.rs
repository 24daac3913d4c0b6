//! The modes that a greedy search tries: those of one branch (signals.rs) and of all at once
//! (modal/search.rs).

use super::decay::Mode;
use crate::bounds::Bounds;

/// Damping ratios that are tried at every frequency.
const DAMPINGS: [f64; 3] = [0.02, 0.05, 0.1];

/// Modes within `frequencies_hz`, as many frequencies per factor of e.
pub(super) fn mode_grid(frequencies_hz: Bounds, per_e: f64) -> Vec<Mode> {
    let Bounds { lo, hi } = frequencies_hz;
    let steps = (per_e * (hi / lo).ln()).ceil().max(1.0);
    let mut out = Vec::new();
    for k in 0..=steps as usize {
        let frequency_hz = lo * (hi / lo).powf(k as f64 / steps);
        for damping in DAMPINGS {
            out.push(Mode {
                frequency_hz,
                damping,
            });
        }
    }
    out
}

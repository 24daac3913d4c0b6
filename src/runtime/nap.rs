//! Waiting for a moment, in pieces, so that a wish to stop is heard.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The longest piece.
pub const NAP: Duration = Duration::from_millis(20);

/// Waits until `due`; `false` when asked to stop meanwhile.
pub fn until(due: Instant, stop: &AtomicBool) -> bool {
    while !stop.load(Ordering::Relaxed) {
        let left = due.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return true;
        }
        std::thread::sleep(left.min(NAP));
    }
    false
}

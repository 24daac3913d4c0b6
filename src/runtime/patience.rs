//! How long the end of a capture may take once somebody wants it.

use super::shared::Shared;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// What is only made better by more time, or can be had from the capture afterwards, is given up
/// after so long: everything else takes a second, and a service is killed if it does not end.
const ENDS_WITHIN: Duration = Duration::from_secs(5);

/// Of whoever waits for a capture to be written. Nobody does where the film has come to its end by
/// itself: the same recording then gives the same capture however slow the machine is.
pub struct Patience {
    until: Instant,
    shared: Arc<Shared>,
}

impl Patience {
    /// Of a capture that begins to be written.
    pub fn from_now(shared: &Arc<Shared>) -> Self {
        Self {
            until: Instant::now() + ENDS_WITHIN,
            shared: shared.clone(),
        }
    }

    /// Whether somebody wants the end and has waited for long enough.
    pub fn is_over(&self) -> bool {
        self.shared.hurry.load(Ordering::Relaxed) && Instant::now() >= self.until
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_who_wants_the_end_loses_patience() {
        let shared = Arc::<Shared>::default();
        let began = Instant::now();
        let now = Patience {
            until: began,
            shared: shared.clone(),
        };
        let later = Patience {
            until: began + Duration::from_secs(3600),
            shared: shared.clone(),
        };
        assert!(
            !now.is_over() && !later.is_over(),
            "a film that ends by itself is not hurried"
        );
        shared.stop_at_once();
        assert!(now.is_over() && !later.is_over());
    }
}

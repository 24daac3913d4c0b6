//! One way to end work early, and to see from outside that it goes on.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// Asks long work to end before it is done.
///
/// The worker calls [`is_cancelled`](Self::is_cancelled) between steps of less than a second,
/// and returns early where it says so. Each call is counted, so that a supervisor can tell work
/// that goes on from work that hangs. Clones are the same token.
#[derive(Clone, Debug, Default)]
pub struct CancelToken {
    state: Arc<State>,
}

#[derive(Debug, Default)]
struct State {
    cancelled: AtomicBool,
    deadline: OnceLock<Instant>,
    checks: AtomicU64,
    parent: Option<CancelToken>,
}

impl CancelToken {
    /// A token that nobody has cancelled yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// A token for a part of the work: cancelled with this one, or by itself.
    pub fn child(&self) -> Self {
        let state = State {
            parent: Some(self.clone()),
            ..State::default()
        };
        Self {
            state: Arc::new(state),
        }
    }

    /// From now on the work is not wanted any more.
    pub fn cancel(&self) {
        self.state.cancelled.store(true, Ordering::Relaxed);
    }

    /// The work is not wanted any more after `moment`. The first such moment counts.
    pub fn cancel_at(&self, moment: Instant) {
        let _ = self.state.deadline.set(moment);
    }

    /// Whether the work is to end. Counts as a sign of life of it.
    pub fn is_cancelled(&self) -> bool {
        self.state.checks.fetch_add(1, Ordering::Relaxed);
        let parent_is_cancelled = match &self.state.parent {
            Some(parent) => parent.is_cancelled(),
            None => false,
        };
        parent_is_cancelled || self.state.cancelled.load(Ordering::Relaxed) || self.is_overdue()
    }

    /// How often [`is_cancelled`](Self::is_cancelled) was called, children included.
    pub fn checks(&self) -> u64 {
        self.state.checks.load(Ordering::Relaxed)
    }

    fn is_overdue(&self) -> bool {
        let deadline = self.state.deadline.get();
        deadline.is_some_and(|deadline| Instant::now() >= *deadline)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_child_ends_with_its_parent_and_not_the_other_way_round() {
        let all = CancelToken::new();
        let (one, other) = (all.child(), all.child());
        one.cancel();
        assert!(one.is_cancelled() && !other.is_cancelled() && !all.is_cancelled());
        all.cancel();
        assert!(other.is_cancelled());
    }

    #[test]
    fn a_deadline_cancels_by_itself() {
        let (over, later) = (CancelToken::new(), CancelToken::new());
        over.cancel_at(Instant::now());
        later.cancel_at(Instant::now() + Duration::from_secs(3600));
        assert!(over.is_cancelled() && !later.is_cancelled());
    }

    /// The watchdog of a service lives by this.
    #[test]
    fn checks_of_children_are_signs_of_life_of_the_parent() {
        let all = CancelToken::new();
        let part = all.child().child();
        let before = all.checks();
        part.is_cancelled();
        assert_eq!(all.checks(), before + 1);
    }
}

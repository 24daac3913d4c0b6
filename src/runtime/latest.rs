//! A slot that holds the newest value only: the edge to the screen, which may lose.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// Written by one thread, read by another; what was not read in time is replaced and counted.
pub struct Latest<T> {
    slot: Mutex<Option<T>>,
    replaced: AtomicU64,
}

impl<T> Default for Latest<T> {
    fn default() -> Self {
        Self {
            slot: Mutex::new(None),
            replaced: AtomicU64::new(0),
        }
    }
}

impl<T> Latest<T> {
    pub fn put(&self, value: T) {
        let mut slot = self.slot.lock().unwrap_or_else(PoisonError::into_inner);
        if slot.replace(value).is_some() {
            self.replaced.fetch_add(1, Ordering::Relaxed);
        }
    }

    pub fn take(&self) -> Option<T> {
        self.slot
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take()
    }

    /// Values that were replaced before anyone took them.
    pub fn replaced(&self) -> u64 {
        self.replaced.load(Ordering::Relaxed)
    }
}

//! The tables of a capture, written in the background while the film goes on.
//!
//! Every frame of a capture has its pose by the model that it ends with, so tables of a model that
//! is replaced are discarded, and begin anew from the first frame. That ends when the model has
//! settled, two minutes after the build; from then on nothing is written twice.

use super::background::{Background, Pending};
use super::capture_tables::CaptureTables;
use super::shared::Shared;
use crate::cancel::CancelToken;
use crate::recording::TrackFileReader;
use crate::solve::Model;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// The tables, and the work that brings them up to date.
pub struct TableWriter {
    model: Arc<Model>,
    background: Background,
    state: Arc<State>,
    cancel: CancelToken,
    writing: Option<Pending<()>>,
}

/// What the work and its owner share.
struct State {
    /// `None` if they could not be written.
    tables: Mutex<Option<CaptureTables>>,
    bytes: AtomicU64,
    shared: Arc<Shared>,
}

impl TableWriter {
    pub fn new(
        tables: CaptureTables,
        model: &Arc<Model>,
        background: Background,
        shared: Arc<Shared>,
    ) -> Self {
        let cancel = shared.pulse.writing.child();
        let state = State {
            tables: Mutex::new(Some(tables)),
            bytes: AtomicU64::new(0),
            shared,
        };
        Self {
            model: model.clone(),
            background,
            state: Arc::new(state),
            cancel,
            writing: None,
        }
    }

    /// Whether the tables are of this model.
    pub fn is_of(&self, model: &Arc<Model>) -> bool {
        Arc::ptr_eq(&self.model, model)
    }

    /// There is more to be written. What comes while the last piece is being written is left for
    /// the next time.
    pub fn catch_up(&mut self, log: TrackFileReader) {
        if self.writing.as_ref().is_some_and(Pending::is_under_way) {
            return;
        }
        let state = self.state.clone();
        let write = move |cancel: &CancelToken| state.catch_up(&log, cancel);
        self.writing = self.background.begin(self.cancel.child(), write);
    }

    /// Size of the tables on the disk, bytes.
    pub fn bytes(&self) -> u64 {
        // After a panic they are not to be used.
        if self.state.tables.is_poisoned() {
            return 0;
        }
        self.state.bytes.load(Ordering::Relaxed)
    }

    /// The tables as far as they are; `None` if they could not be written. What is being written is
    /// cut after the next frame, what waits is not begun.
    pub fn into_tables(mut self) -> Option<CaptureTables> {
        self.take()
    }

    fn take(&mut self) -> Option<CaptureTables> {
        self.cancel.cancel();
        self.state.tables.lock().ok()?.take()
    }
}

/// Tables that nobody took are discarded; nothing is left of them.
impl Drop for TableWriter {
    fn drop(&mut self) {
        drop(self.take());
    }
}

impl State {
    /// Writes up to the end of `log`.
    fn catch_up(&self, log: &TrackFileReader, cancel: &CancelToken) {
        let Ok(mut held) = self.tables.lock() else {
            return;
        };
        let Some(tables) = held.as_mut() else { return };
        match tables.catch_up(log, cancel) {
            Ok(()) => self.bytes.store(tables.bytes(), Ordering::Relaxed),
            Err(e) => {
                // Said while something can be done about it; at the end all is tried again.
                self.shared
                    .news(format!("the capture cannot be written at present: {e}"));
                *held = None;
                self.bytes.store(0, Ordering::Relaxed);
            }
        }
    }
}

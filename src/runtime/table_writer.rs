//! The tables of a capture, written on a thread of their own while the film goes on.
//!
//! Every frame of a capture has its pose by the model that it ends with, so tables of a model that
//! is replaced are discarded, and begin anew from the first frame. That ends when the model has
//! settled, two minutes after the build; from then on nothing is written twice.

use super::capture_tables::CaptureTables;
use super::shared::{Failure, Shared};
use crate::cancel::CancelToken;
use crate::recording::TrackFileReader;
use crate::solve::Model;
use crossbeam_channel::{Receiver, Sender, bounded};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;

/// The tables, and the thread that brings them up to date.
pub struct TableWriter {
    model: Arc<Model>,
    logs: Sender<TrackFileReader>,
    cancel: CancelToken,
    bytes: Arc<AtomicU64>,
    thread: JoinHandle<Result<CaptureTables, Failure>>,
}

impl TableWriter {
    /// # Errors
    /// The thread cannot be started.
    pub fn start(
        tables: CaptureTables,
        model: &Arc<Model>,
        shared: Arc<Shared>,
    ) -> std::io::Result<Self> {
        let (logs, queue) = bounded(1);
        let cancel = shared.pulse.writing.child();
        let token = cancel.clone();
        let bytes = Arc::new(AtomicU64::new(0));
        let written = bytes.clone();
        let run = move || write(tables, &queue, &token, &written, &shared);
        let thread = std::thread::Builder::new()
            .name("write".into())
            .spawn(run)?;
        Ok(Self {
            model: model.clone(),
            logs,
            cancel,
            bytes,
            thread,
        })
    }

    /// Whether the tables are of this model.
    pub fn is_of(&self, model: &Arc<Model>) -> bool {
        Arc::ptr_eq(&self.model, model)
    }

    /// There is more to be written. What comes while the thread is busy is left for the next time.
    pub fn catch_up(&self, log: TrackFileReader) {
        let _ = self.logs.try_send(log);
    }

    /// Size of the tables on the disk, bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// The tables as far as they are; `None` if they could not be written.
    pub fn join(self) -> Option<CaptureTables> {
        drop(self.logs);
        self.thread.join().ok()?.ok()
    }

    /// Nobody wants the tables any more; nothing is left of them.
    pub fn discard(self) {
        self.cancel.cancel();
        drop(self.join());
    }
}

fn write(
    mut tables: CaptureTables,
    logs: &Receiver<TrackFileReader>,
    cancel: &CancelToken,
    written_bytes: &AtomicU64,
    shared: &Shared,
) -> Result<CaptureTables, Failure> {
    for log in logs {
        if let Err(e) = tables.catch_up(&log, cancel) {
            // Said while something can be done about it; at the end all is tried again.
            shared.news(format!("the capture cannot be written at present: {e}"));
            return Err(e);
        }
        written_bytes.store(tables.bytes(), Ordering::Relaxed);
    }
    Ok(tables)
}

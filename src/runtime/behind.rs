//! The tables of a capture on a thread of their own, and their change to another tree when it is
//! refined.
//!
//! Every frame of a capture has its pose by the tree that it ends with, so a refinement means
//! writing both tables anew from the first frame. That is done behind, like all else; until it has
//! come as far as the film, the old tree's tables are kept, so that a wish to stop is granted as
//! fast as ever.

use super::capture_tables::CaptureTables;
use super::shared::{Failure, Shared};
use crate::config::Config;
use crate::pipeline::Tree;
use crate::recording::SpoolReader;
use crossbeam_channel::{Sender, bounded};
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;

/// The tables of the newest tree, and those of the one before until the newest have caught up.
#[derive(Default)]
pub struct BehindTree {
    newest: Option<Behind>,
    older: Option<Behind>,
    /// Number of sets up to which the newest were last asked for.
    asked: u64,
}

impl BehindTree {
    /// Has the tables of `tree` brought up to the end of `spool`, in what becomes the folder `dir`;
    /// `pictured` is the frame whose pose is kept apart.
    pub fn catch_up(
        &mut self,
        tree: &Arc<Tree>,
        spool: SpoolReader,
        (dir, config, pictured): (&Path, &Config, Option<u64>),
        shared: &Arc<Shared>,
    ) {
        if self
            .newest
            .as_ref()
            .is_none_or(|b| !Arc::ptr_eq(&b.tree, tree))
        {
            // Where they cannot be begun, the end will say why.
            let newest = CaptureTables::create(dir, tree, config, pictured)
                .ok()
                .and_then(|tables| Behind::start(tables, tree, shared.clone()).ok());
            match (
                std::mem::replace(&mut self.newest, newest),
                self.older.is_some(),
            ) {
                // The one before had not caught up itself.
                (Some(overtaken), true) => overtaken.give_up(),
                (before, false) => self.older = before,
                (None, true) => {}
            }
        } else if self.asked > 0
            && let Some(newest) = &self.newest
            && newest.written.load(Ordering::Relaxed) >= self.asked
        {
            self.older.take().into_iter().for_each(Behind::give_up);
        }
        self.asked = spool.len();
        // The older ones are what a wish to stop gets: they go on until they are given up.
        if let Some(older) = &self.older {
            older.catch_up(spool.clone());
        }
        if let Some(newest) = &self.newest {
            newest.catch_up(spool);
        }
    }

    /// Nobody wants the tables any more; nothing is left of them.
    pub fn give_up(self) {
        self.newest
            .into_iter()
            .chain(self.older)
            .for_each(Behind::give_up);
    }

    /// The tables as far as they are; `None` if there are none or they could not be written. In a
    /// hurry those that have come farther.
    pub fn join(self, hurry: bool) -> Option<CaptureTables> {
        let (kept, other) = match (self.newest, self.older) {
            (newest, Some(older)) if hurry => (Some(older), newest),
            (newest, older) => (newest, older),
        };
        other.into_iter().for_each(Behind::give_up);
        kept?.join()
    }
}

/// Tables on a thread of their own.
struct Behind {
    tree: Arc<Tree>,
    spool: Sender<SpoolReader>,
    /// Number of sets of which all is written that can be; 0 until `tracks.csv` has begun.
    written: Arc<AtomicU64>,
    given_up: Arc<AtomicBool>,
    thread: JoinHandle<Result<CaptureTables, Failure>>,
}

impl Behind {
    /// # Errors
    /// The thread cannot be started.
    fn start(mut tables: CaptureTables, tree: &Arc<Tree>, shared: Arc<Shared>) -> io::Result<Self> {
        let (spool, readers) = bounded::<SpoolReader>(1);
        let given_up = Arc::<AtomicBool>::default();
        let written = Arc::<AtomicU64>::default();
        let (over, done) = (given_up.clone(), written.clone());
        let run = move || {
            // A sign of life when the end waits for it.
            let wrote = || {
                shared.pulse.wrote();
                !over.load(Ordering::Relaxed)
            };
            for spool in readers {
                if let Err(e) = tables.catch_up(&spool, wrote) {
                    // Said while something can be done about it; at the end all is tried again.
                    shared.news(format!("the capture cannot be written at present: {e}"));
                    return Err(e);
                }
                if tables.is_abreast() {
                    done.store(spool.len(), Ordering::Relaxed);
                }
            }
            Ok(tables)
        };
        let thread = std::thread::Builder::new()
            .name("behind".into())
            .spawn(run)?;
        Ok(Self {
            tree: tree.clone(),
            spool,
            written,
            given_up,
            thread,
        })
    }

    /// There is more to be written. What comes while the thread is busy is left for the next time.
    fn catch_up(&self, spool: SpoolReader) {
        let _ = self.spool.try_send(spool);
    }

    /// Nobody wants the tables any more; nothing is left of them.
    fn give_up(self) {
        self.given_up.store(true, Ordering::Relaxed);
        drop(self.join());
    }

    /// The tables as far as they are; `None` if they could not be written.
    fn join(self) -> Option<CaptureTables> {
        drop(self.spool);
        self.thread.join().ok()?.ok()
    }
}

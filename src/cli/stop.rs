//! Signals in commands that compute something and write it to a file.

use super::command_error::{CommandError, STOPPED};
use super::hangup::SighupAction;
use super::signals::{ending_signals, stop_on_signals};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Stops a command by a signal. Before anything is written the signal ends the process at once,
/// even in a long computation; after that it sets a flag, and the writer removes incomplete files.
pub struct Stop {
    at_once: Arc<AtomicBool>,
    requested: Arc<AtomicBool>,
}

impl Stop {
    /// # Errors
    /// The signals cannot be caught.
    pub fn on_signals() -> Result<Self, CommandError> {
        let at_once = Arc::new(AtomicBool::new(true));
        let by_hangup = SighupAction::ends_this_process();
        for signal in ending_signals(by_hangup) {
            signal_hook::flag::register_conditional_shutdown(
                signal,
                i32::from(STOPPED),
                at_once.clone(),
            )
            .map_err(CommandError::failed)?;
        }
        Ok(Self {
            at_once,
            requested: stop_on_signals(by_hangup, None)?,
        })
    }

    /// From now on signals only set the flag that this returns; the writer must check it.
    pub fn while_writing(&self) -> &AtomicBool {
        self.at_once.store(false, Ordering::SeqCst);
        &self.requested
    }
}

//! Ctrl-C in commands that work something out and write it to a file.

use super::ended::{Ended, STOPPED};
use super::hangup::SighupAction;
use super::session::stop_on_signals;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The wish to end. As long as nothing is written it is fulfilled at once, however long a step
/// takes; from then on it is for the writer, so that nothing half-written is left.
pub struct Stop {
    at_once: Arc<AtomicBool>,
    wish: Arc<AtomicBool>,
}

impl Stop {
    /// # Errors
    /// The signals cannot be caught.
    pub fn on_signals() -> Result<Self, Ended> {
        let at_once = Arc::new(AtomicBool::new(true));
        let by_hangup = SighupAction::ends_this_process();
        for signal in [SIGINT, SIGTERM]
            .into_iter()
            .chain(by_hangup.then_some(SIGHUP))
        {
            signal_hook::flag::register_conditional_shutdown(
                signal,
                i32::from(STOPPED),
                at_once.clone(),
            )
            .map_err(|e| Ended::Failed(e.into()))?;
        }
        Ok(Self {
            at_once,
            wish: stop_on_signals(by_hangup)?,
        })
    }

    /// From now on there is something to be taken away again; the writer looks at what this
    /// gives.
    pub fn while_writing(&self) -> &AtomicBool {
        self.at_once.store(false, Ordering::SeqCst);
        &self.wish
    }
}

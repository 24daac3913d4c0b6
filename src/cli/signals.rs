//! The signals that end a command.

use super::command_error::{CommandError, FAILED};
use super::output::eprint_line;
use crate::runtime::in_background;
use crate::tui;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag::{register, register_conditional_shutdown};
use signal_hook::iterator::Signals;
use signal_hook::low_level;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Signals within this of the first are the same one: `timeout` sends its signal to the program and then to
/// its whole group.
const SAME_SIGNAL: Duration = Duration::from_millis(500);

/// The signals that end a command; SIGHUP only if `by_hangup`.
pub fn ending_signals(by_hangup: bool) -> Vec<i32> {
    let mut signals = vec![SIGINT, SIGTERM];
    if by_hangup {
        signals.push(SIGHUP);
    }
    signals
}

/// A flag that is set by the signals that end a command; by SIGHUP only if `by_hangup`.
///
/// A second signal, half a second later or more, ends the program at once, without a capture: otherwise
/// nothing could end it while a disk hangs. What has been filmed is in `unfinished` then. A closed terminal
/// hangs up twice, itself and through its shell, and ends nothing at once.
///
/// # Errors
/// The signals cannot be caught.
pub fn stop_on_signals(
    by_hangup: bool,
    unfinished: Option<PathBuf>,
) -> Result<Arc<AtomicBool>, CommandError> {
    let stop = Arc::new(AtomicBool::new(false));
    let is_ending = Arc::new(AtomicBool::new(false));
    for signal in ending_signals(by_hangup) {
        // A closed terminal hangs up twice. The others end at once at the third, where the message of the
        // second cannot be written.
        if signal != SIGHUP {
            register_conditional_shutdown(signal, i32::from(FAILED), is_ending.clone())
                .map_err(CommandError::failed)?;
        }
        register(signal, stop.clone()).map_err(CommandError::failed)?;
    }
    let signals = Signals::new([SIGINT, SIGTERM]).map_err(CommandError::failed)?;
    in_background("signals", move || {
        end_at_second(signals, &is_ending, unfinished.as_deref())
    })?;
    Ok(stop)
}

fn end_at_second(mut signals: Signals, is_ending: &AtomicBool, unfinished: Option<&Path>) {
    signals.forever().next();
    thread::sleep(SAME_SIGNAL);
    signals.pending().for_each(drop);
    if signals.forever().next().is_none() {
        return;
    }
    is_ending.store(true, Ordering::SeqCst);
    tui::give_terminal_back();
    let to_finish = match unfinished.filter(|dir| dir.exists()) {
        Some(dir) => format!(
            "; `arborcam finish {}` completes the capture",
            dir.display()
        ),
        None => String::new(),
    };
    eprint_line(&format!(
        "arborcam: ended at once by a second signal{to_finish}"
    ));
    low_level::exit(i32::from(FAILED));
}

//! Threads with a name.

use super::shared::Failure;
use std::thread::JoinHandle;

/// Starts the thread `name`.
///
/// # Errors
/// The system has no thread to give.
pub fn spawn<T: Send + 'static>(
    name: &str,
    run: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, Failure> {
    let thread = std::thread::Builder::new().name(name.into());
    thread.spawn(run).map_err(Failure::Thread)
}

/// Does `work` on a thread of this name, which nobody waits for.
///
/// # Errors
/// There is no thread to be had.
pub fn in_background(name: &str, work: impl FnOnce() + Send + 'static) -> Result<(), Failure> {
    spawn(name, work).map(drop)
}

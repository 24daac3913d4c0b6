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

//! Panics in other people's code that are caught, and known as such to other handlers of
//! panics.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static CATCHING: Cell<bool> = const { Cell::new(false) };
}

/// What `call` gives; `None` if it panicked, after which nothing that it worked on is to be used
/// again.
pub fn caught<T>(call: impl FnOnce() -> T) -> Option<T> {
    let before = CATCHING.replace(true);
    let done = catch_unwind(AssertUnwindSafe(call)).ok();
    CATCHING.set(before);
    done
}

/// From now on panics that are caught go to the log and are not printed: what is wrong is said in one
/// line by who caught them.
pub fn print_only_uncaught() {
    let print = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| match catching() {
        true => tracing::error!("{panic}"),
        false => print(panic),
    }));
}

/// Whether a panic on this thread would be caught by [`caught`]. A hook runs before anything is
/// caught, and must not take such a panic for the end.
pub fn catching() -> bool {
    CATCHING.get()
}

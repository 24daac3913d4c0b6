//! Lines on standard output and standard error.

use super::ended::Ended;
use std::io::{ErrorKind, Write};

/// Writes `text` to standard output. A reader that closed it early has seen what it needed.
pub fn print(text: &str) -> Result<(), Ended> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Ended::Failed(e.into())),
        _ => Ok(()),
    }
}

/// A line on standard error; if nobody reads it any more, that is no reason to fail.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

//! Lines on standard output and standard error.

use super::command_error::CommandError;
use super::plain::plain;
use anyhow::anyhow;
use std::io::{ErrorKind, Write};

/// Writes `text` to standard output. A closed pipe is no error: its reader has what it needs.
///
/// # Errors
/// Standard output cannot be written for another reason.
pub fn print(text: &str) -> Result<(), CommandError> {
    print_bytes(&[text.as_bytes()])
}

/// The same with bytes, one part after the other.
///
/// # Errors
/// As of [`print`].
pub fn print_bytes(parts: &[&[u8]]) -> Result<(), CommandError> {
    let mut out = std::io::stdout().lock();
    let written = parts.iter().try_for_each(|part| out.write_all(part));
    match written.and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(CommandError::Failed(anyhow!(
            "cannot write to standard output: {e}"
        ))),
        _ => Ok(()),
    }
}

/// Writes a line to standard error, in plain words. Errors are ignored: nobody reads it then.
pub fn eprint_line(line: &str) {
    let _ = writeln!(std::io::stderr(), "{}", plain(line));
}

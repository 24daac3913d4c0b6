//! Commands that make a folder of one file.

use std::path::Path;
use std::process::{Command, Output};

pub const FAILED: i32 = 1;
pub const BAD_USAGE: i32 = 2;
pub const NO_INPUT: i32 = 3;

/// A command that writes to `out`.
pub fn command(arguments: &[&str], out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command.args(arguments).arg("--out").arg(out);
    command
}

/// Runs it.
pub fn arborcam(arguments: &[&str], out: &Path) -> Output {
    command(arguments, out).output().expect("arborcam")
}

/// Runs one that must succeed, and returns what it said.
pub fn done(arguments: &[&str], out: &Path) -> String {
    let output = arborcam(arguments, out);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {said}");
    said
}

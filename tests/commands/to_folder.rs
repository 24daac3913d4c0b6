//! Commands that make a folder of one file.

use std::collections::BTreeMap;
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

/// The rows of a table by the names of its columns.
pub fn records(path: &Path) -> Vec<BTreeMap<String, String>> {
    let mut table = csv::Reader::from_path(path).expect("table");
    table.deserialize().map(|row| row.expect("row")).collect()
}

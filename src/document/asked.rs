//! `asked.csv`: when the user of a running film drew along branches.

use super::error::DocumentError;
use super::table::{TableReader, TableWriter};
use crate::files::WriteError;
use std::collections::BTreeSet;
use std::path::Path;

/// The name of the file.
pub const ASKED_FILE: &str = "asked.csv";
const HEADER: &str = "frame";
const COLUMNS: [&str; 1] = ["frame"];

/// The table as bytes: the newest frame each time that the wood was to be looked for again.
///
/// # Errors
/// Memory cannot be had.
pub fn asked_csv(asked: &BTreeSet<u64>) -> Result<Vec<u8>, WriteError> {
    let mut table = TableWriter::new(ASKED_FILE, HEADER, Vec::new())?;
    for frame in asked {
        table.count(*frame);
        table.end_row()?;
    }
    table.finish()
}

/// Reads the table in `dir`; nothing where there is none.
///
/// # Errors
/// It is damaged.
pub fn read_asked(dir: &Path) -> Result<BTreeSet<u64>, DocumentError> {
    let mut asked = BTreeSet::new();
    if !dir.join(ASKED_FILE).exists() {
        return Ok(asked);
    }
    let mut table = TableReader::open(dir, ASKED_FILE, COLUMNS)?;
    while table.next()? {
        asked.insert(table.whole(0, "frame")?);
    }
    Ok(asked)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read_and_damage_is_refused() {
        let dir = tempfile::tempdir().expect("a folder");
        let read = |text: &[u8]| {
            std::fs::write(dir.path().join(ASKED_FILE), text).expect("a file");
            read_asked(dir.path())
        };
        assert_eq!(read_asked(dir.path()).expect("none"), BTreeSet::new());
        for asked in [BTreeSet::new(), BTreeSet::from([0, 17, u64::MAX])] {
            let text = asked_csv(&asked).expect("a table");
            assert_eq!(read(&text).expect("frames"), asked);
        }
        for damaged in ["", "other\n1\n", "frame\n-1\n", "frame\nx\n"] {
            assert!(read(damaged.as_bytes()).is_err(), "{damaged:?}");
        }
    }
}

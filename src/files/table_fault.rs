//! What is wrong with a row of a table, in words.

use csv::{Error, ErrorKind, Position};

/// A row that is no row of its table.
#[derive(Debug, PartialEq, Eq)]
pub struct TableFault {
    /// Counted from 1; the first is that of the names.
    pub line: u64,
    /// Such as `it is no text`.
    pub what: String,
}

impl From<&Error> for TableFault {
    fn from(e: &Error) -> Self {
        let what = match e.kind() {
            ErrorKind::Utf8 { .. } => "it is no text".to_owned(),
            ErrorKind::UnequalLengths {
                expected_len, len, ..
            } => format!("it has {len} cells, and the first line {expected_len}"),
            _ => "it cannot be read as a table".to_owned(),
        };
        let line = e.position().map_or(1, Position::line);
        Self { line, what }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_that_is_none_is_put_in_words() {
        for (table, line, what) in [
            (
                &b"a,b\n1,2\n3\n"[..],
                3,
                "it has 1 cells, and the first line 2",
            ),
            (b"a\xff,b\n1,2\n", 1, "it is no text"),
        ] {
            let mut reader = csv::Reader::from_reader(table);
            let header = reader.headers().err();
            let fault = header.or_else(|| reader.records().find_map(Result::err));
            let expected = TableFault {
                line,
                what: what.to_owned(),
            };
            assert_eq!(fault.as_ref().map(TableFault::from), Some(expected));
        }
    }
}

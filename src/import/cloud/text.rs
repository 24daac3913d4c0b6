//! A point on each line.

use super::Points;
use crate::import::error::ImportError;
use std::io::{BufRead, Read};

/// Longest line, bytes.
const LONGEST_LINE: u64 = 4096;
/// Lines before the first point that may be of another kind: names of columns, a number of points.
const MOST_HEADER_LINES: usize = 16;

/// Reads the first three numbers of every line; they are parted by white space, commas or
/// semicolons, not by both of these. Lines that begin with `#` or `//` do not count.
///
/// # Errors
/// A line is none of a point, or too long.
pub(super) fn read(mut input: impl BufRead, points: &mut Points) -> Result<(), ImportError> {
    let mut line = Vec::new();
    let mut others = 0;
    let mut has_points = false;
    for number in 1_u64.. {
        line.clear();
        let read = (&mut input).take(LONGEST_LINE).read_until(b'\n', &mut line);
        if read.map_err(|e| ImportError::unreadable(&e))? == 0 {
            break;
        }
        let own = line.trim_ascii();
        if own.is_empty() || own.starts_with(b"#") || own.starts_with(b"//") {
            continue;
        }
        if own.contains(&b';') && own.contains(&b',') {
            return Err(ImportError::bad_format(format!(
                "line {number} has semicolons and commas; write numbers with decimal points"
            )));
        }
        if let Some([x, y, z]) = place(own) {
            points.push(x, y, z)?;
            has_points = true;
        } else {
            others += 1;
            if has_points || others > MOST_HEADER_LINES {
                return Err(ImportError::bad_format(format!(
                    "line {number} does not begin with three numbers"
                )));
            }
        }
    }
    Ok(())
}

/// The first three numbers of a line.
fn place(line: &[u8]) -> Option<[f64; 3]> {
    let text = std::str::from_utf8(line).ok()?;
    let mut words = text
        .split(|c: char| c.is_ascii_whitespace() || c == ',' || c == ';')
        .filter(|w| !w.is_empty());
    let mut next = || words.next()?.parse::<f64>().ok();
    Some([next()?, next()?, next()?])
}

//! A point on each line.

use super::Points;
use crate::import::error::ImportError;
use std::io::{BufRead, Read};

/// Longest line, bytes.
const LONGEST_LINE: u64 = 4096;
/// Lines before the first point that may be of another kind: names of columns, a number of points.
const MOST_HEADER_LINES: usize = 16;

/// Reads three numbers of every line: those in the columns that a line before the first point calls x, y and z, or else
/// the first three. They are parted by white space, by commas or by semicolons, not by two of these. Other lines
/// that begin with `#` or `//` do not count.
///
/// # Errors
/// A line is none of a point, or too long, or it may have decimal commas.
pub(super) fn read(mut input: impl BufRead, points: &mut Points) -> Result<(), ImportError> {
    let mut line = Vec::new();
    let mut others = 0;
    let mut has_points = false;
    let mut columns = [0, 1, 2];
    for number in 1_u64.. {
        line.clear();
        let read = (&mut input).take(LONGEST_LINE).read_until(b'\n', &mut line);
        if read.map_err(|e| ImportError::unreadable(&e))? == 0 {
            break;
        }
        let own = line.trim_ascii();
        let is_comment = own.starts_with(b"#") || own.starts_with(b"//");
        if !has_points && let Some(named) = named_columns(own) {
            columns = named;
            continue;
        }
        if own.is_empty() || is_comment {
            continue;
        }
        if has_decimal_commas(own) {
            let others = match own.contains(&b';') {
                true => "semicolons",
                false => "white space",
            };
            return Err(ImportError::bad_format(format!(
                "line {number} has {others} and commas; write numbers with decimal points"
            )));
        }
        if let Some([x, y, z]) = place(own, columns) {
            points.push(x, y, z)?;
            has_points = true;
        } else {
            others += 1;
            if has_points || others > MOST_HEADER_LINES {
                return Err(ImportError::bad_format(format!(
                    "line {number} does not have three numbers of a place"
                )));
            }
        }
    }
    Ok(())
}

/// Which columns a line calls x, y and z; `None` if it has no such names.
fn named_columns(line: &[u8]) -> Option<[usize; 3]> {
    let text = std::str::from_utf8(line).ok()?;
    let names: Vec<String> = words(text.trim_start_matches(['#', '/']))
        .map(|name| name.trim_matches('"').to_ascii_lowercase())
        .collect();
    let column = |wanted: &str| names.iter().position(|name| name == wanted);
    Some([column("x")?, column("y")?, column("z")?])
}

/// Whether commas stand within what white space or semicolons part: they may be those of decimals.
fn has_decimal_commas(line: &[u8]) -> bool {
    let parts = line.split(|c| c.is_ascii_whitespace() || *c == b';');
    let is_one = |part: &&[u8]| part.iter().any(|c| *c != b',');
    let parts: Vec<&[u8]> = parts.filter(is_one).collect();
    let has_inner = |part: &&[u8]| part.split(|c| *c == b',').filter(|p| !p.is_empty()).count() > 1;
    parts.len() > 1 && parts.iter().any(has_inner)
}

/// The numbers in these columns of a line.
fn place(line: &[u8], columns: [usize; 3]) -> Option<[f64; 3]> {
    let text = std::str::from_utf8(line).ok()?;
    let words: Vec<&str> = words(text).collect();
    let number = |column: usize| words.get(column)?.parse::<f64>().ok();
    let [x, y, z] = columns.map(number);
    Some([x?, y?, z?])
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c.is_ascii_whitespace() || c == ',' || c == ';')
        .filter(|word| !word.is_empty())
}

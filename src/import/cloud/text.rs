//! A point on each line.

use super::Points;
use crate::files::without_byte_order_mark;
use crate::import::error::ImportError;
use std::io::{BufRead, Read};

/// Longest line, bytes.
const LONGEST_LINE: u64 = 4096;
/// Lines before the first point that may be of another kind: names of columns, a number of points.
const MOST_HEADER_LINES: usize = 16;

/// What parts the cells of a line, tried in this order; `None` is white space.
const SEPARATORS: [Option<char>; 3] = [Some(';'), Some(','), None];

/// What the columns of a place are called.
const X: [&str; 3] = ["x", "easting", "east"];
const Y: [&str; 3] = ["y", "northing", "north"];
const Z: [&str; 4] = ["z", "height", "elevation", "altitude"];

/// Reads three numbers of every line: those in the columns that a line before the first point calls x, y and z (or
/// easting, northing and height), or else the first three. Semicolons, commas or white space part them, and decimals
/// have points. Other lines that begin with `#` or `//` do not count.
///
/// # Errors
/// A line is none of a point, or too long, or has other columns than the line of names, or may have decimal commas.
pub(super) fn read(mut input: impl BufRead, points: &mut Points) -> Result<(), ImportError> {
    let mut line = Vec::new();
    let mut n_headers = 0;
    let mut has_points = false;
    let mut columns = Columns::FIRST;
    for number in 1_u64.. {
        line.clear();
        let read = (&mut input).take(LONGEST_LINE).read_until(b'\n', &mut line);
        if read.map_err(|e| ImportError::unreadable(&e))? == 0 {
            break;
        }
        let text = String::from_utf8_lossy(&line);
        let own = without_byte_order_mark(&text).trim();
        if own.is_empty() {
            continue;
        }
        if !has_points && let Some(named) = Columns::named(own, number) {
            columns = named;
            continue;
        }
        if is_comment(own) {
            continue;
        }
        if own.contains(';') && own.contains(',') {
            return Err(decimal_commas(number, "semicolons"));
        }
        if !has_points {
            columns = columns.of_points_as(own, number)?;
        }
        if let Some([x, y, z]) = columns.place(own) {
            points.push(x, y, z)?;
            has_points = true;
            continue;
        }
        if has_commas_within(own) {
            return Err(decimal_commas(number, "white space"));
        }
        n_headers += 1;
        if has_points || n_headers > MOST_HEADER_LINES {
            return Err(ImportError::bad_format(format!(
                "line {number} has no place of a point: three numbers"
            )));
        }
    }
    Ok(())
}

/// Whether a cell holds one of these names, with a unit in brackets behind it or not.
fn is_of(cell: &str, names: &[&str]) -> bool {
    let name = cell.split(['(', '[']).next().unwrap_or("").trim();
    names.iter().any(|wanted| name.eq_ignore_ascii_case(wanted))
}

fn is_comment(line: &str) -> bool {
    line.starts_with('#') || line.starts_with("//")
}

fn decimal_commas(number: u64, others: &str) -> ImportError {
    ImportError::bad_format(format!(
        "line {number} has {others} and commas; write numbers with decimal points"
    ))
}

/// Whether a line is of numbers alone, and has commas and white space: the commas may be those of decimals.
fn has_commas_within(line: &str) -> bool {
    line.chars().all(is_of_numbers) && line.contains(',') && line.contains(char::is_whitespace)
}

fn is_of_numbers(c: char) -> bool {
    c.is_ascii_digit() || "+-.,eE".contains(c) || c.is_whitespace()
}

/// The cells of a line, without quotes. Where white space parts them, there are no empty ones.
fn cells(line: &str, separator: Option<char>) -> impl Iterator<Item = &str> {
    let parts = line.split(move |c: char| match separator {
        Some(separator) => c == separator,
        None => c.is_whitespace(),
    });
    parts
        .map(|cell| cell.trim().trim_matches('"'))
        .filter(move |cell| separator.is_some() || !cell.is_empty())
}

/// Where the numbers of a place stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Columns {
    /// Of x, y and z, from 0.
    at: [usize; 3],
    /// The line that names them.
    names: Option<Names>,
}

/// A line that names columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Names {
    line: u64,
    count: usize,
    is_comment: bool,
}

impl Columns {
    /// Those of points without names.
    const FIRST: Self = Self {
        at: [0, 1, 2],
        names: None,
    };

    /// The columns that a line calls x, y and z; `None` if it has no such names.
    fn named(line: &str, number: u64) -> Option<Self> {
        let is_comment = is_comment(line);
        let line = line.trim_start_matches(['#', '/']);
        SEPARATORS.into_iter().find_map(|separator| {
            let column =
                |names: &[&str]| cells(line, separator).position(|cell| is_of(cell, names));
            Some(Self {
                at: [column(&X)?, column(&Y)?, column(&Z)?],
                names: Some(Names {
                    line: number,
                    count: cells(line, separator).count(),
                    is_comment,
                }),
            })
        })
    }

    /// These columns, if the first point has as many cells as there are names, or this line is no point yet. A comment
    /// that merely looks like names is none.
    ///
    /// # Errors
    /// A line of names has another number of them.
    fn of_points_as(self, point: &str, number: u64) -> Result<Self, ImportError> {
        let Some(names) = self.names.filter(|_| self.at != Self::FIRST.at) else {
            return Ok(self);
        };
        let is_of_points = |separator| cells(point, separator).count() == names.count;
        let is_none = self.place(point).is_none() && Self::FIRST.place(point).is_none();
        if is_none || SEPARATORS.into_iter().any(is_of_points) {
            return Ok(self);
        }
        match names.is_comment {
            true => Ok(Self::FIRST),
            false => Err(ImportError::bad_format(format!(
                "line {} names {} columns, and line {number} has others",
                names.line, names.count
            ))),
        }
    }

    /// The place on a line; `None` where a number of it is missing.
    fn place(&self, line: &str) -> Option<[f64; 3]> {
        SEPARATORS.into_iter().find_map(|separator| {
            let number = |column: usize| cells(line, separator).nth(column)?.parse::<f64>().ok();
            let [x, y, z] = self.at.map(number);
            Some([x?, y?, z?])
        })
    }
}

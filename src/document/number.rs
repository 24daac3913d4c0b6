//! Numbers as text, the same on every machine.

use std::str::FromStr;

/// Appends `x` with at most `decimals` digits after the point, no trailing zeros, no exponent and
/// no negative zero; nothing at all for what is no number.
pub fn push(out: &mut String, x: f64, decimals: usize) {
    use std::fmt::Write;
    if !x.is_finite() {
        return;
    }
    let start = out.len();
    // Writing to a string cannot fail.
    let _ = write!(out, "{x:.decimals$}");
    if decimals > 0 {
        out.truncate(
            start
                + out[start..]
                    .trim_end_matches('0')
                    .trim_end_matches('.')
                    .len(),
        );
    }
    if &out[start..] == "-0" {
        out.remove(start);
    }
}

/// What reading the text back gives; no number for what is none.
pub(super) fn as_read<T: FromStr + From<f32>>(x: f64, decimals: usize) -> T {
    let written = text(x, decimals);
    written.parse().unwrap_or_else(|_| f32::NAN.into())
}

/// The number of a cell; `None` where it is unknown: in an empty cell, and where it is infinite or none.
///
/// # Errors
/// The cell holds words.
pub(super) fn known(cell: &str, name: &str) -> Result<Option<f64>, String> {
    if cell.is_empty() {
        return Ok(None);
    }
    let number: f64 = cell.parse().map_err(|_| no_number(cell, name))?;
    Ok(number.is_finite().then_some(number))
}

/// What is wrong with a cell that should hold a number.
pub(super) fn no_number(cell: &str, name: &str) -> String {
    format!("{name} is {cell:?}, and must be a number")
}

/// What [`push`] appends, as a text of its own.
pub(super) fn text(x: f64, decimals: usize) -> String {
    let mut text = String::new();
    push(&mut text, x, decimals);
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn numbers_are_compact_and_never_exponents() {
        let cases = [
            (1.0, 3, "1"),
            (12.5, 3, "12.5"),
            (-0.0001, 3, "0"),
            (100.0, 0, "100"),
            (1e-9, 6, "0"),
            (1e15, 3, "1000000000000000"),
            (2.0 / 3.0, 6, "0.666667"),
            (f64::NAN, 3, ""),
            (f64::INFINITY, 3, ""),
        ];
        for (x, decimals, text) in cases {
            let mut out = String::new();
            super::push(&mut out, x, decimals);
            assert_eq!(out, text);
        }
    }
}

//! What tables say of a branch's sway: the columns of `nodes.csv`, written and read.

use super::number;
use crate::model::{Excitation, SwayColumns, Swaying, Unidentified};

/// The columns of `nodes.csv` on the sway, in their order: first [`SwayColumns::NAMES`].
pub(super) const COLUMNS: [&str; 10] = {
    let [f, f_lo, f_hi, d, d_lo, d_hi] = SwayColumns::NAMES;
    [
        f,
        f_lo,
        f_hi,
        d,
        d_lo,
        d_hi,
        "identifiable",
        "excitation",
        "amplitude_deg",
        "unidentified",
    ]
};

/// The cells of [`COLUMNS`].
pub(super) fn cells(sway: &Swaying) -> [String; 10] {
    let [f, f_lo, f_hi, d, d_lo, d_hi] = SwayColumns::of(sway.as_ref().ok())
        .values()
        .map(|x| number::text(x, 5));
    let amplitude_deg = sway.map_or(f64::NAN, |s| s.amplitude_deg);
    [
        f,
        f_lo,
        f_hi,
        d,
        d_lo,
        d_hi,
        sway.is_ok().to_string(),
        sway.map_or("", |s| s.excitation.word()).into(),
        number::text(amplitude_deg, 4),
        sway.err().map_or("", Unidentified::word).into(),
    ]
}

/// The sway that the cells of [`COLUMNS`] tell. A frequency counts with its interval only.
///
/// # Errors
/// A cell holds what is no number, or an interval does not hold its value, or it is not said what made a branch
/// sway whose frequency is known.
pub(super) fn read(cells: [&str; 10]) -> Result<Swaying, String> {
    let mut values = [f64::NAN; 6];
    for ((value, cell), name) in values.iter_mut().zip(cells).zip(COLUMNS) {
        *value = number::known(cell, name)?.unwrap_or(f64::NAN);
    }
    let [f, f_lo, f_hi, d, d_lo, d_hi] = values;
    refuse_outside([f, f_lo, f_hi], COLUMNS[0], cells[0])?;
    refuse_outside([d, d_lo, d_hi], COLUMNS[3], cells[3])?;
    let columns = SwayColumns::of_values(values);
    if columns.frequency().is_none() {
        return Ok(Err(
            Unidentified::of_word(cells[9]).unwrap_or(Unidentified::NotMeasured)
        ));
    }
    let excitation = Excitation::of_word(cells[7])
        .ok_or_else(|| format!("excitation is {:?}, and must be release or wind", cells[7]))?;
    let amplitude_deg = number::known(cells[8], COLUMNS[8])?.unwrap_or(f64::NAN);
    let sway = columns.sway(excitation, amplitude_deg);
    Ok(sway.ok_or(Unidentified::NotMeasured))
}

/// # Errors
/// The value lies outside of its interval.
fn refuse_outside([value, lo, hi]: [f64; 3], name: &str, cell: &str) -> Result<(), String> {
    match value < lo || value > hi {
        true => Err(format!(
            "{name} is {cell:?}, and must lie between {lo} and {hi}"
        )),
        false => Ok(()),
    }
}

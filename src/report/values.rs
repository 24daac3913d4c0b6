//! Values as text, for the tables and the page.

use super::compare::Change;
use super::levels::Spread;
use crate::model::Interval;

/// `+1.2 % (0.4 to 2.0 %)`, with a star where it counts.
pub fn changed(change: &Change) -> String {
    format!(
        "{}{}",
        percent(&change.percent),
        if change.beyond { " *" } else { "" }
    )
}

/// `+1.2 % (+0.4 to +2.0 %)`.
pub fn percent(of: &Interval) -> String {
    let decimals = if (of.hi - of.lo).abs() < 10.0 { 1 } else { 0 };
    let [value, lo, hi] = [of.value, of.lo, of.hi].map(|x| signed(x, decimals));
    format!("{value} % ({lo} to {hi} %)")
}

/// A number with its sign; none for what rounds to 0.
fn signed(x: f64, decimals: usize) -> String {
    let text = format!("{x:+.decimals$}");
    let mut digits = text.trim_start_matches(['+', '-']).chars();
    if digits.all(|c| c == '0' || c == '.') {
        text[1..].into()
    } else {
        text
    }
}

/// `0.700 (0.699 to 0.702)`: digits enough to tell the ends apart.
pub fn interval(of: &Interval, decimals: usize) -> String {
    let decimals = if (of.hi - of.lo) < 4.0 * 10.0_f64.powi(-(decimals as i32)) {
        decimals + 1
    } else {
        decimals
    };
    format!(
        "{:.decimals$} ({:.decimals$} to {:.decimals$})",
        of.value, of.lo, of.hi
    )
}

/// `1.23 (0.70 to 2.10)`; the value alone where there is just one.
pub fn spread(of: &Spread, decimals: usize) -> String {
    let Spread {
        n,
        median,
        least,
        largest,
    } = of;
    if *n < 2 {
        return format!("{median:.decimals$}");
    }
    format!("{median:.decimals$} ({least:.decimals$} to {largest:.decimals$})")
}

/// A number for people; `-` for none.
pub fn number(x: f64, decimals: usize) -> String {
    if x.is_finite() {
        format!("{x:.decimals$}")
    } else {
        "-".into()
    }
}

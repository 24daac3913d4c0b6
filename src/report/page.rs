//! The parts of the page.

mod branch;
mod compared;
mod levels;
mod modes;
mod pattern;
mod table;

pub use branch::branch_part;
pub use compared::compared_part;
pub use levels::levels_part;
pub use modes::modes_part;
pub use pattern::pattern_part;
pub use table::{not_said, table_part};

use super::plot::escaped;
use crate::model::{Interval, Sway};

/// A drawing with what it shows; nothing without one. `caption` is HTML.
fn figure(svg: Option<String>, caption: &str) -> String {
    let Some(svg) = svg else {
        return String::new();
    };
    let class = if svg.starts_with("<svg class=\"broad\"") {
        " class=\"broad\""
    } else {
        ""
    };
    format!("<figure{class}>{svg}<figcaption>{caption}</figcaption></figure>")
}

/// A value of a branch's sway with its interval.
type ValueOf = fn(&Sway) -> Option<Interval>;

fn frequency_of(sway: &Sway) -> Option<Interval> {
    Some(sway.frequency_hz)
}

fn damping_of(sway: &Sway) -> Option<Interval> {
    sway.damping_ratio
}

/// Which colour is which capture.
fn keys<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let mut out = String::new();
    for (k, name) in names.enumerate() {
        let (colour, name) = (k % 6, escaped(name));
        out += &format!("<span class=\"key\"><i class=\"k c{colour}\"></i>{name}</span> ");
    }
    out
}

/// An interval under its value.
fn stacked(text: &str) -> String {
    let Some((value, rest)) = text.split_once(" (") else {
        return text.into();
    };
    let (interval, star) = rest.rsplit_once(')').unwrap_or((rest, ""));
    format!("{value}{star} <small>{interval}</small>")
}

/// A row of a table; cells are HTML.
fn cells(tag: &str, class: &str, cells: &[String]) -> String {
    cells
        .iter()
        .map(|cell| format!("<{tag} class=\"{class}\">{cell}</{tag}>"))
        .collect()
}

//! The parts of the page.

mod branch;
mod compared;
mod levels;
mod table;

pub use branch::branch_part;
pub use compared::compared_part;
pub use levels::levels_part;
pub use table::{not_said, table_part};

use super::plot::escaped;

/// A drawing with what it shows; nothing without one. `caption` is HTML.
fn figure(svg: Option<String>, caption: &str) -> String {
    let class = |svg: &str| {
        if svg.starts_with("<svg class=\"broad\"") {
            " class=\"broad\""
        } else {
            ""
        }
    };
    svg.map_or(String::new(), |svg| {
        format!(
            "<figure{}>{svg}<figcaption>{caption}</figcaption></figure>",
            class(&svg)
        )
    })
}

/// Which colour is which capture.
fn keys<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let key = |(k, name): (usize, &str)| {
        format!(
            "<span class=\"key\"><i class=\"k c{}\"></i>{}</span> ",
            k % 6,
            escaped(name)
        )
    };
    names.enumerate().map(key).collect()
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

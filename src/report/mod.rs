//! What a film says of a tree's sway, for people and programs: a table as text, JSON, a tidy table
//! (CSV), and one HTML page with plots after Hu et al. (figs. 3, 6, 7, 9 to 12 and 15). Pure: what
//! goes in is analysed already, what comes out is text.

mod columns;
mod compare;
mod decaying;
mod html;
mod json;
mod levels;
mod matching;
mod page;
mod pattern;
mod pieces;
mod plot;
mod released;
mod series;
mod study;
#[cfg(test)]
mod tests;
mod text;
mod tidy;
mod values;
mod words;

pub use compare::{Change, Comparison, Row, compare};
pub use html::page;
pub use json::json;
pub use levels::{Growth, Level, Spread, growth, levels};
pub use matching::{Landmark, Match, Matched, MatchedBy, View, matched};
pub use pattern::{CommonPeak, LevelPeaks, NoCommonPeak, Pattern, pattern};
pub use released::hints;
pub use series::{angles_csv, spectra_csv};
pub use study::{Branch, Gap, Given, Study};
pub use text::text;
pub use tidy::csv;

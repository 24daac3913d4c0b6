//! Notes on options and settings that have no effect on the result.

use super::output::eprint_line;
use crate::config::Config;
use serde_json::{Value, to_value};
use std::path::Path;

/// Sections that only have an effect while filming, none on a finished capture.
const FILM_SECTIONS: [&str; 7] = [
    "camera",
    "outline",
    "detect",
    "track",
    "accumulate",
    "hierarchy",
    "skeleton",
];

/// Prints that `what` has no effect, and why.
pub fn note(what: &str, why: &str) {
    eprint_line(&format!(
        "arborcam: note: {what} changes nothing here: {why}"
    ));
}

/// Notes the sections of [`FILM_SECTIONS`] in which `new` differs from the capture's `own` because
/// of the configuration file `file`.
pub fn note_film_settings(file: &Path, own: &Config, new: &Config) {
    let [own, new] = [own, new].map(|config| to_value(config).unwrap_or(Value::Null));
    let mut changed = Vec::new();
    for section in FILM_SECTIONS {
        if own[section] != new[section] {
            changed.push(format!("[{section}]"));
        }
    }
    if !changed.is_empty() {
        let what = format!("{} in {}", changed.join(", "), file.display());
        note(&what, "it is of filming; give it to `capture` or `replay`");
    }
}

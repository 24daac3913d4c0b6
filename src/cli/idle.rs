//! What was asked for and changes nothing is said, so that nobody looks for it in the result.

use super::output::say;
use crate::config::Config;
use serde_json::{Value, to_value};
use std::path::Path;

/// Settings that are used up when the film is: of a capture they change nothing any more.
const OF_THE_FILM: [&str; 7] = [
    "camera",
    "outline",
    "detect",
    "track",
    "accumulate",
    "hierarchy",
    "skeleton",
];

/// One line for `what`, and why it changes nothing.
pub fn tell(what: &str, why: &str) {
    say(&format!(
        "arborcam: note: {what} changes nothing here: {why}"
    ));
}

/// Of settings that are laid over a capture's `own`.
pub fn settings(file: &Path, own: &Config, new: &Config) {
    let [own, new] = [own, new].map(|config| to_value(config).unwrap_or(Value::Null));
    let idle: Vec<String> = OF_THE_FILM
        .iter()
        .filter(|section| own[section] != new[section])
        .map(|s| format!("[{s}]"))
        .collect();
    if !idle.is_empty() {
        let what = format!("{} in {}", idle.join(", "), file.display());
        tell(&what, "it is of filming; give it to `capture` or `replay`");
    }
}

//! What is known of a film besides its frames.

use super::{LocalTime, UserNotes};

/// When a film was made, and what its user noted on it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// When the first frame was filmed, where that is known: by the clock for a camera, by what it
    /// says itself for a file. Never the time of a replay.
    pub captured_at: Option<LocalTime>,
    /// What the user noted.
    pub notes: UserNotes,
}

impl Origin {
    /// Both as lines for people: `captured at: 2026-05-03T14:07:12.250+02:00`, `site: meadow`.
    pub fn lines(&self) -> Vec<String> {
        let captured_at = self.captured_at.map(|at| format!("captured at: {at}"));
        let notes = self.notes.iter();
        let notes = notes.map(|(key, value)| format!("{key}: {value}"));
        captured_at.into_iter().chain(notes).collect()
    }
}

//! What the user notes on a film: species, site, wind and the like, in fields of his own.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::str::FromStr;

/// Notes on one film; more belong into a file of their own.
const MOST_NOTES: usize = 32;
/// Characters of a key, which becomes a column, a name in JSON, a term on a page.
const LONGEST_KEY: usize = 32;
/// Characters of a value: some sentences.
const LONGEST_VALUE: usize = 300;

/// One note, `KEY=VALUE` on the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UserNote {
    key: String,
    value: String,
}

/// Notes by their keys, which are plain.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "BTreeMap<String, String>")]
#[serde(try_from = "BTreeMap<String, String>")]
pub struct UserNotes(BTreeMap<String, String>);

/// Why a note is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoteError {
    /// There is no `=` in it.
    #[error("give KEY=VALUE, e.g. species=Quercus")]
    NoValue,
    #[error(
        "{key:?} is no key: give 1 to {LONGEST_KEY} letters a to z, digits, _ or -, a letter first"
    )]
    BadKey { key: String },
    #[error("the value of {key} is empty; leave the note out")]
    Empty { key: String },
    #[error("the value of {key} is longer than {LONGEST_VALUE} characters; shorten it")]
    TooLong { key: String },
    #[error("the value of {key} has a line break or another control character; give plain text")]
    NotPlain { key: String },
    #[error("there are more than {MOST_NOTES} notes; give fewer")]
    TooMany,
    #[error("the note {key} is given twice; give it once")]
    Twice { key: String },
}

impl UserNote {
    /// Checks a note.
    ///
    /// # Errors
    /// The key is not plain, or the value is empty, too long or no plain text.
    pub fn new(key: &str, value: &str) -> Result<Self, NoteError> {
        let (key, value) = (key.trim().to_owned(), value.trim().to_owned());
        if !is_plain(&key) {
            return Err(NoteError::BadKey { key });
        }
        if value.is_empty() {
            return Err(NoteError::Empty { key });
        }
        if value.chars().count() > LONGEST_VALUE {
            return Err(NoteError::TooLong { key });
        }
        if value.chars().any(char::is_control) {
            return Err(NoteError::NotPlain { key });
        }
        Ok(Self { key, value })
    }
}

impl FromStr for UserNote {
    type Err = NoteError;

    /// Reads `KEY=VALUE`.
    fn from_str(text: &str) -> Result<Self, NoteError> {
        let (key, value) = text.split_once('=').ok_or(NoteError::NoValue)?;
        Self::new(key, value)
    }
}

fn is_plain(key: &str) -> bool {
    let first = key.chars().next();
    first.is_some_and(|c| c.is_ascii_alphabetic())
        && key.len() <= LONGEST_KEY
        && key
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-'))
}

impl UserNotes {
    /// The notes of a command line.
    ///
    /// # Errors
    /// A key is given twice, or there are too many.
    pub fn of(notes: &[UserNote]) -> Result<Self, NoteError> {
        let mut all = Self::default();
        for note in notes {
            if all.0.contains_key(&note.key) {
                let key = note.key.clone();
                return Err(NoteError::Twice { key });
            }
            all.put(note.clone())?;
        }
        Ok(all)
    }

    /// Adds a note, in the place of one with the same key.
    ///
    /// # Errors
    /// There are too many.
    pub fn put(&mut self, note: UserNote) -> Result<(), NoteError> {
        if self.0.len() == MOST_NOTES && !self.0.contains_key(&note.key) {
            return Err(NoteError::TooMany);
        }
        self.0.insert(note.key, note.value);
        Ok(())
    }

    /// These notes, with `others` added, which take the place of those with the same key.
    ///
    /// # Errors
    /// There are too many.
    pub fn with(mut self, others: Self) -> Result<Self, NoteError> {
        for (key, value) in others.0 {
            self.put(UserNote { key, value })?;
        }
        Ok(self)
    }

    /// Takes a note out; `false` where there is none of this key.
    pub fn remove(&mut self, key: &str) -> bool {
        self.0.remove(key).is_some()
    }

    /// Keys and values, by key.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &str)> {
        self.0.iter().map(|(key, value)| (&**key, &**value))
    }

    /// The value of a key.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.0.get(key).map(String::as_str)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl From<UserNotes> for BTreeMap<String, String> {
    fn from(notes: UserNotes) -> Self {
        notes.0
    }
}

impl TryFrom<BTreeMap<String, String>> for UserNotes {
    type Error = NoteError;

    fn try_from(entries: BTreeMap<String, String>) -> Result<Self, NoteError> {
        let mut notes = Self::default();
        for (key, value) in entries {
            notes.put(UserNote::new(&key, &value)?)?;
        }
        Ok(notes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_note_is_a_plain_key_and_a_line_of_text() {
        let note: UserNote = "site= north meadow = A ".parse().expect("a note");
        let notes = UserNotes::of(&[note]).expect("notes");
        assert_eq!(notes.get("site"), Some("north meadow = A"));
        let long = format!("a={}", "x".repeat(LONGEST_VALUE + 1));
        let long_key = format!("{}=x", "k".repeat(LONGEST_KEY + 1));
        for (text, expected) in [
            ("species", "give KEY=VALUE"),
            ("=Quercus", "is no key"),
            ("2nd=x", "is no key"),
            ("a b=x", "is no key"),
            ("größe=x", "is no key"),
            (&long_key, "is no key"),
            ("species= ", "is empty"),
            (&long, "longer than 300"),
            ("a=x\ny", "control character"),
        ] {
            let error = text.parse::<UserNote>().expect_err(text).to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    #[test]
    fn notes_are_bounded_and_later_ones_win() {
        let note = |text: &str| text.parse::<UserNote>().expect("a note");
        let twice = UserNotes::of(&[note("a=1"), note("a=2")]);
        assert_eq!(twice, Err(NoteError::Twice { key: "a".into() }));
        let many: Vec<UserNote> = (0..=MOST_NOTES).map(|k| note(&format!("k{k}=1"))).collect();
        assert_eq!(UserNotes::of(&many), Err(NoteError::TooMany));
        let old = UserNotes::of(&[note("a=1"), note("b=2")]).expect("notes");
        let new = UserNotes::of(&[note("b=3"), note("c=4")]).expect("notes");
        let both = old.with(new).expect("notes");
        let all: Vec<_> = both.iter().collect();
        assert_eq!(all, [("a", "1"), ("b", "3"), ("c", "4")]);
    }
}

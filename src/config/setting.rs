//! What is declared of a setting: key, text, range or choices, and when a change of it counts.

/// A section of the configuration file: the settings of one stage.
#[derive(Debug)]
pub struct Section {
    /// Its name in the file, without brackets.
    pub name: &'static str,
    pub(super) text: &'static [&'static str],
    /// Its settings, in the order of the file.
    pub settings: &'static [Setting],
}

impl Section {
    /// What it is about.
    pub fn text(&self) -> String {
        joined(self.text)
    }
}

/// One setting.
#[derive(Debug)]
pub struct Setting {
    /// `section.name`.
    pub key: &'static str,
    pub name: &'static str,
    pub(super) text: &'static [&'static str],
    /// The numbers that are allowed; `None` if it is no number, or every number will do.
    pub range: Option<Range>,
    /// When a change counts for a capture that is running.
    pub effect: Effect,
}

impl Setting {
    /// What it is, with its unit, and when to change it.
    pub fn text(&self) -> String {
        joined(self.text)
    }
}

/// The lines of a documentation comment as one paragraph.
fn joined(lines: &[&str]) -> String {
    let lines: Vec<&str> = lines.iter().map(|line| line.trim()).collect();
    lines.join(" ")
}

/// An interval of numbers, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    pub low: f64,
    pub high: f64,
    /// As the user reads it, e.g. `0 (never) to 3600`.
    pub words: &'static str,
}

impl Range {
    /// Whether `value` lies within; never for what is no number.
    pub fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

/// When a changed setting counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// At once; no frame and no measurement is lost.
    Now,
    /// At the next start, for the reason given.
    NextStart(&'static str),
}

/// One of the values of a setting that is chosen from a list.
#[derive(Debug)]
pub struct Choice {
    /// As it is written in a file, without quotes.
    pub value: &'static str,
    pub(super) meaning: &'static str,
}

impl Choice {
    /// What it means; empty where the value says it.
    pub fn meaning(&self) -> &'static str {
        self.meaning.trim()
    }
}

/// A type that a setting may have.
pub(super) trait SettingValue {
    /// The number that its range is for; `None` if it is no number.
    fn number(&self) -> Option<f64>;
    /// As it is written in a TOML file.
    fn as_toml(&self) -> String;
    /// The list that it is chosen from; empty if there is none.
    fn choices(&self) -> &'static [Choice] {
        &[]
    }
}

impl SettingValue for u32 {
    fn number(&self) -> Option<f64> {
        Some(f64::from(*self))
    }

    fn as_toml(&self) -> String {
        self.to_string()
    }
}

impl SettingValue for f64 {
    fn number(&self) -> Option<f64> {
        Some(*self)
    }

    fn as_toml(&self) -> String {
        format!("{self:?}")
    }
}

impl SettingValue for bool {
    fn number(&self) -> Option<f64> {
        None
    }

    fn as_toml(&self) -> String {
        self.to_string()
    }
}

impl SettingValue for String {
    fn number(&self) -> Option<f64> {
        None
    }

    fn as_toml(&self) -> String {
        format!("{self:?}")
    }
}

/// Points of a picture, or lines of them, px.
impl<T: std::fmt::Debug> SettingValue for Vec<T> {
    fn number(&self) -> Option<f64> {
        None
    }

    fn as_toml(&self) -> String {
        format!("{self:?}")
    }
}

//! Settings that are read again while a capture is running: what it takes over, and what not.

use super::setting::Effect::{self, NextStart, Now};
use super::settings::{Config, SECTIONS};

/// When a change of `key`, e.g. `camera.timeout_s`, counts; `None` if there is no such setting.
pub fn effect(key: &str) -> Option<Effect> {
    SECTIONS
        .iter()
        .flat_map(|section| section.settings)
        .find(|setting| setting.key == key)
        .map(|setting| setting.effect)
}

/// A setting that is not what it was.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// `section.key`.
    pub key: String,
    pub from: String,
    pub to: String,
    pub effect: Effect,
}

impl std::fmt::Display for Change {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            key,
            from,
            to,
            effect,
        } = self;
        match effect {
            Now => write!(f, "{key} is now {to} (was {from})"),
            NextStart(why) => write!(
                f,
                "{key} stays {from}; {to} counts from the next start: {why}"
            ),
        }
    }
}

impl Config {
    /// What a running capture with these settings makes of `wanted`: the settings from now on, and
    /// every difference.
    pub fn reload(&self, wanted: &Config) -> (Config, Vec<Change>) {
        let (Ok(mut next), Ok(wanted)) = (serde_json::to_value(self), serde_json::to_value(wanted))
        else {
            return (self.clone(), Vec::new());
        };
        let mut changes = Vec::new();
        for section in SECTIONS {
            for setting in section.settings {
                let to = &wanted[section.name][setting.name];
                let value = &mut next[section.name][setting.name];
                if value == to {
                    continue;
                }
                changes.push(Change {
                    key: setting.key.to_owned(),
                    from: value.to_string(),
                    to: to.to_string(),
                    effect: setting.effect,
                });
                if setting.effect == Now {
                    *value = to.clone();
                }
            }
        }
        changes.sort_by(|a, b| a.key.cmp(&b.key));
        let next = serde_json::from_value(next).unwrap_or_else(|_| self.clone());
        (next, changes)
    }
}

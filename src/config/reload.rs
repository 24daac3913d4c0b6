//! Which settings a running capture can take over, and why the others cannot.

use super::Config;
use serde_json::Value;

/// When a changed setting counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// At once; no frame and nothing that was seen is lost.
    Now,
    /// At the next start, for the reason given.
    NextStart(&'static str),
}
use Effect::{NextStart, Now};

const CAMERA: Effect = NextStart("the camera would have to be stopped, and frames be lost");
const POINTS: Effect = NextStart("the points that are followed would have to be given up");
const TREE: Effect = NextStart("the tree would have to be built anew");
const POSES: Effect = NextStart("the poses before and after would not fit together");

/// Every setting, by its key or by its section; a key goes before its section, so that a new key in
/// a section is not taken over before somebody has seen to it that it can be.
pub const EFFECTS: &[(&str, Effect)] = &[
    ("camera", CAMERA),
    ("camera.timeout_s", Now),
    ("camera.retry_delay_s", Now),
    ("camera.reconnect", Now),
    (
        "outline",
        NextStart("the outline is looked for once, at the start"),
    ),
    ("detect", POINTS),
    ("track", POINTS),
    ("accumulate", TREE),
    ("hierarchy", TREE),
    ("skeleton", TREE),
    ("shape", TREE),
    (
        "wood",
        NextStart("the branches' thickness comes from it, and is in the tree already"),
    ),
    (
        "leaves",
        NextStart("the tree would have to be dressed anew"),
    ),
    ("motion", POSES),
    (
        "dynamics",
        NextStart("one capture has one rule by which a sway counts as known"),
    ),
    // Nothing that is captured depends on it.
    ("wind", Now),
    (
        "export.animation_s",
        NextStart("older poses have been let go already"),
    ),
    (
        "export.metres_per_px",
        NextStart("one capture has one scale"),
    ),
];

/// When a change of `key`, e.g. `camera.timeout_s`, counts; `None` where nothing is said of it.
pub fn effect(key: &str) -> Option<Effect> {
    let of = |name: &str| {
        EFFECTS
            .iter()
            .find(|(n, _)| *n == name)
            .map(|(_, effect)| *effect)
    };
    of(key).or_else(|| of(key.split_once('.')?.0))
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
        let mut merged = self.clone();
        let (Ok(Value::Object(mut next)), Ok(Value::Object(new))) =
            (serde_json::to_value(self), serde_json::to_value(wanted))
        else {
            return (merged, Vec::new());
        };
        let mut changes = Vec::new();
        for (section, settings) in &mut next {
            let Some(settings) = settings.as_object_mut() else {
                continue;
            };
            for (name, value) in settings {
                let Some(to) = new
                    .get(section)
                    .and_then(|s| s.get(name))
                    .filter(|to| *to != value)
                else {
                    continue;
                };
                let key = format!("{section}.{name}");
                let effect = effect(&key).unwrap_or(NextStart("nothing is known of it"));
                changes.push(Change {
                    key,
                    from: value.to_string(),
                    to: to.to_string(),
                    effect,
                });
                if effect == Now {
                    *value = to.clone();
                }
            }
        }
        if let Ok(config) = serde_json::from_value(Value::Object(next)) {
            merged = config;
        }
        (merged, changes)
    }
}

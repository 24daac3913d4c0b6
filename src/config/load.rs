//! Settings from a file and the command line, and the check that they are within their ranges.

use super::setting::Setting;
use super::settings::{Config, SECTIONS};
use std::ops::Range;
use std::path::Path;

/// Why a configuration was not taken; the text names file, line and key.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    #[error("cannot read configuration {path}: {source}; check the name")]
    Unreadable {
        path: String,
        source: std::io::Error,
    },
    #[error("configuration {path}, line {line}: {what}")]
    BadEntry {
        path: String,
        line: usize,
        what: String,
    },
    #[error("configuration: {key} = {value} is out of range; allowed: {allowed}")]
    OutOfRange {
        key: &'static str,
        value: f64,
        allowed: &'static str,
    },
    #[error("markers: {what}")]
    Markers { what: String },
    #[error("depth camera: {what}")]
    DepthCamera { what: String },
}

impl ConfigError {
    /// What the TOML reader says, in one line.
    fn bad_entry(path: &str, line: usize, e: &toml::de::Error) -> Self {
        Self::BadEntry {
            path: path.to_owned(),
            line,
            what: e.message().replace('\n', " "),
        }
    }
}

impl Config {
    /// Reads a TOML file over the defaults.
    ///
    /// # Errors
    /// The file cannot be read, is no TOML, has an unknown key or a value of the wrong kind or out
    /// of range.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        Self::parse(&read(path)?, &path.display().to_string())
    }

    /// Takes the text of a TOML file over the defaults; `name` is for messages.
    ///
    /// # Errors
    /// As for [`Config::load`].
    pub fn parse(text: &str, name: &str) -> Result<Self, ConfigError> {
        let config: Config = toml::from_str(text).map_err(|e| {
            let at = e.span().map_or(0, |s| s.start);
            let line = text[..at.min(text.len())].matches('\n').count() + 1;
            ConfigError::bad_entry(name, line, &e)
        })?;
        config.check()?;
        Ok(config)
    }

    /// The settings of a command: what `file` says over these, what the command line says (`set`)
    /// over the file, and the whole checked. These are the defaults, or the settings of a capture.
    ///
    /// # Errors
    /// As for [`Config::load`]; also if `set` leaves a value out of range.
    pub fn layered(
        &self,
        file: Option<&Path>,
        set: impl FnOnce(&mut Self),
    ) -> Result<Self, ConfigError> {
        let mut config = match file {
            Some(path) => self.overlaid(path)?,
            None => self.clone(),
        };
        set(&mut config);
        config.check()?;
        Ok(config)
    }

    /// These settings, replaced by those that a TOML file names. The combination of both is not
    /// checked.
    fn overlaid(&self, path: &Path) -> Result<Self, ConfigError> {
        let name = path.display().to_string();
        let text = read(path)?;
        // First over the defaults: the error then names the line.
        Self::parse(&text, &name)?;
        let over: toml::Table =
            toml::from_str(&text).map_err(|e| ConfigError::bad_entry(&name, 1, &e))?;
        let mut all = toml::Table::try_from(self).map_err(|e| ConfigError::BadEntry {
            path: name.clone(),
            line: 1,
            what: e.to_string(),
        })?;
        for (section, keys) in over {
            match (all.get_mut(&section), keys) {
                (Some(toml::Value::Table(own)), toml::Value::Table(keys)) => own.extend(keys),
                (_, keys) => drop(all.insert(section, keys)),
            }
        }
        all.try_into()
            .map_err(|e| ConfigError::bad_entry(&name, 1, &e))
    }

    /// Refuses values with which a stage could not work.
    ///
    /// # Errors
    /// The first value that is out of its range.
    pub fn check(&self) -> Result<(), ConfigError> {
        let settings = SECTIONS.iter().flat_map(|section| section.settings);
        for (setting, value) in settings.zip(self.values()) {
            if let Some(number) = value.number() {
                check_range(setting, number)?;
            }
        }
        self.check_combinations()
    }

    /// What ranges of single values cannot express.
    fn check_combinations(&self) -> Result<(), ConfigError> {
        if self.accumulate.min_s > 0.9 * self.accumulate.window_s {
            // The memory would never span that time, and the tree never be built.
            return Err(ConfigError::OutOfRange {
                key: "accumulate.min_s",
                value: self.accumulate.min_s,
                allowed: "at most nine tenths of accumulate.window_s",
            });
        }
        if self.track.window_px.is_multiple_of(2) {
            return Err(ConfigError::OutOfRange {
                key: "track.window_px",
                value: self.track.window_px.into(),
                allowed: "an odd number",
            });
        }
        super::depth_camera::check(&self.depth.own_camera)?;
        super::check_distortion(&self.depth.distortion)
            .map_err(|what| ConfigError::DepthCamera { what })?;
        super::markers::check(&self.markers.windows, &self.markers.corrections)?;
        check_strokes(&self.skeleton.strokes_px)
    }
}

/// Points that a line along a branch has at least, and at most; and so many lines are taken.
pub const STROKE_POINTS: Range<usize> = 2..1001;
const MAX_STROKES: usize = 200;

/// Refuses lines along branches that do not lead from one place to another, and more than a user
/// can have drawn.
///
/// # Errors
/// One has fewer than two points or more than a thousand, or one that is not finite; or there are
/// more than 200.
pub fn check_strokes(strokes_px: &[Vec<[f64; 2]>]) -> Result<(), ConfigError> {
    if strokes_px.len() > MAX_STROKES {
        let lines = strokes_px.len() as f64;
        return Err(refused_strokes(lines, "at most 200 lines"));
    }
    for stroke in strokes_px {
        if !STROKE_POINTS.contains(&stroke.len()) {
            let points = stroke.len() as f64;
            return Err(refused_strokes(points, "2 to 1000 points in each line"));
        }
        if let Some(at) = stroke.iter().flatten().find(|at| !at.is_finite()) {
            return Err(refused_strokes(*at, "finite numbers"));
        }
    }
    Ok(())
}

fn refused_strokes(value: f64, allowed: &'static str) -> ConfigError {
    ConfigError::OutOfRange {
        key: "skeleton.strokes_px",
        value,
        allowed,
    }
}

fn check_range(setting: &Setting, value: f64) -> Result<(), ConfigError> {
    match setting.range {
        Some(range) if !range.contains(value) => Err(ConfigError::OutOfRange {
            key: setting.key,
            value,
            allowed: range.words,
        }),
        _ => Ok(()),
    }
}

fn read(path: &Path) -> Result<String, ConfigError> {
    std::fs::read_to_string(path).map_err(|source| ConfigError::Unreadable {
        path: path.display().to_string(),
        source,
    })
}

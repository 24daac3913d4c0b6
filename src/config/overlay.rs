//! A file over settings that are not the defaults: those of a capture.

use super::{Config, ConfigError};
use std::path::Path;

impl Config {
    /// These settings with what a TOML file says otherwise.
    ///
    /// # Errors
    /// As for [`Config::load`].
    pub fn overlaid(&self, path: &Path) -> Result<Self, ConfigError> {
        // By itself first: of a file that is not taken the line is told.
        Self::load(path)?;
        let shown = path.display().to_string();
        let bad = |what: String| ConfigError::BadEntry {
            path: shown.clone(),
            line: 1,
            what,
        };
        let text = std::fs::read_to_string(path).map_err(|source| ConfigError::Unreadable {
            path: shown.clone(),
            source,
        })?;
        let over: toml::Table =
            toml::from_str(&text).map_err(|e| bad(e.message().replace('\n', " ")))?;
        let mut all = toml::Table::try_from(self).map_err(|e| bad(e.to_string()))?;
        for (section, keys) in over {
            match (all.get_mut(&section), keys) {
                (Some(toml::Value::Table(own)), toml::Value::Table(keys)) => own.extend(keys),
                (_, keys) => drop(all.insert(section, keys)),
            }
        }
        let config: Self = all
            .try_into()
            .map_err(|e: toml::de::Error| bad(e.message().replace('\n', " ")))?;
        config.check()?;
        Ok(config)
    }
}

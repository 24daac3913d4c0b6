//! Arguments that several commands have.

use super::camera::CameraArgs;
use super::scale::ScaleArgs;
use super::shape::ShapeArgs;
use crate::config::{Config, ConfigError};
use crate::outline::OutlineSpec;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// What `capture` and `replay` share.
#[derive(Debug, Args)]
pub struct Common {
    /// Where the tree is: a JSON polygon, a mask image (white = tree), a scribble image (white =
    /// tree, black = background, rest grey or transparent), or `auto` to find it by its motion.
    #[arg(long, value_name = "FILE|auto", default_value = "auto")]
    pub outline: OutlineSpec,
    /// Folder for the result; it must not exist, and appears when it is complete.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Run without the terminal UI.
    #[arg(long)]
    pub headless: bool,
    /// Print each pose on standard output, as a line of JSON; implies --headless.
    #[arg(long, value_name = "FORMAT")]
    pub stream: Option<Stream>,
    /// Settings that differ from the defaults (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// End by itself after so many seconds of film.
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub for_s: Option<f64>,
    #[command(flatten)]
    pub scale: ScaleArgs,
    #[command(flatten)]
    pub shape: ShapeArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Stream {
    Ndjson,
}

impl Common {
    /// The file over the defaults, and over both what the command line says; `camera` are the
    /// arguments of a command that films.
    pub fn config(&self, camera: Option<&CameraArgs>) -> Result<Config, ConfigError> {
        Config::default().layered(self.config.as_deref(), |config| {
            self.scale.set(config);
            self.shape.set(config);
            if let Some(camera) = camera {
                camera.set(&mut config.camera);
            }
        })
    }
}

/// A number of seconds above 0, as an argument.
pub fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text
        .parse()
        .ok()
        .filter(|s: &f64| s.is_finite() && *s > 0.0);
    seconds.ok_or_else(|| "give a number of seconds above 0".to_owned())
}

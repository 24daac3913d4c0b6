//! Arguments, and parsers of arguments, that several commands share.

use super::camera::CameraArgs;
use super::command_error::CommandError;
use super::depth::DepthArgs;
use super::markers::MarkerArgs;
use super::notes::NoteArgs;
use super::scale::ScaleArgs;
use super::shape::ShapeArgs;
use super::strokes::StrokeArgs;
use crate::config::{self, Config, ConfigError};
use crate::outline::OutlineSpec;
use anyhow::anyhow;
use clap::{Args, ValueEnum};
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::str::FromStr;

/// Arguments of `capture` and `replay`.
#[derive(Debug, Args)]
pub struct Common {
    /// Region of the tree in the picture: a JSON polygon, a mask image (white = tree), a scribble
    /// image (white = tree, black = background, rest grey or transparent), or `auto` to find it by
    /// its motion.
    #[arg(long, value_name = "FILE|auto", default_value = "auto")]
    pub outline: OutlineSpec,
    /// Folder for the result. It must not exist, and appears when it is complete.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Run without the screen in the terminal.
    #[arg(long)]
    pub headless: bool,
    /// Print each pose to standard output as a line of JSON. Implies --headless.
    #[arg(long, value_name = "FORMAT")]
    pub stream: Option<Stream>,
    /// Settings that differ from the defaults (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// End after this length of film, s.
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub for_s: Option<f64>,
    #[command(flatten)]
    pub scale: ScaleArgs,
    #[command(flatten)]
    pub shape: ShapeArgs,
    #[command(flatten)]
    pub strokes: StrokeArgs,
    #[command(flatten)]
    pub markers: MarkerArgs,
    #[command(flatten)]
    pub depth: DepthArgs,
    #[command(flatten)]
    pub notes: NoteArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Stream {
    Ndjson,
}

impl Common {
    /// The settings: command line over configuration file over defaults. `camera` are the arguments
    /// of a command that films.
    ///
    /// # Errors
    /// The configuration file cannot be read, or a setting is out of range.
    pub fn config(&self, camera: Option<&CameraArgs>) -> Result<Config, ConfigError> {
        Config::default().layered(self.config.as_deref(), |config| {
            self.scale.set(config);
            self.shape.set(config);
            self.strokes.set(config);
            self.markers.set(config);
            self.depth.set(&mut config.depth);
            if let Some(camera) = camera {
                camera.set(config);
            }
        })
    }
}

/// Parses a duration above 0, s.
pub fn seconds(text: &str) -> Result<f64, String> {
    parse_within(
        text,
        f64::MIN_POSITIVE..=f64::MAX,
        "give a number of seconds above 0",
    )
}

/// Parses a moment of a film, s from its begin.
pub fn moment(text: &str) -> Result<f64, String> {
    parse_within(text, 0.0..=f64::MAX, "give a number of seconds, 0 or more")
}

/// Parses a number in `range`; `hint` is the message for anything else.
pub fn parse_within(text: &str, range: RangeInclusive<f64>, hint: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if range.contains(&number) => Ok(number),
        _ => Err(hint.to_owned()),
    }
}

/// A parser of the setting `key`, for an option that gives it: its message on what is out of range names
/// the option, and not the setting.
pub fn setting(key: &'static str) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| within_setting(text, key, "number")
}

/// The same for a setting that is a whole number.
pub fn whole_setting(key: &'static str) -> impl Fn(&str) -> Result<u32, String> + Clone {
    move |text| within_setting(text, key, "whole number")
}

fn within_setting<T>(text: &str, key: &str, kind: &str) -> Result<T, String>
where
    T: FromStr + Into<f64> + Copy,
{
    let range = config::range(key);
    let allowed = range.map_or(String::new(), |range| format!(": {}", range.words));
    match text.parse::<T>() {
        Ok(number) if range.is_none_or(|range| range.contains(number.into())) => Ok(number),
        _ => Err(format!("give a {kind}{allowed}")),
    }
}

/// Checks the rate of a folder of pictures, frames per second.
///
/// # Errors
/// It is not above 0.
pub fn check_fps(fps: f64) -> Result<(), CommandError> {
    if fps.is_finite() && fps > 0.0 {
        return Ok(());
    }
    Err(CommandError::BadUsage(anyhow!(
        "--fps {fps} is no rate; give a number above 0"
    )))
}

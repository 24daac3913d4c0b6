//! Options of `arborcam animate`.

use super::super::common::{parse_within, seconds, setting};
use super::super::render::{ViewName, WHITE, background, rate, size};
use super::super::scale::HeightArgs;
use super::super::tree::TreeArgs;
use crate::bounds::Bounds;
use crate::config::Config;
use crate::model::Size;
use crate::views::Shot;
use clap::Args;
use std::path::{Path, PathBuf};

/// Longest animation, s.
const MAX_LENGTH_S: f64 = 600.0;
/// Largest number of poses, which are kept in memory.
const MAX_POSES: f64 = 20_000.0;

#[derive(Debug, Args)]
pub struct AnimateArgs {
    /// A capture: the folder written by `capture` or `replay --out`; or a forest, whose trees sway in
    /// the same wind.
    pub dir: PathBuf,
    /// Length of the animation, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = seconds)]
    pub seconds: f64,
    /// File to write, by its suffix: a model (.glb, .gltf), a page (.html), the motion as a table
    /// (.csv), a video (.mp4), or a picture of the last pose (.png). It must not exist. Without it
    /// the tree is shown on the terminal, with keys for the wind.
    #[arg(long, value_name = "PATH")]
    pub out: Option<PathBuf>,
    /// Poses per second, 1 to 120.
    #[arg(long, value_name = "RATE", default_value_t = 30.0, value_parser = rate)]
    pub fps: f64,
    /// Strength of the wind on the Beaufort scale, 0 (still) to 12.
    #[arg(long, value_name = "FORCE", value_parser = setting("wind.force"))]
    pub wind: Option<f64>,
    /// Direction that the wind blows to or --pull pulls to, degrees about the trunk: 0 to the right
    /// of the picture, 90 away from the camera.
    #[arg(long, value_name = "DEGREES", value_parser = setting("wind.direction_deg"))]
    pub direction: Option<f64>,
    /// Variation of the wind speed relative to its mean, 0 (steady) to 1.
    #[arg(long, value_name = "SHARE", value_parser = setting("wind.gusts"))]
    pub gusts: Option<f64>,
    /// Exponent of the gust spectrum, 0 (rough) to 4 (smooth): power is proportional to frequency
    /// to the minus beta.
    #[arg(long, value_name = "BETA", value_parser = setting("wind.beta"))]
    pub beta: Option<f64>,
    /// Make the animation a seamless loop.
    #[arg(long = "loop")]
    pub looped: bool,
    /// A sound (.wav) that controls the wind speed by its loudness; --wind is the mean force.
    #[arg(long, value_name = "FILE")]
    pub wav: Option<PathBuf>,
    /// Pull the tree aside until it leans by this angle, degrees, and release it; in still air
    /// unless --wind is given.
    #[arg(long, value_name = "DEGREES", value_parser = lean_deg, conflicts_with_all = ["looped", "wav"])]
    pub pull: Option<f64>,
    /// The node of nodes.csv at which the tree is pulled; default: the thickest node well above the
    /// ground.
    #[arg(long, value_name = "NODE", requires = "pull")]
    pub pull_node: Option<u32>,
    /// Time of the release, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.5, requires = "pull", value_parser = release_s)]
    pub release: f64,
    /// Magnify the filmed motion by this factor, instead of wind; 0: no motion, 1: as filmed.
    #[arg(
        long,
        value_name = "TIMES",
        value_parser = factor,
        conflicts_with_all = ["wind", "gusts", "beta", "wav", "pull", "direction"]
    )]
    pub magnify: Option<f64>,
    /// Speed of the filmed motion, 0.01 to 100; at 0.5 it takes twice as long.
    #[arg(long, value_name = "TIMES", value_parser = speed, default_value_t = 1.0, requires = "magnify")]
    pub speed: f64,
    /// Magnify only motion between these frequencies, Hz.
    #[arg(long, value_name = "LO..HI", value_parser = band, requires = "magnify")]
    pub band: Option<Bounds>,
    /// Direction of view of a picture or video.
    #[arg(long, value_name = "VIEW", default_value = "front")]
    pub view: ViewName,
    /// Size of a picture or video, px.
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<Size>,
    /// Background of a picture or video.
    #[arg(long, value_name = "transparent|white|#RRGGBB", value_parser = background)]
    pub background: Option<[u8; 4]>,
    /// Draw no leaves in a picture or video.
    #[arg(long)]
    pub bare: bool,
    #[command(flatten)]
    pub height: HeightArgs,
    #[command(flatten)]
    pub tree: TreeArgs,
}

/// Kind of the file to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Glb,
    Gltf,
    Html,
    Csv,
    Video,
    Picture,
}

impl AnimateArgs {
    /// Checks combinations of options, which clap cannot; returns the kind of file to write.
    ///
    /// # Errors
    /// A message for the user: options that exclude each other or are out of range, or an unknown
    /// suffix.
    pub fn check(&self, out: &Path) -> Result<Kind, String> {
        let ending = out
            .extension()
            .map(|e| e.to_string_lossy().to_lowercase())
            .unwrap_or_default();
        let kind = match ending.as_str() {
            "glb" => Kind::Glb,
            "gltf" => Kind::Gltf,
            "html" => Kind::Html,
            "csv" => Kind::Csv,
            "mp4" => Kind::Video,
            "png" => Kind::Picture,
            _ => {
                return Err(format!(
                    "--out {} does not end in .glb, .gltf, .html, .csv, .mp4 or .png; name it so",
                    out.display()
                ));
            }
        };
        if self.seconds > MAX_LENGTH_S {
            return Err(format!("--seconds is more than {MAX_LENGTH_S}; give less"));
        }
        if self.seconds * self.fps > MAX_POSES {
            return Err(format!(
                "--seconds times --fps is more than {MAX_POSES}; give less of one"
            ));
        }
        if kind == Kind::Video && self.background.is_some_and(|b| b[3] == 0) {
            return Err(
                "a video cannot be transparent; give --background white or a colour".into(),
            );
        }
        Ok(kind)
    }

    /// Applies the options on the wind. With `--pull` and without `--wind` the air is still.
    pub fn set(&self, config: &mut Config) {
        let wind = &mut config.wind;
        let still = self.pull.map(|_| 0.0);
        wind.force = self.wind.or(still).unwrap_or(wind.force);
        wind.direction_deg = self.direction.unwrap_or(wind.direction_deg);
        wind.gusts = self.gusts.unwrap_or(wind.gusts);
        wind.beta = self.beta.unwrap_or(wind.beta);
    }

    /// How a video is drawn.
    pub fn shot(&self) -> Shot {
        Shot {
            view: self.view.view(),
            turntable: self.view == ViewName::Turntable,
            as_filmed: false,
            size: self.size,
            background: self.background.unwrap_or(WHITE),
            film: None,
            bare: self.bare,
            at_s: None,
            at_rest: false,
            length_s: Some(self.length_s()),
            fps: self.fps,
        }
    }

    /// Time of the last pose, s.
    pub fn length_s(&self) -> f64 {
        self.count() as f64 / self.fps
    }

    /// Number of poses after the first; at least one.
    pub fn count(&self) -> u64 {
        ((self.seconds * self.fps).round() as u64).max(1)
    }
}

/// Parses `--pull`, degrees.
fn lean_deg(text: &str) -> Result<f64, String> {
    parse_within(text, 0.1..=60.0, "give degrees from 0.1 to 60")
}

/// Parses `--magnify`.
fn factor(text: &str) -> Result<f64, String> {
    parse_within(text, 0.0..=100.0, "give a number from 0 to 100")
}

/// Parses `--speed`.
fn speed(text: &str) -> Result<f64, String> {
    parse_within(text, 0.01..=100.0, "give a number from 0.01 to 100")
}

/// Parses `--release`, s.
fn release_s(text: &str) -> Result<f64, String> {
    parse_within(
        text,
        0.0..=MAX_LENGTH_S,
        "give a number of seconds from 0 to 600",
    )
}

/// Parses `--band`, Hz.
fn band(text: &str) -> Result<Bounds, String> {
    let parsed = text
        .split_once("..")
        .and_then(|(low, high)| Some(Bounds::new(frequency_hz(low)?, frequency_hz(high)?)));
    parsed
        .filter(|band_hz| !band_hz.is_empty())
        .ok_or_else(|| "give two frequencies in Hz, as 0.5..2".to_owned())
}

fn frequency_hz(text: &str) -> Option<f64> {
    let parsed: Option<f64> = text.trim().parse().ok();
    parsed.filter(|hz| (0.0..=1000.0).contains(hz))
}

//! What `arborcam animate` is asked for.

use super::super::common::seconds;
use super::super::render::{ViewName, WHITE, background, rate, size};
use super::super::tree::TreeArgs;
use crate::config::{Config, ConfigError};
use crate::model::Size;
use crate::views::Shot;
use clap::Args;
use std::path::{Path, PathBuf};

/// Longest animation, s, and most poses: they are kept in memory.
const LONGEST_S: f64 = 600.0;
const MOST_POSES: f64 = 20_000.0;

#[derive(Debug, Args)]
pub struct AnimateArgs {
    /// A capture: a folder that `--out` of capture or replay has made.
    pub dir: PathBuf,
    /// Length of the animation, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = seconds)]
    pub seconds: f64,
    /// What to write, by its ending: a model (.glb, .gltf), a page (.html), the motion as a table
    /// (.csv), a video (.mp4), or a picture of the end (.png). It must not exist. Without it the
    /// tree moves on the terminal, with keys for the wind.
    #[arg(long, value_name = "PATH")]
    pub out: Option<PathBuf>,
    /// Poses a second, 1 to 120.
    #[arg(long, value_name = "RATE", default_value_t = 30.0, value_parser = rate)]
    pub fps: f64,
    /// Strength of the wind on the Beaufort scale, 0 (still) to 12.
    #[arg(long, value_name = "FORCE", allow_negative_numbers = true)]
    pub wind: Option<f64>,
    /// Where it blows to, or where --pull pulls to: degrees about the trunk, 0 to the right of the
    /// picture, 90 away from the camera.
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    pub direction: Option<f64>,
    /// How much its speed varies, as a share of the mean, 0 (steady) to 1.
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub gusts: Option<f64>,
    /// Power of gusts falls with their frequency to the minus beta, 0 (wild) to 4 (smooth).
    #[arg(long, value_name = "BETA", allow_negative_numbers = true)]
    pub beta: Option<f64>,
    /// Ends as it begins, without a seam.
    #[arg(long = "loop")]
    pub looped: bool,
    /// A sound (.wav) that drives the wind: it blows as loud as the sound is, with --wind on
    /// average.
    #[arg(long, value_name = "FILE")]
    pub wav: Option<PathBuf>,
    /// Pulls the tree aside until it leans by so many degrees, and lets it go; without --wind in
    /// still air.
    #[arg(long, value_name = "DEGREES", value_parser = lean, conflicts_with_all = ["looped", "wav"])]
    pub pull: Option<f64>,
    /// The node of nodes.csv that is pulled at; if not given the thickest of those well above the
    /// ground.
    #[arg(long, value_name = "NODE", requires = "pull")]
    pub pull_node: Option<u32>,
    /// When it is released, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.5, requires = "pull", value_parser = moment)]
    pub release: f64,
    /// The captured motion instead of wind, so many times as large; 0 holds the tree still, 1 is as
    /// filmed.
    #[arg(
        long,
        value_name = "TIMES",
        value_parser = times,
        conflicts_with_all = ["wind", "gusts", "beta", "wav", "pull", "direction"]
    )]
    pub magnify: Option<f64>,
    /// The captured motion at another speed, 0.01 to 100; 0.5 takes twice as long.
    #[arg(long, value_name = "TIMES", value_parser = speed, default_value_t = 1.0, requires = "magnify")]
    pub speed: f64,
    /// Magnifies only what is between these frequencies of the film, Hz.
    #[arg(long, value_name = "LO..HI", value_parser = band, requires = "magnify")]
    pub band: Option<[f64; 2]>,
    /// Where a picture or video is seen from.
    #[arg(long, value_name = "VIEW", default_value = "front")]
    pub view: ViewName,
    /// Size of a picture or video, px.
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<Size>,
    /// What is behind the tree in a picture or video.
    #[arg(long, value_name = "transparent|white|#RRGGBB", value_parser = background)]
    pub background: Option<[u8; 4]>,
    /// Draws no leaves in a picture or video.
    #[arg(long)]
    pub bare: bool,
    #[command(flatten)]
    pub tree: TreeArgs,
}

/// What kind of file is asked for.
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
    /// Checks what clap cannot.
    ///
    /// # Errors
    /// What does not go together or is out of range, for the user to read.
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
        if self.seconds > LONGEST_S {
            return Err(format!("--seconds is more than {LONGEST_S}; give less"));
        }
        if self.seconds * self.fps > MOST_POSES {
            return Err(format!(
                "--seconds times --fps is more than {MOST_POSES}; give less of one"
            ));
        }
        if kind == Kind::Video && self.background.is_some_and(|b| b[3] == 0) {
            return Err(
                "a video cannot be transparent; give --background white or a colour".into(),
            );
        }
        Ok(kind)
    }

    /// The wind that is asked for in place of the configuration's.
    ///
    /// # Errors
    /// It is out of range.
    pub fn set(&self, config: &mut Config) -> Result<(), ConfigError> {
        let wind = &mut config.wind;
        let still = self.pull.map(|_| 0.0);
        wind.force = self.wind.or(still).unwrap_or(wind.force);
        wind.direction_deg = self.direction.unwrap_or(wind.direction_deg);
        wind.gusts = self.gusts.unwrap_or(wind.gusts);
        wind.beta = self.beta.unwrap_or(wind.beta);
        config.check()
    }

    /// How a video of it is drawn.
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

fn within(text: &str, low: f64, high: f64, else_: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|x: &f64| (low..=high).contains(x))
        .ok_or_else(|| else_.to_owned())
}

fn lean(text: &str) -> Result<f64, String> {
    within(text, 0.1, 60.0, "give degrees from 0.1 to 60")
}

fn times(text: &str) -> Result<f64, String> {
    within(text, 0.0, 100.0, "give a number from 0 to 100")
}

fn speed(text: &str) -> Result<f64, String> {
    within(text, 0.01, 100.0, "give a number from 0.01 to 100")
}

fn moment(text: &str) -> Result<f64, String> {
    within(
        text,
        0.0,
        LONGEST_S,
        "give a number of seconds from 0 to 600",
    )
}

fn band(text: &str) -> Result<[f64; 2], String> {
    let parsed = text
        .split_once("..")
        .and_then(|(low, high)| Some([frequency_hz(low)?, frequency_hz(high)?]));
    parsed
        .filter(|[low, high]| low < high)
        .ok_or_else(|| "give two frequencies in Hz, as 0.5..2".to_owned())
}

fn frequency_hz(text: &str) -> Option<f64> {
    let parsed: Option<f64> = text.trim().parse().ok();
    parsed.filter(|hz| (0.0..=1000.0).contains(hz))
}

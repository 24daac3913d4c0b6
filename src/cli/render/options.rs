//! Options of `arborcam render`.

use super::super::common::{moment, parse_within, seconds};
use super::super::tree::TreeArgs;
use crate::draw::View;
use crate::model::Size;
use crate::views::{FilmPlace, Shot};
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use std::f64::consts::PI;
use std::path::PathBuf;

/// Default background.
pub const WHITE: [u8; 4] = [255; 4];

/// Largest side of a picture, px.
const MAX_SIDE_PX: u32 = 4096;

#[derive(Debug, Args)]
pub struct RenderArgs {
    /// A capture: the folder written by `capture` or `replay --out`; or a forest made by `grow`.
    pub dir: PathBuf,
    /// Direction of view; `turntable` goes once round the tree.
    #[arg(long, value_name = "VIEW", default_value = "front")]
    pub view: ViewName,
    /// Rotates the view to the right about the trunk, degrees.
    #[arg(
        long,
        value_name = "DEGREES",
        default_value_t = 0.0,
        value_parser = degrees
    )]
    pub turn: f64,
    /// The picture (.png) or the video (.mp4); it must not exist.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Moment of the film, s; a video begins there. By default a picture shows the tree at rest, or
    /// with --film as it was in that frame, and a video shows the end of the film.
    #[arg(long, value_name = "SECONDS", value_parser = moment, conflicts_with = "pose")]
    pub at: Option<f64>,
    /// `rest`: the tree at rest, also in a video.
    #[arg(long, value_name = "POSE")]
    pub pose: Option<PoseName>,
    /// Size of the picture, px; with `--film beside` that of each half.
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<Size>,
    /// Background of the tree.
    #[arg(long, value_name = "transparent|white|#RRGGBB", value_parser = background)]
    pub background: Option<[u8; 4]>,
    /// Show the filmed frame `behind` the tree, in the front view, or `beside` it, in any view.
    #[arg(long, value_name = "PLACE")]
    pub film: Option<FilmPlace>,
    /// Draw no leaves.
    #[arg(long)]
    pub bare: bool,
    /// Length of a video, s; default: that of the film, at most 10.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub seconds: Option<f64>,
    /// Frame rate of a video, frames per second, 1 to 120.
    #[arg(long, value_name = "RATE", default_value_t = 30.0, value_parser = rate)]
    pub fps: f64,
    #[command(flatten)]
    pub tree: TreeArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ViewName {
    /// As filmed.
    Front,
    /// From the right.
    Side,
    Back,
    /// From above.
    Top,
    /// Once round the tree, seen slightly from above.
    Turntable,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PoseName {
    Rest,
}

impl ValueEnum for FilmPlace {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Behind, Self::Beside]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(match self {
            Self::Behind => "behind",
            Self::Beside => "beside",
        }))
    }
}

/// Kind of the file to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Picture,
    Video,
}

impl RenderArgs {
    /// Checks combinations of options, which clap cannot; returns the kind of file to write.
    ///
    /// # Errors
    /// A message for the user: options that exclude each other, or an unknown suffix.
    pub fn check(&self) -> Result<Kind, String> {
        let suffix = self
            .out
            .extension()
            .map(|e| e.to_string_lossy().to_lowercase())
            .unwrap_or_default();
        let kind = match suffix.as_str() {
            "png" => Kind::Picture,
            "mp4" => Kind::Video,
            _ => {
                return Err(format!(
                    "--out {} does not end in .png or .mp4; name it so",
                    self.out.display()
                ));
            }
        };
        if kind == Kind::Video && self.background.is_some_and(|b| b[3] == 0) {
            return Err(
                "a video cannot be transparent; give --background white or a colour".into(),
            );
        }
        if kind == Kind::Picture && self.seconds.is_some() {
            return Err(
                "--seconds goes with a video; name one with --out FILE.mp4, or use --at".into(),
            );
        }
        if self.film == Some(FilmPlace::Behind)
            && (self.view != ViewName::Front || self.turn != 0.0)
        {
            return Err(
                "--film behind goes with the front view only, from where it was filmed; use \
                 --film beside"
                    .into(),
            );
        }
        if self.film == Some(FilmPlace::Behind)
            && (self.at.is_some() || self.pose.is_some() || kind == Kind::Video)
        {
            return Err(
                "--film behind lays the tree over the one frame that the capture holds, as it was \
                 in it; leave out --at and --pose, and make a picture, or use --film beside"
                    .into(),
            );
        }
        Ok(kind)
    }

    /// Checks that nothing is asked for that a forest does not have: its pictures are of its rest.
    ///
    /// # Errors
    /// A message for the user: the option.
    pub fn check_forest(&self) -> Result<(), String> {
        if self.film.is_some() || self.at.is_some() || self.tree.is_given() {
            return Err(
                "--film, --at and the options of the tree do not go with a forest; draw one of its \
                 trees, which are folders of their own"
                    .into(),
            );
        }
        Ok(())
    }

    /// What to draw.
    pub fn shot(&self) -> Shot {
        let from = self.view.view();
        Shot {
            view: View {
                turn: from.turn + self.turn.to_radians(),
                ..from
            },
            turntable: self.view == ViewName::Turntable,
            as_filmed: self.view == ViewName::Front && self.turn == 0.0,
            size: self.size,
            background: self.background.unwrap_or(WHITE),
            film: self.film,
            bare: self.bare,
            at_s: self.at,
            at_rest: self.pose.is_some(),
            length_s: self.seconds,
            fps: self.fps,
        }
    }
}

impl ViewName {
    /// The view, of the turntable its begin.
    pub fn view(self) -> View {
        match self {
            Self::Front => View::FRONT,
            Self::Side => View::SIDE,
            Self::Back => View {
                turn: PI,
                down: 0.0,
            },
            Self::Top => View::TOP,
            Self::Turntable => View {
                turn: 0.0,
                down: 0.2,
            },
        }
    }
}

/// Parses `WxH`, px.
pub fn size(text: &str) -> Result<Size, String> {
    let parsed = text
        .split_once(['x', 'X'])
        .and_then(|(w, h)| Some(Size::new(side(w)?, side(h)?)));
    parsed.ok_or_else(|| {
        format!("give width and height in pixels, as 640x480; each 1 to {MAX_SIDE_PX}")
    })
}

/// Parses a side of a picture, px.
fn side(text: &str) -> Option<u32> {
    text.parse().ok().filter(|n| (1..=MAX_SIDE_PX).contains(n))
}

/// An opaque colour from six hexadecimal digits.
fn colour(hex: &str) -> Option<[u8; 4]> {
    if hex.len() != 6 || !hex.bytes().all(|b| b.is_ascii_hexdigit()) {
        return None;
    }
    let [_, red, green, blue] = u32::from_str_radix(hex, 16).ok()?.to_be_bytes();
    Some([red, green, blue, 255])
}

/// Parses a background: sRGB and opacity.
pub fn background(text: &str) -> Result<[u8; 4], String> {
    match text {
        "transparent" => Ok([0; 4]),
        "white" => Ok(WHITE),
        _ => text
            .strip_prefix('#')
            .and_then(colour)
            .ok_or_else(|| "give transparent, white or #rrggbb".to_owned()),
    }
}

/// Parses an angle, degrees.
fn degrees(text: &str) -> Result<f64, String> {
    parse_within(text, -1e6..=1e6, "give degrees, -1000000 to 1000000")
}

/// Parses a frame rate, frames per second.
pub fn rate(text: &str) -> Result<f64, String> {
    parse_within(text, 1.0..=120.0, "give pictures a second, 1 to 120")
}

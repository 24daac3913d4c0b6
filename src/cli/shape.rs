//! What the user draws for the tree's shape: the trunk that it keeps, the space that it fills.

use super::ended::Ended;
use crate::config::{Config, EnvelopeKind, Leader};
use crate::model::Size;
use anyhow::anyhow;
use clap::Args;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// The options of `capture`, `replay` and of the commands that read a capture on the shape.
#[derive(Clone, Debug, Default, Args)]
pub struct ShapeArgs {
    /// Keeps one trunk up to the tip, as conifers have: the line that was drawn in FILE (JSON:
    /// width, height, polyline_px from either end), or `auto` for the straightest way up.
    #[arg(long, value_name = "FILE|auto", value_parser = Trunk::parse)]
    trunk: Option<Trunk>,
    /// What the branches fill: the outline turned about its axis (`revolution`), the hull of the
    /// branches seen, turned (`hull`), or for `export` and `render` the opaque part of an image:
    /// the tree is cut to it.
    #[arg(long, value_name = "revolution|hull|IMAGE", value_parser = Envelope::parse)]
    envelope: Option<Envelope>,
}

impl ShapeArgs {
    /// The command line over the settings.
    pub fn set(&self, config: &mut Config) {
        match &self.trunk {
            Some(Trunk::Auto) => config.shape.leader = Leader::Auto,
            Some(Trunk::Drawn(line)) => {
                (config.shape.leader, config.shape.leader_px) =
                    (Leader::Drawn, line.polyline_px.clone());
            }
            None => {}
        }
        if let Some(Envelope::Kind(kind)) = self.envelope {
            config.shape.envelope = kind;
        }
    }

    /// The shape that the tree is to be cut to, if one was drawn.
    pub fn drawn(&self) -> Option<&Path> {
        match &self.envelope {
            Some(Envelope::Image(path)) => Some(path),
            _ => None,
        }
    }

    /// Refuses a drawn shape where the tree is only being filmed.
    pub fn refuse_drawn(&self) -> Result<(), Ended> {
        self.drawn().map_or(Ok(()), |path| {
            Err(Ended::BadUsage(anyhow!(
                "--envelope takes revolution or hull here; `arborcam export` and `render` cut the captured tree to {}",
                path.display()
            )))
        })
    }

    /// Refuses a trunk that was drawn on a picture of another size.
    pub fn fits(&self, size: Size) -> Result<(), Ended> {
        match &self.trunk {
            Some(Trunk::Drawn(line)) if Size::new(line.width, line.height) != size => {
                Err(Ended::BadUsage(anyhow!(
                    "--trunk is for a picture of {}x{}, this one is {size}; draw it on a frame of this clip",
                    line.width,
                    line.height
                )))
            }
            _ => Ok(()),
        }
    }
}

/// The trunk that is kept.
#[derive(Clone, Debug)]
enum Trunk {
    Auto,
    Drawn(Line),
}

/// A line that was drawn on a picture of this size.
#[derive(Clone, Debug, Deserialize)]
struct Line {
    width: u32,
    height: u32,
    /// From the foot up, once it is read.
    polyline_px: Vec<[f64; 2]>,
}

impl Trunk {
    fn parse(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let bytes = std::fs::read(text).map_err(|e| format!("{e}; give a file, or auto"))?;
        let mut line: Line = serde_json::from_slice(&bytes)
            .map_err(|e| format!("{e}; it must hold width, height and polyline_px"))?;
        if line.polyline_px.iter().flatten().any(|x| !x.is_finite()) {
            return Err("polyline_px holds what is no number".into());
        }
        let [first, .., last] = line.polyline_px[..] else {
            return Err("polyline_px needs at least two points".into());
        };
        // Drawn from the top down: v grows downwards, and a trunk stands on its foot.
        if first[1] < last[1] {
            line.polyline_px.reverse();
        }
        Ok(Self::Drawn(line))
    }
}

/// What the branches fill.
#[derive(Clone, Debug)]
enum Envelope {
    Kind(EnvelopeKind),
    Image(PathBuf),
}

impl Envelope {
    fn parse(text: &str) -> Result<Self, String> {
        match text {
            "revolution" => Ok(Self::Kind(EnvelopeKind::Revolution)),
            "hull" => Ok(Self::Kind(EnvelopeKind::Hull)),
            // A word that is no file is more likely a slip of the pen than a picture.
            path if Path::new(path).is_file() => Ok(Self::Image(path.into())),
            _ => Err("give revolution, hull, or an image that is there".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(polyline_px: &str) -> Result<Vec<[f64; 2]>, String> {
        let file = tempfile::NamedTempFile::new().expect("file");
        std::fs::write(
            file.path(),
            format!(r#"{{"width": 64, "height": 48, "polyline_px": {polyline_px}}}"#),
        )
        .expect("write");
        match Trunk::parse(file.path().to_str().expect("path"))? {
            Trunk::Drawn(line) => Ok(line.polyline_px),
            Trunk::Auto => Err("auto".into()),
        }
    }

    /// A trunk drawn from the top down is the same trunk.
    #[test]
    fn a_trunk_may_be_drawn_from_either_end() {
        let up = parsed("[[30, 40], [31, 20], [29, 4]]");
        assert_eq!(up, Ok(vec![[30.0, 40.0], [31.0, 20.0], [29.0, 4.0]]));
        assert_eq!(parsed("[[29, 4], [31, 20], [30, 40]]"), up);
        assert!(parsed("[[29, 4]]").is_err_and(|why| why.contains("two points")));
    }
}

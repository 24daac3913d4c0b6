//! Options for the shape of the tree: its trunk and the envelope of its branches.

use super::command_error::CommandError;
use super::line::Line;
use crate::config::{Config, EnvelopeKind, Leader};
use crate::model::Size;
use crate::outline::{PolygonFile, from_polygon};
use crate::shape::Drawn;
use anyhow::{Context, anyhow};
use clap::Args;
use nalgebra::Point2;
use std::path::{Path, PathBuf};

/// Shape options of `capture`, `replay` and the commands that read a capture.
#[derive(Clone, Debug, Default, Args)]
pub struct ShapeArgs {
    /// Keep one trunk up to the top, as conifers have: the line in FILE (JSON: width, height,
    /// polyline_px from either end), or `auto` for the straightest path upwards.
    #[arg(long, value_name = "FILE|auto", value_parser = Trunk::parse)]
    trunk: Option<Trunk>,
    /// Envelope of the branches: the outline rotated about its axis (`revolution`), the rotated
    /// hull of the visible branches (`hull`), or, for `export`, `render` and `animate`, a shape that the tree
    /// is cut to: the opaque part of an image, the white part of a mask, a photograph of a thing
    /// before a plain background, or a polygon (JSON).
    #[arg(long, value_name = "revolution|hull|FILE", value_parser = Envelope::parse)]
    envelope: Option<Envelope>,
}

impl ShapeArgs {
    /// Whether any option is given.
    pub fn is_given(&self) -> bool {
        self.trunk.is_some() || self.envelope.is_some()
    }

    /// Applies the options of the command line.
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

    /// The image that the tree is cut to, if one is given.
    pub fn image(&self) -> Option<&Path> {
        match &self.envelope {
            Some(Envelope::Image(path)) => Some(path),
            _ => None,
        }
    }

    /// Checks that the tree is not to be cut to an image, which a command that films cannot do.
    ///
    /// # Errors
    /// An image is given.
    pub fn reject_image_envelope(&self) -> Result<(), CommandError> {
        match self.image() {
            None => Ok(()),
            Some(path) => Err(CommandError::BadUsage(anyhow!(
                "--envelope takes revolution or hull here; `arborcam export` and `render` cut the \
                 captured tree to {}",
                path.display()
            ))),
        }
    }

    /// Checks that the trunk was drawn on a picture of this size.
    ///
    /// # Errors
    /// It was drawn on one of another size.
    pub fn check_size(&self, size: Size) -> Result<(), CommandError> {
        match &self.trunk {
            Some(Trunk::Drawn(line)) => line.check_size("--trunk", size),
            Some(Trunk::Auto) | None => Ok(()),
        }
    }
}

/// Value of `--trunk`.
#[derive(Clone, Debug)]
enum Trunk {
    Auto,
    Drawn(Line),
}

impl Trunk {
    fn parse(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let bytes = std::fs::read(text).map_err(|e| format!("{e}; give a file, or auto"))?;
        let mut line = Line::of_json(&bytes)?;
        // v grows downwards: such a line was drawn from the top.
        if let [first, .., last] = line.polyline_px[..]
            && first[1] < last[1]
        {
            line.polyline_px.reverse();
        }
        Ok(Self::Drawn(line))
    }
}

/// Value of `--envelope`.
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
            // A word that is no existing file is more likely a misspelt keyword.
            path if Path::new(path).is_file() => Ok(Self::Image(path.into())),
            _ => Err("give revolution, hull, or a file that is there".into()),
        }
    }
}

/// The shape in a file: an image, or a polygon in JSON.
///
/// # Errors
/// It cannot be read, or has no shape in it.
pub fn read_drawn(path: &Path) -> anyhow::Result<Drawn> {
    let bytes = std::fs::read(path)
        .map_err(|e| anyhow!("cannot read it: {e}; give an image or a polygon"))?;
    if bytes.iter().find(|b| !b.is_ascii_whitespace()) != Some(&b'{') {
        return Ok(Drawn::of_image(&bytes)?);
    }
    let polygon: PolygonFile = serde_json::from_slice(&bytes)
        .context("is no polygon: it must hold width, height and polygon_px")?;
    let corners_px: Vec<Point2<f64>> = polygon.polygon_px.into_iter().map(Point2::from).collect();
    let size = Size::new(polygon.width, polygon.height);
    Ok(Drawn::of_region(&from_polygon(&corners_px, size)?)?)
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

    /// A line drawn from the top down is the same trunk.
    #[test]
    fn a_trunk_may_be_drawn_from_either_end() {
        let up = parsed("[[30, 40], [31, 20], [29, 4]]");
        assert_eq!(up, Ok(vec![[30.0, 40.0], [31.0, 20.0], [29.0, 4.0]]));
        assert_eq!(parsed("[[29, 4], [31, 20], [30, 40]]"), up);
        assert!(parsed("[[29, 4]]").is_err_and(|why| why.contains("two points")));
    }
}

//! What the user draws for the tree's shape: the trunk that it keeps, the space that it fills.

use super::Ended;
use crate::config::{Config, EnvelopeKind, Leader};
use crate::model::Size;
use anyhow::anyhow;
use clap::Args;
use serde::Deserialize;

/// The options of `capture` and `replay` on the shape.
#[derive(Clone, Debug, Default, Args)]
pub struct ShapeArgs {
    /// Keeps one trunk up to the tip, as conifers have: the line that was drawn in FILE (JSON: width, height,
    /// polyline_px from the foot up), or `auto` for the straightest way up.
    #[arg(long, value_name = "FILE|auto", value_parser = Trunk::parse)]
    trunk: Option<Trunk>,
    /// What the branches fill: the outline turned about its axis, or the hull of the branches seen, turned.
    #[arg(long, value_name = "revolution|hull", value_parser = envelope)]
    envelope: Option<EnvelopeKind>,
}

impl ShapeArgs {
    /// The command line over the settings.
    pub fn set(&self, config: &mut Config) {
        match &self.trunk {
            Some(Trunk::Auto) => config.shape.leader = Leader::Auto,
            Some(Trunk::Drawn(line)) => {
                (config.shape.leader, config.shape.leader_px) = (Leader::Drawn, line.polyline_px.clone());
            }
            None => {}
        }
        if let Some(envelope) = self.envelope {
            config.shape.envelope = envelope;
        }
    }

    /// Refuses a trunk that was drawn on a picture of another size.
    pub fn fits(&self, size: Size) -> Result<(), Ended> {
        match &self.trunk {
            Some(Trunk::Drawn(line)) if Size::new(line.width, line.height) != size => Err(Ended::BadUsage(anyhow!(
                "--trunk is for a picture of {}x{}, this one is {size}; draw it on a frame of this clip",
                line.width,
                line.height
            ))),
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
    /// From the foot up.
    polyline_px: Vec<[f64; 2]>,
}

impl Trunk {
    fn parse(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let bytes = std::fs::read(text).map_err(|e| format!("{e}; give a file, or auto"))?;
        let line: Line =
            serde_json::from_slice(&bytes).map_err(|e| format!("{e}; it must hold width, height and polyline_px"))?;
        let usable = line.polyline_px.len() >= 2 && line.polyline_px.iter().flatten().all(|x| x.is_finite());
        if usable { Ok(Self::Drawn(line)) } else { Err("polyline_px needs at least two points".into()) }
    }
}

fn envelope(name: &str) -> Result<EnvelopeKind, String> {
    match name {
        "revolution" => Ok(EnvelopeKind::Revolution),
        "hull" => Ok(EnvelopeKind::Hull),
        _ => Err("give revolution or hull; a drawn shape is for `arborcam export`".into()),
    }
}

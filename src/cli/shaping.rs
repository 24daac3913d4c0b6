//! What a command that reads a capture may change of its tree, and the tree that comes out.

use super::Ended;
use crate::capture::{CaptureError, Captured};
use crate::config::{Config, ConfigError};
use crate::export::capture::Software;
use crate::export::gltf::{KEY_TOLERANCE_PX, Model, provenance};
use crate::model::{Pose, Skeleton};
use crate::pipeline::{Dressed, Seen, dress, reshape};
use clap::Args;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Changes to a capture's own settings.
#[derive(Debug, Default, Args)]
pub struct Shaping {
    /// Settings that differ from those of the capture (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Planes about the trunk on which the tree is repeated, the one that was filmed included.
    #[arg(long, value_name = "N")]
    planes: Option<u32>,
    /// Length of the animation at most, s; the last so many seconds of the film.
    #[arg(long, value_name = "SECONDS")]
    animation_s: Option<f64>,
    /// Metres in a pixel at the tree; 0 for a model in pixels.
    #[arg(long, value_name = "M")]
    metres_per_px: Option<f64>,
}

/// A tree that has been read, and changed as was wished.
pub struct Made {
    pub captured: Captured,
    pub config: Config,
    pub skeleton: Arc<Skeleton>,
    pub poses: Vec<Pose>,
    pub dressed: Dressed,
    /// How far each group of leaves swings in every pose.
    pub flutter: Vec<Vec<[f32; 2]>>,
    node_extras: Vec<Value>,
    provenance: Value,
    /// It stands otherwise than in the tables of the capture.
    pub reshaped: bool,
}

impl From<CaptureError> for Ended {
    fn from(e: CaptureError) -> Self {
        match e {
            // A sound capture of a film in which there was no tree.
            CaptureError::NoTree { .. } => Ended::Failed(e.into()),
            _ => Ended::NoInput(e.into()),
        }
    }
}

impl Shaping {
    /// The settings of the capture with what is to be changed of them: the file over the capture's, the command line over
    /// both.
    fn config(&self, own: &Config) -> Result<Config, ConfigError> {
        let mut config = match &self.config {
            Some(path) => own.overlaid(path)?,
            None => own.clone(),
        };
        let set = |value: &mut f64, wanted: Option<f64>| wanted.into_iter().for_each(|w| *value = w);
        self.planes.into_iter().for_each(|n| config.shape.planes = n);
        set(&mut config.export.animation_s, self.animation_s);
        set(&mut config.export.metres_per_px, self.metres_per_px);
        config.check()?;
        Ok(config)
    }

    /// Reads the capture in `dir` and makes the tree that is wished for.
    ///
    /// # Errors
    /// The capture cannot be read, a setting is out of range, or the capture lacks what a new shape is made from.
    pub fn made(&self, dir: &Path) -> Result<Made, Ended> {
        let note = Captured::note(dir)?;
        let config = self.config(&note.config).map_err(|e| Ended::BadUsage(e.into()))?;
        let captured = Captured::read(dir, config.export.animation_s)?;
        let reshaped = config.shape != note.config.shape;
        let (skeleton, poses, pose_in_picture) = if reshaped {
            let outline = captured.outline.as_ref().ok_or_else(|| {
                Ended::Failed(anyhow::anyhow!("{} holds no outline, which a new shape is made from", dir.display()))
            })?;
            let skeleton = Arc::new(reshape(&captured.skeleton, outline, &config));
            let poses = captured.reposed(&skeleton, &config, &captured.poses);
            let in_picture = captured.pose_in_picture.as_slice();
            let in_picture = captured.reposed(&skeleton, &config, in_picture).pop();
            (skeleton, poses, in_picture)
        } else {
            (captured.skeleton.clone(), captured.poses.clone(), captured.pose_in_picture.clone())
        };
        let picture = captured.picture.as_ref().map(|p| &*p.rgb);
        let seen = Seen { picture, pose: pose_in_picture.as_ref(), outline: captured.outline.as_ref() };
        let dressed = dress(&skeleton, seen, &config);
        let extras = |sway: &Option<_>| sway.as_ref().map_or(Value::Null, |s: &crate::export::csv::Sway| s.extras());
        // Copies come last; nothing was measured on them.
        let node_extras = captured.sway[..captured.skeleton.measured()].iter().map(extras).collect();
        let provenance = provenance(&captured.note.source.name, &Software::default(), &poses);
        let flutter = Vec::new();
        Ok(Made { captured, config, skeleton, poses, dressed, flutter, node_extras, provenance, reshaped })
    }
}

impl Made {
    /// As it goes into a file.
    pub fn model(&self) -> Model<'_> {
        Model {
            skeleton: &self.skeleton,
            dressed: &self.dressed,
            poses: &self.poses,
            flutter: &self.flutter,
            all_levels: false,
            metres_per_px: self.config.export.metres_per_px,
            tolerance_px: KEY_TOLERANCE_PX,
            node_extras: &self.node_extras,
            provenance: &self.provenance,
        }
    }
}

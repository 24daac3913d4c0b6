//! What a command that reads a capture may change of its tree, and the tree that comes out.

use super::shape::ShapeArgs;
use super::{Ended, say};
use crate::capture::{CaptureError, Captured};
use crate::config::{Config, ConfigError, LeafShow};
use crate::export::capture::Software;
use crate::export::gltf::{KEY_TOLERANCE_PX, Model, provenance};
use crate::export::read_template;
use crate::export::sway::extras;
use crate::model::{Luma, Outline, Pose, Skeleton, Swaying, Unidentified};
use crate::outline;
use crate::pipeline::{Seen, cut_to, dress, flutter, reshape};
use crate::shape::{Cut, Drawn, Dressed};
use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
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
    #[command(flatten)]
    shape: ShapeArgs,
    /// Triangles of the wood, 10000 to 100000 for most uses.
    #[arg(long, value_name = "N")]
    triangles: Option<u32>,
    /// Whether the tree bears leaves; `auto` looks at the film.
    #[arg(long, value_name = "WHEN")]
    leaves: Option<Show>,
    /// A leaf or a small cluster of leaves of your own (.glb, .gltf) instead of the built-in one.
    #[arg(long, value_name = "FILE")]
    leaf: Option<PathBuf>,
    /// How dense the leaves are, as a grey image of the film's size, white where they are densest.
    #[arg(long, value_name = "IMAGE")]
    density: Option<PathBuf>,
    /// Where chance is involved (curl, twigs, leaves), the same number gives the same tree.
    #[arg(long, value_name = "N")]
    seed: Option<u32>,
    /// Length of the animation at most, s; the last so many seconds of the film.
    #[arg(long, value_name = "SECONDS")]
    animation_s: Option<f64>,
    /// Metres in a pixel at the tree; 0 for a model in pixels.
    #[arg(long, value_name = "M")]
    metres_per_px: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Show {
    Auto,
    On,
    Off,
}

/// A tree that has been read, and changed as was wished.
pub struct Made {
    pub captured: Captured,
    pub config: Config,
    pub skeleton: Arc<Skeleton>,
    pub poses: Vec<Pose>,
    /// The pose in the picture of the capture.
    pub pose_in_picture: Option<Pose>,
    pub dressed: Dressed,
    /// How far each group of leaves swings in every pose.
    pub flutter: Vec<Vec<[f32; 2]>>,
    /// What is known of the sway of every node.
    pub sway: Vec<Swaying>,
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
        self.shape.set(&mut config);
        self.planes.into_iter().for_each(|n| config.shape.planes = n);
        self.triangles.into_iter().for_each(|n| config.wood.triangles = n);
        self.seed.into_iter().for_each(|n| config.wood.seed = n);
        if let Some(show) = self.leaves {
            config.leaves.show = match show {
                Show::Auto => LeafShow::Auto,
                Show::On => LeafShow::On,
                Show::Off => LeafShow::Off,
            };
        }
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
        self.made_with(dir, |_| None)
    }

    /// The same with other poses than those of an animation: of the last so many seconds, as `tail_s` says for a film of
    /// its argument's length, s.
    ///
    /// # Errors
    /// As of [`Shaping::made`].
    pub fn made_with(&self, dir: &Path, tail_s: impl Fn(f64) -> Option<f64>) -> Result<Made, Ended> {
        let note = Captured::note(dir)?;
        let config = self.config(&note.config).map_err(|e| Ended::BadUsage(e.into()))?;
        let length_s = tail_s(note.timing.duration_s).unwrap_or(config.export.animation_s);
        let captured = Captured::read(dir, length_s)?;
        self.shape.fits(captured.skeleton.image_size)?;
        let stand = self.stand(&captured, &config, dir)?;
        let leaf = self.leaf.as_deref().map(read_template).transpose().map_err(|e| Ended::BadUsage(e.into()))?;
        let density = match &self.density {
            Some(path) => {
                let size = captured.skeleton.image_size;
                Some(outline::density(path, size).map_err(|e| Ended::BadUsage(e.into()))?)
            }
            // A tree that was cut to a shape bears leaves all over it.
            None => stand.cut_to.as_ref().map(|shape| Luma { size: shape.size, pixels: white(&shape.mask) }),
        };
        let seen = Seen {
            picture: captured.picture.as_ref().map(|p| &*p.rgb),
            pose: stand.pose_in_picture.as_ref(),
            outline: stand.cut_to.as_ref().or(captured.outline.as_ref()),
            cut: stand.cut_to.is_some(),
            leaf: leaf.as_ref(),
            density: density.as_ref(),
        };
        let Stand { skeleton, poses, sway, reshaped, .. } = &stand;
        let dressed = dress(skeleton, seen, &config);
        let node_extras = sway.iter().map(extras).collect();
        let provenance = provenance(&captured.note.source.name, &Software::default(), poses);
        let (flutter, reshaped) = (flutter(&dressed, poses, skeleton, &config), *reshaped);
        let Stand { skeleton, poses, pose_in_picture, sway, .. } = stand;
        Ok(Made {
            captured,
            config,
            skeleton,
            poses,
            pose_in_picture,
            dressed,
            flutter,
            sway,
            node_extras,
            provenance,
            reshaped,
        })
    }

    /// The captured tree as it is to stand, and its poses.
    fn stand(&self, captured: &Captured, config: &Config, dir: &Path) -> Result<Stand, Ended> {
        let drawn = self.shape.drawn();
        let reshaped = config.shape != captured.note.config.shape;
        let outline = || {
            let lacks = || anyhow!("{} holds no outline, which a new shape is made from", dir.display());
            captured.outline.as_ref().ok_or_else(lacks).map_err(Ended::Failed)
        };
        let mut stand = Stand {
            skeleton: captured.skeleton.clone(),
            poses: captured.poses.clone(),
            pose_in_picture: captured.pose_in_picture.clone(),
            sway: captured.sway.clone(),
            cut_to: None,
            reshaped: reshaped || drawn.is_some(),
        };
        if reshaped {
            stand.skeleton = Arc::new(reshape(&captured.skeleton, outline()?, config));
            stand.poses = captured.reposed(&stand.skeleton, config, &captured.poses);
            let in_picture = captured.pose_in_picture.as_slice();
            stand.pose_in_picture = captured.reposed(&stand.skeleton, config, in_picture).pop();
            // Copies come last; nothing was measured on them.
            stand.sway.truncate(captured.skeleton.measured());
            stand.sway.resize(stand.skeleton.nodes.len(), Err(Unidentified::NotMeasured));
        }
        let Some(path) = drawn else { return Ok(stand) };
        let unfit = |e: anyhow::Error| Ended::BadUsage(e.context(format!("--envelope {}", path.display())));
        let bytes = std::fs::read(path).context("cannot read it").map_err(unfit)?;
        let drawn = Drawn::of_image(&bytes).map_err(|e| unfit(e.into()))?;
        let topiary = cut_to(&stand.skeleton, outline()?, &drawn, config).map_err(|e| unfit(e.into()))?;
        tell(&topiary.cut);
        if topiary.cut.larger {
            return Ok(stand);
        }
        let whole = stand.skeleton.clone();
        let pose = |pose: &Pose| topiary.pose(&whole, pose);
        let sway = |(node, of): (&crate::model::Node, &crate::model::NodeId)| {
            let known = stand.sway.get(of.index()).filter(|_| node.copy_of.is_none());
            known.copied().unwrap_or(Err(Unidentified::NotMeasured))
        };
        Ok(Stand {
            poses: stand.poses.iter().map(pose).collect(),
            pose_in_picture: stand.pose_in_picture.as_ref().map(pose),
            sway: topiary.skeleton.nodes.iter().zip(&topiary.moves_as).map(sway).collect(),
            skeleton: Arc::new(topiary.skeleton),
            cut_to: Some(topiary.shape),
            reshaped: true,
        })
    }
}

/// The tree as it is to stand.
struct Stand {
    skeleton: Arc<Skeleton>,
    poses: Vec<Pose>,
    pose_in_picture: Option<Pose>,
    sway: Vec<Swaying>,
    /// The drawn shape in the picture.
    cut_to: Option<Outline>,
    reshaped: bool,
}

fn white(mask: &[u8]) -> Vec<u8> {
    mask.iter().map(|&m| if m == 0 { 0 } else { 255 }).collect()
}

/// What became of the tree.
fn tell(cut: &Cut) {
    say(&if cut.larger {
        "arborcam: warning: the shape of --envelope holds the whole tree; nothing is cut".to_owned()
    } else {
        format!(
            "arborcam: cut to the shape: {} branches gone, {} shortened, {} added; {:.0} % of the shape is covered",
            cut.gone,
            cut.shortened,
            cut.grown,
            100.0 * cut.coverage
        )
    });
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
            thorough: true,
            node_extras: &self.node_extras,
            provenance: &self.provenance,
        }
    }
}

//! What a command that reads a capture may change of its tree, and the tree that comes out.

use super::scale::ScaleArgs;
use super::shape::ShapeArgs;
use super::{Ended, idle, say};
use crate::capture::{CaptureError, Captured};
use crate::config::{Config, ConfigError, LeafShow};
use crate::export::capture::Software;
use crate::export::gltf::{KEY_TOLERANCE_PX, Model, provenance};
use crate::export::read_template;
use crate::export::sway::extras;
use crate::model::{Outline, Pose, Skeleton, Swaying, Unidentified};
use crate::outline;
use crate::pipeline::{MOST_RESHAPED, Seen, cut_to, dress, flutter, reshape};
use crate::shape::{Cut, Drawn, Dressed, Topiary};
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
    /// Where chance is involved (curl, twigs, leaves, wind), the same number gives the same tree.
    #[arg(long, value_name = "N")]
    seed: Option<u32>,
    /// Length of the animation at most, s; the last so many seconds of the film.
    #[arg(long, value_name = "SECONDS")]
    animation_s: Option<f64>,
    #[command(flatten)]
    scale: ScaleArgs,
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
    restood: Restood,
}

/// What was done to the captured tree, for all further poses of it.
#[derive(Default)]
struct Restood {
    /// The tree of the new shape.
    reshaped: Option<Arc<Skeleton>>,
    /// The tree before it was cut, and the cut one.
    cut: Option<(Arc<Skeleton>, Topiary)>,
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
    /// The settings of the capture with what is to be changed of them: the file over the capture's,
    /// the command line over both.
    fn config(&self, own: &Config) -> Result<Config, ConfigError> {
        let mut config = match &self.config {
            Some(path) => own.overlaid(path)?,
            None => own.clone(),
        };
        let set =
            |value: &mut f64, wanted: Option<f64>| wanted.into_iter().for_each(|w| *value = w);
        self.shape.set(&mut config);
        self.planes
            .into_iter()
            .for_each(|n| config.shape.planes = n);
        self.triangles
            .into_iter()
            .for_each(|n| config.wood.triangles = n);
        self.seed
            .into_iter()
            .for_each(|n| (config.wood.seed, config.wind.seed) = (n, n));
        if let Some(show) = self.leaves {
            config.leaves.show = match show {
                Show::Auto => LeafShow::Auto,
                Show::On => LeafShow::On,
                Show::Off => LeafShow::Off,
            };
        }
        set(&mut config.export.animation_s, self.animation_s);
        self.scale.set(&mut config);
        config.check()?;
        Ok(config)
    }

    /// Reads the capture in `dir` and makes the tree that is wished for.
    ///
    /// # Errors
    /// The capture cannot be read, a setting is out of range, or the capture lacks what a new shape
    /// is made from.
    pub fn made(&self, dir: &Path) -> Result<Made, Ended> {
        self.made_with(dir, |_| None)
    }

    /// The same with other poses than those of an animation: of the last so many seconds, as
    /// `tail_s` says for a film of its argument's length, s.
    ///
    /// # Errors
    /// As of [`Shaping::made`].
    pub fn made_with(
        &self,
        dir: &Path,
        tail_s: impl Fn(f64) -> Option<f64>,
    ) -> Result<Made, Ended> {
        let note = Captured::note(dir)?;
        let config = self
            .config(&note.config)
            .map_err(|e| Ended::BadUsage(e.into()))?;
        self.config
            .iter()
            .for_each(|file| idle::settings(file, &note.config, &config));
        let length_s = tail_s(note.timing.duration_s).unwrap_or(config.export.animation_s);
        let captured = Captured::read(dir, length_s)?;
        self.shape.fits(captured.skeleton.image_size)?;
        self.scale.fits(captured.skeleton.image_size)?;
        let stand = self.stand(&captured, &config, dir)?;
        let leaf = self
            .leaf
            .as_deref()
            .map(read_template)
            .transpose()
            .map_err(|e| Ended::BadUsage(e.into()))?;
        let size = captured.skeleton.image_size;
        let density = self
            .density
            .as_deref()
            .map(|path| outline::density(path, size))
            .transpose();
        let density = density.map_err(|e| Ended::BadUsage(e.into()))?;
        let seen = Seen {
            picture: captured.picture.as_ref().map(|p| &*p.rgb),
            pose: stand.pose_in_picture.as_ref(),
            outline: captured.outline.as_ref(),
            cut_to: stand.cut_to.as_ref(),
            leaf: leaf.as_ref(),
            density: density.as_ref(),
        };
        let Stand {
            skeleton,
            poses,
            sway,
            reshaped,
            ..
        } = &stand;
        let dressed = dress(skeleton, seen, &config);
        if self.leaf.is_some() && dressed.foliage.groups.is_empty() {
            idle::tell(
                "--leaf",
                "the tree bears no leaves; put them on with --leaves on",
            );
        }
        let node_extras = sway.iter().map(extras).collect();
        let provenance = provenance(&captured.note.source.name, &Software::default(), poses);
        let (flutter, reshaped) = (flutter(&dressed, poses, skeleton, &config), *reshaped);
        let Stand {
            skeleton,
            poses,
            pose_in_picture,
            sway,
            restood,
            ..
        } = stand;
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
            restood,
        })
    }

    /// The captured tree as it is to stand, and its poses.
    fn stand(&self, captured: &Captured, config: &Config, dir: &Path) -> Result<Stand, Ended> {
        let drawn = self.shape.drawn();
        let reshaped = config.shape != captured.note.config.shape;
        let outline = || {
            let lacks = || {
                anyhow!(
                    "{} holds no outline, which a new shape is made from",
                    dir.display()
                )
            };
            captured
                .outline
                .as_ref()
                .ok_or_else(lacks)
                .map_err(Ended::Failed)
        };
        let mut stand = Stand {
            skeleton: captured.skeleton.clone(),
            poses: captured.poses.clone(),
            pose_in_picture: captured.pose_in_picture.clone(),
            sway: captured.sway.clone(),
            cut_to: None,
            reshaped: reshaped || drawn.is_some(),
            restood: Restood::default(),
        };
        let planes = if reshaped {
            config.shape.planes as usize
        } else {
            0
        };
        let nodes = stand
            .skeleton
            .nodes
            .len()
            .max(planes.saturating_mul(stand.skeleton.measured()));
        if stand.reshaped && nodes > MOST_RESHAPED {
            return Err(Ended::Failed(anyhow!(
                "another shape would have {nodes} nodes, and at most {MOST_RESHAPED} can be given one; take fewer --planes, \
                 or leave all options of the shape out"
            )));
        }
        if reshaped {
            stand.skeleton = Arc::new(reshape(&captured.skeleton, outline()?, config));
            stand.poses = captured.reposed(&stand.skeleton, config, &captured.poses);
            let in_picture = captured.pose_in_picture.as_slice();
            stand.pose_in_picture = captured.reposed(&stand.skeleton, config, in_picture).pop();
            // Copies come last; nothing was measured on them.
            stand.sway.truncate(captured.skeleton.measured());
            stand
                .sway
                .resize(stand.skeleton.nodes.len(), Err(Unidentified::NotMeasured));
            stand.restood.reshaped = Some(stand.skeleton.clone());
        }
        let Some(path) = drawn else { return Ok(stand) };
        let unfit =
            |e: anyhow::Error| Ended::BadUsage(e.context(format!("--envelope {}", path.display())));
        let bytes = std::fs::read(path)
            .context("cannot read it")
            .map_err(unfit)?;
        let drawn = Drawn::of_image(&bytes).map_err(|e| unfit(e.into()))?;
        let topiary =
            cut_to(&stand.skeleton, outline()?, &drawn, config).map_err(|e| unfit(e.into()))?;
        tell(&topiary.cut);
        if topiary.cut.larger {
            return Ok(stand);
        }
        let whole = stand.skeleton.clone();
        let pose = |pose: &Pose| topiary.pose(&whole, pose);
        let sway = |(node, of): (&crate::model::Node, &crate::model::NodeId)| {
            let known = stand
                .sway
                .get(of.index())
                .filter(|_| node.copy_of.is_none());
            known.copied().unwrap_or(Err(Unidentified::NotMeasured))
        };
        Ok(Stand {
            poses: stand.poses.iter().map(pose).collect(),
            pose_in_picture: stand.pose_in_picture.as_ref().map(pose),
            sway: topiary
                .skeleton
                .nodes
                .iter()
                .zip(&topiary.moves_as)
                .map(sway)
                .collect(),
            skeleton: Arc::new(topiary.skeleton.clone()),
            cut_to: Some(topiary.shape.clone()),
            reshaped: true,
            restood: Restood {
                cut: Some((whole, topiary)),
                ..stand.restood
            },
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
    restood: Restood,
}

/// The poses of a loop with the lap before and the one after, and how long a lap is, s: nothing
/// begins or ends in it.
fn round(poses: &[Pose]) -> Option<(Vec<Pose>, f64)> {
    let (first, rest) = poses.split_first()?;
    let lap_s = rest.last()?.time_s - first.time_s;
    let moved = |by_s: f64| {
        move |p: &Pose| Pose {
            time_s: p.time_s + by_s,
            ..p.clone()
        }
    };
    let before = poses[..rest.len()].iter().map(moved(-lap_s));
    Some((
        before
            .chain(poses.iter().cloned())
            .chain(rest.iter().map(moved(lap_s)))
            .collect(),
        lap_s,
    ))
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
    /// Takes other poses than those of the film, at even times; `looped`: the last is the first
    /// again. `what` says for the file's own notes where they come from.
    pub fn animate(&mut self, poses: Vec<Pose>, looped: bool, what: Value) {
        let flutter =
            |poses: &[Pose], config: &Config| flutter(&self.dressed, poses, &self.skeleton, config);
        self.flutter = match round(&poses).filter(|_| looped) {
            None => flutter(&poses, &self.config),
            Some((round, lap_s)) => {
                // Leaves come round too: whole swings in a lap.
                let mut config = self.config.clone();
                config.leaves.frequency_hz =
                    (config.leaves.frequency_hz * lap_s).round().max(1.0) / lap_s;
                let of_lap = poses.len() - 1..2 * poses.len() - 1;
                flutter(&round, &config)
                    .into_iter()
                    .map(|all| all[of_lap.clone()].to_vec())
                    .collect()
            }
        };
        self.provenance = provenance(
            &self.captured.note.source.name,
            &Software::default(),
            &poses,
        );
        if let Some(notes) = self.provenance.as_object_mut() {
            notes.insert("animated".into(), what);
        }
        self.poses = poses;
    }

    /// All poses of the film, of the tree as it stands; read anew, one at a time.
    ///
    /// # Errors
    /// `motion.csv` cannot be read.
    pub fn film(&self) -> Result<impl Iterator<Item = Result<Pose, CaptureError>>, CaptureError> {
        let Restood { reshaped, cut } = &self.restood;
        let mut repose = reshaped
            .as_ref()
            .map(|new| self.captured.reposer(new, &self.config));
        Ok(self.captured.film()?.map(move |pose| {
            let pose = pose?;
            let pose = match &mut repose {
                Some(repose) => repose(&pose),
                None => pose,
            };
            Ok(match cut {
                Some((whole, topiary)) => topiary.pose(whole, &pose),
                None => pose,
            })
        }))
    }

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
            thorough: &|| true,
            node_extras: &self.node_extras,
            provenance: &self.provenance,
        }
    }
}

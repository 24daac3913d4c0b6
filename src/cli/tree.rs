//! The options on what a command may change of a document's tree.

use super::ended::Ended;
use super::idle;
use super::output::say;
use super::scale::ScaleArgs;
use super::shape::ShapeArgs;
use crate::config::{Config, ConfigError, LeafShow};
use crate::document::Document;
use crate::export::read_template;
use crate::model::{Luma, Size};
use crate::outline;
use crate::shape::{Cut, Drawn};
use crate::views::{PrepareError, PreparedTree, TreeOptions};
use anyhow::Context;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Changes to a capture's own settings.
#[derive(Debug, Default, Args)]
pub struct TreeArgs {
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

/// How much of the end of a film is read.
#[derive(Clone, Copy, Debug)]
pub enum Tail {
    /// As much as an animation holds (`export.animation_s`).
    Animation,
    /// So many seconds.
    Seconds(f64),
    /// From this moment of the film on, s.
    From(f64),
    Whole,
}

impl Tail {
    /// Its length in a film of `film_s`, s.
    fn length_s(self, film_s: f64, config: &Config) -> f64 {
        match self {
            Self::Animation => config.export.animation_s,
            Self::Seconds(length_s) => length_s,
            // The last frame's own time is a little less than the film's.
            Self::From(at_s) => (film_s - at_s).max(0.0) + 2.0,
            Self::Whole => film_s + 1.0,
        }
    }
}

impl TreeArgs {
    /// The settings of the capture with what is to be changed of them: the file over the capture's,
    /// the command line over both.
    fn config(&self, own: &Config) -> Result<Config, ConfigError> {
        let mut config = match &self.config {
            Some(path) => own.overlaid(path)?,
            None => own.clone(),
        };
        self.shape.set(&mut config);
        if let Some(planes) = self.planes {
            config.shape.planes = planes;
        }
        if let Some(triangles) = self.triangles {
            config.wood.triangles = triangles;
        }
        if let Some(seed) = self.seed {
            (config.wood.seed, config.wind.seed) = (seed, seed);
        }
        if let Some(show) = self.leaves {
            config.leaves.show = match show {
                Show::Auto => LeafShow::Auto,
                Show::On => LeafShow::On,
                Show::Off => LeafShow::Off,
            };
        }
        if let Some(animation_s) = self.animation_s {
            config.export.animation_s = animation_s;
        }
        self.scale.set(&mut config);
        config.check()?;
        Ok(config)
    }

    /// Reads the document in `dir`, with the poses of the end of its film, and prepares the tree
    /// that these options ask for.
    ///
    /// # Errors
    /// The document or a file of an option cannot be read, a setting is out of range, or the
    /// document lacks what a new shape is made from.
    pub fn prepare(&self, dir: &Path, tail: Tail) -> Result<PreparedTree, Ended> {
        let note = Document::note(dir)?;
        let config = self.config(&note.config).map_err(bad_usage)?;
        if let Some(file) = &self.config {
            idle::settings(file, &note.config, &config);
        }
        let length_s = tail.length_s(note.timing.duration_s, &config);
        let document = Document::read(dir, length_s)?;
        let size = document.skeleton.image_size;
        self.shape.fits(size)?;
        self.scale.fits(size)?;
        let options = TreeOptions {
            cut_to: self.drawn()?,
            leaf: self
                .leaf
                .as_deref()
                .map(read_template)
                .transpose()
                .map_err(bad_usage)?,
            density: self.density(size)?,
            config,
        };
        let tree = PreparedTree::new(document, options).map_err(|e| self.unfit(e))?;
        self.tell(&tree);
        Ok(tree)
    }

    /// The drawn shape that the tree is to be cut to.
    fn drawn(&self) -> Result<Option<Drawn>, Ended> {
        let Some(path) = self.shape.drawn() else {
            return Ok(None);
        };
        let drawn = std::fs::read(path)
            .context("cannot read it")
            .and_then(|bytes| Ok(Drawn::of_image(&bytes)?));
        match drawn {
            Ok(drawn) => Ok(Some(drawn)),
            Err(e) => Err(of_envelope(path, e)),
        }
    }

    fn density(&self, size: Size) -> Result<Option<Luma>, Ended> {
        let Some(path) = self.density.as_deref() else {
            return Ok(None);
        };
        outline::density(path, size).map(Some).map_err(bad_usage)
    }

    /// Names the option that a shape comes from.
    fn unfit(&self, e: PrepareError) -> Ended {
        match (e, self.shape.drawn()) {
            (PrepareError::Shape(e), Some(path)) => of_envelope(path, e.into()),
            (e, _) => e.into(),
        }
    }

    /// What became of the tree, and of an option that changes nothing.
    fn tell(&self, tree: &PreparedTree) {
        if let Some(cut) = &tree.cut {
            say(&told(cut));
        }
        if self.leaf.is_some() && tree.dressed.foliage.groups.is_empty() {
            idle::tell(
                "--leaf",
                "the tree bears no leaves; put them on with --leaves on",
            );
        }
    }
}

fn bad_usage(e: impl Into<anyhow::Error>) -> Ended {
    Ended::BadUsage(e.into())
}

fn of_envelope(path: &Path, e: anyhow::Error) -> Ended {
    Ended::BadUsage(e.context(format!("--envelope {}", path.display())))
}

fn told(cut: &Cut) -> String {
    if cut.larger {
        return "arborcam: warning: the shape of --envelope holds the whole tree; nothing is cut"
            .to_owned();
    }
    format!(
        "arborcam: cut to the shape: {} branches gone, {} shortened, {} added; {:.0} % of the shape is covered",
        cut.gone,
        cut.shortened,
        cut.grown,
        100.0 * cut.coverage
    )
}

/// Says what the document lacks.
pub fn warn(tree: &PreparedTree) {
    for warning in &tree.document.warnings {
        say(&format!("arborcam: warning: {warning}"));
    }
}

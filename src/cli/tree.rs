//! Options for the tree of a capture, for the commands that export, draw or animate it.

use super::command_error::CommandError;
use super::common::{setting, whole_setting};
use super::output::eprint_line;
use super::scale::ScaleArgs;
use super::shape::{ShapeArgs, read_drawn};
use super::unused;
use crate::config::{Config, LeafShow};
use crate::document::Document;
use crate::export::read_template;
use crate::model::{Luma, Size};
use crate::outline;
use crate::shape::{Cut, Drawn};
use crate::views::{PrepareError, PreparedTree, TreeOptions};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Options that override the settings of the capture.
#[derive(Debug, Default, Args)]
pub struct TreeArgs {
    /// Settings that differ from those of the capture (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Number of planes about the trunk on which the branches are repeated, filmed one included.
    #[arg(long, value_name = "N", value_parser = whole_setting("shape.planes"))]
    planes: Option<u32>,
    #[command(flatten)]
    shape: ShapeArgs,
    /// Number of triangles of the wood; 10000 to 100000 for most uses.
    #[arg(long, value_name = "N", value_parser = whole_setting("wood.triangles"))]
    triangles: Option<u32>,
    /// Whether the tree has leaves; `auto` decides by the film.
    #[arg(long, value_name = "WHEN")]
    leaves: Option<Show>,
    /// Model of a leaf or a small cluster of leaves (.glb, .gltf) instead of the built-in one.
    #[arg(long, value_name = "FILE")]
    leaf: Option<PathBuf>,
    /// Let leaves swing on their own in the animation of a model's file, not only with their
    /// branches.
    #[arg(long)]
    leaf_swing: bool,
    /// Density of the leaves as a grey image of the film's size, white where it is highest.
    #[arg(long, value_name = "IMAGE")]
    density: Option<PathBuf>,
    /// Seed of the random numbers (curl, twigs, leaves, wind); the same seed gives the same tree.
    #[arg(long, value_name = "N")]
    seed: Option<u32>,
    /// Longest animation, s; of a longer film the end is used.
    #[arg(long, value_name = "SECONDS", value_parser = setting("export.animation_s"))]
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

/// The part of a film, up to its end, of which poses are read.
#[derive(Clone, Copy, Debug)]
pub enum Tail {
    /// The length of an animation (`export.animation_s`).
    Animation,
    /// The last seconds.
    Seconds(f64),
    /// From this moment of the film, s.
    From(f64),
    Whole,
}

impl Tail {
    /// Its length in a film of length `film_s`, s.
    fn length_s(self, film_s: f64, config: &Config) -> f64 {
        match self {
            Self::Animation => config.export.animation_s,
            Self::Seconds(length_s) => length_s,
            // Two seconds more, because the last frame is earlier than the end of the film.
            Self::From(at_s) => (film_s - at_s).max(0.0) + 2.0,
            Self::Whole => film_s + 1.0,
        }
    }
}

impl TreeArgs {
    /// Whether any option is given.
    pub fn is_given(&self) -> bool {
        let Self {
            config,
            planes,
            shape,
            triangles,
            leaves,
            leaf,
            leaf_swing,
            density,
            seed,
            animation_s,
            scale,
        } = self;
        let files = config.is_some() || leaf.is_some() || density.is_some();
        let numbers = planes.is_some() || triangles.is_some() || seed.is_some();
        let other = leaves.is_some() || *leaf_swing || animation_s.is_some();
        files || numbers || other || shape.is_given() || scale.is_given()
    }

    /// Applies the options of the command line.
    fn set(&self, config: &mut Config) {
        self.shape.set(config);
        if let Some(planes) = self.planes {
            (config.shape.planes, config.shape.copy_bare) = (planes, true);
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
        if self.leaf_swing {
            config.export.leaf_swing = true;
        }
        self.scale.set(config);
    }

    /// Reads the capture in `dir`, with the poses of the end of its film, and prepares its tree as
    /// these options say. The settings are layered: command line over configuration file over those
    /// of the capture. `set` applies the options that only the calling command has.
    ///
    /// # Errors
    /// The capture or a file of an option cannot be read, a setting is out of range, or the capture
    /// lacks the data for another shape.
    pub fn prepare(
        &self,
        dir: &Path,
        tail: Tail,
        set: impl FnOnce(&mut Config),
    ) -> Result<PreparedTree, CommandError> {
        let note = Document::note(dir)?;
        let config = note.config.layered(self.config.as_deref(), |config| {
            self.set(config);
            set(config);
        })?;
        if let Some(file) = &self.config {
            unused::note_film_settings(file, &note.config, &config);
        }
        // What was not filmed is a loop of a minute at most.
        let film_s = match note.timing.is_of_film() {
            true => note.timing.duration_s,
            false => f64::INFINITY,
        };
        let length_s = tail.length_s(film_s, &config);
        let document = Document::read(dir, length_s)?;
        let size = document.skeleton.image_size;
        self.shape.check_size(size)?;
        self.scale.check_size(size)?;
        let cut_to = self.read_envelope()?;
        let leaf = self.leaf.as_deref().map(read_template).transpose();
        let options = TreeOptions {
            cut_to,
            leaf: leaf.map_err(CommandError::bad_usage)?,
            density: self.read_density(size)?,
            config,
        };
        let tree = PreparedTree::new(document, options).map_err(|e| self.prepare_error(e))?;
        self.print_notes(&tree);
        Ok(tree)
    }

    /// The shape that the tree is to be cut to.
    fn read_envelope(&self) -> Result<Option<Drawn>, CommandError> {
        let Some(path) = self.shape.image() else {
            return Ok(None);
        };
        read_drawn(path)
            .map(Some)
            .map_err(|e| envelope_error(path, e))
    }

    /// The image of the density of the leaves.
    fn read_density(&self, size: Size) -> Result<Option<Luma>, CommandError> {
        let Some(path) = self.density.as_deref() else {
            return Ok(None);
        };
        outline::density(path, size)
            .map(Some)
            .map_err(CommandError::bad_usage)
    }

    /// Adds the option to an error in the shape that it gives.
    fn prepare_error(&self, e: PrepareError) -> CommandError {
        match (e, self.shape.image()) {
            (PrepareError::Shape(e), Some(path)) => envelope_error(path, e.into()),
            (e, _) => e.into(),
        }
    }

    /// Prints how the tree was cut, and whether `--leaf` has no effect.
    fn print_notes(&self, tree: &PreparedTree) {
        if let Some(cut) = &tree.cut {
            eprint_line(&cut_summary(cut));
        }
        if self.leaf.is_some() && tree.dressed.foliage.groups.is_empty() {
            unused::note(
                "--leaf",
                "the tree bears no leaves; put them on with --leaves on",
            );
        }
    }
}

/// An error in the image of `--envelope`.
fn envelope_error(path: &Path, e: anyhow::Error) -> CommandError {
    CommandError::BadUsage(e.context(format!("--envelope {}", path.display())))
}

/// The line that says how the tree was cut.
fn cut_summary(cut: &Cut) -> String {
    if cut.larger {
        return "arborcam: warning: the shape of --envelope holds the whole tree; nothing is cut"
            .to_owned();
    }
    format!(
        "arborcam: cut to the shape: {} branches gone, {} shortened, {} added; {:.0} % of the \
         shape is covered",
        cut.gone,
        cut.shortened,
        cut.grown,
        100.0 * cut.coverage
    )
}

/// Prints what the capture lacks.
pub fn print_warnings(tree: &PreparedTree) {
    for warning in &tree.document.warnings {
        eprint_line(&format!("arborcam: warning: {warning}"));
    }
}

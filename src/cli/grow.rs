//! `arborcam grow EXAMPLE --count N --out DIR`: new trees like a captured, drawn or modelled one,
//! each on its own or all in one forest.

use super::command_error::CommandError;
use super::common::parse_within;
use super::example::Example;
use super::forest::{ForestArgs, write_forest};
use super::output::eprint_line;
use super::shape::read_drawn;
use super::stop::Stop;
use crate::document::Document;
use crate::files::check_place;
use crate::grow::Resampling;
use crate::model::Outline;
use crate::outline;
use crate::runtime::{Undone, in_parallel};
use crate::tui::CountBar;
use crate::views::{
    Likeness, OffspringMotion, OffspringOptions, Parent, PrepareError, example_outline,
};
use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Most trees of one run.
const MOST_TREES: u64 = 100_000;
const MOST_THREADS: i64 = 256;

#[derive(Debug, Args)]
pub struct GrowArgs {
    /// The example: the folder of a capture, of a sketch or of a grown tree, or a file: a drawing
    /// (.svg, .json) or a modelled tree (.glb, .gltf; the lines of an .obj or .ply; .csv for
    /// cylinders; .txt for a treefile of RayCloudTools).
    example: PathBuf,
    /// Number of new trees; with --forest the number of trees in it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_TREES))]
    count: u64,
    /// Seed of the random numbers; the same seed gives the same trees.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// In what the trees are like the example.
    #[arg(long, value_name = "WHAT", default_value = "dirichlet")]
    like: Like,
    /// Only angles with a density above this are taken, 1/rad; less is freer (von-mises).
    #[arg(long, value_name = "DENSITY", value_parser = threshold)]
    threshold: Option<f64>,
    /// Branches from this level on are turned; the trunk has level 1 (von-mises).
    #[arg(long, value_name = "LEVEL", value_parser = clap::value_parser!(u8).range(1..))]
    from_level: Option<u8>,
    /// The shape that the trees fill instead of the example's outline: a picture with a transparent
    /// background, a mask (white = inside) or a photograph of a thing before a plain background, or
    /// a polygon (JSON) (dirichlet).
    #[arg(long, value_name = "IMAGE|MASK|POLYGON")]
    envelope: Option<PathBuf>,
    /// How the trees move; by default as the example did in its film, in wind where it is a scan with measured
    /// frequencies, else not at all.
    #[arg(long, value_name = "HOW")]
    motion: Option<HowToMove>,
    /// Settings that differ from those of the example (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    #[command(flatten)]
    forest: ForestArgs,
    /// Threads that trees are grown on; by default as many as there are processors. It changes no
    /// tree.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    threads: Option<u16>,
    /// Folder for the trees, one folder for each. It must not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Like {
    /// Forks of the same kind, in a new order (Li 2011).
    Dirichlet,
    /// The same branches at other angles (Zeng 2015).
    VonMises,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum HowToMove {
    /// With the example's frequencies, in a loop of ten seconds.
    Example,
    /// In the wind of the settings, in a loop of ten seconds.
    Wind,
    /// Not at all.
    None,
}

/// Parses `--threshold`, 1/rad.
fn threshold(text: &str) -> Result<f64, String> {
    parse_within(text, 0.0..=1e3, "give a density from 0 to 1000")
}

pub fn run(args: &GrowArgs) -> Result<(), CommandError> {
    let likeness = args.likeness()?;
    check_place(&args.out)?;
    let stop = Stop::on_signals()?;
    let Example { document, config } = Example::read(&args.example, args.config.as_deref())?;
    let motion = args.motion(&document);
    let region = args.region(&document)?;
    let options = OffspringOptions {
        likeness,
        motion,
        region,
        config,
    };
    let parent = Parent::new(document, options)?;
    if parent.loses_axis() {
        eprint_line(
            "arborcam: warning: the example has one trunk up to the top; new trees of its forks do not keep it, \
             --like von-mises does",
        );
    }
    let forest = args.forest.plan(&parent, args.count, args.seed)?;
    let is_stopped = stop.while_writing();
    let Some(forest) = forest else {
        args.grow(&parent, args.count, is_stopped)?;
        let trees = if args.count == 1 { "tree" } else { "trees" };
        eprint_line(&format!("{}: {} {trees}", args.out.display(), args.count));
        return Ok(());
    };
    args.grow(&parent, forest.origin.templates.len() as u64, is_stopped)?;
    write_forest(forest, &args.out, is_stopped)
}

/// The folder of the new tree with this number.
pub fn tree_name(number: u64) -> String {
    format!("tree-{number:04}")
}

impl GrowArgs {
    /// Grows and writes the new trees 1 to `count`.
    fn grow(
        &self,
        parent: &Parent,
        count: u64,
        is_stopped: &AtomicBool,
    ) -> Result<(), CommandError> {
        let bar = CountBar::new(count, "trees");
        let threads = match self.threads {
            Some(threads) => usize::from(threads),
            None => std::thread::available_parallelism().map_or(1, usize::from),
        };
        let grow_one = |number| self.grow_one(parent, number, is_stopped);
        let grown = in_parallel(count, threads, is_stopped, &grow_one, &|done| bar.set(done));
        grown.map_err(|undone| match undone {
            Undone::Stopped => CommandError::Stopped,
            Undone::Failed(e) => e.into(),
        })
    }

    fn grow_one(
        &self,
        parent: &Parent,
        number: u64,
        is_stopped: &AtomicBool,
    ) -> Result<(), PrepareError> {
        let tree = parent.offspring(self.seed, number)?;
        parent.write(&self.out.join(tree_name(number)), tree, is_stopped)
    }

    /// # Errors
    /// An option does not go with what is asked for.
    fn likeness(&self) -> Result<Likeness, CommandError> {
        let unfit = match self.like {
            Like::Dirichlet if self.threshold.is_some() => "--threshold goes with --like von-mises",
            Like::Dirichlet if self.from_level.is_some() => {
                "--from-level goes with --like von-mises"
            }
            Like::VonMises if self.envelope.is_some() => {
                "--envelope goes with --like dirichlet: von-mises keeps the example's branches"
            }
            Like::Dirichlet => return Ok(Likeness::Forks),
            Like::VonMises => {
                let default = Resampling::default();
                return Ok(Likeness::Branches(Resampling {
                    threshold: self.threshold.unwrap_or(default.threshold),
                    from_level: self.from_level.unwrap_or(default.from_level),
                }));
            }
        };
        Err(CommandError::BadUsage(anyhow!(unfit)))
    }

    /// What is asked for; else as the example where that moves, or in wind where its sway was measured.
    fn motion(&self, document: &Document) -> OffspringMotion {
        match self.motion {
            Some(HowToMove::Example) => OffspringMotion::Example,
            Some(HowToMove::Wind) => OffspringMotion::Wind,
            Some(HowToMove::None) => OffspringMotion::AtRest,
            None if document.has_motion() || !document.poses.is_empty() => OffspringMotion::Example,
            None if document.has_measured_sway() => {
                eprint_line(
                    "arborcam: note: the example has frequencies that were measured, and no film: the trees sway in \
                     wind with them; give --motion none for trees at rest",
                );
                OffspringMotion::Wind
            }
            None => {
                eprint_line(
                    "arborcam: note: the example has no motion, and the trees stand still; give \
                     --motion wind",
                );
                OffspringMotion::AtRest
            }
        }
    }

    /// The region of `--envelope` in the picture of the example.
    fn region(&self, document: &Document) -> Result<Option<Outline>, CommandError> {
        let Some(path) = &self.envelope else {
            return Ok(None);
        };
        let own = example_outline(document)?;
        let region = placed(path, own, document);
        region
            .map(Some)
            .with_context(|| format!("--envelope {}", path.display()))
            .map_err(CommandError::BadUsage)
    }
}

/// The shape in a file where it stands in the picture of the example.
fn placed(path: &Path, own: &Outline, document: &Document) -> anyhow::Result<Outline> {
    let placed = read_drawn(path)?.placed(own, document.skeleton.foot_px)?;
    Ok(outline::in_one_piece(&placed)?)
}

//! `arborcam photo PICTURE --out DIR`: a tree from one photograph.

use super::command_error::CommandError;
use super::example::Example;
use super::line::Lines;
use super::output::eprint_line;
use super::stop::Stop;
use crate::cancel::CancelToken;
use crate::config::Config;
use crate::files::{read_bounded, refuse_taken};
use crate::grow::{Library, SubtreeKind};
use crate::import::{Crown, read_crown, traced};
use crate::model::{Foot, FootBasis, Outline, Size};
use crate::outline::{self, OutlineError};
use crate::source::Photograph;
use crate::views::{PhotoDepth, PhotoGrowth, PhotoParts, PhotoTree, photo_defaults};
use crate::wood::{self, LeafColour, SeenInPhotograph, Stroke};
use anyhow::{Context, anyhow};
use clap::{Args, ValueEnum};
use nalgebra::Point2;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Largest photograph, and largest file of a stroke, that is read, bytes.
const LARGEST: u64 = 256_000_000;

/// Gaps between leaves up to this share of the photograph's width are closed; up to the second where one
/// piece then has nearly all.
const CLOSE_SHARE: f64 = 0.008;
const CLOSE_MOST: f64 = 0.06;
const NEARLY_ALL: f64 = 0.93;
/// Without a stroke the trunk is looked for up to this share of the tree's height, and has so many
/// rows at least.
const TRUNK_SHARE: f64 = 0.3;
const LEAST_TRUNK_ROWS: usize = 12;

#[derive(Debug, Args)]
pub struct PhotoArgs {
    /// The photograph (.png, .jpg, .bmp).
    picture: PathBuf,
    /// A closed line round the crown, in the pixels of the photograph: JSON (width, height,
    /// polygon_px), or SVG.
    #[arg(long, value_name = "FILE", value_parser = parse_crown)]
    crown: Option<Crown>,
    /// A line along a branch from its base to its tip, the trunk's first: JSON (width, height,
    /// polyline_px), or a drawing as for `sketch` (SVG, JSON). May be given several times.
    #[arg(long = "branch", value_name = "FILE", value_parser = Lines::read)]
    branches: Vec<Lines>,
    /// The colour by which leaves are known.
    #[arg(long, value_name = "COLOUR", default_value = "green")]
    foliage: Foliage,
    /// A tree whose branches those that are not seen are like, and whose sway the tree is given: a
    /// capture, or what else `grow` takes as an example.
    #[arg(long, value_name = "EXAMPLE")]
    like: Option<PathBuf>,
    /// Where branches grow on others, if the photograph shows too few to learn from.
    #[arg(long, value_name = "WHERE", default_value = "both")]
    subtrees: Subtrees,
    /// How the branches that are seen come into space.
    #[arg(long, value_name = "HOW", default_value = "push")]
    depth: Depth,
    /// Seed of the random numbers; the same seed gives the same tree.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u32,
    /// Settings that differ from the defaults (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Folder for the tree. It must not exist, and appears when it is complete.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Foliage {
    Green,
    Red,
    Yellow,
    White,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Subtrees {
    /// At the end of others (type I).
    AtEnd,
    /// Along others (type II).
    Along,
    Both,
}

impl From<Subtrees> for SubtreeKind {
    fn from(kind: Subtrees) -> Self {
        match kind {
            Subtrees::AtEnd => Self::AtEnd,
            Subtrees::Along => Self::Along,
            Subtrees::Both => Self::Both,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Depth {
    /// They fill the crown turned about its axis.
    Push,
    /// They lie as far apart as they can.
    Apart,
}

impl From<Depth> for PhotoDepth {
    fn from(depth: Depth) -> Self {
        match depth {
            Depth::Push => Self::Push,
            Depth::Apart => Self::Apart,
        }
    }
}

impl From<Foliage> for LeafColour {
    fn from(colour: Foliage) -> Self {
        match colour {
            Foliage::Green => Self::Green,
            Foliage::Red => Self::Red,
            Foliage::Yellow => Self::Yellow,
            Foliage::White => Self::White,
        }
    }
}

/// Parses `--crown`.
fn parse_crown(path: &str) -> Result<Crown, String> {
    let bytes = read_bounded(Path::new(path), LARGEST).map_err(|e| format!("{e}; give a file"))?;
    read_crown(&bytes).map_err(|e| e.to_string())
}

pub fn run(args: &PhotoArgs) -> Result<(), CommandError> {
    refuse_taken(&args.out)?;
    let stop = Stop::on_signals()?;
    let config = photo_defaults().layered(args.config.as_deref(), |config| {
        (config.wood.seed, config.wind.seed) = (args.seed, args.seed);
    })?;
    let photo = args.read_picture()?;
    let like = args.like()?;
    let drawn = args.drawn(&photo)?;
    let seen = args.seen(&photo, &drawn, &config)?;
    let mut tree = args.stood_up(&photo, &drawn, &seen, like.as_ref(), config)?;
    tree.tree.note.warnings.extend(drawn.found);
    let all = tree.tree.skeleton.measured_branches().count();
    let grown = tree.growth.branches;
    if stop.while_writing().load(Ordering::SeqCst) {
        return Err(CommandError::Stopped);
    }
    tree.write(&args.out)?;
    let shown = args.out.display();
    eprint_line(&format!(
        "{shown}: a tree of {all} branches: {} seen, {grown} grown",
        all - grown.min(all)
    ));
    Ok(())
}

/// What is looked for in the photograph.
struct Drawn {
    crown: Outline,
    /// The trunk's first.
    strokes: Vec<Stroke>,
    /// What was found without strokes, and how sure that is.
    found: Option<String>,
}

impl PhotoArgs {
    fn name(&self) -> std::path::Display<'_> {
        self.picture.display()
    }

    fn read_picture(&self) -> Result<Photograph, CommandError> {
        let bytes = read_bounded(&self.picture, LARGEST).map_err(|e| {
            CommandError::NoInput(anyhow!("cannot read {}: {e}; give another", self.name()))
        })?;
        Photograph::read(&bytes).map_err(|e| CommandError::Failed(anyhow!("{}: {e}", self.name())))
    }

    /// The tree of `--like`.
    fn like(&self) -> Result<Option<Example>, CommandError> {
        let Some(path) = &self.like else {
            return Ok(None);
        };
        let example = Example::read(path, None)?;
        if Library::like(&example.document.skeleton).is_none() {
            return Err(CommandError::BadUsage(anyhow!(
                "--like {}: it has no branches that bear others; give another tree",
                path.display()
            )));
        }
        Ok(Some(example))
    }

    /// The region within the crown stroke; `None` where none was drawn.
    fn crown(&self, photo: &Photograph) -> Result<Option<Outline>, CommandError> {
        let Some(crown) = &self.crown else {
            return Ok(None);
        };
        let scale = scale("--crown", crown.size, photo)?;
        let corners_px: Vec<Point2<f64>> = crown.corners_px.iter().map(|c| c * scale).collect();
        outline::from_polygon(&corners_px, photo.picture.size)
            .map(Some)
            .context("--crown")
            .map_err(CommandError::BadUsage)
    }

    /// The branch strokes, each from its lower end if it is the first.
    fn strokes(&self, photo: &Photograph) -> Result<Vec<Stroke>, CommandError> {
        let mut strokes: Vec<Stroke> = Vec::new();
        for line in self.branches.iter().flat_map(|lines| &lines.0) {
            let scale = scale("--branch", line.size(), photo)?;
            let stroke: Stroke = line
                .polyline_px
                .iter()
                .map(|p| Point2::from(*p) * scale)
                .collect();
            if let Some(off) = stroke.iter().find(|at| !photo.picture.size.contains(**at)) {
                let at = off / scale;
                return Err(CommandError::BadUsage(anyhow!(
                    "--branch: ({:.0}, {:.0}) lies outside the photograph; draw it on the tree",
                    at.x,
                    at.y
                )));
            }
            strokes.push(stroke);
        }
        if let Some([first, .., last]) = strokes.first_mut().map(|s| &mut s[..])
            && first.y < last.y
        {
            strokes[0].reverse();
        }
        Ok(strokes)
    }

    /// The strokes; for those that were not drawn what stands in the middle of the photograph, and its
    /// trunk.
    fn drawn(&self, photo: &Photograph) -> Result<Drawn, CommandError> {
        let crown = self.crown(photo)?;
        let strokes = self.strokes(photo)?;
        if let (Some(crown), false) = (&crown, strokes.is_empty()) {
            return Ok(Drawn {
                crown: crown.clone(),
                strokes,
                found: None,
            });
        }
        let middle = outline::in_middle(&photo.picture).map_err(CommandError::failed)?;
        let middle = middle.ok_or_else(|| self.no_tree())?;
        let mut outlines = middle.outlines.into_iter();
        let with_trunk = outlines.find_map(|outline| Some((trunk_of(&outline)?, outline)));
        let (trunk, outline) = with_trunk.ok_or_else(|| self.no_tree())?;
        let strokes = match strokes.is_empty() {
            true => vec![trunk],
            false => strokes,
        };
        let agreement = 100.0 * middle.agreement;
        let found = format!(
            "the tree was found without strokes: two attempts agree by {agreement:.0} %; if it is \
             wrong, draw --crown and --branch"
        );
        eprint_line(&format!("arborcam: note: {found}"));
        Ok(Drawn {
            crown: crown.unwrap_or(outline),
            strokes,
            found: Some(found),
        })
    }

    fn no_tree(&self) -> CommandError {
        CommandError::Failed(anyhow!(
            "{}: no tree with a trunk is found in its middle; draw --crown and --branch",
            self.name()
        ))
    }

    fn seen(
        &self,
        photo: &Photograph,
        drawn: &Drawn,
        config: &Config,
    ) -> Result<SeenInPhotograph, CommandError> {
        let view = wood::Photograph {
            picture: &photo.picture,
            crown: &drawn.crown,
            strokes: &drawn.strokes,
            leaf_colour: self.foliage.into(),
            trace_by: config.skeleton.trace_by,
        };
        let seen = wood::in_photograph(view, &CancelToken::new());
        let seen = seen.map_err(CommandError::failed)?.ok_or_else(|| {
            CommandError::Failed(anyhow!(
                "{}: no wood is seen that leads to the foot of the trunk; draw the trunk with --branch",
                self.name()
            ))
        })?;
        let branches = &seen.wood.branches;
        let is_met = |at: &Point2<f64>| branches.piece_at(*at, photo.picture.size).is_some();
        match drawn.strokes.iter().position(|s| !s.iter().any(is_met)) {
            Some(apart) => Err(CommandError::BadUsage(anyhow!(
                "--branch: stroke {} meets no wood that leads to the trunk; draw it from the branch \
                 that carries it",
                apart + 1
            ))),
            None => Ok(seen),
        }
    }

    fn stood_up(
        &self,
        photo: &Photograph,
        drawn: &Drawn,
        seen: &SeenInPhotograph,
        like: Option<&Example>,
        config: Config,
    ) -> Result<PhotoTree, CommandError> {
        let of_file = |e: anyhow::Error| CommandError::Failed(e.context(self.name().to_string()));
        let corners = drawn.crown.polygon_px.iter();
        let crown_px: Vec<Point2<f64>> = corners.map(|c| c.map(f64::from)).collect();
        let size = photo.picture.size;
        let flat = traced(&seen.wood.branches, size, &crown_px).map_err(|e| of_file(e.into()))?;
        let region = match seen.in_leaf {
            true => closed(size, &seen.tree),
            false => outline::covered(&flat.cover_px(), size),
        };
        let region = region.map_err(|e| of_file(e.into()))?;
        let name = self
            .picture
            .file_name()
            .unwrap_or_default()
            .to_string_lossy();
        let parts = PhotoParts {
            picture: &Arc::new(photo.picture.clone()),
            flat: &flat,
            region: &region,
            in_leaf: seen.in_leaf,
            wood: &seen.wood,
        };
        let growth = PhotoGrowth {
            subtrees: self.subtrees.into(),
            like: like.map(|example| &example.document),
            depth: self.depth.into(),
        };
        Ok(PhotoTree::new(name.into_owned(), parts, growth, config)?)
    }
}

/// The tree of a mask in one piece, its gaps closed as little as it takes to hold nearly all.
///
/// # Errors
/// The mask is empty.
fn closed(size: Size, tree: &[u8]) -> Result<Outline, OutlineError> {
    let all = tree.iter().filter(|m| **m != 0).count() as f64;
    let mut share = CLOSE_SHARE;
    loop {
        let close_px = share * f64::from(size.width);
        let found = outline::closed(size, tree, close_px.round() as u32)?;
        let held = tree.iter().zip(&found.mask).filter(|(m, f)| **m & **f != 0);
        if held.count() as f64 >= NEARLY_ALL * all || share >= CLOSE_MOST {
            return Ok(found);
        }
        share *= 2.0;
    }
}

/// A line along the trunk of the tree in an outline, from its foot up; `None` where it has none.
fn trunk_of(outline: &Outline) -> Option<Stroke> {
    let foot = Foot::of(outline, None);
    let rows = foot.trunk_rows(outline, TRUNK_SHARE);
    let places = rows.iter().map(|row| {
        let middle = 0.5 * f64::from(row.first + row.last);
        Point2::new(middle, f64::from(row.v))
    });
    let line: Stroke = places.collect();
    let is_seen = foot.basis != FootBasis::Guessed && line.len() >= LEAST_TRUNK_ROWS;
    is_seen.then_some(line)
}

/// By what the pixels of a stroke are to be multiplied that was drawn in a picture of the size
/// `drawn_in`.
///
/// # Errors
/// That is another picture.
fn scale(option: &str, drawn_in: Size, photo: &Photograph) -> Result<f64, CommandError> {
    let own = photo.picture.size;
    if drawn_in == own {
        return Ok(1.0);
    }
    if drawn_in == photo.full_size {
        return Ok(f64::from(own.width) / f64::from(drawn_in.width));
    }
    Err(CommandError::BadUsage(anyhow!(
        "{option} is for a picture of {drawn_in}, this one is {}; draw it on this one",
        photo.full_size
    )))
}

//! `arborcam photo PICTURE --out DIR`: trees from one photograph, or from one frame of a film.

mod draw;
mod drawn;
mod kept;
mod picture;

use super::command_error::CommandError;
use super::common::parse_within;
use super::example::Example;
use super::forest::{megabytes, told_of};
use super::grow::tree_name;
use super::output::eprint_line;
use super::stop::Stop;
use crate::cancel::CancelToken;
use crate::export::gltf::NamedBytes;
use crate::files::{check_place, write_folder};
use crate::grow::SubtreeKind;
use crate::pipeline::{PhotoError, PhotoOptions, TreeInPhoto, see_tree};
use crate::runtime::AtOnce;
use crate::views::{
    Attracting, ForestPlan, PhotoDepth, PhotoExample, PhotoGrowth, PhotoParts, PhotoTree,
    PhotoTreeError, ReadyDocument, StandingPlaces, photo_defaults, photo_forest,
};
use crate::wood::{LeafColour, LeafHint};
use anyhow::anyhow;
use clap::{Args, ValueEnum};
use drawn::{DrawnTree, StrokeFiles};
use nalgebra::Point2;
use picture::{PictureArgs, ShownPicture};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

#[derive(Debug, Args)]
pub struct PhotoArgs {
    #[command(flatten)]
    picture: PictureArgs,
    #[command(flatten)]
    strokes: StrokeFiles,
    /// Draw crown and branches on the picture in the terminal, and see what is found after every
    /// stroke; what is given by files is there already. What is drawn is kept as DIR-strokes-1.json and
    /// so on, which --tree takes again.
    #[arg(long)]
    draw: bool,
    /// The colour by which leaves are known, or that the tree is bare: then none are looked for. A crown
    /// without leaves of a colour that is given is an error; if nothing is given they are green, and a tree
    /// without them is bare.
    #[arg(long, value_name = "COLOUR")]
    foliage: Option<Foliage>,
    /// A tree whose branches those that are not seen are like, and whose sway the tree is given: a
    /// capture, or what else `grow` takes as an example.
    #[arg(long, value_name = "EXAMPLE")]
    like: Option<PathBuf>,
    /// Where branches grow on others, if the photograph shows too few to learn from; or that none are made up.
    #[arg(long, value_name = "WHERE", default_value = "both")]
    subtrees: Subtrees,
    /// How the branches that are seen come into space.
    #[arg(long, value_name = "HOW", default_value = "push")]
    depth: Depth,
    /// What draws the branches that are grown: the leaves in the picture alone, or in turns with what
    /// makes the tree as deep as it is wide.
    #[arg(long, value_name = "WHERE", default_value = "space")]
    attractors: Attractors,
    /// The row of the horizon, px of the photograph, by which trees that stand farther away are
    /// larger than they look; of several trees only. By default the middle row.
    #[arg(long, value_name = "ROW", value_parser = parse_row, allow_negative_numbers = true)]
    horizon: Option<f64>,
    /// Seed of the random numbers; the same seed gives the same tree.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u32,
    /// Settings that differ from the defaults (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Folder for the tree, or for several trees and their scene. It must not exist, and appears when
    /// it is complete.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Foliage {
    Green,
    Red,
    Yellow,
    White,
    /// There are no leaves.
    Bare,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Subtrees {
    /// At the end of others (type I).
    AtEnd,
    /// Along others (type II).
    Along,
    Both,
    /// Nowhere: the tree has only the branches that are seen.
    None,
}

impl Subtrees {
    /// `None` where nothing is to grow.
    fn kind(self) -> Option<SubtreeKind> {
        match self {
            Self::AtEnd => Some(SubtreeKind::AtEnd),
            Self::Along => Some(SubtreeKind::Along),
            Self::Both => Some(SubtreeKind::Both),
            Self::None => None,
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

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Attractors {
    /// In the picture and in space.
    Space,
    /// In the picture alone.
    Picture,
}

impl From<Attractors> for Attracting {
    fn from(attractors: Attractors) -> Self {
        match attractors {
            Attractors::Space => Self::Space,
            Attractors::Picture => Self::Picture,
        }
    }
}

impl From<Depth> for PhotoDepth {
    fn from(depth: Depth) -> Self {
        match depth {
            Depth::Push => Self::Push,
            Depth::Apart => Self::Apart,
        }
    }
}

impl From<Foliage> for LeafHint {
    fn from(colour: Foliage) -> Self {
        match colour {
            Foliage::Green => Self::Of(LeafColour::Green),
            Foliage::Red => Self::Of(LeafColour::Red),
            Foliage::Yellow => Self::Of(LeafColour::Yellow),
            Foliage::White => Self::Of(LeafColour::White),
            Foliage::Bare => Self::Bare,
        }
    }
}

pub fn run(args: &PhotoArgs) -> Result<(), CommandError> {
    check_place(&args.out)?;
    let config = photo_defaults().layered(args.config.as_deref(), |config| {
        (config.wood.seed, config.wind.seed) = (args.seed, args.seed);
    })?;
    let shown = args.picture.read(&config.camera)?;
    if let Some(warning) = shown.warning() {
        eprint_line(&format!("arborcam: warning: {}: {warning}", shown.name));
    }
    let mut drawn = args.strokes.on(&shown)?;
    let options = PhotoOptions {
        leaves: args.foliage.map_or(LeafHint::Unknown, LeafHint::from),
        trace_by: config.skeleton.trace_by,
    };
    if args.draw {
        drawn = draw::on_screen(&shown, drawn, options, &args.out)?;
    }
    if args.horizon.is_some() && drawn.len() < 2 {
        return Err(CommandError::BadUsage(anyhow!(
            "--horizon is for several trees; draw each with its own --tree"
        )));
    }
    let stop = Stop::on_signals()?;
    let like = args.like()?;
    let seen = seen(&shown, &drawn, options)?;
    if !args.draw {
        refuse_unlikely(&shown, &seen, &drawn)?;
    }
    print_doubts(&shown, &seen, &drawn);
    let growth = PhotoGrowth {
        subtrees: args.subtrees.kind(),
        like: like.as_ref(),
        depth: args.depth.into(),
        attractors: args.attractors.into(),
    };
    let mut trees = Vec::with_capacity(seen.len());
    for (tree, own) in seen.iter().zip(&drawn) {
        let parts = PhotoParts {
            name: &shown.name,
            picture: &shown.picture,
            tree,
        };
        let new = PhotoTree::new(parts, growth, config.clone());
        let mut new = new.map_err(|e| failure(&shown, own, e))?;
        new.tree.note.warnings.extend(shown.warning());
        new.tree.note.warnings.extend(found_note(tree, own));
        new.tree.note.warnings.extend(warnings_of(tree));
        trees.push(new);
    }
    let forest = match trees.len() {
        1 => None,
        _ => Some(args.forest(&shown, &trees)?),
    };
    let trees: Result<Vec<ReadyTree>, CommandError> =
        trees.into_iter().map(ReadyTree::of).collect();
    let folder = ReadyFolder::of(&args.out, trees?, forest)?;
    folder.write(&args.out, stop.while_writing())
}

/// Parses a row of the photograph, px; the horizon may lie above the picture.
fn parse_row(text: &str) -> Result<f64, String> {
    parse_within(text, -1e5..=1e5, "give a row of the photograph, px")
}

impl PhotoArgs {
    /// The tree of `--like`.
    fn like(&self) -> Result<Option<PhotoExample>, CommandError> {
        let Some(path) = &self.like else {
            return Ok(None);
        };
        let example = PhotoExample::of(Example::read(path, None)?.document);
        example.map(Some).ok_or_else(|| {
            CommandError::BadUsage(anyhow!(
                "--like {}: it has no branches that bear others; give another tree",
                path.display()
            ))
        })
    }

    /// Where several trees stand in one scene.
    fn forest(
        &self,
        shown: &ShownPicture,
        trees: &[PhotoTree],
    ) -> Result<ForestPlan, CommandError> {
        let feet = trees.iter().map(|tree| tree.tree.skeleton.foot_px);
        let feet_px: Vec<Point2<f64>> = feet.collect();
        let horizon_px = self.horizon.map(|row| row * shown.scale());
        let size = shown.picture.rgb.size;
        let places = StandingPlaces::of(&feet_px, size, horizon_px).ok_or_else(|| {
            CommandError::BadUsage(anyhow!(
                "--horizon: the foot of a tree is not below that row; give a row above all feet"
            ))
        })?;
        if horizon_px.is_none() {
            eprint_line(
                "arborcam: note: the horizon is not known, and taken for the picture's middle row, or just above the \
                 feet; how far and how large the trees are hangs on it: give --horizon",
            );
        }
        Ok(photo_forest(&shown.name, trees, &places, tree_name))
    }
}

/// What the photograph shows of every tree that is drawn on it.
fn seen(
    shown: &ShownPicture,
    drawn: &[DrawnTree],
    options: PhotoOptions,
) -> Result<Vec<TreeInPhoto>, CommandError> {
    let mut seen = Vec::with_capacity(drawn.len());
    for own in drawn {
        let tree = see_tree(
            &shown.picture.rgb,
            &own.strokes,
            options,
            &AtOnce,
            &CancelToken::new(),
        );
        seen.push(tree.map_err(|e| failure(shown, own, e.into()))?);
    }
    Ok(seen)
}

/// Says what is doubtful of every tree.
fn print_doubts(shown: &ShownPicture, seen: &[TreeInPhoto], drawn: &[DrawnTree]) {
    for (tree, own) in seen.iter().zip(drawn) {
        if let Some(note) = found_note(tree, own) {
            eprint_line(&format!("arborcam: note: {note}"));
        }
        for warning in warnings_of(tree) {
            eprint_line(&format!("arborcam: warning: {}: {warning}", shown.name));
        }
    }
}

/// Refuses a tree that was found without strokes and is more likely wrong than right, unless the user has seen
/// and accepted it.
fn refuse_unlikely(
    shown: &ShownPicture,
    seen: &[TreeInPhoto],
    drawn: &[DrawnTree],
) -> Result<(), CommandError> {
    for (tree, own) in seen.iter().zip(drawn) {
        if let Some(found) = tree.found.filter(|found| !found.is_likely()) {
            let missing = Missing::of(own);
            return Err(CommandError::Failed(anyhow!(
                "{}: {} is found without a stroke, but is right with a chance of {:.0} % only{}; draw with {}, or \
                 on the screen with --draw",
                shown.name,
                missing.what(),
                100.0 * found.chance(),
                if tree.has_colour {
                    ""
                } else {
                    ", for the picture is grey"
                },
                missing.options(),
            )));
        }
    }
    Ok(())
}

/// What was not drawn of a tree.
#[derive(Clone, Copy, Debug)]
enum Missing {
    Both,
    Crown,
    Trunk,
}

impl Missing {
    /// Of a tree of which not all is drawn.
    fn of(drawn: &DrawnTree) -> Self {
        let strokes = &drawn.strokes;
        match (strokes.crown_px.is_empty(), strokes.branches_px.is_empty()) {
            (true, true) => Self::Both,
            (true, false) => Self::Crown,
            (false, _) => Self::Trunk,
        }
    }

    fn what(self) -> &'static str {
        match self {
            Self::Both => "the tree",
            Self::Crown => "the crown",
            Self::Trunk => "the trunk",
        }
    }

    fn options(self) -> &'static str {
        match self {
            Self::Both => "--crown and --branch",
            Self::Crown => "--crown",
            Self::Trunk => "--branch",
        }
    }
}

/// What is said of what was found without a stroke, and how sure that is.
fn found_note(tree: &TreeInPhoto, drawn: &DrawnTree) -> Option<String> {
    let found = tree.found?;
    let missing = Missing::of(drawn);
    Some(format!(
        "{} was found without a stroke, and is right with a chance of {:.0} %; look at it, and if it is wrong, \
         draw with {}, or on the screen with --draw",
        missing.what(),
        100.0 * found.chance(),
        missing.options(),
    ))
}

/// What is doubtful of a tree.
fn warnings_of(tree: &TreeInPhoto) -> Vec<String> {
    let mut warnings = Vec::new();
    if !tree.has_colour && !tree.is_said_bare {
        warnings.push(
            "the photograph has no colours, by which leaves are known: the tree is taken to be bare"
                .to_owned(),
        );
    }
    if let Some(colour) = tree.seen.other_leaves {
        let colour = colour.name();
        let sought = match tree.is_said_bare {
            true => "not looked for",
            false => "looked for in another colour",
        };
        warnings.push(format!(
            "half of the crown is {colour}, and leaves were {sought}: if these are leaves, give --foliage {colour}"
        ));
    }
    if tree.seen.is_as_around {
        warnings.push(
            "the leaves have the colours of what is around the crown: look whether its stroke is round the \
             tree, and not on a lawn or a hedge"
                .to_owned(),
        );
    }
    if let Some(level) = tree.seen.walls_share() {
        warnings.push(format!(
            "{:.0} % of the branches run level, as edges of buildings do and branches seldom: look whether a wall \
             is among them",
            100.0 * level
        ));
    }
    for index in &tree.seen.doubtful {
        warnings.push(format!(
            "along stroke {} hardly anything is seen that differs from what is at both its sides: it is a \
             branch by its drawing alone; look whether it is on its wood",
            index + 1
        ));
    }
    warnings
}

/// The error of a tree that is drawn so: of the file with its strokes, or else of the photograph.
fn failure(shown: &ShownPicture, drawn: &DrawnTree, e: PhotoTreeError) -> CommandError {
    let e = match e {
        PhotoTreeError::Photo(e) => e,
        PhotoTreeError::Prepare(e) => return e.into(),
    };
    let place = drawn.file_of(&e).unwrap_or(&shown.name);
    match e {
        PhotoError::Cancelled => CommandError::Stopped,
        e if e.is_of_strokes() => CommandError::BadUsage(anyhow!("{place}: {e}")),
        e if e.is_of_picture() => CommandError::Failed(anyhow!(
            "{place}: {e} (--draw, or --crown and --branch; --tree for each of several trees)"
        )),
        e => CommandError::Failed(anyhow!("{place}: {e}")),
    }
}

/// A tree all of whose files are made, and of what it is made.
struct ReadyTree {
    document: ReadyDocument,
    told: String,
}

impl ReadyTree {
    fn of(tree: PhotoTree) -> Result<Self, CommandError> {
        let all = tree.tree.skeleton.measured_branches().count();
        let grown = tree.growth.branches;
        Ok(Self {
            document: tree.ready()?,
            told: format!(
                "a tree of {all} branches: {} seen, {grown} grown",
                all - grown.min(all)
            ),
        })
    }
}

/// A folder all of whose files are made, and what is said of it once it is there.
#[derive(Default)]
struct ReadyFolder {
    files: Vec<NamedBytes>,
    lines: Vec<String>,
}

impl ReadyFolder {
    /// One tree, which is the folder `out`; or several in folders of their own, and their scene.
    fn of(
        out: &Path,
        trees: Vec<ReadyTree>,
        forest: Option<ForestPlan>,
    ) -> Result<Self, CommandError> {
        let mut folder = Self::default();
        let Some(forest) = forest else {
            for tree in trees {
                folder.lines.push(said_of(out, &tree.told));
                folder.files.extend(tree.document.files);
            }
            return Ok(folder);
        };
        let mut templates = Vec::with_capacity(trees.len());
        for (number, tree) in (1..).zip(trees) {
            let name = tree_name(number);
            folder.lines.push(said_of(&out.join(&name), &tree.told));
            let files = tree.document.files.into_iter();
            let files = files.map(|(file, bytes)| (format!("{name}/{file}"), bytes));
            folder.files.extend(files);
            templates.push(tree.document.tree);
        }
        let told = told_of(&forest);
        let scene = forest.files_of(out, templates)?;
        let told = format!("{told}, {:.1} MB", megabytes(&scene));
        folder.lines.push(said_of(out, &told));
        folder.files.extend(scene);
        Ok(folder)
    }

    /// Writes it whole or not at all.
    fn write(&self, out: &Path, is_stopped: &AtomicBool) -> Result<(), CommandError> {
        write_folder(out, &self.files, is_stopped)?;
        self.lines.iter().for_each(|line| eprint_line(line));
        Ok(())
    }
}

fn said_of(dir: &Path, told: &str) -> String {
    format!("{}: {told}", dir.display())
}

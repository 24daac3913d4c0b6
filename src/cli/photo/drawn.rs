//! The strokes of `arborcam photo` that are given as files.

use super::picture::ShownPicture;
use crate::cli::command_error::CommandError;
use crate::cli::line::of_another_picture;
use crate::files::read_bounded;
use crate::import::{ImportError, Sketch, Stroke, read_strokes};
use crate::model::{TreeStrokes, scaled};
use crate::pipeline::{DrawnPart, PhotoError};
use anyhow::anyhow;
use clap::Args;
use nalgebra::Point2;
use std::path::Path;

/// Largest file of strokes that is read, bytes.
const LARGEST: u64 = 64_000_000;
/// Trees whose feet are nearer to each other than this are one, px: no two trunks stand on each other.
const SAME_FOOT_PX: f64 = 1.0;

#[derive(Debug, Args)]
pub struct StrokeFiles {
    /// A closed line round the crown, in the pixels of the photograph: JSON (width, height,
    /// polygon_px), or SVG.
    #[arg(long, value_name = "FILE", value_parser = StrokeFile::parse)]
    crown: Option<StrokeFile>,
    /// A line along a branch from its base to its tip, the trunk's first: JSON (width, height,
    /// polyline_px), or a drawing as for `sketch` (SVG, JSON). May be given several times.
    #[arg(long = "branch", value_name = "FILE", value_parser = StrokeFile::parse)]
    branches: Vec<StrokeFile>,
    /// Crown and strokes of one tree in one drawing as for `sketch` (SVG with a line marked `crown`,
    /// JSON with polygon_px). Given several times: several trees, which come into one scene.
    #[arg(
        long = "tree",
        value_name = "FILE",
        value_parser = StrokeFile::parse,
        conflicts_with_all = ["crown", "branches"]
    )]
    trees: Vec<StrokeFile>,
}

/// What a file holds.
#[derive(Clone, Debug)]
struct StrokeFile {
    name: String,
    sketch: Sketch,
    /// An SVG drawing has no pixels of its own: it is as large as what it is drawn on.
    is_svg: bool,
}

/// The strokes of one tree, px of the picture that is worked on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DrawnTree {
    pub strokes: TreeStrokes,
    /// The files that they are from; none of what was drawn on the screen.
    pub crown_file: Option<String>,
    /// By branch stroke.
    pub branch_files: Vec<String>,
}

impl DrawnTree {
    /// The lower end of its trunk's stroke; `None` where none is drawn.
    fn foot_px(&self) -> Option<Point2<f64>> {
        let [first, .., last] = self.strokes.branches_px.first()?.as_slice() else {
            return None;
        };
        Some(if first.y < last.y { *last } else { *first })
    }

    /// Whether it stands where another one does.
    fn stands_on(&self, other: &Self) -> bool {
        let feet_px = self.foot_px().zip(other.foot_px());
        feet_px.is_some_and(|(a, b)| (a - b).norm() < SAME_FOOT_PX)
    }

    /// The file with what an error is about; `None` if that is the photograph.
    pub fn file_of(&self, e: &PhotoError) -> Option<&String> {
        match e.at_fault()? {
            DrawnPart::Crown => self.crown_file.as_ref(),
            DrawnPart::Branch(number) => self.branch_files.get(number.checked_sub(1)?),
        }
    }
}

impl StrokeFile {
    fn parse(path: &str) -> Result<Self, String> {
        let bytes =
            read_bounded(Path::new(path), LARGEST).map_err(|e| format!("{e}; give a file"))?;
        let sketch = read_strokes(&bytes).map_err(|e| e.to_string())?;
        match sketch.strokes.is_empty() && sketch.crown_px.is_empty() {
            true => Err(ImportError::NoStrokes.to_string()),
            false => Ok(Self {
                name: path.to_owned(),
                sketch,
                is_svg: bytes.trim_ascii_start().starts_with(b"<"),
            }),
        }
    }

    /// By what its pixels are to be multiplied, which may be those of the photograph before it was
    /// reduced.
    fn scale(&self, option: &str, shown: &ShownPicture) -> Result<f64, CommandError> {
        if self.sketch.size == shown.picture.rgb.size {
            return Ok(1.0);
        }
        if self.sketch.size == shown.full_size {
            return Ok(shown.scale());
        }
        let [drawn, own] = [self.sketch.size, shown.picture.rgb.size];
        let scale = f64::from(own.width) / f64::from(drawn.width);
        // Sides of a page are rounded to pixels.
        let off_px = f64::from(drawn.height) - f64::from(own.height) / scale;
        if self.is_svg && off_px.abs() <= 1.0 + 1.0 / scale {
            return Ok(scale);
        }
        Err(of_another_picture(
            &format!("{option} {}", self.name),
            self.sketch.size,
            shown.full_size,
        ))
    }
}

impl StrokeFiles {
    /// What is drawn on a photograph: one tree at least, though maybe without a stroke.
    ///
    /// # Errors
    /// A file is for another picture, or of several trees one has no crown or no stroke, or two are the same.
    pub fn on(&self, shown: &ShownPicture) -> Result<Vec<DrawnTree>, CommandError> {
        if self.trees.is_empty() {
            return Ok(vec![self.single(shown)?]);
        }
        let mut trees: Vec<DrawnTree> = Vec::with_capacity(self.trees.len());
        for file in &self.trees {
            let strokes = TreeStrokes {
                crown_px: file.sketch.crown_px.clone(),
                branches_px: file.sketch.lines_px(),
            };
            let is_whole = !strokes.crown_px.is_empty() && !strokes.branches_px.is_empty();
            if self.trees.len() > 1 && !is_whole {
                return Err(CommandError::BadUsage(anyhow!(
                    "--tree {}: each of several trees needs a crown and a stroke along its trunk; draw both",
                    file.name
                )));
            }
            let tree = DrawnTree {
                crown_file: Some(file.name.clone()),
                branch_files: vec![file.name.clone(); strokes.branches_px.len()],
                strokes: strokes.scaled(file.scale("--tree", shown)?),
            };
            if let Some(number) = trees.iter().position(|other| tree.stands_on(other)) {
                return Err(CommandError::BadUsage(anyhow!(
                    "--tree {}: it is the tree of --tree {} once more, for both trunks have one foot; give each \
                     tree once",
                    file.name,
                    self.trees[number].name
                )));
            }
            trees.push(tree);
        }
        Ok(trees)
    }

    /// What `--crown` and `--branch` give.
    fn single(&self, shown: &ShownPicture) -> Result<DrawnTree, CommandError> {
        let mut tree = DrawnTree::default();
        if let Some(file) = &self.crown {
            let crown_px = file.sketch.clone().only_crown_px();
            let crown_px = crown_px
                .map_err(|e| CommandError::BadUsage(anyhow!("--crown {}: {e}", file.name)))?;
            let scale = file.scale("--crown", shown)?;
            tree.strokes.crown_px = scaled(&crown_px, scale);
            tree.crown_file = Some(file.name.clone());
        }
        for file in &self.branches {
            let scale = file.scale("--branch", shown)?;
            if file.sketch.strokes.is_empty() {
                return Err(CommandError::BadUsage(anyhow!(
                    "--branch {}: it holds a crown and no line along a branch; give it to --crown, and a \
                     line along the trunk here",
                    file.name
                )));
            }
            if file.sketch.strokes.iter().any(Stroke::is_closed) {
                return Err(CommandError::BadUsage(anyhow!(
                    "--branch {}: a line in it is closed, as one round a crown is; draw it along a branch, \
                     from its base to its tip",
                    file.name
                )));
            }
            for line in file.sketch.lines_px() {
                tree.strokes.branches_px.push(scaled(&line, scale));
                tree.branch_files.push(file.name.clone());
            }
        }
        Ok(tree)
    }
}

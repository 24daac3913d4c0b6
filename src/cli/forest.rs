//! Options of `arborcam grow --forest`, and what other commands do with a forest.

use super::command_error::CommandError;
use super::common::parse_within;
use super::grow::tree_name;
use super::output::eprint_line;
use super::unused;
use crate::document::MOST_GROUND_SAMPLES;
use crate::export::gltf::NamedBytes;
use crate::files::write_files;
use crate::model::Size;
use crate::views::{ForestOptions, ForestPlan, HeightMap, Parent};
use anyhow::anyhow;
use clap::Args;
use image::imageops::{FilterType, resize};
use image::{ImageReader, Limits};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Largest side of a height map, px.
const MOST_SIDE_PX: u32 = 16_384;

#[derive(Debug, Args)]
pub struct ForestArgs {
    /// Put the trees into one scene: they stand by chance and share templates, which are the new
    /// trees in the folder.
    #[arg(long)]
    forest: bool,
    /// Number of templates that the trees of the forest share.
    #[arg(
        long,
        value_name = "K",
        requires = "forest",
        default_value_t = 8,
        value_parser = clap::value_parser!(u64).range(1..=64)
    )]
    templates: u64,
    /// Least distance between two trunks, m; by default the width of the example.
    #[arg(long, value_name = "M", requires = "forest", value_parser = length)]
    spacing: Option<f64>,
    /// Width of the plot, m; by default as wide as the trees need.
    #[arg(long, value_name = "M", requires = "forest", value_parser = length)]
    size: Option<f64>,
    /// The heights of the ground as a grey picture, white highest; the plot has its shape.
    #[arg(long, value_name = "PICTURE", requires = "forest")]
    height_map: Option<PathBuf>,
    /// Height of white over black in the height map, m; by default a tenth of the plot's width.
    #[arg(long, value_name = "M", requires = "height_map", value_parser = relief)]
    relief: Option<f64>,
    /// Height of the example, m, where no scale is known; by default 10.
    #[arg(long, value_name = "M", requires = "forest", value_parser = length)]
    tree_height: Option<f64>,
}

/// Parses a length, m.
fn length(text: &str) -> Result<f64, String> {
    parse_within(
        text,
        1e-3..=1e6,
        "give a number of metres from 0.001 to 1000000",
    )
}

/// Parses `--relief`, m.
fn relief(text: &str) -> Result<f64, String> {
    parse_within(text, 0.0..=1e5, "give a number of metres from 0 to 100000")
}

impl ForestArgs {
    /// The forest of `count` trees that is asked for; `None` where none is.
    ///
    /// # Errors
    /// The height map is no picture, or the trees have no room.
    pub fn plan(
        &self,
        parent: &Parent,
        count: u64,
        seed: u64,
    ) -> Result<Option<ForestPlan>, CommandError> {
        if !self.forest {
            return Ok(None);
        }
        if self.tree_height.is_some() && parent.metres_per_px() > 0.0 {
            unused::note("--tree-height", "the scale of the example is known");
        }
        let options = ForestOptions {
            count,
            templates: self.templates.min(count),
            spacing_m: self.spacing,
            width_m: self.size,
            heights: self.height_map.as_deref().map(read_heights).transpose()?,
            relief_m: self.relief,
            height_m: self.tree_height,
            seed,
        };
        Ok(Some(ForestPlan::new(parent, &options, tree_name)?))
    }
}

/// Reads a height map. A large one is made smaller.
fn read_heights(path: &Path) -> Result<HeightMap, CommandError> {
    heights(path).map_err(|e| {
        CommandError::BadUsage(anyhow!(
            "--height-map {} is no picture that can be read ({e}); give a PNG, JPEG or BMP in greys",
            path.display()
        ))
    })
}

fn heights(path: &Path) -> anyhow::Result<HeightMap> {
    let mut reader = ImageReader::open(path)?.with_guessed_format()?;
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MOST_SIDE_PX), Some(MOST_SIDE_PX));
    reader.limits(limits);
    let grey = reader.decode()?.into_luma16();
    let picture = Size::new(grey.width(), grey.height());
    if picture.area() == 0 {
        return Err(anyhow!("it has no pixels"));
    }
    let [columns, rows] = [picture.width, picture.height].map(|n| n.min(MOST_GROUND_SAMPLES));
    let samples = match (columns, rows) == (picture.width, picture.height) {
        true => grey,
        false => resize(&grey, columns, rows, FilterType::Triangle),
    };
    Ok(HeightMap {
        samples: Size::new(columns, rows),
        heights: samples.into_raw(),
        picture,
    })
}

/// Writes the files of a forest beside its templates in `dir`, all or none.
pub fn write_forest(
    forest: ForestPlan,
    dir: &Path,
    is_stopped: &AtomicBool,
) -> Result<(), CommandError> {
    let told = told_of(&forest);
    let files = forest.files(dir)?;
    write_files(dir, &files, is_stopped)?;
    let size_mb = megabytes(&files);
    eprint_line(&format!("{}: {told}, {size_mb:.1} MB", dir.display()));
    Ok(())
}

/// What is said of a forest.
pub fn told_of(forest: &ForestPlan) -> String {
    let ground = &forest.forest.ground;
    format!(
        "a forest of {} trees of {} templates on {:.1} m x {:.1} m",
        forest.forest.trees.len(),
        forest.origin.templates.len(),
        ground.width_m,
        ground.depth_m,
    )
}

/// Size of files.
pub fn megabytes(files: &[NamedBytes]) -> f64 {
    let bytes: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
    bytes as f64 / 1e6
}

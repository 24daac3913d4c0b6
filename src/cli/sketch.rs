//! `arborcam sketch STROKES --out DIR`: a tree of drawn strokes.

use super::command_error::CommandError;
use super::common::whole_setting;
use super::example::{read_drawing, stood_up};
use super::output::eprint_line;
use super::stop::Stop;
use crate::config::Config;
use crate::files::check_place;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct SketchArgs {
    /// The drawing: SVG with a path or line for each branch, drawn from its base to its tip, the
    /// trunk marked by the id, class or layer name `trunk`; or JSON (width, height, strokes with
    /// polyline_px and trunk).
    strokes: PathBuf,
    /// Folder for the tree. It must not exist, and appears when it is complete.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of planes about the trunk on which the branches are repeated, drawn one included.
    #[arg(long, value_name = "N", value_parser = whole_setting("shape.planes"))]
    planes: Option<u32>,
    /// Settings that differ from the defaults (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

pub fn run(args: &SketchArgs) -> Result<(), CommandError> {
    check_place(&args.out)?;
    let stop = Stop::on_signals()?;
    let config = Config::default().layered(args.config.as_deref(), |config| {
        if let Some(planes) = args.planes {
            config.shape.planes = planes;
        }
    })?;
    let flat = read_drawing(&args.strokes)?;
    let tree = stood_up(&args.strokes, &flat, config)?;
    let branches = tree.skeleton.measured_branches().count();
    tree.write(&args.out, stop.while_writing())?;
    let shown = args.out.display();
    let noun = if branches == 1 { "branch" } else { "branches" };
    eprint_line(&format!("{shown}: a tree of {branches} {noun}"));
    Ok(())
}

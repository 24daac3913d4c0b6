//! A table of cylinders or a treefile in place of points: the tree is there already.

use super::{CloudArgs, Scan, Unit, branches_said};
use crate::cli::command_error::CommandError;
use crate::cli::example::{read_file, say_what_is_lost, unfit};
use crate::cli::output::eprint_line;
use crate::cli::stop::Stop;
use crate::cli::unused;
use crate::cloud::check_height;
use crate::config::Config;
use crate::document::Document;
use crate::import::{CloudFormat, ModelTree, Units, is_wood_table, read_model};
use crate::model::{PointCloud, Skeleton, Swaying, Unidentified};
use crate::pipeline::as_scanned;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// A header is not longer, bytes.
const BEGIN: u64 = 65_536;

/// The tree in a table; `None` if the file is none.
///
/// # Errors
/// It is one, and cannot be read.
pub fn read(path: &Path) -> Result<Option<ModelTree>, CommandError> {
    if !matches!(CloudFormat::of_name(path), Ok(CloudFormat::Text) | Err(_)) {
        return Ok(None);
    }
    let mut begin = Vec::new();
    // What cannot be read is named by the reader of points.
    let read = File::open(path).and_then(|file| file.take(BEGIN).read_to_end(&mut begin));
    if read.is_err() || !is_wood_table(&String::from_utf8_lossy(&begin)) {
        return Ok(None);
    }
    let model = read_model(&read_file(path)?, path).map_err(|e| unfit(path, e))?;
    say_what_is_lost(path, &model.tree);
    Ok(Some(model.tree))
}

/// Writes the tree of a table, with the sway that the table holds or that of a film.
///
/// # Errors
/// A radius is missing, the film does not lie on it, or it cannot be written.
pub fn write(
    args: &CloudArgs,
    table: &ModelTree,
    film: Option<&Document>,
    config: Config,
    stop: &Stop,
) -> Result<(), CommandError> {
    for (is_given, option) in [
        (args.method.is_some(), "--method"),
        (args.points, "--points"),
        (args.in_leaf, "--in-leaf"),
        (args.tree.is_some(), "--tree"),
        (args.twig_radius_mm.is_some(), "--twig-radius-mm"),
    ] {
        if is_given {
            unused::note(option, "the file is a table of a tree, and no point cloud");
        }
    }
    if film.is_some() && table.nodes.iter().any(|node| node.wood.sway.is_some()) {
        eprint_line(
            "arborcam: note: the frequencies of the table are left out for those of the film",
        );
    }
    let metres = args.unit.map_or(1.0, Unit::metres);
    let tree = as_scanned(table, metres).map_err(|e| args.failed(e))?;
    check_height(tree.figures.height_m).map_err(|e| args.failed(e))?;
    let name = args.file.file_name().unwrap_or_default();
    let scan = Scan {
        name: name.to_string_lossy().into_owned(),
        cloud: PointCloud::default(),
        units: args
            .unit
            .map_or(Units::METRES, |unit| Units::all(unit.metres())),
        unit_is_known: args.unit.is_some(),
        unknown_system: None,
        config,
    };
    let mut drawn = scan.drawn(&tree).map_err(|e| args.failed(e))?;
    // Nothing was scanned here that could be judged.
    drawn.note.verdict = None;
    let branches = drawn.skeleton.botanical_branches().all.len();
    let is_stopped = stop.while_writing();
    match film {
        Some(capture) => {
            args.write_with_film(capture, &tree, &scan, drawn, is_stopped)?;
        }
        None => {
            let sway = sway_by_node(table, &drawn.skeleton);
            drawn.write_swaying(&args.out, &sway, is_stopped)?;
        }
    }
    scan.say_unit("the tree", tree.figures.height_m);
    eprint_line(&format!(
        "{}: a tree of {}, {:.2} m high",
        args.out.display(),
        branches_said(branches),
        tree.figures.height_m
    ));
    Ok(())
}

/// What the table says of the branch that ends in each node; bends have none of their own.
fn sway_by_node(table: &ModelTree, skeleton: &Skeleton) -> Vec<Swaying> {
    let mut sways = table.sways();
    for (sway, node) in sways.iter_mut().zip(&skeleton.nodes) {
        if node.moves_with.is_some() || node.parent.is_none() {
            *sway = Err(Unidentified::NotMeasured);
        }
    }
    sways
}

//! Trees that are not captures: drawings and modelled trees, and all that `grow` takes as an example.

use super::command_error::CommandError;
use super::output::eprint_line;
use crate::config::{Config, Wood};
use crate::document::Document;
use crate::files::read_bounded;
use crate::import::{
    FlatTree, ImportError, ModelTree, StandingModel, cover_px, joined, read_model, read_sketch,
};
use crate::model::{Outline, Size};
use crate::outline;
use crate::views::{DrawnTree, modelled_defaults};
use anyhow::{Context, anyhow};
use nalgebra::Point2;
use std::path::Path;

/// Largest drawing or model that is read, bytes.
const LARGEST: u64 = 256_000_000;

/// An example, and the settings for trees like it: its own, or others.
pub struct Example {
    pub document: Document,
    pub config: Config,
}

impl Example {
    /// Reads the folder of a tree, a drawing (`.svg`, `.json`), or a modelled tree. `settings` is a
    /// configuration file.
    ///
    /// # Errors
    /// It cannot be read or is no tree, or a setting is out of range.
    pub fn read(path: &Path, settings: Option<&Path>) -> Result<Self, CommandError> {
        if !path.is_file() {
            let note = Document::note(path)?;
            let mut own = note.config;
            if note.scan.is_some() {
                // A scan shows all bends of its branches; those of trees like it are not known.
                own.wood.curl = Wood::default().curl;
            }
            let config = own.layered(settings, |_| {})?;
            let document = Document::read(path, config.export.animation_s)?;
            return Ok(Self { document, config });
        }
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        let mut document = if ["svg", "json"].map(Some).contains(&ending.to_str()) {
            let config = Config::default().layered(settings, |_| {})?;
            let flat = read_drawing(path)?;
            stood_up(path, &flat, config)?.document(&[], Vec::new())?
        } else {
            modelled(path, settings)?
        };
        // It is in no folder, and the file holds no others.
        document.dir = path.to_owned();
        let config = document.note.config.clone();
        Ok(Self { document, config })
    }
}

/// The document of a modelled tree.
fn modelled(path: &Path, settings: Option<&Path>) -> Result<Document, CommandError> {
    let bytes = read_file(path)?;
    let model = read_model(&bytes, path).map_err(|e| unfit(path, e))?;
    say_what_is_lost(path, &model.tree);
    say_guessed_unit(path, &model.tree).map_err(|e| unfit(path, e))?;
    let standing = StandingModel::of(&model.tree).map_err(|e| unfit(path, e))?;
    let config = modelled_defaults(&standing).layered(settings, |_| {})?;
    let region = region(
        path,
        &cover_px(&standing.skeleton),
        standing.skeleton.image_size,
    )?;
    let tree = DrawnTree::modelled(short_name(path), &standing, &region, config);
    let mut poses = Vec::with_capacity(model.poses.len());
    for (frame, places) in (0_u64..).zip(&model.poses) {
        let time_s = frame as f64 * model.step_s;
        poses.push(standing.pose(&model.tree, places, frame, time_s));
    }
    Ok(tree.document(&standing.sway(&model.tree), poses)?)
}

/// Says how high a tree is of which only its height tells the unit.
fn say_guessed_unit(path: &Path, tree: &ModelTree) -> Result<(), ImportError> {
    if !tree.unit_is_guessed {
        return Ok(());
    }
    let height = tree.height()?;
    let said = match tree.metres_per_unit > 0.0 {
        true => format!(
            "note: {}: no unit in the file: taken as metres, the tree is {height:.1} m high",
            path.display()
        ),
        false => format!(
            "note: {}: no unit in the file, and in metres the tree would be {height:.0} m high: its size counts as not \
             known",
            path.display()
        ),
    };
    eprint_line(&format!("arborcam: {said}"));
    Ok(())
}

/// Says what of a modelled tree does not count.
pub fn say_what_is_lost(path: &Path, tree: &ModelTree) {
    let bare = tree.without_interval();
    if bare > 0 {
        eprint_line(&format!(
            "arborcam: warning: {}: the frequencies of {bare} pieces are left out: they are not above 0, not \
             within an interval (frequency_lo_hz, frequency_hi_hz), or such as no branch has",
            path.display()
        ));
    }
    let (thin, all) = (tree.without_radius(), tree.nodes.len() - 1);
    if thin > 0 && thin < all {
        eprint_line(&format!(
            "arborcam: warning: {}: {thin} of {all} pieces have no radius above 0, and no radius of it counts",
            path.display()
        ));
    }
    let apart = tree.begin_apart();
    if apart > 0 {
        eprint_line(&format!(
            "arborcam: warning: {}: {apart} of {all} pieces begin far from the one that they grow from, and are drawn \
             from its end; check their parents",
            path.display()
        ));
    }
    let made_up = tree.made_up();
    if made_up > 0 {
        eprint_line(&format!(
            "arborcam: note: {}: nobody has seen {made_up} of {all} pieces (copies, twigs, grown); the new tree does \
             not keep that mark",
            path.display()
        ));
    }
}

/// The flat tree in a drawing.
///
/// # Errors
/// The file cannot be read, or gives no tree.
pub fn read_drawing(path: &Path) -> Result<FlatTree, CommandError> {
    let bytes = read_file(path)?;
    let flat = read_sketch(&bytes).and_then(|sketch| joined(&sketch));
    let flat = flat.map_err(|e| unfit(path, e))?;
    if flat.trunk_px.is_empty() {
        eprint_line(
            "arborcam: note: no stroke is marked as the trunk, and the one with the lowest end is taken",
        );
    }
    Ok(flat)
}

/// The tree of a file in space.
///
/// # Errors
/// It encloses nothing, or has too many branches.
pub fn stood_up(path: &Path, flat: &FlatTree, config: Config) -> Result<DrawnTree, CommandError> {
    let region = region(path, &flat.cover_px(), flat.skeleton.image_size)?;
    Ok(DrawnTree::new(short_name(path), flat, &region, config)?)
}

/// What a tree of a file fills in its picture.
fn region(path: &Path, cover_px: &[Vec<Point2<f64>>], size: Size) -> Result<Outline, CommandError> {
    outline::covered(cover_px, size)
        .with_context(|| path.display().to_string())
        .map_err(CommandError::Failed)
}

fn short_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// The bytes of a drawing or a model.
///
/// # Errors
/// The file cannot be read, or is too large.
pub fn read_file(path: &Path) -> Result<Vec<u8>, CommandError> {
    read_bounded(path, LARGEST).map_err(|e| {
        CommandError::NoInput(anyhow!("cannot read {}: {e}; give another", path.display()))
    })
}

/// The error of a file that gives no tree.
pub fn unfit(path: &Path, e: ImportError) -> CommandError {
    CommandError::Failed(anyhow!("{}: {e}", path.display()))
}

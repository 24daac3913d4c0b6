//! How long it takes to look at a photograph after a stroke, of the folders of `made_photos.py` that
//! `ARBORCAM_PHOTOS` names (with `:` between them).

use crate::tracking::{median, timed_ms};
use arborcam::cancel::CancelToken;
use arborcam::config::TraceBy;
use arborcam::import::{Sketch, read_strokes};
use arborcam::model::TreeStrokes;
use arborcam::pipeline::{PhotoOptions, see_tree};
use arborcam::runtime::AtOnce;
use arborcam::source::Photograph;
use arborcam::wood::LeafHint;
use std::path::Path;

const REPEATS: usize = 5;

/// A line for each photograph.
pub fn table() -> Vec<String> {
    let folders = std::env::var("ARBORCAM_PHOTOS").unwrap_or_default();
    let folders: Vec<&str> = folders.split(':').filter(|f| !f.is_empty()).collect();
    if folders.is_empty() {
        return vec!["ARBORCAM_PHOTOS names no folder of made_photos.py; nothing measured".into()];
    }
    folders
        .iter()
        .map(|folder| line(Path::new(folder)))
        .collect()
}

fn line(folder: &Path) -> String {
    let photo = Photograph::read(&read(folder, "photo.jpg")).expect("a photograph");
    let drawn = TreeStrokes {
        crown_px: strokes(folder, "crown.json").crown_px,
        branches_px: strokes(folder, "trunk.json").lines_px(),
    };
    let options = PhotoOptions {
        leaves: LeafHint::Unknown,
        trace_by: TraceBy::Paths,
    };
    let look = || {
        see_tree(
            &photo.picture,
            &drawn,
            options,
            &AtOnce,
            &CancelToken::new(),
        )
        .expect("a tree")
    };
    let in_leaf = look().seen.in_leaf;
    let ms = median((0..REPEATS).map(|_| timed_ms(look).0).collect());
    let state = if in_leaf { "in leaf" } else { "bare" };
    let (name, size) = (folder.display(), photo.picture.size);
    format!(
        "{name}, {size}, {state}: leaves and branches {ms:.0} ms after a stroke (must be <= 500)"
    )
}

fn strokes(folder: &Path, name: &str) -> Sketch {
    read_strokes(&read(folder, name)).expect("strokes")
}

fn read(folder: &Path, name: &str) -> Vec<u8> {
    let path = folder.join(name);
    std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

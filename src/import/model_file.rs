//! Which file holds what kind of a modelled tree.

use super::error::ImportError;
use super::gltf_skeleton::{self, MovingModel};
use super::model_tree::ModelTree;
use super::wood_table::WoodTable;
use super::{cylinders, obj, ply, treefile};
use crate::files::is_named_film;
use std::borrow::Cow;
use std::path::Path;

/// A header is not longer, bytes.
const LONGEST_HEADER: usize = 65_536;

/// Reads a modelled tree in the `bytes` of the file at `path`, whose name says its format: `.glb` and
/// `.gltf`, `.obj`, `.ply`. A table of cylinders and a treefile are known by their first line, whatever
/// their name is. Files that a glTF refers to are read from beside it.
///
/// # Errors
/// It is of another format or damaged, or holds no skeleton that is a tree.
pub fn read_model(bytes: &[u8], path: &Path) -> Result<MovingModel, ImportError> {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(ImportError::bad_format("it is empty"));
    }
    let tree = match ending.to_str().unwrap_or_default() {
        "glb" | "gltf" => return gltf_skeleton::read(bytes, path),
        "obj" => ModelTree::of_edges(&obj::edges(&String::from_utf8_lossy(bytes))?)?,
        "ply" => ModelTree::of_edges(&ply::edges(bytes)?)?,
        ending => tree_of_table(bytes, path, ending)?.in_metres(),
    };
    Ok(MovingModel {
        tree,
        poses: Vec::new(),
        step_s: 0.0,
    })
}

/// The tree of a table of wood, whatever the file's ending is.
fn tree_of_table(bytes: &[u8], path: &Path, ending: &str) -> Result<ModelTree, ImportError> {
    let edges = match WoodTable::of(&begin_of(bytes)) {
        Some(WoodTable::Cylinders) => cylinders::edges(bytes)?,
        Some(WoodTable::Treefile) => treefile::edges(&String::from_utf8_lossy(bytes))?,
        None => return Err(no_table(bytes, path, ending)),
    };
    ModelTree::of_edges(&edges)
}

/// Why what is no table of wood and has this ending is not read.
fn no_table(bytes: &[u8], path: &Path, ending: &str) -> ImportError {
    // The reader of what the name says knows what is missing.
    let refused = match ending {
        "csv" => cylinders::edges(bytes).err(),
        "txt" => treefile::edges(&String::from_utf8_lossy(bytes)).err(),
        _ => None,
    };
    if let Some(refused) = refused {
        return refused;
    }
    if is_named_film(path) {
        return ImportError::unsupported(
            "it is a film",
            "make a tree of it with `arborcam replay`, and give that",
        );
    }
    ImportError::unsupported(
        "its name does not say what it is",
        "give a folder of a tree, or .svg, .json, .glb, .gltf, .obj, .ply, .csv or .txt",
    )
}

/// The text at the begin of a file, in which a header would be.
fn begin_of(bytes: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(&bytes[..bytes.len().min(LONGEST_HEADER)])
}

/// Whether the text at the begin of a file is that of a table of cylinders or of a treefile, and not of
/// points.
pub fn is_wood_table(begin: &str) -> bool {
    WoodTable::of(begin).is_some()
}

//! Which file holds what kind of a modelled tree.

use super::error::ImportError;
use super::gltf_skeleton::{self, MovingModel};
use super::model_tree::ModelTree;
use super::{cylinders, obj, ply, treefile};
use crate::files::is_named_film;
use std::path::Path;

/// Reads a modelled tree in the `bytes` of the file at `path`, whose name says its format: `.glb` and
/// `.gltf`, `.obj`, `.ply`, `.csv` for a table of cylinders, and `.txt` for a treefile. Files that a
/// glTF refers to are read from beside it.
///
/// # Errors
/// It is of another format or damaged, or holds no skeleton that is a tree.
pub fn read_model(bytes: &[u8], path: &Path) -> Result<MovingModel, ImportError> {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(ImportError::bad_format("it is empty"));
    }
    let edges = match ending.to_str().unwrap_or_default() {
        "glb" | "gltf" => return gltf_skeleton::read(bytes, path),
        "obj" => obj::edges(&String::from_utf8_lossy(bytes))?,
        "ply" => ply::edges(bytes)?,
        "csv" => cylinders::edges(bytes)?,
        "txt" => treefile::edges(&String::from_utf8_lossy(bytes))?,
        _ if is_named_film(path) => {
            return Err(ImportError::unsupported(
                "it is a film",
                "make a tree of it with `arborcam replay`, and give that",
            ));
        }
        _ => {
            return Err(ImportError::unsupported(
                "its name does not say what it is",
                "give a folder of a tree, or .svg, .json, .glb, .gltf, .obj, .ply, .csv or .txt",
            ));
        }
    };
    Ok(MovingModel {
        tree: ModelTree::of_edges(&edges)?,
        poses: Vec::new(),
        step_s: 0.0,
    })
}

/// Whether the text at the begin of a file is that of a table of cylinders or of a treefile, and not of
/// points.
pub fn is_wood_table(begin: &str) -> bool {
    let mut lines = begin.lines().filter(|line| !line.starts_with('#'));
    let header = lines.find(|line| !line.trim().is_empty()).unwrap_or("");
    header
        .split(',')
        .any(|name| ["parentID", "parent_ID", "parent_id"].contains(&name.trim()))
}

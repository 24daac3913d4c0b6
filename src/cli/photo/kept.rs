//! Strokes that were drawn on the screen, as files beside the tree: `--tree` takes each, and so do
//! `--crown` and `--branch`.

use crate::files::{OutputFile, WriteError, replace};
use crate::model::{Size, TreeStrokes};
use nalgebra::Point2;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// The files of one command.
pub struct KeptStrokes {
    /// Of the tree: the names of the files begin with it.
    out: PathBuf,
    /// Of the picture that was drawn on.
    size: Size,
    /// Of each tree, as far as it was kept before.
    files: Vec<PathBuf>,
}

impl KeptStrokes {
    /// Nothing is kept yet.
    pub fn beside(out: &Path, size: Size) -> Self {
        Self {
            out: out.to_owned(),
            size,
            files: Vec::new(),
        }
    }

    /// Keeps the strokes of these trees, and gives a file for each on which anything is drawn; files of
    /// before are replaced, those of other commands are not.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn keep(&mut self, trees: &[TreeStrokes]) -> Result<&[PathBuf], WriteError> {
        let stop = AtomicBool::new(false);
        let drawn: Vec<&TreeStrokes> = trees.iter().filter(|tree| !tree.is_empty()).collect();
        for (k, tree) in drawn.iter().enumerate() {
            let bytes = as_json(tree, self.size).to_string().into_bytes();
            match self.files.get(k) {
                Some(file) => replace(file, &bytes, &stop)?,
                None => {
                    let path = self.free_path();
                    let file = OutputFile::create(&path)?;
                    file.write(&bytes, &stop)?;
                    file.publish()?;
                    self.files.push(path);
                }
            }
        }
        Ok(&self.files[..drawn.len()])
    }

    /// The first path that nothing has.
    fn free_path(&self) -> PathBuf {
        let name = self.out.file_name().unwrap_or_default().to_string_lossy();
        let mut number = 1_u32;
        loop {
            let path = self
                .out
                .with_file_name(format!("{name}-strokes-{number}.json"));
            if !path.exists() {
                return path;
            }
            number += 1;
        }
    }
}

/// In the form that `import` reads as a drawing.
fn as_json(tree: &TreeStrokes, size: Size) -> Value {
    let strokes = tree.branches_px.iter().enumerate();
    let strokes: Vec<Value> = strokes
        .map(|(k, line)| json!({ "polyline_px": places(line), "trunk": k == 0 }))
        .collect();
    json!({
        "width": size.width,
        "height": size.height,
        "polygon_px": places(&tree.crown_px),
        "strokes": strokes,
    })
}

/// In hundredths of a pixel.
fn places(line: &[Point2<f64>]) -> Vec<[f64; 2]> {
    let places = line.iter();
    places
        .map(|at| [at.x, at.y].map(|x| (100.0 * x).round() / 100.0))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::read_strokes;

    #[test]
    fn kept_strokes_can_be_given_again_and_take_no_file_of_others() {
        let dir = tempfile::tempdir().expect("a folder");
        let out = dir.path().join("oak");
        let taken = dir.path().join("oak-strokes-1.json");
        std::fs::write(&taken, "of somebody").expect("written");
        let line = |ends: [[f64; 2]; 2]| ends.map(Point2::from).to_vec();
        let mut tree = TreeStrokes {
            crown_px: [[9.5, 9.0], [90.0, 9.0], [50.0, 60.25]]
                .map(Point2::from)
                .to_vec(),
            branches_px: vec![line([[50.0, 90.0], [50.0, 50.0]])],
        };
        let mut kept = KeptStrokes::beside(&out, Size::new(100, 100));
        let nothing = TreeStrokes::default();
        let files = kept
            .keep(&[tree.clone(), nothing])
            .expect("written")
            .to_vec();
        assert_eq!(files, [dir.path().join("oak-strokes-2.json")]);
        tree.branches_px.push(line([[50.0, 60.0], [70.0, 40.0]]));
        assert_eq!(
            kept.keep(std::slice::from_ref(&tree)).expect("written"),
            files
        );
        let sketch = read_strokes(&std::fs::read(&files[0]).expect("read")).expect("sound");
        assert_eq!(sketch.lines_px(), tree.branches_px);
        assert_eq!(sketch.only_crown_px().expect("a crown"), tree.crown_px);
        assert_eq!(
            std::fs::read_to_string(&taken).expect("read"),
            "of somebody"
        );
    }
}

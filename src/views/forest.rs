//! A forest with its templates: its files, and a page of it.

use super::{PrepareError, PreparedTree, TreeOptions};
use crate::document::note::Software;
use crate::document::{Document, ForestDocument};
use crate::export::forest::{ForestModel, ForestTemplate, forest_files, moving_glb};
use crate::export::gltf::NamedBytes;
use crate::export::{ExportError, html};
use serde_json::{Value, json};
use std::path::Path;

/// A forest that is ready to be written or drawn.
pub struct PreparedForest {
    pub document: ForestDocument,
    /// In the order of the document.
    pub templates: Vec<PreparedTree>,
}

impl PreparedForest {
    /// Reads the forest in `dir` and its templates.
    ///
    /// # Errors
    /// The folder holds no forest, or a file of it or of a template is missing or damaged.
    pub fn read(dir: &Path) -> Result<Self, PrepareError> {
        Self::of(ForestDocument::read(dir)?)
    }

    /// Reads the templates of a forest.
    ///
    /// # Errors
    /// A template cannot be read.
    pub fn of(document: ForestDocument) -> Result<Self, PrepareError> {
        let mut templates = Vec::with_capacity(document.note.templates.len());
        for dir in document.template_dirs() {
            let config = Document::note(&dir)?.config;
            let tree = Document::read(&dir, config.export.animation_s)?;
            let options = TreeOptions {
                config,
                ..TreeOptions::default()
            };
            templates.push(PreparedTree::new(tree, options)?);
        }
        Ok(Self {
            document,
            templates,
        })
    }

    /// The model's files, see [`forest_files`].
    ///
    /// # Errors
    /// A template is none for a file, or a file would be larger than its format can count.
    pub fn files(&self) -> Result<Vec<NamedBytes>, ExportError> {
        let templates = self.export_templates();
        forest_files(&ForestModel {
            forest: &self.document.forest,
            templates: &templates,
            provenance: &self.provenance(),
        })
    }

    /// A page that shows the forest in motion.
    ///
    /// # Errors
    /// As of [`files`](Self::files), or the program was built without the page.
    pub fn page(&self, title: &str) -> Result<Vec<u8>, ExportError> {
        let glb = self.moving_glb()?;
        let facts = html::ForestFacts {
            trees: self.document.forest.trees.len() as u64,
            templates: self.templates.len() as u64,
        };
        let data = html::Data::of_forest(&self.document.note.example, &Software::default(), facts);
        let page = html::page(&html::Page {
            title,
            glb: &glb,
            data: &data,
            picture: None,
        })?;
        Ok(page.into_bytes())
    }

    fn export_templates(&self) -> Vec<ForestTemplate<'_>> {
        let names = self.document.note.templates.iter();
        let templates = names.zip(&self.templates);
        let templates = templates.map(|(name, tree)| ForestTemplate {
            name,
            model: tree.model(),
        });
        templates.collect()
    }

    /// Where the forest comes from, for the file's own notes.
    fn provenance(&self) -> Value {
        let note = &self.document.note;
        json!({
            "software": Software::default(),
            "source": note.example,
            "seed": note.seed,
            "trees": note.trees,
            "templates": note.templates,
            "unit": "m",
            "scale": note.scale,
        })
    }

    /// Whether any of its trees moves.
    pub fn sways(&self) -> bool {
        self.templates.iter().any(|tree| tree.poses.len() > 1)
    }

    /// Whether trees of one template move one after the other, which they can in a loop only.
    pub fn is_staggered(&self) -> bool {
        self.document.forest.trees.iter().any(|tree| tree.ahead > 0)
    }

    /// The model in motion (GLB); at rest where no tree moves.
    ///
    /// # Errors
    /// As of [`files`](Self::files).
    pub fn moving_glb(&self) -> Result<Vec<u8>, ExportError> {
        let templates = self.export_templates();
        moving_glb(&ForestModel {
            forest: &self.document.forest,
            templates: &templates,
            provenance: &self.provenance(),
        })
    }

    /// Metres of a pixel of a template, as it stands in the forest.
    pub fn metres_per_px(&self, template: usize) -> f64 {
        let forest = &self.document.forest;
        let first = forest.trees.iter().find(|tree| tree.template == template);
        forest.metres_per_px * first.map_or(1.0, |tree| tree.scale)
    }
}

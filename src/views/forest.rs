//! A forest with its templates: its files, a picture and a page of it.

use super::studio::{PLAIN, model, png, samples};
use super::{PrepareError, PreparedTree, Shot, TreeOptions};
use crate::document::note::Software;
use crate::document::{Document, ForestDocument};
use crate::draw::{BoundingCylinder, Camera, Look, Placed, Posed, scene};
use crate::export::forest::{ForestModel, ForestTemplate, forest_files, moving_glb};
use crate::export::gltf::NamedBytes;
use crate::export::{ExportError, html};
use crate::geometry::{GROUND_RGB, ground};
use nalgebra::{Point3, Vector3};
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
        let templates = self.export_templates();
        let glb = moving_glb(&ForestModel {
            forest: &self.document.forest,
            templates: &templates,
            provenance: &self.provenance(),
        })?;
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

    /// The bytes of a picture (PNG) of the forest at rest. Of `shot` the view, the size, the
    /// background, whether it is bare and whether it has shadows count.
    ///
    /// # Errors
    /// There is nothing to be drawn of a template.
    pub fn picture(&self, shot: &Shot) -> Result<Vec<u8>, PrepareError> {
        let size = shot.size.unwrap_or(PLAIN);
        let mut models = Vec::with_capacity(self.templates.len());
        for tree in &self.templates {
            let wood = tree.dressed.wood.first();
            let wood = wood.ok_or(PrepareError::NothingToDraw)?;
            models.push(model(tree, wood, shot.bare));
        }
        let posed: Vec<Posed> = models.iter().map(|m| m.posed(None, &[])).collect();
        let forest = &self.document.forest;
        let mut trees = Vec::with_capacity(forest.trees.len());
        for tree in &forest.trees {
            trees.push(Placed {
                posed: posed
                    .get(tree.template)
                    .ok_or(PrepareError::NothingToDraw)?,
                foot: tree.foot,
                turn_rad: tree.turn_rad,
                scale: tree.scale * forest.metres_per_px,
            });
        }
        let mesh = ground(&forest.ground);
        let ground = Posed::of_mesh(&mesh, GROUND_RGB);
        let bounds = bounds(&ground, &trees).ok_or(PrepareError::NothingToDraw)?;
        let look = Look {
            samples: samples(size),
            shadow: shot.turntable && forest.ground.is_flat(),
            ..Look::default()
        };
        let camera = Camera::fitting(&bounds, shot.view, false, size);
        let mut below = crate::draw::Rgba::of_one(size, shot.background);
        below.put(&scene(&ground, &trees, &camera, &look));
        Ok(png(&below)?)
    }
}

/// What holds the ground and all trees in any turn.
fn bounds(ground: &Posed, trees: &[Placed]) -> Option<BoundingCylinder> {
    let mut points = Vec::new();
    if let Some(plot) = ground.bounds() {
        points.extend([plot.low, plot.high]);
    }
    for tree in trees {
        let Some(own) = tree.posed.bounds() else {
            continue;
        };
        let reach = Vector3::new(own.radius, 0.0, own.radius) * tree.scale;
        let up = |y: f64| Point3::new(tree.foot.x, tree.foot.y + y * tree.scale, tree.foot.z);
        points.extend([up(own.low.y) - reach, up(own.high.y) + reach]);
    }
    BoundingCylinder::of(points)
}

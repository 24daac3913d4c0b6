//! Where the trees of a new forest will stand, before any of them is grown.

use super::{Parent, PrepareError, PreparedForest, PreparedTree};
use crate::document::{ForestDocument, ForestOrigin};
use crate::export::gltf::NamedBytes;
use crate::grow::Planting;
use crate::model::{Forest, Ground, Size};
use std::path::Path;

/// Height of the example where no scale is known and none was given, m.
pub(super) const HEIGHT_M: f64 = 10.0;
/// From the lowest to the highest place of a height map where that is not given, as a share of the
/// plot's width.
const RELIEF_SHARE: f64 = 0.1;

/// How a forest is to be.
#[derive(Clone, Debug, PartialEq)]
pub struct ForestOptions {
    /// Trees, and templates that they share; 1 or more.
    pub count: u64,
    pub templates: u64,
    /// Least distance between two trunks, m; `None`: the width of the example.
    pub spacing_m: Option<f64>,
    /// Width of the plot, m; `None`: as wide as the trees need.
    pub width_m: Option<f64>,
    /// The heights of the ground; `None`: it is level, and the plot a square.
    pub heights: Option<HeightMap>,
    /// From the lowest value of the map to the highest, m.
    pub relief_m: Option<f64>,
    /// Height of the example where its scale is not known, m.
    pub height_m: Option<f64>,
    pub seed: u64,
}

/// The heights of the ground as a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeightMap {
    /// Each side 1 or more.
    pub samples: Size,
    /// Row by row, the farthest first: 0 is lowest, 65535 highest.
    pub heights: Vec<u16>,
    /// Size of the picture that they were taken from: the plot has its shape.
    pub picture: Size,
}

/// A forest that is to be made.
#[derive(Clone, Debug)]
pub struct ForestPlan {
    pub forest: Forest,
    /// What is said of it in its file; the templates are the first of the new trees.
    pub origin: ForestOrigin,
}

impl ForestPlan {
    /// Plans a forest of new trees like `parent`; `template_name` gives the folder of a template by
    /// its number, from 1 on.
    ///
    /// # Errors
    /// The trees have no room, or the plot is too large for its spacing.
    pub fn new(
        parent: &Parent,
        options: &ForestOptions,
        template_name: impl Fn(u64) -> String,
    ) -> Result<Self, PrepareError> {
        let measured = parent.metres_per_px();
        let size = parent.size_px();
        let metres_per_px = match measured > 0.0 {
            true => measured,
            false => options.height_m.unwrap_or(HEIGHT_M) / f64::from(size.height),
        };
        let spacing_m = options.spacing_m;
        let planting = Planting {
            count: options.count as usize,
            templates: options.templates as usize,
            spacing_m: spacing_m.unwrap_or(f64::from(size.width) * metres_per_px),
            seed: options.seed,
        };
        let depth_share = options.heights.as_ref().map_or(1.0, HeightMap::depth_share);
        let width_m = options.width_m;
        let width_m = width_m.unwrap_or_else(|| planting.width_m(depth_share));
        let mut ground = Ground::flat(width_m, width_m * depth_share);
        if let Some(map) = &options.heights {
            ground = Ground {
                relief_m: options.relief_m.unwrap_or(RELIEF_SHARE * width_m),
                samples: map.samples,
                heights: map.heights.clone(),
                ..ground
            };
        }
        Ok(Self {
            forest: planting.on(ground, metres_per_px)?,
            origin: ForestOrigin {
                example: parent.example_name(),
                seed: options.seed,
                templates: (1..=options.templates).map(template_name).collect(),
                spacing_m: planting.spacing_m,
                scale: if measured > 0.0 { "measured" } else { "height" },
            },
        })
    }

    /// All files of the forest but its templates, which lie in `dir`.
    ///
    /// # Errors
    /// A template cannot be read, or the forest is none for a file.
    pub fn files(self, dir: &Path) -> Result<Vec<NamedBytes>, PrepareError> {
        self.files_with(dir, PreparedForest::of)
    }

    /// The same of templates that are not written yet.
    ///
    /// # Errors
    /// The forest is none for a file.
    pub fn files_of(
        self,
        dir: &Path,
        templates: Vec<PreparedTree>,
    ) -> Result<Vec<NamedBytes>, PrepareError> {
        self.files_with(dir, |document| {
            Ok(PreparedForest {
                document,
                templates,
            })
        })
    }

    fn files_with(
        self,
        dir: &Path,
        prepare: impl FnOnce(ForestDocument) -> Result<PreparedForest, PrepareError>,
    ) -> Result<Vec<NamedBytes>, PrepareError> {
        let (document, own) = ForestDocument::as_written(dir, &self.forest, self.origin)?;
        let mut files = prepare(document)?.files()?;
        files.extend(own.into_iter().map(|f| (f.name.to_owned(), f.bytes)));
        Ok(files)
    }
}

impl HeightMap {
    /// How deep the plot is for its width.
    fn depth_share(&self) -> f64 {
        f64::from(self.picture.height.max(1)) / f64::from(self.picture.width.max(1))
    }
}

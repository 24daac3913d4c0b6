//! Documents of trees that were drawn, or modelled elsewhere.

use super::{Draft, PrepareError, write_document};
use crate::config::{Config, Leader};
use crate::document::Document;
use crate::document::note::{CaptureNote, ModelNote, OutlineNote, Source};
use crate::import::{FlatTree, StandingModel};
use crate::model::{Outline, Pose, Skeleton, Swaying};
use crate::pipeline::{MOST_RESHAPED, stand_drawn, thickened};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// The settings that a modelled tree has if no others are given: all of its branches are there, and trees
/// like it have no copies; where radii are known the twigs are there, too.
pub fn modelled_defaults(standing: &StandingModel) -> Config {
    let mut config = Config::default();
    config.shape.planes = 1;
    if standing.has_radii {
        config.wood.max_twigs = 0;
    }
    config
}

/// A tree that was not filmed, stood up in space.
#[derive(Clone, Debug)]
pub struct DrawnTree {
    pub note: CaptureNote,
    pub skeleton: Skeleton,
}

impl DrawnTree {
    /// The tree `flat` within `region`. A trunk that is marked is neither copied nor pushed (Li
    /// 2011 sect. 6). `name` says where it is from.
    ///
    /// # Errors
    /// It has too many branches.
    pub fn new(
        name: String,
        flat: &FlatTree,
        region: &Outline,
        mut config: Config,
    ) -> Result<Self, PrepareError> {
        let nodes = flat.skeleton.nodes.len() * config.shape.planes as usize;
        if nodes > MOST_RESHAPED {
            return Err(PrepareError::TooManyNodes { nodes });
        }
        if !flat.trunk_px.is_empty() {
            config.shape.leader = Leader::Drawn;
            config.shape.leader_px = flat.trunk_px.iter().map(|p| [p.x, p.y]).collect();
        }
        let skeleton = stand_drawn(&flat.skeleton, flat.has_radii, region, &config);
        let note = note(name, &skeleton, region, config);
        Ok(Self { note, skeleton })
    }

    /// A modelled tree as it stands, within `region` in its picture.
    pub fn modelled(
        name: String,
        standing: &StandingModel,
        region: &Outline,
        mut config: Config,
    ) -> Self {
        config.export.metres_per_px = standing.metres_per_px;
        let mut skeleton = standing.skeleton.clone();
        if !standing.has_radii {
            thickened(&mut skeleton, region, &config);
        }
        let note = note(name, &skeleton, region, config);
        Self { note, skeleton }
    }

    /// Writes it as a document to `dir`, which appears when it is complete, or not at all: also where `stop`
    /// is set meanwhile.
    ///
    /// # Errors
    /// `dir` is there already, a file cannot be written, or it was stopped.
    pub fn write(self, dir: &Path, stop: &AtomicBool) -> Result<(), PrepareError> {
        self.write_swaying(dir, &[], stop)
    }

    /// The same with the sway of its nodes, by node index.
    ///
    /// # Errors
    /// As there.
    pub fn write_swaying(
        self,
        dir: &Path,
        sway: &[Swaying],
        stop: &AtomicBool,
    ) -> Result<(), PrepareError> {
        let draft = Draft {
            note: self.note,
            skeleton: &self.skeleton,
            picture: None,
            bark: None,
            at_rest: None,
            poses: Vec::new(),
            pose_in_picture: None,
        };
        write_document(dir, draft, sway, stop)
    }

    /// The document that would be read back, with the sway of its nodes, by node index, and with `poses` as
    /// its motion.
    ///
    /// # Errors
    /// It cannot be read back, as it reaches too far.
    pub fn document(&self, sway: &[Swaying], poses: Vec<Pose>) -> Result<Document, PrepareError> {
        let mut document = Document::as_read(&self.note, &self.skeleton, sway, None)?;
        document.poses = poses;
        Ok(document)
    }
}

/// What `capture.json` says of a tree that was not filmed.
pub(super) fn note(
    name: String,
    skeleton: &Skeleton,
    region: &Outline,
    config: Config,
) -> CaptureNote {
    let source = Source {
        name,
        width: region.size.width,
        height: region.size.height,
        ..Source::default()
    };
    let outline = OutlineNote::of(0, region, Some(region));
    let model = ModelNote::of(skeleton, config.export.metres_per_px);
    CaptureNote::not_filmed(source, Some(outline), model, config)
}

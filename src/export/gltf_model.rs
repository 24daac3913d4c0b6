//! What goes into a glTF file.

use super::ExportError;
use crate::geometry::Dressed;
use crate::model::{LeafSwing, Pose, Skeleton};
use gltf_json::extras::RawValue;
use serde_json::Value;

/// Keys are thinned so that no node is farther than this from its pose in any frame as seen in its
/// own plane (the picture's for measured nodes), px; across it, where depth was estimated and not
/// seen, it may be twice as far.
pub const KEY_TOLERANCE_PX: f64 = 0.2;

/// Everything that goes into the file.
#[derive(Clone, Copy)]
pub struct Model<'a> {
    pub skeleton: &'a Skeleton,
    /// Its meshes may be empty: then the file holds the joints alone.
    pub dressed: &'a Dressed,
    /// In the order of time; the rest pose stands for none.
    pub poses: &'a [Pose],
    /// How far each group of leaves swings in every pose: the weights of its two displacements.
    /// Empty: not at all, and all leaves are one mesh that the joints alone move.
    pub flutter: &'a [Vec<LeafSwing>],
    /// Level of detail of wood and leaves, 0 the finest; beyond the last one the last.
    pub level: usize,
    /// Metres in a pixel; 0 leaves the model in pixels.
    pub metres_per_px: f64,
    /// See [`KEY_TOLERANCE_PX`].
    pub tolerance_px: f64,
    /// One JSON object a node, added to what the joints say of the tree; may be shorter than the
    /// skeleton.
    pub node_extras: &'a [Value],
    /// Software version, name of the source, frames: the `extras` of the asset.
    pub provenance: &'a Value,
}

impl Model<'_> {
    pub(super) fn scale(&self) -> f64 {
        if self.metres_per_px > 0.0 {
            self.metres_per_px
        } else {
            1.0
        }
    }

    /// Where the joint of node `i` rests, in the file's unit: at the parent node, about which the
    /// branch turns.
    pub(super) fn pivot(&self, i: usize) -> nalgebra::Vector3<f64> {
        let nodes = &self.skeleton.nodes;
        nodes[nodes[i].parent.map_or(i, |p| p.index())]
            .position
            .coords
            * self.scale()
    }
}

/// JSON text that is written as it stands; `null` is left out.
pub(super) fn raw(value: &Value) -> Result<Option<Box<RawValue>>, ExportError> {
    let text = (!value.is_null()).then(|| value.to_string());
    text.map(RawValue::from_string)
        .transpose()
        .map_err(|e| ExportError::unfit(e.to_string()))
}

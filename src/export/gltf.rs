//! The moving tree as one GLB: core glTF 2.0, one skinned mesh, one animation of rotations.

use super::ExportError;
use super::capture::{AnimationNote, Software};
use super::gltf_buffer::{BufferBuilder, Layout, accessor, le_f32};
use super::gltf_mesh::push_skinned_mesh;
use super::joints::{self, Keys};
use crate::model::{Pose, Skeleton};
use crate::shape::Mesh;
use gltf_json::accessor::Type;
use gltf_json::animation::{Animation, Channel, Interpolation, Property, Sampler, Target};
use gltf_json::extras::RawValue;
use gltf_json::validation::Checked::Valid;
use gltf_json::{Asset, Index, Node, Root, Scene};
use serde_json::{Value, json};
use std::borrow::Cow;

/// Keys are thinned so that no node is farther than this from its pose in any frame, px.
pub const KEY_TOLERANCE_PX: f64 = 0.2;

/// Where the model comes from, for the file's own notes.
pub fn provenance(source: &str, software: &Software, poses: &[Pose]) -> Value {
    json!({
        "software": software,
        "source": source,
        "first_frame": poses.first().map(|p| p.frame),
        "frames": poses.len(),
        "measured": "front view: tracked points; depth and copied planes: estimated (Li et al. 2011)",
    })
}

/// Everything that goes into the file.
#[derive(Clone, Debug)]
pub struct Model<'a> {
    pub skeleton: &'a Skeleton,
    /// May be empty: then the file holds the joints alone.
    pub mesh: &'a Mesh,
    /// In the order of time; the rest pose stands for none.
    pub poses: &'a [Pose],
    /// Colour of the bark as in a picture (sRGB).
    pub bark_rgb: [u8; 3],
    /// Metres in a pixel; 0 leaves the model in pixels.
    pub metres_per_px: f64,
    /// See [`KEY_TOLERANCE_PX`].
    pub tolerance_px: f64,
    /// One JSON object a node, added to `level`, `n_tracks` and `copy_of`; may be shorter than the skeleton.
    pub node_extras: &'a [Value],
    /// Software version, name of the source, frames: the `extras` of the asset.
    pub provenance: &'a Value,
}

impl Model<'_> {
    pub(super) fn scale(&self) -> f64 {
        if self.metres_per_px > 0.0 { self.metres_per_px } else { 1.0 }
    }

    /// Where the joint of node `i` rests, in the file's unit: at the parent node, about which the branch turns.
    pub(super) fn pivot(&self, i: usize) -> nalgebra::Vector3<f64> {
        let nodes = &self.skeleton.nodes;
        nodes[nodes[i].parent.map_or(i, |p| p.index())].position.coords * self.scale()
    }
}

/// The bytes of the GLB file, and what its animation is.
///
/// # Errors
/// [`ExportError::Unfit`] if the skeleton is empty, out of order or has positions that are no numbers, if a pose
/// belongs to another tree, or if there is more than the format can count.
pub fn glb(model: &Model) -> Result<(Vec<u8>, AnimationNote), ExportError> {
    check(model)?;
    let keys = joints::keys(model.skeleton, model.poses, model.tolerance_px)?;
    let mut root = Root::default();
    let mut buffer = BufferBuilder::default();
    root.asset = Asset {
        generator: Some(concat!("arborcam ", env!("CARGO_PKG_VERSION")).to_string()),
        extras: raw(model.provenance)?,
        ..Asset::default()
    };
    push_joints(&mut root, model)?;
    let mut scene_nodes = vec![Index::new(0)];
    if !model.mesh.indices.is_empty() {
        scene_nodes.push(push_skinned_mesh(&mut root, &mut buffer, model));
    }
    if !keys.is_empty() {
        push_animation(&mut root, &mut buffer, &keys);
    }
    let name = Some("arborcam".to_string());
    root.scene = Some(root.push(Scene { extensions: None, extras: None, name, nodes: scene_nodes }));
    let bin: Option<Cow<[u8]>> = buffer.finish(&mut root).map(Cow::Owned);
    let json: Cow<[u8]> = Cow::Owned(root.to_vec().map_err(|e| ExportError::unfit(e.to_string()))?);
    if json.len() + bin.as_ref().map_or(0, |b| b.len()) + 64 > u32::MAX as usize {
        return Err(ExportError::unfit("it is larger than the 4 GB that a GLB can hold; export a shorter animation"));
    }
    // The length in the header is computed when it is written.
    let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
    let bytes = gltf::binary::Glb { header, json, bin }.to_vec().map_err(|e| ExportError::unfit(e.to_string()))?;
    let frames = model.poses.len() as u64;
    let animation = AnimationNote {
        first_frame: model.poses.first().map_or(0, |p| p.frame),
        frames,
        keys: keys.iter().map(|k| k.times_s.len() as u64).sum(),
        raw_keys: keys.len() as u64 * frames,
    };
    Ok((bytes, animation))
}

fn check(model: &Model) -> Result<(), ExportError> {
    let (nodes, mesh) = (&model.skeleton.nodes, model.mesh);
    if nodes.is_empty() {
        return Err(ExportError::unfit("it has no nodes"));
    }
    if nodes.len() > 1 + usize::from(u16::MAX) {
        return Err(ExportError::unfit(format!("{} nodes are more than the 65536 joints of a skin", nodes.len())));
    }
    for (i, node) in nodes.iter().enumerate() {
        if node.parent.map(|p| p.index()).is_some_and(|p| p >= i) || (i > 0) != node.parent.is_some() {
            return Err(ExportError::unfit(format!("node {i} does not come after its parent")));
        }
        if !node.position.coords.iter().all(|x| ((x * model.scale()) as f32).is_finite()) {
            return Err(ExportError::unfit(format!("the position of node {i} is no number")));
        }
    }
    let n = mesh.positions.len();
    let same = [mesh.normals.len(), mesh.uvs.len(), mesh.joints.len(), mesh.weights.len()].iter().all(|&m| m == n);
    if !same || !mesh.indices.len().is_multiple_of(3) || mesh.indices.iter().any(|&i| i as usize >= n) {
        return Err(ExportError::unfit("its mesh has vectors of different lengths or indices beyond them"));
    }
    if !mesh.positions.iter().flatten().all(|x| ((f64::from(*x) * model.scale()) as f32).is_finite())
        || !mesh.joints.iter().flatten().all(|&j| usize::from(j) < nodes.len())
    {
        return Err(ExportError::unfit("its mesh has positions that are no numbers or joints of another tree"));
    }
    Ok(())
}

/// JSON text that is written as it stands; `null` is left out.
fn raw(value: &Value) -> Result<Option<Box<RawValue>>, ExportError> {
    let text = (!value.is_null()).then(|| value.to_string());
    text.map(RawValue::from_string).transpose().map_err(|e| ExportError::unfit(e.to_string()))
}

/// One glTF node a skeleton node, in the same order, so that the indices agree.
fn push_joints(root: &mut Root, model: &Model) -> Result<(), ExportError> {
    let children = model.skeleton.children();
    for (i, node) in model.skeleton.nodes.iter().enumerate() {
        let parent_pivot = node.parent.map_or_else(nalgebra::Vector3::zeros, |p| model.pivot(p.index()));
        let t = model.pivot(i) - parent_pivot;
        let (name, original) = (node.name.0, node.copy_of.and_then(|o| model.skeleton.name_of(o)));
        let mut extras = json!({
            "level": node.level,
            "n_tracks": node.n_tracks,
            "certainty": node.certainty,
            "copy_of": original.map(|c| c.0),
        });
        if let (Some(all), Some(Value::Object(more))) = (extras.as_object_mut(), model.node_extras.get(i)) {
            all.extend(more.clone());
        }
        root.nodes.push(Node {
            children: (!children[i].is_empty()).then(|| children[i].iter().map(|c| Index::new(c.0)).collect()),
            extras: raw(&extras)?,
            name: Some(match original {
                Some(original) => format!("node_{name}_copy_of_{}", original.0),
                None => format!("node_{name}"),
            }),
            translation: Some([t.x as f32, t.y as f32, t.z as f32]),
            ..Node::default()
        });
    }
    Ok(())
}

/// All times lie in one view and all rotations in another.
fn push_animation(root: &mut Root, buffer: &mut BufferBuilder, keys: &[Keys]) {
    let time_bytes = keys.iter().flat_map(|k| k.times_s.iter().flat_map(|t| t.to_le_bytes()));
    let times = buffer.view(root, time_bytes, None);
    let rotations = buffer.view(root, keys.iter().flat_map(|k| le_f32(&k.rotations)), None);
    let (mut channels, mut samplers) = (Vec::new(), Vec::new());
    let mut before = 0;
    for joint in keys {
        let count = joint.times_s.len();
        let mut input = accessor(times, 4 * before, Layout::f32(Type::Scalar), count);
        input.min = joint.times_s.first().map(|t| json!([t]));
        input.max = joint.times_s.last().map(|t| json!([t]));
        let input = root.push(input);
        let output = root.push(accessor(rotations, 16 * before, Layout::f32(Type::Vec4), count));
        before += count;
        let interpolation = Valid(Interpolation::Linear);
        samplers.push(Sampler { extensions: None, extras: None, input, interpolation, output });
        let node = Index::new(joint.node as u32);
        let target = Target { extensions: None, extras: None, node, path: Valid(Property::Rotation) };
        let sampler = Index::new(channels.len() as u32);
        channels.push(Channel { sampler, target, extensions: None, extras: None });
    }
    let name = Some("sway".to_string());
    root.push(Animation { extensions: None, extras: None, channels, name, samplers });
}

//! The moving tree as one GLB: core glTF 2.0, one skinned mesh, one animation of rotations.

use super::ExportError;
use super::gltf_buffer::{BufferBuilder, Layout, accessor, bounds, le_f32};
use super::joints::{self, Keys};
use crate::model::{Pose, Skeleton};
use crate::shape::mesh::Mesh;
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::animation::{Animation, Channel, Interpolation, Property, Sampler, Target};
use gltf_json::buffer::Target::{ArrayBuffer, ElementArrayBuffer};
use gltf_json::extras::RawValue;
use gltf_json::material::{Material, PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::validation::Checked::Valid;
use gltf_json::{Asset, Index, Node, Root, Scene, Skin};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Keys are thinned so that no node is farther than this from its pose in any frame, px.
pub const KEY_TOLERANCE_PX: f64 = 0.2;

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
    fn scale(&self) -> f64 {
        if self.metres_per_px > 0.0 { self.metres_per_px } else { 1.0 }
    }

    /// Where the joint of node `i` rests, in the file's unit: at the parent node, about which the branch turns.
    fn pivot(&self, i: usize) -> nalgebra::Vector3<f64> {
        let nodes = &self.skeleton.nodes;
        nodes[nodes[i].parent.map_or(i, |p| p.index())].position.coords * self.scale()
    }
}

/// The bytes of the GLB file.
///
/// # Errors
/// [`ExportError::Unfit`] if the skeleton is empty, out of order or has positions that are no numbers, if a pose
/// belongs to another tree, or if there is more than the format can count.
pub fn glb(model: &Model) -> Result<Vec<u8>, ExportError> {
    glb_and_keys(model).map(|(bytes, _)| bytes)
}

/// The bytes of the GLB file, and how many rotation keys are in it.
///
/// # Errors
/// As of [`glb`].
pub fn glb_and_keys(model: &Model) -> Result<(Vec<u8>, u64), ExportError> {
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
    Ok((bytes, keys.iter().map(|k| k.times_s.len() as u64).sum()))
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
        if !node.position.coords.iter().all(|x| x.is_finite()) {
            return Err(ExportError::unfit(format!("the position of node {i} is no number")));
        }
    }
    let n = mesh.positions.len();
    let same = [mesh.normals.len(), mesh.uvs.len(), mesh.joints.len(), mesh.weights.len()].iter().all(|&m| m == n);
    if !same || mesh.indices.len() % 3 != 0 || mesh.indices.iter().any(|&i| i as usize >= n) {
        return Err(ExportError::unfit("its mesh has vectors of different lengths or indices beyond them"));
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
        let mut extras = json!({
            "level": node.level,
            "n_tracks": node.n_tracks,
            "copy_of": node.copy_of.map(|c| c.0),
        });
        if let (Some(all), Some(Value::Object(more))) = (extras.as_object_mut(), model.node_extras.get(i)) {
            all.extend(more.clone());
        }
        root.nodes.push(Node {
            children: (!children[i].is_empty()).then(|| children[i].iter().map(|c| Index::new(c.0)).collect()),
            extras: raw(&extras)?,
            name: Some(match node.copy_of {
                Some(original) => format!("node_{i}_copy_of_{}", original.0),
                None => format!("node_{i}"),
            }),
            translation: Some([t.x as f32, t.y as f32, t.z as f32]),
            ..Node::default()
        });
    }
    Ok(())
}

/// The mesh stands beside the joints, not below them: a skin is placed by its joints alone.
fn push_skinned_mesh(root: &mut Root, buffer: &mut BufferBuilder, model: &Model) -> Index<Node> {
    let mesh = model.mesh;
    let n = mesh.positions.len();
    let scale = model.scale();
    let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| p.map(|x| (f64::from(x) * scale) as f32)).collect();
    let (low, high) = bounds(&positions);
    let vertices = Some(ArrayBuffer);
    let position = buffer.accessor(root, Layout::f32(Type::Vec3), n, le_f32(&positions), vertices);
    root.accessors[position.value()].min = Some(json!(low));
    root.accessors[position.value()].max = Some(json!(high));
    let normal = buffer.accessor(root, Layout::f32(Type::Vec3), n, le_f32(&mesh.normals), vertices);
    let uv = buffer.accessor(root, Layout::f32(Type::Vec2), n, le_f32(&mesh.uvs), vertices);
    let weights = buffer.accessor(root, Layout::f32(Type::Vec4), n, le_f32(&mesh.weights), vertices);
    let joint_bytes = mesh.joints.iter().flatten().flat_map(|j| j.to_le_bytes());
    let vec4_u16 = Layout { component: ComponentType::U16, shape: Type::Vec4 };
    let joints = buffer.accessor(root, vec4_u16, n, joint_bytes, vertices);
    let indices = push_indices(root, buffer, mesh);
    let attributes = BTreeMap::from([
        (Valid(Semantic::Positions), position),
        (Valid(Semantic::Normals), normal),
        (Valid(Semantic::TexCoords(0)), uv),
        (Valid(Semantic::Joints(0)), joints),
        (Valid(Semantic::Weights(0)), weights),
    ]);
    let material = root.push(bark(model.bark_rgb));
    let primitive = Primitive {
        attributes,
        extensions: None,
        extras: None,
        indices: Some(indices),
        material: Some(material),
        mode: Valid(Mode::Triangles),
        targets: None,
    };
    let name = || Some("tree".to_string());
    let primitives = vec![primitive];
    let mesh = root.push(gltf_json::Mesh { extensions: None, extras: None, name: name(), primitives, weights: None });
    let skin = push_skin(root, buffer, model);
    root.push(Node { mesh: Some(mesh), skin: Some(skin), name: name(), ..Node::default() })
}

/// Half the size where it fits; 65535 itself is reserved by the format.
fn push_indices(root: &mut Root, buffer: &mut BufferBuilder, mesh: &Mesh) -> Index<gltf_json::Accessor> {
    let target = Some(ElementArrayBuffer);
    let count = mesh.indices.len();
    if mesh.positions.len() <= usize::from(u16::MAX) {
        let bytes = mesh.indices.iter().flat_map(|&i| (i as u16).to_le_bytes());
        buffer.accessor(root, Layout { component: ComponentType::U16, shape: Type::Scalar }, count, bytes, target)
    } else {
        let bytes = mesh.indices.iter().flat_map(|i| i.to_le_bytes());
        buffer.accessor(root, Layout { component: ComponentType::U32, shape: Type::Scalar }, count, bytes, target)
    }
}

fn push_skin(root: &mut Root, buffer: &mut BufferBuilder, model: &Model) -> Index<Skin> {
    let n = model.skeleton.nodes.len();
    let bind: Vec<[f32; 16]> = (0..n)
        .map(|i| {
            let back = -model.pivot(i);
            let (x, y, z) = (back.x as f32, back.y as f32, back.z as f32);
            [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0]
        })
        .collect();
    let inverse_bind = buffer.accessor(root, Layout::f32(Type::Mat4), n, le_f32(&bind), None);
    root.push(Skin {
        extensions: None,
        extras: None,
        inverse_bind_matrices: Some(inverse_bind),
        joints: (0..n as u32).map(Index::new).collect(),
        name: Some("tree".to_string()),
        skeleton: Some(Index::new(0)),
    })
}

fn bark(rgb: [u8; 3]) -> Material {
    // glTF colours are linear, those of a picture are not (sRGB transfer function, IEC 61966-2-1).
    let linear = rgb.map(|c| {
        let c = f32::from(c) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    });
    Material {
        name: Some("bark".to_string()),
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor([linear[0], linear[1], linear[2], 1.0]),
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(0.9),
            ..PbrMetallicRoughness::default()
        },
        ..Material::default()
    }
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

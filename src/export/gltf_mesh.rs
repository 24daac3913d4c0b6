//! Meshes of a glTF file: wood and leaves.

use super::ExportError;
use super::gltf_buffer::{BufferBuilder, Layout, bounds, le_f32};
use super::gltf_look::linear;
use super::gltf_model::{Model, raw};
use super::skinning::{Skinning, skinning};
use crate::geometry::{FoliageGroup, Mesh};
use crate::model::{NodeName, TREE};
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::buffer::Target::{ArrayBuffer, ElementArrayBuffer};
use gltf_json::material::Material;
use gltf_json::mesh::{Mode, MorphTarget, Primitive, Semantic};
use gltf_json::validation::Checked::{self, Valid};
use gltf_json::{Accessor, Index, Node, Root, Skin};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// One mesh with its looks, and with its skin where joints move it.
pub(super) struct MeshPart<'a> {
    mesh: &'a Mesh,
    /// Empty for one colour.
    colours: &'a [[u8; 3]],
    /// Displacements that the animation may add.
    targets: Vec<Displacement<'a>>,
    material: Index<Material>,
    skin: Option<Index<Skin>>,
    pub name: String,
    extras: Value,
}

/// A displacement of every vertex that an animation adds by a weight.
#[derive(Clone, Debug)]
pub(super) struct Displacement<'a> {
    pub name: String,
    /// Model axes, px.
    pub by: Cow<'a, [[f32; 3]]>,
}

impl<'a> Displacement<'a> {
    fn of_leaves(name: &str, by: &'a [[f32; 3]]) -> Self {
        Self {
            name: name.to_owned(),
            by: Cow::Borrowed(by),
        }
    }
}

impl<'a> MeshPart<'a> {
    pub fn wood(mesh: &'a Mesh, material: Index<Material>, skin: Index<Skin>) -> Self {
        Self {
            skin: Some(skin),
            ..Self::without_skin(mesh, &[], material, Vec::new())
        }
    }

    /// A mesh that no joints move.
    pub fn without_skin(
        mesh: &'a Mesh,
        colours: &'a [[u8; 3]],
        material: Index<Material>,
        targets: Vec<Displacement<'a>>,
    ) -> Self {
        Self {
            mesh,
            colours,
            targets,
            material,
            skin: None,
            name: "wood".to_owned(),
            extras: Value::Null,
        }
    }

    /// Leaves that the joints alone move.
    pub fn leaves(group: &'a FoliageGroup, material: Index<Material>, skin: Index<Skin>) -> Self {
        Self {
            colours: &group.colours,
            name: "leaves".to_owned(),
            ..Self::wood(&group.mesh, material, skin)
        }
    }

    /// `branch` is the one with which the leaves swing.
    pub fn swinging_leaves(
        group: &'a FoliageGroup,
        material: Index<Material>,
        skin: Index<Skin>,
        name: String,
        branch: Option<NodeName>,
    ) -> Self {
        let targets = vec![
            Displacement::of_leaves("sine", &group.sine),
            Displacement::of_leaves("cosine", &group.cosine),
        ];
        Self {
            targets,
            name,
            extras: json!({ "node": branch.map(|b| b.0) }),
            ..Self::leaves(group, material, skin)
        }
    }
}

/// Adds a mesh of these parts, and the node that shows it, which is called as the first.
pub(super) fn push_skinned(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    scale: f64,
    parts: &[MeshPart],
) -> Result<Index<Node>, ExportError> {
    let mesh = mesh_of(root, buffer, scale, parts)?;
    let mesh = root.push(mesh);
    let first = parts.first();
    let extras = raw(first.map_or(&Value::Null, |part| &part.extras))?;
    Ok(root.push(Node {
        mesh: Some(mesh),
        skin: first.and_then(|part| part.skin),
        name: first.map(|part| part.name.clone()),
        extras,
        ..Node::default()
    }))
}

/// A mesh of these parts, named like the first, lengths times `scale`; its numbers are added. All
/// parts must have the same number of displacements.
pub(super) fn mesh_of(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    scale: f64,
    parts: &[MeshPart],
) -> Result<gltf_json::Mesh, ExportError> {
    let mut primitives = Vec::with_capacity(parts.len());
    for part in parts {
        primitives.push(push_primitive(root, buffer, scale, part));
    }
    let targets = parts.first().map_or(&[][..], |part| &part.targets);
    let names = if targets.is_empty() {
        Value::Null
    } else {
        let names: Vec<&str> = targets.iter().map(|t| t.name.as_str()).collect();
        json!({ "targetNames": names })
    };
    Ok(gltf_json::Mesh {
        extensions: None,
        extras: raw(&names)?,
        name: parts.first().map(|part| part.name.clone()),
        primitives,
        weights: (!targets.is_empty()).then(|| vec![0.0; targets.len()]),
    })
}

fn push_primitive(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    scale: f64,
    what: &MeshPart,
) -> Primitive {
    let attributes = push_vertices(root, buffer, scale, what);
    let mut targets = Vec::with_capacity(what.targets.len());
    for target in &what.targets {
        targets.push(MorphTarget {
            positions: Some(push_places(root, buffer, &target.by, scale)),
            normals: None,
            tangents: None,
        });
    }
    let indices = push_indices(root, buffer, what.mesh);
    Primitive {
        attributes,
        extensions: None,
        extras: None,
        indices: Some(indices),
        material: Some(what.material),
        mode: Valid(Mode::Triangles),
        targets: (!targets.is_empty()).then_some(targets),
    }
}

/// What every vertex has.
type Attributes = BTreeMap<Checked<Semantic>, Index<Accessor>>;

/// Adds places, normals, texture coordinates and colours where there are any, and with a skin joints
/// and weights, in this order.
fn push_vertices(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    scale: f64,
    what: &MeshPart,
) -> Attributes {
    let mesh = what.mesh;
    let (n, vertices) = (mesh.positions.len(), Some(ArrayBuffer));
    let mut attributes = Attributes::new();
    let position = push_places(root, buffer, &mesh.positions, scale);
    attributes.insert(Valid(Semantic::Positions), position);
    let normals: Vec<[f32; 3]> = mesh.normals.iter().map(unit).collect();
    let normal = buffer.accessor(root, Layout::f32(Type::Vec3), n, le_f32(&normals), vertices);
    attributes.insert(Valid(Semantic::Normals), normal);
    if !mesh.uvs.is_empty() {
        let layout = Layout::f32(Type::Vec2);
        let uv = buffer.accessor(root, layout, n, le_f32(&mesh.uvs), vertices);
        attributes.insert(Valid(Semantic::TexCoords(0)), uv);
    }
    if !what.colours.is_empty() {
        let bytes = what.colours.iter().flat_map(|c| le_linear(*c));
        let layout = Layout::normalized(ComponentType::U16, Type::Vec4);
        let colours = buffer.accessor(root, layout, n, bytes, vertices);
        attributes.insert(Valid(Semantic::Colors(0)), colours);
    }
    if what.skin.is_none() {
        return attributes;
    }
    let Skinning { joints, weights } = skinning(mesh);
    let (size, bytes) = joints.le_bytes();
    let layout = Layout {
        component: unsigned(size),
        shape: Type::Vec4,
        normalized: false,
    };
    let joints = buffer.accessor(root, layout, n, bytes.into_iter(), vertices);
    attributes.insert(Valid(Semantic::Joints(0)), joints);
    let (size, bytes) = weights.le_bytes();
    let layout = Layout::normalized(unsigned(size), Type::Vec4);
    let weights = buffer.accessor(root, layout, n, bytes.into_iter(), vertices);
    attributes.insert(Valid(Semantic::Weights(0)), weights);
    attributes
}

/// Whole numbers of so many bytes.
fn unsigned(size: usize) -> ComponentType {
    if size == 1 {
        ComponentType::U8
    } else {
        ComponentType::U16
    }
}

/// A colour (sRGB) as the file has it. Two bytes a channel: the linear scale has too few dark steps
/// in one.
fn le_linear(rgb: [u8; 3]) -> impl Iterator<Item = u8> {
    let [r, g, b] = rgb.map(|c| (linear(c) * 65535.0).round() as u16);
    [r, g, b, u16::MAX].into_iter().flat_map(u16::to_le_bytes)
}

/// Places or ways, px in the model, with the bounds that the format asks for.
fn push_places(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    rows: &[[f32; 3]],
    scale: f64,
) -> Index<Accessor> {
    let scaled: Vec<[f32; 3]> = rows
        .iter()
        .map(|p| p.map(|x| (f64::from(x) * scale) as f32))
        .collect();
    let (low, high) = bounds(&scaled);
    let places = buffer.accessor(
        root,
        Layout::f32(Type::Vec3),
        rows.len(),
        le_f32(&scaled),
        Some(ArrayBuffer),
    );
    root.accessors[places.value()].min = Some(json!(low));
    root.accessors[places.value()].max = Some(json!(high));
    places
}

/// Of length 1, whatever a degenerate triangle has left.
fn unit(normal: &[f32; 3]) -> [f32; 3] {
    let n = nalgebra::Vector3::from(*normal).map(f64::from);
    let n = n.try_normalize(1e-9).unwrap_or_else(nalgebra::Vector3::y);
    [n.x as f32, n.y as f32, n.z as f32]
}

/// Half the size where it fits; 65535 itself is reserved by the format.
fn push_indices(root: &mut Root, buffer: &mut BufferBuilder, mesh: &Mesh) -> Index<Accessor> {
    let target = Some(ElementArrayBuffer);
    let count = mesh.indices.len();
    if mesh.positions.len() <= usize::from(u16::MAX) {
        let bytes = mesh.indices.iter().flat_map(|&i| (i as u16).to_le_bytes());
        buffer.accessor(root, scalar(ComponentType::U16), count, bytes, target)
    } else {
        let bytes = mesh.indices.iter().flat_map(|i| i.to_le_bytes());
        buffer.accessor(root, scalar(ComponentType::U32), count, bytes, target)
    }
}

fn scalar(component: ComponentType) -> Layout {
    Layout {
        component,
        shape: Type::Scalar,
        normalized: false,
    }
}

/// The skin that all meshes share.
pub(super) fn push_skin(root: &mut Root, buffer: &mut BufferBuilder, model: &Model) -> Index<Skin> {
    let n = model.skeleton.nodes.len();
    let bind: Vec<[f32; 16]> = (0..n)
        .map(|i| {
            let back = -model.pivot(i);
            let (x, y, z) = (back.x as f32, back.y as f32, back.z as f32);
            [
                1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0,
            ]
        })
        .collect();
    let inverse_bind = buffer.accessor(root, Layout::f32(Type::Mat4), n, le_f32(&bind), None);
    root.push(Skin {
        extensions: None,
        extras: None,
        inverse_bind_matrices: Some(inverse_bind),
        joints: (0..n as u32).map(Index::new).collect(),
        name: Some(TREE.to_owned()),
        skeleton: Some(Index::new(0)),
    })
}

//! The skinned mesh of a GLB: vertices, skin and bark.

use super::gltf::Model;
use super::gltf_buffer::{BufferBuilder, Layout, bounds, le_f32};
use crate::shape::Mesh;
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::buffer::Target::{ArrayBuffer, ElementArrayBuffer};
use gltf_json::material::{Material, PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::validation::Checked::Valid;
use gltf_json::{Index, Node, Root, Skin};
use serde_json::json;
use std::collections::BTreeMap;

/// The mesh stands beside the joints, not below them: a skin is placed by its joints alone.
pub(super) fn push_skinned_mesh(root: &mut Root, buffer: &mut BufferBuilder, model: &Model) -> Index<Node> {
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

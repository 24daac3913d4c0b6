//! The moving tree as glTF 2.0 without extensions: joints, one skin, wood in one level of detail or
//! more, leaves, and one animation.

use super::ExportError;
use super::gltf_animation::push_animation;
use super::gltf_buffer::BufferBuilder;
use super::gltf_check::check;
use super::gltf_look::{LeafPicture, bark, leaf};
use super::gltf_mesh::{Skinned, push_mesh, push_skin};
use super::gltf_model::raw;
use super::joints::Moving;
use crate::document::note::{AnimationNote, Software};
use crate::geometry::{Dressed, Mesh};
use crate::model::Pose;
use gltf_json::{Asset, Index, Node, Root, Scene, Skin};
use serde_json::{Value, json};
use std::borrow::Cow;

pub use super::gltf_model::{KEY_TOLERANCE_PX, Model};

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

/// A file and its bytes.
pub type NamedBytes = (String, Vec<u8>);

/// The bytes of the GLB file, and what its animation is.
///
/// # Errors
/// [`ExportError::Unfit`] if the skeleton is empty, out of order or has positions that are no
/// numbers, if a pose belongs to another tree, or if there is more than the format can count.
pub fn glb(model: &Model) -> Result<(Vec<u8>, AnimationNote), ExportError> {
    let Assembled {
        mut root,
        buffer,
        animation,
        ..
    } = assemble(model, false)?;
    let bin: Option<Cow<[u8]>> = buffer.finish(&mut root, None).map(Cow::Owned);
    let json: Cow<[u8]> = Cow::Owned(
        root.to_vec()
            .map_err(|e| ExportError::unfit(e.to_string()))?,
    );
    if json.len() + bin.as_ref().map_or(0, |b| b.len()) + 64 > u32::MAX as usize {
        return Err(ExportError::unfit(
            "it is larger than the 4 GB that a GLB can hold; export a shorter animation",
        ));
    }
    // The length in the header is computed when it is written.
    let header = gltf::binary::Header {
        magic: *b"glTF",
        version: 2,
        length: 0,
    };
    let bytes = gltf::binary::Glb { header, json, bin }
        .to_vec()
        .map_err(|e| ExportError::unfit(e.to_string()))?;
    Ok((bytes, animation))
}

/// The same as files beside each other: `STEM.gltf`, `STEM.bin`, and the texture of the leaves
/// where there is one. What is pointed to comes first, the `.gltf` last.
///
/// # Errors
/// As of [`glb`].
pub fn gltf_files(
    model: &Model,
    stem: &str,
) -> Result<(Vec<NamedBytes>, AnimationNote), ExportError> {
    let Assembled {
        mut root,
        buffer,
        animation,
        texture,
    } = assemble(model, true)?;
    let mut files = Vec::new();
    // Names in the file are those of links: what a link cannot hold is written as %XX.
    if let (Some((ending, bytes)), Some(image)) = (texture, root.images.first_mut()) {
        let name = format!("{stem}_leaf.{ending}");
        image.uri = Some(percent(&name));
        files.push((name, bytes));
    }
    let name = format!("{stem}.bin");
    if let Some(bytes) = buffer.finish(&mut root, Some(percent(&name))) {
        files.push((name, bytes));
    }
    let mut text = root
        .to_vec_pretty()
        .map_err(|e| ExportError::unfit(e.to_string()))?;
    text.push(b'\n');
    files.push((format!("{stem}.gltf"), text));
    Ok((files, animation))
}

struct Assembled {
    root: Root,
    buffer: BufferBuilder,
    animation: AnimationNote,
    /// Ending and bytes of the picture that is not in the buffer.
    texture: Option<(&'static str, Vec<u8>)>,
}

fn assemble(model: &Model, texture_apart: bool) -> Result<Assembled, ExportError> {
    check(model)?;
    let moving = Moving::new(model.skeleton, model.poses, model.tolerance_px);
    let mut root = Root::default();
    let mut buffer = BufferBuilder::default();
    root.asset = Asset {
        generator: Some(concat!("arborcam ", env!("CARGO_PKG_VERSION")).to_string()),
        extras: raw(model.provenance)?,
        ..Asset::default()
    };
    push_joints(&mut root, model)?;
    let Dressed { wood, foliage, .. } = model.dressed;
    let mut meshes = wood.iter().chain(foliage.groups.iter().map(|g| &g.mesh));
    let mut drawn = Drawn::default();
    if meshes.any(is_drawn) {
        let skin = push_skin(&mut root, &mut buffer, model);
        drawn.levels = push_wood(&mut root, &mut buffer, model, skin)?;
        drawn.leaves = push_leaves(&mut root, &mut buffer, model, skin, texture_apart)?;
    }
    push_animation(&mut root, &mut buffer, model, &moving, &drawn.leaves);
    let leaves = drawn.leaves.iter().map(|(_, node)| *node);
    push_scenes(&mut root, &drawn.levels, leaves);
    let animation = AnimationNote {
        first_frame: model.poses.first().map_or(0, |p| p.frame),
        frames: model.poses.len() as u64,
        keys: moving.keys(),
        raw_keys: moving.raw_keys(),
    };
    let texture = match leaf_picture(model, texture_apart) {
        Some(picture) if texture_apart && !drawn.leaves.is_empty() => {
            Some((picture.ending()?, picture.texture.1.clone()))
        }
        _ => None,
    };
    Ok(Assembled {
        root,
        buffer,
        animation,
        texture,
    })
}

/// The nodes that show meshes.
#[derive(Default)]
struct Drawn {
    /// The wood, a node for every level of detail.
    levels: Vec<Index<Node>>,
    /// The leaves, with the place of their group among all.
    leaves: Vec<(usize, Index<Node>)>,
}

fn is_drawn(mesh: &Mesh) -> bool {
    !mesh.indices.is_empty()
}

fn push_wood(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    model: &Model,
    skin: Index<Skin>,
) -> Result<Vec<Index<Node>>, ExportError> {
    let material = root.push(bark(model.dressed.bark_rgb));
    let wood = &model.dressed.wood;
    let wanted = if model.all_levels { wood.len() } else { 1 };
    let mut levels = Vec::new();
    for (k, mesh) in wood.iter().take(wanted).enumerate() {
        if !is_drawn(mesh) {
            continue;
        }
        let name = if k == 0 {
            "tree".to_owned()
        } else {
            format!("tree_lod{k}")
        };
        let what = Skinned::wood(mesh, material, skin, name);
        levels.push(push_mesh(root, buffer, model, what)?);
    }
    Ok(levels)
}

fn push_leaves(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    model: &Model,
    skin: Index<Skin>,
    texture_apart: bool,
) -> Result<Vec<(usize, Index<Node>)>, ExportError> {
    let groups = &model.dressed.foliage.groups;
    let mut leaves = Vec::new();
    if !groups.iter().any(|g| is_drawn(&g.mesh)) {
        return Ok(leaves);
    }
    let material = leaf(root, buffer, leaf_picture(model, texture_apart))?;
    for (k, group) in groups.iter().enumerate() {
        if is_drawn(&group.mesh) {
            let branch = model.skeleton.name_of(group.node);
            let what = Skinned::leaves(group, material, skin, format!("leaves_{k}"), branch);
            leaves.push((k, push_mesh(root, buffer, model, what)?));
        }
    }
    Ok(leaves)
}

fn leaf_picture<'a>(model: &Model<'a>, apart: bool) -> Option<LeafPicture<'a>> {
    let foliage = &model.dressed.foliage;
    let mut uvs = foliage.groups.iter().flat_map(|g| &g.mesh.uvs);
    Some(LeafPicture {
        texture: foliage.texture.as_ref()?,
        tiled: uvs.any(|[u, v]| u.min(*v) < -0.01 || u.max(*v) > 1.01),
        apart,
    })
}

/// One glTF node a skeleton node, in the same order, so that the indices agree.
fn push_joints(root: &mut Root, model: &Model) -> Result<(), ExportError> {
    let children = model.skeleton.children();
    for (i, node) in model.skeleton.nodes.iter().enumerate() {
        let parent_pivot = node
            .parent
            .map_or_else(nalgebra::Vector3::zeros, |p| model.pivot(p.index()));
        let t = model.pivot(i) - parent_pivot;
        let (name, original) = (
            node.name.0,
            node.copy_of.and_then(|o| model.skeleton.name_of(o)),
        );
        let mut extras = json!({
            "level": node.level,
            "n_tracks": node.n_tracks,
            "certainty": node.certainty,
            "copy_of": original.map(|c| c.0),
        });
        let mover = node.moves_with.and_then(|m| model.skeleton.name_of(m));
        if let (Some(all), Some(mover)) = (extras.as_object_mut(), mover) {
            all.insert("moves_with".into(), mover.0.into());
        }
        if let (Some(all), Some(Value::Object(more))) =
            (extras.as_object_mut(), model.node_extras.get(i))
        {
            all.extend(more.clone());
        }
        root.nodes.push(Node {
            children: (!children[i].is_empty())
                .then(|| children[i].iter().map(|c| Index::new(c.0)).collect()),
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

/// A scene for each level of the wood, which stands beside the joints and not below them: a skin is
/// placed by its joints alone. The first is the one that is shown.
fn push_scenes(
    root: &mut Root,
    levels: &[Index<Node>],
    leaves: impl Iterator<Item = Index<Node>> + Clone,
) {
    for k in 0..levels.len().max(1) {
        let nodes = std::iter::once(Index::new(0))
            .chain(levels.get(k).copied())
            .chain(leaves.clone())
            .collect();
        let name = if levels.len() > 1 {
            format!("lod{k}")
        } else {
            "arborcam".to_owned()
        };
        root.push(Scene {
            extensions: None,
            extras: None,
            name: Some(name),
            nodes,
        });
    }
    root.scene = Some(Index::new(0));
}

/// A name as a relative link.
fn percent(name: &str) -> String {
    let mut link = String::with_capacity(name.len());
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            link.push(char::from(byte));
        } else {
            link.push_str(&format!("%{byte:02X}"));
        }
    }
    link
}

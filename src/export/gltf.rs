//! The moving tree as glTF 2.0 without extensions: joints, one skin, wood and leaves in one level
//! of detail, and one animation.

use super::ExportError;
use super::gltf_animation::push_animation;
use super::gltf_buffer::BufferBuilder;
use super::gltf_check::check;
use super::gltf_look::{LeafPicture, MADE_UP_BARK, bark, leaf};
use super::gltf_mesh::{MeshPart, push_skin, push_skinned};
use super::gltf_model::raw;
use super::joints::Moving;
use crate::document::note::{AnimationNote, CaptureNote, Software};
use crate::geometry::{Dressed, Foliage, FoliageGroup, LEVELS, Mesh};
use crate::model::{NodeId, Pose, TREE};
use gltf_json::material::Material;
use gltf_json::{Asset, Index, Node, Root, Scene, Skin};
use serde_json::{Value, json};
use std::borrow::Cow;

pub use super::gltf_model::{KEY_TOLERANCE_PX, Model};

/// Where the model comes from, for the file's own notes: the capture, and the program that writes
/// it.
pub fn provenance(capture: &CaptureNote, software: &Software, poses: &[Pose]) -> Value {
    let mut provenance = json!({
        "software": software,
        "source": capture.source.name,
        "first_frame": poses.first().map(|p| p.frame),
        "frames": poses.len(),
        "measured": "front view: tracked points; depth and copied planes: estimated (Li et al. 2011)",
    });
    if let Some(at) = capture.captured_at {
        provenance["captured_at"] = at.to_string().into();
    }
    if !capture.notes.is_empty() {
        provenance["notes"] = json!(capture.notes);
    }
    provenance
}

/// How many levels of detail there are.
pub const LEVELS_OF_DETAIL: usize = LEVELS.len();

/// A file and its bytes.
pub type NamedBytes = (String, Vec<u8>);

/// The bytes of the GLB file, and what its animation is.
///
/// # Errors
/// [`ExportError::Unfit`] if the skeleton is empty, out of order or has positions that are no
/// numbers, if a pose belongs to another tree, or if there is more than the format can count.
pub fn glb(model: &Model) -> Result<(Vec<u8>, AnimationNote), ExportError> {
    let Assembled {
        root,
        buffer,
        animation,
        ..
    } = assemble(model, false)?;
    Ok((binary(root, buffer)?, animation))
}

/// The bytes of a GLB file.
///
/// # Errors
/// It is larger than the format can count.
pub(super) fn binary(mut root: Root, buffer: BufferBuilder) -> Result<Vec<u8>, ExportError> {
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
    gltf::binary::Glb { header, json, bin }
        .to_vec()
        .map_err(|e| ExportError::unfit(e.to_string()))
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
    // The picture of the leaf comes after that of the bark. Names in the file are those of links:
    // what a link cannot hold is written as %XX.
    if let (Some((ending, bytes)), Some(image)) = (texture, root.images.last_mut()) {
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
    root.asset = asset(model.provenance)?;
    push_joints(&mut root, model)?;
    let look = Look::of(model);
    let mut drawn = Drawn::default();
    if look.is_drawn() {
        let skin = push_skin(&mut root, &mut buffer, model);
        drawn.meshes = push_wood(&mut root, &mut buffer, model, &look, skin)?;
        push_leaves(
            &mut root,
            &mut buffer,
            model,
            &look,
            skin,
            texture_apart,
            &mut drawn,
        )?;
    }
    push_animation(&mut root, &mut buffer, model, &moving, &drawn.swinging);
    push_scene(&mut root, &drawn.meshes);
    let animation = AnimationNote {
        first_frame: model.poses.first().map_or(0, |p| p.frame),
        frames: model.poses.len() as u64,
        keys: moving.keys(),
        raw_keys: moving.raw_keys(),
    };
    let texture = match leaf_picture(&model.dressed.foliage, texture_apart) {
        Some(picture) if texture_apart && look.has_leaves() => {
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

/// What the file says of itself.
pub(super) fn asset(provenance: &Value) -> Result<Asset, ExportError> {
    Ok(Asset {
        generator: Some(concat!("arborcam ", env!("CARGO_PKG_VERSION")).to_string()),
        extras: raw(provenance)?,
        ..Asset::default()
    })
}

/// The meshes of one level of detail.
struct Look<'a> {
    wood: Option<&'a Mesh>,
    /// One mesh, or one a group where the groups swing.
    leaves: Vec<Cow<'a, FoliageGroup>>,
    swings: bool,
}

impl<'a> Look<'a> {
    fn of(model: &Model<'a>) -> Self {
        let Dressed { wood, foliage, .. } = model.dressed;
        let level = model.level.min(LEVELS.len() - 1);
        let swings = !model.flutter.is_empty();
        let foliage = match level {
            0 => Cow::Borrowed(foliage),
            _ => Cow::Owned(foliage.thinned(LEVELS[level])),
        };
        let leaves = match foliage {
            all if !swings => vec![Cow::Owned(all.merged())],
            Cow::Borrowed(all) => all.groups.iter().map(Cow::Borrowed).collect(),
            Cow::Owned(all) => all.groups.into_iter().map(Cow::Owned).collect(),
        };
        let wood = wood.get(level).or(wood.last());
        Self {
            wood: wood.filter(|mesh| is_drawn(mesh)),
            leaves,
            swings,
        }
    }

    fn has_leaves(&self) -> bool {
        self.leaves.iter().any(|g| is_drawn(&g.mesh))
    }

    fn is_drawn(&self) -> bool {
        self.wood.is_some() || self.has_leaves()
    }
}

/// The nodes that show meshes.
#[derive(Default)]
struct Drawn {
    meshes: Vec<Index<Node>>,
    /// The leaves that swing, with the place of their group among all.
    swinging: Vec<(usize, Index<Node>)>,
}

fn is_drawn(mesh: &Mesh) -> bool {
    !mesh.indices.is_empty()
}

fn push_wood(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    model: &Model,
    look: &Look,
    skin: Index<Skin>,
) -> Result<Vec<Index<Node>>, ExportError> {
    let Some(mesh) = look.wood else {
        return Ok(Vec::new());
    };
    let bark = bark(root, buffer, &model.dressed.bark)?;
    let material = root.push(bark.clone());
    if !mesh.is_made_up_in_part() {
        let what = MeshPart::wood(mesh, material, skin);
        return Ok(vec![push_skinned(root, buffer, model.scale(), &[what])?]);
    }
    let (seen, made_up) = (mesh.part(false), mesh.part(true));
    // It looks the same; with a material of its own it can be hidden.
    let of_made_up = root.push(Material {
        name: Some(MADE_UP_BARK.to_owned()),
        ..bark
    });
    let parts = [
        MeshPart::wood(&seen, material, skin),
        MeshPart::wood(&made_up, of_made_up, skin),
    ];
    Ok(vec![push_skinned(root, buffer, model.scale(), &parts)?])
}

fn push_leaves(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    model: &Model,
    look: &Look,
    skin: Index<Skin>,
    texture_apart: bool,
    drawn: &mut Drawn,
) -> Result<(), ExportError> {
    if !look.has_leaves() {
        return Ok(());
    }
    let material = leaf(
        root,
        buffer,
        leaf_picture(&model.dressed.foliage, texture_apart),
    )?;
    for (k, group) in look.leaves.iter().enumerate() {
        if !is_drawn(&group.mesh) {
            continue;
        }
        let what = if look.swings {
            let branch = model.skeleton.name_of(group.node);
            MeshPart::swinging_leaves(group, material, skin, format!("leaves_{k}"), branch)
        } else {
            MeshPart::leaves(group, material, skin)
        };
        let node = push_skinned(root, buffer, model.scale(), &[what])?;
        drawn.meshes.push(node);
        drawn.swinging.extend(look.swings.then_some((k, node)));
    }
    Ok(())
}

/// The picture of the leaf, where there is one.
pub(super) fn leaf_picture(foliage: &Foliage, apart: bool) -> Option<LeafPicture<'_>> {
    let mut uvs = foliage.groups.iter().flat_map(|g| &g.mesh.uvs);
    Some(LeafPicture {
        texture: foliage.texture.as_ref()?,
        tiled: uvs.any(|[u, v]| u.min(*v) < -0.01 || u.max(*v) > 1.01),
        apart,
    })
}

/// One glTF node a skeleton node, in the same order, so that the indices agree; named by the piece
/// of a branch that it moves.
fn push_joints(root: &mut Root, model: &Model) -> Result<(), ExportError> {
    let children = model.skeleton.children();
    let branches = model.skeleton.botanical_branches();
    for (i, node) in model.skeleton.nodes.iter().enumerate() {
        let parent_pivot = node
            .parent
            .map_or_else(nalgebra::Vector3::zeros, |p| model.pivot(p.index()));
        let t = model.pivot(i) - parent_pivot;
        let id = NodeId(i as u32);
        let original = node.copy_of.and_then(|o| model.skeleton.name_of(o));
        let mut extras = json!({
            "node_id": node.name.0,
            "branch": branches.name(id),
            "order": branches.order(id),
            "level": node.level,
            "n_tracks": node.n_tracks,
            "kind": node.kind_word(),
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
            name: Some(branches.piece_name(id)),
            translation: Some([t.x as f32, t.y as f32, t.z as f32]),
            ..Node::default()
        });
    }
    Ok(())
}

/// The one scene. The meshes stand beside the joints and not below them: a skin is placed by its
/// joints alone.
fn push_scene(root: &mut Root, meshes: &[Index<Node>]) {
    let nodes = std::iter::once(Index::new(0)).chain(meshes.iter().copied());
    let nodes = nodes.collect();
    root.push(Scene {
        extensions: None,
        extras: None,
        name: Some(TREE.to_owned()),
        nodes,
    });
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

//! The meshes of a forest's templates in its levels of detail, and the materials that they share.

use super::ExportError;
use super::gltf::leaf_picture;
use super::gltf_buffer::BufferBuilder;
use super::gltf_look::{bark, ground, leaf};
use super::gltf_mesh::{Displacement, MeshPart, mesh_of};
use super::gltf_model::Model;
use super::motion_modes::MotionModes;
use crate::geometry::{self, Dressed, FoliageGroup, Mesh};
use crate::model::Ground;
use gltf_json::material::Material;
use gltf_json::{Index, Root};
use std::borrow::Cow;

/// Share of its triangles that a template has in each level of detail, the finest first: a quarter of
/// them where a tree is half as large on the screen. The branches of the skeleton stay in all levels,
/// and bare trees have more than their share in the coarsest.
pub(super) const LEVELS: [f64; 3] = [1.0, 0.25, 0.0625];

/// Wood and leaves of all templates.
pub(super) struct Materials {
    bark: Index<Material>,
    leaf: Option<Index<Material>>,
    ground: Index<Material>,
}

impl Materials {
    /// Adds those of `first`, the first of the templates, which all have in common.
    pub fn push(
        root: &mut Root,
        buffer: &mut BufferBuilder,
        first: &Dressed,
        in_leaf: bool,
    ) -> Result<Self, ExportError> {
        let bark = bark(root, buffer, &first.bark)?;
        let bark = root.push(bark);
        let leaf = match in_leaf {
            true => Some(leaf(root, buffer, leaf_picture(&first.foliage, false))?),
            false => None,
        };
        let ground = root.push(ground());
        Ok(Self { bark, leaf, ground })
    }
}

/// The mesh of a template in a level of detail, with a displacement for every mode of its motion; its
/// numbers are added. `None` where there is nothing to be drawn.
pub(super) fn template_mesh(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    model: &Model,
    level: usize,
    name: &str,
    materials: &Materials,
    motion: Option<&MotionModes>,
) -> Result<Option<gltf_json::Mesh>, ExportError> {
    let wood = wood(model.dressed, level);
    let leaves = leaves(model.dressed, level);
    let mut parts = Vec::with_capacity(2);
    if !wood.indices.is_empty() {
        let targets = displacements(&wood, motion);
        parts.push(MeshPart::without_skin(&wood, &[], materials.bark, targets));
    }
    if let Some(leaf) = materials.leaf
        && !leaves.mesh.indices.is_empty()
    {
        let targets = displacements(&leaves.mesh, motion);
        let (mesh, colours) = (&leaves.mesh, &leaves.colours);
        parts.push(MeshPart::without_skin(mesh, colours, leaf, targets));
    }
    if let Some(first) = parts.first_mut() {
        first.name = format!("{name}_lod{level}");
    }
    match parts.is_empty() {
        true => Ok(None),
        false => mesh_of(root, buffer, model.scale(), &parts).map(Some),
    }
}

/// The mesh of the ground; its numbers are added.
pub(super) fn ground_mesh(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    of: &Ground,
    materials: &Materials,
) -> Result<gltf_json::Mesh, ExportError> {
    let mesh = geometry::ground(of);
    let mut part = MeshPart::without_skin(&mesh, &[], materials.ground, Vec::new());
    part.name = "ground".to_owned();
    mesh_of(root, buffer, 1.0, &[part])
}

fn wood(dressed: &Dressed, level: usize) -> Cow<'_, Mesh> {
    let Some(finest) = dressed.wood.first() else {
        return Cow::Owned(Mesh::default());
    };
    if level == 0 {
        return Cow::Borrowed(finest);
    }
    let triangles = finest.indices.len() as f64 / 3.0 * LEVELS[level];
    Cow::Owned(geometry::wood(&dressed.limbs, triangles.round() as usize))
}

fn leaves(dressed: &Dressed, level: usize) -> FoliageGroup {
    match level {
        0 => dressed.foliage.merged(),
        _ => dressed.foliage.thinned(LEVELS[level]).merged(),
    }
}

fn displacements(mesh: &Mesh, motion: Option<&MotionModes>) -> Vec<Displacement<'static>> {
    let modes = motion.map_or(&[][..], |m| &m.modes);
    let all = modes.iter().enumerate();
    let all = all.map(|(k, mode)| Displacement {
        name: format!("mode_{k}"),
        by: Cow::Owned(mode.displacements(mesh)),
    });
    all.collect()
}

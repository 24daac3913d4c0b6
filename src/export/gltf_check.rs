//! Whether a model can be put into a file that every viewer takes.

use super::ExportError;
use super::gltf_model::Model;
use crate::geometry::{FoliageGroup, Mesh};

/// Joints of a skin are numbered with two bytes.
const MOST_NODES: usize = 1 + u16::MAX as usize;

/// # Errors
/// The first thing that no file can hold.
pub(super) fn check(model: &Model) -> Result<(), ExportError> {
    check_nodes(model)?;
    check_poses(model)?;
    for mesh in &model.dressed.wood {
        check_mesh(model, mesh)?;
    }
    for (k, group) in model.dressed.foliage.groups.iter().enumerate() {
        check_mesh(model, &group.mesh)?;
        check_leaves(model, k, group)?;
    }
    Ok(())
}

fn check_nodes(model: &Model) -> Result<(), ExportError> {
    let nodes = &model.skeleton.nodes;
    if nodes.is_empty() {
        return Err(ExportError::unfit("it has no nodes"));
    }
    if nodes.len() > MOST_NODES {
        return Err(ExportError::unfit(format!(
            "{} nodes are more than the {MOST_NODES} joints of a skin",
            nodes.len()
        )));
    }
    for (i, node) in nodes.iter().enumerate() {
        let after_parent = match node.parent {
            Some(parent) => parent.index() < i,
            None => i == 0,
        };
        if !after_parent {
            return Err(ExportError::unfit(format!(
                "node {i} does not come after its parent"
            )));
        }
        if !node.position.iter().all(|x| has_place(model, *x)) {
            return Err(ExportError::unfit(format!(
                "the position of node {i} is no number"
            )));
        }
    }
    Ok(())
}

/// Whether a length, px, is a number in the file.
fn has_place(model: &Model, length_px: f64) -> bool {
    ((length_px * model.scale()) as f32).is_finite()
}

fn check_poses(model: &Model) -> Result<(), ExportError> {
    let nodes = model.skeleton.nodes.len();
    match model.poses.iter().find(|p| p.joints.len() != nodes) {
        None => Ok(()),
        Some(pose) => Err(ExportError::unfit(format!(
            "the pose of frame {} has {} joints, the tree {nodes}",
            pose.frame,
            pose.joints.len()
        ))),
    }
}

/// What group `k` of the leaves has beside its mesh.
fn check_leaves(model: &Model, k: usize, group: &FoliageGroup) -> Result<(), ExportError> {
    let n = group.mesh.positions.len();
    let lengths = [group.colours.len(), group.sine.len(), group.cosine.len()];
    if lengths != [n; 3] {
        return Err(ExportError::unfit(format!(
            "group {k} of its leaves has vectors of different lengths"
        )));
    }
    let mut ways = group.sine.iter().chain(&group.cosine).flatten();
    if !ways.all(|x| has_place(model, (*x).into())) {
        return Err(ExportError::unfit(format!(
            "group {k} of its leaves moves by what is no number"
        )));
    }
    let against = group.mesh.corners_against_winding();
    if against > 0 {
        return Err(ExportError::unfit(format!(
            "{against} corners in group {k} of its leaves have a normal that points against their triangle"
        )));
    }
    let Some(swings) = model.flutter.get(k) else {
        return Ok(());
    };
    let sound = swings
        .iter()
        .all(|s| s.sine.is_finite() && s.cosine.is_finite());
    if swings.len() != model.poses.len() || !sound {
        return Err(ExportError::unfit(format!(
            "group {k} of its leaves swings in other frames than the tree"
        )));
    }
    Ok(())
}

fn check_mesh(model: &Model, mesh: &Mesh) -> Result<(), ExportError> {
    let n = mesh.positions.len();
    let lengths = [
        mesh.normals.len(),
        mesh.uvs.len(),
        mesh.joints.len(),
        mesh.weights.len(),
    ];
    let whole = mesh.indices.len().is_multiple_of(3);
    if lengths != [n; 4] || !whole || mesh.indices.iter().any(|&i| i as usize >= n) {
        return Err(ExportError::unfit(
            "its mesh has vectors of different lengths or indices beyond them",
        ));
    }
    let joints = model.skeleton.nodes.len();
    let of_tree = mesh
        .joints
        .iter()
        .flatten()
        .all(|&j| usize::from(j) < joints);
    if !of_tree || !is_of_numbers(model, mesh) {
        return Err(ExportError::unfit(
            "its mesh has positions that are no numbers or joints of another tree",
        ));
    }
    Ok(())
}

fn is_of_numbers(model: &Model, mesh: &Mesh) -> bool {
    let mut positions = mesh.positions.iter().flatten();
    positions.all(|x| has_place(model, (*x).into()))
        && mesh.normals.iter().flatten().all(|x| x.is_finite())
        && mesh.uvs.iter().flatten().all(|x| x.is_finite())
        && mesh.weights.iter().flatten().all(|x| x.is_finite())
}

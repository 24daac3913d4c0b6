//! Whether a model can be put into a file that every viewer takes.

use super::ExportError;
use super::gltf::Model;
use crate::shape::{FoliageGroup, Mesh};

/// # Errors
/// The first thing that no file can hold.
pub(super) fn check(model: &Model) -> Result<(), ExportError> {
    let nodes = &model.skeleton.nodes;
    if nodes.is_empty() {
        return Err(ExportError::unfit("it has no nodes"));
    }
    if nodes.len() > 1 + usize::from(u16::MAX) {
        return Err(ExportError::unfit(format!(
            "{} nodes are more than the 65536 joints of a skin",
            nodes.len()
        )));
    }
    for (i, node) in nodes.iter().enumerate() {
        if node.parent.map(|p| p.index()).is_some_and(|p| p >= i)
            || (i > 0) != node.parent.is_some()
        {
            return Err(ExportError::unfit(format!(
                "node {i} does not come after its parent"
            )));
        }
        if !node
            .position
            .coords
            .iter()
            .all(|x| ((x * model.scale()) as f32).is_finite())
        {
            return Err(ExportError::unfit(format!(
                "the position of node {i} is no number"
            )));
        }
    }
    if let Some(p) = model.poses.iter().find(|p| p.joints.len() != nodes.len()) {
        let why = format!(
            "the pose of frame {} has {} joints, the tree {}",
            p.frame,
            p.joints.len(),
            nodes.len()
        );
        return Err(ExportError::unfit(why));
    }
    model
        .dressed
        .wood
        .iter()
        .try_for_each(|mesh| check_mesh(model, mesh))?;
    for (k, group) in model.dressed.foliage.groups.iter().enumerate() {
        check_mesh(model, &group.mesh)?;
        let n = group.mesh.positions.len();
        let FoliageGroup {
            colours,
            sine,
            cosine,
            ..
        } = group;
        if colours.len() != n || sine.len() != n || cosine.len() != n {
            return Err(ExportError::unfit(format!(
                "group {k} of its leaves has vectors of different lengths"
            )));
        }
        if !sine
            .iter()
            .chain(cosine)
            .flatten()
            .all(|x| ((f64::from(*x) * model.scale()) as f32).is_finite())
        {
            return Err(ExportError::unfit(format!(
                "group {k} of its leaves moves by what is no number"
            )));
        }
        let swings = model.flutter.get(k);
        if swings.is_some_and(|s| {
            s.len() != model.poses.len() || !s.iter().flatten().all(|x| x.is_finite())
        }) {
            return Err(ExportError::unfit(format!(
                "group {k} of its leaves swings in other frames than the tree"
            )));
        }
    }
    Ok(())
}

fn check_mesh(model: &Model, mesh: &Mesh) -> Result<(), ExportError> {
    let n = mesh.positions.len();
    let same = [
        mesh.normals.len(),
        mesh.uvs.len(),
        mesh.joints.len(),
        mesh.weights.len(),
    ]
    .iter()
    .all(|&m| m == n);
    if !same
        || !mesh.indices.len().is_multiple_of(3)
        || mesh.indices.iter().any(|&i| i as usize >= n)
    {
        return Err(ExportError::unfit(
            "its mesh has vectors of different lengths or indices beyond them",
        ));
    }
    let numbers = mesh
        .normals
        .iter()
        .flatten()
        .chain(mesh.uvs.iter().flatten())
        .chain(mesh.weights.iter().flatten());
    if !mesh
        .positions
        .iter()
        .flatten()
        .all(|x| ((f64::from(*x) * model.scale()) as f32).is_finite())
        || !mesh
            .joints
            .iter()
            .flatten()
            .all(|&j| usize::from(j) < model.skeleton.nodes.len())
        || !numbers.copied().all(f32::is_finite)
    {
        return Err(ExportError::unfit(
            "its mesh has positions that are no numbers or joints of another tree",
        ));
    }
    Ok(())
}

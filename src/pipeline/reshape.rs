//! Another shape in space for a tree that has been measured.

use crate::config::Config;
use crate::model::{ClusterId, Node, NodeId, NodeName, Outline, Skeleton};
use crate::shape::{Drawn, Topiary, TopiaryError};
use crate::solve::assign_radii;
use crate::{shape, skeleton};

/// Nodes that a tree may have, copies included, to be given another shape: pushing them takes time
/// with their square.
pub const MOST_RESHAPED: usize = 4096;

/// Stands the measured nodes up anew as `config` says. They keep their places in the picture and
/// their names; copies get names that no node had before.
pub fn reshape(old: &Skeleton, outline: &Outline, config: &Config) -> Skeleton {
    let measured = &old.nodes[..old.measured()];
    let flat: Vec<skeleton::Node2d> = measured
        .iter()
        .enumerate()
        .map(|(i, n)| skeleton::Node2d {
            parent: n.parent.map(|p| p.index()),
            level: n.level,
            cluster: i.checked_sub(1).map(|k| ClusterId(k as u32)),
            position_px: old.image_from_model(&n.position),
            certainty: n.certainty,
        })
        .collect();
    let tracks: Vec<u32> = measured.iter().map(|n| n.n_tracks).collect();
    let mut new = shape::build(&flat, &tracks, outline, &config.shape);
    assign_radii(&mut new, outline, config);
    let unused = old
        .nodes
        .iter()
        .map(|n| n.name.0)
        .max()
        .map_or(0, |n| n.saturating_add(1));
    let (kept, copies) = new.nodes.split_at_mut(measured.len());
    for (new, old) in kept.iter_mut().zip(measured) {
        (new.name, new.kind) = (old.name, old.kind);
        new.moves_with = old.moves_with;
    }
    for (name, copy) in (unused..).zip(copies) {
        copy.name = NodeName(name);
    }
    for i in measured.len()..new.nodes.len() {
        new.nodes[i].moves_with = mover_of_copy(&new, &new.nodes[i]);
    }
    new
}

/// The copy of what a copy's original moves with, on the same plane; where that has none there, the
/// original's mover itself.
fn mover_of_copy(skeleton: &Skeleton, copy: &Node) -> Option<NodeId> {
    let original = skeleton.nodes.get(copy.copy_of?.index())?;
    let mover = original.moves_with?;
    let on_plane = |n: &Node| n.copy_of == Some(mover) && n.plane_angle == copy.plane_angle;
    let place = skeleton.nodes.iter().position(on_plane);
    Some(place.map_or(mover, |k| NodeId(k as u32)))
}

/// Cuts the tree to a drawn shape; radii follow from what is left.
///
/// # Errors
/// The shape lies off the tree.
pub fn cut_to(
    skeleton: &Skeleton,
    outline: &Outline,
    drawn: &Drawn,
    config: &Config,
) -> Result<Topiary, TopiaryError> {
    let mut topiary = shape::topiary(
        skeleton,
        outline,
        drawn,
        &config.shape,
        config.wood.seed.into(),
    )?;
    if !topiary.cut.larger {
        let trunk_px = skeleton
            .nodes
            .get(1)
            .map_or(shape::TIP_RADIUS_PX, |top| top.radius);
        let room = shape::room(
            &topiary.skeleton,
            Some(&topiary.shape),
            shape::Silhouette::Drawn,
        );
        shape::thicken(
            &mut topiary.skeleton,
            trunk_px,
            &room,
            &config.wood,
            config.wood.seed.into(),
        );
    }
    Ok(topiary)
}

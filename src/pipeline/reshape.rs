//! Another shape in space for a tree that has been measured.

use crate::config::Config;
use crate::model::{ClusterId, NodeId, NodeName, Outline, Skeleton};
use crate::shape::{Drawn, Terms, Topiary, TopiaryError};
use crate::solve::{assign_radii, in_depth_of};
use crate::{shape, skeleton};

/// Nodes that a tree may have, copies included, to be given another shape: pushing them takes time
/// with their square.
pub const MOST_RESHAPED: usize = 4096;

/// Stands the measured nodes up anew as `config` says. They keep their places in the picture and
/// their names; copies get names that no node had before.
pub fn reshape(old: &Skeleton, outline: &Outline, config: &Config) -> Skeleton {
    let movers = old.foot_and_branches();
    let Flat { nodes, tracks } = Flat::of(old, &movers);
    let mut straight = shape::build(&nodes, &tracks, outline, &config.shape);
    let unused = old
        .nodes
        .iter()
        .map(|n| n.name.0)
        .max()
        .map_or(0, |n| n.saturating_add(1));
    let (kept, copies) = straight.nodes.split_at_mut(movers.len());
    for (new, mover) in kept.iter_mut().zip(&movers) {
        let old = &old.nodes[mover.index()];
        (new.name, new.kind) = (old.name, old.kind);
    }
    for (name, copy) in (unused..).zip(copies) {
        copy.name = NodeName(name);
    }
    if movers.len() == old.measured() {
        assign_radii(&mut straight, outline, config);
        return straight;
    }
    let next = unused.saturating_add(straight.nodes.len() as u32);
    in_depth_of(&straight, old, next)
}

/// How the terms of the push weigh for trees like the one of `skeleton`, of which `samples` were grown
/// in its outline.
pub fn grown_terms(
    skeleton: &Skeleton,
    samples: &[Vec<skeleton::Node2d>],
    outline: &Outline,
    config: &Config,
) -> Terms {
    let Flat { nodes, tracks } = Flat::of(skeleton, &skeleton.foot_and_branches());
    let example = shape::Tuned::of(&nodes, &tracks, outline, &config.shape);
    shape::grown_terms(&example, samples, outline, &config.shape)
}

/// The measured nodes of a tree in the picture, and how many points are on each.
struct Flat {
    nodes: Vec<skeleton::Node2d>,
    tracks: Vec<u32>,
}

impl Flat {
    /// Of a tree whose foot and branches are `movers`.
    fn of(tree: &Skeleton, movers: &[NodeId]) -> Self {
        let mut flat = Self {
            nodes: Vec::with_capacity(movers.len()),
            tracks: Vec::with_capacity(movers.len()),
        };
        for (i, mover) in movers.iter().enumerate() {
            let node = &tree.nodes[mover.index()];
            let carrier = tree.moving_parent(*mover);
            flat.nodes.push(skeleton::Node2d {
                parent: carrier.and_then(|c| movers.iter().position(|m| *m == c)),
                level: node.level,
                cluster: i.checked_sub(1).map(|k| ClusterId(k as u32)),
                position_px: tree.image_from_model(&node.position),
                certainty: node.certainty,
            });
            flat.tracks.push(node.n_tracks);
        }
        flat
    }
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

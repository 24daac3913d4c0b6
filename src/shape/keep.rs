//! A tree that was built anew stands as the old one did, as far as its branches are the same.

use super::envelope::Envelope;
use crate::model::{NodeId, Skeleton};
use nalgebra::{Point3, Rotation3, Vector3};

/// A node of the old tree that goes on in the new one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twin {
    pub old: NodeId,
    /// By how much the rest places of the points that both trees share have moved in the picture, px: the node moves
    /// with them.
    pub moved_px: [f64; 2],
}

/// Halvings of a push that would leave the envelope before it is given up.
const HALVINGS: u32 = 8;

/// For every node of `new` its twin in `old`, copies included: the copy of a node's twin on the same plane.
pub fn twins(new: &Skeleton, old: &Skeleton, measured: &[Option<Twin>]) -> Vec<Option<Twin>> {
    let of = |i: usize| match new.nodes[i].copy_of {
        None => measured.get(i).copied().flatten(),
        Some(original) => {
            let twin = measured.get(original.index()).copied().flatten()?;
            let angle = new.nodes[i].plane_angle;
            let same = |n: &crate::model::Node| n.copy_of == Some(twin.old) && (n.plane_angle - angle).abs() < 1e-9;
            let copy = old.nodes.iter().position(same)?;
            Some(Twin { old: NodeId(copy as u32), ..twin })
        }
    };
    (0..new.nodes.len()).map(of).collect()
}

/// Puts the nodes of `new` that have a twin where that stands in `old`; the others are carried along by the nearest one
/// below them. A branch that the picture shows unchanged then neither jumps nor changes sides between the viewer and the
/// far end. The foot stays, and with it the model's axes.
///
/// A branch may end a little sooner or later, so the old place is as good as the new one as long as the same branches
/// leave from there. Where others do, the node goes to the new fork, or what branches off would run back along it; only
/// its depth stays.
pub fn stand_as_before(new: &mut Skeleton, old: &Skeleton, twins: &[Option<Twin>], envelope: &Envelope) {
    let foot = [new.foot_px[0] - old.foot_px[0], new.foot_px[1] - old.foot_px[1]];
    new.foot_px = old.foot_px;
    let in_old_axes = Vector3::new(foot[0], -foot[1], 0.0);
    // By how much each node is off the place at which it was built.
    let mut carried: Vec<Vector3<f64>> = Vec::with_capacity(new.nodes.len());
    let same_fork = same_forks(new, old, twins);
    for (i, same_fork) in same_fork.into_iter().enumerate() {
        let node = &new.nodes[i];
        let built = if i == 0 { Point3::origin() } else { node.position + in_old_axes };
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), node.plane_angle);
        let place = match twins.get(i).copied().flatten() {
            Some(Twin { old: twin, moved_px: [du, dv] }) => {
                let before = old.nodes[twin.index()].position + turn * Vector3::new(du, -dv, 0.0);
                let copy = node.copy_of.is_some();
                match (i < 2 || same_fork, copy) {
                    (true, _) => before,
                    (false, false) => drawn_in(built, Point3::new(built.x, built.y, before.z), envelope),
                    (false, true) => built,
                }
            }
            None => {
                let below = node.parent.map_or_else(Vector3::zeros, |p| carried[p.index()]);
                // The picture shows where a measured node is; only its depth is free.
                let way = if node.copy_of.is_some() { below } else { Vector3::new(0.0, 0.0, below.z) };
                drawn_in(built, built + way, envelope)
            }
        };
        carried.push(place - built);
        new.nodes[i].position = place;
    }
}

/// For every node of `new` whether the branches that leave from it are those that left from its twin.
fn same_forks(new: &Skeleton, old: &Skeleton, twins: &[Option<Twin>]) -> Vec<bool> {
    let children = |skeleton: &Skeleton| {
        let mut of = vec![Vec::new(); skeleton.nodes.len()];
        for (i, node) in skeleton.nodes.iter().enumerate() {
            if let Some(parent) = node.parent {
                of[parent.index()].push(i);
            }
        }
        of
    };
    let (leave, left) = (children(new), children(old));
    let twin = |i: usize| twins.get(i).copied().flatten().map(|t| t.old.index());
    let same = |i: usize| {
        let mut found: Vec<Option<usize>> = leave[i].iter().map(|&c| twin(c)).collect();
        found.sort_unstable();
        twin(i).is_some_and(|t| found.iter().copied().eq(left[t].iter().map(|&c| Some(c))))
    };
    (0..new.nodes.len()).map(same).collect()
}

/// `wanted`, or as much of the way there from `built` as stays in the envelope.
fn drawn_in(built: Point3<f64>, wanted: Point3<f64>, envelope: &Envelope) -> Point3<f64> {
    let way = wanted - built;
    let options = (0..HALVINGS).map(|k| built + way / f64::from(1u32 << k));
    options.into_iter().find(|p| envelope.contains(p)).unwrap_or(built)
}

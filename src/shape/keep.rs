//! A tree that was built anew stands as the old one did, as far as its branches are the same.

use super::angles::angle_between;
use super::envelope::Envelope;
use crate::model::{Node, NodeId, Skeleton};
use nalgebra::{Point3, Rotation3, Vector3};
use std::f64::consts::FRAC_PI_2;

/// A node of the old tree that goes on in the new one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twin {
    pub old: NodeId,
    /// By how much the rest places of the points that both trees share have moved in the picture,
    /// px: the node moves with them.
    pub moved_px: [f64; 2],
}

/// Halvings of a push that would leave the envelope before it is given up.
const HALVINGS: u32 = 8;

/// For every node of `new` its twin in `old`, copies included: the copy of a node's twin on the
/// same plane.
pub fn twins(new: &Skeleton, old: &Skeleton, measured: &[Option<Twin>]) -> Vec<Option<Twin>> {
    let of = |i: usize| match new.nodes[i].copy_of {
        None => measured.get(i).copied().flatten(),
        Some(original) => {
            let twin = measured.get(original.index()).copied().flatten()?;
            let angle = new.nodes[i].plane_angle;
            let same = |n: &crate::model::Node| {
                n.copy_of == Some(twin.old) && (n.plane_angle - angle).abs() < 1e-9
            };
            let copy = old.nodes.iter().position(same)?;
            Some(Twin {
                old: NodeId(copy as u32),
                ..twin
            })
        }
    };
    (0..new.nodes.len()).map(of).collect()
}

/// The same tree with its foot, and with it the model's axes, at `foot_px`; all else stays where it
/// is in the picture.
pub fn on_foot(mut skeleton: Skeleton, foot_px: [f64; 2]) -> Skeleton {
    let way = Vector3::new(
        skeleton.foot_px[0] - foot_px[0],
        foot_px[1] - skeleton.foot_px[1],
        0.0,
    );
    skeleton
        .nodes
        .iter_mut()
        .skip(1)
        .for_each(|n| n.position += way);
    skeleton.foot_px = foot_px;
    skeleton
}

/// Puts the nodes of `new` that have a twin where that stands in `old`; the others are carried
/// along by the nearest one below them. A branch that the picture shows unchanged then neither
/// jumps nor changes sides between the viewer and the far end. Both trees have the same foot. Gives
/// for every node where its twin has put it, in depth at least; `None` for those that nothing
/// holds.
///
/// A branch may end a little sooner or later, so the old place is as good as the new one as long as
/// the same branches leave from there and they do not turn back: that their turns of more than a
/// right angle exceed it by `turned_back_rad` more than at the new place, in all. Else the node
/// goes to the new fork, and only its depth stays.
pub fn stand_as_before(
    new: &mut Skeleton,
    old: &Skeleton,
    twins: &[Option<Twin>],
    envelope: &Envelope,
    turned_back_rad: f64,
) -> Vec<Option<Point3<f64>>> {
    let twin = |i: usize| twins.get(i).copied().flatten();
    let stood = |(i, node): (usize, &Node)| {
        let Twin {
            old: twin,
            moved_px: [du, dv],
        } = twin(i)?;
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), node.plane_angle);
        Some(old.nodes[twin.index()].position + turn * Vector3::new(du, -dv, 0.0))
    };
    let stood: Vec<Option<Point3<f64>>> = new.nodes.iter().enumerate().map(stood).collect();
    let stays = staying(new, &stood, same_forks(new, old, twins), turned_back_rad);
    // By how much each node is off the place at which it was built.
    let mut carried: Vec<Vector3<f64>> = Vec::with_capacity(new.nodes.len());
    let mut held = vec![None; new.nodes.len()];
    for i in 0..new.nodes.len() {
        let node = &new.nodes[i];
        let (built, copy) = (node.position, node.copy_of.is_some());
        let place = match stood[i] {
            Some(before) if stays[i] => before,
            Some(before) if !copy => {
                drawn_in(built, Point3::new(built.x, built.y, before.z), envelope)
            }
            Some(_) => built,
            None => {
                let below = node
                    .parent
                    .map_or_else(Vector3::zeros, |p| carried[p.index()]);
                // The picture shows where a measured node is; only its depth is free.
                let way = if copy {
                    below
                } else {
                    Vector3::new(0.0, 0.0, below.z)
                };
                drawn_in(built, built + way, envelope)
            }
        };
        held[i] = stood[i].filter(|_| stays[i] || !copy).map(|_| place);
        carried.push(place - built);
        new.nodes[i].position = place;
    }
    held
}

/// Which nodes stay where their twins stood: those from which the same branches leave, unless that
/// makes one of these, or their own, turn back in the picture where the new place does not. A copy
/// does as its original.
fn staying(
    new: &Skeleton,
    stood: &[Option<Point3<f64>>],
    same_fork: Vec<bool>,
    turned_back_rad: f64,
) -> Vec<bool> {
    let mut stays = same_fork;
    stays
        .iter_mut()
        .take(2)
        .for_each(|foot_or_trunk| *foot_or_trunk = true);
    let in_picture = |p: &Point3<f64>| Point3::new(p.x, p.y, 0.0);
    let built = |i: usize| in_picture(&new.nodes[i].position);
    let mut at: Vec<Point3<f64>> = (0..stood.len())
        .map(|i| {
            stood[i]
                .filter(|_| stays[i])
                .map_or_else(|| built(i), |p| in_picture(&p))
        })
        .collect();
    let children = new.children();
    let parent = |i: usize| new.nodes[i].parent.map(|p| p.index());
    for i in 1..new.measured() {
        let (Some(before), Some(below)) = (stood[i].filter(|_| stays[i]), parent(i)) else {
            continue;
        };
        // By how much the branches that meet there turn back, in all.
        let back = |place: &Point3<f64>| {
            let own = parent(below).map(|grand| angle_between(&at[grand], &at[below], place));
            let leaving = children[i]
                .iter()
                .filter(|c| new.nodes[c.index()].copy_of.is_none());
            let leaving = leaving.map(|c| angle_between(&at[below], place, &at[c.index()]));
            leaving
                .chain(own)
                .map(|turn| (turn - FRAC_PI_2).max(0.0))
                .sum::<f64>()
        };
        if back(&in_picture(&before)) > back(&built(i)) + turned_back_rad {
            (stays[i], at[i]) = (false, built(i));
        }
    }
    for i in new.measured()..stays.len() {
        stays[i] &= new.nodes[i]
            .copy_of
            .is_none_or(|original| stays[original.index()]);
    }
    stays
}

/// For every node of `new` whether the branches that leave from it are those that left from its
/// twin.
fn same_forks(new: &Skeleton, old: &Skeleton, twins: &[Option<Twin>]) -> Vec<bool> {
    let (leave, left) = (new.children(), old.children());
    let twin = |i: usize| twins.get(i).copied().flatten().map(|t| t.old);
    let same = |i: usize| {
        let mut found: Vec<Option<NodeId>> = leave[i].iter().map(|c| twin(c.index())).collect();
        found.sort_unstable();
        twin(i).is_some_and(|t| {
            found
                .iter()
                .copied()
                .eq(left[t.index()].iter().map(|&c| Some(c)))
        })
    };
    (0..new.nodes.len()).map(same).collect()
}

/// `wanted`, or as much of the way there from `built` as stays in the envelope.
fn drawn_in(built: Point3<f64>, wanted: Point3<f64>, envelope: &Envelope) -> Point3<f64> {
    let way = wanted - built;
    let options = (0..HALVINGS).map(|k| built + way / f64::from(1u32 << k));
    options
        .into_iter()
        .find(|p| envelope.contains(p))
        .unwrap_or(built)
}

//! A tree that was built anew stands as the old one did, as far as its branches are the same.

use super::angles::angle_between;
use super::envelope::Envelope;
use crate::model::{NodeId, Skeleton};
use nalgebra::{Point2, Point3, Rotation3, Vector2, Vector3};
use std::f64::consts::FRAC_PI_2;

/// A node of the old tree that goes on in the new one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twin {
    pub old: NodeId,
    /// By how much the rest places of the points that both trees share have moved in the picture,
    /// px: the node moves with them.
    pub moved_px: Vector2<f64>,
}

/// Halvings of a push that would leave the envelope before it is given up.
const HALVINGS: u32 = 8;

/// For every node of `new` its twin in `old`, copies included: the copy of a node's twin on the
/// same plane.
pub fn twins(new: &Skeleton, old: &Skeleton, measured: &[Option<Twin>]) -> Vec<Option<Twin>> {
    let mut twins = Vec::with_capacity(new.nodes.len());
    for (i, node) in new.nodes.iter().enumerate() {
        let original = node.copy_of.map_or(i, |o| o.index());
        let twin = measured.get(original).copied().flatten();
        twins.push(match (twin, node.copy_of) {
            (Some(twin), Some(_)) => copy_on_plane(old, twin, node.plane_angle),
            _ => twin,
        });
    }
    twins
}

/// The copy of the node `twin` on the plane at `plane_angle`, radians.
fn copy_on_plane(old: &Skeleton, twin: Twin, plane_angle: f64) -> Option<Twin> {
    let copy = old
        .nodes
        .iter()
        .position(|n| n.copy_of == Some(twin.old) && (n.plane_angle - plane_angle).abs() < 1e-9)?;
    Some(Twin {
        old: NodeId(copy as u32),
        ..twin
    })
}

/// The same tree with its foot, and with it the model's axes, at `foot_px`; all else stays where it
/// is in the picture.
pub fn on_foot(mut skeleton: Skeleton, foot_px: Point2<f64>) -> Skeleton {
    let was_px = skeleton.foot_px;
    let way = Vector3::new(was_px.x - foot_px.x, foot_px.y - was_px.y, 0.0);
    for node in skeleton.nodes.iter_mut().skip(1) {
        node.position += way;
    }
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
pub(super) fn carry_over_positions(
    new: &mut Skeleton,
    old: &Skeleton,
    twins: &[Option<Twin>],
    envelope: &Envelope,
    turned_back_rad: f64,
) -> Vec<Option<Point3<f64>>> {
    let stood = old_places(new, old, twins);
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
        // What a depth camera has seen since says more than where it stood.
        let place = match envelope.seen(i) {
            Some(_) => Point3::new(place.x, place.y, built.z),
            None => place,
        };
        if stood[i].is_some() && (stays[i] || !copy) {
            held[i] = Some(place);
        }
        carried.push(place - built);
        new.nodes[i].position = place;
    }
    held
}

/// Where every node of `new` stood as its twin in `old`, moved with what the picture shows.
fn old_places(new: &Skeleton, old: &Skeleton, twins: &[Option<Twin>]) -> Vec<Option<Point3<f64>>> {
    let mut places = vec![None; new.nodes.len()];
    for ((place, node), twin) in places.iter_mut().zip(&new.nodes).zip(twins) {
        if let Some(Twin {
            old: twin,
            moved_px,
        }) = *twin
        {
            let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), node.plane_angle);
            let moved = turn * Vector3::new(moved_px.x, -moved_px.y, 0.0);
            *place = Some(old.nodes[twin.index()].position + moved);
        }
    }
    places
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
    for foot_or_trunk in stays.iter_mut().take(2) {
        *foot_or_trunk = true;
    }
    let mut picture = Picture::new(new, stood, &stays);
    for i in 1..new.measured() {
        let (Some(before), true) = (stood[i], stays[i]) else {
            continue;
        };
        let Some(below) = new.nodes[i].parent.map(|p| p.index()) else {
            continue;
        };
        let built = in_picture(&new.nodes[i].position);
        let at_old = picture.turning_back(i, below, &in_picture(&before));
        if at_old > picture.turning_back(i, below, &built) + turned_back_rad {
            (stays[i], picture.at[i]) = (false, built);
        }
    }
    for i in new.measured()..stays.len() {
        if let Some(original) = new.nodes[i].copy_of {
            stays[i] &= stays[original.index()];
        }
    }
    stays
}

/// The front view of a tree some of whose nodes stay where they stood.
struct Picture<'a> {
    tree: &'a Skeleton,
    children: Vec<Vec<NodeId>>,
    at: Vec<Point3<f64>>,
}

impl<'a> Picture<'a> {
    fn new(tree: &'a Skeleton, stood: &[Option<Point3<f64>>], stays: &[bool]) -> Self {
        let mut at = Vec::with_capacity(stood.len());
        for (i, node) in tree.nodes.iter().enumerate() {
            let place = stood[i].filter(|_| stays[i]).unwrap_or(node.position);
            at.push(in_picture(&place));
        }
        Self {
            tree,
            children: tree.children(),
            at,
        }
    }

    /// By how much the measured branches that meet in node `i`, which grows from `below`, turn by
    /// more than a right angle if it is at `place`, in all, radians.
    fn turning_back(&self, i: usize, below: usize, place: &Point3<f64>) -> f64 {
        let mut sum = 0.0;
        for child in &self.children[i] {
            if self.tree.nodes[child.index()].copy_of.is_none() {
                let turn = angle_between(&self.at[below], place, &self.at[child.index()]);
                sum += (turn - FRAC_PI_2).max(0.0);
            }
        }
        if let Some(grand) = self.tree.nodes[below].parent {
            let turn = angle_between(&self.at[grand.index()], &self.at[below], place);
            sum += (turn - FRAC_PI_2).max(0.0);
        }
        sum
    }
}

fn in_picture(place: &Point3<f64>) -> Point3<f64> {
    Point3::new(place.x, place.y, 0.0)
}

/// For every node of `new` whether the branches that leave from it are those that left from its
/// twin.
fn same_forks(new: &Skeleton, old: &Skeleton, twins: &[Option<Twin>]) -> Vec<bool> {
    let (leave, left) = (new.children(), old.children());
    let twins: Vec<Option<NodeId>> = (0..new.nodes.len())
        .map(|i| twins.get(i).copied().flatten().map(|t| t.old))
        .collect();
    let mut same = vec![false; new.nodes.len()];
    for (i, twin) in twins.iter().enumerate() {
        let Some(twin) = twin else { continue };
        let mut found: Vec<Option<NodeId>> = leave[i].iter().map(|c| twins[c.index()]).collect();
        found.sort_unstable();
        same[i] = found
            .into_iter()
            .eq(left[twin.index()].iter().map(|&c| Some(c)));
    }
    same
}

/// `wanted`, or as much of the way there from `built` as stays in the envelope.
fn drawn_in(built: Point3<f64>, wanted: Point3<f64>, envelope: &Envelope) -> Point3<f64> {
    let way = wanted - built;
    (0..HALVINGS)
        .map(|k| built + way / f64::from(1u32 << k))
        .find(|p| envelope.contains(p))
        .unwrap_or(built)
}

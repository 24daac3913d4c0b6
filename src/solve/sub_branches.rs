//! Sub-branches: branches that only their own frequency tells from the branch that carries them.
//!
//! The affinity of motion puts a limb's twigs together; after a release their frequencies tell them
//! apart ([`shoots`]). They are added last of all: push, copies, and whether one tree is better
//! than another are of the tree without them.

use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::config::Dynamics;
use crate::dynamics::{Film, FilmTrack, NOT_SEEN, Take, shoots};
use crate::hierarchy::rest_position_px;
use crate::model::{Node, NodeId, NodeKind, NodeName, Skeleton, TrackId, TrackTable};
use nalgebra::{Point2, Point3, Vector2, Vector3};
use std::collections::BTreeSet;

/// Points that decide how far a branch reaches: one alone may be off it.
const FARTHEST: usize = 3;
/// A branch is no shorter than this share of the picture's width: it could not be told from its
/// fork.
const SHORTEST: f64 = 0.01;
/// A tip forks where this share of its first shoot's points is behind, between these shares of its
/// length.
const BEHIND: f64 = 0.25;
const FORKS: Bounds = Bounds::new(0.3, 0.9);
/// So many points that are left on a tip are what it goes on as beyond its fork.
const LEFT: usize = 2;

/// A branch that only its own sway tells.
#[derive(Clone, Debug, PartialEq)]
pub struct SubBranch {
    /// The measured branch that carries it. A tip forks at this share of its length; 1 where it is
    /// none.
    pub on: NodeId,
    pub fork: f64,
    /// Ordered by id.
    pub members: Vec<TrackId>,
    pub name: NodeName,
    /// Where it ends, px. `None` for what a tip goes on as beyond its fork, with the points that
    /// are left: it ends where the tip did.
    pub end_px: Option<Point2<f64>>,
}

/// The sub-branches that the points of `table` show, without names; `node_of` says on which
/// measured node of `skeleton` a point is.
pub(super) fn identify(
    table: &TrackTable,
    skeleton: &Skeleton,
    node_of: impl Fn(TrackId) -> Option<NodeId>,
    config: &Dynamics,
    cancel: &CancelToken,
) -> Vec<SubBranch> {
    let mut points = Vec::new();
    let mut tracks = Vec::new();
    for (row, &id) in table.ids.iter().enumerate() {
        let Some(node) = node_of(id) else { continue };
        let rest_px = rest_position_px(table, row);
        points.push(Point { id, node, rest_px });
        tracks.push(FilmTrack {
            node,
            at_px: table.positions[row].iter().map(place_px).collect(),
        });
    }
    let film = Take::of(Film::new(&table.times_s, tracks)).film;
    let found = shoots(skeleton, &film, config, cancel);
    let mut out = Vec::new();
    for on in (0..skeleton.measured() as u32).map(NodeId) {
        let mut groups: Vec<Vec<&Point>> = Vec::new();
        for group in found.iter().filter(|group| group.on == on) {
            groups.push(group.tracks.iter().map(|&k| &points[k]).collect());
        }
        if !groups.is_empty() {
            out.extend(branches_on(skeleton, on, &groups, &points));
        }
    }
    out
}

/// A followed point with its node and its rest place, px.
struct Point {
    id: TrackId,
    node: NodeId,
    rest_px: Point2<f64>,
}

fn place_px(place: &Option<Point2<f32>>) -> Point2<f64> {
    match place {
        Some(px) => px.cast(),
        None => NOT_SEEN,
    }
}

/// A sub-branch for each group of points on the branch `on`, and where that is a tip, one that
/// continues it with the points that are left.
fn branches_on(
    skeleton: &Skeleton,
    on: NodeId,
    groups: &[Vec<&Point>],
    points: &[Point],
) -> Vec<SubBranch> {
    let mut places: Vec<Vec<Point2<f64>>> = Vec::new();
    for group in groups {
        places.push(group.iter().map(|p| p.rest_px).collect());
    }
    let is_tip = is_tip(skeleton, on);
    let fork = if is_tip {
        forks_at(skeleton, on, &places)
    } else {
        1.0
    };
    let fork_px = skeleton.image_from_model(&along(skeleton, on, fork));
    let mut out = Vec::new();
    for (group, places) in groups.iter().zip(&places) {
        out.push(SubBranch::new(
            on,
            fork,
            group,
            Some(end_px(fork_px, places)),
        ));
    }
    let grouped: BTreeSet<TrackId> = groups.iter().flatten().map(|p| p.id).collect();
    let left: Vec<&Point> = points
        .iter()
        .filter(|p| p.node == on && !grouped.contains(&p.id))
        .collect();
    if is_tip && left.len() >= LEFT {
        out.push(SubBranch::new(on, fork, &left, None));
    }
    out
}

impl SubBranch {
    fn new(on: NodeId, fork: f64, points: &[&Point], end_px: Option<Point2<f64>>) -> Self {
        let mut members: Vec<TrackId> = points.iter().map(|p| p.id).collect();
        members.sort_unstable();
        Self {
            on,
            fork,
            members,
            name: NodeName(0),
            end_px,
        }
    }
}

fn is_tip(skeleton: &Skeleton, node: NodeId) -> bool {
    skeleton.nodes.iter().all(|n| n.parent != Some(node))
}

/// Where a branch begins.
fn begin(skeleton: &Skeleton, node: NodeId) -> Point3<f64> {
    let node = &skeleton.nodes[node.index()];
    node.parent
        .map_or(node.position, |p| skeleton.nodes[p.index()].position)
}

/// The place at a share of a branch's length.
fn along(skeleton: &Skeleton, node: NodeId, share: f64) -> Point3<f64> {
    let (from, to) = (begin(skeleton, node), skeleton.nodes[node.index()].position);
    from + share * (to - from)
}

/// At which share of its length a tip forks: where the first of the sub-branches leaves it that
/// have points at these `places`, px.
fn forks_at(skeleton: &Skeleton, tip: NodeId, places: &[Vec<Point2<f64>>]) -> f64 {
    let from = begin(skeleton, tip);
    let axis = (skeleton.nodes[tip.index()].position - from).xy();
    let from_px = skeleton.image_from_model(&from);
    let mut first = FORKS.hi;
    for places in places {
        let mut shares: Vec<f64> = places
            .iter()
            .map(|place_px| share_along(place_px, from_px, &axis))
            .collect();
        shares.sort_unstable_by(f64::total_cmp);
        let behind = (BEHIND * shares.len() as f64) as usize;
        first = first.min(shares.get(behind).copied().unwrap_or(FORKS.hi));
    }
    first.max(FORKS.lo)
}

/// How far along `axis` (model axes, px) from `from_px` a place in the picture is, as a share of
/// its length.
fn share_along(place_px: &Point2<f64>, from_px: Point2<f64>, axis: &Vector2<f64>) -> f64 {
    let offset = Vector2::new(place_px.x - from_px.x, from_px.y - place_px.y);
    offset.dot(axis) / axis.norm_squared().max(f64::MIN_POSITIVE)
}

/// Where a sub-branch ends that leaves at `fork_px`: at those of its points that are farthest from
/// there.
fn end_px(fork_px: Point2<f64>, places: &[Point2<f64>]) -> Point2<f64> {
    let mut offsets: Vec<Vector2<f64>> = places.iter().map(|p| p - fork_px).collect();
    offsets.sort_by(|a, b| b.norm().total_cmp(&a.norm()));
    offsets.truncate(FARTHEST);
    let mean = offsets.iter().sum::<Vector2<f64>>() / offsets.len().max(1) as f64;
    fork_px + mean
}

/// `skeleton` with a node for each of `branches`, after the measured ones, in order; without radii.
/// A tip that carries some ends at the fork from now on. How deep in space they reach nobody has
/// seen: they stay as deep as the fork.
pub(super) fn with(skeleton: &Skeleton, branches: &[SubBranch]) -> Skeleton {
    let measured = skeleton.measured();
    let mut nodes: Vec<Node> = skeleton.nodes[..measured].to_vec();
    for branch in branches.iter().filter(|b| is_tip(skeleton, b.on)) {
        nodes[branch.on.index()].position = along(skeleton, branch.on, branch.fork);
    }
    for branch in branches {
        let on = nodes[branch.on.index()].clone();
        let position = match branch.end_px {
            Some(end_px) => reaching(skeleton, &on.position, end_px),
            None => skeleton.nodes[branch.on.index()].position,
        };
        nodes.push(Node {
            name: branch.name,
            parent: Some(branch.on),
            level: on.level + 1,
            position,
            n_tracks: branch.members.len() as u32,
            certainty: 0.0,
            kind: NodeKind::Shoot,
            ..on
        });
    }
    let n_new = branches.len() as u32;
    for copy in &skeleton.nodes[measured..] {
        nodes.push(Node {
            parent: copy.parent.map(|id| shifted(id, measured, n_new)),
            copy_of: copy.copy_of.map(|id| shifted(id, measured, n_new)),
            moves_with: copy.moves_with.map(|id| shifted(id, measured, n_new)),
            ..copy.clone()
        });
    }
    Skeleton {
        nodes,
        ..skeleton.clone()
    }
}

/// Where a node stands after `n_new` nodes were put in behind the measured ones.
fn shifted(id: NodeId, measured: usize, n_new: u32) -> NodeId {
    if id.index() < measured {
        id
    } else {
        NodeId(id.0 + n_new)
    }
}

/// The end of a sub-branch from `fork` that is seen at `end_px`.
fn reaching(skeleton: &Skeleton, fork: &Point3<f64>, end_px: Point2<f64>) -> Point3<f64> {
    let fork_px = skeleton.image_from_model(fork);
    let way = Vector3::new(end_px.x - fork_px.x, fork_px.y - end_px.y, 0.0);
    let least = SHORTEST * f64::from(skeleton.image_size.width);
    fork + way.try_normalize(1e-9).unwrap_or_else(Vector3::y) * way.norm().max(least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;

    /// Foot, trunk, a tip that leans to the right and one that leans to the left and away, and a
    /// copy of either.
    fn skeleton() -> Skeleton {
        let node = |name: u32, parent: Option<u32>, at: [f64; 3], copy_of: Option<u32>| Node {
            level: parent.map_or(0, |p| if p == 0 { 1 } else { 2 }),
            copy_of: copy_of.map(NodeId),
            plane_angle: copy_of.map_or(0.0, |_| 1.0),
            ..Node::made_up(name, parent, at)
        };
        let nodes = vec![
            node(0, None, [0.0, 0.0, 0.0], None),
            node(1, Some(0), [0.0, 100.0, 0.0], None),
            node(2, Some(1), [100.0, 100.0, 40.0], None),
            node(3, Some(1), [-50.0, 150.0, -20.0], None),
            node(4, Some(1), [50.0, 100.0, 80.0], Some(2)),
            node(5, Some(1), [-20.0, 150.0, -40.0], Some(3)),
        ];
        Skeleton {
            nodes,
            foot_px: Point2::new(300.0, 300.0),
            image_size: Size {
                width: 640,
                height: 360,
            },
        }
    }

    /// Points that leave the first tip in its middle, upwards.
    fn places() -> Vec<Point2<f64>> {
        (0..5)
            .map(|k| Point2::new(350.0 + f64::from(k), 200.0 - 10.0 * f64::from(k)))
            .collect()
    }

    /// One with those points, and what the tip goes on as.
    fn two_shoots() -> [SubBranch; 2] {
        let before = skeleton();
        let fork = forks_at(&before, NodeId(2), &[places()]);
        let end_px = end_px(
            before.image_from_model(&along(&before, NodeId(2), fork)),
            &places(),
        );
        let members = |ids: std::ops::Range<u32>| ids.map(TrackId).collect();
        [(6, 0..5, Some(end_px)), (7, 7..9, None)].map(|(name, ids, end_px)| SubBranch {
            on: NodeId(2),
            fork,
            members: members(ids),
            name: NodeName(name),
            end_px,
        })
    }

    /// A line drawn from the tip back to a branch that leaves in its middle is what anyone would
    /// see at once.
    #[test]
    fn a_tip_forks_where_its_shoot_begins_and_goes_on_to_where_it_ended() {
        let before = skeleton();
        let after = with(&before, &two_shoots());
        assert_eq!(after.measured(), 6);
        let fork = after.nodes[2].position;
        assert!(
            (fork - Point3::new(51.0, 100.0, 20.4)).norm() < 1e-9,
            "{fork}"
        );
        let (shoot, rest) = (&after.nodes[4], &after.nodes[5]);
        assert_eq!(
            (shoot.name, shoot.parent, shoot.level, shoot.n_tracks),
            (NodeName(6), Some(NodeId(2)), 3, 5)
        );
        assert!(
            (shoot.position - Point3::new(53.0, 130.0, 20.4)).norm() < 1e-9,
            "{}",
            shoot.position
        );
        assert_eq!(
            (rest.name, rest.parent, rest.position),
            (NodeName(7), Some(NodeId(2)), before.nodes[2].position)
        );
    }

    /// Files and poses find a copy's original by its place.
    #[test]
    fn copies_stay_what_they_were_and_where() {
        let before = skeleton();
        let after = with(&before, &two_shoots());
        for (was, is) in before.nodes[4..].iter().zip(&after.nodes[6..]) {
            assert_eq!(
                (was.name, was.position, was.copy_of, was.parent),
                (is.name, is.position, is.copy_of, is.parent)
            );
        }
        // A copy on a copy.
        let mut deep = before;
        let mut twig = deep.nodes[5].clone();
        (twig.name, twig.parent, twig.copy_of) = (NodeName(9), Some(NodeId(5)), Some(NodeId(3)));
        deep.nodes.push(twig);
        let after = with(&deep, &two_shoots()[..1]);
        assert_eq!(
            (after.nodes[7].parent, after.nodes[7].copy_of),
            (Some(NodeId(6)), Some(NodeId(3)))
        );
    }

    /// Points in one place, or none that are known, must not make a branch without a length: it
    /// could not be posed.
    #[test]
    fn no_shoot_is_without_length() {
        let at_one = [Point2::new(351.0, 200.0); 5];
        let far_away = [Point2::new(f64::MAX, f64::MIN)];
        for places in [&at_one[..], &[], &far_away] {
            let fork = forks_at(&skeleton(), NodeId(2), &[places.to_vec()]);
            assert!(FORKS.contains(fork), "{fork}");
        }
        let [mut shoot, _] = two_shoots();
        shoot.end_px =
            Some(skeleton().image_from_model(&along(&skeleton(), NodeId(2), shoot.fork)));
        let after = with(&skeleton(), &[shoot]);
        let length = (after.nodes[4].position - after.nodes[2].position).norm();
        assert!((length - 6.4).abs() < 1e-9, "{length}");
        assert_eq!(end_px(Point2::new(5.0, 6.0), &[]), Point2::new(5.0, 6.0));
    }
}

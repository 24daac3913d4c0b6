//! Branches that only their own sway tells: a refinement adds them to the tree that stands.
//!
//! Likeness of motion puts a limb's twigs together; after a release their frequencies tell them
//! apart ([`shoots`]). They are added last of all: push, copies, and whether one tree is better
//! than another are of the tree without them. So whatever is told of them, the tree itself stands
//! as it did.

use crate::cancel::CancelToken;
use crate::config::Dynamics;
use crate::dynamics::{Film, FilmTrack, shoots};
use crate::hierarchy::rest_position_px;
use crate::model::{Node, NodeId, NodeKind, NodeName, Skeleton, TrackId};
use crate::track::TrackTable;
use nalgebra::{Point3, Vector2, Vector3};

/// Points by which it is told how far a branch reaches: one alone may be off it.
const FARTHEST: usize = 3;
/// A branch is no shorter than this share of the picture's width: it could not be told from its
/// fork.
const SHORTEST: f64 = 0.01;
/// A tip forks where this share of its first shoot's points is behind, between these shares of its
/// length.
const BEHIND: f64 = 0.25;
const FORKS: [f64; 2] = [0.3, 0.9];
/// So many points that are left on a tip are what it goes on as beyond its fork.
const LEFT: usize = 2;

/// A branch that only its own sway tells.
#[derive(Clone, Debug, PartialEq)]
pub struct Shoot {
    /// The measured branch that carries it. A tip forks at this share of its length; 1 where it is
    /// none.
    pub on: NodeId,
    pub fork: f64,
    /// Ordered by id.
    pub members: Vec<TrackId>,
    pub name: NodeName,
    /// Where it ends, px. `None` for what a tip goes on as beyond its fork, with the points that
    /// are left: it ends where the tip did.
    pub end_px: Option<[f64; 2]>,
}

/// The shoots that the points of `table` tell, without names; `node_of` says on which measured node
/// of `skeleton` a point is.
pub(super) fn told(
    table: &TrackTable,
    skeleton: &Skeleton,
    node_of: impl Fn(TrackId) -> Option<NodeId>,
    config: &Dynamics,
    cancel: &CancelToken,
) -> Vec<Shoot> {
    let at = |p: &Option<[f32; 2]>| p.map_or([f64::NAN; 2], |p| p.map(f64::from));
    let on_tree = |row: usize| Some((row, node_of(table.ids[row])?));
    let (rows, nodes): (Vec<usize>, Vec<NodeId>) = (0..table.ids.len()).filter_map(on_tree).unzip();
    let track = |(&row, &node): (&usize, &NodeId)| FilmTrack {
        node,
        at_px: table.positions[row].iter().map(at).collect(),
    };
    let film = Film::new(&table.times_s, rows.iter().zip(&nodes).map(track).collect());
    let rest_px: Vec<[f64; 2]> = rows
        .iter()
        .map(|&row| rest_position_px(table, row))
        .collect();
    let told = shoots(skeleton, &film, config, cancel);
    let mut out = Vec::new();
    for on in (0..skeleton.measured() as u32).map(NodeId) {
        let of_this: Vec<&Vec<usize>> = told
            .iter()
            .filter(|s| s.on == on)
            .map(|s| &s.tracks)
            .collect();
        if of_this.is_empty() {
            continue;
        }
        let places = |tracks: &[usize]| tracks.iter().map(|&k| rest_px[k]).collect::<Vec<_>>();
        let all: Vec<Vec<[f64; 2]>> = of_this.iter().map(|t| places(t)).collect();
        let fork = if is_tip(skeleton, on) {
            forks_at(skeleton, on, &all)
        } else {
            1.0
        };
        let from = skeleton.image_from_model(&along(skeleton, on, fork));
        let shoot = |tracks: &[usize], end_px: Option<[f64; 2]>| {
            let mut members: Vec<TrackId> = tracks.iter().map(|&k| table.ids[rows[k]]).collect();
            members.sort_unstable();
            Shoot {
                on,
                fork,
                members,
                name: NodeName(0),
                end_px,
            }
        };
        out.extend(
            of_this
                .iter()
                .zip(&all)
                .map(|(tracks, places)| shoot(tracks, Some(end_px(from, places)))),
        );
        let left: Vec<usize> = (0..rows.len())
            .filter(|k| nodes[*k] == on && !of_this.iter().any(|t| t.contains(k)))
            .collect();
        if is_tip(skeleton, on) && left.len() >= LEFT {
            out.push(shoot(&left, None));
        }
    }
    out
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

/// At which share of its length a tip forks: where the first of the shoots leaves it that have
/// points at these `places`, px.
fn forks_at(skeleton: &Skeleton, tip: NodeId, places: &[Vec<[f64; 2]>]) -> f64 {
    let from = begin(skeleton, tip);
    let (way, [u, v]) = (
        (skeleton.nodes[tip.index()].position - from).xy(),
        skeleton.image_from_model(&from),
    );
    let share = |at: &[f64; 2]| {
        Vector2::new(at[0] - u, v - at[1]).dot(&way) / way.norm_squared().max(f64::MIN_POSITIVE)
    };
    let leaves = |places: &Vec<[f64; 2]>| {
        let mut shares: Vec<f64> = places.iter().map(share).collect();
        shares.sort_unstable_by(f64::total_cmp);
        shares
            .get((BEHIND * shares.len() as f64) as usize)
            .copied()
            .unwrap_or(FORKS[1])
    };
    places
        .iter()
        .map(leaves)
        .fold(FORKS[1], f64::min)
        .max(FORKS[0])
}

/// Where a shoot ends that leaves at `fork`, px: at those of its points that are farthest from
/// there.
fn end_px(fork: [f64; 2], places: &[[f64; 2]]) -> [f64; 2] {
    let way = |p: &[f64; 2]| Vector2::new(p[0] - fork[0], p[1] - fork[1]);
    let mut ways: Vec<Vector2<f64>> = places.iter().map(way).collect();
    ways.sort_by(|a, b| b.norm().total_cmp(&a.norm()));
    ways.truncate(FARTHEST);
    let way = ways.iter().sum::<Vector2<f64>>() / ways.len().max(1) as f64;
    [fork[0] + way.x, fork[1] + way.y]
}

/// `skeleton` with a node for each of `shoots`, after the measured ones, in order; without radii. A
/// tip that carries some ends at the fork from now on. How deep in space they reach nobody has
/// seen: they stay as deep as the fork.
pub(super) fn with(skeleton: &Skeleton, shoots: &[Shoot]) -> Skeleton {
    let (measured, more) = (skeleton.measured(), shoots.len() as u32);
    let shifted = |id: NodeId| {
        if id.index() < measured {
            id
        } else {
            NodeId(id.0 + more)
        }
    };
    let mut nodes: Vec<Node> = skeleton.nodes[..measured].to_vec();
    for shoot in shoots.iter().filter(|s| is_tip(skeleton, s.on)) {
        nodes[shoot.on.index()].position = along(skeleton, shoot.on, shoot.fork);
    }
    for shoot in shoots {
        let on = nodes[shoot.on.index()].clone();
        let position = match shoot.end_px {
            Some(end_px) => reaching(skeleton, &on.position, end_px),
            None => skeleton.nodes[shoot.on.index()].position,
        };
        let (level, n_tracks) = (on.level + 1, shoot.members.len() as u32);
        nodes.push(Node {
            name: shoot.name,
            parent: Some(shoot.on),
            level,
            position,
            n_tracks,
            certainty: 0.0,
            kind: NodeKind::Shoot,
            ..on
        });
    }
    let copy = |node: &Node| Node {
        parent: node.parent.map(shifted),
        copy_of: node.copy_of.map(shifted),
        ..node.clone()
    };
    nodes.extend(skeleton.nodes[measured..].iter().map(copy));
    Skeleton {
        nodes,
        ..skeleton.clone()
    }
}

/// The end of a shoot from `fork` that is seen at `end_px`.
fn reaching(skeleton: &Skeleton, fork: &Point3<f64>, end_px: [f64; 2]) -> Point3<f64> {
    let [u, v] = skeleton.image_from_model(fork);
    let way = Vector3::new(end_px[0] - u, v - end_px[1], 0.0);
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
            name: NodeName(name),
            parent: parent.map(NodeId),
            level: parent.map_or(0, |p| if p == 0 { 1 } else { 2 }),
            position: at.into(),
            radius: 1.0,
            n_tracks: 9,
            certainty: 0.5,
            copy_of: copy_of.map(NodeId),
            plane_angle: copy_of.map_or(0.0, |_| 1.0),
            kind: Default::default(),
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
            foot_px: [300.0, 300.0],
            image_size: Size {
                width: 640,
                height: 360,
            },
        }
    }

    /// Points that leave the first tip in its middle, upwards.
    fn places() -> Vec<[f64; 2]> {
        (0..5)
            .map(|k| [350.0 + f64::from(k), 200.0 - 10.0 * f64::from(k)])
            .collect()
    }

    /// One with those points, and what the tip goes on as.
    fn two_shoots() -> [Shoot; 2] {
        let before = skeleton();
        let fork = forks_at(&before, NodeId(2), &[places()]);
        let end_px = end_px(
            before.image_from_model(&along(&before, NodeId(2), fork)),
            &places(),
        );
        let members = |ids: std::ops::Range<u32>| ids.map(TrackId).collect();
        [(6, 0..5, Some(end_px)), (7, 7..9, None)].map(|(name, ids, end_px)| Shoot {
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
        for places in [&[[351.0, 200.0]; 5][..], &[], &[[f64::MAX, f64::MIN]]] {
            let fork = forks_at(&skeleton(), NodeId(2), &[places.to_vec()]);
            assert!((FORKS[0]..=FORKS[1]).contains(&fork), "{fork}");
        }
        let [mut shoot, _] = two_shoots();
        shoot.end_px =
            Some(skeleton().image_from_model(&along(&skeleton(), NodeId(2), shoot.fork)));
        let after = with(&skeleton(), &[shoot]);
        let length = (after.nodes[4].position - after.nodes[2].position).norm();
        assert!((length - 6.4).abs() < 1e-9, "{length}");
        assert_eq!(end_px([5.0, 6.0], &[]), [5.0, 6.0]);
    }
}

//! Which marker carries which, where nobody says it: by their places on the branches of the tree of all points.

use crate::model::{NodeId, Skeleton};
use nalgebra::Point2;

/// A marker and what is known of it.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// Where it rests, px.
    pub rest_px: Point2<f64>,
    /// The node of the tree of all points that it moves with; `None` where it moves like none.
    pub moves_with: Option<NodeId>,
}

/// What carries a marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Carried {
    /// The marker that does, by index; `None` for the foot.
    pub parent: Option<usize>,
    /// Place and motion agree on it.
    pub is_certain: bool,
}

/// A place on the piece between a node and its parent.
#[derive(Clone, Copy, Debug)]
struct OnPiece {
    node: NodeId,
    /// How far along it is from the parent, as a share of the piece; beyond an end it is below 0 or above 1.
    share: f64,
}

/// What carries each marker: it lies on the piece of the tree that is nearest to it in the picture, and the next
/// marker along the pieces from there to the foot carries it. One that moves like no branch is on
/// none: the foot carries it, and it carries nothing.
///
/// A point is put on the end of the branches with which it moves, so that its node says which branches come into
/// question, but not how far along them it is. Where the nearest of these pieces has another marker before
/// it than the nearest of all, the parent is not certain.
pub fn carried(markers: &[Placed], skeleton: &Skeleton) -> Vec<Carried> {
    let mut places = Vec::with_capacity(markers.len());
    for marker in markers {
        let place = marker.moves_with.and_then(|_| {
            let all = (0..skeleton.nodes.len()).map(|k| NodeId(k as u32));
            nearest(marker.rest_px, all, skeleton)
        });
        places.push(place);
    }
    let mut all = Vec::with_capacity(markers.len());
    for (k, marker) in markers.iter().enumerate() {
        let parent = places[k].and_then(|place| before(k, place, &places, skeleton));
        let by_motion = marker.moves_with.and_then(|node| {
            let own = std::iter::once(node).chain(skeleton.ancestors(node));
            let place = nearest(marker.rest_px, own, skeleton)?;
            before(k, place, &places, skeleton)
        });
        all.push(Carried {
            parent,
            is_certain: markers.len() == 1 || marker.moves_with.is_some() && parent == by_motion,
        });
    }
    all
}

/// The place on these pieces that is nearest in the picture; `None` of no piece.
fn nearest(
    rest_px: Point2<f64>,
    nodes: impl Iterator<Item = NodeId>,
    skeleton: &Skeleton,
) -> Option<OnPiece> {
    let mut best: Option<(f64, OnPiece)> = None;
    for id in nodes {
        let node = &skeleton.nodes[id.index()];
        let Some(parent) = node.parent.filter(|_| node.copy_of.is_none()) else {
            continue;
        };
        let base_px = skeleton.image_from_model(&skeleton.nodes[parent.index()].position);
        let piece = skeleton.image_from_model(&node.position) - base_px;
        let squares = piece.norm_squared().max(f64::MIN_POSITIVE);
        let share = (rest_px - base_px).dot(&piece) / squares;
        let off_px = (base_px + piece * share.clamp(0.0, 1.0) - rest_px).norm();
        if best.is_none_or(|(best_px, _)| off_px < best_px) {
            best = Some((off_px, OnPiece { node: id, share }));
        }
    }
    best.map(|(_, place)| place)
}

/// The next marker from a place to the foot, other than `own`. Of two in one place the first comes first.
fn before(
    own: usize,
    place: OnPiece,
    places: &[Option<OnPiece>],
    skeleton: &Skeleton,
) -> Option<usize> {
    let on_own = last_on(place.node, places, |k, share| {
        share < place.share || (share == place.share && k < own)
    });
    on_own.or_else(|| {
        let mut below = skeleton.ancestors(place.node);
        below.find_map(|node| last_on(node, places, |k, _| k != own))
    })
}

/// The marker on a piece that is farthest from the foot, of those that `may_be`.
fn last_on(
    node: NodeId,
    places: &[Option<OnPiece>],
    may_be: impl Fn(usize, f64) -> bool,
) -> Option<usize> {
    let mut last: Option<(usize, f64)> = None;
    for (k, place) in places.iter().enumerate() {
        let on_it = place.filter(|place| place.node == node && may_be(k, place.share));
        if let Some(place) = on_it
            && last.is_none_or(|(_, share)| place.share >= share)
        {
            last = Some((k, place.share));
        }
    }
    last.map(|(k, _)| k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Node, NodeKind, NodeName, Size};
    use nalgebra::Point3;

    /// A trunk of 200 px with a branch to the right at half of its height, and one to the left at its end.
    fn forked() -> Skeleton {
        let places = [
            (None, [0.0, 0.0]),
            (Some(0), [0.0, 100.0]),
            (Some(1), [0.0, 200.0]),
            (Some(1), [80.0, 140.0]),
            (Some(2), [-60.0, 260.0]),
        ];
        let mut nodes = Vec::new();
        for (k, (parent, [x, y])) in places.into_iter().enumerate() {
            nodes.push(Node {
                name: NodeName(k as u32),
                parent: parent.map(NodeId),
                level: 0,
                position: Point3::new(x, y, 0.0),
                radius: 1.0,
                n_tracks: 0,
                kind: NodeKind::Measured,
                certainty: 1.0,
                copy_of: None,
                plane_angle: 0.0,
                moves_with: None,
            });
        }
        Skeleton {
            nodes,
            foot_px: Point2::new(160.0, 300.0),
            image_size: Size::new(320, 320),
        }
    }

    /// A marker at a place of the model that moves with a node.
    fn placed(x: f64, y: f64, moves_with: Option<u32>) -> Placed {
        Placed {
            rest_px: Point2::new(160.0 + x, 300.0 - y),
            moves_with: moves_with.map(NodeId),
        }
    }

    fn sure(parent: Option<usize>) -> Carried {
        Carried {
            parent,
            is_certain: true,
        }
    }

    /// All points of a branch are on its end: where a marker is on it follows from the picture alone.
    #[test]
    fn the_next_marker_towards_the_foot_carries() {
        let markers = [
            placed(-40.0, 241.0, Some(4)),
            placed(2.0, 60.0, Some(4)),
            placed(-1.0, 190.0, Some(4)),
            placed(60.0, 130.0, Some(3)),
            placed(1.0, 150.0, Some(4)),
        ];
        let expected = [Some(2), None, Some(4), Some(1), Some(1)];
        assert_eq!(carried(&markers, &forked()), expected.map(sure));
    }

    /// The wood is often drawn too short.
    #[test]
    fn beyond_a_tip_the_inner_marker_carries_in_any_order() {
        let [inner, outer] = [placed(-64.0, 264.0, Some(4)), placed(-90.0, 290.0, Some(4))];
        assert_eq!(
            carried(&[inner, outer], &forked()),
            [None, Some(0)].map(sure)
        );
        assert_eq!(
            carried(&[outer, inner], &forked()),
            [Some(1), None].map(sure)
        );
    }

    #[test]
    fn a_marker_that_moves_like_no_branch_is_on_none() {
        let markers = [
            placed(0.0, 60.0, Some(2)),
            placed(0.0, 150.0, None),
            placed(0.0, 190.0, Some(2)),
        ];
        let all = carried(&markers, &forked());
        assert_eq!((all[0], all[2]), (sure(None), sure(Some(0))));
        assert_eq!((all[1].parent, all[1].is_certain), (None, false));
    }

    #[test]
    fn where_place_and_motion_disagree_the_parent_is_not_certain() {
        let markers = [
            placed(0.0, 150.0, Some(4)),
            placed(-50.0, 250.0, Some(3)),
            placed(40.0, 120.0, Some(3)),
        ];
        let all = carried(&markers, &forked());
        assert_eq!((all[1].parent, all[1].is_certain), (Some(0), false));
        assert_eq!(all[2], sure(None));
    }
}

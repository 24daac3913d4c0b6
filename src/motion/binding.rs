//! Which track moves which node, and where the tracks of a frame put every node in the picture.

use super::local::{self, Nearby};
use crate::model::{
    MotionHierarchy, NodeDepth, NodeId, Observation, RestDepths, Skeleton, TrackId, TrackSet,
};
use nalgebra::{Point2, Vector2};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A later track is given to the nearest tip only within so many times the mean distance between
/// tips.
const REACH: f64 = 2.0;
/// The points around a node count over this share of the picture's width at least.
const LEAST: f64 = 0.01;

/// A track's node and the place in the picture to which it belongs at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bound {
    node: NodeId,
    rest_px: Point2<f64>,
}

/// Tracks bound to the measured nodes of a skeleton.
pub struct Binding {
    tracks: BTreeMap<TrackId, Option<Bound>>,
    /// Those that move nothing, bound or not.
    left_out: BTreeSet<TrackId>,
    /// Of each measured node the one in which the branch ends that carries it; `None` for those
    /// that move with another one.
    parents: Vec<Option<NodeId>>,
    /// Projection of each measured node at rest, px.
    rest_px: Vec<Point2<f64>>,
    tips: Vec<NodeId>,
    reach_px: f64,
    least_px: f64,
    /// Points of the present frame by node; kept for their memory.
    collected: Vec<Vec<Nearby>>,
    /// What a depth camera has seen of the tree at rest.
    depths: Option<Arc<RestDepths>>,
    /// How far towards the viewer each measured node is at rest, px.
    rest_z_px: Vec<f64>,
}

impl Binding {
    /// Binds the members of `hierarchy` to the nodes of `skeleton`; of those that move on their
    /// own, node k + 1 belongs to cluster k. `rest_px` holds the rest positions of all tracks that
    /// were there when the tree was built; those that are in no cluster did not move or
    /// contradicted their neighbours, and stay unbound.
    pub fn new(
        hierarchy: &MotionHierarchy,
        rest_px: &BTreeMap<TrackId, Point2<f64>>,
        skeleton: &Skeleton,
    ) -> Self {
        let nodes = &skeleton.nodes[..skeleton.measured()];
        let mut tracks: BTreeMap<TrackId, Option<Bound>> =
            rest_px.keys().map(|id| (*id, None)).collect();
        // Deeper clusters come later and overwrite: each track ends at the deepest node that it
        // belongs to.
        let moving: Vec<NodeId> = skeleton.measured_branches().collect();
        for (cluster, &node) in hierarchy.clusters.iter().zip(&moving) {
            for id in &cluster.members {
                if let Some(&rest_px) = rest_px.get(id) {
                    tracks.insert(*id, Some(Bound { node, rest_px }));
                }
            }
        }
        let mut parents: Vec<Option<NodeId>> = vec![None; nodes.len()];
        let mut is_tip = vec![true; nodes.len()];
        for &node in &moving {
            parents[node.index()] = skeleton.moving_parent(node);
            if let Some(parent) = parents[node.index()] {
                is_tip[parent.index()] = false;
            }
        }
        let tips: Vec<NodeId> = moving.into_iter().filter(|n| is_tip[n.index()]).collect();
        let rest: Vec<Point2<f64>> = nodes
            .iter()
            .map(|n| skeleton.image_from_model(&n.position))
            .collect();
        Self {
            reach_px: REACH * mean_gap(&tips, &rest),
            tracks,
            left_out: BTreeSet::new(),
            parents,
            collected: vec![Vec::new(); nodes.len()],
            rest_px: rest,
            rest_z_px: nodes.iter().map(|n| n.position.z).collect(),
            depths: None,
            tips,
            least_px: LEAST * f64::from(skeleton.image_size.width),
        }
    }

    /// Takes over tracks that an older tree knew, with the node and the rest place (px) that each
    /// has here.
    pub fn inherit(&mut self, tracks: &BTreeMap<TrackId, (NodeId, Point2<f64>)>) {
        for (&id, &(node, rest_px)) in tracks {
            self.tracks.insert(id, Some(Bound { node, rest_px }));
        }
    }

    /// Takes what a depth camera has seen of the tree at rest.
    pub fn see_depths(&mut self, depths: Option<Arc<RestDepths>>) {
        self.depths = depths;
    }

    /// How far towards the viewer the tracks put each measured node, model axes; `None` where none of
    /// them has a depth. Empty in a film without depth.
    pub fn target_depths(&self, set: &TrackSet) -> Vec<Option<NodeDepth>> {
        let Some(depths) = &self.depths else {
            return Vec::new();
        };
        let mut seen: Vec<DepthsOfNode> = vec![DepthsOfNode::default(); self.parents.len()];
        for o in &set.observations {
            let Some(bound) = self.moving(o) else {
                continue;
            };
            let Some((now, rest)) = o.depth.zip(depths.tracks.get(&o.id).copied()) else {
                continue;
            };
            let (now, rest) = (depths.in_model(now), depths.in_model(rest));
            for node in self.carriers(bound.node) {
                seen[node.index()].points.push(Nearby {
                    displacement: Vector2::new(now.z_px - rest.z_px, 0.0),
                    offset: bound.rest_px - self.rest_px[node.index()],
                });
                seen[node.index()].precision +=
                    (now.sd_px * now.sd_px + rest.sd_px * rest.sd_px).recip();
            }
        }
        let mut out = Vec::with_capacity(seen.len());
        for (mut seen, rest_z_px) in seen.into_iter().zip(&self.rest_z_px) {
            let moved = seen.moved(self.least_px);
            out.push(moved.map(|moved| NodeDepth {
                z_px: rest_z_px + moved.z_px,
                ..moved
            }));
        }
        out
    }

    /// Where a point is bound that moves something.
    fn moving(&self, o: &Observation) -> Option<Bound> {
        let bound = self.tracks.get(&o.id).copied().flatten()?;
        (!self.left_out.contains(&o.id)).then_some(bound)
    }

    /// A node and all that carry it.
    fn carriers(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        std::iter::successors(Some(node), |node| self.parents[node.index()])
    }

    /// Tracks that move nothing from now on. They stay on their nodes.
    pub fn leave_out(&mut self, tracks: &BTreeSet<TrackId>) {
        self.left_out.extend(tracks);
    }

    /// Every bound track with its deepest node and its rest place, px; those that have been lost
    /// among them.
    pub fn bound(&self) -> impl Iterator<Item = (TrackId, NodeId, Point2<f64>)> {
        self.tracks
            .iter()
            .filter_map(|(id, bound)| bound.map(|b| (*id, b.node, b.rest_px)))
    }

    /// How many tracks are bound to each measured node or to what it carries; those that have been
    /// lost among them.
    pub fn count_tracks(&self) -> Vec<u32> {
        let mut count = vec![0; self.parents.len()];
        for (_, node, _) in self.bound() {
            for carrier in self.carriers(node) {
                count[carrier.index()] += 1;
            }
        }
        count
    }

    /// The deepest node that a track belongs to.
    pub fn node_of(&self, track: TrackId) -> Option<NodeId> {
        self.tracks.get(&track)?.map(|b| b.node)
    }

    /// Where the tracks put each measured node, px; `None` where none of its tracks was seen. The
    /// foot never moves.
    ///
    /// Tracks that are new and confirmed are bound to the tip that is nearest to them in this
    /// frame, if one is near enough.
    pub fn targets_px(&mut self, set: &TrackSet) -> Vec<Option<Point2<f64>>> {
        self.collect(set);
        let mut targets: Vec<Option<Point2<f64>>> = self
            .collected
            .iter_mut()
            .zip(&self.rest_px)
            .map(|(d, rest)| local::displacement(d, self.least_px).map(|d| rest + d))
            .collect();
        for o in &set.observations {
            if o.confirmed && !self.tracks.contains_key(&o.id) {
                let at = o.at_px();
                // Decided once: a point of the background stays unbound when a branch swings near
                // it later.
                if let Some((tip, target)) = self.nearest_tip(at, &targets) {
                    let rest_px = self.rest_px[tip.index()] + (at - target);
                    let near = distance(at, target) <= self.reach_px;
                    let bound = near.then_some(Bound { node: tip, rest_px });
                    self.tracks.insert(o.id, bound);
                }
            }
        }
        if let Some(foot) = targets.first_mut() {
            *foot = self.rest_px.first().copied();
        }
        targets
    }

    /// The tip nearest to the place `at`, px, and where it is in this frame; `None` if no tip's
    /// place is known.
    fn nearest_tip(
        &self,
        at: Point2<f64>,
        targets: &[Option<Point2<f64>>],
    ) -> Option<(NodeId, Point2<f64>)> {
        let placed = self
            .tips
            .iter()
            .filter_map(|&tip| Some((tip, self.expected_px(tip, targets)?)));
        placed.min_by(|a, b| distance(at, a.1).total_cmp(&distance(at, b.1)))
    }

    /// Where a tip is, px. One that has lost all its tracks is where the nearest branch below it
    /// that is seen would carry it.
    fn expected_px(&self, tip: NodeId, targets: &[Option<Point2<f64>>]) -> Option<Point2<f64>> {
        let mut carrier = tip;
        let target = loop {
            match targets[carrier.index()] {
                Some(target) => break target,
                None => carrier = self.parents[carrier.index()]?,
            }
        };
        let (rest, own) = (self.rest_px[carrier.index()], self.rest_px[tip.index()]);
        // The last bits depend on the order of the sum.
        Some(own + target.coords - rest.coords)
    }

    /// Every track's displacement goes to its node and to all nodes above it.
    fn collect(&mut self, set: &TrackSet) {
        self.collected.iter_mut().for_each(Vec::clear);
        for o in &set.observations {
            let Some(bound) = self.moving(o) else {
                continue;
            };
            let displacement = o.at_px() - bound.rest_px;
            let mut at = Some(bound.node);
            while let Some(node) = at {
                self.collected[node.index()].push(Nearby {
                    displacement,
                    offset: bound.rest_px - self.rest_px[node.index()],
                });
                at = self.parents[node.index()];
            }
        }
    }
}

/// The points of a node whose depth is known.
#[derive(Clone, Debug, Default)]
struct DepthsOfNode {
    /// How far each has moved towards the viewer, px, as the first of two parts.
    points: Vec<Nearby>,
    /// Sum of one over their variances, px^-2.
    precision: f64,
}

impl DepthsOfNode {
    /// How far the node has moved towards the viewer; `None` without points.
    fn moved(&mut self, least_px: f64) -> Option<NodeDepth> {
        let count = self.points.len();
        let moved = local::displacement(&mut self.points, least_px)?;
        // As many points as count, each as sure as they are on average.
        let used = count.min(local::POINTS) as f64;
        Some(NodeDepth {
            z_px: moved.x,
            sd_px: (self.precision * used / count as f64).sqrt().recip(),
        })
    }
}

/// Mean distance of the tips from the nearest other tip, px; 0 for less than two.
fn mean_gap(tips: &[NodeId], rest_px: &[Point2<f64>]) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for tip in tips {
        let others = tips.iter().filter(|other| *other != tip);
        let nearest = others
            .map(|other| distance(rest_px[tip.index()], rest_px[other.index()]))
            .fold(f64::INFINITY, f64::min);
        if nearest.is_finite() {
            sum += nearest;
            count += 1;
        }
    }
    sum / count.max(1) as f64
}

fn distance(a: Point2<f64>, b: Point2<f64>) -> f64 {
    (a.x - b.x).hypot(a.y - b.y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Cluster, Node, Observation, Size};

    /// Two points on one branch; the second goes astray.
    #[test]
    fn points_that_are_left_out_move_nothing_and_stay_on_their_node() {
        let skeleton = Skeleton {
            nodes: vec![
                Node::made_up(0, None, [0.0; 3]),
                Node::made_up(1, Some(0), [0.0, 40.0, 0.0]),
            ],
            foot_px: Point2::new(100.0, 100.0),
            image_size: Size::new(200, 150),
        };
        let ids = [TrackId(3), TrackId(4)];
        let hierarchy = MotionHierarchy {
            clusters: vec![Cluster {
                parent: None,
                level: 0,
                members: ids.to_vec(),
                centroid_px: Point2::new(100.0, 60.0),
                end_px: None,
                certainty: 0.0,
            }],
        };
        let rest_px = Point2::new(100.0, 60.0);
        let rest = ids.map(|id| (id, rest_px)).into();
        let set = TrackSet {
            observations: vec![at(ids[0], 101.0), at(ids[1], 120.0)],
            ..TrackSet::default()
        };
        let mut binding = Binding::new(&hierarchy, &rest, &skeleton);
        let pulled = binding.targets_px(&set)[1].expect("seen");
        assert!(pulled.x > 102.0, "{pulled}");
        binding.leave_out(&BTreeSet::from([ids[1]]));
        let target = binding.targets_px(&set)[1].expect("seen");
        assert!((target.x - 101.0).abs() < 1e-6, "{target}");
        assert_eq!(binding.node_of(ids[1]), Some(NodeId(1)));
        assert_eq!(binding.bound().count(), 2);
    }

    fn at(id: TrackId, u_px: f32) -> Observation {
        Observation {
            id,
            u_px,
            v_px: 60.0,
            fb_error_px: 0.0,
            error_px: None,
            confirmed: true,
            depth: None,
        }
    }
}

//! What a depth camera has seen of a tree: its points at rest, the distance of its foot, its nodes.

use crate::config;
use crate::depth;
use crate::model::{DepthSeen, LogWindow, MotionHierarchy, NodeDepth, RestDepths, TrackId};
use crate::motion::{self, Nearby};
use crate::signal::median;
use crate::skeleton::Node2d;
use nalgebra::{Point2, Vector2};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A point whose depth was seen in fewer frames says nothing of it.
const LEAST_FRAMES: usize = 5;
/// Fewer points do not tell how far away the foot of the trunk is by where they are.
const LEAST_OF_TRUNK: usize = 3;
/// What of the deviation of a depth is the same in all frames and does not average out: bends of the
/// sensor's field, and the pattern on a still thing. A guess.
const LASTING_SHARE: f64 = 0.25;
/// The points around a node count over this many px at least, as a share of the focal length.
const LEAST: f64 = 0.01;
/// What is seen around a node is its depth where the points there count for as much as one that is on
/// it.
const LEAST_WEIGHT: f64 = 1.0;
/// From the median of absolute deviations to a standard deviation, of a normal distribution.
const SD_OF_MAD: f64 = 1.4826;

/// Places of points at rest, px.
pub(super) type RestPlaces = BTreeMap<TrackId, Point2<f64>>;

/// Where the depths of a tree come from.
#[derive(Clone, Copy)]
pub(super) struct DepthSource<'a> {
    /// The film that the tree is built from.
    pub window: LogWindow<'a>,
    /// What was seen of the tree before, which goes on.
    pub prior: Option<&'a RestDepths>,
}

/// What is seen of the points that rest at `rest_px`; the trunk's foot is at `foot_px`.
/// A tree that goes on keeps the distance of its foot. `None` in a film without depth, or where it
/// was seen of no point.
pub(super) fn rest_depths(
    source: DepthSource,
    rest_px: &RestPlaces,
    foot_px: Point2<f64>,
    settings: &config::Depth,
) -> Option<Arc<RestDepths>> {
    let focal_px = depth::format(settings)?.pinhole.focal_px.mean();
    let mut tracks = of_points(source.window);
    tracks.retain(|id, _| rest_px.contains_key(id));
    let foot_m = match source.prior {
        Some(prior) => prior.foot_m,
        None => foot_m(&tracks, rest_px, foot_px, focal_px)?,
    };
    // Points that have gone since stay where they were.
    for (id, seen) in source.prior.into_iter().flat_map(|prior| &prior.tracks) {
        tracks.entry(*id).or_insert(*seen);
    }
    Some(Arc::new(RestDepths {
        foot_m,
        metres_per_px: foot_m / focal_px,
        tracks,
    }))
}

/// The middle depth of every point of a window.
fn of_points(window: LogWindow) -> BTreeMap<TrackId, DepthSeen> {
    let mut seen: BTreeMap<TrackId, Vec<DepthSeen>> = BTreeMap::new();
    for set in window.sets() {
        for o in &set.observations {
            if let Some(depth) = o.depth {
                seen.entry(o.id).or_default().push(depth);
            }
        }
    }
    seen.retain(|_, depths| depths.len() >= LEAST_FRAMES);
    let mut out = BTreeMap::new();
    for (id, depths) in seen {
        let (count, middle) = (depths.len() as f64, middle(depths));
        out.extend(middle.map(|middle| {
            let share = count.sqrt().recip().max(LASTING_SHARE) as f32;
            let sd_m = share * middle.sd_m;
            (id, DepthSeen { sd_m, ..middle })
        }));
    }
    out
}

fn middle(mut depths: Vec<DepthSeen>) -> Option<DepthSeen> {
    depths.sort_unstable_by(|a, b| a.depth_m.total_cmp(&b.depth_m));
    depths.get(depths.len() / 2).copied()
}

/// Distance of the foot, m: that of the points about it, carried on down to it. They need not move, and
/// the nearest ones hardly do.
fn foot_m(
    tracks: &BTreeMap<TrackId, DepthSeen>,
    rest_px: &RestPlaces,
    foot_px: Point2<f64>,
    focal_px: f64,
) -> Option<f64> {
    let all_m: Vec<f64> = tracks.values().map(|seen| seen.depth_m.into()).collect();
    let middle_m = median(all_m, f64::total_cmp)?;
    let about = RestDepths {
        foot_m: middle_m,
        metres_per_px: middle_m / focal_px,
        tracks: tracks.clone(),
    };
    let mut points = points_about(about.tracks.keys(), &about, rest_px, foot_px);
    if points.len() < LEAST_OF_TRUNK {
        return Some(middle_m);
    }
    let at_foot_px = motion::depth(&mut points, LEAST * focal_px)?;
    Some(middle_m - at_foot_px * about.metres_per_px)
}

/// How far points are towards the viewer, px, each as the first part of a displacement, as seen from a
/// place.
fn points_about<'a>(
    ids: impl IntoIterator<Item = &'a TrackId>,
    depths: &RestDepths,
    rest_px: &RestPlaces,
    place_px: Point2<f64>,
) -> Vec<Nearby> {
    let mut points = Vec::new();
    for id in ids {
        if let (Some(seen), Some(at_px)) = (depths.tracks.get(id), rest_px.get(id)) {
            points.push(Nearby {
                displacement: Vector2::new(depths.in_model(*seen).z_px, 0.0),
                offset: at_px - place_px,
            });
        }
    }
    points
}

/// Where every node of the flat tree is along the line of sight, as the points around it have it, on
/// whatever branch they were taken to be; where there are none, as those of its branch have it. `None`
/// for nodes of whose branch no point has a depth, either. The foot is where it is by definition.
pub(super) fn node_depths(
    flat: &[Node2d],
    hierarchy: &MotionHierarchy,
    rest_px: &RestPlaces,
    depths: &RestDepths,
) -> Vec<Option<NodeDepth>> {
    let mut out = Vec::with_capacity(flat.len());
    for node in flat {
        let cluster = node
            .cluster
            .and_then(|c| hierarchy.clusters.get(c.0 as usize));
        out.push(cluster.and_then(|cluster| {
            let around = depth_around(node.position_px, rest_px, depths);
            around.or_else(|| depth_of_branch(node.position_px, &cluster.members, rest_px, depths))
        }));
    }
    out
}

/// A point near a node: how far it is towards the viewer, and how much it counts.
struct Weighted {
    depth: NodeDepth,
    weight: f64,
}

/// The depth of what is seen at a place: the median of the points around it, weighted by a normal
/// distribution of their distance in the picture. Points on several things make it less sure.
fn depth_around(
    place_px: Point2<f64>,
    rest_px: &RestPlaces,
    depths: &RestDepths,
) -> Option<NodeDepth> {
    let sd_px = LEAST * depths.foot_m / depths.metres_per_px;
    let mut near = Vec::new();
    for (id, seen) in &depths.tracks {
        let Some(at_px) = rest_px.get(id) else {
            continue;
        };
        let square = (at_px - place_px).norm_squared() / (sd_px * sd_px);
        near.push(Weighted {
            depth: depths.in_model(*seen),
            weight: (-0.5 * square).exp(),
        });
    }
    let total: f64 = near.iter().map(|point| point.weight).sum();
    if total < LEAST_WEIGHT {
        return None;
    }
    let middle = weighted_median(&mut near, |point| point.depth.z_px)?;
    let off_px = weighted_median(&mut near, |point| (point.depth.z_px - middle).abs())?;
    let noise_px = weighted_median(&mut near, |point| point.depth.sd_px)?;
    Some(NodeDepth {
        z_px: middle,
        sd_px: noise_px.hypot(SD_OF_MAD * off_px),
    })
}

/// The number below which half of the weight lies. Reorders `points`.
fn weighted_median(points: &mut [Weighted], number: impl Fn(&Weighted) -> f64) -> Option<f64> {
    points.sort_by(|a, b| number(a).total_cmp(&number(b)));
    let half = 0.5 * points.iter().map(|point| point.weight).sum::<f64>();
    let mut below = 0.0;
    for point in points.iter() {
        below += point.weight;
        if below >= half {
            return Some(number(point));
        }
    }
    None
}

fn depth_of_branch(
    place_px: Point2<f64>,
    members: &[TrackId],
    rest_px: &RestPlaces,
    depths: &RestDepths,
) -> Option<NodeDepth> {
    let mut points = points_about(members, depths, rest_px, place_px);
    let sds_m = members
        .iter()
        .filter_map(|id| Some(depths.tracks.get(id)?.sd_m));
    let sd_m: f64 = median(sds_m.collect(), f32::total_cmp)?.into();
    let focal_px = depths.foot_m / depths.metres_per_px;
    Some(NodeDepth {
        z_px: motion::depth(&mut points, LEAST * focal_px)?,
        sd_px: sd_m / depths.metres_per_px,
    })
}

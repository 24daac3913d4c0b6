//! How far away a depth camera has seen the markers of a film (Hu et al. sect. 4).

use super::note::DepthNote;
use super::tracks::DepthAt;
use crate::model::{NodeId, Size, depth_in_model_px};
use crate::signal::statistics::median;
use nalgebra::Point2;
use std::collections::BTreeMap;

/// A depth that is off the line through so many before and after it by so many standard deviations, as their median
/// deviation tells them, is that of something else (Hampel's identifier, with its usual numbers).
const BESIDE: usize = 3;
const LEAST_ABOUT: usize = 5;
const DEVIATIONS: f64 = 3.0;
/// Standard deviation of a normal distribution by its median absolute deviation.
const SD_BY_MEDIAN: f64 = 1.4826;
/// The same at least, as a share of the depth: depth cameras are off by some mm at 2 m.
const LEAST_SD: f64 = 0.003;

/// Depths of markers over time, by the node that each is. Without a depth camera all are in the picture's
/// plane.
#[derive(Clone, Debug)]
pub(super) struct MarkerDepths {
    /// The film has depth; else all is in the picture's plane.
    has_depth: bool,
    /// `None` where the depth of the foot is not known: then nothing is known of a place in space.
    foot: Option<FootSeen>,
    of_node: BTreeMap<NodeId, DepthWay>,
}

/// The foot before the camera.
#[derive(Clone, Copy, Debug)]
struct FootSeen {
    depth_m: f64,
    metres_per_px: f64,
    /// Where the camera's axis meets the picture, px: its middle. Off by 20 px, a marker that comes nearer
    /// by a fortieth of its distance is off by half a pixel.
    axis_px: Point2<f64>,
}

impl FootSeen {
    fn z_px(&self, depth_m: f64) -> f64 {
        depth_in_model_px(self.depth_m, self.metres_per_px, depth_m)
    }
}

/// The depth of one marker.
#[derive(Clone, Debug)]
struct DepthWay {
    /// The median.
    rest_m: f64,
    /// In order of time.
    seen: Vec<DepthAt>,
}

impl MarkerDepths {
    /// Of no marker yet, before the camera that has seen what `note` says, of a film with or without depth.
    pub fn before(note: Option<&DepthNote>, has_depth: bool, size: Size) -> Self {
        let foot = note.filter(|note| note.metres_per_px > 0.0);
        Self {
            has_depth: has_depth || foot.is_some(),
            foot: foot.map(|note| FootSeen {
                depth_m: note.foot_m,
                metres_per_px: note.metres_per_px,
                axis_px: Point2::new(
                    0.5 * (f64::from(size.width) - 1.0),
                    0.5 * (f64::from(size.height) - 1.0),
                ),
            }),
            of_node: BTreeMap::new(),
        }
    }

    /// Adds the marker that is `node`, as it was `seen` in order of time. A twig before it or a pixel beside it makes a
    /// depth jump for single frames; such depths count as not seen.
    pub fn add(&mut self, node: NodeId, seen: Vec<DepthAt>) {
        if self.foot.is_some() {
            let seen = without_jumps(&seen);
            let depths_m = seen.iter().map(|at| at.depth_m).collect();
            if let Some(rest_m) = median(depths_m, f64::total_cmp) {
                self.of_node.insert(node, DepthWay { rest_m, seen });
            }
        }
    }

    /// Where a marker rests along the line of sight, px towards the viewer from the foot; 0 in a film
    /// without depth, and `None` where only that of this marker was never seen.
    pub fn rest_z_px(&self, node: NodeId) -> Option<f64> {
        match self.foot {
            None => (!self.has_depth).then_some(0.0),
            Some(foot) => Some(foot.z_px(self.of_node.get(&node)?.rest_m)),
        }
    }

    /// Where it is at a time; no number where that was not seen.
    pub fn z_px(&self, node: NodeId, time_s: f64) -> f64 {
        match self.foot {
            None if self.has_depth => f64::NAN,
            None => 0.0,
            Some(foot) => self.at(node, time_s).map_or(f64::NAN, |m| foot.z_px(m)),
        }
    }

    /// Where a marker that is seen at `at_px` would be seen as far away as it rests: what comes nearer
    /// moves outwards in the picture without any motion across.
    pub fn at_rest_distance_px(
        &self,
        node: NodeId,
        time_s: f64,
        at_px: Point2<f64>,
    ) -> Point2<f64> {
        match (self.foot, self.of_node.get(&node), self.at(node, time_s)) {
            (Some(foot), Some(way), Some(depth_m)) => {
                foot.axis_px + (at_px - foot.axis_px) * (depth_m / way.rest_m)
            }
            _ => at_px,
        }
    }

    fn at(&self, node: NodeId, time_s: f64) -> Option<f64> {
        let seen = &self.of_node.get(&node)?.seen;
        let found = seen.binary_search_by(|at| at.time_s.total_cmp(&time_s));
        found.ok().map(|i| seen[i].depth_m)
    }
}

/// The depths without those that are off all about them.
fn without_jumps(seen: &[DepthAt]) -> Vec<DepthAt> {
    let mut kept = Vec::with_capacity(seen.len());
    for (k, own) in seen.iter().enumerate() {
        let about = &seen[k.saturating_sub(BESIDE)..seen.len().min(k + BESIDE + 1)];
        if about.len() < LEAST_ABOUT || !is_jump(own, about) {
            kept.push(*own);
        }
    }
    kept
}

/// Whether a depth is off the line through those about it by more than they are (Theil and Sen's slope, Hampel's
/// identifier).
fn is_jump(own: &DepthAt, about: &[DepthAt]) -> bool {
    let mut slopes = Vec::new();
    for (k, a) in about.iter().enumerate() {
        let later = about[k + 1..].iter();
        slopes.extend(later.map(|b| (b.depth_m - a.depth_m) / (b.time_s - a.time_s)));
    }
    let slope = median(slopes, f64::total_cmp).unwrap_or_default();
    let from_own_m: Vec<f64> = about
        .iter()
        .map(|at| at.depth_m - own.depth_m - slope * (at.time_s - own.time_s))
        .collect();
    let off_m = median(from_own_m.clone(), f64::total_cmp).unwrap_or_default();
    let spread_m = from_own_m.iter().map(|from_m| (from_m - off_m).abs());
    let sd_m = SD_BY_MEDIAN * median(spread_m.collect(), f64::total_cmp).unwrap_or_default();
    off_m.abs() > DEVIATIONS * sd_m.max(LEAST_SD * own.depth_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A marker that swings by 0.1 m in 30 frames, noise of some mm, and a twig before it in three frames.
    #[test]
    fn depths_of_something_before_the_marker_are_left_out() {
        let mut depths_m: Vec<f64> = (0..120)
            .map(|k| {
                let swing = 0.05 * (f64::from(k) * std::f64::consts::TAU / 30.0).sin();
                2.0 + swing + 0.004 * f64::from(k * 7 % 5 - 2) / 2.0
            })
            .collect();
        for k in [40, 42, 60] {
            depths_m[k] -= 0.4;
        }
        let kept: Vec<f64> = without_jumps(&seen(&depths_m))
            .iter()
            .map(|at| at.time_s)
            .collect();
        for k in [40.0, 42.0, 60.0] {
            assert!(!kept.contains(&k), "{kept:?}");
        }
        assert!(kept.len() >= 112, "{}", kept.len());
        assert!(without_jumps(&[]).is_empty());
    }

    const MARKER: NodeId = NodeId(1);

    /// A camera with focal length 500 px before a foot in 2 m: a pixel is 4 mm there.
    fn camera() -> DepthNote {
        DepthNote {
            foot_m: 2.0,
            metres_per_px: 0.004,
            ..DepthNote::default()
        }
    }

    fn seen(depths_m: &[f64]) -> Vec<DepthAt> {
        let mut all = Vec::with_capacity(depths_m.len());
        for (k, depth_m) in depths_m.iter().enumerate() {
            all.push(DepthAt {
                time_s: k as f64,
                depth_m: *depth_m,
            });
        }
        all
    }

    #[test]
    fn what_comes_nearer_has_not_moved_across() {
        let size = Size::new(641, 481);
        let mut depths = MarkerDepths::before(Some(&camera()), true, size);
        let depths_m = [2.0, 1.9, 2.1];
        depths.add(MARKER, seen(&depths_m));
        assert_eq!(depths.rest_z_px(MARKER), Some(0.0));
        for (k, depth_m) in depths_m.iter().enumerate() {
            // 0.4 m right of the axis and 0.2 m above it.
            let at_px = Point2::new(320.0 + 500.0 * 0.4 / depth_m, 240.0 - 500.0 * 0.2 / depth_m);
            let found_px = depths.at_rest_distance_px(MARKER, k as f64, at_px);
            assert!(
                (found_px - Point2::new(420.0, 190.0)).norm() < 1e-9,
                "{found_px}"
            );
            let z_px = depths.z_px(MARKER, k as f64);
            assert!((z_px - (2.0 - depth_m) / 0.004).abs() < 1e-9, "{z_px}");
        }
    }

    #[test]
    fn a_depth_that_was_not_seen_is_no_number_and_without_a_camera_all_is_flat() {
        let size = Size::new(640, 480);
        let mut depths = MarkerDepths::before(Some(&camera()), true, size);
        depths.add(MARKER, seen(&[2.0]));
        assert!(depths.z_px(MARKER, 0.5).is_nan() && depths.z_px(NodeId(2), 0.0).is_nan());
        assert_eq!(depths.rest_z_px(NodeId(2)), None);
        let mut unknown = MarkerDepths::before(None, true, size);
        unknown.add(MARKER, seen(&[2.0]));
        assert!(unknown.z_px(MARKER, 0.0).is_nan() && unknown.rest_z_px(MARKER).is_none());
        let mut flat = MarkerDepths::before(None, false, size);
        flat.add(MARKER, seen(&[2.0]));
        assert_eq!(
            (flat.rest_z_px(MARKER), flat.z_px(MARKER, 0.5)),
            (Some(0.0), 0.0)
        );
    }
}

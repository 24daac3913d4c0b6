//! Depths of a point over time: one that is far from all those before is of something else.

use crate::model::{DepthSeen, Observation, TrackId};
use crate::signal::median;
use std::collections::BTreeMap;

/// A point's depth is known by so many of its first ones: half a second, in which a few may be wrong.
const FIRST: usize = 15;
/// Fewer say nothing yet.
const LEAST: usize = 5;
/// No point of a tree comes nearer or goes away by more than this share of its distance: at that
/// distance a tree that fills the picture is about as deep in all.
const FARTHEST_SHARE: f64 = 0.25;

/// A point that has not been seen for so many frames is forgotten: a minute or two, so that a marker that
/// is found again is held to what it was, and memory does not grow.
const MOST_FRAMES_LOST: u64 = 3600;

/// Leaves out depths that cannot be those of a point: a marker or a point that was lost to what is
/// behind the tree, or before it, has no depth there.
#[derive(Clone, Debug, Default)]
pub struct DepthGate {
    /// Frames so far.
    frame: u64,
    points: BTreeMap<TrackId, Usual>,
}

/// What a point's depth usually is.
#[derive(Clone, Debug, Default)]
struct Usual {
    first_m: Vec<f64>,
    /// The median of the first ones; `None` until there are enough of them.
    depth_m: Option<f64>,
    last_frame: u64,
}

impl Usual {
    /// Whether the depth is none of this point's.
    fn is_far_from(&self, depth_m: f64) -> bool {
        self.depth_m
            .is_some_and(|usual_m| (depth_m - usual_m).abs() > FARTHEST_SHARE * usual_m)
    }

    fn learn(&mut self, depth_m: f64) {
        if self.first_m.len() == FIRST {
            return;
        }
        self.first_m.push(depth_m);
        if self.first_m.len() >= LEAST {
            self.depth_m = median(self.first_m.clone(), f64::total_cmp);
        }
    }
}

impl DepthGate {
    /// Takes the depths away that are not those of their points.
    pub fn step(&mut self, observations: &mut [Observation]) {
        self.frame += 1;
        for o in observations {
            o.depth = o.depth.filter(|depth| self.is_of(o.id, depth));
        }
        if self.frame.is_multiple_of(MOST_FRAMES_LOST) {
            let first_kept = self.frame - MOST_FRAMES_LOST;
            self.points.retain(|_, usual| usual.last_frame > first_kept);
        }
    }

    /// Whether a depth may be that of a point, by those that it has had.
    pub fn may_be(&self, id: TrackId, depth: &DepthSeen) -> bool {
        let depth_m = f64::from(depth.depth_m);
        self.points
            .get(&id)
            .is_none_or(|usual| !usual.is_far_from(depth_m))
    }

    fn is_of(&mut self, id: TrackId, depth: &DepthSeen) -> bool {
        let usual = self.points.entry(id).or_default();
        usual.last_frame = self.frame;
        let depth_m = f64::from(depth.depth_m);
        if usual.is_far_from(depth_m) {
            return false;
        }
        usual.learn(depth_m);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(id: u32, depth_m: f64) -> Observation {
        Observation {
            id: TrackId(id),
            u_px: 0.0,
            v_px: 0.0,
            fb_error_px: 0.0,
            error_px: None,
            confirmed: true,
            depth: Some(DepthSeen {
                depth_m: depth_m as f32,
                sd_m: 0.006,
            }),
        }
    }

    #[test]
    fn a_point_that_is_lost_to_a_wall_has_no_depth_there() {
        let mut gate = DepthGate::default();
        let mut kept = Vec::new();
        for k in 0..60 {
            // It sways by 0.3 m at 2 m, and is on a wall from frame 30 to 49.
            let depth_m = match k {
                30..50 => 4.7,
                _ => 2.0 + 0.3 * (f64::from(k) / 5.0).sin(),
            };
            // In between it is not seen at all.
            if k == 29 {
                gate.step(&mut [seen(8, 3.0)]);
                kept.push(true);
                continue;
            }
            let mut observations = [seen(7, depth_m), seen(8, 3.0)];
            gate.step(&mut observations);
            kept.push(observations[0].depth.is_some());
            assert!(observations[1].depth.is_some());
        }
        let missing: Vec<usize> = (0..60).filter(|k| !kept[*k]).collect();
        assert_eq!(missing, (30..50).collect::<Vec<_>>());
    }

    #[test]
    fn points_that_are_gone_are_forgotten() {
        let mut gate = DepthGate::default();
        for id in 0..3 * MOST_FRAMES_LOST {
            gate.step(&mut [seen(id as u32, 2.0)]);
        }
        assert!(gate.points.len() as u64 <= MOST_FRAMES_LOST);
    }
}

//! The rotations of a pose of which only the places are known, as in a table that was written.

use super::rotation::shortest_rotation;
use super::{PoseEstimator, turn_of_copy};
use crate::model::Pose;
use nalgebra::{Point3, Unit, UnitQuaternion};

impl PoseEstimator {
    /// The pose whose nodes lie at `places` (model axes, px, one a node), by the rule by which
    /// poses are made: a measured branch turns the shortest way in the axes of its parent branch, a
    /// copy as its original. Lengths are those at rest, whatever `places` says; what is missing or
    /// no number stays as its parent has it.
    pub fn recover(&self, frame: u64, time_s: f64, places: &[Point3<f64>]) -> Pose {
        let mut joints = self.skeleton.joints_at_rest();
        for branch in &self.branches {
            let parent = joints[branch.way.parent.index()].rotation;
            let own = match &branch.copy {
                Some(copy) => turn_of_copy(copy, &joints),
                None => places
                    .get(branch.way.node.index())
                    .zip(places.get(branch.way.begin.index()))
                    .filter(|_| branch.length >= 1e-6)
                    .and_then(|(end, start)| Unit::try_new(parent.inverse() * (end - start), 1e-9))
                    .filter(|d| d.iter().all(|x| x.is_finite()))
                    .map_or_else(UnitQuaternion::identity, |d| {
                        shortest_rotation(&branch.direction, &d)
                    }),
            };
            branch.turn(&self.skeleton, own, &mut joints);
        }
        Pose {
            frame,
            time_s,
            joints,
        }
    }
}

//! The angles of all branches over the last seconds of film, frame by frame.

use crate::dynamics::AngleToParent;
use crate::model::{Angles, NodeName, Pose, Skeleton};
use std::collections::VecDeque;
use std::sync::Arc;

/// A window that slides along. A row is shared by all that look at it: a copy of the whole window
/// costs one count a frame.
pub struct AngleWindow {
    window_s: f64,
    nodes: Arc<[NodeName]>,
    followers: Vec<AngleToParent>,
    rows: VecDeque<(f64, Arc<[f32]>)>,
}

impl AngleWindow {
    /// Keeps `window_s` seconds.
    pub fn new(window_s: f64) -> Self {
        Self {
            window_s,
            nodes: Arc::default(),
            followers: Vec::new(),
            rows: VecDeque::new(),
        }
    }

    /// Begins anew with the measured branches of `skeleton` that move on their own.
    pub fn begin(&mut self, skeleton: &Skeleton) {
        let branches = skeleton.measured_branches();
        self.nodes = branches.filter_map(|n| skeleton.name_of(n)).collect();
        self.followers = skeleton
            .measured_branches()
            .map(|n| AngleToParent::new(skeleton, n))
            .collect();
        self.rows.clear();
    }

    /// Takes the next pose.
    pub fn push(&mut self, pose: &Pose) {
        let row = self
            .followers
            .iter_mut()
            .map(|f| f.step(pose) as f32)
            .collect();
        self.rows.push_back((pose.time_s, row));
        while self
            .rows
            .front()
            .is_some_and(|(t, _)| pose.time_s - t > self.window_s)
        {
            self.rows.pop_front();
        }
    }

    /// The last `span_s` seconds.
    pub fn last(&self, span_s: f64) -> Angles {
        let from_s = self.rows.back().map_or(0.0, |(t, _)| t - span_s);
        let from = self.rows.partition_point(|(t, _)| *t < from_s);
        Angles {
            nodes: self.nodes.clone(),
            rows: self.rows.range(from..).cloned().collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::angle_to_parent_deg;
    use crate::model::{JointPose, Node, NodeId, Size};
    use nalgebra::{Point2, Point3, UnitQuaternion, Vector3};

    /// A trunk and a branch that sways on it for `seconds`.
    fn film(seconds: u32) -> (Skeleton, Vec<Pose>) {
        let places = [[0.0; 3], [0.0, 50.0, 0.0], [20.0, 80.0, 5.0]];
        let at = places.map(Point3::from);
        let nodes = (0..).zip(places).map(|(i, place)| Node {
            level: i as u8,
            ..Node::made_up(10 * i, i.checked_sub(1), place)
        });
        let skeleton = Skeleton {
            nodes: nodes.collect(),
            foot_px: Point2::origin(),
            image_size: Size::new(64, 64),
        };
        let pose = |k: u32| {
            let time_s = f64::from(k) / 30.0;
            let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * 0.1 * (4.0 * time_s).sin());
            let mut joints = at.map(|position| JointPose {
                position,
                rotation: UnitQuaternion::identity(),
            });
            joints[2].position = at[1] + turn * (at[2] - at[1]);
            Pose {
                frame: k.into(),
                time_s,
                joints: joints.into(),
            }
        };
        (skeleton, (0..30 * seconds).map(pose).collect())
    }

    /// Hours of film take no more room than the window, and what is in it is the angle of the
    /// papers.
    #[test]
    fn the_window_slides_and_holds_the_angles_of_its_branches() {
        let (skeleton, poses) = film(60);
        let mut window = AngleWindow::new(10.0);
        window.begin(&skeleton);
        poses.iter().for_each(|pose| window.push(pose));
        let all = window.last(f64::INFINITY);
        assert_eq!(
            (all.rows.len(), &*all.nodes),
            (301, &[NodeName(10), NodeName(20)][..])
        );
        let wanted = angle_to_parent_deg(&skeleton, &poses, NodeId(2));
        for ((t, angle), k) in all.of(NodeName(20)).zip(poses.len() - 301..) {
            assert!(
                t == poses[k].time_s && (angle - wanted[k]).abs() < 1e-4,
                "{angle} at {t}, not {}",
                wanted[k]
            );
        }
        assert_eq!(window.last(1.0).rows.len(), 31);
        assert_eq!(all.of(NodeName(7)).count(), 0);
        // A tree that is built anew begins anew.
        window.begin(&skeleton);
        assert_eq!(window.last(f64::INFINITY).rows.len(), 0);
    }
}

//! Where the frames of reference of a film stand to each other.

use super::ros::FrameTransform;
use nalgebra::Isometry3;
use std::collections::BTreeMap;

/// So many are kept; a robot has some dozens.
const MOST: usize = 1000;
/// Frames on the way from a camera to the root of all, at most.
const LONGEST_WAY: usize = 64;

/// Transforms that were found in a film.
#[derive(Clone, Debug, Default)]
pub(super) struct Transforms {
    /// By the name of the frame that is placed.
    frames: BTreeMap<String, FrameTransform>,
    /// Of streams of a RealSense camera, by the first part of their topics: from the axes that all of
    /// a camera share to those of the stream.
    streams: BTreeMap<String, Isometry3<f64>>,
}

impl Transforms {
    /// Keeps the first transform of each frame: cameras on one stand do not move to each other.
    pub fn add_frame(&mut self, transform: FrameTransform) {
        if self.frames.len() < MOST {
            let child = transform.child.clone();
            self.frames.entry(child).or_insert(transform);
        }
    }

    /// The same of a stream of a RealSense camera, `/device_0/sensor_0/Depth_0/tf/0`.
    pub fn add_stream(&mut self, topic: &str, stream_from_shared: Isometry3<f64>) {
        if let Some((stream, _)) = topic.split_once("/tf/")
            && self.streams.len() < MOST
        {
            let stream = stream.to_owned();
            self.streams.entry(stream).or_insert(stream_from_shared);
        }
    }

    /// From the axes of the stream of one topic to those of another.
    pub fn between_topics(&self, from: &str, to: &str) -> Option<Isometry3<f64>> {
        let [from, to] = [from, to].map(|topic| {
            let (stream, _) = topic.split_once("/image/")?;
            self.streams.get(stream)
        });
        Some(to? * from?.inverse())
    }

    /// From one frame of reference to another.
    pub fn between_frames(&self, from: &str, to: &str) -> Option<Isometry3<f64>> {
        let (from, to) = (self.to_root(from), self.to_root(to));
        (from.root == to.root).then(|| to.root_from.inverse() * from.root_from)
    }

    fn to_root(&self, frame: &str) -> ToRoot {
        let mut way = ToRoot {
            root: plain_frame(frame).to_owned(),
            root_from: Isometry3::identity(),
        };
        for _ in 0..LONGEST_WAY {
            let Some(up) = self.frames.get(&way.root) else {
                break;
            };
            way.root_from = up.parent_from_child * way.root_from;
            way.root.clone_from(&up.parent);
        }
        way
    }
}

/// The frame that is placed by no other, and the way there.
struct ToRoot {
    root: String,
    root_from: Isometry3<f64>,
}

/// The name of a frame; older programs begin it with a slash.
pub(super) fn plain_frame(name: &str) -> &str {
    name.strip_prefix('/').unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};

    fn placed(child: &str, parent: &str, x_m: f64, turn: f64) -> FrameTransform {
        FrameTransform {
            parent: parent.into(),
            child: child.into(),
            parent_from_child: Isometry3::from_parts(
                Translation3::new(x_m, 0.0, 0.0),
                UnitQuaternion::from_axis_angle(&Vector3::y_axis(), turn),
            ),
        }
    }

    #[test]
    fn the_way_between_two_cameras_leads_over_their_stand() {
        let mut transforms = Transforms::default();
        transforms.add_frame(placed("depth", "stand", 0.1, 0.0));
        transforms.add_frame(placed("mount", "stand", -0.2, 0.0));
        transforms.add_frame(placed("colour", "mount", 0.05, std::f64::consts::PI));
        let way = transforms
            .between_frames("/depth", "colour")
            .expect("a way");
        let place = way * Point3::new(0.0, 0.0, 2.0);
        assert!((place - Point3::new(-0.25, 0.0, -2.0)).norm() < 1e-12);
        assert!(transforms.between_frames("depth", "other").is_none());
        // A ring has an end.
        transforms.add_frame(placed("stand", "colour", 1.0, 0.0));
        let _ = transforms.between_frames("depth", "colour");
    }

    #[test]
    fn streams_of_one_camera_are_placed_by_their_topics() {
        let mut transforms = Transforms::default();
        let shift = |x| Isometry3::translation(x, 0.0, 0.0);
        transforms.add_stream("/device_0/sensor_0/Depth_0/tf/0", shift(0.0));
        transforms.add_stream("/device_0/sensor_1/Color_0/tf/0", shift(0.015));
        let way = transforms.between_topics(
            "/device_0/sensor_0/Depth_0/image/data",
            "/device_0/sensor_1/Color_0/image/data",
        );
        assert_eq!(way, Some(shift(0.015)));
    }
}

//! Another program's pictures and depth: which topics are taken, and how the depth lies with the pictures.

use super::channel::{Channel, camera_topic, is_of_realsense, is_registered};
use super::image::{Picture, decode_depth};
use super::pairing::Pairing;
use super::ros::{self, Kind};
use super::transforms::Transforms;
use crate::model::{CameraModel, DepthImage, DepthRig};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// By how much two cameras of the same view may differ, as a share.
const SAME_CAMERA: f64 = 0.01;

/// What is known so far.
#[derive(Default)]
pub(super) struct Foreign {
    /// The topic whose pictures are taken: the first that comes.
    picture_topic: Option<String>,
    /// Topics whose pictures are not.
    other_topics: BTreeSet<String>,
    depth_topic: Option<String>,
    /// Cameras by topic.
    cameras: BTreeMap<String, CameraModel>,
    pub pairing: Pairing<Picture>,
    /// Frames of reference that depth and pictures name.
    depth_frame: Option<String>,
    picture_frame: Option<String>,
    transforms: Transforms,
    /// Metres for each count, as the first depth image says, and whether that is for us to say.
    pub unit_m: Option<f64>,
    pub is_in_metres: bool,
}

/// A depth image with what its message says of it.
struct TimedDepth {
    time_ns: Option<i64>,
    frame: Option<String>,
    image: DepthImage,
    unit_m: Option<f64>,
    is_in_metres: bool,
}

impl TimedDepth {
    fn read(channel: &Channel, content: &[u8]) -> Option<Self> {
        let Some(layout) = channel.layout else {
            let read = decode_depth(content)?;
            return Some(Self {
                time_ns: read.time_ns,
                frame: None,
                image: read.image,
                unit_m: read.metres_unit_m,
                is_in_metres: read.metres_unit_m.is_some(),
            });
        };
        let read = ros::depth(layout, content)?;
        Some(Self {
            time_ns: Some(read.stamp.time_ns),
            frame: Some(read.stamp.frame_id),
            image: read.image,
            unit_m: Some(read.unit_m),
            is_in_metres: read.is_in_metres,
        })
    }
}

impl Foreign {
    /// Whether the pictures of this topic are those that are taken.
    pub fn takes_pictures_of(&mut self, topic: &str) -> bool {
        let taken = self.picture_topic.get_or_insert_with(|| topic.to_owned());
        let is_taken = taken == topic;
        if !is_taken {
            self.other_topics.insert(topic.to_owned());
        }
        is_taken
    }

    /// The frame of reference that the pictures name.
    pub fn note_picture_frame(&mut self, frame: String) {
        if self.picture_frame.is_none() && !frame.is_empty() {
            self.picture_frame = Some(frame);
        }
    }

    /// Keeps a depth image until its picture comes, if its topic is the one that is taken: the first of
    /// `topics`, which are those that may be. Returns whether the message could be read.
    pub fn note_depth(
        &mut self,
        channel: &Channel,
        topics: &[&str],
        content: &[u8],
        log_ns: u64,
    ) -> bool {
        let first = topics.first().copied().unwrap_or_default();
        let taken = self.depth_topic.get_or_insert_with(|| first.to_owned());
        if *taken != channel.topic {
            return true;
        }
        let Some(read) = TimedDepth::read(channel, content) else {
            return false;
        };
        if self.unit_m.is_none() {
            (self.unit_m, self.is_in_metres) = (read.unit_m, read.is_in_metres);
        }
        let frame = read.frame.filter(|frame| !frame.is_empty());
        self.depth_frame = self.depth_frame.take().or(frame);
        let log_ns = i64::try_from(log_ns).ok();
        if let Some(time_ns) = read.time_ns.filter(|ns| *ns != 0).or(log_ns) {
            self.pairing.depth(time_ns, Arc::new(read.image));
        }
        true
    }

    /// Keeps a camera.
    pub fn note_camera(&mut self, channel: &Channel, content: &[u8]) {
        let layout = channel.layout;
        if let Some(camera) = layout.and_then(|layout| ros::camera(layout, content)) {
            let topic = channel.topic.clone();
            self.cameras.entry(topic).or_insert(camera);
        }
    }

    /// Keeps where something stands.
    pub fn note_transform(&mut self, channel: &Channel, content: &[u8]) {
        let Some(layout) = channel.layout else {
            return;
        };
        if Kind::of(&channel.schema) == Some(Kind::Transform) {
            if let Some(transform) = ros::transform(layout, content) {
                self.transforms.add_stream(&channel.topic, transform);
            }
            return;
        }
        for transform in ros::transforms(layout, content) {
            self.transforms.add_frame(transform);
        }
    }

    /// The colour camera; `None` where the recording does not say.
    pub fn camera(&self) -> Option<CameraModel> {
        match self.misfit().is_some() {
            true => self.picture_camera(),
            false => self.depth_camera().or(self.picture_camera()),
        }
    }

    /// The camera beside the depth's topic.
    fn depth_camera(&self) -> Option<CameraModel> {
        self.camera_beside(self.depth_topic.as_deref()?)
    }

    fn picture_camera(&self) -> Option<CameraModel> {
        self.camera_beside(self.picture_topic.as_deref()?)
    }

    fn camera_beside(&self, topic: &str) -> Option<CameraModel> {
        self.cameras.get(&camera_topic(topic)?).copied()
    }

    /// The cameras of depth and of pictures, where the depth is not registered with the pictures and
    /// the recording says where both stand.
    pub fn rig(&self) -> Option<DepthRig> {
        self.misfit()?;
        let (from, to) = (self.depth_topic.as_deref()?, self.picture_topic.as_deref()?);
        let colour_from_depth = if is_of_realsense(from) {
            // Its frames of reference have numbers that do not place them.
            self.transforms.between_topics(from, to)?
        } else {
            let frames = self.depth_frame.as_ref().zip(self.picture_frame.as_ref());
            let (from, to) = frames?;
            self.transforms.between_frames(from, to)?
        };
        Some(DepthRig {
            depth: self.depth_camera()?,
            colour: self.picture_camera()?,
            colour_from_depth,
        })
    }

    /// What shows that the depth is not registered with the pictures: both name other frames of
    /// reference, or have other cameras.
    pub fn misfit(&self) -> Option<String> {
        let frames = self.depth_frame.as_ref().zip(self.picture_frame.as_ref());
        if let Some((depth, picture)) = frames.filter(|(depth, picture)| depth != picture) {
            return Some(format!("frames {depth} and {picture}"));
        }
        let topic = self.depth_topic.as_deref().filter(|t| !is_registered(t))?;
        if is_of_realsense(topic) {
            return Some("a RealSense camera has its depth beside its colours".to_owned());
        }
        let (depth, picture) = (self.camera_beside(topic)?, self.picture_camera()?);
        let differ = !is_same_view(&depth.for_size(picture.size), &picture);
        differ.then(|| "its camera is another one".to_owned())
    }

    /// What is not used, in words.
    pub fn left_out(&self) -> Option<String> {
        if self.other_topics.is_empty() {
            return None;
        }
        let others: Vec<&str> = self.other_topics.iter().map(String::as_str).collect();
        let taken = self.picture_topic.as_deref().unwrap_or_default();
        let others = others.join(", ");
        Some(format!(
            "the pictures of {taken} are used, those of {others} are not"
        ))
    }
}

/// Whether two cameras for images of one size show the same.
fn is_same_view(a: &CameraModel, b: &CameraModel) -> bool {
    let focal = a.pinhole.focal_px.component_div(&b.pinhole.focal_px);
    let shift = a.pinhole.middle_px - b.pinhole.middle_px;
    let sides = [f64::from(b.size.width), f64::from(b.size.height)];
    focal.iter().all(|share| (share - 1.0).abs() <= SAME_CAMERA)
        && shift.x.abs() <= SAME_CAMERA * sides[0]
        && shift.y.abs() <= SAME_CAMERA * sides[1]
}

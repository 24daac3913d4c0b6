//! The channels of a recording, its own or another program's: what each is good for.

use super::ros::{Kind, Layout};
use super::schema::{COMPRESSED_IMAGE, DEPTH_TOPIC, RAW_IMAGE};

/// In the names of topics with depth, with pictures of infrared cameras, and with depth that is
/// registered with the pictures.
const DEPTH: &str = "depth";
const INFRARED: &str = "infra";
const REGISTERED: [&str; 2] = ["aligned", "registered"];
/// In the names of topics with pictures in colour.
const COLOUR: [&str; 2] = ["color", "rgb"];

/// Ends the topic of a stream of a RealSense camera, and is within that of its transform.
const REALSENSE_IMAGE: &str = "/image/data";
const STREAM_TRANSFORM: &str = "/tf/";

/// A series of messages.
pub(super) struct Channel {
    pub topic: String,
    pub schema: String,
    /// How messages of ROS are written; `None` for others.
    pub layout: Option<Layout>,
    /// It is one of ours, and whether its numbers are the driver's.
    pub counted: Option<bool>,
}

/// What a channel is good for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Picture,
    Depth,
    /// Focal lengths and middle of a camera.
    Camera,
    /// Where frames of reference, or the streams of a camera, stand.
    Transform,
    Other,
}

impl Channel {
    /// Depth, and the pictures of infrared cameras, have that in their topic's name, with all drivers.
    pub fn role(&self) -> Role {
        let is_foxglove =
            self.layout.is_none() && (self.schema == COMPRESSED_IMAGE || self.schema == RAW_IMAGE);
        let kind = Kind::of(&self.schema).filter(|_| self.layout.is_some());
        match kind {
            Some(Kind::CameraInfo) => return Role::Camera,
            Some(Kind::Transforms) => return Role::Transform,
            Some(Kind::Transform) if self.topic.contains(STREAM_TRANSFORM) => {
                return Role::Transform;
            }
            Some(Kind::Transform) => return Role::Other,
            Some(Kind::Image | Kind::CompressedImage) | None => {}
        }
        if !is_foxglove && kind.is_none() {
            return Role::Other;
        }
        if self.counted.is_some() {
            return Role::Picture;
        }
        let topic = self.topic.to_lowercase();
        let is_compressed =
            kind == Some(Kind::CompressedImage) || is_foxglove && self.schema == COMPRESSED_IMAGE;
        match names_depth(&topic) {
            true if is_compressed => Role::Other,
            true => Role::Depth,
            false if kind.is_some() && topic.contains(INFRARED) => Role::Other,
            false => Role::Picture,
        }
    }

    pub fn is_own_depth(&self) -> bool {
        self.topic == DEPTH_TOPIC && self.schema == RAW_IMAGE
    }
}

/// Whether a topic is one of depth: a part of its name says so, and none after that speaks of colour,
/// as in `/depth_camera/color/image_raw`.
fn names_depth(topic: &str) -> bool {
    let from_the_end = topic.rsplit('/');
    let mut parts = from_the_end.skip_while(|part| {
        !part.contains(DEPTH) && !COLOUR.iter().any(|colour| part.contains(colour))
    });
    parts.next().is_some_and(|part| part.contains(DEPTH))
}

/// The topic of the camera beside an image's: its last part is the camera's, and with RealSense cameras
/// the last two.
pub(super) fn camera_topic(image: &str) -> Option<String> {
    if let Some(stream) = image.strip_suffix(REALSENSE_IMAGE) {
        return Some(format!("{stream}/info/camera_info"));
    }
    let image = image.strip_suffix("/compressed").unwrap_or(image);
    let (beside, _) = image.rsplit_once('/')?;
    Some(format!("{beside}/camera_info"))
}

/// Whether an image's topic is one that a RealSense camera's own program records.
pub(super) fn is_of_realsense(image: &str) -> bool {
    image.starts_with("/device_") && image.ends_with(REALSENSE_IMAGE)
}

/// Whether a topic says that its depth is registered with the pictures.
pub(super) fn is_registered(topic: &str) -> bool {
    REGISTERED.iter().any(|word| topic.contains(word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_of_depth_and_their_cameras_are_known_by_name() {
        for depth in [
            "/camera/depth/image_rect_raw",
            "/camera/aligned_depth_to_color/image_raw",
            "/depth_to_rgb/image_raw",
            "/zed/zed_node/depth/depth_registered",
            "/device_0/sensor_0/depth_0/image/data",
        ] {
            assert!(names_depth(depth), "{depth}");
        }
        for picture in [
            "/depth_camera/color/image_raw",
            "/camera/rgb/image",
            "/image",
        ] {
            assert!(!names_depth(picture), "{picture}");
        }
        let of = |topic| camera_topic(topic).expect("a topic");
        assert_eq!(of("/a/color/image_raw"), "/a/color/camera_info");
        assert_eq!(of("/a/color/image_raw/compressed"), "/a/color/camera_info");
        assert_eq!(
            of("/device_0/sensor_0/Depth_0/image/data"),
            "/device_0/sensor_0/Depth_0/info/camera_info"
        );
    }
}

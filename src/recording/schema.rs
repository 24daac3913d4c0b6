//! The channels of a recording: topic, published schema, encoding. The protobuf schemas are
//! Foxglove's (<https://github.com/foxglove/foxglove-sdk>, MIT), made by
//! `scripts/foxglove-schemas.py`.

/// One kind of message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Topic {
    /// Frames that are compressed, and frames that are not; with the driver's number, and without
    /// one.
    Image,
    ImageUncounted,
    RawImage,
    RawImageUncounted,
    Depth,
    Outline,
    Points,
    Tracks,
    Skeleton,
    Scene,
    Transforms,
}

/// What a file says of a channel.
pub(super) struct Channel {
    pub topic: &'static str,
    pub schema: &'static str,
    pub schema_encoding: &'static str,
    pub definition: &'static [u8],
    pub message_encoding: &'static str,
}

pub(super) const COMPRESSED_IMAGE: &str = "foxglove.CompressedImage";
pub(super) const RAW_IMAGE: &str = "foxglove.RawImage";

/// Where depth images are, each before the frame that it belongs to and with its times.
pub(super) const DEPTH_TOPIC: &str = "/camera/depth";

/// Keys of a channel's metadata: what the header's `sequence` is, see [`COUNTED`] and
/// [`UNCOUNTED`].
pub(super) const SEQUENCE: &str = "sequence";
pub(super) const COUNTED: &str = "driver";
pub(super) const UNCOUNTED: &str = "none";

/// The record of metadata at the head of a recording, and its keys.
pub(super) const ABOUT: &str = "arborcam";
pub(super) const SHIFT_NS: &str = "publish_time_minus_sensor_time_ns";
pub(super) const FIRST_SEQUENCE: &str = "first_sequence";
pub(super) const CLOCK: &str = "clock";
/// [`CLOCK`] where the frames are those of a file, which were not filmed when they were recorded.
pub(super) const FILE_CLOCK: &str = "file";
pub(super) const CAPTURED_AT: &str = "captured_at";
/// Metres for each count of the depth images, and the colour camera that they are registered with, px.
pub(super) const DEPTH_UNIT_M: &str = "depth_unit_m";
pub(super) const DEPTH_CAMERA_PX: [&str; 4] =
    ["depth_fx_px", "depth_fy_px", "depth_cx_px", "depth_cy_px"];
/// The distortion of its lens, up to eight numbers, where it is known.
pub(super) const DEPTH_DISTORTION: &str = "depth_distortion";
/// Begins the keys of the user's notes.
pub(super) const NOTE: &str = "note.";

fn protobuf(topic: &'static str, schema: &'static str, definition: &'static [u8]) -> Channel {
    Channel {
        topic,
        schema,
        schema_encoding: "protobuf",
        definition,
        message_encoding: "protobuf",
    }
}

fn json(topic: &'static str, schema: &'static str, definition: &'static str) -> Channel {
    Channel {
        topic,
        schema,
        schema_encoding: "jsonschema",
        definition: definition.as_bytes(),
        message_encoding: "json",
    }
}

impl Topic {
    pub fn channel(self) -> Channel {
        match self {
            Topic::Image | Topic::ImageUncounted => protobuf(
                "/camera/image",
                COMPRESSED_IMAGE,
                include_bytes!("foxglove/CompressedImage.bin"),
            ),
            Topic::RawImage | Topic::RawImageUncounted => protobuf(
                "/camera/image_raw",
                RAW_IMAGE,
                include_bytes!("foxglove/RawImage.bin"),
            ),
            Topic::Depth => protobuf(
                DEPTH_TOPIC,
                RAW_IMAGE,
                include_bytes!("foxglove/RawImage.bin"),
            ),
            Topic::Outline => protobuf(
                "/tree/outline",
                "foxglove.ImageAnnotations",
                include_bytes!("foxglove/ImageAnnotations.bin"),
            ),
            Topic::Points => protobuf(
                "/tree/points",
                "foxglove.ImageAnnotations",
                include_bytes!("foxglove/ImageAnnotations.bin"),
            ),
            Topic::Tracks => json("/tree/tracks", "arborcam.Tracks", TRACKS),
            Topic::Skeleton => json("/tree/skeleton", "arborcam.Skeleton", SKELETON),
            Topic::Scene => protobuf(
                "/tree/scene",
                "foxglove.SceneUpdate",
                include_bytes!("foxglove/SceneUpdate.bin"),
            ),
            Topic::Transforms => protobuf(
                "/tree/poses",
                "foxglove.FrameTransforms",
                include_bytes!("foxglove/FrameTransforms.bin"),
            ),
        }
    }

    /// `None` for a channel that holds no frames.
    pub fn sequence(self) -> Option<&'static str> {
        match self {
            Topic::Image | Topic::RawImage => Some(COUNTED),
            Topic::ImageUncounted | Topic::RawImageUncounted => Some(UNCOUNTED),
            _ => None,
        }
    }
}

const TRACKS: &str = r#"{
  "title": "arborcam.Tracks", "type": "object",
  "description": "Points followed in one frame. The arrays go together, ordered by id.",
  "properties": {
    "frame": {"type": "integer", "description": "frames since the first one of the capture, losses included"},
    "time_s": {"type": "number", "description": "seconds since the first frame, by the sensor"},
    "lost": {"type": "integer"}, "born": {"type": "integer"},
    "id": {"type": "array", "items": {"type": "integer"}},
    "u_px": {"type": "array", "items": {"type": "number"}, "description": "where it was filmed"},
    "v_px": {"type": "array", "items": {"type": "number"}},
    "camera": {"type": "object", "description": "the camera's motion: what stands still at (u, v) in the first frame was filmed at scale times that, turned about (0, 0), and shifted",
      "properties": {
        "shift_u_px": {"type": "number"}, "shift_v_px": {"type": "number"},
        "roll_deg": {"type": "number"}, "scale": {"type": "number"},
        "sd_px": {"type": ["number", "null"], "description": "standard deviation within the outline; null where the background does not show it"}}},
    "fb_error_px": {"type": "array", "items": {"type": "number"}},
    "error_px": {"type": "array", "items": {"type": ["number", "null"]}, "description": "expected distance from the point that it was when it was found"},
    "confirmed": {"type": "array", "items": {"type": "boolean"}, "description": "false while the point is on trial"},
    "rejected": {"type": "array", "items": {"type": "integer"}, "description": "ids that did not pass their trial: what was seen of them is void"}
  }
}"#;

const SKELETON: &str = r#"{
  "title": "arborcam.Skeleton", "type": "object",
  "description": "The tree at rest: parents before children, axes x right, y up, z towards the viewer, px, the trunk's foot at the origin. Comes again when the tree is refined; a node that is not in the newest one is no longer there.",
  "properties": {
    "frame": {"type": "integer"}, "time_s": {"type": "number"},
    "foot_px": {"type": "array", "items": {"type": "number"}},
    "width": {"type": "integer"}, "height": {"type": "integer"},
    "nodes": {"type": "array", "items": {"type": "object", "properties": {
      "id": {"type": "integer", "description": "number of the node, as in nodes.csv; it keeps it when the tree is refined, so numbers have gaps and no order"},
      "parent": {"type": ["integer", "null"], "description": "id of the node below; null for the foot"},
      "level": {"type": "integer"},
      "x": {"type": "number"}, "y": {"type": "number"}, "z": {"type": "number"},
      "radius": {"type": "number"}, "n_tracks": {"type": "integer"},
      "certainty": {"type": "number", "description": "how sure it is that the branches above part here, 0 to 1; 0 at a tip"},
      "copy_of": {"type": ["integer", "null"], "description": "id of the measured node that it is a copy of; null where it is measured"}
    }}}
  }
}"#;

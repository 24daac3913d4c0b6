//! Recordings as programs of ROS make them: pictures, depth that is registered with them, and cameras.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;

/// Sides of the pictures, px.
pub const WIDTH: u32 = 8;
pub const HEIGHT: u32 = 6;
/// Focal length of the camera, px.
pub const FOCAL_PX: f64 = 7.5;

/// What is unusual about a recording.
#[derive(Clone, Copy, Debug, Default)]
pub struct Faults {
    /// Depth names another frame of reference than the pictures.
    pub other_frame: bool,
    pub no_camera: bool,
    /// Depth is so much later than the pictures, ns.
    pub late_ns: u64,
    /// Depth ends after so many images.
    pub stops_after: Option<u64>,
}

/// Fields of a message of ROS 1, or of ROS 2 (CDR, little-endian).
struct Message {
    bytes: Vec<u8>,
    is_ros2: bool,
}

impl Message {
    fn new(is_ros2: bool, time_ns: u64, frame: &str) -> Self {
        let bytes = Vec::new();
        let mut message = Self { bytes, is_ros2 };
        if !is_ros2 {
            message.u32(0);
        }
        message.u32((time_ns / 1_000_000_000) as u32);
        message.u32((time_ns % 1_000_000_000) as u32);
        message.text(frame);
        message
    }

    fn align(&mut self, to: usize) {
        while self.is_ros2 && !self.bytes.len().is_multiple_of(to) {
            self.bytes.push(0);
        }
    }

    fn u32(&mut self, x: u32) {
        self.align(4);
        self.bytes.extend(x.to_le_bytes());
    }

    fn f64(&mut self, x: f64) {
        self.align(8);
        self.bytes.extend(x.to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        let end: &[u8] = if self.is_ros2 { &[0] } else { &[] };
        self.u32((text.len() + end.len()) as u32);
        self.bytes.extend(text.as_bytes());
        self.bytes.extend(end);
    }

    fn image(mut self, encoding: &str, pixel_bytes: u32, data: &[u8]) -> Vec<u8> {
        self.u32(HEIGHT);
        self.u32(WIDTH);
        self.text(encoding);
        self.bytes.push(0);
        self.u32(pixel_bytes * WIDTH);
        self.u32(data.len() as u32);
        self.bytes.extend(data);
        self.done()
    }

    fn camera(mut self) -> Vec<u8> {
        self.u32(HEIGHT);
        self.u32(WIDTH);
        self.text("plumb_bob");
        self.u32(5);
        (0..5).for_each(|_| self.f64(0.0));
        let (cx, cy) = (f64::from(WIDTH) / 2.0 - 0.5, f64::from(HEIGHT) / 2.0 - 0.5);
        for k in [FOCAL_PX, 0.0, cx, 0.0, FOCAL_PX, cy, 0.0, 0.0, 1.0] {
            self.f64(k);
        }
        self.done()
    }

    fn done(self) -> Vec<u8> {
        match self.is_ros2 {
            true => [&[0, 1, 0, 0], self.bytes.as_slice()].concat(),
            false => self.bytes,
        }
    }
}

/// A recording of 30 frames a second; depth of frame k counts 1000 + k everywhere.
pub fn film(is_ros2: bool, frames: u64, faults: Faults) -> Vec<u8> {
    let mut writer = mcap::Writer::new(Cursor::new(Vec::new())).expect("a writer");
    let (encoding, schema_encoding) = match is_ros2 {
        true => ("cdr", "ros2msg"),
        false => ("ros1", "ros1msg"),
    };
    let between = if is_ros2 { "/msg" } else { "" };
    let mut channel = |topic: &str, kind: &str| {
        let schema = mcap::Schema {
            id: 0,
            name: format!("sensor_msgs{between}/{kind}"),
            encoding: schema_encoding.into(),
            data: Cow::Borrowed(b""),
        };
        let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data);
        let schema = schema.expect("a schema");
        let topic = format!("/camera/{topic}");
        writer
            .add_channel(schema, &topic, encoding, &BTreeMap::new())
            .expect("a channel")
    };
    let colour = channel("color/image_raw", "Image");
    let infrared = channel("infra1/image_rect_raw", "Image");
    let raw_depth = channel("depth/image_rect_raw", "Image");
    let depth = channel("aligned_depth_to_color/image_raw", "Image");
    let camera = channel("aligned_depth_to_color/camera_info", "CameraInfo");
    let depth_frame = if faults.other_frame { "depth" } else { "color" };
    let pixels = (WIDTH * HEIGHT) as usize;
    for k in 0..frames {
        let time_ns = 1_700_000_000_000_000_000 + k * 33_333_333;
        let mut write = |channel_id: u16, time_ns: u64, data: &[u8]| {
            let header = mcap::records::MessageHeader {
                channel_id,
                sequence: k as u32,
                log_time: time_ns,
                publish_time: time_ns,
            };
            writer
                .write_to_known_channel(&header, data)
                .expect("written");
        };
        let message = |frame: &str, late_ns| Message::new(is_ros2, time_ns + late_ns, frame);
        let rgb: Vec<u8> = (0..3 * pixels).map(|i| (i as u64 * 7 + k) as u8).collect();
        write(colour, time_ns, &message("color", 0).image("rgb8", 3, &rgb));
        let grey = vec![k as u8; pixels];
        write(
            infrared,
            time_ns,
            &message("infra1", 0).image("mono8", 1, &grey),
        );
        if faults.stops_after.is_none_or(|last| k < last) {
            let counts = (1000 + k as u16).to_le_bytes().repeat(pixels);
            let late_ns = 3_000_000 + faults.late_ns;
            let image = message(depth_frame, late_ns).image("16UC1", 2, &counts);
            write(depth, time_ns + late_ns, &image);
            write(
                raw_depth,
                time_ns + late_ns,
                &message("depth", late_ns).image("16UC1", 2, &counts),
            );
        }
        if !faults.no_camera {
            write(camera, time_ns, &message("color", 0).camera());
        }
    }
    writer.finish().expect("finished");
    writer.into_inner().into_inner()
}

//! Recordings as programs of ROS make them: pictures, depth that is registered with them, and cameras.
#![allow(dead_code)] // not every test file needs all of it

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
pub struct Message {
    bytes: Vec<u8>,
    is_ros2: bool,
}

impl Message {
    /// A message with a head.
    pub fn new(is_ros2: bool, time_ns: u64, frame: &str) -> Self {
        let mut message = Self::bare(is_ros2);
        message.head(time_ns, frame);
        message
    }

    /// A message without a head.
    pub fn bare(is_ros2: bool) -> Self {
        let bytes = Vec::new();
        Self { bytes, is_ros2 }
    }

    fn head(&mut self, time_ns: u64, frame: &str) {
        let is_ros2 = self.is_ros2;
        let message = self;
        if !is_ros2 {
            message.u32(0);
        }
        message.u32((time_ns / 1_000_000_000) as u32);
        message.u32((time_ns % 1_000_000_000) as u32);
        message.text(frame);
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

    fn image(self, encoding: &str, pixel_bytes: u32, data: &[u8]) -> Vec<u8> {
        self.image_of([WIDTH, HEIGHT], encoding, pixel_bytes, data)
    }

    /// An image of this width and height.
    pub fn image_of(
        mut self,
        size: [u32; 2],
        encoding: &str,
        pixel_bytes: u32,
        data: &[u8],
    ) -> Vec<u8> {
        self.u32(size[1]);
        self.u32(size[0]);
        self.text(encoding);
        self.bytes.push(0);
        self.u32(pixel_bytes * size[0]);
        self.u32(data.len() as u32);
        self.bytes.extend(data);
        self.done()
    }

    fn camera(self) -> Vec<u8> {
        self.camera_of([WIDTH, HEIGHT], FOCAL_PX)
    }

    /// A camera without distortion that looks at the middle of its images.
    pub fn camera_of(mut self, size: [u32; 2], focal_px: f64) -> Vec<u8> {
        self.u32(size[1]);
        self.u32(size[0]);
        self.text("plumb_bob");
        self.u32(5);
        (0..5).for_each(|_| self.f64(0.0));
        let [cx, cy] = size.map(|side| f64::from(side) / 2.0 - 0.5);
        for k in [focal_px, 0.0, cx, 0.0, focal_px, cy, 0.0, 0.0, 1.0] {
            self.f64(k);
        }
        self.done()
    }

    /// One shift without a turn.
    pub fn transform(mut self, shift_m: [f64; 3]) -> Vec<u8> {
        self.shift(shift_m);
        self.done()
    }

    /// Where a frame of reference stands in another.
    pub fn frame_transform(mut self, parent: &str, child: &str, shift_m: [f64; 3]) -> Vec<u8> {
        self.u32(1);
        self.head(5, parent);
        self.text(child);
        self.shift(shift_m);
        self.done()
    }

    fn shift(&mut self, shift_m: [f64; 3]) {
        for x in shift_m.into_iter().chain([0.0, 0.0, 0.0, 1.0]) {
            self.f64(x);
        }
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

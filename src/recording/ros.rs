//! Messages of ROS with pictures, depth and cameras, as ROS 1 and ROS 2 write them: `sensor_msgs/Image`,
//! `CompressedImage` and `CameraInfo`, and transforms.

use super::image::{Encoding, MAX_SIDE_PX, metres};
use super::transforms::plain_frame;
use crate::model::{CameraModel, DepthImage, METRES_UNIT_M, Pinhole, PixelFormat, Size};
use nalgebra::{Isometry3, Point2, Quaternion, Translation3, UnitQuaternion, Vector2};

/// Metres for each count of 16 bits of depth (REP 118).
pub const ROS_UNIT_M: f64 = 0.001;
/// The frame of reference in images of a RealSense camera that give the unit of their depth.
const WITH_UNIT: &str = "1";
/// Units of depth that may be true, m.
const UNITS_M: std::ops::RangeInclusive<f64> = 1e-6..=1.0;
/// Transforms in one message at most.
const MOST_TRANSFORMS: u32 = 1000;

/// How the fields of a message follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// One after the other, little-endian.
    Ros1,
    /// CDR: numbers stand at multiples of their size, texts end with a zero.
    Ros2,
}

/// What kind of message a schema names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Image,
    CompressedImage,
    CameraInfo,
    /// One transform, whose frames are not named.
    Transform,
    Transforms,
}

impl Kind {
    /// By the name of a type, in either form.
    pub fn of(schema: &str) -> Option<Self> {
        match schema {
            "sensor_msgs/Image" | "sensor_msgs/msg/Image" => Some(Self::Image),
            "sensor_msgs/CompressedImage" | "sensor_msgs/msg/CompressedImage" => {
                Some(Self::CompressedImage)
            }
            "sensor_msgs/CameraInfo" | "sensor_msgs/msg/CameraInfo" => Some(Self::CameraInfo),
            "geometry_msgs/Transform" | "geometry_msgs/msg/Transform" => Some(Self::Transform),
            "tf2_msgs/TFMessage" | "tf2_msgs/msg/TFMessage" | "tf/tfMessage" => {
                Some(Self::Transforms)
            }
            _ => None,
        }
    }
}

/// The head of a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stamp {
    pub time_ns: i64,
    /// The frame of reference; images of one camera name the same.
    pub frame_id: String,
}

/// A picture in colour or grey.
#[derive(Clone, Debug, PartialEq)]
pub struct RosPicture {
    pub stamp: Stamp,
    pub encoding: Encoding,
    pub bytes: Vec<u8>,
}

/// A depth image.
#[derive(Clone, Debug, PartialEq)]
pub struct RosDepth {
    pub stamp: Stamp,
    pub image: DepthImage,
    /// Metres for each count.
    pub unit_m: f64,
    /// The message has metres: the unit is ours.
    pub is_in_metres: bool,
}

/// Where a frame of reference stands.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameTransform {
    pub parent: String,
    pub child: String,
    pub parent_from_child: Isometry3<f64>,
}

/// The picture in a message of an image; `None` where it holds none that can be used.
pub fn picture(kind: Kind, layout: Layout, message: &[u8]) -> Option<RosPicture> {
    let mut fields = Fields::new(message, layout)?;
    let stamp = fields.stamp()?;
    if kind == Kind::CompressedImage {
        let name = fields.text()?.to_owned();
        let bytes = fields.counted()?.to_vec();
        let encoding = Encoding::File(name);
        return Some(RosPicture {
            stamp,
            encoding,
            bytes,
        });
    }
    let image = fields.image()?;
    let (format, bytes) = match image.encoding {
        "rgb8" => (PixelFormat::Rgb24, image.rows(3)?),
        "bgr8" | "8UC3" => (PixelFormat::Rgb24, swapped(image.rows(3)?)),
        "mono8" | "8UC1" => (PixelFormat::Grey, image.rows(1)?),
        "yuv422" | "uyvy" => (PixelFormat::Uyvy, image.rows(2)?),
        "yuv422_yuy2" | "yuyv" | "YUYV" => (PixelFormat::Yuyv, image.rows(2)?),
        "rgba8" => (PixelFormat::Rgb24, without_alpha(&image.rows(4)?)),
        "bgra8" | "8UC4" => (PixelFormat::Rgb24, swapped(without_alpha(&image.rows(4)?))),
        _ => return None,
    };
    let encoding = Encoding::Pixels(format, image.size);
    Some(RosPicture {
        stamp,
        encoding,
        bytes,
    })
}

/// The depth image in a message; `None` where it holds none of 16 bits, or of metres (`32FC1`).
pub fn depth(layout: Layout, message: &[u8]) -> Option<RosDepth> {
    let mut fields = Fields::new(message, layout)?;
    let stamp = fields.stamp()?;
    let image = fields.image()?;
    if image.encoding == "32FC1" {
        let rows = image.rows(4)?;
        return Some(RosDepth {
            stamp,
            image: DepthImage::from_metres(image.size, metres(&rows, image.is_big_endian))?,
            unit_m: METRES_UNIT_M,
            is_in_metres: true,
        });
    }
    if !matches!(image.encoding, "16UC1" | "mono16" | "Z16") {
        return None;
    }
    // A RealSense camera appends the unit.
    let said_m = (stamp.frame_id == WITH_UNIT)
        .then(|| fields.f32())
        .flatten();
    let said_m = said_m.map(f64::from).filter(|m| UNITS_M.contains(m));
    let number = match image.is_big_endian {
        true => u16::from_be_bytes,
        false => u16::from_le_bytes,
    };
    let rows = image.rows(2)?;
    let counts = rows.chunks_exact(2).map(|b| number([b[0], b[1]])).collect();
    let size = image.size;
    Some(RosDepth {
        stamp,
        image: DepthImage::new(size, counts),
        unit_m: said_m.unwrap_or(ROS_UNIT_M),
        is_in_metres: false,
    })
}

/// The camera in a message; `None` where it is none, e.g. not calibrated.
pub fn camera(layout: Layout, message: &[u8]) -> Option<CameraModel> {
    let mut fields = Fields::new(message, layout)?;
    fields.stamp()?;
    let (height, width) = (fields.u32()?, fields.u32()?);
    let model = fields.text()?;
    // These two are OpenCV's, with the same order of coefficients.
    let is_known = matches!(model, "plumb_bob" | "rational_polynomial");
    let mut distortion = [0.0; 8];
    let coefficients = fields.u32()?;
    for k in 0..coefficients as usize {
        let coefficient = fields.f64()?;
        if let Some(known) = distortion.get_mut(k).filter(|_| is_known) {
            *known = coefficient;
        }
    }
    let mut k = [0.0; 9];
    for k in &mut k {
        *k = fields.f64()?;
    }
    let pinhole = Pinhole {
        focal_px: Vector2::new(k[0], k[4]),
        middle_px: Point2::new(k[2], k[5]),
    };
    let camera = CameraModel {
        size: Size::new(width, height),
        pinhole,
        distortion,
    };
    camera.is_valid().then_some(camera)
}

/// The transform in a message of one.
pub fn transform(layout: Layout, message: &[u8]) -> Option<Isometry3<f64>> {
    Fields::new(message, layout)?.transform()
}

/// The transforms in a message of several, as far as they can be read.
pub fn transforms(layout: Layout, message: &[u8]) -> Vec<FrameTransform> {
    let mut found = Vec::new();
    let Some(mut fields) = Fields::new(message, layout) else {
        return found;
    };
    let count = fields.u32().unwrap_or(0).min(MOST_TRANSFORMS);
    for _ in 0..count {
        let Some(transform) = fields.frame_transform() else {
            break;
        };
        found.push(transform);
    }
    found
}

fn without_alpha(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len() / 4 * 3);
    for pixel in bytes.chunks_exact(4) {
        out.extend_from_slice(&pixel[..3]);
    }
    out
}

/// Blue first to red first.
fn swapped(mut bytes: Vec<u8>) -> Vec<u8> {
    for pixel in bytes.chunks_exact_mut(3) {
        pixel.swap(0, 2);
    }
    bytes
}

/// The fields of an image.
struct Image<'a> {
    size: Size,
    encoding: &'a str,
    is_big_endian: bool,
    /// Bytes from one line to the next.
    step: usize,
    data: &'a [u8],
}

impl Image<'_> {
    /// The lines without padding, of so many bytes a pixel; `None` where there are too few.
    fn rows(&self, pixel_bytes: usize) -> Option<Vec<u8>> {
        let line = pixel_bytes * self.size.width as usize;
        let height = self.size.height as usize;
        let step = self.step.max(line);
        let needed = step.checked_mul(height - 1)?.checked_add(line)?;
        if self.data.len() < needed {
            return None;
        }
        let mut out = Vec::with_capacity(line * height);
        for row in self.data.chunks(step).take(height) {
            out.extend_from_slice(&row[..line]);
        }
        Some(out)
    }
}

/// Reads fields from the front; `None` where there is too little.
struct Fields<'a> {
    bytes: &'a [u8],
    at: usize,
    layout: Layout,
    is_big_endian: bool,
}

impl<'a> Fields<'a> {
    fn new(message: &'a [u8], layout: Layout) -> Option<Self> {
        let mut bytes = message;
        let mut is_big_endian = false;
        if layout == Layout::Ros2 {
            let (head, rest) = message.split_at_checked(4)?;
            // CDR, big- or little-endian; lists of parameters are not used for these messages.
            is_big_endian = match head {
                [0, 0, ..] => true,
                [0, 1, ..] => false,
                _ => return None,
            };
            bytes = rest;
        }
        Some(Self {
            bytes,
            at: 0,
            layout,
            is_big_endian,
        })
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(count)?;
        let taken = self.bytes.get(self.at..end)?;
        self.at = end;
        Some(taken)
    }

    /// A number of `N` bytes, lowest first.
    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        if self.layout == Layout::Ros2 {
            self.at = self.at.next_multiple_of(N);
        }
        let mut bytes: [u8; N] = self.take(N)?.try_into().ok()?;
        if self.is_big_endian {
            bytes.reverse();
        }
        Some(bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    fn f32(&mut self) -> Option<f32> {
        self.number().map(f32::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.number().map(f64::from_le_bytes)
    }

    /// A shift and a turn; `None` where the turn is none.
    fn transform(&mut self) -> Option<Isometry3<f64>> {
        let shift = Translation3::new(self.f64()?, self.f64()?, self.f64()?);
        let (i, j, k, w) = (self.f64()?, self.f64()?, self.f64()?, self.f64()?);
        let turn = Quaternion::new(w, i, j, k);
        let is_turn = (turn.norm() - 1.0).abs() < 0.01;
        let is_known = is_turn && shift.vector.iter().all(|x| x.is_finite());
        is_known.then(|| Isometry3::from_parts(shift, UnitQuaternion::from_quaternion(turn)))
    }

    fn frame_transform(&mut self) -> Option<FrameTransform> {
        let parent = plain_frame(&self.stamp()?.frame_id).to_owned();
        let child = plain_frame(self.text()?).to_owned();
        Some(FrameTransform {
            parent,
            child,
            parent_from_child: self.transform()?,
        })
    }

    fn counted(&mut self) -> Option<&'a [u8]> {
        let count = self.u32()?;
        self.take(count as usize)
    }

    fn text(&mut self) -> Option<&'a str> {
        let bytes = self.counted()?;
        std::str::from_utf8(bytes.strip_suffix(&[0]).unwrap_or(bytes)).ok()
    }

    fn stamp(&mut self) -> Option<Stamp> {
        if self.layout == Layout::Ros1 {
            self.u32()?;
        }
        let (seconds, nanos) = (self.u32()?, self.u32()?);
        let frame_id = self.text()?.to_owned();
        let time_ns = i64::from(seconds) * 1_000_000_000 + i64::from(nanos);
        Some(Stamp { time_ns, frame_id })
    }

    fn image(&mut self) -> Option<Image<'a>> {
        let (height, width) = (self.u32()?, self.u32()?);
        let sides = 1..=MAX_SIDE_PX;
        if !sides.contains(&width) || !sides.contains(&height) {
            return None;
        }
        let encoding = self.text()?;
        let is_big_endian = self.take(1)? != [0];
        Some(Image {
            size: Size::new(width, height),
            encoding,
            is_big_endian,
            step: self.u32()? as usize,
            data: self.counted()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes the fields of a message in either layout.
    struct Writer {
        bytes: Vec<u8>,
        layout: Layout,
    }

    impl Writer {
        fn new(layout: Layout) -> Self {
            let bytes = Vec::new();
            Self { bytes, layout }
        }

        fn align(&mut self, to: usize) {
            while self.layout == Layout::Ros2 && !self.bytes.len().is_multiple_of(to) {
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
            let end: &[u8] = if self.layout == Layout::Ros2 {
                &[0]
            } else {
                &[]
            };
            self.u32((text.len() + end.len()) as u32);
            self.bytes.extend(text.as_bytes());
            self.bytes.extend(end);
        }

        fn head(&mut self) {
            if self.layout == Layout::Ros1 {
                self.u32(77);
            }
            self.u32(5);
            self.u32(6);
            self.text("camera");
        }

        fn done(self) -> Vec<u8> {
            match self.layout {
                Layout::Ros1 => self.bytes,
                Layout::Ros2 => [&[0, 1, 0, 0], self.bytes.as_slice()].concat(),
            }
        }
    }

    fn image(layout: Layout, encoding: &str, step: u32, data: &[u8]) -> Vec<u8> {
        let mut w = Writer::new(layout);
        w.head();
        w.u32(2);
        w.u32(3);
        w.text(encoding);
        w.bytes.push(0);
        w.u32(step);
        w.u32(data.len() as u32);
        w.bytes.extend(data);
        w.done()
    }

    #[test]
    fn depth_and_pictures_of_both_generations_are_read() {
        for layout in [Layout::Ros1, Layout::Ros2] {
            let data = [1, 0, 2, 0, 3, 0, 99, 99, 4, 0, 5, 0, 0, 1, 99, 99];
            let read = depth(layout, &image(layout, "16UC1", 8, &data)).expect("depth");
            assert_eq!(read.image.counts, [1, 2, 3, 4, 5, 256]);
            assert_eq!(read.image.size, Size::new(3, 2));
            assert_eq!(read.stamp.time_ns, 5_000_000_006);
            assert_eq!(read.stamp.frame_id, "camera");
            let data: Vec<u8> = (0..18).collect();
            let bgr = image(layout, "bgr8", 9, &data);
            let read = picture(Kind::Image, layout, &bgr).expect("a picture");
            assert_eq!(read.bytes[..6], [2, 1, 0, 5, 4, 3]);
            assert_eq!(depth(layout, &bgr), None);
            assert_eq!(
                picture(Kind::Image, layout, &image(layout, "32FC1", 12, &data)),
                None
            );
            let mut data = Vec::new();
            for depth_m in [1.5_f32, f32::NAN, 0.0, 2.25, f32::INFINITY, 80.0] {
                data.extend(depth_m.to_le_bytes());
            }
            let read = depth(layout, &image(layout, "32FC1", 12, &data)).expect("depth");
            assert_eq!(read.image.counts, [1500, 0, 0, 2250, 0, 0]);
            assert!(read.is_in_metres);
        }
    }

    #[test]
    fn a_camera_is_read_and_one_that_is_not_calibrated_is_none() {
        for layout in [Layout::Ros1, Layout::Ros2] {
            let message = |focal: f64| {
                let mut w = Writer::new(layout);
                w.head();
                w.u32(480);
                w.u32(640);
                w.text("plumb_bob");
                w.u32(5);
                for d in [0.1, 0.2, 0.3, 0.4, 0.5] {
                    w.f64(d);
                }
                for k in [focal, 0.0, 319.5, 0.0, focal + 1.0, 239.5, 0.0, 0.0, 1.0] {
                    w.f64(k);
                }
                w.done()
            };
            let read = camera(layout, &message(600.0)).expect("a camera");
            assert_eq!(read.size, Size::new(640, 480));
            assert_eq!(read.pinhole.focal_px, Vector2::new(600.0, 601.0));
            assert_eq!(read.pinhole.middle_px, Point2::new(319.5, 239.5));
            assert_eq!(read.distortion[..5], [0.1, 0.2, 0.3, 0.4, 0.5]);
            let larger = read.for_size(Size::new(1280, 960)).pinhole;
            assert_eq!(larger.focal_px, Vector2::new(1200.0, 1202.0));
            assert_eq!(larger.middle_px, Point2::new(639.5, 479.5));
            assert_eq!(camera(layout, &message(0.0)), None);
        }
    }

    #[test]
    fn transforms_are_read_and_a_turn_that_is_none_is_left_out() {
        for layout in [Layout::Ros1, Layout::Ros2] {
            let message = |turn: [f64; 4]| {
                let mut w = Writer::new(layout);
                w.u32(1);
                w.head();
                w.text("/depth");
                for x in [0.1, 0.2, 0.3].into_iter().chain(turn) {
                    w.f64(x);
                }
                w.done()
            };
            let read = transforms(layout, &message([0.0, 0.0, 1.0, 0.0]));
            assert_eq!(read.len(), 1);
            assert_eq!((&*read[0].parent, &*read[0].child), ("camera", "depth"));
            let place = read[0].parent_from_child * nalgebra::Point3::new(1.0, 0.0, 0.0);
            assert!((place - nalgebra::Point3::new(-0.9, 0.2, 0.3)).norm() < 1e-12);
            assert_eq!(transforms(layout, &message([0.0; 4])), []);
        }
    }

    /// No length is taken on trust.
    #[test]
    fn messages_that_are_cut_or_lie_are_none() {
        for layout in [Layout::Ros1, Layout::Ros2] {
            let whole = image(layout, "16UC1", 6, &[7; 12]);
            assert!(depth(layout, &whole).is_some());
            for cut in 0..whole.len() {
                assert_eq!(depth(layout, &whole[..cut]), None);
            }
            let long_step = image(layout, "16UC1", u32::MAX, &[7; 12]);
            assert_eq!(depth(layout, &long_step), None);
        }
    }
}

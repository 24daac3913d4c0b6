//! Frames as the published image messages, and back.

use super::schema::{COMPRESSED_IMAGE, RAW_IMAGE, Topic};
use super::wire::{Fields, Message, Value};
use crate::model::{DepthImage, METRES_UNIT_M, PixelFormat, RawFrame, Size};
use std::sync::Arc;

/// Frame of reference that images and annotations name.
pub(super) const CAMERA: &str = "camera";

/// Longest side of a picture that is taken, px.
pub(super) const MAX_SIDE_PX: u32 = 1 << 15;

/// How the bytes of a [`Picture`] are to be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// A picture file, `jpeg` or `png` or whatever the message says; its size is in it.
    File(String),
    /// Pixels without padding.
    Pixels(PixelFormat, Size),
}

/// A frame out of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The driver's number; `None` if it does not count, or the recording does not tell.
    pub sequence: Option<u64>,
    pub sensor_time_ns: i64,
    pub encoding: Encoding,
    pub bytes: Vec<u8>,
    /// The depth image that belongs to it.
    pub depth: Option<Arc<DepthImage>>,
}

/// Name of the layout in [`RAW_IMAGE`].
fn encoding_name(format: PixelFormat) -> Option<&'static str> {
    match format {
        PixelFormat::Mjpeg => None,
        // Of depth; never a frame of its own.
        PixelFormat::Z16 | PixelFormat::Y16 => Some(DEPTH_NAME),
        PixelFormat::Yuyv => Some("yuv422_yuy2"),
        PixelFormat::Uyvy => Some("uyvy"),
        PixelFormat::Nv12 => Some("nv12"),
        PixelFormat::Grey => Some("mono8"),
        PixelFormat::Rgb24 => Some("rgb8"),
    }
}

fn format_of(name: &str) -> Option<PixelFormat> {
    let other = match name {
        "yuyv" => Some(PixelFormat::Yuyv),
        "yuv422" => Some(PixelFormat::Uyvy),
        "8UC1" => Some(PixelFormat::Grey),
        _ => None,
    };
    other.or_else(|| {
        PixelFormat::ALL
            .into_iter()
            .find(|f| encoding_name(*f) == Some(name))
    })
}

/// Bytes of a line.
fn step(format: PixelFormat, size: Size) -> u32 {
    size.width
        * match format {
            PixelFormat::Yuyv | PixelFormat::Uyvy | PixelFormat::Z16 | PixelFormat::Y16 => 2,
            PixelFormat::Rgb24 => 3,
            PixelFormat::Mjpeg | PixelFormat::Nv12 | PixelFormat::Grey => 1,
        }
}

/// The channel that a frame goes into.
pub(super) fn topic(raw: &RawFrame) -> Topic {
    match (encoding_name(raw.format), raw.sequence) {
        (None, Some(_)) => Topic::Image,
        (None, None) => Topic::ImageUncounted,
        (Some(_), Some(_)) => Topic::RawImage,
        (Some(_), None) => Topic::RawImageUncounted,
    }
}

/// Puts the frame into `into` as its message, which takes the one copy of its bytes.
pub(super) fn encode(raw: &RawFrame, log_time_ns: u64, into: &mut Vec<u8>) {
    into.clear();
    into.reserve(raw.bytes.len() + 128);
    let mut message = Message(into);
    message.timestamp(1, log_time_ns);
    match encoding_name(raw.format) {
        None => {
            message.text(4, CAMERA);
            message.text(3, "jpeg");
            message.bytes(2, &raw.bytes);
        }
        Some(name) => {
            message.text(7, CAMERA);
            message.fixed32(2, raw.size.width);
            message.fixed32(3, raw.size.height);
            message.text(4, name);
            message.fixed32(5, step(raw.format, raw.size));
            message.bytes(6, &raw.bytes);
        }
    }
}

/// Name of the layout of depth in [`RAW_IMAGE`].
const DEPTH_NAME: &str = "16UC1";

/// Puts a depth image into `into` as its message.
pub(super) fn encode_depth(depth: &DepthImage, log_time_ns: u64, into: &mut Vec<u8>) {
    into.clear();
    into.reserve(depth.bytes() + 128);
    let mut message = Message(into);
    message.timestamp(1, log_time_ns);
    message.text(7, CAMERA);
    message.fixed32(2, depth.size.width);
    message.fixed32(3, depth.size.height);
    message.text(4, DEPTH_NAME);
    message.fixed32(5, 2 * depth.size.width);
    let mut bytes = Vec::with_capacity(depth.bytes());
    for count in &depth.counts {
        bytes.extend(count.to_le_bytes());
    }
    message.bytes(6, &bytes);
}

/// A depth image and the time that its message gives itself, ns.
pub(super) struct DecodedDepth {
    pub time_ns: Option<i64>,
    pub image: DepthImage,
    /// Metres for each count, where the message has metres and the unit is ours.
    pub metres_unit_m: Option<f64>,
}

/// Numbers of four bytes, metres.
pub(super) fn metres(bytes: &[u8], is_big_endian: bool) -> impl Iterator<Item = f32> {
    let number = match is_big_endian {
        true => f32::from_be_bytes,
        false => f32::from_le_bytes,
    };
    bytes
        .chunks_exact(4)
        .map(move |b| number([b[0], b[1], b[2], b[3]]))
}

/// The depth image in a message of [`RAW_IMAGE`]; `None` if there is none that can be used.
pub(super) fn decode_depth(message: &[u8]) -> Option<DecodedDepth> {
    let raw = Raw::read(message)?;
    let sides = 1..=MAX_SIDE_PX;
    let pixel_bytes = match raw.name {
        DEPTH_NAME | "mono16" => 2,
        "32FC1" => 4,
        _ => return None,
    };
    if !sides.contains(&raw.width) || !sides.contains(&raw.height) {
        return None;
    }
    let (line, height) = (pixel_bytes * raw.width as usize, raw.height as usize);
    let bytes = unpadded(raw.data?, raw.step.max(line), line, height);
    let size = Size::new(raw.width, raw.height);
    if pixel_bytes == 4 {
        return Some(DecodedDepth {
            time_ns: raw.time_ns,
            image: DepthImage::from_metres(size, metres(&bytes, false))?,
            metres_unit_m: Some(METRES_UNIT_M),
        });
    }
    Some(DecodedDepth {
        time_ns: raw.time_ns,
        image: DepthImage::from_bytes(size, &bytes)?,
        metres_unit_m: None,
    })
}

/// What a message holds.
pub(super) struct Decoded {
    pub encoding: Encoding,
    /// The time that the message gives itself, ns.
    pub time_ns: Option<i64>,
    pub bytes: Vec<u8>,
}

impl Decoded {
    pub fn new(encoding: Encoding, time_ns: i64, bytes: Vec<u8>) -> Self {
        let time_ns = Some(time_ns);
        Self {
            encoding,
            time_ns,
            bytes,
        }
    }
}

/// The picture in a message of the schema; `None` if there is none that can be used.
pub(super) fn decode(schema: &str, message: &[u8]) -> Option<Decoded> {
    match schema {
        COMPRESSED_IMAGE => decode_compressed(message),
        RAW_IMAGE => decode_raw(message),
        _ => None,
    }
}

fn decode_compressed(message: &[u8]) -> Option<Decoded> {
    let (mut time_ns, mut data, mut name) = (None, None, "");
    for (field, value) in Fields(message) {
        match (field, value) {
            (1, Value::Bytes(t)) => time_ns = timestamp(t),
            (2, Value::Bytes(d)) => data = Some(d),
            (3, Value::Bytes(n)) => name = std::str::from_utf8(n).ok()?,
            _ => {}
        }
    }
    Some(Decoded {
        encoding: Encoding::File(name.to_owned()),
        time_ns,
        bytes: data?.to_vec(),
    })
}

/// The fields of [`RAW_IMAGE`].
#[derive(Default)]
struct Raw<'a> {
    time_ns: Option<i64>,
    width: u32,
    height: u32,
    /// Name of the layout.
    name: &'a str,
    /// Bytes from one line to the next.
    step: usize,
    data: Option<&'a [u8]>,
}

fn decode_raw(message: &[u8]) -> Option<Decoded> {
    Raw::read(message)?.decoded()
}

impl<'a> Raw<'a> {
    fn read(message: &'a [u8]) -> Option<Self> {
        let mut raw = Raw::default();
        for (field, value) in Fields(message) {
            match (field, value) {
                (1, Value::Bytes(t)) => raw.time_ns = timestamp(t),
                (2, Value::Number(n)) => raw.width = u32::try_from(n).ok()?,
                (3, Value::Number(n)) => raw.height = u32::try_from(n).ok()?,
                (4, Value::Bytes(n)) => raw.name = std::str::from_utf8(n).ok()?,
                (5, Value::Number(n)) => raw.step = n as usize,
                (6, Value::Bytes(d)) => raw.data = Some(d),
                _ => {}
            }
        }
        Some(raw)
    }

    fn decoded(&self) -> Option<Decoded> {
        let data = self.data?;
        let format = format_of(self.name)?;
        let sides = 1..=MAX_SIDE_PX;
        if !sides.contains(&self.width) || !sides.contains(&self.height) {
            return None;
        }
        let size = Size::new(self.width, self.height);
        let line = step(format, size) as usize;
        // Lines of another program's file may be padded.
        let bytes = if self.step > line && format != PixelFormat::Nv12 {
            unpadded(data, self.step, line, size.height as usize)
        } else {
            data.to_vec()
        };
        Some(Decoded {
            encoding: Encoding::Pixels(format, size),
            time_ns: self.time_ns,
            bytes,
        })
    }
}

/// The first `line` bytes of every `step`, `count` times.
fn unpadded(data: &[u8], step: usize, line: usize, count: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    for padded in data.chunks(step).take(count) {
        bytes.extend_from_slice(&padded[..padded.len().min(line)]);
    }
    bytes
}

fn timestamp(message: &[u8]) -> Option<i64> {
    let (mut seconds, mut nanos) = (0i64, 0i64);
    for (field, value) in Fields(message) {
        match (field, value) {
            (1, Value::Number(n)) => seconds = n as i64,
            (2, Value::Number(n)) => nanos = n as i64,
            _ => {}
        }
    }
    seconds.checked_mul(1_000_000_000)?.checked_add(nanos)
}

//! Frames as the published image messages, and back.

use super::schema::{COMPRESSED_IMAGE, RAW_IMAGE, Topic};
use super::wire::{Fields, Message, Value};
use crate::model::{PixelFormat, RawFrame, Size};

/// Frame of reference that images and annotations name.
pub(super) const CAMERA: &str = "camera";

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
}

/// Name of the layout in [`RAW_IMAGE`].
fn encoding_name(format: PixelFormat) -> Option<&'static str> {
    match format {
        PixelFormat::Mjpeg => None,
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
            PixelFormat::Yuyv | PixelFormat::Uyvy => 2,
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

/// The picture in a message of the schema, with the time that the message gives itself, ns; `None`
/// if there is none that can be used.
pub(super) fn decode(schema: &str, message: &[u8]) -> Option<(Encoding, Option<i64>, Vec<u8>)> {
    let raw = schema == RAW_IMAGE;
    if !raw && schema != COMPRESSED_IMAGE {
        return None;
    }
    let (mut name, mut data, mut time_ns) = ("", None, None);
    let (mut width, mut height, mut given_step) = (0, 0, 0);
    for (field, value) in Fields(message) {
        match (raw, field, value) {
            (_, 1, Value::Bytes(t)) => time_ns = timestamp(t),
            (false, 2, Value::Bytes(d)) | (true, 6, Value::Bytes(d)) => data = Some(d),
            (false, 3, Value::Bytes(n)) | (true, 4, Value::Bytes(n)) => {
                name = std::str::from_utf8(n).ok()?
            }
            (true, 2, Value::Number(n)) => width = u32::try_from(n).ok()?,
            (true, 3, Value::Number(n)) => height = u32::try_from(n).ok()?,
            (true, 5, Value::Number(n)) => given_step = n as usize,
            _ => {}
        }
    }
    let data = data?;
    if !raw {
        return Some((Encoding::File(name.to_owned()), time_ns, data.to_vec()));
    }
    let format = format_of(name)?;
    if width == 0 || height == 0 || width > 1 << 15 || height > 1 << 15 {
        return None;
    }
    let size = Size::new(width, height);
    let line = step(format, size) as usize;
    // Somebody else's lines may be padded.
    let bytes = if given_step > line && format != PixelFormat::Nv12 {
        data.chunks(given_step)
            .take(height as usize)
            .flat_map(|l| &l[..l.len().min(line)])
            .copied()
            .collect()
    } else {
        data.to_vec()
    };
    Some((Encoding::Pixels(format, size), time_ns, bytes))
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

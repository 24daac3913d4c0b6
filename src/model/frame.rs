//! Pictures, as the camera delivered them and as the tracker wants them.

use super::DepthImage;
use nalgebra::{Point2, Vector3};
use std::sync::Arc;
use std::time::Instant;

/// Width and height of a picture in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Size {
    pub width: u32,
    pub height: u32,
}

impl Size {
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height }
    }

    /// Number of pixels.
    pub fn area(self) -> usize {
        self.width as usize * self.height as usize
    }

    /// A picture of this size made so many times as large, with a pixel at least.
    pub fn scaled(self, share: f64) -> Self {
        let [width, height] = [self.width, self.height].map(f64::from);
        Self {
            width: (width * share).round().max(1.0) as u32,
            height: (height * share).round().max(1.0) as u32,
        }
    }

    /// Its corners, px.
    pub fn corners_px(self) -> [Point2<f64>; 4] {
        let (width, height) = (f64::from(self.width), f64::from(self.height));
        let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
        corners.map(|(u, v)| Point2::new(u, v))
    }

    /// Whether the pixel whose centre is nearest to `at_px` lies in the picture.
    pub fn contains(self, at_px: Point2<f64>) -> bool {
        at_px.x >= -0.5
            && at_px.y >= -0.5
            && at_px.x < self.width as f64 - 0.5
            && at_px.y < self.height as f64 - 0.5
    }

    /// The pixel whose centre is nearest to `at_px`, counted row by row; `None` outside of the picture.
    pub fn pixel_at(self, at_px: Point2<f64>) -> Option<usize> {
        let [u, v] = [at_px.x, at_px.y].map(|px| (px + 0.5) as usize);
        self.contains(at_px).then_some(v * self.width as usize + u)
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// How the bytes of a [`RawFrame`] are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PixelFormat {
    /// One JPEG picture a frame.
    Mjpeg,
    /// Packed 4:2:2, bytes Y0 U Y1 V, no padding at the end of a line.
    Yuyv,
    /// The same with the bytes U Y0 V Y1.
    Uyvy,
    /// A plane of luma, then one of U and V in turns at half the width and half the height (4:2:0).
    Nv12,
    /// One byte of luma a pixel.
    Grey,
    /// Three bytes a pixel, red first.
    Rgb24,
    /// Two bytes a pixel of depth, the lower first.
    Z16,
    /// The same of light or, with some depth cameras, of depth.
    Y16,
}

impl PixelFormat {
    /// Formats of pictures.
    pub const ALL: [PixelFormat; 6] = [
        PixelFormat::Mjpeg,
        PixelFormat::Yuyv,
        PixelFormat::Uyvy,
        PixelFormat::Nv12,
        PixelFormat::Grey,
        PixelFormat::Rgb24,
    ];

    /// Formats of depth images, the best first.
    pub const DEPTH: [PixelFormat; 2] = [PixelFormat::Z16, PixelFormat::Y16];

    /// The name that V4L2 gives it, four letters; blanks at the end are left out.
    pub fn fourcc(self) -> &'static str {
        match self {
            PixelFormat::Mjpeg => "MJPG",
            PixelFormat::Yuyv => "YUYV",
            PixelFormat::Uyvy => "UYVY",
            PixelFormat::Nv12 => "NV12",
            PixelFormat::Grey => "GREY",
            PixelFormat::Rgb24 => "RGB3",
            PixelFormat::Z16 => "Z16",
            PixelFormat::Y16 => "Y16",
        }
    }

    /// The format of that name; JPEG goes by two.
    pub fn from_fourcc(name: &str) -> Option<Self> {
        if name == "JPEG" {
            return Some(PixelFormat::Mjpeg);
        }
        let mut formats = Self::ALL.into_iter().chain(Self::DEPTH);
        formats.find(|format| format.fourcc() == name.trim_end())
    }

    /// Whether its images are of depth.
    pub fn is_depth(self) -> bool {
        Self::DEPTH.contains(&self)
    }

    /// Bytes of a picture without padding; `None` where that depends on the picture.
    pub fn picture_bytes(self, size: Size) -> Option<usize> {
        let (width, height) = (size.width as usize, size.height as usize);
        match self {
            PixelFormat::Mjpeg => None,
            PixelFormat::Yuyv | PixelFormat::Uyvy | PixelFormat::Z16 | PixelFormat::Y16 => {
                Some(2 * width * height)
            }
            PixelFormat::Nv12 => Some(width * height + 2 * (width / 2) * (height / 2)),
            PixelFormat::Grey => Some(width * height),
            PixelFormat::Rgb24 => Some(3 * width * height),
        }
    }
}

impl std::fmt::Display for PixelFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.fourcc())
    }
}

/// A frame as it left the camera or the file, not decoded.
#[derive(Clone, Debug)]
pub struct RawFrame {
    /// The driver's own count with its wraps undone, or the index in the file; a step of more than
    /// one is a loss before us. `None` where the driver does not count.
    pub sequence: Option<u64>,
    /// The sensor's time in seconds, a whole number of nanoseconds ([`seconds`]); only differences
    /// mean something. Strictly growing within one source.
    pub sensor_time_s: f64,
    pub size: Size,
    pub format: PixelFormat,
    pub bytes: Vec<u8>,
    /// The depth image that belongs to it.
    pub depth: Option<Arc<DepthImage>>,
}

impl RawFrame {
    /// Memory that it takes, bytes.
    pub fn all_bytes(&self) -> usize {
        self.bytes.len() + self.depth.as_ref().map_or(0, |depth| depth.bytes())
    }
}

/// A raw frame with its place in the film.
#[derive(Clone, Debug)]
pub struct TimedFrame {
    pub raw: Arc<RawFrame>,
    /// Frames since the first one, those that were lost before us included.
    pub index: u64,
    /// Seconds since the first frame, by the sensor's clock.
    pub time_s: f64,
    /// When the program received the frame, for latency figures only.
    pub received: Instant,
}

impl TimedFrame {
    /// Frame `index` of a film whose first frame has the sensor time `first_s`, s.
    pub fn new(raw: Arc<RawFrame>, index: u64, first_s: f64, received: Instant) -> Self {
        Self {
            time_s: raw.sensor_time_s - first_s,
            raw,
            index,
            received,
        }
    }
}

/// Whole nanoseconds of a time in seconds: what a recording keeps of it. Times beyond 292 years are
/// cut to that.
pub fn nanoseconds(time_s: f64) -> i64 {
    let whole = time_s.floor();
    // The fraction of a double is exact, so nothing is lost by taking it off first.
    let part = ((time_s - whole) * 1e9).round();
    (whole as i64)
        .saturating_mul(1_000_000_000)
        .saturating_add(part as i64)
}

/// The same back again; `seconds(nanoseconds(t))` is `t` for every `t` that came out of here, to
/// the last bit.
pub fn seconds(time_ns: i64) -> f64 {
    let (whole, part) = (
        time_ns.div_euclid(1_000_000_000),
        time_ns.rem_euclid(1_000_000_000),
    );
    whole as f64 + part as f64 / 1e9
}

/// Grey picture, row by row, no padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Luma {
    pub size: Size,
    pub pixels: Vec<u8>,
}

/// Colour picture, row by row, red green blue, no padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgb {
    pub size: Size,
    pub pixels: Vec<u8>,
}

/// Brightness of a colour (ITU-R BT.601, the weights that JPEG and YUYV are made with).
pub fn brightness(colour: [u8; 3]) -> u8 {
    let [r, g, b] = colour.map(u32::from);
    ((77 * r + 150 * g + 29 * b + 128) >> 8) as u8
}

/// Channels of a pixel that differ by more than this make a colour, levels: what a JPEG of a grey
/// picture may be off. A picture has colours if this share of it has one.
const GREY_LEVELS: u8 = 4;
const COLOUR_SHARE: f64 = 0.001;

fn is_coloured([red, green, blue]: [u8; 3]) -> bool {
    red.max(green).max(blue) - red.min(green).min(blue) > GREY_LEVELS
}

impl Rgb {
    /// Whether it is more than grey.
    pub fn has_colour(&self) -> bool {
        let (pixels, _) = self.pixels.as_chunks::<3>();
        let coloured = pixels.iter().filter(|pixel| is_coloured(**pixel)).count();
        coloured as f64 > COLOUR_SHARE * pixels.len() as f64
    }

    /// The colour of the pixel at column `u` and row `v`; both must lie in the picture.
    pub fn at(&self, u: u32, v: u32) -> [u8; 3] {
        let i = 3 * (v as usize * self.size.width as usize + u as usize);
        [self.pixels[i], self.pixels[i + 1], self.pixels[i + 2]]
    }

    /// The colour between the pixels about a place, bilinear, 0 to 255; `None` outside.
    pub fn interpolated(&self, at_px: Point2<f64>) -> Option<Vector3<f64>> {
        let (right, down) = (
            f64::from(self.size.width) - 1.0,
            f64::from(self.size.height) - 1.0,
        );
        if !((0.0..=right).contains(&at_px.x) && (0.0..=down).contains(&at_px.y)) {
            return None;
        }
        let (u, v) = (at_px.x as u32, at_px.y as u32);
        let (to_right, to_down) = (at_px.x.fract(), at_px.y.fract());
        let (next_u, next_v) = (
            (u + 1).min(self.size.width - 1),
            (v + 1).min(self.size.height - 1),
        );
        let colour = |u, v| Vector3::from(self.at(u, v).map(f64::from));
        let above = colour(u, v).lerp(&colour(next_u, v), to_right);
        let below = colour(u, next_v).lerp(&colour(next_u, next_v), to_right);
        Some(above.lerp(&below, to_down))
    }

    /// Mean of each channel (sRGB); `None` of no pixel.
    pub fn mean(&self) -> Option<[u8; 3]> {
        let mut sum = [0_u64; 3];
        for pixel in self.pixels.chunks_exact(3) {
            for (sum, channel) in sum.iter_mut().zip(pixel) {
                *sum += u64::from(*channel);
            }
        }
        let count = self.pixels.len() as u64 / 3;
        (count > 0).then(|| sum.map(|sum| ((sum + count / 2) / count) as u8))
    }
}

/// A whole frame in colour, which is kept.
#[derive(Clone, Debug)]
pub struct Picture {
    pub rgb: Arc<Rgb>,
    pub frame: u64,
    pub time_s: f64,
}

/// A decoded frame on its way to the tracker.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Frames since the first one of this capture; a frame lost before us leaves a hole in the
    /// count.
    pub index: u64,
    /// Seconds since the first frame of this capture, by the sensor's clock.
    pub time_s: f64,
    /// When the program received the frame, for latency figures only.
    pub received: Instant,
    pub luma: Luma,
    /// A smaller picture in colour for the screen, made for some frames only.
    pub preview: Option<Arc<Rgb>>,
    /// The whole picture in colour, where coloured markers are followed.
    pub colour: Option<Rgb>,
    /// The frame as it came, from which its colours can be had later; `None` where only the luma is
    /// known.
    pub raw: Option<Arc<RawFrame>>,
    /// The depth image that belongs to it.
    pub depth: Option<Arc<DepthImage>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A replay must see the times of the run that recorded it, whatever clock they came from:
    /// uptime, the epoch, a file's ticks, or before zero.
    #[test]
    fn a_time_survives_the_way_through_nanoseconds() {
        for start_s in [0.0, -0.25, 12.345_678, 86_400.0 * 300.0, 1.7e9] {
            for k in 0..20_000 {
                let time_s = seconds(nanoseconds(start_s + f64::from(k) / 29.97));
                assert_eq!(seconds(nanoseconds(time_s)), time_s);
                assert!((time_s - start_s - f64::from(k) / 29.97).abs() < 3e-7);
            }
        }
        assert_eq!(
            (nanoseconds(-0.25), seconds(-250_000_000)),
            (-250_000_000, -0.25)
        );
        assert_eq!(nanoseconds(f64::INFINITY), i64::MAX);
    }
}

//! Raw frames to pictures: luma for the tracker, a small one in colour for the screen.

use crate::model::{Luma, PixelFormat, RawFrame, Rgb, Size, brightness};
use turbojpeg::{Colorspace, Decompressor, Image, ScalingFactor};

/// Some cheap cameras leave a few filling bytes before the end mark of every picture. They are
/// harmless; more of them are what is left when a damaged picture has been read out of step.
const FILLING_BYTES: u32 = 8;

/// Why a frame could not be decoded; the source goes on, the next frame may be whole.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DecodeError {
    /// The frame is damaged: leave it out and count it.
    #[error("the picture is damaged: {what}")]
    Damaged { what: String },
    /// The pictures became larger or smaller: start again, or stop.
    #[error("the picture is {found}, but {expected} is expected; its size must not change")]
    SizeChanged { expected: Size, found: Size },
    /// The decoder itself does not work.
    #[error("no JPEG decoder: {what}")]
    Unavailable { what: String },
}

/// Decodes frame after frame and keeps what it needs for that.
pub struct Decoder {
    jpeg: Decompressor,
    /// Sizes to which a JPEG can be decoded at once, as shares of the full one, largest first, none
    /// above 1.
    scales: Vec<ScalingFactor>,
}

impl Decoder {
    /// # Errors
    /// The JPEG library cannot be initialised.
    pub fn new() -> Result<Self, DecodeError> {
        let jpeg = new_jpeg()?;
        let mut scales = Decompressor::supported_scaling_factors();
        scales.retain(|s| s.num() <= s.denom());
        scales.sort_by_key(|s| std::cmp::Reverse(s.scale(1 << 20)));
        Ok(Self { jpeg, scales })
    }

    /// Decodes the brightness into `into`. An empty `into` takes the frame's size, and is not
    /// allocated again as long as that stays; after an error its content means nothing.
    ///
    /// # Errors
    /// The frame is damaged, or its size is not that of `into` or not what the source said.
    pub fn luma(&mut self, raw: &RawFrame, into: &mut Luma) -> Result<(), DecodeError> {
        self.check(raw)?;
        if !into.pixels.is_empty() && into.size != raw.size {
            return Err(DecodeError::SizeChanged {
                expected: into.size,
                found: raw.size,
            });
        }
        into.size = raw.size;
        into.pixels.resize(raw.size.area(), 0);
        let pixels = into.pixels.as_mut_slice();
        match raw.format {
            PixelFormat::Mjpeg => {
                self.decompress(
                    raw,
                    ScalingFactor::ONE,
                    raw.size,
                    turbojpeg::PixelFormat::GRAY,
                    pixels,
                )?;
            }
            PixelFormat::Yuyv => pixels
                .iter_mut()
                .zip(raw.bytes.chunks_exact(2))
                .for_each(|(y, pair)| *y = pair[0]),
            // The upper bytes: a picture of far and near.
            PixelFormat::Uyvy | PixelFormat::Z16 | PixelFormat::Y16 => pixels
                .iter_mut()
                .zip(raw.bytes.chunks_exact(2))
                .for_each(|(y, pair)| *y = pair[1]),
            PixelFormat::Grey | PixelFormat::Nv12 => {
                pixels.copy_from_slice(&raw.bytes[..raw.size.area()])
            }
            PixelFormat::Rgb24 => {
                pixels
                    .iter_mut()
                    .zip(raw.bytes.chunks_exact(3))
                    .for_each(|(y, p)| {
                        *y = brightness([p[0], p[1], p[2]]);
                    })
            }
        }
        Ok(())
    }

    /// A picture in colour, no wider than `max_width` and else as large as is cheap.
    ///
    /// # Errors
    /// As for [`Decoder::luma`].
    pub fn preview(&mut self, raw: &RawFrame, max_width: u32) -> Result<Rgb, DecodeError> {
        self.check(raw)?;
        let max_width = max_width.max(1);
        if raw.format != PixelFormat::Mjpeg {
            return Ok(thin_out(raw.size, max_width, colour_of(raw)));
        }
        let fitting = self
            .scales
            .iter()
            .find(|s| s.scale(raw.size.width as usize) <= max_width as usize);
        let scale = fitting
            .or(self.scales.last())
            .copied()
            .unwrap_or(ScalingFactor::ONE);
        let [width, height] =
            [raw.size.width, raw.size.height].map(|side| scale.scale(side as usize) as u32);
        let mut rgb = Rgb {
            size: Size::new(width, height),
            pixels: vec![0; 3 * Size::new(width, height).area()],
        };
        self.decompress(
            raw,
            scale,
            rgb.size,
            turbojpeg::PixelFormat::RGB,
            &mut rgb.pixels,
        )?;
        if width <= max_width {
            return Ok(rgb);
        }
        let wide = rgb.size;
        Ok(thin_out(wide, max_width, |u, v| rgb.at(u, v)))
    }

    /// Makes sure that the frame has the size that it says.
    fn check(&mut self, raw: &RawFrame) -> Result<(), DecodeError> {
        let Some(must) = raw.format.picture_bytes(raw.size) else {
            let header = self
                .jpeg
                .read_header(&raw.bytes)
                .map_err(|e| self.damaged(e.to_string()))?;
            let found = Size::new(header.width as u32, header.height as u32);
            if found != raw.size {
                self.renew()?;
                return Err(DecodeError::SizeChanged {
                    expected: raw.size,
                    found,
                });
            }
            return Ok(());
        };
        let is = raw.bytes.len();
        if is < must || raw.size.area() == 0 {
            return Err(DecodeError::Damaged {
                what: format!("{is} bytes instead of the {must} of a {} picture", raw.size),
            });
        }
        Ok(())
    }

    fn decompress(
        &mut self,
        raw: &RawFrame,
        scale: ScalingFactor,
        size: Size,
        format: turbojpeg::PixelFormat,
        pixels: &mut [u8],
    ) -> Result<(), DecodeError> {
        let (width, height) = (size.width as usize, size.height as usize);
        let output = Image {
            pixels,
            width,
            pitch: width * format.size(),
            height,
            format,
        };
        let done = self
            .jpeg
            .set_scaling_factor(scale)
            .and_then(|()| self.jpeg.decompress(&raw.bytes, output));
        // The library goes on after damage, fills the rest with grey and warns; the crate makes
        // that an error.
        match done.map_err(|e| e.to_string()) {
            Err(what) if !is_filling(&what) => Err(self.damaged(what)),
            _ => Ok(()),
        }
    }

    fn damaged(&mut self, what: String) -> DecodeError {
        self.renew().err().unwrap_or(DecodeError::Damaged { what })
    }

    /// Takes a new JPEG decoder: the old one keeps the Huffman tables of a damaged picture, and
    /// would read every later one with them whose camera leaves its tables out.
    fn renew(&mut self) -> Result<(), DecodeError> {
        self.jpeg = new_jpeg()?;
        Ok(())
    }
}

fn new_jpeg() -> Result<Decompressor, DecodeError> {
    Decompressor::new().map_err(|e| DecodeError::Unavailable {
        what: e.to_string(),
    })
}

/// What of a JPEG the library finds damaged and goes on after; `None` of a sound one, and of one that it does
/// not read at all. Nothing is kept of the picture, which is decoded as small as can be.
pub(super) fn jpeg_damage(bytes: &[u8]) -> Option<String> {
    const SMALLEST: ScalingFactor = ScalingFactor::ONE_EIGHTH;
    let mut jpeg = Decompressor::new().ok()?;
    let header = jpeg.read_header(bytes).ok()?;
    jpeg.set_scaling_factor(SMALLEST).ok()?;
    let [width, height] = [header.width, header.height].map(|side| SMALLEST.scale(side));
    // The library makes neither colours nor grey of printing inks.
    let format = match header.colorspace {
        Colorspace::CMYK | Colorspace::YCCK => turbojpeg::PixelFormat::CMYK,
        _ => turbojpeg::PixelFormat::RGB,
    };
    let pitch = width * format.size();
    let mut pixels = vec![0; pitch * height];
    let output = Image {
        pixels: pixels.as_mut_slice(),
        width,
        pitch,
        height,
        format,
    };
    let complaint = jpeg.decompress(bytes, output).err()?.to_string();
    // As libjpeg words it: other complaints are of marks that are unusual, and of no pixel.
    let begin = ["Corrupt JPEG data: ", "Premature end "]
        .into_iter()
        .find_map(|begin| complaint.find(begin))?;
    let what = &complaint[begin..];
    (!is_filling(what)).then(|| what.trim_start_matches("Corrupt JPEG data: ").to_owned())
}

/// Whether the library only complains about a few bytes before the end mark, after the whole
/// picture.
fn is_filling(what: &str) -> bool {
    let Some((before, mark)) = what.split_once(" extraneous bytes before marker ") else {
        return false;
    };
    let count = before.rsplit(' ').next().and_then(|n| n.parse().ok());
    mark.starts_with("0xd9") && count.is_some_and(|n: u32| n <= FILLING_BYTES)
}

/// Every n-th pixel of a picture, so that it is no wider than `max_width`.
fn thin_out(size: Size, max_width: u32, colour: impl Fn(u32, u32) -> [u8; 3]) -> Rgb {
    let step = size.width.div_ceil(max_width).max(1);
    let small = Size::new(size.width.div_ceil(step), size.height.div_ceil(step));
    let mut pixels = Vec::with_capacity(3 * small.area());
    for v in (0..size.height).step_by(step as usize) {
        for u in (0..size.width).step_by(step as usize) {
            pixels.extend_from_slice(&colour(u, v));
        }
    }
    Rgb {
        size: small,
        pixels,
    }
}

/// Colour of a pixel of a frame that is not compressed.
fn colour_of(raw: &RawFrame) -> impl Fn(u32, u32) -> [u8; 3] {
    let (width, height) = (raw.size.width as usize, raw.size.height as usize);
    let (bytes, format) = (raw.bytes.as_slice(), raw.format);
    move |u, v| {
        let i = v as usize * width + u as usize;
        match format {
            PixelFormat::Z16 | PixelFormat::Y16 => [bytes[2 * i + 1]; 3],
            PixelFormat::Rgb24 => [bytes[3 * i], bytes[3 * i + 1], bytes[3 * i + 2]],
            // A pair of pixels shares U and V. An odd width does not occur: source and ffmpeg see
            // to it.
            PixelFormat::Yuyv => rgb_of(
                bytes[2 * i],
                bytes.get(4 * (i / 2) + 1),
                bytes.get(4 * (i / 2) + 3),
            ),
            PixelFormat::Uyvy => rgb_of(
                bytes[2 * i + 1],
                bytes.get(4 * (i / 2)),
                bytes.get(4 * (i / 2) + 2),
            ),
            PixelFormat::Nv12 => {
                // Two by two pixels share theirs; a last odd row or column has none.
                let pair =
                    height * width + (v as usize / 2) * 2 * (width / 2) + 2 * (u as usize / 2);
                rgb_of(bytes[i], bytes.get(pair), bytes.get(pair + 1))
            }
            PixelFormat::Grey | PixelFormat::Mjpeg => [bytes[i]; 3],
        }
    }
}

/// Grey where there is none.
fn chroma(c: Option<&u8>) -> f32 {
    c.map_or(0.0, |&c| f32::from(c) - 128.0)
}

/// BT.601 with the limited range of video.
fn rgb_of(luma: u8, cb: Option<&u8>, cr: Option<&u8>) -> [u8; 3] {
    let (y, cb, cr) = (1.164 * (f32::from(luma) - 16.0), chroma(cb), chroma(cr));
    // `as u8` saturates.
    [y + 1.596 * cr, y - 0.392 * cb - 0.813 * cr, y + 2.017 * cb].map(|c| (c + 0.5) as u8)
}

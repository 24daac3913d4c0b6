//! One photograph: PNG, JPEG or BMP, turned upright, and reduced where it is large.

use super::decode::jpeg_damage;
use crate::model::{Rgb, Size};
use image::imageops::{FilterType, resize};
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits, RgbImage};
use std::io::{Cursor, ErrorKind};

/// Pixels of a photograph that are read, at most.
const MOST_PIXELS: u64 = 64_000_000;
/// Longest side on which a photograph is worked, px; larger ones are reduced to it. The paper's have
/// about 1500 (Tan et al. 2008 sect. 2.2).
pub const LONGEST_SIDE_PX: u32 = 1536;
/// Least side, px.
const LEAST_SIDE_PX: u32 = 64;

/// A photograph as it is worked on.
#[derive(Clone, Debug)]
pub struct Photograph {
    pub picture: Rgb,
    /// As it is seen, before it was reduced.
    pub full_size: Size,
    /// What the decoder of a JPEG complains of that is damaged, and went on after: a part of the picture is
    /// not what the camera saw.
    pub damage: Option<String>,
}

/// What a HEIC file says to be (ISO/IEC 23008-12).
const HEIC_BRANDS: [&[u8; 4]; 4] = [b"heic", b"heix", b"mif1", b"msf1"];

/// Why a file gives no photograph. Each message is one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum PhotographError {
    #[error(
        "it is no picture that can be read ({what}); give a PNG, JPEG or BMP file, or --frame for a film"
    )]
    BadFormat { what: String },
    #[error("it is a {format} picture, which is not read; save it as PNG or JPEG, and give that")]
    OtherFormat { format: &'static str },
    #[error("it is damaged: the {format} is cut off before its end; copy or export it anew")]
    CutOff { format: &'static str },
    #[error("it is damaged: the {format} cannot be decoded to its end; copy or export it anew")]
    Damaged { format: &'static str },
    #[error("it has {megapixels} megapixels, and at most 64 are read; reduce it")]
    TooLarge { megapixels: u64 },
    #[error("it is {size} px, and must have 64 px a side at least; give a larger one")]
    TooSmall { size: Size },
}

impl Photograph {
    /// Reads the bytes of a picture file. Its EXIF orientation is applied; 16 bits a channel become
    /// 8, grey and CMYK become colours, and transparent parts lose their transparency.
    ///
    /// # Errors
    /// It is damaged, of another format, too large or too small.
    pub fn read(bytes: &[u8]) -> Result<Self, PhotographError> {
        if bytes.is_empty() {
            return Err(bad_format("the file is empty"));
        }
        let Some(format) = image_format(bytes) else {
            return Err(bad_format("its first bytes are those of no known format"));
        };
        match format {
            // The decoder fills what is missing with grey, and does not say so.
            "JPEG" if is_cut_off(bytes) => return Err(PhotographError::CutOff { format }),
            "JPEG" | "PNG" | "BMP" => {}
            _ => return Err(PhotographError::OtherFormat { format }),
        }
        let not_read = |e| not_read(format, e);
        let mut reader = ImageReader::new(Cursor::new(bytes))
            .with_guessed_format()
            .map_err(bad_format)?;
        reader.limits(Limits::no_limits());
        let mut decoder = reader.into_decoder().map_err(not_read)?;
        let (width, height) = decoder.dimensions();
        let pixels = u64::from(width) * u64::from(height);
        if pixels > MOST_PIXELS {
            return Err(PhotographError::TooLarge {
                megapixels: pixels.div_ceil(1_000_000),
            });
        }
        let size = Size::new(width, height);
        refuse_small(size)?;
        let orientation = decoder.orientation().map_err(not_read)?;
        let damage = match format {
            "JPEG" => jpeg_damage(bytes),
            _ => None,
        };
        let mut image = DynamicImage::from_decoder(decoder).map_err(not_read)?;
        let longest = width.max(height);
        if longest > LONGEST_SIDE_PX {
            image = image.resize(LONGEST_SIDE_PX, LONGEST_SIDE_PX, FilterType::Triangle);
        }
        image.apply_orientation(orientation);
        let rgb = image.into_rgb8();
        let is_turned = (rgb.width() > rgb.height()) != (width > height);
        let full_size = match is_turned {
            true => Size::new(height, width),
            false => size,
        };
        Ok(Self {
            full_size,
            damage,
            picture: Rgb {
                size: Size::new(rgb.width(), rgb.height()),
                pixels: rgb.into_raw(),
            },
        })
    }
}

impl Photograph {
    /// A frame of a film as a photograph.
    ///
    /// # Errors
    /// It is too small.
    pub fn of_frame(frame: Rgb) -> Result<Self, PhotographError> {
        let full_size = frame.size;
        refuse_small(full_size)?;
        let longest = full_size.width.max(full_size.height);
        let scale = f64::from(LONGEST_SIDE_PX) / f64::from(longest);
        let whole = RgbImage::from_raw(full_size.width, full_size.height, frame.pixels);
        let whole = whole.ok_or_else(|| bad_format("the frame is not whole"))?;
        let reduced = match scale < 1.0 {
            true => {
                let reduced = full_size.scaled(scale);
                resize(&whole, reduced.width, reduced.height, FilterType::Triangle)
            }
            false => whole,
        };
        Ok(Self {
            full_size,
            damage: None,
            picture: Rgb {
                size: Size::new(reduced.width(), reduced.height()),
                pixels: reduced.into_raw(),
            },
        })
    }
}

/// The name of the picture format that a file begins as; `None` for what is no picture.
pub fn image_format(begin: &[u8]) -> Option<&'static str> {
    if let Some([b'f', b't', b'y', b'p', brand @ ..]) = begin.get(4..12)
        && HEIC_BRANDS.iter().any(|known| brand == known.as_slice())
    {
        return Some("HEIC");
    }
    match image::guess_format(begin).ok()? {
        ImageFormat::Jpeg => Some("JPEG"),
        ImageFormat::Png => Some("PNG"),
        ImageFormat::Bmp => Some("BMP"),
        ImageFormat::WebP => Some("WebP"),
        ImageFormat::Gif => Some("GIF"),
        ImageFormat::Tiff => Some("TIFF"),
        ImageFormat::Avif => Some("AVIF"),
        ImageFormat::OpenExr => Some("OpenEXR"),
        ImageFormat::Qoi => Some("QOI"),
        _ => None,
    }
}

fn refuse_small(size: Size) -> Result<(), PhotographError> {
    match size.width.min(size.height) < LEAST_SIDE_PX {
        true => Err(PhotographError::TooSmall { size }),
        false => Ok(()),
    }
}

/// Whether a JPEG has no end mark behind the begin of its first scan (ITU-T T.81 annex B): within a
/// scan no such two bytes occur. What may stand behind the end mark, as phones add films, does not
/// count.
fn is_cut_off(bytes: &[u8]) -> bool {
    const BEGIN_OF_SCAN: u8 = 0xda;
    const END: [u8; 2] = [0xff, 0xd9];
    // Behind the mark of the begin of the picture.
    let mut at = 2;
    while let Some([0xff, marker, rest @ ..]) = bytes.get(at..) {
        match (*marker, rest) {
            (BEGIN_OF_SCAN, scan) => return !scan.windows(2).any(|pair| pair == END),
            // Filling, and marks without a length.
            (0xff, _) => at += 1,
            (0x01 | 0xd0..=0xd7, _) => at += 2,
            (_, [high, low, ..]) => at += 2 + usize::from(u16::from_be_bytes([*high, *low])),
            _ => return true,
        }
    }
    // What is there instead of a mark is left to the decoder.
    at >= bytes.len()
}

/// Why a file that begins as a picture of this format is not read.
fn not_read(format: &'static str, e: ImageError) -> PhotographError {
    match e {
        ImageError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof => {
            PhotographError::CutOff { format }
        }
        ImageError::Decoding(_) => PhotographError::Damaged { format },
        e => bad_format(e),
    }
}

fn bad_format(e: impl std::fmt::Display) -> PhotographError {
    PhotographError::BadFormat {
        what: e.to_string().replace('\n', " "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ExtendedColorType, ImageEncoder, Rgb as Pixel, RgbImage};

    fn png(image: &DynamicImage) -> Vec<u8> {
        encoded(image, ImageFormat::Png)
    }

    fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).expect("encoded");
        bytes.into_inner()
    }

    /// A picture with detail everywhere, so that every byte of its file counts.
    fn busy() -> DynamicImage {
        let mut noise = 1_u32;
        let pixels = RgbImage::from_fn(320, 240, |_, _| {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let [a, b, c, _] = noise.to_be_bytes();
            Pixel([a, b, c])
        });
        pixels.into()
    }

    /// Red above, blue below.
    fn halves(width: u32, height: u32) -> RgbImage {
        RgbImage::from_fn(width, height, |_, v| {
            Pixel(if v < height / 2 {
                [200, 0, 0]
            } else {
                [0, 0, 200]
            })
        })
    }

    #[test]
    fn a_large_photograph_is_reduced_and_a_small_one_stays() {
        let read = |w, h| Photograph::read(&png(&halves(w, h).into())).expect("a photograph");
        let small = read(640, 400);
        assert_eq!(small.picture.size, Size::new(640, 400));
        let large = read(3072, 2000);
        assert_eq!(large.full_size, Size::new(3072, 2000));
        assert_eq!(large.picture.size, Size::new(1536, 1000));
        assert_eq!(large.picture.at(700, 100), [200, 0, 0]);
        assert_eq!(large.picture.at(700, 900), [0, 0, 200]);
    }

    #[test]
    fn sixteen_bits_and_grey_are_read() {
        let wide = DynamicImage::from(halves(80, 70)).into_rgb16();
        let read = Photograph::read(&png(&wide.into())).expect("a photograph");
        assert_eq!(read.picture.at(3, 3), [200, 0, 0]);
        let grey = DynamicImage::from(halves(80, 70)).into_luma8();
        let read = Photograph::read(&png(&grey.into())).expect("a photograph");
        assert_eq!(read.picture.pixels.len(), 3 * 80 * 70);
    }

    /// Orientation 6: the camera was turned to the left, and the picture is turned to the right.
    #[test]
    fn a_photograph_is_turned_upright() {
        let mut bytes = Vec::new();
        let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95);
        let exif = [
            &b"MM\0\x2a\0\0\0\x08\0\x01"[..],
            &b"\x01\x12\0\x03\0\0\0\x01\0\x06\0\0"[..],
            &[0; 4],
        ];
        encoder.set_exif_metadata(exif.concat()).expect("exif");
        let lying = halves(120, 80);
        encoder
            .write_image(lying.as_raw(), 120, 80, ExtendedColorType::Rgb8)
            .expect("jpeg");
        let read = Photograph::read(&bytes).expect("a photograph");
        assert_eq!(read.picture.size, Size::new(80, 120));
        assert_eq!(read.full_size, Size::new(80, 120));
        // What was above is on the right.
        assert!(read.picture.at(70, 60)[0] > 150 && read.picture.at(10, 60)[2] > 150);
    }

    #[test]
    fn a_jpeg_that_is_cut_off_is_damaged_wherever_that_is() {
        let mut whole = encoded(&halves(200, 100).into(), ImageFormat::Jpeg);
        assert!(Photograph::read(&whole).is_ok());
        for kept in [4, 30, whole.len() / 2, whole.len() - 20, whole.len() - 1] {
            let error = Photograph::read(&whole[..kept]).expect_err("cut off");
            assert!(error.to_string().contains("damaged"), "{kept}: {error}");
        }
        // What phones add behind the picture is none of it.
        whole.extend([0xff, 0xda, 1, 2, 3]);
        assert!(Photograph::read(&whole).is_ok());
    }

    #[test]
    fn a_jpeg_that_is_damaged_within_is_read_and_said_to_be() {
        let mut whole = encoded(&busy(), ImageFormat::Jpeg);
        assert_eq!(Photograph::read(&whole).expect("a photograph").damage, None);
        for grey in [DynamicImage::from(busy().to_luma8()), halves(80, 70).into()] {
            let bytes = encoded(&grey, ImageFormat::Jpeg);
            assert_eq!(Photograph::read(&bytes).expect("a photograph").damage, None);
        }
        let (middle, end) = (whole.len() / 2, whole.len() - 2);
        let mut hole = whole.clone();
        hole[middle..middle + 500].fill(0);
        whole[middle..end].fill(0);
        for bytes in [hole, whole] {
            let read = Photograph::read(&bytes).expect("a photograph");
            assert_eq!(read.picture.size, Size::new(320, 240));
            assert!(read.damage.is_some());
        }
    }

    #[test]
    fn other_pictures_that_are_damaged_are_refused_as_such() {
        for format in [ImageFormat::Png, ImageFormat::Bmp] {
            let whole = encoded(&busy(), format);
            for kept in [whole.len() / 2, whole.len() - 20] {
                let error = Photograph::read(&whole[..kept]).expect_err("cut off");
                let is_cut_off = matches!(error, PhotographError::CutOff { .. });
                assert!(is_cut_off, "{format:?} {kept}: {error}");
            }
        }
        let mut png = encoded(&busy(), ImageFormat::Png);
        let middle = png.len() / 2;
        png[middle] ^= 1;
        let error = Photograph::read(&png).expect_err("damaged").to_string();
        assert!(error.contains("the PNG cannot be decoded"), "{error}");
    }

    #[test]
    fn a_frame_of_a_film_is_reduced_as_a_photograph_is() {
        let frame = |width, height| Rgb {
            size: Size::new(width, height),
            pixels: halves(width, height).into_raw(),
        };
        let large = Photograph::of_frame(frame(3072, 2000)).expect("a photograph");
        assert_eq!(large.picture.size, Size::new(1536, 1000));
        assert_eq!(large.full_size, Size::new(3072, 2000));
        assert_eq!(large.picture.at(700, 900), [0, 0, 200]);
        let small = Photograph::of_frame(frame(640, 360)).expect("a photograph");
        assert_eq!(small.picture, frame(640, 360));
        assert!(Photograph::of_frame(frame(640, 36)).is_err());
    }

    #[test]
    fn what_is_no_photograph_is_refused_in_one_line() {
        let whole = png(&halves(200, 100).into());
        let heic = [&[0, 0, 0, 24][..], b"ftypheic", &[0; 12]].concat();
        for (bytes, expected) in [
            (b"no picture".to_vec(), "no picture"),
            (Vec::new(), "the file is empty"),
            (whole[..whole.len() / 2].to_vec(), "the PNG is cut off"),
            (b"GIF89a\x01\0\x01\0".to_vec(), "it is a GIF"),
            (b"RIFF\x20\0\0\0WEBPVP8 ".to_vec(), "it is a WebP"),
            (b"II*\0\x08\0\0\0".to_vec(), "it is a TIFF"),
            (heic, "it is a HEIC"),
            (png(&halves(30, 100).into()), "64 px a side"),
            (
                png(&DynamicImage::new_luma8(10_000, 10_000)),
                "100 megapixels",
            ),
        ] {
            let error = Photograph::read(&bytes).expect_err(expected).to_string();
            assert!(error.contains(expected) && !error.contains('\n'), "{error}");
        }
    }
}

//! Pictures on leaves and bark.

use crate::model::{Rgb, Size};

/// A decoded texture.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    width: usize,
    height: usize,
    /// Four bytes a texel, red first.
    rgba: Vec<u8>,
}

/// Sides beyond this are scaled down: a leaf covers a few pixels, and textures of users come from
/// cameras.
const LARGEST: u32 = 1024;

impl Texture {
    /// Reads PNG or JPEG bytes; `None` for what is neither.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes))
            .with_guessed_format()
            .ok()?;
        // A small file may unfold to more than the memory holds.
        let mut limits = image::Limits::default();
        (limits.max_image_width, limits.max_image_height) = (Some(1 << 14), Some(1 << 14));
        reader.limits(limits);
        let picture = reader.decode().ok()?;
        let picture = if picture.width().max(picture.height()) > LARGEST {
            picture.resize(LARGEST, LARGEST, image::imageops::FilterType::Triangle)
        } else {
            picture
        };
        let rgba = picture.to_rgba8();
        let (width, height) = (rgba.width() as usize, rgba.height() as usize);
        (width * height > 0).then(|| Self {
            width,
            height,
            rgba: rgba.into_raw(),
        })
    }

    /// A picture without a transparent part; `None` of none.
    pub fn of(picture: &Rgb) -> Option<Self> {
        let Size { width, height } = picture.size;
        let mut rgba = Vec::with_capacity(4 * picture.size.area());
        for pixel in picture.pixels.chunks_exact(3) {
            rgba.extend([pixel[0], pixel[1], pixel[2], u8::MAX]);
        }
        (!rgba.is_empty() && rgba.len() == 4 * picture.size.area()).then_some(Self {
            width: width as usize,
            height: height as usize,
            rgba,
        })
    }

    /// The texel at (`u`, `v`), 0 to 1 across and down, repeated beyond that as glTF does by
    /// default.
    pub fn at(&self, u: f32, v: f32) -> [u8; 4] {
        let at = 4 * (texel(v, self.height) * self.width + texel(u, self.width));
        [
            self.rgba[at],
            self.rgba[at + 1],
            self.rgba[at + 2],
            self.rgba[at + 3],
        ]
    }
}

/// Number of the texel at `c` along a side of `n` texels.
fn texel(c: f32, n: usize) -> usize {
    (((c - c.floor()) * n as f32) as usize).min(n - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeats_and_refuses_what_is_no_picture() {
        let picture = image::RgbaImage::from_raw(2, 1, vec![1, 2, 3, 255, 7, 8, 9, 0]).unwrap();
        let mut png = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let texture = Texture::read(png.get_ref()).unwrap();
        for (u, expected) in [
            (0.2, [1, 2, 3, 255]),
            (0.9, [7, 8, 9, 0]),
            (-0.9, [1, 2, 3, 255]),
            (5.9, [7, 8, 9, 0]),
        ] {
            assert_eq!(texture.at(u, 0.5), expected, "{u}");
        }
        assert_eq!(texture.at(f32::NAN, f32::INFINITY), [1, 2, 3, 255]);
        assert_eq!(Texture::read(&png.get_ref()[..20]), None);
        assert_eq!(Texture::read(b"no picture"), None);
    }
}

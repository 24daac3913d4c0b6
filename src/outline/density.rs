//! A drawn density of the leaves: a grey picture of the frame's size, white where they are densest.

use crate::model::{Luma, Size};
use std::path::Path;

/// Below this mean a picture counts as empty: noise of a JPEG in what is black.
const LEAST_MEAN: f64 = 0.5;

/// Why a picture is no density.
#[derive(Debug, thiserror::Error)]
pub enum DensityError {
    #[error(
        "cannot read density {name}: {what}; give a PNG, JPEG or BMP of the film's size, white where leaves are"
    )]
    Unreadable { name: String, what: String },
    #[error(
        "density {name} is for {found}, the picture is {wanted}; draw it on a frame of this clip"
    )]
    WrongSize {
        name: String,
        found: Size,
        wanted: Size,
    },
    #[error("density {name} is black all over; draw in white where leaves are to be")]
    Empty { name: String },
}

/// Reads a density for pictures of `size`; what is transparent in it is black.
///
/// # Errors
/// It cannot be read, is of another size, or has nothing in it.
pub fn density(path: &Path, size: Size) -> Result<Luma, DensityError> {
    let name = path.display().to_string();
    let picture = match decode(path) {
        Ok(picture) => picture.into_luma_alpha8(),
        Err(e) => {
            let what = e.to_string();
            return Err(DensityError::Unreadable { name, what });
        }
    };
    let found = Size::new(picture.width(), picture.height());
    if found != size {
        return Err(DensityError::WrongSize {
            name,
            found,
            wanted: size,
        });
    }
    let pixels: Vec<u8> = picture
        .pixels()
        .map(|p| (u16::from(p.0[0]) * u16::from(p.0[1]) / 255) as u8)
        .collect();
    let mean = pixels.iter().map(|&p| f64::from(p)).sum::<f64>() / pixels.len().max(1) as f64;
    if mean < LEAST_MEAN {
        return Err(DensityError::Empty { name });
    }
    Ok(Luma { size, pixels })
}

fn decode(path: &Path) -> image::ImageResult<image::DynamicImage> {
    let mut reader = image::ImageReader::open(path)?.with_guessed_format()?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(16384);
    limits.max_image_height = Some(16384);
    reader.limits(limits);
    reader.decode()
}

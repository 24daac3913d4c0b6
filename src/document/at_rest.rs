//! `rest.png`, `wood.png` and `leaves.png`: the tree at rest, how sure it is that each pixel is wood,
//! and that it is a leaf.
//!
//! The picture is a PNG as the masks are: they are used together to the pixel, and what a finished
//! run reads back is what it writes.

use super::{grey_png, png};
use crate::files::WriteError;
use crate::model::{AtRest, Luma, Masks, Rgb, Size};
use image::DynamicImage;
use std::path::Path;

/// Names of the picture and the masks in the folder of a capture.
pub const REST_FILE: &str = "rest.png";
pub const WOOD_MASK_FILE: &str = "wood.png";
pub const LEAVES_MASK_FILE: &str = "leaves.png";

/// A file of a document.
#[derive(Clone, Debug)]
pub struct FileBytes {
    pub name: &'static str,
    pub bytes: Vec<u8>,
}

/// The three files.
///
/// # Errors
/// A picture has no area, or not as many bytes as it should have.
pub fn at_rest_files(at_rest: &AtRest) -> Result<[FileBytes; 3], WriteError> {
    Ok([
        FileBytes {
            name: REST_FILE,
            bytes: png::png(&at_rest.picture)?,
        },
        FileBytes {
            name: WOOD_MASK_FILE,
            bytes: grey_png(&at_rest.masks.wood)?,
        },
        FileBytes {
            name: LEAVES_MASK_FILE,
            bytes: grey_png(&at_rest.masks.leaves)?,
        },
    ])
}

/// What the three files in `dir` hold, which must be of the film's size.
///
/// # Errors
/// One is missing, no picture of its kind, or of another size, for the user to read.
pub(super) fn read(dir: &Path, size: Size) -> Result<AtRest, String> {
    Ok(AtRest {
        picture: Rgb {
            size,
            pixels: picture(dir, REST_FILE, size)?.into_rgb8().into_raw(),
        },
        masks: Masks {
            wood: mask(dir, WOOD_MASK_FILE, size)?,
            leaves: mask(dir, LEAVES_MASK_FILE, size)?,
        },
    })
}

/// The mask of the leaves in `dir`, which must be of the picture's size.
///
/// # Errors
/// As of [`read`].
pub(super) fn leaves(dir: &Path, size: Size) -> Result<Luma, String> {
    mask(dir, LEAVES_MASK_FILE, size)
}

fn mask(dir: &Path, name: &str, size: Size) -> Result<Luma, String> {
    let grey = picture(dir, name, size)?.into_luma8();
    Ok(Luma {
        size,
        pixels: grey.into_raw(),
    })
}

fn picture(dir: &Path, name: &str, size: Size) -> Result<DynamicImage, String> {
    let picture = png::read(dir, name, size)?;
    let found = Size::new(picture.width(), picture.height());
    if found != size {
        return Err(format!("{name} is {found}, and the film is {size}"));
    }
    Ok(picture)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes the files of pictures of this size, but for the one of this name.
    fn put(dir: &Path, size: Size, missing: &str) {
        for file in at_rest_files(&AtRest::made_up(size)).expect("files") {
            let path = dir.join(file.name);
            let _ = std::fs::remove_file(&path);
            if file.name != missing {
                std::fs::write(path, file.bytes).expect("written");
            }
        }
    }

    #[test]
    fn what_was_written_is_read_and_another_size_or_a_missing_file_is_refused() {
        let dir = tempfile::tempdir().expect("a folder");
        let size = Size::new(4, 3);
        put(dir.path(), size, "");
        assert_eq!(read(dir.path(), size), Ok(AtRest::made_up(size)));
        for name in [REST_FILE, WOOD_MASK_FILE, LEAVES_MASK_FILE] {
            put(dir.path(), size, name);
            let why = read(dir.path(), size).expect_err("one is missing");
            assert!(why.starts_with(&format!("{name}: ")), "{why}");
        }
        put(dir.path(), Size::new(2, 3), "");
        let why = read(dir.path(), size).expect_err("they are small");
        assert_eq!(why, "rest.png is 2x3, and the film is 4x3");
    }
}

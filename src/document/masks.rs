//! `wood.png` and `leaves.png`: how sure it is that each pixel is wood, and that it is a leaf.

use super::png;
use crate::model::{Luma, Masks, Size};
use std::path::Path;

/// Names of the masks in the folder of a capture.
pub const WOOD_MASK_FILE: &str = "wood.png";
pub const LEAVES_MASK_FILE: &str = "leaves.png";

/// The masks in `dir`, which must be of the film's size.
///
/// # Errors
/// One is missing, no picture of its kind, or of another size, for the user to read.
pub(super) fn read(dir: &Path, size: Size) -> Result<Masks, String> {
    Ok(Masks {
        wood: mask(dir, WOOD_MASK_FILE, size)?,
        leaves: mask(dir, LEAVES_MASK_FILE, size)?,
    })
}

fn mask(dir: &Path, name: &str, size: Size) -> Result<Luma, String> {
    let grey = png::read(dir, name, size)?.into_luma8();
    let found = Size::new(grey.width(), grey.height());
    if found != size {
        return Err(format!("{name} is {found}, and the film is {size}"));
    }
    Ok(Luma {
        size,
        pixels: grey.into_raw(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::grey_png;
    use super::*;

    #[test]
    fn masks_of_another_size_and_a_missing_one_are_refused() {
        let dir = tempfile::tempdir().expect("a folder");
        let of = |size: Size| Luma {
            size,
            pixels: vec![9; size.area()],
        };
        let put = |name, size| {
            let bytes = grey_png(&of(size)).expect("a file");
            std::fs::write(dir.path().join(name), bytes).expect("written");
        };
        let size = Size::new(4, 3);
        put(WOOD_MASK_FILE, size);
        let why = read(dir.path(), size).expect_err("no leaves");
        assert!(why.starts_with("leaves.png: "), "{why}");
        put(LEAVES_MASK_FILE, Size::new(2, 3));
        let why = read(dir.path(), size).expect_err("small leaves");
        assert_eq!(why, "leaves.png is 2x3, and the film is 4x3");
        put(LEAVES_MASK_FILE, size);
        let masks = read(dir.path(), size).expect("masks");
        assert_eq!((masks.wood, masks.leaves), (of(size), of(size)));
    }
}

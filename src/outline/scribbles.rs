//! Outlines drawn as a picture: a mask, white on black, or scribbles, white and black strokes on
//! undecided ground.

use super::error::OutlineError;
use super::region;
use crate::model::{Outline, Size, brightness};
use crate::signal::median;
use image::{ImageError, RgbaImage};
use std::path::Path;

/// Share of undecided pixels above which a picture holds scribbles: a mask has them at its soft
/// edges only.
const MOST_UNDECIDED: f64 = 0.05;
/// Brightness up to which a stroke counts as black, and from which as white; JPEG leaves neither
/// quite alone.
const BLACK: u8 = 40;
const WHITE: u8 = 215;
/// From here to there it is neither, at the soft edge of a mask.
const GREY: std::ops::RangeInclusive<u8> = 64..=192;
/// In a scribble image the undecided rest is of one shade, so many grey levels wide; else it is a
/// photograph, whose bright sky would be taken for tree.
const ONE_SHADE: u8 = 24;
/// Share of the undecided pixels that must be of that shade; the edges of strokes are not.
const MOST_OF_REST: f64 = 0.8;

/// What a stroke says about a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    Undecided,
    Background,
    Tree,
}

/// Strokes of a person who marked some of the tree and some of the background in the first frame
/// (Zeng 2015 sect. 5.3.1).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scribbles {
    /// Name of the file, for messages.
    pub name: String,
    pub size: Size,
    /// One for each pixel, row by row.
    pub marks: Vec<Mark>,
}

/// An outline as a person gave it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Given {
    /// The region itself.
    Region(Outline),
    /// What it is to be solved from, once the first picture is there
    /// ([`from_scribbles`](super::from_scribbles)).
    Scribbles(Scribbles),
}

impl From<Outline> for Given {
    fn from(outline: Outline) -> Self {
        Given::Region(outline)
    }
}

/// Reads a mask or scribbles (PNG, JPEG, BMP). They are told apart by what they hold: a mask is
/// black and white, or white and transparent; scribbles leave more than 5 % of the picture
/// undecided, in one grey or transparent, and have black.
///
/// # Errors
/// It cannot be read, is not of `size`, is neither of the two, or lacks white, or black in
/// scribbles.
pub fn read(path: &Path, size: Size) -> Result<Given, OutlineError> {
    let name = path.display().to_string();
    let picture = image::open(path)
        .map_err(|e| {
            let what = match e {
                ImageError::Unsupported(_) => {
                    "it is neither a JSON polygon nor a picture".to_owned()
                }
                e => format!("it is no picture that can be read ({e})"),
            };
            OutlineError::bad_file(&name, what)
        })?
        .into_rgba8();
    let found = Size::new(picture.width(), picture.height());
    if found != size {
        return Err(OutlineError::WrongSize {
            name,
            found,
            wanted: size,
        });
    }
    let shades: Vec<Option<u8>> = picture.pixels().map(|p| shade(p.0)).collect();
    let marks: Vec<Mark> = shades.iter().map(|s| mark(*s)).collect();
    if is_mask(&picture, &shades, &marks) {
        if shades.contains(&None) && !marks.contains(&Mark::Background) {
            tracing::warn!(
                "outline {name}: taken for a mask, as it has white and no black; scribbles need both"
            );
        }
        let mask: Vec<u8> = shades
            .iter()
            .map(|s| if s.is_some_and(|s| s >= 128) { 255 } else { 0 })
            .collect();
        let one = region::close_to_one(size, &mask, 0)
            .map_err(|e| OutlineError::bad_file(&name, e))?
            .ok_or_else(|| {
                OutlineError::bad_file(&name, "nothing in it is white, and white is tree")
            })?;
        return Ok(Given::Region(one));
    }
    check(&picture, &marks).map_err(|what| OutlineError::bad_file(&name, what))?;
    Ok(Given::Scribbles(Scribbles { name, size, marks }))
}

/// Brightness of a pixel, `None` where it is more transparent than not.
fn shade([r, g, b, opacity]: [u8; 4]) -> Option<u8> {
    (opacity >= 128).then_some(brightness([r, g, b]))
}

fn mark(shade: Option<u8>) -> Mark {
    match shade {
        Some(WHITE..) => Mark::Tree,
        Some(..=BLACK) => Mark::Background,
        _ => Mark::Undecided,
    }
}

/// Whether it is a mask, also one with soft edges, in grey or in opacity.
fn is_mask(picture: &RgbaImage, shades: &[Option<u8>], marks: &[Mark]) -> bool {
    let most = MOST_UNDECIDED * marks.len() as f64;
    if count(marks, Mark::Undecided) as f64 <= most {
        return true;
    }
    let grey = shades.iter().flatten().filter(|s| GREY.contains(s)).count();
    let little_grey = grey as f64 <= most;
    if shades.iter().all(Option::is_some) {
        // What is between black and white is of all shades at soft edges, and of one in scribbles.
        return little_grey && !one_shade(picture, marks);
    }
    // White on nothing, cut out elsewhere: scribbles have black.
    let black = shades.iter().flatten().any(|s| *s < *GREY.start());
    count(marks, Mark::Tree) > 0 && !black && little_grey
}

fn count(marks: &[Mark], wanted: Mark) -> usize {
    marks.iter().filter(|m| **m == wanted).count()
}

/// Whether what is undecided and opaque is of one shade, but for the edges of strokes.
fn one_shade(picture: &RgbaImage, marks: &[Mark]) -> bool {
    let rest: Vec<[u8; 4]> = picture
        .pixels()
        .zip(marks)
        .filter(|(p, m)| **m == Mark::Undecided && p.0[3] >= 128)
        .map(|(p, _)| p.0)
        .collect();
    let middle = [0, 1, 2].map(|channel| {
        let values = rest.iter().map(|p| p[channel]).collect();
        median(values, u8::cmp).unwrap_or(0)
    });
    let near = rest
        .iter()
        .filter(|p| (0..3).all(|c| p[c].abs_diff(middle[c]) <= ONE_SHADE));
    near.count() as f64 >= MOST_OF_REST * rest.len() as f64
}

/// Why scribbles cannot be solved.
fn check(picture: &RgbaImage, marks: &[Mark]) -> Result<(), &'static str> {
    if !one_shade(picture, marks) {
        return Err(
            "it is neither a mask (black and white) nor scribbles (white tree, black background, \
             the rest one grey or transparent)",
        );
    }
    match (
        marks.contains(&Mark::Tree),
        marks.contains(&Mark::Background),
    ) {
        (true, true) => Ok(()),
        (true, false) => Err(
            "its scribbles mark no background; draw black strokes on some of it, or fill the rest black for a mask",
        ),
        (false, true) => {
            Err("its scribbles mark no tree; draw white strokes on trunk and branches")
        }
        (false, false) => Err(
            "it has no scribbles; draw white strokes on the tree and black ones on the background",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        width: 60,
        height: 40,
    };

    /// A picture of one colour with strokes, as a file.
    fn given(ground: [u8; 4], strokes: &[([u8; 4], u32)]) -> Result<Given, String> {
        let mut picture = RgbaImage::from_pixel(SIZE.width, SIZE.height, image::Rgba(ground));
        for &(colour, left) in strokes {
            (5..35).for_each(|v| {
                (left..left + 6).for_each(|u| picture.put_pixel(u, v, image::Rgba(colour)))
            });
        }
        let file = tempfile::Builder::new()
            .suffix(".png")
            .tempfile()
            .expect("file");
        picture.save(file.path()).expect("picture");
        read(file.path(), SIZE).map_err(|e| e.to_string())
    }

    #[test]
    fn masks_and_scribbles_are_told_apart_by_what_they_hold() {
        let (black, white, grey, clear) = (
            [0, 0, 0, 255],
            [255; 4],
            [128, 128, 128, 255],
            [255, 255, 255, 0],
        );
        // On black, and saved without a ground.
        for ground in [black, clear, [0; 4]] {
            let Ok(Given::Region(outline)) = given(ground, &[(white, 9)]) else {
                panic!("{ground:?}")
            };
            assert_eq!(outline.mask.iter().filter(|m| **m != 0).count(), 180);
        }
        for ground in [grey, clear, [200, 190, 210, 255]] {
            let Ok(Given::Scribbles(s)) = given(ground, &[(white, 9), (black, 40)]) else {
                panic!("{ground:?}")
            };
            for mark in [Mark::Tree, Mark::Background] {
                assert_eq!(count(&s.marks, mark), 180, "{mark:?} on {ground:?}");
            }
        }
    }

    const SOFT_STRIPE: [u8; 20] = [
        0, 0, 0, 0, 0, 0, 0, 0, 10, 50, 128, 205, 255, 255, 255, 255, 200, 55, 8, 0,
    ];

    /// A bare tree as a segmentation tool gives it is a lot of edge, fading in grey or in opacity.
    #[test]
    fn a_mask_may_have_soft_edges() {
        let file = tempfile::Builder::new()
            .suffix(".png")
            .tempfile()
            .expect("file");
        for by_opacity in [false, true] {
            let picture = image::RgbaImage::from_fn(SIZE.width, SIZE.height, |u, _| {
                let soft = SOFT_STRIPE[u as usize % 20];
                image::Rgba(if by_opacity {
                    [255, 255, 255, soft]
                } else {
                    [soft, soft, soft, 255]
                })
            });
            picture.save(file.path()).expect("picture");
            let outline = match read(file.path(), SIZE) {
                Ok(Given::Region(outline)) => outline,
                other => panic!("{other:?}"),
            };
            assert!(
                (240..=280).contains(&outline.mask.iter().filter(|m| **m != 0).count()),
                "{by_opacity}"
            );
        }
    }

    /// Its black shadows and white sky are no scribbles.
    #[test]
    fn a_photograph_is_refused() {
        let file = tempfile::Builder::new()
            .suffix(".png")
            .tempfile()
            .expect("file");
        let photograph = image::RgbImage::from_fn(SIZE.width, SIZE.height, |u, v| {
            image::Rgb([(4 * u) as u8, (6 * v) as u8, (4 * u) as u8])
        });
        photograph.save(file.path()).expect("picture");
        let message = read(file.path(), SIZE)
            .map(drop)
            .expect_err("a photograph")
            .to_string();
        assert!(message.contains("neither a mask"), "{message}");
    }

    #[test]
    fn scribbles_that_cannot_be_solved_are_refused_with_what_to_do() {
        let (black, white, grey) = ([0, 0, 0, 255], [255; 4], [128, 128, 128, 255]);
        let cases = [
            (given(grey, &[(white, 9)]), "black strokes"),
            (given(grey, &[(black, 9)]), "white strokes"),
            (given(grey, &[]), "no scribbles"),
            (given([0; 4], &[]), "no scribbles"),
        ];
        for (result, says) in cases {
            let message = result.map(drop).expect_err(says);
            assert!(
                message.contains(says) && message.contains("leave --outline out"),
                "{message}"
            );
        }
    }
}

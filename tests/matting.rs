//! Scribbles solved by closed-form matting, held to PyMatting's solution of the same
//! (scripts/matting-fixture.py).

use arborcam::config::Detect;
use arborcam::model::{CameraMotion, Luma, Outline, Rgb, Size};
use arborcam::outline::{self, Given, Mark, Scribbles};
use arborcam::track::Detector;
use nalgebra::Point2;
use std::path::Path;

fn picture() -> Rgb {
    let picture = image::open("tests/matting/picture.png")
        .expect("picture")
        .into_rgb8();
    Rgb {
        size: Size::new(picture.width(), picture.height()),
        pixels: picture.into_raw(),
    }
}

fn scribbles(size: Size) -> Scribbles {
    match outline::load(Path::new("tests/matting/scribbles.png"), size).expect("scribbles") {
        Given::Scribbles(scribbles) => scribbles,
        Given::Region(_) => panic!("taken for a mask"),
    }
}

fn solved() -> Outline {
    let picture = picture();
    outline::from_scribbles(&scribbles(picture.size), &picture).expect("outline")
}

/// As a share of full opacity.
fn mean_difference(a: &[u8], b: &[u8]) -> f64 {
    let sum: f64 = a
        .iter()
        .zip(b)
        .map(|(a, b)| f64::from(a.abs_diff(*b)))
        .sum();
    sum / 255.0 / a.len() as f64
}

#[test]
fn the_matte_is_that_of_pymatting() {
    let picture = picture();
    let alpha = outline::alpha(&picture, &scribbles(picture.size)).expect("alpha");
    let theirs = image::open("tests/matting/alpha.png")
        .expect("alpha")
        .into_luma8();
    let mean = mean_difference(&alpha, theirs.as_raw());
    let wrong = alpha
        .iter()
        .zip(theirs.as_raw())
        .filter(|(a, b)| (**a >= 128) != (**b >= 128))
        .count();
    println!(
        "mean absolute difference {mean:.4}, {wrong} of {} pixels on the other side",
        alpha.len()
    );
    assert!(mean <= 0.01, "{mean}");
}

/// What was marked stays what it was marked as, whatever the colours say.
#[test]
fn the_matte_keeps_to_the_scribbles() {
    let picture = picture();
    let scribbles = scribbles(picture.size);
    let alpha = outline::alpha(&picture, &scribbles).expect("alpha");
    for (alpha, mark) in alpha.iter().zip(&scribbles.marks) {
        match mark {
            Mark::Tree => assert_eq!(*alpha, 255),
            Mark::Background => assert_eq!(*alpha, 0),
            Mark::Undecided => {}
        }
    }
}

/// A large frame is solved smaller; strokes and matte must still lie where they were drawn.
#[test]
fn a_picture_that_comes_smaller_gives_nearly_the_same_matte() {
    let picture = picture();
    let scribbles = scribbles(picture.size);
    let full = outline::alpha(&picture, &scribbles).expect("alpha");
    let half = Size::new(picture.size.width / 2, picture.size.height / 2);
    let mut pixels = Vec::new();
    for v in 0..half.height {
        for u in 0..half.width {
            let four =
                [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(du, dv)| picture.at(2 * u + du, 2 * v + dv));
            pixels.extend(
                (0..3).map(|c| (four.iter().map(|p| u32::from(p[c])).sum::<u32>() / 4) as u8),
            );
        }
    }
    let small = outline::alpha(&Rgb { size: half, pixels }, &scribbles).expect("alpha");
    assert_eq!(small.len(), full.len());
    let differ = small
        .iter()
        .zip(&full)
        .filter(|(a, b)| a.abs_diff(**b) > 127)
        .count();
    assert!(
        differ as f64 <= 0.03 * full.len() as f64,
        "{differ} of {} pixels",
        full.len()
    );
}

fn luma(picture: &Rgb) -> Luma {
    let brightness = picture
        .pixels
        .chunks_exact(3)
        .map(|p| (77 * u32::from(p[0]) + 150 * u32::from(p[1]) + 29 * u32::from(p[2])) >> 8);
    Luma {
        size: picture.size,
        pixels: brightness.map(|y| y as u8).collect(),
    }
}

/// Corners with a wide border left out.
fn detect(outline: &Outline) -> Vec<Point2<f32>> {
    let settings = Detect {
        border_px: 20.0,
        ..Detect::default()
    };
    Detector::new(&settings, outline).detect(&luma(&picture()), &[], 400, &CameraMotion::default())
}

#[test]
fn no_point_is_looked_for_in_the_sky() {
    let outline = solved();
    let matte = outline.matte.as_ref().expect("a matte");
    let points = detect(&outline);
    assert!(points.len() >= 100, "{} points", points.len());
    for p in points {
        let (u, v) = (p.x.round() as usize, p.y.round() as usize);
        let rows = matte.chunks_exact(outline.size.width as usize);
        let mut around = rows.skip(v - 2).take(5).flat_map(|row| &row[u - 2..=u + 2]);
        assert!(around.any(|alpha| *alpha > 127), "{p:?} is in the sky");
    }
}

/// A crown without holes, 255 inside.
fn crown(size: Size) -> Vec<u8> {
    let mut mask = vec![0; size.area()];
    for row in mask
        .chunks_exact_mut(size.width as usize)
        .take(200)
        .skip(50)
    {
        row[60..200].fill(255);
    }
    mask
}

/// Whether a point is on the border of the crown.
fn on_border(p: &Point2<f32>) -> bool {
    p.x < 68.0 || p.x > 191.0 || p.y < 58.0 || p.y > 191.0
}

/// A window on the matte's border holds background that does not move with the tree (Zeng 2015
/// sect. 5.3.2).
#[test]
fn no_point_is_looked_for_on_the_border_of_a_wide_tree() {
    let outline = solved();
    let mask = crown(outline.size);
    let without_matte = Outline {
        matte: None,
        other_foot_px: None,
        ..outline.clone()
    };
    assert!(
        detect(&without_matte).iter().any(on_border),
        "there is something to reject"
    );
    let points = detect(&Outline {
        mask: mask.clone(),
        matte: Some(mask),
        other_foot_px: None,
        ..outline
    });
    assert!(points.len() >= 20, "{} points", points.len());
    assert!(!points.iter().any(on_border), "{points:?}");
}

/// The matte may hold a second piece, which the outline shown does not.
#[test]
fn no_point_is_looked_for_outside_the_outline_that_is_shown() {
    let outline = solved();
    let (mut left, mut two) = (crown(outline.size), crown(outline.size));
    let width = outline.size.width as usize;
    left.chunks_exact_mut(width)
        .for_each(|row| row[130..].fill(0));
    two.chunks_exact_mut(width)
        .for_each(|row| row[130..136].fill(0));
    let points = detect(&Outline {
        mask: left,
        matte: Some(two),
        other_foot_px: None,
        ..outline
    });
    assert!(points.len() >= 5, "{} points", points.len());
    assert!(points.iter().all(|p| p.x < 131.5), "{points:?}");
}

#[test]
fn a_picture_too_small_to_solve_is_an_error_and_no_panic() {
    for (width, height) in [(1, 1), (3, 9), (9, 3)] {
        let size = Size::new(width, height);
        let marks = (0..size.area())
            .map(|i| if i == 0 { Mark::Tree } else { Mark::Undecided })
            .collect();
        let scribbles = Scribbles {
            name: "s.png".into(),
            size,
            marks,
        };
        let picture = Rgb {
            size,
            pixels: vec![9; 3 * size.area()],
        };
        let message = outline::from_scribbles(&scribbles, &picture)
            .expect_err("too small")
            .to_string();
        assert!(message.contains("too small"), "{message}");
    }
}

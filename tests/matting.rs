//! Scribbles solved by closed-form matting, held to PyMatting's solution of the same
//! (scripts/matting-fixture.py).

use arborcam::config::Detect;
use arborcam::model::{Luma, Outline, Rgb, Size};
use arborcam::outline::{self, Given, Mark, Scribbles};
use arborcam::track::Detector;
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

#[test]
fn the_matte_is_that_of_pymatting() {
    let picture = picture();
    let alpha = outline::alpha(&picture, &scribbles(picture.size)).expect("alpha");
    let theirs = image::open("tests/matting/alpha.png")
        .expect("alpha")
        .into_luma8();
    let off = |(a, b): (&u8, &u8)| f64::from(a.abs_diff(*b)) / 255.0;
    let mean = alpha.iter().zip(theirs.as_raw()).map(off).sum::<f64>() / alpha.len() as f64;
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

/// A window on the matte's border holds background that does not move with the tree (Zeng section
/// 5.3.2).
#[test]
fn no_point_is_looked_for_in_the_sky_or_on_the_border_of_a_wide_tree() {
    let (picture, outline) = (picture(), solved());
    let grey = |p: &[u8]| {
        ((77 * u32::from(p[0]) + 150 * u32::from(p[1]) + 29 * u32::from(p[2])) >> 8) as u8
    };
    let luma = Luma {
        size: picture.size,
        pixels: picture.pixels.chunks_exact(3).map(grey).collect(),
    };
    let detect = |outline: &Outline| {
        Detector::new(
            &Detect {
                border_px: 20.0,
                ..Detect::default()
            },
            outline,
        )
        .detect(&luma, &[], 400)
    };
    let matte = outline.matte.clone().expect("a matte");
    let width = picture.size.width as i32;
    let near = |p: &[f32; 2], far: i32| {
        let (u, v) = (p[0].round() as i32, p[1].round() as i32);
        (-far..=far)
            .any(|dv| (-far..=far).any(|du| matte[((v + dv) * width + u + du) as usize] > 127))
    };
    let points = detect(&outline);
    assert!(points.len() >= 100, "{} points", points.len());
    assert!(points.iter().all(|p| near(p, 2)), "none in the sky");

    // A crown without holes: the border is kept off on all sides.
    let mut crown = vec![0; picture.size.area()];
    let inside = |i: usize| (60..200).contains(&(i % 320)) && (50..200).contains(&(i / 320));
    crown
        .iter_mut()
        .enumerate()
        .filter(|(i, _)| inside(*i))
        .for_each(|(_, m)| *m = 255);
    let on_border = |p: &[f32; 2]| p[0] < 68.0 || p[0] > 191.0 || p[1] < 58.0 || p[1] > 191.0;
    assert!(
        detect(&Outline {
            matte: None,
            ..outline.clone()
        })
        .iter()
        .any(on_border),
        "there is something to reject"
    );
    let points = detect(&Outline {
        mask: crown.clone(),
        matte: Some(crown.clone()),
        ..outline.clone()
    });
    assert!(points.len() >= 20, "{} points", points.len());
    assert!(!points.iter().any(on_border), "{points:?}");

    // The matte may hold a second piece, which the outline shown does not.
    let left_half: Vec<u8> = crown
        .iter()
        .enumerate()
        .map(|(i, m)| if i % 320 < 130 { *m } else { 0 })
        .collect();
    let two = crown
        .iter()
        .enumerate()
        .map(|(i, m)| {
            if (130..136).contains(&(i % 320)) {
                0
            } else {
                *m
            }
        })
        .collect();
    let points = detect(&Outline {
        mask: left_half,
        matte: Some(two),
        ..outline
    });
    assert!(points.len() >= 5, "{} points", points.len());
    assert!(
        points.iter().all(|p| p[0] < 131.5),
        "none outside the outline that is shown: {points:?}"
    );
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

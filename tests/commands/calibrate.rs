//! `arborcam calibrate`: a known lens is found again in made pictures of a chessboard.

use crate::chance::Chance;
use arborcam::import::read_lens_profile;
use arborcam::model::{Distortion, Lens, PixelFormat, RawFrame, Size, seconds};
use arborcam::recording::{Head, Limits, Series};
use image::GrayImage;
use nalgebra::{Point2, Point3, Rotation3, Vector2, Vector3};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const COLUMNS: i32 = 9;
const ROWS: i32 = 7;
const SIZE: Size = Size {
    width: 640,
    height: 480,
};

fn arborcam(pictures: &Path, out: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command.args(["calibrate", "--squares", &format!("{COLUMNS}x{ROWS}")]);
    command.arg(pictures).arg("--out").arg(out);
    command.output().expect("arborcam")
}

fn lens() -> Lens {
    Lens {
        size: SIZE,
        focal_px: Vector2::new(610.0, 607.0),
        middle_px: Point2::new(327.0, 233.0),
        distortion: Distortion::RadialTangential([-0.23, 0.07, 0.0008, -0.0006, 0.0]),
        readout_s: 0.0,
    }
}

/// Where a pinhole would show each corner of the pixels, by rays (x, y, 1).
fn rays(lens: &Lens) -> Vec<Vector2<f64>> {
    let mut rays = Vec::new();
    for y in 0..=SIZE.height {
        for x in 0..=SIZE.width {
            let at = lens.undistorted(Point2::new(f64::from(x) - 0.5, f64::from(y) - 0.5));
            rays.push((at - lens.middle_px).component_div(&lens.focal_px));
        }
    }
    rays
}

/// A board before the camera: its turn, and where its middle is, in squares.
struct Placed {
    turn: Rotation3<f64>,
    middle: Vector3<f64>,
}

impl Placed {
    fn by(chance: &mut Chance) -> Self {
        let tilt = |chance: &mut Chance| chance.between(-0.6, 0.6);
        let turn = Vector3::new(tilt(chance), tilt(chance), chance.between(-0.4, 0.4));
        let away = chance.between(13.0, 20.0);
        let aside = Vector2::new(chance.between(-0.18, 0.18), chance.between(-0.12, 0.12)) * away;
        Self {
            turn: Rotation3::new(turn),
            middle: Vector3::new(aside.x, aside.y, away),
        }
    }

    /// Brightness along a ray: squares, a white rim of one square, and grey behind.
    fn brightness(&self, ray: &Vector2<f64>) -> f64 {
        let normal = self.turn * Vector3::z();
        let ray = Vector3::new(ray.x, ray.y, 1.0);
        let at = ray * (normal.dot(&self.middle) / normal.dot(&ray));
        let on_board = self.turn.inverse() * Point3::from(at - self.middle);
        let column = (on_board.x + 0.5 * f64::from(COLUMNS)).floor() as i32;
        let row = (on_board.y + 0.5 * f64::from(ROWS)).floor() as i32;
        if (0..COLUMNS).contains(&column) && (0..ROWS).contains(&row) {
            return if (column + row) % 2 == 0 { 30.0 } else { 215.0 };
        }
        let is_rim = (-1..=COLUMNS).contains(&column) && (-1..=ROWS).contains(&row);
        if is_rim { 215.0 } else { 120.0 }
    }

    fn picture(&self, rays: &[Vector2<f64>], chance: &mut Chance) -> GrayImage {
        const PARTS: usize = 4;
        let stride = SIZE.width as usize + 1;
        GrayImage::from_fn(SIZE.width, SIZE.height, |x, y| {
            let first = y as usize * stride + x as usize;
            let corners = [0, 1, stride, stride + 1].map(|k| rays[first + k]);
            let mut sum = 0.0;
            for k in 0..PARTS * PARTS {
                let [u, v] = [k % PARTS, k / PARTS].map(|n| (n as f64 + 0.5) / PARTS as f64);
                let [top, bottom] = [0, 2].map(|k| corners[k].lerp(&corners[k + 1], u));
                sum += self.brightness(&top.lerp(&bottom, v));
            }
            let noise = 3.0 * chance.normal();
            image::Luma([(sum / (PARTS * PARTS) as f64 + noise).clamp(0.0, 255.0) as u8])
        })
    }
}

fn write_pictures(dir: &Path, views: &[Placed], chance: &mut Chance) {
    fs::create_dir_all(dir).expect("folder");
    let rays = rays(&lens());
    for (k, view) in views.iter().enumerate() {
        let picture = view.picture(&rays, chance);
        picture
            .save(dir.join(format!("{k:02}.png")))
            .expect("picture");
    }
}

#[test]
fn a_known_lens_is_found_again() {
    let dir = tempfile::tempdir().expect("tempdir");
    let [pictures, out] = ["pictures", "lens.json"].map(|name| dir.path().join(name));
    let chance = &mut Chance::new(22);
    let views: Vec<Placed> = (0..16).map(|_| Placed::by(chance)).collect();
    write_pictures(&pictures, &views, chance);
    let output = arborcam(&pictures, &out);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    assert!(said.contains("of 16; corners are off by 0."), "{said}");
    let bytes = fs::read(&out).expect("profile");
    let found = read_lens_profile(&bytes).expect("a lens");
    let truth = lens();
    let text: serde_json::Value = serde_json::from_slice(&bytes).expect("JSON");
    let sd = |name: &str, axis: usize| {
        text["standard_deviations"][name][axis]
            .as_f64()
            .expect("a number")
    };
    for axis in 0..2 {
        let focal = found.focal_px[axis] - truth.focal_px[axis];
        let middle = found.middle_px[axis] - truth.middle_px[axis];
        assert!(
            focal.abs() < 4.0 * sd("focal_px", axis),
            "{focal} px: {said}"
        );
        assert!(
            middle.abs() < 4.0 * sd("middle_px", axis),
            "{middle} px: {said}"
        );
        assert!(focal.abs() < 0.005 * truth.focal_px[axis], "{focal} px");
    }
    // The two lenses put a place near the corner where the other does.
    for at in [Point2::new(60.0, 50.0), Point2::new(580.0, 430.0)] {
        let off = found.undistorted(at) - truth.undistorted(at);
        assert!(off.norm() < 1.5, "{at}: {off}");
    }
    let again = arborcam(&pictures, &out);
    assert_eq!(again.status.code(), Some(1));
}

#[test]
fn views_that_say_too_little_get_one_line() {
    let dir = tempfile::tempdir().expect("tempdir");
    let chance = &mut Chance::new(5);
    // The board is moved, and never turned.
    let mut level = Vec::new();
    for k in 0..8 {
        let aside = f64::from(k) - 3.5;
        level.push(Placed {
            turn: Rotation3::identity(),
            middle: Vector3::new(aside, -0.5 * aside, 16.0),
        });
    }
    let few: Vec<Placed> = (0..3).map(|_| Placed::by(chance)).collect();
    for (name, views, what) in [
        ("level", &level, "alike"),
        ("few", &few, "differ, where 5 are needed"),
    ] {
        let [pictures, out] = [name.to_owned(), format!("{name}.json")].map(|n| dir.path().join(n));
        write_pictures(&pictures, views, chance);
        let output = arborcam(&pictures, &out);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{name}: {said}");
        assert!(
            said.contains(what) && said.lines().count() == 1,
            "{name}: {said}"
        );
        assert!(!out.exists(), "{name}");
    }
    let output = arborcam(&dir.path().join("absent"), &dir.path().join("absent.json"));
    assert_eq!(output.status.code(), Some(3));
}

/// A lens is for pictures of one size.
#[test]
fn pictures_of_several_sizes_are_refused() {
    let dir = tempfile::tempdir().expect("tempdir");
    let sizes = [SIZE, SIZE, Size::new(320, 240)];
    let [folder, film, out] = ["pictures", "film.mcap", "lens.json"].map(|n| dir.path().join(n));
    fs::create_dir(&folder).expect("folder");
    let mut series = Series::create(&film, Head::default(), Limits::default(), || 0).expect("film");
    for (k, size) in (0..).zip(sizes) {
        let picture = GrayImage::new(size.width, size.height);
        picture
            .save(folder.join(format!("{k}.png")))
            .expect("picture");
        let frame = RawFrame {
            sequence: Some(k),
            sensor_time_s: seconds(k as i64 * 1_000_000_000),
            size,
            format: PixelFormat::Grey,
            bytes: picture.into_raw(),
            depth: None,
        };
        series.frame(&frame, k).expect("frame");
    }
    series.close().expect("closed");
    for input in [&folder, &film] {
        let output = arborcam(input, &out);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(3), "{said}");
        let names = [
            "320x240",
            "640x480",
            "one size",
            &input.display().to_string(),
        ];
        assert!(names.iter().all(|n| said.contains(n)), "{said}");
        assert!(said.lines().count() == 1 && !out.exists(), "{said}");
    }
}

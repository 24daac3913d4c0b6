//! Films with depth through the whole program: what is found in space, what stays as it is without
//! depth, and what bad input gets.

use crate::support::recording;
use arborcam::model::PixelFormat;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};
use tempfile::TempDir;

const OUTLINE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/recordings/sparse_winter.outline.json"
);
const DONE: i32 = 0;
const BAD_USAGE: i32 = 2;
const NO_INPUT: i32 = 3;
/// Frames of the clip that are used: enough for a tree.
const FRAMES: usize = 150;
const FPS: f64 = 30.0;
/// Metres for each count.
const UNIT_M: f64 = 0.001;
const FOCAL_PX: f64 = 600.0;
/// A tree is built early, and not refined.
const EARLY: &str = "[accumulate]\nmin_s = 2.0\nthreshold = 0.1\nrefine_s = 0.0\n";

/// A folder of colour and depth images, made of the shipped clip.
struct Film {
    dir: TempDir,
}

impl Film {
    /// `depth` gives the counts of a pixel; `None` for a film without depth.
    fn new(depth: Option<fn(u32, u32) -> u16>) -> Self {
        let film = Self {
            dir: tempfile::tempdir().expect("tempdir"),
        };
        fs::create_dir(film.path("rgb")).expect("folder");
        fs::create_dir(film.path("depth")).expect("folder");
        fs::write(film.path("config.toml"), EARLY).expect("config");
        let (mut colours, mut depths) = (String::new(), String::from("# depth images\n"));
        let mut png = Vec::new();
        for (k, frame) in recording().iter().take(FRAMES).enumerate() {
            assert_eq!(frame.format, PixelFormat::Mjpeg);
            let time_s = 1000.0 + k as f64 / FPS;
            fs::write(film.path(&format!("rgb/{k}.jpg")), &frame.bytes).expect("picture");
            colours += &format!("{time_s:.6} rgb/{k}.jpg\n");
            if let Some(depth) = depth {
                let size = frame.size;
                if png.is_empty() {
                    png = depth_png(size.width, size.height, depth);
                }
                fs::write(film.path(&format!("depth/{k}.png")), &png).expect("depth");
                depths += &format!("{:.6} depth/{k}.png\n", time_s + 0.004);
            }
        }
        fs::write(film.path("rgb.txt"), colours).expect("list");
        if depth.is_some() {
            fs::write(film.path("depth.txt"), depths).expect("list");
            film.write_camera("camera.json");
        }
        film
    }

    fn write_camera(&self, name: &str) {
        let (size, unit) = (recording()[0].size, UNIT_M);
        let (cx, cy) = (f64::from(size.width) / 2.0, f64::from(size.height) / 2.0);
        let text = format!(
            r#"{{"fx": {FOCAL_PX}, "fy": {FOCAL_PX}, "cx": {cx}, "cy": {cy}, "depth_unit_m": {unit}}}"#
        );
        fs::write(self.path(name), text).expect("camera");
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn arborcam(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_arborcam"))
            .args(arguments)
            .current_dir(self.dir.path())
            .output()
            .expect("arborcam")
    }

    /// Replays `input` to the capture `out`.
    fn replay(&self, input: &str, out: &str, more: &[&str]) -> Output {
        let usual = [
            "replay",
            input,
            "--fast",
            "--headless",
            "--outline",
            OUTLINE,
            "--config",
            "config.toml",
            "--out",
            out,
        ];
        self.arborcam(&[&usual, more].concat())
    }

    fn read(&self, capture: &str, name: &str) -> Vec<u8> {
        fs::read(self.path(capture).join(name)).unwrap_or_else(|e| panic!("{capture}/{name}: {e}"))
    }

    fn note(&self, capture: &str) -> serde_json::Value {
        serde_json::from_slice(&self.read(capture, "capture.json")).expect("capture.json")
    }

    fn table(&self, capture: &str, name: &str) -> Vec<Vec<String>> {
        let text = String::from_utf8(self.read(capture, name)).expect("text");
        let cells = |line: &str| line.split(',').map(str::to_owned).collect();
        text.lines().map(cells).collect()
    }
}

fn depth_png(width: u32, height: u32, depth: fn(u32, u32) -> u16) -> Vec<u8> {
    let image = image::ImageBuffer::from_fn(width, height, |u, v| image::Luma([depth(u, v)]));
    let mut png = Vec::new();
    image::DynamicImage::ImageLuma16(image)
        .write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png)
        .expect("written");
    png
}

fn holes(_: u32, _: u32) -> u16 {
    0
}

/// The tree comes nearer by 1.5 mm with every pixel to the right.
fn aslant(u: u32, _: u32) -> u16 {
    4000 - (u * 3 / 2) as u16
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn is_done(output: &Output) {
    assert_eq!(output.status.code(), Some(DONE), "{}", said(output));
}

#[test]
fn where_depth_is_not_known_everything_stays_as_it_is() {
    let film = Film::new(Some(holes));
    is_done(&film.replay(".", "holes", &[]));
    is_done(&film.replay(".", "none", &["--no-depth"]));
    for name in [
        "nodes.csv",
        "motion.csv",
        "camera.csv",
        "modes.csv",
        "tree.glb",
    ] {
        assert_eq!(film.read("holes", name), film.read("none", name), "{name}");
    }
    let (holes, none) = (
        film.table("holes", "tracks.csv"),
        film.table("none", "tracks.csv"),
    );
    assert_eq!(holes[0][6..], ["depth_m", "depth_sd_m"]);
    assert_eq!(holes.len(), none.len());
    for (with, without) in holes.iter().zip(&none).skip(1) {
        assert_eq!(with[..6], without[..]);
        assert_eq!(with[6..], ["", ""]);
    }
    assert!(film.note("holes")["depth"].is_null());
}

#[test]
fn depth_puts_the_tree_into_space_in_metres_and_a_recording_keeps_it() {
    let film = Film::new(Some(aslant));
    let first = film.replay(".", "out", &["--record", "film.mcap"]);
    is_done(&first);
    let note = film.note("out");
    let depth = &note["depth"];
    let (foot_m, scale) = (depth["foot_m"].as_f64(), depth["metres_per_px"].as_f64());
    let (foot_m, scale) = (foot_m.expect("a foot"), scale.expect("a scale"));
    assert!((scale - foot_m / FOCAL_PX).abs() < 1e-9);
    assert_eq!(
        note["config"]["export"]["metres_per_px"].as_f64(),
        Some(scale)
    );
    let nodes = film.table("out", "nodes.csv");
    let column = |name: &str| nodes[0].iter().position(|c| c == name).expect("column");
    let [kind, u, z] = ["kind", "u_px", "z"].map(column);
    let foot_u: f64 = nodes[1][u].parse().expect("a number");
    assert!((foot_m - (4.0 - 0.0015 * foot_u)).abs() < 0.02, "{foot_m}");
    let mut off_m: Vec<f64> = Vec::new();
    for node in nodes.iter().skip(2).filter(|node| node[kind] == "measured") {
        let [u, z] = [u, z].map(|k| node[k].parse::<f64>().expect("a number"));
        off_m.push((z - 0.0015 * (u - foot_u)).abs());
    }
    off_m.sort_by(f64::total_cmp);
    assert!(off_m.len() > 3, "{nodes:?}");
    // Half a pixel is 3 mm here.
    assert!(off_m[off_m.len() / 2] < 0.02, "{off_m:?}");
    // The frames with their depth once more, out of the recording.
    is_done(&film.replay("film.mcap", "again", &[]));
    // tree.glb names its source.
    for name in ["nodes.csv", "motion.csv", "tracks.csv"] {
        assert_eq!(film.read("out", name), film.read("again", name), "{name}");
    }
}

#[test]
fn what_is_missing_is_said_in_one_line() {
    let film = Film::new(Some(aslant));
    let refused = |arguments: &[&str], status: i32, what: &str| {
        let output = film.replay(".", "out", arguments);
        let said = said(&output);
        assert_eq!(output.status.code(), Some(status), "{said}");
        assert!(said.contains(what), "{what}: {said}");
        // What is wrong with an option is followed by where to read of it.
        let lines = said.trim().lines().count();
        assert!(lines == 1 || status == BAD_USAGE, "{said}");
        assert!(!film.path("out").exists());
    };
    refused(&["--depth-unit", "5000"], BAD_USAGE, "metres of one count");
    refused(&["--depth-camera", "rgb.txt"], BAD_USAGE, "it is no camera");
    refused(&["--depth-late", "0.3"], BAD_USAGE, "give seconds, -0.25");
    let sound = fs::read_to_string(film.path("camera.json")).expect("camera");
    let lost_digit = sound.replace(&format!(r#""fy": {FOCAL_PX}"#), r#""fy": 6.5"#);
    assert_ne!(lost_digit, sound);
    fs::write(film.path("camera.json"), lost_digit).expect("camera");
    refused(
        &[],
        NO_INPUT,
        "its camera cannot be one: its focal lengths are",
    );
    fs::write(film.path("camera.json"), sound).expect("camera");
    fs::rename(film.path("camera.json"), film.path("mine.json")).expect("renamed");
    refused(&[], NO_INPUT, "put a camera.json");
    is_done(&film.replay(".", "given", &["--depth-camera", "mine.json"]));
    film.write_camera("camera.json");
    let depths = fs::read_to_string(film.path("depth.txt")).expect("list");
    let late: String = depths.replace("\n1", "\n2");
    fs::write(film.path("depth.txt"), late).expect("list");
    refused(&[], NO_INPUT, "the clocks of colour and depth do not meet");
    // Stamps that are late can be set right: the first frames have depth then.
    let listed: Vec<(f64, &str)> = depths
        .lines()
        .skip(1)
        .filter_map(|line| line.split_once(' '))
        .map(|(time, file)| (time.parse().expect("a time"), file))
        .collect();
    let late: String = listed
        .iter()
        .map(|(time_s, file)| format!("{:.6} {file}\n", time_s + 0.2))
        .collect();
    fs::write(film.path("depth.txt"), late).expect("list");
    is_done(&film.replay(".", "late", &[]));
    is_done(&film.replay(".", "right", &["--depth-late", "0.2"]));
    let depth_of_first = |capture: &str| film.table(capture, "tracks.csv")[1][6].clone();
    assert_eq!(depth_of_first("late"), "");
    assert_ne!(depth_of_first("right"), "");
    fs::write(film.path("depth.txt"), "12 a b\nx\n").expect("list");
    refused(&[], NO_INPUT, "line 2 is not a time");
    // A stream that stops is used as far as it goes.
    let some: Vec<&str> = depths.lines().take(FRAMES / 3).collect();
    fs::write(film.path("depth.txt"), some.join("\n")).expect("list");
    let stops = film.replay(".", "stops", &[]);
    is_done(&stops);
    assert!(
        said(&stops).contains("depth stops after 1.6 of 5.0 s"),
        "{}",
        said(&stops)
    );
    fs::write(film.path("depth/0.png"), "no picture").expect("written");
    refused(&[], NO_INPUT, "it is no readable PNG");
    fs::remove_file(film.path("depth/0.png")).expect("removed");
    let missing = "depth/0.png cannot be used: there is no such file; put a sound one there, take its line out of \
                   depth.txt, or give --no-depth";
    refused(&[], NO_INPUT, missing);
    // Without a list of them there is no depth, which is said.
    fs::remove_file(film.path("depth.txt")).expect("removed");
    let colours = film.replay(".", "colours", &["--depth-unit", "0.001"]);
    is_done(&colours);
    let said = said(&colours);
    assert!(
        said.contains("there is no depth.txt beside rgb.txt"),
        "{said}"
    );
    assert!(said.contains("--depth-unit changes nothing here"), "{said}");
}

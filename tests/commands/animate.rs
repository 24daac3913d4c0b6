//! `arborcam animate`: what a user gets from a capture, and what bad input gets.

use crate::support::replayed;
use arborcam::document::Document;
use nalgebra::{Point2, distance};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use tempfile::TempDir;

const FAILED: i32 = 1;
const BAD_USAGE: i32 = 2;
const NO_INPUT: i32 = 3;

fn animate(dir: &Path, out: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command
        .arg("animate")
        .arg(dir)
        .arg("--out")
        .arg(out)
        .args(more)
        .output()
        .expect("arborcam")
}

/// The shipped recording's capture with a frequency on every second branch, as a longer film would
/// have it.
fn tuned() -> &'static Path {
    static MADE: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let (_, out) = MADE.get_or_init(|| {
        let dir = tempfile::tempdir().expect("tempdir");
        let out = dir.path().join("tuned");
        fs::create_dir(&out).expect("folder");
        for entry in fs::read_dir(replayed()).expect("folder").flatten() {
            fs::copy(entry.path(), out.join(entry.file_name())).expect("copy");
        }
        let text = fs::read_to_string(out.join("nodes.csv")).expect("nodes");
        let row = |(k, line): (usize, &str)| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if k > 0 && k % 2 == 0 && !cells[3].starts_with('0') {
                let hz = 0.7 * 1.3_f64.powi(cells[2].parse::<i32>().expect("level") - 1);
                let values =
                    [hz, 0.99 * hz, 1.01 * hz, 0.05, 0.04, 0.06].map(|x| format!("{x:.4}"));
                cells[10..16].clone_from_slice(&values);
                cells[16] = "true".into();
                cells[17] = "release".into();
            }
            cells.join(",")
        };
        let rows: Vec<String> = text.lines().enumerate().map(row).collect();
        fs::write(out.join("nodes.csv"), rows.join("\n") + "\n").expect("nodes");
        (dir, out)
    });
    out
}

fn animated(name: &str, more: &[&str]) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join(name);
    let output = animate(tuned(), &out, more);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{more:?}: {told}");
    assert!(!told.contains("warning"), "{more:?}: {told}");
    assert!(output.stdout.is_empty(), "standard output is for data");
    (dir, out)
}

/// Place in the picture of every node in every frame.
fn table(path: &Path) -> BTreeMap<u64, Vec<Point2<f64>>> {
    let text = fs::read_to_string(path).expect("table");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("frame,time_s,node_id,x,y,z,u_px,v_px"));
    let mut out: BTreeMap<u64, Vec<Point2<f64>>> = BTreeMap::new();
    for line in lines {
        let cells: Vec<f64> = line
            .split(',')
            .map(|c| c.parse().expect("number"))
            .collect();
        out.entry(cells[0] as u64)
            .or_default()
            .push(Point2::new(cells[6], cells[7]));
    }
    out
}

fn apart_px(a: &[Point2<f64>], b: &[Point2<f64>]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| distance(a, b))
        .fold(0.0, f64::max)
}

#[test]
fn a_height_gives_a_moving_tree_metres() {
    let more = ["--seconds", "1", "--wind", "5", "--height", "7.5"];
    let (_dir, out) = animated("tree.glb", &more);
    let model = gltf::Gltf::open(&out).expect("a valid file");
    let notes = model.as_json().asset.extras.as_ref().expect("notes").get();
    let notes: serde_json::Value = serde_json::from_str(notes).expect("json");
    let scale = (&notes["unit"], &notes["scale"]);
    assert_eq!(scale, (&"m".into(), &"height".into()));
}

#[test]
fn the_table_is_as_long_as_asked_and_the_loops_ends_meet() {
    let (_dir, out) = animated(
        "loop.csv",
        &["--seconds", "4", "--fps", "25", "--wind", "7", "--loop"],
    );
    let frames = table(&out);
    assert_eq!(frames.len(), 101);
    let nodes = Document::read(replayed(), 0.0)
        .expect("capture")
        .skeleton
        .nodes
        .len();
    assert!(frames.values().all(|f| f.len() == nodes));
    let seam = apart_px(&frames[&0], &frames[&100]);
    let moved = (1..100)
        .map(|k| apart_px(&frames[&0], &frames[&k]))
        .fold(0.0, f64::max);
    assert!(
        seam < 0.1 && moved > 5.0,
        "the ends are {seam} px apart, in between {moved}"
    );
}

/// The model is played by other programs: its bones, keys and leaves are what the table says.
#[test]
fn the_model_holds_the_motion_and_its_loop_closes() {
    let (_dir, out) = animated(
        "tree.glb",
        &[
            "--seconds",
            "4",
            "--wind",
            "6",
            "--loop",
            "--leaves",
            "on",
            "--leaf-swing",
            "--planes",
            "3",
        ],
    );
    let (document, buffers, _) = gltf::import(&out).expect("a model");
    let animation = document.animations().next().expect("an animation");
    let (mut channels, mut swings) = (0, 0);
    for channel in animation.channels() {
        let reader = channel.reader(|b| Some(&buffers[b.index()]));
        let times: Vec<f32> = reader.read_inputs().expect("times").collect();
        assert!(
            times[0] == 0.0 && times.iter().all(|t| *t <= 4.001),
            "{times:?}"
        );
        match reader.read_outputs().expect("values") {
            gltf::animation::util::ReadOutputs::Rotations(turns) => {
                let turns: Vec<[f32; 4]> = turns.into_f32().collect();
                let (a, b) = (turns[0], turns[turns.len() - 1]);
                let same = (0..4).map(|i| a[i] * b[i]).sum::<f32>().abs();
                assert!(same > 0.999_99, "a bone begins at {a:?} and ends at {b:?}");
                channels += 1;
            }
            gltf::animation::util::ReadOutputs::MorphTargetWeights(weights) => {
                let weights: Vec<f32> = weights.into_f32().collect();
                let n = weights.len();
                assert!(
                    (weights[0] - weights[n - 2]).abs() < 0.01
                        && (weights[1] - weights[n - 1]).abs() < 0.01
                );
                swings += usize::from(weights.iter().any(|w| w.abs() > 0.005));
            }
            _ => panic!("bones turn and leaves swing, nothing else"),
        }
    }
    assert!(
        channels > 30 && swings > 3,
        "{channels} bones turn, {swings} groups of leaves swing"
    );
    let text = fs::read(&out).expect("file");
    assert!(
        text.windows(10).any(|w| w == b"\"animated\""),
        "the file does not say that its motion was made"
    );
}

#[test]
fn the_same_seed_gives_the_same_file_and_wind_or_rope_another() {
    let short = |more: &[&str]| {
        let (_dir, out) = animated("a.csv", &[&["--seconds", "1"], more].concat());
        fs::read(out).expect("file")
    };
    let first = short(&["--wind", "5", "--seed", "4"]);
    assert!(
        first == short(&["--wind", "5", "--seed", "4"]),
        "not the same twice"
    );
    assert!(first != short(&["--wind", "5", "--seed", "5"]));
    assert!(first != short(&["--wind", "5", "--seed", "4", "--direction", "90"]));
    assert!(first != short(&["--pull", "8"]));
    assert!(first != short(&["--magnify", "2"]));
    assert!(first != short(&["--magnify", "2", "--band", "0.5..1.5", "--speed", "0.5"]));
}

#[test]
fn every_kind_of_file_is_written() {
    for (name, more) in [
        ("tree.gltf", &["--wind", "3"][..]),
        ("tree.html", &["--magnify", "3", "--loop"]),
        ("still.png", &["--wind", "0", "--size", "160x120"]),
        (
            "film.mp4",
            &["--wind", "8", "--size", "160x120", "--fps", "10"],
        ),
    ] {
        if name.ends_with("html") && arborcam::export::html::built_in().is_err() {
            println!("skipped: built without the viewer");
            continue;
        }
        let (_dir, out) = animated(name, &[&["--seconds", "1"], more].concat());
        assert!(fs::metadata(&out).expect(name).len() > 500, "{name}");
    }
}

/// In still air the picture is the tree at rest; in a gale it is not.
#[test]
fn a_picture_shows_the_tree_bent() {
    let picture = |force: &str| {
        let (_dir, out) = animated(
            "a.png",
            &["--seconds", "1", "--wind", force, "--size", "320x240"],
        );
        image::open(out).expect("picture").into_rgb8()
    };
    let (still, gale) = (picture("0"), picture("9"));
    assert!(dark_pixels(&still) > 300);
    let differ = still
        .pixels()
        .zip(gale.pixels())
        .filter(|(a, b)| a != b)
        .count();
    assert!(
        differ > 1000,
        "{differ} pixels differ between still air and a gale"
    );
}

fn dark_pixels(picture: &image::RgbImage) -> usize {
    picture.pixels().filter(|c| c[0] < 128).count()
}

#[test]
fn a_capture_without_frequencies_moves_and_says_what_stands_in_for_them() {
    let dir = tempfile::tempdir().expect("tempdir");
    let bare = dir.path().join("bare");
    fs::create_dir(&bare).expect("folder");
    for entry in fs::read_dir(replayed()).expect("folder").flatten() {
        fs::copy(entry.path(), bare.join(entry.file_name())).expect("copy");
    }
    let text = fs::read_to_string(bare.join("nodes.csv")).expect("nodes");
    let row = |(k, line): (usize, &str)| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if k > 0 {
            cells[10..16].fill("");
            cells[16] = "false";
        }
        cells.join(",")
    };
    let rows: Vec<String> = text.lines().enumerate().map(row).collect();
    fs::write(bare.join("nodes.csv"), rows.join("\n") + "\n").expect("nodes");
    let out = dir.path().join("a.csv");
    let output = animate(&bare, &out, &["--seconds", "1", "--wind", "6"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && told.contains("wind.trunk_hz"),
        "{told}"
    );
    let frames = table(&out);
    assert!(apart_px(&frames[&0], &frames[&30]) > 1.0);
}

#[test]
fn bad_input_gets_one_line_and_its_exit_status() {
    let dir = tempfile::tempdir().expect("tempdir");
    let write = |name: &str, bytes: &[u8]| {
        let path = dir.path().join(name);
        fs::write(&path, bytes).expect("file");
        path.display().to_string()
    };
    let none = write("none.wav", &wav(&[]));
    let silent = write("silent.wav", &wav(&[7; 400]));
    let text = write("text.wav", b"this is no sound");
    let taken = write("taken.csv", b"mine");
    let cases: &[(&str, &[&str], i32, &str)] = &[
        ("a.xyz", &[], BAD_USAGE, ".glb"),
        ("a", &[], BAD_USAGE, ".glb"),
        ("taken.csv", &[], FAILED, "exists already"),
        ("a.csv", &["--wind", "13"], BAD_USAGE, "--wind <FORCE>"),
        ("a.csv", &["--wind", "nan"], BAD_USAGE, "--wind <FORCE>"),
        ("a.csv", &["--beta", "-1"], BAD_USAGE, "beta"),
        ("a.csv", &["--seconds", "0"], BAD_USAGE, "seconds"),
        ("a.csv", &["--seconds", "601"], BAD_USAGE, "600"),
        ("a.csv", &["--fps", "0"], BAD_USAGE, "fps"),
        (
            "a.csv",
            &["--fps", "100", "--seconds", "500"],
            BAD_USAGE,
            "20000",
        ),
        ("a.csv", &["--pull", "90"], BAD_USAGE, "0.1 to 60"),
        ("a.csv", &["--pull", "5", "--loop"], BAD_USAGE, "--loop"),
        (
            "a.csv",
            &["--pull", "5", "--pull-node", "4000"],
            BAD_USAGE,
            "nodes.csv",
        ),
        ("a.csv", &["--pull-node", "4"], BAD_USAGE, "--pull"),
        (
            "a.csv",
            &["--magnify", "2", "--wind", "3"],
            BAD_USAGE,
            "--wind",
        ),
        ("a.csv", &["--magnify", "nan"], BAD_USAGE, "0 to 100"),
        (
            "a.csv",
            &["--magnify", "2", "--band", "3..1"],
            BAD_USAGE,
            "0.5..2",
        ),
        (
            "a.csv",
            &["--magnify", "2", "--band", "40..50"],
            FAILED,
            "lower --band",
        ),
        (
            "a.csv",
            &["--magnify", "2", "--seconds", "60", "--loop"],
            FAILED,
            "--seconds",
        ),
        ("a.csv", &["--band", "1..2"], BAD_USAGE, "--magnify"),
        ("a.csv", &["--wav", &none], BAD_USAGE, "no samples"),
        ("a.csv", &["--wav", &silent], BAD_USAGE, "silent"),
        ("a.csv", &["--wav", &text], BAD_USAGE, "no WAV"),
        (
            "a.csv",
            &["--wav", "not-there.wav"],
            BAD_USAGE,
            "not-there.wav",
        ),
        (
            "a.mp4",
            &["--background", "transparent"],
            BAD_USAGE,
            "transparent",
        ),
    ];
    for (name, more, status, needle) in cases {
        let output = animate(tuned(), &dir.path().join(name), more);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(
            output.status.code(),
            Some(*status),
            "{name} {more:?}: {told}"
        );
        assert!(told.contains(needle), "{name} {more:?}: {told}");
        let usage = told.contains("For more information");
        assert!(
            usage || told.lines().count() == 1,
            "{name} {more:?}: {told}"
        );
        assert!(
            told.starts_with("arborcam: ") && output.stdout.is_empty(),
            "{told}"
        );
    }
    assert_eq!(fs::read(taken).expect("file"), b"mine");
    assert_eq!(
        fs::read_dir(dir.path()).expect("folder").count(),
        4,
        "something was left behind"
    );
    let output = animate(dir.path(), &dir.path().join("a.csv"), &[]);
    assert_eq!(output.status.code(), Some(NO_INPUT));
    // Without --out the tree moves on a terminal, and here is none.
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    let output = command
        .arg("animate")
        .arg(tuned())
        .output()
        .expect("arborcam");
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(BAD_USAGE), "{told}");
    assert!(told.contains("--out"), "{told}");
}

fn wav(samples: &[i16]) -> Vec<u8> {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 8000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = hound::WavWriter::new(&mut bytes, spec).expect("header");
    samples
        .iter()
        .for_each(|s| writer.write_sample(*s).expect("sample"));
    writer.finalize().expect("end");
    bytes.into_inner()
}

#[test]
fn a_sound_drives_the_tree() {
    let dir = tempfile::tempdir().expect("tempdir");
    let tone = |k: i32| {
        if (k / 8000) % 2 == 0 {
            (9000.0 * (0.3 * f64::from(k)).sin()) as i16
        } else {
            0
        }
    };
    let path = dir.path().join("wind.wav");
    fs::write(&path, wav(&(0..48_000).map(tone).collect::<Vec<_>>())).expect("file");
    let path = path.display().to_string();
    let (_dir, out) = animated("a.csv", &["--seconds", "4", "--wind", "7", "--wav", &path]);
    let (frames, rest) = (
        table(&out),
        Document::read(replayed(), 0.0).expect("capture").skeleton,
    );
    let rest: Vec<Point2<f64>> = rest
        .nodes
        .iter()
        .map(|n| rest.image_from_model(&n.position))
        .collect();
    let far = |from: u64| {
        (from..from + 8)
            .map(|k| apart_px(&frames[&k], &rest))
            .fold(0.0, f64::max)
    };
    assert!(far(0) > 5.0 && far(22) > 5.0, "it does not move");
    let (_dir, out) = animated(
        "b.csv",
        &["--seconds", "4", "--wind", "7", "--wav", &path, "--loop"],
    );
    let looped = table(&out);
    assert!(apart_px(&looped[&0], &looped[&120]) < 0.1);
}

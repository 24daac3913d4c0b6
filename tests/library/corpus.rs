//! The fuzzers' seeds and some hundred seeded mutations of them, on stable: no panic, and an end.
//! `fuzz/` goes further.

use crate::chance::Chance;
use crate::ros;
use arborcam::cloud::{CloudOptions, tree_of_cloud};
use arborcam::config::Config;
use arborcam::import::{
    CloudFormat, StandingModel, joined, read_cloud, read_lens_profile, read_model, read_sketch,
};
use arborcam::model::{PixelFormat, RawFrame, Size};
use arborcam::recording::{Head, Limits, Reader, Series};
use arborcam::source::{self, CameraFile, kinect_rig};
use std::fs;
use std::io::Cursor;
use std::path::Path;

/// Mutations of each seed.
const TRIES: u64 = 200;

/// What befalls files: flipped bits, lengths that lie, pieces cut out, repeated, or the end
/// missing.
fn mutated(seed: &[u8], number: u64) -> Vec<u8> {
    let mut chance = Chance::new(number);
    let mut bytes = seed.to_vec();
    for _ in 0..=chance.below(4) {
        if bytes.is_empty() {
            break;
        }
        let at = chance.below(bytes.len());
        let count = chance.below(64).min(bytes.len() - at);
        match chance.below(6) {
            0 => bytes[at] ^= 1 << chance.below(8),
            1 => bytes[at..at + count.min(8)].fill(0xff),
            2 => bytes[at..at + count.min(8)].fill(0),
            3 => drop(bytes.drain(at..at + count)),
            4 => {
                let piece = bytes[at..at + count].to_vec();
                let to = chance.below(bytes.len());
                drop(bytes.splice(to..to, piece));
            }
            _ => bytes.truncate(at),
        }
    }
    bytes
}

fn each(seed: &[u8], mut check: impl FnMut(&[u8])) {
    check(seed);
    (0..TRIES).for_each(|number| check(&mutated(seed, number)));
}

fn seeds(kind: &str) -> Vec<Vec<u8>> {
    let folder = Path::new("fuzz/corpus").join(kind);
    let mut paths: Vec<_> = fs::read_dir(&folder)
        .expect("corpus")
        .flatten()
        .map(|e| e.path())
        .collect();
    paths.sort();
    assert!(!paths.is_empty(), "{} is empty", folder.display());
    paths.iter().map(|p| fs::read(p).expect("seed")).collect()
}

/// A recording as it is written today; those in the corpus are as they were written once.
fn written_now() -> Vec<u8> {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("seed.mcap");
    let head = Head {
        source: "seed".into(),
        ..Head::default()
    };
    let mut series =
        Series::create(&path, head, Limits::default(), || 1_700_000_000_000_000_000).expect("file");
    for (n, format) in PixelFormat::ALL.into_iter().cycle().take(12).enumerate() {
        let size = Size::new(4, 2);
        let bytes = vec![n as u8; format.picture_bytes(size).unwrap_or(30)];
        let raw = RawFrame {
            sequence: Some(n as u64),
            sensor_time_s: n as f64,
            size,
            format,
            bytes,
            depth: None,
        };
        series.frame(&raw, n as u64).expect("frame");
        if n % 3 == 2 {
            series.flush().expect("flush");
        }
    }
    series.close().expect("close");
    fs::read(&path).expect("file")
}

#[test]
fn no_recording_brings_the_reader_down() {
    let now = written_now();
    let mut read = Vec::new();
    let of_ros = [false, true].map(|is_ros2| ros::film(is_ros2, 4, ros::Faults::default()));
    for seed in seeds("recording").into_iter().chain([now]).chain(of_ros) {
        each(&seed, |bytes| {
            let Ok(mut reader) = Reader::new(Path::new("seed.mcap"), Cursor::new(bytes)) else {
                return;
            };
            read.push(std::iter::from_fn(|| reader.next_picture()).count());
            assert!(reader.warnings().iter().all(|w| !w.contains('\n')));
        });
    }
    assert!(
        read.iter().sum::<usize>() > 1000,
        "hardly anything was ever read: this shows nothing"
    );
}

#[test]
fn no_text_brings_the_parsers_down() {
    for seed in seeds("config") {
        each(&seed, |bytes| {
            let said = Config::parse(&String::from_utf8_lossy(bytes), "seed.toml")
                .err()
                .map(|e| e.to_string());
            assert!(said.is_none_or(|s| !s.contains('\n')), "one line");
        });
    }
    for seed in seeds("outline") {
        each(&seed, |bytes| {
            let text = String::from_utf8_lossy(bytes);
            let _ = arborcam::outline::parse(&text, "seed.json".into(), Size::new(64, 36));
        });
    }
}

#[test]
fn no_camera_file_and_no_list_brings_the_readers_down() {
    let (mut cameras, mut lenses) = (0, 0);
    for seed in seeds("camera") {
        each(&seed, |bytes| {
            let text = String::from_utf8_lossy(bytes);
            let camera = CameraFile::parse(&text);
            let rig = kinect_rig(&text, Size::new(640, 576), Size::new(1280, 720));
            cameras += usize::from(camera.is_ok()) + usize::from(rig.is_ok());
            assert!(camera.err().is_none_or(|what| !what.contains('\n')));
            assert!(rig.err().is_none_or(|what| !what.contains('\n')));
            let lens = read_lens_profile(bytes);
            lenses += usize::from(lens.is_ok());
            assert!(lens.err().is_none_or(|what| !what.contains('\n')));
        });
    }
    assert!(cameras > 10, "hardly any was ever read: {cameras}");
    assert!(lenses > 5, "hardly any was ever read: {lenses}");
    let folder = tempfile::tempdir().expect("folder");
    for seed in seeds("list") {
        each(&seed, |bytes| {
            for name in ["rgb.txt", "depth.txt"] {
                fs::write(folder.path().join(name), bytes).expect("list");
            }
            let said = source::open(folder.path(), &Config::default(), None).err();
            assert!(said.is_some_and(|e| !e.to_string().contains('\n')));
        });
    }
}

/// A film of two pictures with depth, whose depth image is what befell a sound one.
#[test]
fn no_depth_image_brings_its_film_down() {
    let folder = tempfile::tempdir().expect("folder");
    let path = |name: &str| folder.path().join(name);
    let camera = r#"{"fx": 600, "fy": 600, "cx": 4, "cy": 3, "depth_unit_m": 0.001}"#;
    fs::write(path("camera.json"), camera).expect("camera");
    fs::write(path("rgb.txt"), "1.0 colour.png\n1.1 colour.png\n").expect("list");
    fs::write(path("depth.txt"), "1.0 depth.png\n1.1 depth.png\n").expect("list");
    fs::copy("fuzz/corpus/depth/colour.png", path("colour.png")).expect("picture");
    let mut with_depth = 0;
    let mut check = |bytes: &[u8]| {
        fs::write(path("depth.png"), bytes).expect("depth");
        let mut film = match source::open(folder.path(), &Config::default(), None) {
            Ok(film) => film,
            Err(e) => return assert!(!e.to_string().contains('\n'), "one line"),
        };
        let frame = film.next_frame().expect("a picture").expect("a picture");
        with_depth += u64::from(frame.depth.is_some());
        assert!(film.warnings().iter().all(|w| !w.contains('\n')));
    };
    for seed in seeds("depth") {
        each(&seed, &mut check);
    }
    assert!((1..TRIES).contains(&with_depth), "{with_depth} with depth");
}

#[test]
fn no_drawing_and_no_model_brings_the_readers_down() {
    let mut trees = 0;
    for seed in seeds("drawing") {
        each(&seed, |bytes| {
            let tree = read_sketch(bytes).and_then(|sketch| joined(&sketch));
            trees += usize::from(tree.is_ok());
            assert!(tree.err().is_none_or(|e| !e.to_string().contains('\n')));
        });
    }
    for seed in seeds("model") {
        // As each kind of file.
        for name in ["seed.glb", "seed.obj", "seed.ply", "seed.csv", "seed.txt"] {
            each(&seed, |bytes| {
                let tree = read_model(bytes, Path::new(name))
                    .and_then(|model| StandingModel::of(&model.tree).map(|_| model));
                trees += usize::from(tree.is_ok());
                assert!(tree.err().is_none_or(|e| !e.to_string().contains('\n')));
            });
        }
    }
    assert!(trees > 30, "only {trees} trees: this shows nothing");
}

/// LAS, PLY, PCD and text: an end, one line, and never more than was there.
#[test]
fn no_cloud_brings_the_readers_down() {
    let mut read = 0;
    for seed in seeds("cloud") {
        let format = match seed.first() {
            Some(b'L') => CloudFormat::Las,
            Some(b'p') => CloudFormat::Ply,
            Some(b'V') => CloudFormat::Pcd,
            _ => CloudFormat::Text,
        };
        each(&seed, |bytes| {
            match read_cloud(Cursor::new(bytes.to_vec()), format, None) {
                Ok(found) => {
                    read += 1;
                    assert!(found.cloud.points.len() <= bytes.len());
                    let _ = tree_of_cloud(&found.cloud, CloudOptions::default());
                }
                Err(e) => assert!(!e.to_string().contains('\n'), "one line"),
            }
        });
    }
    assert!(
        read > 200,
        "hardly anything was ever read: this shows nothing"
    );
}

/// LAS, LAZ and E57, which crates read: the same.
#[test]
fn no_scan_brings_the_readers_down() {
    let mut read = 0;
    for seed in seeds("scan") {
        let format = match seed.first() {
            Some(b'L') => CloudFormat::Las,
            _ => CloudFormat::E57,
        };
        each(&seed, |bytes| {
            match read_cloud(Cursor::new(bytes.to_vec()), format, None) {
                Ok(_) => read += 1,
                Err(e) => assert!(!e.to_string().contains('\n'), "one line"),
            }
        });
    }
    assert!(
        read > 60,
        "hardly anything was ever read: this shows nothing ({read})"
    );
}

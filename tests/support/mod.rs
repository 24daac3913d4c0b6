//! The shipped recording, read once for all tests of a file.
#![allow(dead_code)] // not every test file needs all of it

use arborcam::config::Config;
use arborcam::model::{Frame, Outline, RawFrame, Size, TimedFrame};
use arborcam::outline::Given;
use arborcam::pipeline::DecodeStage;
use arborcam::source;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, OnceLock};
use std::time::Instant;
use tempfile::TempDir;

pub const CLIP: &str = "recordings/sparse_winter.mkv";
pub const OUTLINE: &str = "recordings/sparse_winter.outline.json";
pub const SIZE: Size = Size {
    width: 640,
    height: 360,
};

pub fn recording() -> &'static [RawFrame] {
    static FRAMES: OnceLock<Vec<RawFrame>> = OnceLock::new();
    FRAMES.get_or_init(|| {
        let mut clip = source::open(Path::new(CLIP), &Config::default(), None).expect("clip");
        std::iter::from_fn(|| clip.next_frame().expect("frame")).collect()
    })
}

/// Frame `k` of the recording as it comes from the source.
pub fn timed(k: usize) -> TimedFrame {
    let first_s = recording()[0].sensor_time_s;
    let raw = Arc::new(recording()[k].clone());
    TimedFrame::new(raw, k as u64, first_s, Instant::now())
}

/// The first stage, for frames of the recording.
pub fn decoding() -> DecodeStage {
    DecodeStage::new(false, None).expect("decoder")
}

/// Frame `k` of the recording as the tracker gets it.
pub fn decoded(decode: &mut DecodeStage, k: usize) -> Frame {
    decode.step(&timed(k), None).expect("picture")
}

pub fn outline() -> Outline {
    match arborcam::outline::load(Path::new(OUTLINE), SIZE).expect("outline") {
        Given::Region(outline) => outline,
        Given::Scribbles(_) => panic!("a polygon"),
    }
}

/// The capture folder of one replay of the shipped recording by the program itself.
pub fn replayed() -> &'static Path {
    static MADE: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    &MADE.get_or_init(|| replayed_with("")).1
}

/// The same with the skeleton of the motion alone: every node moves on its own, so that rows can be
/// taken out of its tables.
pub fn replayed_by_motion() -> &'static Path {
    static MADE: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    &MADE
        .get_or_init(|| replayed_with("[skeleton]\nalong_wood = false\n"))
        .1
}

fn replayed_with(settings: &str) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().expect("tempdir");
    let (config, out) = (dir.path().join("settings.toml"), dir.path().join("out"));
    std::fs::write(&config, settings).expect("settings");
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command
        .args(["replay", CLIP, "--fast", "--headless", "--outline", OUTLINE])
        .arg("--config")
        .arg(&config)
        .arg("--out")
        .arg(&out);
    let output = command.output().expect("arborcam");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    (dir, out)
}

/// Names of what a folder holds, in order.
pub fn names_in(dir: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(dir).expect("folder").flatten();
    let mut names: Vec<String> = entries
        .map(|e| e.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

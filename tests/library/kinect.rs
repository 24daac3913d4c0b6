//! Films of an Azure Kinect, made with ffmpeg: both tracks, the calibration, and what is wrong with some.

use arborcam::config::Config;
use arborcam::model::{CameraModel, RawFrame, Size};
use arborcam::source::{self, SourceInfo};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::TempDir;

const COLOUR: Size = Size {
    width: 320,
    height: 180,
};
const DEPTH: Size = Size {
    width: 320,
    height: 288,
};
const FRAMES: u16 = 12;
/// Where the fourcc stands in the description of a raw track.
const FOURCC_AT: usize = 16;
const BITS_AT: usize = 14;

/// Both cameras at one place, looking the same way.
const CALIBRATION: &str = r#"{"CalibrationInformation": {"Cameras": [
    {"Intrinsics": {"ModelParameterCount": 14, "ModelType": "CALIBRATION_LensDistortionModelBrownConrady",
        "ModelParameters": [0.5, 0.5, 0.5, 0.5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]},
     "Purpose": "CALIBRATION_CameraPurposeDepth", "SensorWidth": 1024, "SensorHeight": 1024,
     "Rt": {"Rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "Translation": [0, 0, 0]}},
    {"Intrinsics": {"ModelParameterCount": 14, "ModelType": "CALIBRATION_LensDistortionModelBrownConrady",
        "ModelParameters": [0.5, 0.5, 0.8, 1.0666666667, 0.01, 0, 0, 0, 0, 0, 0, 0, 0, 0]},
     "Purpose": "CALIBRATION_CameraPurposePhotoVideo", "SensorWidth": 4096, "SensorHeight": 3072,
     "Rt": {"Rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "Translation": [0, 0, 0]}}]}}"#;

/// A film with this calibration, or without any.
fn film(calibration: Option<&str>) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("film.mkv");
    let mut command = Command::new("ffmpeg");
    let colours = format!("testsrc=size={COLOUR}:rate=30");
    command
        .current_dir(dir.path())
        .args(["-v", "error", "-f", "lavfi", "-i", &colours])
        .args(["-f", "rawvideo", "-pix_fmt", "gray16be", "-framerate", "30"])
        .args(["-video_size", &DEPTH.to_string(), "-i", "pipe:0"])
        .args([
            "-map",
            "0:v",
            "-map",
            "1:v",
            "-frames:v",
            &FRAMES.to_string(),
        ])
        .args([
            "-c:v:0",
            "mjpeg",
            "-pix_fmt:v:0",
            "yuvj422p",
            "-c:v:1",
            "copy",
        ])
        .args([
            "-metadata:s:v:0",
            "title=COLOR",
            "-metadata:s:v:1",
            "title=DEPTH",
        ])
        .args(["-allow_raw_vfw", "1"]);
    if let Some(text) = calibration {
        std::fs::write(dir.path().join("calibration.json"), text).expect("written");
        command
            .args(["-attach", "calibration.json"])
            .args(["-metadata:s:t:0", "mimetype=application/octet-stream"]);
    }
    command.arg("film.mkv").stdin(Stdio::piped());
    let mut child = command.spawn().expect("ffmpeg");
    let mut input = child.stdin.take().expect("a pipe");
    for k in 0..FRAMES {
        // The upper part is 1 m nearer than the lower.
        let counts = (0..DEPTH.area()).map(|i| if i < DEPTH.area() / 2 { 1500 } else { 2500 } + k);
        let bytes: Vec<u8> = counts.flat_map(u16::to_be_bytes).collect();
        input.write_all(&bytes).expect("written");
    }
    drop(input);
    assert!(child.wait().expect("ffmpeg").success());
    describe_depth(&path);
    (dir, path)
}

/// ffmpeg leaves out what the track's pixels are; the camera's own program says it.
fn describe_depth(path: &Path) {
    let mut bytes = std::fs::read(path).expect("film");
    let codec = b"V_MS/VFW/FOURCC";
    let at = bytes.windows(codec.len()).position(|w| w == codec);
    let at = at.expect("a raw track");
    let length = 40_u32.to_le_bytes();
    let info = bytes[at..].windows(4).position(|w| w == length);
    let info = at + info.expect("its description");
    bytes[info + BITS_AT..info + BITS_AT + 2].copy_from_slice(&16_u16.to_le_bytes());
    bytes[info + FOURCC_AT..info + FOURCC_AT + 4].copy_from_slice(b"b16g");
    std::fs::write(path, bytes).expect("written");
}

/// All frames of a film, what it says of itself, and its warnings.
struct Read {
    frames: Vec<RawFrame>,
    info: SourceInfo,
    warnings: Vec<String>,
}

fn read(path: &Path, config: &Config) -> Result<Read, String> {
    let mut source = source::open(path, config, None).map_err(|e| e.to_string())?;
    let info = source.describe();
    let frames = std::iter::from_fn(|| source.next_frame().expect("a frame")).collect();
    Ok(Read {
        frames,
        info,
        warnings: source.warnings(),
    })
}

#[test]
fn both_tracks_are_read_and_the_depth_is_put_into_the_colours() {
    let (_dir, path) = film(Some(CALIBRATION));
    let film = read(&path, &Config::default()).expect("a film");
    assert_eq!(film.warnings, [""; 0]);
    assert_eq!(film.frames.len(), usize::from(FRAMES));
    let format = film.info.depth.expect("depth");
    assert_eq!(format.unit_m, 0.001);
    assert!((format.pinhole.focal_px.x - 256.0).abs() < 1e-6);
    assert!((format.pinhole.focal_px.y - 256.0).abs() < 1e-6);
    assert_eq!(format.distortion, CameraModel::coefficients(&[0.01]));
    // ffmpeg leaves out the last depth image when it writes such a film.
    let with_depth = usize::from(FRAMES) - 1;
    for (k, frame) in film.frames.iter().enumerate().take(with_depth) {
        assert_eq!(frame.size, COLOUR);
        let depth = frame.depth.as_ref().expect("depth");
        // Both look from one place: above the middle is what is above it in the depth.
        let (middle, high) = (depth.size.width as i64 / 2, depth.size.height as i64);
        let counts = [high / 4, 3 * high / 4].map(|v| depth.count(middle, v));
        assert_eq!(counts, [Some(1500 + k as u16), Some(2500 + k as u16)]);
    }
    let mut config = Config::default();
    config.depth.read = false;
    let colours = read(&path, &config).expect("a film");
    assert_eq!(colours.info.depth, None);
    assert_eq!(colours.frames.len(), usize::from(FRAMES));
}

#[test]
fn a_calibration_that_is_missing_or_none_is_said_in_one_line() {
    let broken = &CALIBRATION[..CALIBRATION.len() / 2];
    for (calibration, what) in [
        (None, "it has no calibration.json"),
        (Some(broken), "its calibration cannot be used"),
    ] {
        let (_dir, path) = film(calibration);
        let said = read(&path, &Config::default()).err().expect("refused");
        assert!(said.contains(what) && said.contains("--no-depth"), "{said}");
        assert!(!said.contains('\n'), "{said}");
    }
}

#[test]
fn a_film_that_was_cut_is_used_as_far_as_it_goes() {
    let (_dir, path) = film(Some(CALIBRATION));
    let whole = std::fs::read(&path).expect("film");
    std::fs::write(&path, &whole[..whole.len() * 3 / 4]).expect("written");
    // The attachment may be behind the cut, or before it.
    match read(&path, &Config::default()) {
        Ok(film) => assert!((3..usize::from(FRAMES)).contains(&film.frames.len())),
        Err(said) => assert!(!said.contains('\n'), "{said}"),
    }
}

//! Depth in recordings: our own to the byte, and those of programs of ROS.

use crate::ros::{FOCAL_PX, Faults, HEIGHT, WIDTH, film};
use arborcam::config::Config;
use arborcam::model::{DepthFormat, DepthImage, Pinhole, PixelFormat, RawFrame, Size, seconds};
use arborcam::recording::{Head, Limits, Series};
use arborcam::source::{self, SourceInfo};
use nalgebra::{Point2, Vector2};
use std::path::PathBuf;
use std::sync::Arc;
use tempfile::TempDir;

const SMALL: Size = Size {
    width: 16,
    height: 8,
};

fn config(change: impl Fn(&mut Config)) -> Config {
    let mut config = Config::default();
    change(&mut config);
    config
}

fn file(bytes: &[u8]) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("film.mcap");
    std::fs::write(&path, bytes).expect("written");
    (dir, path)
}

/// All frames of a film, what it says of itself, and its warnings.
struct Read {
    frames: Vec<RawFrame>,
    info: SourceInfo,
    warnings: Vec<String>,
}

fn read(bytes: &[u8], config: &Config) -> Result<Read, String> {
    let (_dir, path) = file(bytes);
    let mut source = source::open(&path, config, None).map_err(|e| e.to_string())?;
    let info = source.describe();
    let frames = std::iter::from_fn(|| source.next_frame().expect("a frame")).collect();
    let warnings = source.warnings();
    Ok(Read {
        frames,
        info,
        warnings,
    })
}

fn count(frame: &RawFrame) -> Option<u16> {
    frame.depth.as_ref().map(|depth| depth.counts[0])
}

#[test]
fn our_own_depth_comes_back_to_the_byte() {
    let format = DepthFormat {
        pinhole: Pinhole {
            focal_px: Vector2::new(612.345_678_901_2, 611.1),
            middle_px: Point2::new(7.25, 3.5),
        },
        distortion: [0.5, -2.6, 0.001, -0.0003, 1.5, 0.38, -2.4, 1.45],
        unit_m: 0.000_25,
        late_s: 0.0,
    };
    let head = Head {
        source: "test".into(),
        size: Some(SMALL),
        clock: "file".into(),
        depth: Some(format),
        ..Head::default()
    };
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("film.mcap");
    let mut series =
        Series::create(&path, head, Limits::default(), || 1_700_000_000_000_000_000).expect("file");
    let mut frames = Vec::new();
    for n in 0..40_u64 {
        let counts = (0..SMALL.area())
            .map(|i| (i as u64 * 3001 * n) as u16)
            .collect();
        let depth = DepthImage::new(SMALL, counts);
        frames.push(RawFrame {
            sequence: Some(n),
            sensor_time_s: seconds(-1_000_000_000 + n as i64 * 33_366_667),
            size: SMALL,
            format: PixelFormat::Grey,
            bytes: vec![n as u8; SMALL.area()],
            depth: (n % 5 != 3).then(|| Arc::new(depth)),
        });
        series.frame(&frames[n as usize], n).expect("frame");
    }
    series.close().expect("closed");
    let bytes = std::fs::read(&path).expect("file");
    let whole = read(&bytes, &Config::default()).expect("a film");
    assert_eq!(whole.info.depth, Some(format));
    assert_eq!(whole.frames.len(), frames.len());
    for (read, written) in whole.frames.iter().zip(&frames) {
        assert_eq!(read.depth, written.depth);
        assert_eq!(read.bytes, written.bytes);
        assert_eq!(read.sensor_time_s, written.sensor_time_s);
    }
    let without = read(&bytes, &config(|c| c.depth.read = false)).expect("a film");
    assert_eq!(without.info.depth, None);
    assert!(without.frames.iter().all(|frame| frame.depth.is_none()));
    // Cut anywhere, no frame gets the depth of another one.
    for cut in (bytes.len() / 2..bytes.len()).step_by(97) {
        for frame in read(&bytes[..cut], &Config::default()).map_or(Vec::new(), |r| r.frames) {
            let n = frame.sequence.expect("a number") as usize;
            assert!(frame.depth.is_none() || frame.depth == frames[n].depth);
        }
    }
}

#[test]
fn depth_of_both_generations_of_ros_is_read_with_its_camera() {
    for is_ros2 in [false, true] {
        let film = film(is_ros2, 20, Faults::default());
        let read = read(&film, &Config::default()).expect("a film");
        assert_eq!(read.frames.len(), 20, "{:?}", read.warnings);
        for (k, frame) in read.frames.iter().enumerate() {
            assert_eq!(count(frame), Some(1000 + k as u16), "frame {k}");
            assert_eq!(frame.size, Size::new(WIDTH, HEIGHT));
            assert_eq!(frame.format, PixelFormat::Rgb24);
            assert_eq!(frame.bytes[1], 7 + k as u8);
        }
        let format = read.info.depth.expect("depth");
        assert_eq!(format.unit_m, 0.001);
        assert_eq!(format.pinhole.focal_px, Vector2::repeat(FOCAL_PX));
        assert_eq!(read.warnings, [""; 0]);
    }
}

#[test]
fn what_the_user_says_goes_before_what_the_film_says() {
    let given = config(|c| {
        c.depth.unit_m = 0.002;
        (c.depth.fx_px, c.depth.fy_px) = (9.0, 8.0);
    });
    let read = read(&film(true, 5, Faults::default()), &given).expect("a film");
    let format = read.info.depth.expect("depth");
    assert_eq!(format.unit_m, 0.002);
    assert_eq!(format.pinhole.focal_px, Vector2::new(9.0, 8.0));
}

#[test]
fn depth_that_cannot_be_used_is_said_in_one_line() {
    let refused = |faults: Faults, what: &str| {
        let said = read(&film(true, 20, faults), &Config::default()).err();
        let said = said.expect("it is refused");
        assert!(said.contains(what) && !said.contains('\n'), "{said}");
        let colours = read(&film(true, 20, faults), &config(|c| c.depth.read = false));
        assert_eq!(colours.expect("a film").frames.len(), 20);
    };
    let other_frame = Faults {
        other_frame: true,
        ..Faults::default()
    };
    refused(other_frame, "not registered");
    let no_camera = Faults {
        no_camera: true,
        ..Faults::default()
    };
    refused(no_camera, "--depth-camera FILE");
}

#[test]
fn clocks_that_do_not_meet_and_a_stream_that_stops_are_reported() {
    let said = |faults: Faults| {
        let read = read(&film(true, 90, faults), &Config::default()).expect("a film");
        assert_eq!(read.frames.len(), 90);
        assert_eq!(read.warnings.len(), 1, "{:?}", read.warnings);
        read.warnings.join("")
    };
    let late = said(Faults {
        late_ns: 1_000_000_000_000,
        ..Faults::default()
    });
    assert!(
        late.contains("clocks of colour and depth do not meet"),
        "{late}"
    );
    let stops = said(Faults {
        stops_after: Some(31),
        ..Faults::default()
    });
    assert!(stops.contains("depth stops after 1.0 of 3.0 s"), "{stops}");
}

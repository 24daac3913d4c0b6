//! A depth camera beside a camera: pairs, losses, and a camera that never waits.

use super::*;
use crate::model::{DepthImage, FormatNote, PixelFormat, Size};

const SIZE: Size = Size {
    width: 2,
    height: 2,
};
const INTERVAL_S: f64 = 1.0 / 30.0;

/// What a camera that is played does next: it delivers, is lost, or ends where nothing more comes.
type Script = Receiver<Result<RawFrame, &'static str>>;

/// Plays a script.
struct Played {
    script: Script,
    is_depth: bool,
}

impl Source for Played {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        match self.script.recv_timeout(Duration::from_secs(5)) {
            Ok(Ok(frame)) => Ok(Some(frame)),
            Ok(Err(reason)) => Err(SourceError::Disconnected {
                input: "played".into(),
                reason: reason.into(),
            }),
            Err(_) => Ok(None),
        }
    }

    fn describe(&self) -> SourceInfo {
        SourceInfo {
            name: "played".into(),
            format: FormatNote::default(),
            size: SIZE,
            nominal_rate_hz: Some(30.0),
            frames_total: None,
            // Read where it is, as a file: no thread more.
            live: false,
            depth: None,
        }
    }

    fn returns(&self) -> bool {
        self.is_depth
    }

    fn reopen(&mut self) -> Result<(), SourceError> {
        Ok(())
    }
}

fn picture(k: u64) -> RawFrame {
    RawFrame {
        sequence: Some(k),
        sensor_time_s: 100.0 + k as f64 * INTERVAL_S,
        size: SIZE,
        format: PixelFormat::Grey,
        bytes: vec![0; 4],
        depth: None,
    }
}

/// The depth image of picture `k`, some milliseconds later.
fn depth(k: u64) -> RawFrame {
    let image = DepthImage::new(SIZE, vec![1 + k as u16; 4]);
    RawFrame {
        sensor_time_s: picture(k).sensor_time_s + 0.004,
        format: PixelFormat::Z16,
        bytes: Vec::new(),
        depth: Some(Arc::new(image)),
        ..picture(k)
    }
}

/// Both cameras, and their scripts.
struct Stage {
    pictures: Sender<Result<RawFrame, &'static str>>,
    depths: Sender<Result<RawFrame, &'static str>>,
    both: WithDepth,
    shared: Arc<Shared>,
}

impl Stage {
    fn new() -> Self {
        let (pictures, script) = crossbeam_channel::unbounded();
        let camera = Played {
            script,
            is_depth: false,
        };
        let (depths, script) = crossbeam_channel::unbounded();
        let depth = Played {
            script,
            is_depth: true,
        };
        let shared = Arc::new(Shared::default());
        let settings = config::Camera::default();
        let both = WithDepth::start(Box::new(camera), Box::new(depth), &settings, &shared);
        Self {
            pictures,
            depths,
            both: both.expect("a thread"),
            shared,
        }
    }

    /// Count of the depth image of the next picture, which must be the `k`th.
    fn next(&mut self, k: u64) -> Option<u16> {
        let frame = self.both.next_frame().expect("no failure");
        let frame = frame.expect("a picture");
        assert_eq!(frame.sequence, Some(k));
        frame.depth.map(|image| image.counts[0])
    }

    fn counts(&self) -> DepthCounts {
        let state = self.shared.camera_state();
        state.depth.expect("a depth camera").counts
    }

    /// Waits until the depth camera's thread has come so far.
    fn wait_until(&self, is_so: impl Fn(DepthCounts) -> bool) {
        let until = Instant::now() + Duration::from_secs(10);
        while !is_so(self.counts()) {
            assert!(Instant::now() < until, "{:?}", self.counts());
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

#[test]
fn each_picture_gets_the_depth_of_its_time_and_losses_are_counted() {
    let mut stage = Stage::new();
    for k in 0..8 {
        // One is missing.
        if k != 3 {
            stage.depths.send(Ok(depth(k))).expect("sent");
        }
    }
    stage.wait_until(|counts| counts.images == 7);
    for k in 0..8 {
        stage.pictures.send(Ok(picture(k))).expect("sent");
    }
    for k in 0..8 {
        let expected = (k != 3).then_some(1 + k as u16);
        assert_eq!(stage.next(k), expected, "picture {k}");
    }
    let counts = stage.counts();
    assert_eq!((counts.images_lost, counts.images_dropped), (1, 0));
    assert_eq!(counts.frames_without, 1);
}

#[test]
fn images_that_nobody_takes_are_dropped_and_the_newest_stay() {
    let mut stage = Stage::new();
    for k in 0..20 {
        stage.depths.send(Ok(depth(k))).expect("sent");
    }
    stage.wait_until(|counts| counts.images == 20);
    assert_eq!(stage.counts().images_dropped, 12);
    for k in 10..14 {
        stage.pictures.send(Ok(picture(k))).expect("sent");
    }
    for k in 10..14 {
        let expected = (k >= 12).then_some(1 + k as u16);
        assert_eq!(stage.next(k), expected, "picture {k}");
    }
}

#[test]
fn a_depth_camera_that_is_lost_is_said_once_and_pictures_go_on() {
    let mut stage = Stage::new();
    stage.depths.send(Ok(depth(0))).expect("sent");
    stage.wait_until(|counts| counts.images == 1);
    stage.pictures.send(Ok(picture(0))).expect("sent");
    assert_eq!(stage.next(0), Some(1));
    stage.depths.send(Err("unplugged")).expect("sent");
    stage.wait_until(|counts| counts.absences == 1);
    for k in 1..10 {
        stage.pictures.send(Ok(picture(k))).expect("sent");
        // None is held back.
        assert_eq!(stage.next(k), None);
    }
    let warnings = stage.shared.warnings();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].contains("the depth camera was lost"));
    assert!(warnings[0].contains("unplugged"), "{warnings:?}");
    // It is plugged in again.
    stage.depths.send(Ok(depth(10))).expect("sent");
    stage.wait_until(|counts| counts.images == 2);
    stage.pictures.send(Ok(picture(10))).expect("sent");
    assert_eq!(stage.next(10), Some(11));
    assert!(stage.shared.take_news().join("\n").contains("is back"));
    assert_eq!(stage.shared.warnings().len(), 1);
}

#[test]
fn a_camera_that_is_lost_gives_its_last_picture_first() {
    let mut stage = Stage::new();
    stage.pictures.send(Ok(picture(0))).expect("sent");
    stage.pictures.send(Err("unplugged")).expect("sent");
    assert_eq!(stage.next(0), None);
    let lost = stage.both.next_frame();
    assert!(matches!(lost, Err(SourceError::Disconnected { .. })));
}

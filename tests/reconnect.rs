//! A camera that is unplugged, hangs and comes back: the capture goes on, and every frame that
//! there was is accounted for.

mod support;

use arborcam::config::Config;
use arborcam::model::{Control, FormatNote, Observation, RawFrame, Snapshot, TrackId, TrackSet};
use arborcam::recording::{Head, Limits};
use arborcam::runtime::{
    self, Failure, Job, Pace, QUEUE_BYTES, RecordJob, RecordTo, Running, Summary,
};
use arborcam::source::{Health, Source, SourceError, SourceInfo, Successor};
use arborcam::track::Tracker;
use nalgebra::Point2;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use support::{SIZE, recording};

const HANGS: Duration = Duration::from_secs(60);
/// The made-up camera is that much faster than one of 30 frames a second.
const HURRY: u64 = 2;
/// It slows down where the program does not keep up, lest what is judged here depend on how fast
/// the machine is: no more frames are under way than the queue to the tracker holds.
const UNDER_WAY_S: f64 = 3.5 / 30.0;

/// The live cases take turns: together they would be slower than any machine for which the limits
/// of time are meant.
fn alone() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

fn unplugged() -> SourceError {
    SourceError::Disconnected {
        input: "fake".into(),
        reason: "test".into(),
    }
}

fn silent() -> SourceError {
    SourceError::Timeout {
        input: "fake".into(),
        seconds: 3.0,
    }
}

fn denied() -> SourceError {
    SourceError::Denied {
        input: "fake".into(),
        remedy: "test".into(),
    }
}

fn absent() -> SourceError {
    SourceError::Absent {
        input: "fake".into(),
        hint: "test",
    }
}

/// What happens to a camera at some frame.
#[derive(Clone, Copy)]
struct Loss {
    at: u64,
    /// How it fails.
    how: fn() -> SourceError,
    /// What the attempts to open it again come to before one succeeds.
    attempts: u64,
    refusal: fn() -> SourceError,
    /// How long it was away by its own clock, s.
    away_s: f64,
    /// It starts, and fails once more before the first frame.
    false_start: bool,
}

const UNPLUGGED: Loss = Loss {
    at: 100,
    how: unplugged,
    attempts: 2,
    refusal: absent,
    away_s: 2.0,
    false_start: false,
};

#[derive(Default)]
struct Log {
    reopened: Vec<Instant>,
    /// Time of the newest frame that is known to have been followed, s since the first.
    followed_s: f64,
}

/// Plays the recording over and over as a camera of 30 frames a second would.
struct Camera {
    losses: Vec<Loss>,
    frames: u64,
    next: u64,
    /// Time of the last frame, s since the first.
    delivered_s: f64,
    away_s: f64,
    refused: u64,
    /// It is gone, and the frame at which it went.
    gone: bool,
    stop: Arc<AtomicBool>,
    log: Arc<Mutex<Log>>,
}

impl Camera {
    fn new(losses: &[Loss], frames: u64) -> (Box<Self>, Arc<Mutex<Log>>) {
        let log = Arc::new(Mutex::new(Log::default()));
        let (losses, stop) = (losses.to_vec(), Arc::default());
        let (next, delivered_s, away_s, refused, gone) = (0, 0.0, 0.0, 0, false);
        (
            Box::new(Self {
                losses,
                frames,
                next,
                delivered_s,
                away_s,
                refused,
                gone,
                stop,
                log: log.clone(),
            }),
            log,
        )
    }

    fn wait_for_the_tracker(&self) {
        let since = Instant::now();
        let behind_s = || self.delivered_s - self.log.lock().expect("log").followed_s;
        while behind_s() > UNDER_WAY_S
            && since.elapsed() < HANGS / 4
            && !self.stop.load(Ordering::Relaxed)
        {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Source for Camera {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        if self.next == self.frames || self.stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        if let Some(loss) = self.losses.first().copied()
            && loss.at == self.next
        {
            if !self.gone || self.losses[0].false_start && self.refused == loss.attempts {
                self.refused += u64::from(self.gone);
                self.gone = true;
                return Err((loss.how)());
            }
            self.losses.remove(0);
            (self.gone, self.refused) = (false, 0);
        }
        std::thread::sleep(Duration::from_millis(33 / HURRY));
        self.wait_for_the_tracker();
        let n = self.next;
        self.next += 1;
        let clip = recording();
        let mut raw = clip[(n % clip.len() as u64) as usize].clone();
        self.delivered_s = n as f64 / 30.0 + self.away_s;
        (raw.sequence, raw.sensor_time_s) = (Some(n), 1000.0 + self.delivered_s);
        Ok(Some(raw))
    }

    fn describe(&self) -> SourceInfo {
        SourceInfo {
            name: "fake".into(),
            format: FormatNote::default(),
            size: SIZE,
            nominal_rate_hz: Some(30.0),
            frames_total: None,
            live: true,
            depth: None,
        }
    }

    fn returns(&self) -> bool {
        true
    }

    fn reopen(&mut self) -> Result<(), SourceError> {
        self.log.lock().expect("log").reopened.push(Instant::now());
        let loss = self.losses[0];
        if self.refused < loss.attempts {
            self.refused += 1;
            return Err((loss.refusal)());
        }
        if self.refused == loss.attempts {
            self.away_s += loss.away_s;
        }
        Ok(())
    }

    fn stop_when(&mut self, stop: Arc<AtomicBool>) {
        self.stop = stop;
    }

    fn health(&self) -> Health {
        Health::default()
    }
}

fn job(out: Option<&Path>) -> Job {
    Job {
        config: Config::default(),
        outline: Some(support::outline().into()),
        pace: Pace::Live,
        length_s: None,
        stream: None,
        out: out.map(Path::to_path_buf),
        record: None,
        notes: Default::default(),
        preview_every: Some(Duration::from_secs(2)),
    }
}

/// Looks at the screen: the state that it shows, if that is new.
fn look(running: &Running, log: &Mutex<Log>) -> Option<Arc<Snapshot>> {
    let shown = running.latest()?;
    log.lock().expect("log").followed_s = shown.time_s;
    Some(shown)
}

/// Waits for the end of a run: how it ended, and all that was told on the way.
fn ended(running: Running, log: &Mutex<Log>) -> (Summary, Option<Failure>, Vec<String>) {
    let (mut since, mut followed_s, mut news) = (Instant::now(), 0.0, Vec::new());
    while !running.finished() {
        assert!(
            since.elapsed() < HANGS,
            "the run hangs; told so far: {news:?}"
        );
        news.extend(running.news());
        // Slow is not hung.
        if let Some(shown) = look(&running, log).filter(|s| s.time_s > followed_s) {
            (since, followed_s) = (Instant::now(), shown.time_s);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    news.extend(running.news());
    let (summary, failure) = running.join();
    (summary.expect("a summary"), failure, news)
}

fn capture(out: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(out.join("capture.json")).expect("capture.json"))
        .expect("JSON")
}

/// Runs a camera with these losses; the capture's `timing`, and what was told.
fn run(losses: &[Loss], frames: u64) -> (serde_json::Value, Summary, Vec<String>) {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    let (camera, log) = Camera::new(losses, frames);
    let (summary, failure, news) = ended(
        runtime::start(camera, job(Some(&out))).expect("start"),
        &log,
    );
    assert!(failure.is_none(), "{failure:?}");
    let timing = capture(&out)["timing"].clone();
    assert_eq!(
        timing["frames_dropped_tracker"], 0,
        "the camera of this test waits for the tracker"
    );
    (timing, summary, news)
}

#[test]
fn an_unplugged_camera_is_waited_for_and_the_gap_has_its_true_length() {
    let _alone = alone();
    let (timing, summary, news) = run(&[UNPLUGGED], 300);
    assert_eq!(
        (summary.frames, timing["reconnects"].as_u64()),
        (300, Some(1))
    );
    let gap = &timing["gaps"][0];
    assert_eq!(
        (gap["after_frame"].as_u64(), gap["cause"].as_str()),
        (Some(99), Some("disconnected"))
    );
    assert_eq!(gap["missing"], 60, "two seconds of frames");
    assert!(
        (gap["length_s"].as_f64().expect("length") - (2.0 + 1.0 / 30.0)).abs() < 1e-3,
        "{gap}"
    );
    assert!((timing["away_s"].as_f64().expect("time") - (2.0 + 1.0 / 30.0)).abs() < 1e-3);
    let rate_hz = timing["measured_rate_hz"].as_f64().expect("rate");
    assert!(
        (rate_hz - 30.0).abs() < 0.01,
        "{rate_hz}: the absence is no time in which it filmed"
    );
    assert_eq!(
        timing["frames_dropped_camera"], 0,
        "what was never filmed was not dropped"
    );
    assert!((timing["duration_s"].as_f64().expect("time") - (299.0 / 30.0 + 2.0)).abs() < 1e-3);
    let told = |what: &str| news.iter().filter(|l| l.contains(what)).count();
    assert_eq!(
        (
            told("was lost at 3.3 s (test)"),
            told("the camera is back after")
        ),
        (1, 1),
        "{news:?}"
    );
    assert!(summary.tree.is_some(), "a tree is built all the same");
}

#[test]
fn twenty_times_unplugged_is_twenty_times_back_with_the_same_tree_and_points() {
    let _alone = alone();
    let losses: Vec<Loss> = (0..20)
        .map(|k| Loss {
            at: 330 + 15 * k,
            away_s: 0.5,
            attempts: k % 2,
            false_start: k % 3 == 0,
            ..UNPLUGGED
        })
        .collect();
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    let (camera, log) = Camera::new(&losses, 330 + 20 * 15 + 30);
    let mut config = Config::default();
    // Less than what is filmed between two losses.
    config.camera.retry_delay_s = 0.1;
    let (summary, failure, news) = ended(
        runtime::start(
            camera,
            Job {
                config,
                ..job(Some(&out))
            },
        )
        .expect("start"),
        &log,
    );
    assert!(failure.is_none(), "{failure:?}");
    let capture = capture(&out);
    let timing = &capture["timing"];
    assert_eq!(timing["frames_dropped_tracker"], 0);
    assert_eq!(
        (timing["reconnects"].as_u64(), summary.frames),
        (Some(20), 660),
        "{news:?}"
    );
    assert_eq!(timing["gaps"].as_array().map(Vec::len), Some(20));
    assert!((timing["away_s"].as_f64().expect("time") - 20.0 * (0.5 + 1.0 / 30.0)).abs() < 1e-2);
    let tree = summary.tree.expect("a tree");
    assert!(
        tree.first.frame < 330,
        "built before the first loss, and not from scratch again"
    );
    // The points that made the tree are still the ones that move it.
    let text = std::fs::read_to_string(out.join("tracks.csv")).expect("tracks.csv");
    let row = |l: &str| {
        Some((
            l.split(',').next()?.parse::<u32>().ok()?,
            l.split(',').nth(1)?.parse::<u64>().ok()?,
        ))
    };
    let rows: Vec<(u32, u64)> = text.lines().skip(1).filter_map(row).collect();
    let last = rows.iter().map(|r| r.1).max().expect("tracks");
    assert!(last > 800, "frames keep their places in time: {last}");
    let at_end: Vec<u32> = rows.iter().filter(|r| r.1 == last).map(|r| r.0).collect();
    let kept = at_end
        .iter()
        .filter(|id| tree.rest_px.keys().any(|t| t.0 == **id))
        .count();
    assert!(
        kept * 10 >= tree.rest_px.len() * 6,
        "{kept} of {} points are left",
        tree.rest_px.len()
    );
}

#[test]
fn why_it_cannot_go_on_yet_is_told_once_and_attempts_do_not_crowd() {
    let _alone = alone();
    fn other_size() -> SourceError {
        SourceError::BadFormat {
            input: "fake".into(),
            what: "it came back with another size".into(),
        }
    }
    let (camera, log) = Camera::new(
        &[Loss {
            how: silent,
            attempts: 4,
            refusal: other_size,
            ..UNPLUGGED
        }],
        120,
    );
    let (summary, failure, news) = ended(runtime::start(camera, job(None)).expect("start"), &log);
    assert!(failure.is_none() && summary.frames == 120);
    let told = |what: &str| news.iter().filter(|l| l.contains(what)).count();
    assert_eq!(
        (
            told("no frame for 3 s"),
            told("came back with another size")
        ),
        (1, 1),
        "{news:?}"
    );
    let times = log.lock().expect("log").reopened.clone();
    assert_eq!(times.len(), 5);
    let least = times
        .windows(2)
        .map(|w| w[1] - w[0])
        .min()
        .expect("attempts");
    assert!(
        least >= Duration::from_millis(500),
        "camera.retry_delay_s is kept: {least:?}"
    );
}

#[test]
fn a_camera_that_is_not_there_is_looked_for_often_enough() {
    let _alone = alone();
    let mut config = Config::default();
    config.camera.retry_delay_s = 3600.0;
    let (camera, log) = Camera::new(
        &[Loss {
            attempts: 5,
            ..UNPLUGGED
        }],
        120,
    );
    let (summary, ..) = ended(
        runtime::start(
            camera,
            Job {
                config,
                ..job(None)
            },
        )
        .expect("start"),
        &log,
    );
    let times = log.lock().expect("log").reopened.clone();
    assert_eq!((summary.frames, times.len()), (120, 6));
    let longest = times
        .windows(2)
        .map(|w| w[1] - w[0])
        .max()
        .expect("attempts");
    assert!(
        longest < Duration::from_secs(1),
        "a camera that comes back is seen: {longest:?}"
    );
}

/// Until the lost camera has been tried for the first time.
fn wait_for_an_attempt(running: &Running, log: &Mutex<Log>, since: Instant) {
    while log.lock().expect("log").reopened.is_empty() {
        assert!(since.elapsed() < HANGS, "it is never tried");
        look(running, log);
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_wish_to_stop_is_heard_while_waiting() {
    let _alone = alone();
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    let mut config = Config::default();
    config.camera.retry_delay_s = 3600.0;
    let (camera, log) = Camera::new(
        &[Loss {
            attempts: u64::MAX,
            refusal: silent,
            at: 150,
            ..UNPLUGGED
        }],
        300,
    );
    let running = runtime::start(
        camera,
        Job {
            config,
            ..job(Some(&out))
        },
    )
    .expect("start");
    let since = Instant::now();
    wait_for_an_attempt(&running, &log, since);
    // The screen says so though no frame comes.
    let away = |r: &Running| r.latest().is_some_and(|s| s.camera.away.is_some());
    while !away(&running) {
        assert!(since.elapsed() < HANGS, "the screen does not say it");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(300));
    running.send(Control::Quit);
    let (summary, failure, _) = ended(running, &log);
    assert!(failure.is_none(), "{failure:?}");
    assert_eq!(
        (summary.frames, summary.written.is_some()),
        (150, true),
        "what was captured is kept"
    );
    let timing = &capture(&out)["timing"];
    let [gap] = timing["gaps"].as_array().expect("gaps").as_slice() else {
        panic!("{timing}")
    };
    assert_eq!(
        (gap["after_frame"].as_u64(), gap["missing"].as_u64()),
        (Some(149), Some(0)),
        "{gap}"
    );
    assert_eq!(
        (gap["cause"].as_str(), &gap["length_s"]),
        (Some("disconnected"), &timing["away_s"])
    );
    let away_s = timing["away_s"].as_f64().expect("time");
    assert!(
        (0.3..since.elapsed().as_secs_f64()).contains(&away_s),
        "{away_s}"
    );
    let rate_hz = timing["measured_rate_hz"].as_f64().expect("rate");
    assert!(
        (rate_hz - 30.0).abs() < 0.01 && timing["reconnects"] == 0,
        "{timing}"
    );
}

#[test]
fn without_reconnecting_the_first_loss_ends_the_capture() {
    let _alone = alone();
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    let mut config = Config::default();
    config.camera.reconnect = false;
    let (camera, log) = Camera::new(
        &[Loss {
            at: 150,
            ..UNPLUGGED
        }],
        300,
    );
    let (summary, failure, _) = ended(
        runtime::start(
            camera,
            Job {
                config,
                ..job(Some(&out))
            },
        )
        .expect("start"),
        &log,
    );
    assert!(
        matches!(
            failure,
            Some(Failure::Source(SourceError::Disconnected { .. }))
        ),
        "{failure:?}"
    );
    assert_eq!(
        (summary.frames, out.join("capture.json").exists()),
        (150, true)
    );
    assert!(log.lock().expect("log").reopened.is_empty());
}

/// A camera that never gave a frame is not one to wait for: most likely it is the wrong one.
#[test]
fn a_camera_that_never_filmed_is_not_waited_for() {
    let _alone = alone();
    let (camera, log) = Camera::new(
        &[Loss {
            at: 0,
            how: silent,
            ..UNPLUGGED
        }],
        300,
    );
    let (summary, failure, _) = ended(runtime::start(camera, job(None)).expect("start"), &log);
    assert!(
        matches!(failure, Some(Failure::Source(SourceError::Timeout { .. }))),
        "{failure:?}"
    );
    assert_eq!(summary.frames, 0);
    assert!(log.lock().expect("log").reopened.is_empty());
}

/// udev gives a new node to its group a moment after it has appeared.
#[test]
fn a_camera_that_may_not_be_opened_yet_is_looked_at_again_at_once_and_told_of_when_it_stays_so() {
    let _alone = alone();
    let mut config = Config::default();
    config.camera.retry_delay_s = 3600.0;
    let (camera, log) = Camera::new(
        &[Loss {
            attempts: 3,
            refusal: denied,
            ..UNPLUGGED
        }],
        120,
    );
    let (summary, _, news) = ended(
        runtime::start(
            camera,
            Job {
                config,
                ..job(None)
            },
        )
        .expect("start"),
        &log,
    );
    let told = |news: &[String]| news.iter().filter(|l| l.contains("no permission")).count();
    assert_eq!((summary.frames, told(&news)), (120, 0), "{news:?}");
    let (camera, log) = Camera::new(
        &[Loss {
            attempts: 14,
            refusal: denied,
            ..UNPLUGGED
        }],
        120,
    );
    let (summary, _, news) = ended(runtime::start(camera, job(None)).expect("start"), &log);
    assert_eq!((summary.frames, told(&news)), (120, 1), "{news:?}");
}

#[test]
fn a_camera_that_comes_back_for_one_frame_each_is_not_opened_without_a_pause() {
    let _alone = alone();
    let losses: Vec<Loss> = (100..103)
        .map(|at| Loss {
            at,
            attempts: 0,
            ..UNPLUGGED
        })
        .collect();
    let (camera, log) = Camera::new(&losses, 120);
    let (summary, ..) = ended(runtime::start(camera, job(None)).expect("start"), &log);
    let times = log.lock().expect("log").reopened.clone();
    assert_eq!((summary.frames, times.len()), (120, 3));
    let least = times
        .windows(2)
        .map(|w| w[1] - w[0])
        .min()
        .expect("attempts");
    assert!(
        least >= Duration::from_millis(500),
        "camera.retry_delay_s is kept: {least:?}"
    );
}

#[test]
fn a_wait_that_is_switched_off_meanwhile_ends_with_what_was_captured() {
    let _alone = alone();
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    let mut config = Config::default();
    config.camera.retry_delay_s = 3600.0;
    let (camera, log) = Camera::new(
        &[Loss {
            attempts: u64::MAX,
            refusal: silent,
            at: 150,
            ..UNPLUGGED
        }],
        300,
    );
    let running = runtime::start(
        camera,
        Job {
            config: config.clone(),
            ..job(Some(&out))
        },
    )
    .expect("start");
    wait_for_an_attempt(&running, &log, Instant::now());
    config.camera.reconnect = false;
    running.reload(config);
    let (summary, failure, _) = ended(running, &log);
    assert!(
        matches!(
            failure,
            Some(Failure::Source(SourceError::Disconnected { .. }))
        ),
        "{failure:?}"
    );
    assert_eq!(
        (summary.frames, out.join("capture.json").exists()),
        (150, true)
    );
    assert_eq!(log.lock().expect("log").reopened.len(), 1);
}

/// A camera whose driver hangs for good, or that is read by a crate which panics when it is opened
/// again.
struct Careless {
    camera: Box<Camera>,
    hangs: bool,
}

impl Source for Careless {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        if self.hangs {
            loop {
                std::thread::park();
            }
        }
        self.camera.next_frame()
    }

    fn describe(&self) -> SourceInfo {
        self.camera.describe()
    }

    fn returns(&self) -> bool {
        true
    }

    fn reopen(&mut self) -> Result<(), SourceError> {
        panic!("of this test, on purpose");
    }
}

#[test]
fn a_camera_whose_thread_has_ended_is_not_waited_for() {
    let _alone = alone();
    let (camera, log) = Camera::new(&[UNPLUGGED], 300);
    let running = runtime::start(
        Box::new(Careless {
            camera,
            hangs: false,
        }),
        job(None),
    )
    .expect("start");
    let (summary, failure, _) = ended(running, &log);
    assert!(
        matches!(
            failure,
            Some(Failure::Source(SourceError::Disconnected { .. }))
        ),
        "{failure:?}"
    );
    assert_eq!(summary.frames, 100);
}

#[test]
fn recording_alone_gives_up_a_camera_that_hangs() {
    let dir = tempfile::tempdir().expect("tempdir");
    let to = RecordTo {
        path: dir.path().join("a.mcap"),
        limits: Limits::default(),
        head: Head::default(),
        queue_bytes: QUEUE_BYTES,
    };
    let (camera, _) = Camera::new(&[], 300);
    let job = RecordJob {
        to,
        pace: Pace::Live,
        camera: Config::default().camera,
    };
    let running = runtime::record(
        Box::new(Careless {
            camera,
            hangs: true,
        }),
        job,
    )
    .expect("start");
    let since = Instant::now();
    while !running.finished() {
        assert!(since.elapsed() < HANGS, "it waits for ever");
        std::thread::sleep(Duration::from_millis(5));
    }
    let (_, failure) = running.join();
    assert!(
        matches!(failure, Some(Failure::Source(SourceError::Timeout { .. }))),
        "{failure:?}"
    );
}

/// Where the driver of a made-up camera hangs.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hang {
    Dequeue,
    Close,
    /// The kernel ends the thread while it closes the device: nothing is unwound, nothing dropped.
    ClosedByTheKernel,
    Reopen,
    /// Every attempt does, also on the node that comes next.
    EveryReopen,
}

/// What the test and all openings of a [`Stuck`] camera know.
#[derive(Default)]
struct Driver {
    /// Frames delivered so far.
    next: AtomicU64,
    /// Calls that hang now.
    hanging: AtomicU64,
    released: AtomicBool,
}

impl Driver {
    /// A call that does not return before the test lets it.
    fn hang(&self) {
        self.hanging.fetch_add(1, Ordering::SeqCst);
        while !self.released.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(2));
        }
        self.hanging.fetch_sub(1, Ordering::SeqCst);
    }
}

/// A camera that is lost at frame [`Stuck::LOST_AT`] with a call to its driver hanging; only its
/// next node is well.
struct Stuck {
    hang: Hang,
    driver: Arc<Driver>,
    /// Whether this is the node that it was first opened by.
    first: bool,
    open: bool,
    stop: Arc<AtomicBool>,
}

impl Stuck {
    const LOST_AT: u64 = 150;

    fn new(hang: Hang) -> (Box<Self>, Arc<Driver>) {
        let driver = Arc::new(Driver::default());
        let camera = Self {
            hang,
            driver: driver.clone(),
            first: true,
            open: true,
            stop: Arc::default(),
        };
        (Box::new(camera), driver)
    }
}

impl Source for Stuck {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        let n = self.driver.next.load(Ordering::SeqCst);
        if self.first && n == Self::LOST_AT {
            if self.hang == Hang::Dequeue {
                self.driver.hang();
            }
            return Err(unplugged());
        }
        if !self.open {
            return Err(unplugged());
        }
        if self.stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(33 / HURRY));
        self.driver.next.fetch_add(1, Ordering::SeqCst);
        let clip = recording();
        let mut raw = clip[n as usize % clip.len()].clone();
        let away_s = if self.first { 0.0 } else { 2.0 };
        (raw.sequence, raw.sensor_time_s) = (Some(n), 1000.0 + n as f64 / 30.0 + away_s);
        Ok(Some(raw))
    }

    fn describe(&self) -> SourceInfo {
        SourceInfo {
            name: "stuck".into(),
            format: FormatNote::default(),
            size: SIZE,
            nominal_rate_hz: Some(30.0),
            frames_total: None,
            live: true,
            depth: None,
        }
    }

    fn stop_when(&mut self, stop: Arc<AtomicBool>) {
        self.stop = stop;
    }

    fn returns(&self) -> bool {
        true
    }

    fn close(&mut self) {
        self.open = false;
        match self.hang {
            Hang::Close if self.first => self.driver.hang(),
            // SAFETY: ends this thread alone, as the kernel does with one that is in a faulty
            // driver; it shares nothing that somebody else would free.
            Hang::ClosedByTheKernel if self.first => unsafe {
                libc::syscall(libc::SYS_exit, 0);
            },
            _ => {}
        }
    }

    fn reopen(&mut self) -> Result<(), SourceError> {
        let hangs = match self.hang {
            Hang::Reopen => self.first,
            Hang::EveryReopen => true,
            _ => false,
        };
        if hangs {
            self.driver.hang();
        }
        if self.first {
            return Err(absent());
        }
        self.open = true;
        Ok(())
    }

    fn successor(&self) -> Option<Successor> {
        let (hang, driver) = (self.hang, self.driver.clone());
        Some(Box::new(move || {
            Box::new(Stuck {
                hang,
                driver: driver.clone(),
                first: false,
                open: false,
                stop: Arc::default(),
            })
        }))
    }
}

/// Until `line` has been told.
fn wait_for_news(running: &Running, news: &mut Vec<String>, line: &str) {
    let since = Instant::now();
    while !news.iter().any(|told| told.contains(line)) {
        assert!(since.elapsed() < HANGS, "{line:?} is not told: {news:?}");
        news.extend(running.news());
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Whatever hangs in the driver is said in time, and left behind: the capture goes on with the
/// camera's next node, and a request to stop writes it, while the call hangs still.
#[test]
fn a_call_to_the_driver_that_never_returns_is_left_behind() {
    for hang in [
        Hang::Dequeue,
        Hang::Close,
        Hang::ClosedByTheKernel,
        Hang::Reopen,
    ] {
        let _alone = alone();
        let dir = tempfile::tempdir().expect("tempdir");
        let out = dir.path().join("out");
        let mut job = job(Some(&out));
        job.config.camera.timeout_s = 0.5;
        let (camera, driver) = Stuck::new(hang);
        let running = runtime::start(camera, job).expect("start");
        let since = Instant::now();
        while driver.next.load(Ordering::SeqCst) < Stuck::LOST_AT {
            assert!(since.elapsed() < HANGS, "{hang:?}: it never films");
            std::thread::sleep(Duration::from_millis(2));
        }
        let (lost, mut news) = (Instant::now(), Vec::new());
        wait_for_news(&running, &mut news, "the camera was lost at 5.0 s");
        let told = lost.elapsed();
        assert!(
            told < Duration::from_secs(3),
            "{hang:?}: told {told:?} late"
        );
        wait_for_news(&running, &mut news, "the camera is back");
        while driver.next.load(Ordering::SeqCst) < Stuck::LOST_AT + 30 {
            assert!(since.elapsed() < HANGS, "{hang:?}: no more frames");
            std::thread::sleep(Duration::from_millis(2));
        }
        running.send(Control::Quit);
        let (summary, failure, more) = ended(running, &Mutex::default());
        news.extend(more);
        assert!(failure.is_none() && summary.written.is_some(), "{hang:?}");
        let hanging = u64::from(hang != Hang::ClosedByTheKernel);
        assert_eq!(driver.hanging.load(Ordering::SeqCst), hanging, "{hang:?}");
        let timing = &capture(&out)["timing"];
        let gap = &timing["gaps"][0];
        assert_eq!(
            (
                gap["after_frame"].as_u64(),
                gap["missing"].as_u64(),
                timing["reconnects"].as_u64()
            ),
            (Some(Stuck::LOST_AT - 1), Some(60), Some(1)),
            "{hang:?}: {timing}"
        );
        driver.released.store(true, Ordering::SeqCst);
    }
}

/// Where every attempt hangs there is an end to the threads that wait in the driver; they take no
/// part in the end of the capture; and when they return the capture goes on.
#[test]
fn calls_that_hang_do_not_pile_up() {
    let _alone = alone();
    for released in [false, true] {
        let dir = tempfile::tempdir().expect("tempdir");
        let out = dir.path().join("out");
        let mut job = job(Some(&out));
        (job.config.camera.timeout_s, job.config.camera.retry_delay_s) = (0.4, 0.05);
        let (camera, driver) = Stuck::new(Hang::EveryReopen);
        let running = runtime::start(camera, job).expect("start");
        let mut news = Vec::new();
        let line = "the camera cannot go on yet: 8 calls to its driver have not returned";
        wait_for_news(&running, &mut news, line);
        std::thread::sleep(Duration::from_millis(500));
        // Those left behind, and the one whose turn it is.
        assert_eq!(driver.hanging.load(Ordering::SeqCst), 9);
        if released {
            driver.released.store(true, Ordering::SeqCst);
            wait_for_news(&running, &mut news, "the camera is back");
            let since = Instant::now();
            while driver.hanging.load(Ordering::SeqCst) > 0 {
                assert!(since.elapsed() < HANGS, "a thread does not end");
                std::thread::sleep(Duration::from_millis(2));
            }
        }
        running.send(Control::Quit);
        let (summary, failure, _) = ended(running, &Mutex::default());
        assert!(
            failure.is_none() && summary.written.is_some(),
            "{failure:?}"
        );
        let reconnects = &capture(&out)["timing"]["reconnects"];
        assert_eq!(reconnects.as_u64(), Some(u64::from(released)));
        driver.released.store(true, Ordering::SeqCst);
    }
}

/// Follows the frames, `skipped` left out; the points of each of the others.
fn followed(
    skipped: std::ops::Range<usize>,
    adjust: &dyn Fn(usize, &mut arborcam::model::Frame),
) -> Vec<TrackSet> {
    let config = Config::default();
    let mut tracker = Tracker::new(&config.detect, &config.track, &support::outline(), 0);
    let mut decode = support::decoding();
    let mut sets = Vec::new();
    for k in (0..recording().len()).filter(|k| !skipped.contains(k)) {
        let mut frame = support::decoded(&mut decode, k);
        adjust(k, &mut frame);
        sets.push(tracker.step(&frame));
    }
    sets
}

/// While a camera is away the tree goes on swaying, and a camera that starts takes a moment to find
/// its exposure.
#[test]
fn points_are_found_again_after_a_gap_under_their_names_and_in_their_places() {
    let whole = followed(0..0, &|_, _| {});
    for (gap, dark) in [
        (150..153, 0),
        (150..195, 0),
        (150..240, 0),
        (150..240, 10),
        (150..240, 30),
    ] {
        let back = gap.end;
        let with_gap = followed(gap.clone(), &|k, frame| {
            // The first pictures are too dark by half, less and less so.
            if k >= back && k < back + dark {
                let gain = 0.3 + 0.7 * (k - back) as f64 / dark as f64;
                frame
                    .luma
                    .pixels
                    .iter_mut()
                    .for_each(|p| *p = (f64::from(*p) * gain) as u8);
            }
        });
        let before: BTreeSet<TrackId> = with_gap[gap.start - 1]
            .observations
            .iter()
            .map(|o| o.id)
            .collect();
        // Two seconds after the camera is back, of which the first may have been dark.
        let k = back + 60;
        let set = &with_gap[k - gap.len()];
        let truth: BTreeMap<TrackId, Point2<f32>> = whole[k]
            .observations
            .iter()
            .map(|o| (o.id, Point2::new(o.u_px, o.v_px)))
            .collect();
        let kept: Vec<_> = set
            .observations
            .iter()
            .filter(|o| before.contains(&o.id))
            .collect();
        let least = if gap.len() < 10 { 0.95 } else { 0.55 };
        let share = kept.len() as f64 / before.len() as f64;
        assert!(
            share >= least,
            "{gap:?}, dark for {dark}: {} of {} are left",
            kept.len(),
            before.len()
        );
        let off = |o: &&Observation| {
            let truth = truth.get(&o.id)?;
            Some((o.u_px - truth.x).hypot(o.v_px - truth.y))
        };
        let off_px: Vec<f32> = kept.into_iter().filter_map(|o| off(&o)).collect();
        let right = off_px.iter().filter(|d| **d < 2.0).count();
        assert!(
            right * 10 >= off_px.len() * 9,
            "{gap:?}, dark for {dark}: {right} of {} are right",
            off_px.len()
        );
    }
}

//! What tracking costs and how well it follows, each beside what anyone would write with OpenCV.
//!
//! The textbook's way is two calls of `calc_optical_flow_pyr_lk` on pictures, forward and back,
//! window 15. Both follow the same points through the same frames, in turns and more than once, and
//! of each frame the shortest time counts: whatever else the machine does meanwhile is not
//! measured.

use crate::support;
use crate::truth::{self, Places, Truth};
use arborcam::config::{Config, Detect};
use arborcam::model::{CameraMotion, Frame, Luma, Outline, TrackId};
use arborcam::outline::whole;
use arborcam::source::{self, Decoder};
use arborcam::track::{Detector, Tracker};
use nalgebra::Point2;
use opencv::boxed_ref::BoxedRef;
use opencv::core::{Mat, Point2f, Size as CvSize, TermCriteria, Vector};
use opencv::video::{OPTFLOW_USE_INITIAL_FLOW, calc_optical_flow_pyr_lk};
use std::path::Path;
use std::time::Instant;

/// The same frames are followed so many times.
const ROUNDS: usize = 3;
/// Frames that are measured: the trial ends at two to six seconds.
const FRAMES: usize = 220;

/// What is measured: shortest times of each frame, ms.
#[derive(Default)]
struct Costs {
    ours_ms: Vec<f64>,
    plain_ms: Vec<f64>,
    points: Vec<f64>,
}

impl Costs {
    fn row(&self, what: &str, bound: &str) -> String {
        if self.points.is_empty() {
            return format!("{what:<34} no such frame");
        }
        let [points, ours, plain] =
            [&self.points, &self.ours_ms, &self.plain_ms].map(|v| median(v.clone()));
        let ratio = ours / plain;
        format!("{what:<34}{points:>8.0}{ours:>10.2}{plain:>10.2}{ratio:>8.2}  {bound}")
    }
}

/// The table of the tracker; `large` is the recording at 1920x1080, `clip` at 1280x720.
pub fn table(clip: &Path, large: &Path) -> Vec<String> {
    let frames = format!(
        "{:<34}{:>8}{:>10}{:>10}{:>8}",
        "tracking", "points", "ours/ms", "plain/ms", "ratio"
    );
    let (trial, after, _) = costs(clip, 400);
    let (large_trial, large_after, detection_ms) = costs(large, 2000);
    let fps = |c: &Costs| 1e3 * c.ours_ms.len() as f64 / c.ours_ms.iter().sum::<f64>();
    let plain_fps = |c: &Costs| 1e3 * c.plain_ms.len() as f64 / c.plain_ms.iter().sum::<f64>();
    let large_bound = |c: &Costs| {
        format!(
            "{:.0} frames/s (must be >= 30), plain OpenCV {:.0}",
            fps(c),
            plain_fps(c)
        )
    };
    let mut rows = vec![busy(), frames];
    rows.push(after.row("1280x720, 400 wanted", "(must be <= 1.5)"));
    rows.push(trial.row("  while twice as many are on trial", ""));
    rows.push(large_after.row("1920x1080, 2,000 wanted", &large_bound(&large_after)));
    rows.push(large_trial.row(
        "  while twice as many are on trial",
        &large_bound(&large_trial),
    ));
    let detection = detection(clip);
    rows.push(format!(
        "{:<34}{:>8}{detection:>10.2}",
        "1280x720, new points are looked for", 800
    ));
    rows.push(format!(
        "{:<34}{:>8}{detection_ms:>10.2}",
        "1920x1080, the first frame", 4000
    ));
    rows.push(String::new());
    rows.extend(accuracy());
    rows
}

/// Frames a second mean little where others use the cores, too.
fn busy() -> String {
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    format!(
        "load of the machine {} on {cores} cores",
        load.split(' ').next().unwrap_or_default()
    )
}

/// During the trial, after it, and of the first frame, ms.
fn costs(clip: &Path, wanted: u32) -> (Costs, Costs, f64) {
    let settings = Config::default();
    let mut source = source::open(clip, &settings, None).expect("clip");
    let mut decoder = Decoder::new().expect("decoder");
    let mut next = |index: u64| {
        let raw = source.next_frame().expect("frame")?;
        let mut luma = Luma {
            size: raw.size,
            pixels: Vec::new(),
        };
        decoder.luma(&raw, &mut luma).expect("picture");
        Some(Frame {
            index,
            time_s: raw.sensor_time_s,
            received: Instant::now(),
            luma,
            preview: None,
            colour: None,
            raw: None,
            depth: None,
        })
    };
    let mut before = next(0).expect("a frame");
    let outline: Outline = whole(before.luma.size);
    // So many find room only where they may stand close.
    let min_distance_px = settings.detect.min_distance_px.min(2.0);
    let detect = Detect {
        points: wanted,
        min_distance_px,
        ..settings.detect
    };
    let mut trackers: Vec<Tracker> = (0..ROUNDS)
        .map(|_| Tracker::new(&detect, &settings.track, &outline, 0))
        .collect();
    let first: Vec<(f64, _)> = trackers
        .iter_mut()
        .map(|t| timed_ms(|| t.step(&before)))
        .collect();
    let first_ms = first.iter().map(|(ms, _)| *ms).fold(f64::MAX, f64::min);
    let mut set = first.into_iter().last().expect("a round").1;
    let (mut trial, mut after) = (Costs::default(), Costs::default());
    for frame in (1..FRAMES as u64).map_while(next) {
        let from: Vector<Point2f> = set
            .observations
            .iter()
            .map(|o| Point2f::new(o.u_px, o.v_px))
            .collect();
        let on_trial = set.observations.iter().any(|o| !o.confirmed);
        let (mut ours_ms, mut plain_ms) = (f64::MAX, f64::MAX);
        for tracker in &mut trackers {
            plain_ms =
                plain_ms.min(timed_ms(|| there_and_back(&before.luma, &frame.luma, &from)).0);
            let (ms, next) = timed_ms(|| tracker.step(&frame));
            ours_ms = ours_ms.min(ms);
            set = next;
        }
        let costs = if on_trial { &mut trial } else { &mut after };
        costs.ours_ms.push(ours_ms);
        costs.plain_ms.push(plain_ms);
        costs.points.push(from.len() as f64);
        before = frame;
    }
    (trial, after, first_ms)
}

/// Shortest time in which the points of a trial are found, ms.
fn detection(clip: &Path) -> f64 {
    let settings = Config::default();
    let mut source = source::open(clip, &settings, None).expect("clip");
    let raw = source.next_frame().expect("frame").expect("a frame");
    let mut luma = Luma {
        size: raw.size,
        pixels: Vec::new(),
    };
    Decoder::new()
        .expect("decoder")
        .luma(&raw, &mut luma)
        .expect("picture");
    let detector = Detector::new(&settings.detect, &whole(luma.size));
    let still = CameraMotion::default();
    (0..20)
        .map(|_| timed_ms(|| detector.detect(&luma, &[], 800, &still)).0)
        .fold(f64::MAX, f64::min)
}

/// The shipped recording: ours as a user gets it, and the textbook's way from the same corners.
fn accuracy() -> Vec<String> {
    let truth = Truth::read();
    let row = |what: &str, places: &Places| {
        let s = truth.score(places);
        format!(
            "{what:<34}{:>8}{:>10.3}{:>10.2}",
            s.tracks, s.within_2px, s.median_end_px
        )
    };
    vec![
        format!(
            "{:<34}{:>8}{:>10}{:>10}",
            "recording, against the truth", "scored", "within_2", "median/px"
        ),
        row("ours", &truth::tracks().0),
        row("plain OpenCV, the same corners", &textbook()),
    ]
}

fn textbook() -> Places {
    let settings = Config::default();
    let mut decode = support::decoding();
    let mut before = support::decoded(&mut decode, 0).luma;
    let mut points = Detector::new(&settings.detect, &support::outline()).detect(
        &before,
        &[],
        2 * settings.detect.points as usize,
        &CameraMotion::default(),
    );
    let mut ids: Vec<TrackId> = (0..points.len() as u32).map(TrackId).collect();
    let mut places = Places::new();
    for k in 0..support::recording().len() {
        let now = support::decoded(&mut decode, k).luma;
        let from: Vector<Point2f> = points.iter().map(|p| Point2f::new(p.x, p.y)).collect();
        let (to, closed) = there_and_back(&before, &now, &from);
        let kept: Vec<usize> = (0..points.len()).filter(|&i| closed[i]).collect();
        ids = kept.iter().map(|&i| ids[i]).collect();
        points = kept.iter().map(|&i| to[i]).collect();
        for (id, p) in ids.iter().zip(&points) {
            places
                .entry(*id)
                .or_default()
                .insert(k as u64, p.map(f64::from));
        }
        before = now;
    }
    places
}

/// Where points go from picture `a` to picture `b`, and whether the way back ends within 1 px of
/// where they were.
fn there_and_back(a: &Luma, b: &Luma, from: &Vector<Point2f>) -> (Vec<Point2<f32>>, Vec<bool>) {
    let (rows, cols) = (a.size.height as i32, a.size.width as i32);
    let [a, b] = [a, b].map(|l| Mat::new_rows_cols_with_data(rows, cols, &l.pixels).expect("mat"));
    let flow = |a: &BoxedRef<Mat>, b: &BoxedRef<Mat>, from: &Vector<Point2f>| {
        let (mut to, mut status, mut error) =
            (from.clone(), Vector::<u8>::new(), Vector::<f32>::new());
        let (window, flags) = (CvSize::new(15, 15), OPTFLOW_USE_INITIAL_FLOW);
        let criteria = TermCriteria::new(3, 30, 0.01).expect("criteria");
        calc_optical_flow_pyr_lk(
            a,
            b,
            from,
            &mut to,
            &mut status,
            &mut error,
            window,
            3,
            criteria,
            flags,
            1e-4,
        )
        .expect("flow");
        (to, status)
    };
    let (to, there) = flow(&a, &b, from);
    let (again, back) = flow(&b, &a, &to);
    let missed_px = from
        .iter()
        .zip(again.iter())
        .map(|(p, q)| (p.x - q.x).hypot(p.y - q.y));
    let closed = missed_px
        .zip(there.iter().zip(back.iter()))
        .map(|(px, (s, t))| px < 1.0 && s != 0 && t != 0);
    (
        to.iter().map(|p| Point2::new(p.x, p.y)).collect(),
        closed.collect(),
    )
}

pub fn timed_ms<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let result = work();
    (start.elapsed().as_secs_f64() * 1e3, result)
}

pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

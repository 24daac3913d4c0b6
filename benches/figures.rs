//! The figures that arborcam is held to: `cargo bench`, or `make bench`.
//!
//! Each is printed on a line of its own with its bound; criterion's statistics stand above them.

#[path = "../tests/support/mod.rs"]
mod support;

use arborcam::config::{Config, Detect};
use arborcam::hierarchy::{self, COMPARE_HZ, Evidence, evidence, evidence_of};
use arborcam::model::{Frame, Luma, Outline, Rgb, Size, TrackId, TrackSet};
use arborcam::outline::{self, Mark, Scribbles, whole};
use arborcam::pipeline::{self, Moment, Pipeline, Tree};
use arborcam::source::{self, Decoder};
use arborcam::track::{OpticalFlow, Pyramid, TrackHistory, TrackTable, Tracker};
use criterion::Criterion;
use opencv::boxed_ref::BoxedRef;
use opencv::core::{Mat, Point2f, Size as CvSize, TermCriteria, Vector};
use opencv::video::{OPTFLOW_USE_INITIAL_FLOW, calc_optical_flow_pyr_lk};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Frames of the 720p clip that tracking is measured on: in the first 6 s all points are on trial.
const TRACKED: usize = 230;

fn main() {
    let dir = tempfile::tempdir().expect("tempdir");
    let clip = dir.path().join("720p.mkv");
    let scale = ["-v", "error", "-nostdin", "-i", support::CLIP, "-vf", "scale=1280:720", "-c:v", "mjpeg", "-q:v", "4"];
    assert!(Command::new("ffmpeg").args(scale).arg(&clip).status().expect("ffmpeg").success());

    let mut criterion = Criterion::default()
        .without_plots()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(3));
    let lines = [build(&mut criterion, 400, 100), build(&mut criterion, 2000, 1500)].into_iter().chain([
        pose(&mut criterion),
        matting(),
        replay(&clip, dir.path()),
    ]);
    println!();
    tracking(&clip).into_iter().chain(lines).for_each(|line| println!("{line}"));
}

fn frames(clip: &Path, n: usize) -> Vec<Frame> {
    let mut source = source::open(clip, &Config::default().camera, None).expect("clip");
    let mut decoder = Decoder::new().expect("decoder");
    let frame = |index: usize| {
        let raw = source.next_frame().expect("frame")?;
        let mut luma = Luma { size: raw.size, pixels: Vec::new() };
        decoder.luma(&raw, &mut luma).expect("picture");
        let (time_s, received) = (raw.sensor_time_s, Instant::now());
        Some(Frame { index: index as u64, time_s, received, luma, preview: None })
    };
    (0..n).map_while(frame).collect()
}

/// Forward and back as our tracker does it, each pyramid built once, against two plain calls of OpenCV on pictures, as
/// anyone would write them; in turns on the same frames and points, so that whatever else the machine does is shared
/// fairly. The medians are compared, those of the tracker's whole step, which also undoes drift, among them. While points
/// are on trial there are twice as many.
fn tracking(clip: &Path) -> [String; 2] {
    let frames = frames(clip, TRACKED);
    let settings = Config::default();
    let (window, levels) = (settings.track.window_px, settings.track.levels);
    let outline = whole(frames[0].luma.size);
    let detect = Detect { points: 400, ..settings.detect };
    let (mut ours_ms, mut plain_ms, mut step_ms, mut trial_ms) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut flow = OpticalFlow::new(window);
    let (mut forward, mut backward) = (Vec::new(), Vec::new());
    for _ in 0..2 {
        let mut tracker = Tracker::new(&detect, &settings.track, &outline, 0);
        let mut set = tracker.step(&frames[0]);
        let (mut previous, mut present) = (Pyramid::default(), Pyramid::default());
        previous.rebuild(&frames[0].luma, window, levels);
        for pair in frames.windows(2) {
            let points: Vec<[f32; 2]> = set.observations.iter().map(|o| [o.u_px, o.v_px]).collect();
            assert!(points.len() >= 300, "{} points", points.len());
            let on_trial = set.observations.iter().any(|o| !o.confirmed);
            if on_trial {
                let (ms, next) = timed_ms(|| tracker.step(&pair[1]));
                trial_ms.push(ms);
                std::mem::swap(&mut previous, &mut present);
                previous.rebuild(&pair[1].luma, window, levels);
                set = next;
                continue;
            }
            let from: Vector<Point2f> = points.iter().map(|p| Point2f::new(p[0], p[1])).collect();
            plain_ms.push(timed_ms(|| plain(&pair[0].luma, &pair[1].luma, &from)).0);
            let ours = || {
                present.rebuild(&pair[1].luma, window, levels);
                flow.track((&previous, &present), &points, None, levels, &mut forward);
                let to: Vec<[f32; 2]> = forward.iter().map(|f| f.to).collect();
                flow.track((&present, &previous), &to, None, levels, &mut backward);
            };
            ours_ms.push(timed_ms(ours).0);
            std::mem::swap(&mut previous, &mut present);
            let (ms, next) = timed_ms(|| tracker.step(&pair[1]));
            step_ms.push(ms);
            set = next;
        }
    }
    let (ours, plain, step, trial) = (median(ours_ms), median(plain_ms), median(step_ms), median(trial_ms));
    println!("a 720p frame, some 400 points, forward and back: {ours:.2} ms; plain OpenCV: {plain:.2} ms");
    println!("the whole step, drift undone: {step:.2} ms; with some 800 points on trial: {trial:.2} ms");
    [
        format!("forward and back: {:.2} of plain OpenCV (must be <= 0.85)", ours / plain),
        format!("all of tracking: {:.2} of plain OpenCV (must be <= 1.5)", step / plain),
    ]
}

fn plain(a: &Luma, b: &Luma, from: &Vector<Point2f>) -> Vector<Point2f> {
    let (rows, cols) = (a.size.height as i32, a.size.width as i32);
    let [a, b] = [a, b].map(|l| Mat::new_rows_cols_with_data(rows, cols, &l.pixels).expect("mat"));
    let (mut status, mut error) = (Vector::<u8>::new(), Vector::<f32>::new());
    let mut flow = |a: &BoxedRef<Mat>, b: &BoxedRef<Mat>, from: &Vector<Point2f>| {
        let (mut to, window) = (from.clone(), CvSize::new(15, 15));
        let criteria = TermCriteria::new(3, 30, 0.01).expect("criteria");
        let flags = OPTFLOW_USE_INITIAL_FLOW;
        calc_optical_flow_pyr_lk(a, b, from, &mut to, &mut status, &mut error, window, 3, criteria, flags, 1e-4)
            .expect("flow");
        to
    };
    let to = flow(&a, &b, from);
    flow(&b, &a, &to)
}

/// What has been seen of the recording by the time the tree is built.
fn gathered() -> (TrackHistory, Arc<Outline>, Vec<TrackSet>) {
    let config = Config::default();
    let outline = support::outline();
    let mut pipeline = Pipeline::new(&config, Some(outline.clone()));
    let mut decoder = Decoder::new().expect("decoder");
    let (mut history, mut sets) = (TrackHistory::new(config.accumulate.window_s), Vec::new());
    for k in 0..support::recording().len() {
        for moved in pipeline.step(support::decoded(&mut decoder, k)) {
            if pipeline.back.tree().is_none() || history.is_empty() {
                history.push(moved.tracks.clone());
            }
            sets.push(moved.tracks);
        }
    }
    (history, Arc::new(outline), sets)
}

fn built(history: &TrackHistory, outline: &Arc<Outline>) -> Tree {
    let config = Config::default();
    let evidence = evidence_of(history, &config.accumulate);
    let table = Arc::new(history.table(1.0 / COMPARE_HZ));
    pipeline::build(&table, evidence, outline, &config, Moment::default()).expect("a tree")
}

/// The recording's tracks over and over until there are `points` that move, each some pixels beside its model.
fn crowd(history: &TrackHistory, points: usize) -> (TrackTable, Evidence) {
    let settings = Config::default().accumulate;
    let table = history.table(1.0 / COMPARE_HZ);
    let moving = evidence(&table, &settings).moving;
    let beside = |k: usize| {
        let aside = (k / moving.len()) as f32;
        let place = |p: [f32; 2]| [p[0] + 1.7 * aside.sin() * aside, p[1] + 1.3 * aside.cos() * aside];
        table.positions[moving[k % moving.len()]].iter().map(|p| p.map(place)).collect()
    };
    let crowd = TrackTable {
        ids: (0..points as u32).map(TrackId).collect(),
        times_s: table.times_s.clone(),
        positions: (0..points).map(beside).collect(),
        fb_errors_px: vec![0.05; points],
    };
    let evidence = evidence(&crowd, &settings);
    (crowd, evidence)
}

fn build(criterion: &mut Criterion, points: usize, bound_ms: u32) -> String {
    let (history, outline, _) = gathered();
    let (table, evidence) = crowd(&history, points);
    let table = Arc::new(table);
    let config = Config::default();
    let whole = || pipeline::build(&table, evidence.clone(), &outline, &config, Moment::default()).expect("a tree");
    let parting = || hierarchy::build(&table, &evidence.moving, [300.0, 330.0], &config.hierarchy);
    criterion.bench_function(&format!("build of the tree, {points} points"), |b| b.iter(whole));
    let ms = median((0..10).map(|_| timed_ms(whole).0).collect());
    let parting_ms = median((0..10).map(|_| timed_ms(parting).0).collect());
    let moving = evidence.moving.len();
    format!("build of {moving} points: {ms:.0} ms, {parting_ms:.0} ms of it the hierarchy (must be <= {bound_ms})")
}

fn pose(criterion: &mut Criterion) -> String {
    let (history, outline, sets) = gathered();
    let tree = built(&history, &outline);
    let all = || {
        let (mut binding, mut estimator) = (tree.binding(), tree.estimator(&Config::default()));
        for set in &sets {
            std::hint::black_box(estimator.step(set.frame, set.time_s, &binding.targets_px(set)));
        }
    };
    criterion.bench_function("poses of 330 frames", |b| b.iter(all));
    let ms = median((0..5).map(|_| timed_ms(all).0 / sets.len() as f64).collect());
    format!("pose: {ms:.3} ms a frame (must be <= 1)")
}

/// The program itself, everything included: ffmpeg, decoding, all stages, the capture folder.
fn replay(clip: &Path, dir: &Path) -> String {
    let outline = dir.join("720p.json");
    let corners: Vec<[i32; 2]> = support::outline().polygon_px.iter().map(|p| [2 * p[0], 2 * p[1]]).collect();
    std::fs::write(&outline, format!(r#"{{"width": 1280, "height": 720, "polygon_px": {corners:?}}}"#))
        .expect("outline");
    let run = |k: usize| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
        command.args(["replay", "--fast", "--headless"]).arg(clip).arg("--outline").arg(&outline);
        command.arg("--out").arg(dir.join(format!("out{k}"))).stderr(std::process::Stdio::null());
        let (ms, status) = timed_ms(|| command.status().expect("arborcam"));
        assert!(status.success());
        ms
    };
    let ms = median((0..3).map(run).collect());
    format!("replay: {:.0} frames/s at 1280x720 (must be >= 80)", support::recording().len() as f64 / ms * 1e3)
}

/// The test's picture and scribbles at 640x480, as large as the figure asks.
fn matting() -> String {
    let load = |name: &str| image::open(Path::new("tests/matting").join(name)).expect("picture");
    let (picture, strokes) = (load("picture.png"), load("scribbles.png"));
    let size = Size::new(640, 480);
    let pixels = picture.resize_exact(640, 480, image::imageops::FilterType::CatmullRom).into_rgb8().into_raw();
    let mark = |&shade: &u8| match shade {
        0 => Mark::Background,
        255 => Mark::Tree,
        _ => Mark::Undecided,
    };
    let strokes = strokes.resize_exact(640, 480, image::imageops::FilterType::Nearest).into_luma8();
    let scribbles = Scribbles { name: String::new(), size, marks: strokes.as_raw().iter().map(mark).collect() };
    let picture = Rgb { size, pixels };
    let ms =
        (0..5).map(|_| timed_ms(|| outline::alpha(&picture, &scribbles).expect("a matte")).0).fold(f64::MAX, f64::min);
    format!("scribbles on a 640x480 picture solved: {ms:.0} ms (must be <= 1500)")
}

fn timed_ms<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let result = work();
    (start.elapsed().as_secs_f64() * 1e3, result)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

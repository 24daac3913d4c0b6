//! The figures that arborcam is held to: `cargo bench`, or `make bench`.
//!
//! Each is printed on a line of its own with its bound; criterion's statistics stand above them.

mod photo;
#[path = "../tests/support/mod.rs"]
mod support;
#[path = "../tests/synthetic/mod.rs"]
mod synthetic;
mod tracking;
#[path = "../tests/support/truth.rs"]
mod truth;

use arborcam::animate::{Animator, Wind};
use arborcam::cancel::CancelToken;
use arborcam::config::{self, Config};
use arborcam::export::gltf::{KEY_TOLERANCE_PX, Model, glb};
use arborcam::hierarchy::{self, evidence};
use arborcam::model::{Observation, Outline, Pose, Rgb, Size, TrackId, TrackLog, TrackSet};
use arborcam::motion::PoseEstimator;
use arborcam::outline::{self, Mark, Scribbles};
use arborcam::pipeline::{self, Pipeline, PoseTracker, Seen, dress};
use arborcam::solve::{self, lift_to_3d, solve};
use criterion::Criterion;
use nalgebra::Point2;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::Duration;
use tracking::{median, timed_ms};

/// With a word, `make bench ONLY=tracking`, `ONLY=wood`, `ONLY=pose`, `ONLY=animate` or `ONLY=photo`,
/// only the figures of the tracker, of the static tree, of the pose of many branches and the model's
/// file, of the animation, or of made photographs.
fn main() {
    if std::env::args().any(|a| a == "photo") {
        photo::table().iter().for_each(|line| println!("{line}"));
        return;
    }
    if std::env::args().any(|a| a == "animate") {
        println!("{}", animation());
        return;
    }
    if std::env::args().any(|a| a == "pose") {
        println!("{}\n{}", pose_of_127(), model_file());
        return;
    }
    if std::env::args().any(|a| a == "wood") {
        println!("{}", dressed());
        return;
    }
    let dir = tempfile::tempdir().expect("tempdir");
    let clip = scaled(dir.path(), "1280:720");
    let large = scaled(dir.path(), "1920:1080");
    let table = tracking::table(&clip, &large);
    if std::env::args().any(|a| a == "tracking") {
        table.iter().for_each(|line| println!("{line}"));
        return;
    }
    let mut criterion = Criterion::default()
        .without_plots()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(3));
    let lines = [
        build(&mut criterion, 400, 100),
        build(&mut criterion, 2000, 1500),
    ]
    .into_iter()
    .chain([
        dressed(),
        pose(&mut criterion),
        pose_of_127(),
        model_file(),
        matting(),
        animation(),
        replay(&clip, dir.path()),
    ]);
    println!();
    table
        .into_iter()
        .chain([String::new()])
        .chain(lines)
        .for_each(|line| println!("{line}"));
}

/// The recording in another size.
fn scaled(dir: &Path, size: &str) -> PathBuf {
    let clip = dir.join(format!("{}.mkv", size.replace(':', "x")));
    let (filter, quality) = (format!("scale={size}"), ["-c:v", "mjpeg", "-q:v", "4"]);
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg
        .args([
            "-v",
            "error",
            "-nostdin",
            "-i",
            support::CLIP,
            "-vf",
            &filter,
        ])
        .args(quality)
        .arg(&clip);
    assert!(ffmpeg.status().expect("ffmpeg").success());
    clip
}

/// What has been seen of the recording by the time the tree is built.
fn gathered() -> (TrackLog, Arc<Outline>, Vec<TrackSet>) {
    let config = Config::default();
    let outline = support::outline();
    let mut pipeline = Pipeline::new(&config, Some(outline.clone())).expect("decoder");
    let mut log = TrackLog::new(config.accumulate.window_s);
    let mut sets = Vec::new();
    for k in 0..support::recording().len() {
        for moved in pipeline.step(&support::timed(k)).expect("picture") {
            if pipeline.back.model().is_none() || log.all().is_empty() {
                log.push(moved.tracks.clone());
            }
            sets.push(moved.tracks);
        }
    }
    (log, Arc::new(outline), sets)
}

fn built(log: &TrackLog, outline: &Arc<Outline>) -> solve::Model {
    solve(log, outline, None, &Config::default(), &CancelToken::new()).expect("a tree")
}

/// The recording's points that move, over and over until there are `points`, each some pixels beside
/// its model.
fn crowd(log: &TrackLog, points: usize) -> TrackLog {
    let table = hierarchy::table(log.all());
    let moving = evidence(&table, &Config::default().accumulate).moving;
    let mut crowd = TrackLog::new(f64::INFINITY);
    for set in log.all().sets() {
        let mut observations = Vec::new();
        for k in 0..points {
            let id = table.ids[moving[k % moving.len()]];
            let aside = (k / moving.len()) as f32;
            if let Some(seen) = set.observations.iter().find(|o| o.id == id) {
                observations.push(Observation {
                    id: TrackId(k as u32),
                    u_px: seen.u_px + 1.7 * aside.sin() * aside,
                    v_px: seen.v_px + 1.3 * aside.cos() * aside,
                    fb_error_px: 0.05,
                    confirmed: true,
                    ..*seen
                });
            }
        }
        crowd.push(TrackSet {
            observations,
            rejected: Vec::new(),
            ..set.clone()
        });
    }
    crowd
}

fn build(criterion: &mut Criterion, points: usize, bound_ms: u32) -> String {
    let (log, outline, _) = gathered();
    let log = crowd(&log, points);
    let config = Config::default();
    let table = hierarchy::table(log.all());
    let evidence = evidence(&table, &config.accumulate);
    let whole = || built(&log, &outline);
    let parting = || {
        hierarchy::build(
            &table,
            &evidence.moving,
            Point2::new(300.0, 330.0),
            &config.hierarchy,
        )
    };
    criterion.bench_function(&format!("build of the tree, {points} points"), |b| {
        b.iter(whole)
    });
    let ms = median((0..10).map(|_| timed_ms(whole).0).collect());
    let parting_ms = median((0..10).map(|_| timed_ms(parting).0).collect());
    let moving = evidence.moving.len();
    format!(
        "build of {moving} points: {ms:.0} ms, {parting_ms:.0} ms of it the hierarchy (must be <= {bound_ms})"
    )
}

/// The recording's tree is bare; a crown of noise gives the leaves as much to do as there can be.
fn crown_of_noise(outline: &Outline) -> Rgb {
    let size = outline.size;
    let noise =
        |i: usize| [60, 110, 40].map(|c: usize| (c / 2 + (i * 7919 + i / 640 * 104_729) % c) as u8);
    let sky = [190, 210, 235];
    let colour = |i: usize| if outline.mask[i] > 0 { noise(i) } else { sky };
    Rgb {
        size,
        pixels: (0..size.area()).flat_map(colour).collect(),
    }
}

/// From the built hierarchy to all that is drawn: skeleton in space, wood of 20,000 triangles and
/// its coarser levels, leaves.
fn dressed() -> String {
    let (log, outline, _) = gathered();
    let tree = built(&log, &outline);
    let picture = crown_of_noise(&outline);
    let mut config = Config::default();
    config.wood.triangles = 20_000;
    let all = || {
        let skeleton = lift_to_3d(
            &tree.hierarchy,
            tree.foot.position_px,
            &outline,
            &[],
            &config,
        );
        dress(
            &skeleton,
            Seen {
                picture: Some(&picture),
                outline: Some(&outline),
                ..Seen::default()
            },
            &config,
        )
    };
    let ms = median((0..10).map(|_| timed_ms(all).0).collect());
    let dressed = all();
    let triangles = dressed
        .wood
        .first()
        .map_or(0, |mesh| mesh.indices.len() / 3);
    let of_leaves: usize = dressed
        .foliage
        .groups
        .iter()
        .map(|g| g.mesh.indices.len() / 3)
        .sum();
    let twigs = dressed.limbs.iter().filter(|l| l.twig).count();
    format!(
        "static tree of {triangles} triangles of wood with {twigs} twigs and {of_leaves} of leaves: {ms:.0} ms (must be <= 400)"
    )
}

fn pose(criterion: &mut Criterion) -> String {
    let (log, outline, sets) = gathered();
    let tree = Arc::new(built(&log, &outline));
    let all = || {
        let mut tracker = PoseTracker::new(tree.clone(), &Config::default());
        for set in &sets {
            std::hint::black_box(tracker.step(set));
        }
    };
    criterion.bench_function("poses of 330 frames", |b| b.iter(all));
    let ms = median(
        (0..5)
            .map(|_| timed_ms(all).0 / sets.len() as f64)
            .collect(),
    );
    format!("targets and pose of the recording's tree: {ms:.3} ms a frame (must be <= 0.5)")
}

/// Foot, 127 measured nodes and two copies of all above the trunk.
fn pose_of_127() -> String {
    let skeleton = Arc::new(synthetic::tree(7, 3));
    let truth = synthetic::sway(&skeleton, 330);
    let seen = |pose: &Pose| -> Vec<Option<Point2<f64>>> {
        pose.joints[..skeleton.measured()]
            .iter()
            .map(|j| Some(skeleton.image_from_model(&j.position)))
            .collect()
    };
    let targets: Vec<_> = truth.iter().map(seen).collect();
    let all = || {
        let mut estimator = PoseEstimator::new(skeleton.clone(), &Config::default().motion);
        for (pose, targets) in truth.iter().zip(&targets) {
            std::hint::black_box(estimator.step(pose.frame, pose.time_s, targets));
        }
    };
    let ms = median(
        (0..9)
            .map(|_| timed_ms(all).0 / truth.len() as f64)
            .collect(),
    );
    let (measured, nodes) = (skeleton.measured() - 1, skeleton.nodes.len());
    format!(
        "pose of {measured} measured nodes and {} copies: {ms:.3} ms a frame (must be <= 0.5)",
        nodes - measured - 1
    )
}

/// The model's file of the whole recording, in full leaf.
fn model_file() -> String {
    let (log, outline, sets) = gathered();
    let tree = Arc::new(built(&log, &outline));
    let config = Config::default();
    let mut tracker = PoseTracker::new(tree.clone(), &config);
    let poses: Vec<Pose> = sets.iter().map(|set| tracker.step(set).0).collect();
    let picture = crown_of_noise(&outline);
    let seen = Seen {
        picture: Some(&picture),
        outline: Some(&outline),
        ..Seen::default()
    };
    let dressed = dress(&tree.skeleton, seen, &config);
    let flutter = pipeline::flutter(&dressed, &poses, &tree.skeleton, &config);
    let provenance = serde_json::Value::Null;
    let write = || {
        let model = Model {
            skeleton: &tree.skeleton,
            dressed: &dressed,
            poses: &poses,
            flutter: &flutter,
            level: 0,
            metres_per_px: 0.0,
            tolerance_px: KEY_TOLERANCE_PX,
            node_extras: &[],
            provenance: &provenance,
        };
        glb(&model).expect("a model")
    };
    let ms = median((0..5).map(|_| timed_ms(write).0).collect());
    let (bytes, animation) = write();
    format!(
        "GLB of {} frames and {} joints, in leaf: {ms:.0} ms, {:.2} MB (must be <= 300 and 6); {:.1} % of the keys (must be <= 27)",
        animation.frames,
        tree.skeleton.nodes.len(),
        bytes.len() as f64 / 1e6,
        100.0 * animation.keys as f64 / animation.raw_keys.max(1) as f64
    )
}

/// The program itself, everything included: ffmpeg, decoding, all stages, the capture folder.
fn replay(clip: &Path, dir: &Path) -> String {
    let outline = dir.join("720p.json");
    let corners: Vec<[i32; 2]> = support::outline()
        .polygon_px
        .iter()
        .map(|p| [2 * p.x, 2 * p.y])
        .collect();
    std::fs::write(
        &outline,
        format!(r#"{{"width": 1280, "height": 720, "polygon_px": {corners:?}}}"#),
    )
    .expect("outline");
    let run = |k: usize| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
        command
            .args(["replay", "--fast", "--headless"])
            .arg(clip)
            .arg("--outline")
            .arg(&outline);
        command
            .arg("--out")
            .arg(dir.join(format!("out{k}")))
            .stderr(std::process::Stdio::null());
        let (ms, status) = timed_ms(|| command.status().expect("arborcam"));
        assert!(status.success());
        ms
    };
    let ms = median((0..3).map(run).collect());
    format!(
        "replay: {:.0} frames/s at 1280x720 (must be >= 80)",
        support::recording().len() as f64 / ms * 1e3
    )
}

/// The test's picture and scribbles at 640x480, as large as the figure asks.
fn matting() -> String {
    let load = |name: &str| image::open(Path::new("tests/matting").join(name)).expect("picture");
    let (picture, strokes) = (load("picture.png"), load("scribbles.png"));
    let size = Size::new(640, 480);
    let pixels = picture
        .resize_exact(640, 480, image::imageops::FilterType::CatmullRom)
        .into_rgb8()
        .into_raw();
    let mark = |&shade: &u8| match shade {
        0 => Mark::Background,
        255 => Mark::Tree,
        _ => Mark::Undecided,
    };
    let strokes = strokes
        .resize_exact(640, 480, image::imageops::FilterType::Nearest)
        .into_luma8();
    let scribbles = Scribbles {
        name: String::new(),
        size,
        marks: strokes.as_raw().iter().map(mark).collect(),
    };
    let picture = Rgb { size, pixels };
    let ms = (0..5)
        .map(|_| timed_ms(|| outline::alpha(&picture, &scribbles).expect("a matte")).0)
        .fold(f64::MAX, f64::min);
    format!("scribbles on a 640x480 picture solved: {ms:.0} ms (must be <= 1500)")
}

/// A hundred trees in a gale, frame after frame, on this core.
fn animation() -> String {
    let skeleton = Arc::new(synthetic::tree(7, 1));
    let branches = skeleton.nodes.len() - 1;
    let tree = |seed: u32| {
        let wind = config::Wind {
            force: 8.0,
            seed,
            ..config::Wind::default()
        };
        let mut animator =
            Animator::new(skeleton.clone(), &[], &wind, Wind::new(&wind, 128.0, 0.03));
        animator.warm_up();
        animator
    };
    let mut trees: Vec<Animator> = (0..100).map(tree).collect();
    let mut frame = || {
        for tree in &mut trees {
            tree.advance(1.0 / 60.0);
            std::hint::black_box(tree.pose(0));
        }
    };
    let ms = median((0..200).map(|_| timed_ms(&mut frame).0).collect());
    format!(
        "animation: a frame of 100 trees of {branches} branches in {ms:.1} ms (must be <= 16.7); {:.0} frames/s",
        1e3 / ms
    )
}

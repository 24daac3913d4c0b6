//! A tree from points of your own, with the core alone:
//!
//! ```text
//! cargo run --release --no-default-features --example tree_from_tracks
//! ```
//!
//! All that is needed are the positions of points on a swaying plant, frame by frame, from any
//! tracker, and a mask of the region in which the plant stands. The points here are made up: a
//! trunk with four branches, each of which swings about its base at a frequency of its own, while
//! the trunk bends and takes all of them along.

use arborcam::cancel::CancelToken;
use arborcam::config::Config;
use arborcam::model::{Observation, Outline, Size, Skeleton, TrackId, TrackLog, TrackSet};
use arborcam::solve::solve;
use nalgebra::{Point2, Rotation2, Vector2};
use std::f64::consts::TAU;
use std::process::ExitCode;
use std::sync::Arc;

const SIZE: Size = Size {
    width: 640,
    height: 480,
};
/// The trunk, u and v in px: v grows downwards.
const FOOT: Point2<f64> = Point2::new(320.0, 450.0);
const TRUNK_LENGTH_PX: f64 = 250.0;
/// Sway of the trunk's top to either side, and its frequency.
const TRUNK_SWAY_PX: f64 = 6.0;
const TRUNK_HZ: f64 = 0.4;
/// Largest angle of a branch to either side of its rest, radians.
const SWING: f64 = 0.06;
const POINTS_PER_LIMB: usize = 25;
/// The outline is as far from the points as this, px.
const MARGIN_PX: f64 = 14.0;
const FRAME_RATE_HZ: f64 = 30.0;
const DURATION_S: f64 = 15.0;

/// A straight branch that swings about its base.
struct Branch {
    base: Point2<f64>,
    tip: Vector2<f64>,
    frequency_hz: f64,
}

impl Branch {
    /// A branch from the trunk at `height_px` above the foot; `tip` is seen from there, px.
    fn new(height_px: f64, tip: Vector2<f64>, frequency_hz: f64) -> Self {
        Self {
            base: FOOT - Vector2::new(0.0, height_px),
            tip,
            frequency_hz,
        }
    }
}

/// A point on the plant: where it is at rest, and the branch that it is on (`None`: the trunk).
struct PlantPoint {
    rest: Point2<f64>,
    branch: Option<usize>,
}

fn main() -> ExitCode {
    let branches = branches();
    let points = points(&branches);
    let outline = Arc::new(outline(&points));

    let config = Config::default();
    let mut log = TrackLog::new(config.accumulate.window_s);
    let n_frames = (DURATION_S * FRAME_RATE_HZ) as u64;
    for frame in 0..n_frames {
        log.push(tracks(&points, &branches, frame));
    }

    match solve(&log, &outline, None, &config, &CancelToken::new()) {
        Some(tree) => {
            print_nodes(&tree.skeleton);
            ExitCode::SUCCESS
        }
        None => {
            eprintln!("no tree: too few points moved, or they moved too little");
            ExitCode::FAILURE
        }
    }
}

fn branches() -> [Branch; 4] {
    [
        Branch::new(140.0, Vector2::new(-130.0, -70.0), 0.9),
        Branch::new(170.0, Vector2::new(140.0, -90.0), 1.15),
        Branch::new(TRUNK_LENGTH_PX, Vector2::new(-80.0, -130.0), 1.45),
        Branch::new(TRUNK_LENGTH_PX, Vector2::new(90.0, -120.0), 1.8),
    ]
}

/// Points along the trunk and along every branch, a little to the side of its axis in turn.
fn points(branches: &[Branch]) -> Vec<PlantPoint> {
    let trunk = Vector2::new(0.0, -TRUNK_LENGTH_PX);
    let mut points = Vec::new();
    for i in 0..POINTS_PER_LIMB {
        let share = (i + 1) as f64 / POINTS_PER_LIMB as f64;
        let aside = Vector2::new(2.0, 1.0) * (i % 3) as f64;
        points.push(PlantPoint {
            rest: FOOT + trunk * share + aside,
            branch: None,
        });
        for (k, branch) in branches.iter().enumerate() {
            points.push(PlantPoint {
                rest: branch.base + branch.tip * share + aside,
                branch: Some(k),
            });
        }
    }
    points
}

/// What a tracker would tell of one frame. The number of a point is its name in all frames.
fn tracks(points: &[PlantPoint], branches: &[Branch], frame: u64) -> TrackSet {
    let time_s = frame as f64 / FRAME_RATE_HZ;
    let mut observations = Vec::with_capacity(points.len());
    for (id, point) in points.iter().enumerate() {
        let at = position(point, branches, time_s);
        observations.push(Observation {
            id: TrackId(id as u32),
            u_px: at.x as f32,
            v_px: at.y as f32,
            fb_error_px: 0.05,
            error_px: None,
            confirmed: true,
            depth: None,
        });
    }
    TrackSet {
        frame,
        time_s,
        observations,
        ..TrackSet::default()
    }
}

fn position(point: &PlantPoint, branches: &[Branch], time_s: f64) -> Point2<f64> {
    let Some(branch) = point.branch.map(|k| &branches[k]) else {
        return point.rest + trunk_sway(&point.rest, time_s);
    };
    let swing = SWING * (TAU * branch.frequency_hz * time_s).sin();
    let turned = branch.base + Rotation2::new(swing) * (point.rest - branch.base);
    turned + trunk_sway(&branch.base, time_s)
}

/// How far the trunk has moved at the height of `place`: it bends as a beam that is held at its
/// foot.
fn trunk_sway(place: &Point2<f64>, time_s: f64) -> Vector2<f64> {
    let height = (FOOT.y - place.y) / TRUNK_LENGTH_PX;
    let sway_px = TRUNK_SWAY_PX * height * height * (TAU * TRUNK_HZ * time_s).sin();
    Vector2::new(sway_px, 0.0)
}

/// All pixels near a point.
fn outline(points: &[PlantPoint]) -> Outline {
    let mut mask = vec![0; SIZE.area()];
    for (i, pixel) in mask.iter_mut().enumerate() {
        let i = i as u32;
        let at = Point2::new(f64::from(i % SIZE.width), f64::from(i / SIZE.width));
        if points
            .iter()
            .any(|p| nalgebra::distance(&p.rest, &at) <= MARGIN_PX)
        {
            *pixel = u8::MAX;
        }
    }
    Outline {
        size: SIZE,
        mask,
        // Only for drawing.
        polygon_px: Vec::new(),
        matte: None,
        other_foot_px: None,
    }
}

fn print_nodes(skeleton: &Skeleton) {
    println!("node  parent  x_px    y_px    z_px    radius_px  kind");
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let parent = node.parent.map_or("-".to_owned(), |p| p.0.to_string());
        let kind = if node.copy_of.is_some() {
            "copy"
        } else {
            "measured"
        };
        println!(
            "{i:<4}  {parent:<6}  {:<6.1}  {:<6.1}  {:<6.1}  {:<9.1}  {kind}",
            node.position.x, node.position.y, node.position.z, node.radius
        );
    }
}

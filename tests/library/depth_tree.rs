//! A tree in space from points whose depth is known: its branches at rest, its pose, its scale.

use crate::chance::Chance;
use arborcam::cancel::CancelToken;
use arborcam::config::{Config, Depth};
use arborcam::model::{DepthSeen, NodeId, Observation, Outline, Size, TrackId, TrackLog, TrackSet};
use arborcam::outline::from_polygon;
use arborcam::pipeline::PoseTracker;
use arborcam::solve::{Model, solve};
use nalgebra::{Point2, Point3, Rotation3, Vector3};
use std::f64::consts::TAU;
use std::sync::Arc;

const SIZE: Size = Size {
    width: 640,
    height: 480,
};
/// The trunk's foot, px, and its distance from the camera, m.
const FOOT: Point2<f64> = Point2::new(320.0, 450.0);
const FOOT_M: f64 = 2.5;
const FOCAL_PX: f64 = 500.0;
const METRES_PER_PX: f64 = FOOT_M / FOCAL_PX;
const TRUNK_PX: f64 = 250.0;
const TRUNK_HZ: f64 = 0.4;
const POINTS_PER_LIMB: usize = 25;
const FRAME_RATE_HZ: f64 = 30.0;
const FRAMES: u64 = 450;
/// How far a branch turns to either side about its base, in the picture and in depth, radians.
const SWING: f64 = 0.06;
/// Deviation of a depth, m.
const NOISE_M: f64 = 0.006;

/// A straight branch, model axes, px.
struct Branch {
    base: Point3<f64>,
    tip: Vector3<f64>,
    frequency_hz: f64,
}

/// Two to each side, one of each towards the viewer.
fn branches() -> [Branch; 4] {
    let branch = |height, tip: [f64; 3], frequency_hz| Branch {
        base: Point3::new(0.0, height, 0.0),
        tip: Vector3::from(tip),
        frequency_hz,
    };
    [
        branch(140.0, [-130.0, 70.0, 90.0], 0.9),
        branch(170.0, [140.0, 90.0, -80.0], 1.15),
        branch(TRUNK_PX, [-80.0, 130.0, -60.0], 1.45),
        branch(TRUNK_PX, [90.0, 120.0, 70.0], 1.8),
    ]
}

/// A point: where it is at rest, and the branch that it is on (`None`: the trunk).
struct TreePoint {
    rest: Point3<f64>,
    branch: Option<usize>,
}

fn points() -> Vec<TreePoint> {
    let mut points = Vec::new();
    for i in 0..POINTS_PER_LIMB {
        let share = (i + 1) as f64 / POINTS_PER_LIMB as f64;
        let aside = Vector3::new(2.0, -1.0, 0.0) * (i % 3) as f64;
        points.push(TreePoint {
            rest: Point3::new(0.0, TRUNK_PX * share, 0.0) + aside,
            branch: None,
        });
        for (k, branch) in branches().iter().enumerate() {
            points.push(TreePoint {
                rest: branch.base + branch.tip * share + aside,
                branch: Some(k),
            });
        }
    }
    points
}

/// The place of a branch at rest that is nearest to another one in the picture.
fn nearest_on(branch: &Branch, place: &Point3<f64>) -> Point3<f64> {
    let (along, way) = (branch.tip.xy(), place.xy() - branch.base.xy());
    branch.base + branch.tip * (way.dot(&along) / along.norm_squared())
}

/// How far the trunk has moved at this height.
fn trunk_sway(height: f64, time_s: f64) -> Vector3<f64> {
    let share = height / TRUNK_PX;
    Vector3::x() * (6.0 * share * share * (TAU * TRUNK_HZ * time_s).sin())
}

/// Where a place of a branch is.
fn on_branch(branch: &Branch, rest: Point3<f64>, time_s: f64) -> Point3<f64> {
    let swing = SWING * (TAU * branch.frequency_hz * time_s).sin();
    // As much to the viewer and away as in the picture.
    let axis = nalgebra::Unit::new_normalize(Vector3::new(0.0, 1.0, 1.0));
    let turned = Rotation3::from_axis_angle(&axis, swing) * (rest - branch.base);
    branch.base + turned + trunk_sway(branch.base.y, time_s)
}

fn place(point: &TreePoint, time_s: f64) -> Point3<f64> {
    match point.branch {
        None => point.rest + trunk_sway(point.rest.y, time_s),
        Some(k) => on_branch(&branches()[k], point.rest, time_s),
    }
}

/// What is seen of one frame; one depth in ten is missing, and one in fifty is wrong.
fn set(points: &[TreePoint], frame: u64, has_depth: bool) -> TrackSet {
    let time_s = frame as f64 / FRAME_RATE_HZ;
    let mut chance = Chance::new(47_900 + frame);
    let mut observations = Vec::new();
    for (id, point) in points.iter().enumerate() {
        let at = place(point, time_s);
        let noise = chance.normal();
        let (missing, wrong) = (chance.even() < 0.1, chance.even() < 0.02);
        let behind_m = if wrong { 1.5 } else { 0.0 };
        let depth_m = FOOT_M - at.z * METRES_PER_PX + NOISE_M * noise + behind_m;
        observations.push(Observation {
            id: TrackId(id as u32),
            u_px: (FOOT.x + at.x) as f32,
            v_px: (FOOT.y - at.y) as f32,
            fb_error_px: 0.05,
            error_px: None,
            confirmed: true,
            depth: (has_depth && !missing).then_some(DepthSeen {
                depth_m: depth_m as f32,
                sd_m: NOISE_M as f32,
            }),
        });
    }
    TrackSet {
        frame,
        time_s,
        observations,
        ..TrackSet::default()
    }
}

fn outline() -> Arc<Outline> {
    let corners = [
        [290.0, 460.0],
        [350.0, 460.0],
        [480.0, 180.0],
        [430.0, 60.0],
        [220.0, 60.0],
        [170.0, 210.0],
    ];
    let outline = from_polygon(&corners.map(Point2::from), SIZE).expect("outline");
    Arc::new(outline)
}

fn config() -> Config {
    let mut config = Config::default();
    config.depth = Depth {
        unit_m: 0.001,
        fx_px: FOCAL_PX,
        fy_px: FOCAL_PX,
        cx_px: 319.5,
        cy_px: 239.5,
        ..config.depth
    };
    config
}

fn model(has_depth: bool, config: &Config) -> Model {
    let points = points();
    let mut log = TrackLog::new(config.accumulate.window_s);
    for frame in 0..FRAMES {
        log.push(set(&points, frame, has_depth));
    }
    solve(&log, &outline(), None, config, &CancelToken::new()).expect("a tree")
}

/// The measured node nearest to the tip of each branch in the picture.
fn tips(model: &Model) -> Vec<NodeId> {
    let skeleton = &model.skeleton;
    let mut tips = Vec::new();
    for branch in branches() {
        let tip = branch.base + branch.tip;
        let off = |k: &usize| (skeleton.nodes[*k].position.xy() - tip.xy()).norm();
        let nearest = (1..skeleton.measured()).min_by(|a, b| off(a).total_cmp(&off(b)));
        let nearest = nearest.expect("a node");
        assert!(off(&nearest) < 15.0, "no node at {tip}");
        tips.push(NodeId(nearest as u32));
    }
    tips
}

#[test]
fn branches_are_where_they_are_seen_and_the_scale_is_known() {
    let model = model(true, &config());
    let depths = model.depths.as_ref().expect("depth");
    // The lowest points do not move and are not on the tree: the foot is carried on from above.
    let off = depths.metres_per_px / METRES_PER_PX - 1.0;
    assert!(off.abs() < 0.005, "{off}, {} m", depths.foot_m);
    assert!((depths.foot_m / FOOT_M - 1.0 - off).abs() < 1e-9);
    for (tip, branch) in tips(&model).into_iter().zip(branches()) {
        let z = model.skeleton.nodes[tip.index()].position.z;
        assert!(
            (z - branch.tip.z).abs() < 6.0,
            "{z} px for {}",
            branch.tip.z
        );
    }
}

#[test]
fn the_pose_follows_what_comes_nearer_and_goes_away() {
    let config = config();
    let model = Arc::new(model(true, &config));
    let (tips, points) = (tips(&model), points());
    let mut with = PoseTracker::new(model.clone(), &config);
    let mut without = PoseTracker::new(model.clone(), &config);
    let mut off_px = [Vec::new(), Vec::new()];
    for frame in 0..FRAMES {
        let time_s = frame as f64 / FRAME_RATE_HZ;
        let poses = [
            with.step(&set(&points, frame, true)).0,
            without.step(&set(&points, frame, false)).0,
        ];
        for (off_px, pose) in off_px.iter_mut().zip(&poses) {
            for (tip, branch) in tips.iter().zip(branches()) {
                let at_rest = nearest_on(&branch, &model.skeleton.nodes[tip.index()].position);
                let true_z = on_branch(&branch, at_rest, time_s).z;
                off_px.push((pose.joints[tip.index()].position.z - true_z).abs());
            }
        }
    }
    let [with_px, without_px] = off_px.map(|mut off_px| {
        off_px.sort_by(f64::total_cmp);
        off_px[off_px.len() / 2]
    });
    println!("in depth the tips are off by {with_px:.2} px with depth, {without_px:.2} px without");
    // The tips swing by up to 10 px in depth.
    assert!(with_px < 4.0, "{with_px}");
    assert!(with_px < 0.7 * without_px, "{with_px} and {without_px}");
}

/// The same points without depth, whatever the settings say of a camera.
#[test]
fn without_depth_the_tree_is_the_one_that_it_was() {
    let (plain, no_depth) = (model(false, &Config::default()), model(false, &config()));
    assert!(no_depth.depths.is_none());
    assert_eq!(plain.skeleton, no_depth.skeleton);
    let seen = model(true, &Config::default());
    assert_eq!(plain.skeleton, seen.skeleton);
}

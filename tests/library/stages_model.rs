//! From tracks to tree and pose, on motion and shapes that are known.

use crate::trees;
use arborcam::config;
use arborcam::hierarchy;
use arborcam::model::TrackTable;
use arborcam::model::{
    Cluster, ClusterId, Foot, MotionHierarchy, Outline, Size, Skeleton, TrackId,
};
use arborcam::motion::{PoseEstimator, Problem, SightLine, deterministic_direction};
use arborcam::shape::{self, Envelope, Terms};
use arborcam::skeleton::{self, Node2d};
use nalgebra::{Point2, Point3, Rotation3, Unit, UnitQuaternion, Vector2, Vector3, distance};
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::sync::Arc;

const SIZE: Size = Size {
    width: 200,
    height: 240,
};

/// A crown on a trunk whose foot is at (100, 230).
fn outline() -> Outline {
    let crown = [
        [95.0, 230.0],
        [105.0, 230.0],
        [105.0, 150.0],
        [170.0, 100.0],
        [130.0, 20.0],
        [70.0, 20.0],
        [30.0, 100.0],
        [95.0, 150.0],
    ]
    .map(Point2::from);
    arborcam::outline::from_polygon(&crown, SIZE).expect("outline")
}

/// Where point `i` of [`pendulums`] is.
fn pendulum_px(i: usize, time_s: f64) -> Point2<f32> {
    let (column, row) = (i % 10 % 5, i / 10);
    let left = Point2::new(
        60.0 + 8.0 * column as f64,
        60.0 + 12.0 * (row % 2) as f64 + 6.0 * (i % 2) as f64,
    );
    let (rest, hz) = match row {
        0 | 1 => (left, 1.1),
        2 | 3 => (left + Vector2::new(60.0, 0.0), 1.6),
        _ => (Point2::new(100.0, 40.0 + 8.0 * (i % 10) as f64), 0.0),
    };
    let u = rest.x + 5.0 * (TAU * hz * time_s).sin();
    Point2::new(u as f32, rest.y as f32)
}

/// Two pendulums side by side, of 1.1 and 1.6 Hz, 20 points each, and 10 points between them that
/// stand still.
fn pendulums() -> TrackTable {
    let times_s: Vec<f64> = (0..90).map(|k| f64::from(k) / 15.0).collect();
    TrackTable {
        ids: (0..50).map(TrackId).collect(),
        positions: (0..50)
            .map(|i| times_s.iter().map(|&t| Some(pendulum_px(i, t))).collect())
            .collect(),
        fb_errors_px: vec![0.02; 50],
        times_s: times_s.clone(),
    }
}

/// The pendulums that a cluster has points of.
fn sides(c: &Cluster) -> BTreeSet<u32> {
    c.members.iter().map(|id| id.0 / 20).collect()
}

#[test]
fn what_moves_differently_is_cut_apart_and_what_stands_still_takes_no_part() {
    let table = pendulums();
    let evidence = hierarchy::evidence(&table, &config::Accumulate::default());
    assert_eq!(
        evidence.moving,
        (0..40).collect::<Vec<usize>>(),
        "the still points are told apart"
    );
    let tree = hierarchy::build(
        &table,
        &evidence.moving,
        Point2::new(100.0, 230.0),
        &config::Hierarchy::default(),
    );
    let first: Vec<&Cluster> = tree.clusters.iter().filter(|c| c.level == 1).collect();
    assert_eq!(first.len(), 2);
    assert!(
        first.iter().all(|c| sides(c).len() == 1),
        "the first cut goes between the pendulums: {first:?}"
    );
    for (k, c) in tree.clusters.iter().enumerate().skip(1) {
        let parent = c.parent.expect("a parent");
        assert!((parent.0 as usize) < k && tree.clusters[parent.0 as usize].level + 1 == c.level);
        assert!(
            c.members
                .iter()
                .all(|id| tree.clusters[parent.0 as usize].members.contains(id)),
            "cluster {k}"
        );
    }
}

fn cluster(parent: Option<u32>, level: u8, centroid_px: Point2<f64>) -> Cluster {
    Cluster {
        parent: parent.map(ClusterId),
        level,
        members: vec![TrackId(0), TrackId(1)],
        centroid_px,
        end_px: None,
        certainty: 1.0,
    }
}

/// Trunk, two main branches, two twigs on each.
fn hierarchy_of_seven() -> MotionHierarchy {
    MotionHierarchy {
        clusters: vec![
            cluster(None, 0, Point2::new(100.0, 130.0)),
            cluster(Some(0), 1, Point2::new(70.0, 90.0)),
            cluster(Some(0), 1, Point2::new(130.0, 90.0)),
            cluster(Some(1), 2, Point2::new(55.0, 70.0)),
            cluster(Some(1), 2, Point2::new(85.0, 60.0)),
            cluster(Some(2), 2, Point2::new(120.0, 50.0)),
            cluster(Some(2), 2, Point2::new(150.0, 85.0)),
        ],
    }
}

fn flat() -> Vec<Node2d> {
    skeleton::build(
        &hierarchy_of_seven(),
        Foot::of(&outline(), Some(100.0)).position_px,
        &config::Skeleton::default(),
    )
}

#[test]
fn the_skeleton_is_folded_by_two_fifths_and_stands_on_the_foot() {
    let nodes = flat();
    assert_eq!(nodes.len(), 8);
    let expected = [
        [100.0, 230.0],
        // Root to tip, towards the parent where that has gone: 130 + 0.4 * (230 - 130) = 170.
        [100.0, 170.0],
        [82.0, 122.0],
        [118.0, 122.0],
        // Tips stay, lest the tree shrinks.
        [55.0, 70.0],
    ];
    for (i, at) in expected.into_iter().enumerate() {
        let p = nodes[i].position_px;
        assert!(
            distance(&p, &at.into()) < 1e-9,
            "node {i} is at {p:?} and not at {at:?}"
        );
    }
    assert!(
        nodes
            .iter()
            .skip(1)
            .all(|n| n.parent.is_some_and(|p| nodes[p].level + 1 == n.level))
    );
}

fn built() -> Skeleton {
    let tracks = trees::carried(&flat());
    let mut tree = shape::build(&flat(), &tracks, &outline(), &config::Shape::default());
    shape::thicken(&mut tree, 5.0, &|_, _| true, &config::Wood::default(), 1);
    tree
}

#[test]
fn the_tree_in_space_stays_in_its_envelope_on_one_trunk() {
    let (tree, settings) = (built(), config::Shape::default());
    let envelope = Envelope::of_revolution(&outline(), tree.foot_px);
    for (i, node) in tree.nodes.iter().enumerate() {
        assert!(
            envelope.contains(&node.position),
            "node {i} at {} is outside",
            node.position
        );
    }
    let trunk: Vec<&arborcam::model::Node> = tree.nodes.iter().filter(|n| n.level < 2).collect();
    assert!(
        trunk.len() == 2 && trunk.iter().all(|n| n.copy_of.is_none()),
        "one trunk"
    );
    // Two more planes of all that is above it.
    assert_eq!((tree.measured(), tree.nodes.len()), (8, 8 + 2 * 6));
    assert!(
        tree.nodes.iter().any(|n| n.position.z.abs() > 5.0),
        "it is not flat"
    );
    assert!(tree.nodes.iter().all(|n| {
        n.parent
            .is_none_or(|p| tree.nodes[p.index()].radius >= n.radius)
    }));
    assert!(
        (200..=300).contains(&settings.attractors),
        "as in the paper"
    );
}

#[test]
fn attractors_lie_on_the_surface() {
    let foot = Foot::of(&outline(), None).position_px;
    let envelope = Envelope::of_revolution(&outline(), foot);
    let points = envelope.attractors(256);
    assert_eq!(points.len(), 256);
    for p in &points {
        let row = outline().size.width as usize * (foot.y - p.y).round() as usize;
        let inside: Vec<usize> = (0..SIZE.width as usize)
            .filter(|u| outline().mask[row + u] != 0)
            .collect();
        let (left, right) = (inside[0] as f64, inside[inside.len() - 1] as f64);
        let (centre, radius) = ((left + right) / 2.0 - foot.x, (right - left + 1.0) / 2.0);
        assert!(
            ((p.x - centre).hypot(p.z) - radius).abs() < 1e-6,
            "{p} is not on a circle of {radius}"
        );
    }
    // All around, and not only in front.
    for side in [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]] {
        assert!(
            points
                .iter()
                .filter(|p| p.x * side[0] + p.z * side[1] > 5.0)
                .count()
                > 40,
            "{side:?}"
        );
    }
}

/// A stem that only twigs leave is the trunk as far as it carries more than half of all points.
#[test]
fn the_trunk_goes_on_in_what_carries_most() {
    let trunk_of = |carried: [u32; 8]| shape::trunk(&flat(), &carried, config::Leader::None, &[]);
    let forked = trunk_of([16, 16, 8, 8, 4, 4, 4, 4]);
    assert_eq!(forked.iter().filter(|is| **is).count(), 2, "{forked:?}");
    let stem = trunk_of([16, 16, 14, 2, 9, 5, 1, 1]);
    let on = [true, true, true, false, true, false, false, false];
    assert_eq!(stem, on);
    // What no points are known of has no stem but the lowest.
    assert_eq!(trunk_of([0; 8]), forked);
}

#[test]
fn pushing_brings_the_tree_nearer_to_its_envelope() {
    let (settings, outline) = (config::Shape::default(), outline());
    let foot_px = Foot::of(&outline, None).position_px;
    let envelope = Envelope::of_revolution(&outline, foot_px);
    let tracks = trees::carried(&flat());
    let trunk = shape::trunk(&flat(), &tracks, config::Leader::None, &[]);
    let prototype = shape::copy_to_planes(
        &flat(),
        &tracks,
        &trunk,
        &outline,
        &envelope,
        settings.planes,
    );
    let attractors = settings.attractors as usize;
    let before = shape::envelope_distance(&prototype, &envelope, attractors);
    for terms in [
        Terms::Both {
            weight: 1.0,
            gain_floor: 0.02,
            spread_first: false,
        },
        Terms::Global,
    ] {
        let mut pushed = prototype.clone();
        shape::push(&mut pushed, &trunk, &envelope, &settings, terms);
        let after = shape::envelope_distance(&pushed, &envelope, attractors);
        assert!(after < before, "{terms:?}");
    }
}

/// Where the nodes would be seen if each main branch of the built tree were turned by `angle` about
/// `axis`.
fn swung(tree: &Skeleton, axis: Vector3<f64>, angle: f64) -> Vec<Point3<f64>> {
    let turn = Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle);
    let top = tree.nodes[1].position;
    let mut places = Vec::new();
    for node in &tree.nodes[..tree.measured()] {
        places.push(if node.level < 2 {
            node.position
        } else {
            top + turn * (node.position - top)
        });
    }
    places
}

fn seen(tree: &Skeleton, at: &[Point3<f64>]) -> Vec<Option<Point2<f64>>> {
    at.iter().map(|p| Some(tree.image_from_model(p))).collect()
}

fn settings(method: config::MotionMethod) -> config::Motion {
    config::Motion {
        method,
        ..config::Motion::default()
    }
}

/// Where node `i` is seen in frame `k`, if it is: jumping about, and missing in every fifth.
fn wild_px(tree: &Skeleton, i: usize, k: u64) -> Option<Point2<f64>> {
    let off = Vector2::new(1.3, 2.1).map(|a| 60.0 * (i as f64 * 3.7 + k as f64 * a).sin());
    let at = tree.image_from_model(&tree.nodes[i].position);
    (!(i as u64 + k).is_multiple_of(5)).then_some(at + off)
}

#[test]
fn branches_keep_their_lengths_whatever_is_seen() {
    let tree = Arc::new(built());
    for method in [
        config::MotionMethod::Probabilistic,
        config::MotionMethod::Deterministic,
    ] {
        let mut estimator = PoseEstimator::new(tree.clone(), &settings(method));
        for k in 0..40u64 {
            let targets: Vec<_> = (0..tree.measured()).map(|i| wild_px(&tree, i, k)).collect();
            let pose = estimator.step(k, k as f64 / 30.0, &targets);
            for i in 1..tree.nodes.len() {
                let parent = tree.nodes[i].parent.expect("a parent").index();
                let is = (pose.joints[i].position - pose.joints[parent].position).norm();
                let was = (tree.nodes[i].position - tree.nodes[parent].position).norm();
                assert!(
                    (is - was).abs() < 1e-6 * was.max(1.0),
                    "{method:?}, frame {k}, branch {i}: {was} became {is}"
                );
            }
        }
    }
}

#[test]
fn no_motion_is_the_rest_pose() {
    let tree = Arc::new(built());
    let mut estimator =
        PoseEstimator::new(tree.clone(), &settings(config::MotionMethod::Probabilistic));
    let targets = seen(&tree, &swung(&tree, Vector3::y(), 0.0));
    for k in 0..5 {
        for (joint, node) in estimator
            .step(k, 0.0, &targets)
            .joints
            .iter()
            .zip(&tree.nodes)
        {
            assert!(
                (joint.position - node.position).norm() < 1e-3,
                "{} became {}",
                node.position,
                joint.position
            );
        }
    }
}

/// The same, pushed as in the paper, which brings its main branches before the trunk. (Of a branch
/// behind it the picture cannot tell whether it swings forward or further back.)
fn leaning() -> Skeleton {
    let settings = config::Shape {
        passes: 1,
        push_options: 21,
        ..config::Shape::default()
    };
    let mut prototype =
        shape::Prototype::of(&flat(), &trees::carried(&flat()), &outline(), &settings);
    let papers = Terms::Both {
        weight: 1.0,
        gain_floor: 0.0,
        spread_first: false,
    };
    shape::push(
        &mut prototype.skeleton,
        &prototype.trunk,
        &prototype.envelope,
        &settings,
        papers,
    );
    prototype.skeleton
}

/// A swing towards the camera shortens a branch in the picture; its depth is recovered from that.
#[test]
fn a_swing_towards_the_camera_is_recovered() {
    let tree = Arc::new(leaning());
    let mut estimator =
        PoseEstimator::new(tree.clone(), &settings(config::MotionMethod::Probabilistic));
    for k in 0..=20u64 {
        let truth = swung(&tree, Vector3::x(), 0.5 * (TAU * k as f64 / 80.0).sin());
        let pose = estimator.step(k, k as f64 / 30.0, &seen(&tree, &truth));
        if k == 20 {
            for i in (1..tree.measured()).filter(|&i| tree.nodes[i].level == 2) {
                let rest = tree.nodes[i].position.z;
                let (found, true_depth) = (pose.joints[i].position.z - rest, truth[i].z - rest);
                assert!(
                    true_depth > 10.0 && (found / true_depth - 1.0).abs() < 0.4,
                    "node {i}: {found:.1} of {true_depth:.1} px"
                );
            }
        }
    }
}

fn problem(target: Option<Vector2<f64>>) -> Problem {
    Problem {
        parent_rotation: UnitQuaternion::identity(),
        length: 50.0,
        target,
        parent_direction: Some(Vector3::y_axis()),
        rest_direction: Vector3::y_axis(),
        previous_direction: Vector3::y_axis(),
        sigma_track_px: 1.0,
        sigma_shape: 0.3,
        sigma_depth: None,
        sigma_lean: None,
        sigma_turn: None,
        max_step: 0.2,
        max_total: 0.5,
        depth: None,
    }
}

#[test]
fn a_branch_turns_no_further_than_its_bounds() {
    for target in [
        Vector2::new(50.0, 0.0),
        Vector2::new(-50.0, 0.0),
        Vector2::new(30.0, 40.0),
        Vector2::new(0.0, -50.0),
        Vector2::new(500.0, 500.0),
    ] {
        let mut p = problem(Some(target));
        for step in 0..10 {
            let d = p.solve();
            assert!(
                p.previous_direction.angle(&d) <= p.max_step + 1e-6,
                "{target:?}, step {step}"
            );
            assert!(
                p.rest_direction.angle(&d) <= p.max_total + 1e-6,
                "{target:?}, step {step}"
            );
            p.previous_direction = d;
        }
        let turned = p.rest_direction.angle(&p.previous_direction);
        assert!(
            target.x == 0.0 || turned > 0.4,
            "{target:?}: it must try to get there, and turned by {turned}"
        );
    }
    let kept = problem(None).solve();
    assert!(
        kept.angle(&Vector3::y_axis()) < 1e-9,
        "what is not seen keeps its angle"
    );
}

#[test]
fn a_target_out_of_reach_is_shifted_until_the_branch_reaches_it() {
    let (root, now) = (Point3::new(10.0, 20.0, 5.0), Point3::new(10.0, 50.0, 45.0));
    for target in [
        Point2::new(30.0, 40.0),
        Point2::new(200.0, 20.0),
        Point2::new(-300.0, 900.0),
        Point2::new(10.0, 20.0),
        Point2::new(60.0, 20.0),
    ] {
        let seen = SightLine {
            target_px: target,
            sd_px: 1.0,
            depth: None,
        };
        let d = deterministic_direction(&root, 50.0, &now, seen);
        let end = root + d.into_inner() * 50.0;
        let wanted = target - root.xy();
        let off = distance(&end.xy(), &target);
        if wanted.x.hypot(wanted.y) <= 50.0 {
            assert!(off < 1e-6, "{target:?} is within reach: {end}");
            assert!(
                end.z >= root.z,
                "of two solutions the nearer to where it was"
            );
        } else {
            // On the silhouette, on the way from where it was seen to the target.
            assert!((end.z - root.z).abs() < 1e-3, "{target:?}: {end}");
            let way = target - now.xy();
            let off_line = way.perp(&(end.xy() - now.xy())) / way.x.hypot(way.y);
            assert!(
                off_line.abs() < 1e-6,
                "{target:?}: {off_line} px off the way"
            );
        }
    }
}

//! Poses from noisy tracks: the probabilistic way against the deterministic one, on a made-up tree
//! whose motion is known.

use crate::chance::Chance;
use arborcam::config::{Motion, MotionMethod};
use arborcam::model::{
    Cluster, ClusterId, JointPose, MotionHierarchy, Node, NodeId, NodeName, Observation, Pose,
    Size, Skeleton, TrackId, TrackSet,
};
use arborcam::motion::{Binding, PoseEstimator};
use nalgebra::{Point2, Point3, UnitQuaternion, Vector2, Vector3, distance_squared};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Arc;

const FRAMES: usize = 240;
const LEVELS: u8 = 5;
/// Points that are followed on each branch.
const POINTS: usize = 4;
/// Share of the observations that are missing.
const MISSING: f64 = 0.3;

fn node(k: usize, parent: Option<usize>, level: u8, position: Point3<f64>) -> Node {
    Node {
        name: NodeName(k as u32),
        parent: parent.map(|p| NodeId(p as u32)),
        level,
        position,
        radius: 1.0,
        n_tracks: POINTS as u32,
        certainty: 1.0,
        copy_of: None,
        plane_angle: 0.0,
        moves_with: None,
        kind: Default::default(),
    }
}

/// Foot, trunk, and two branches at every node up to level [`LEVELS`]: 32 nodes, all measured.
fn tree() -> Skeleton {
    let mut chance = Chance::new(3);
    let mut nodes = vec![
        node(0, None, 0, Point3::origin()),
        node(1, Some(0), 1, Point3::new(3.0, 90.0, 0.0)),
    ];
    let mut i = 1;
    while i < nodes.len() {
        let (level, at) = (nodes[i].level, nodes[i].position);
        let way = (at - nodes[nodes[i].parent.unwrap().index()].position).normalize();
        for side in [-1.0, 1.0].into_iter().filter(|_| level < LEVELS) {
            let lean = way.x.atan2(way.y) + side * (0.45 + 0.15 * chance.even());
            let length = 60.0 * 0.8_f64.powi(i32::from(level) - 1) * (0.9 + 0.2 * chance.even());
            let depth = 0.9 * (chance.even() - 0.5);
            let step = Vector3::new(
                lean.sin() * depth.cos(),
                lean.cos() * depth.cos(),
                depth.sin(),
            ) * length;
            nodes.push(node(nodes.len(), Some(i), level + 1, at + step));
        }
        i += 1;
    }
    Skeleton {
        nodes,
        foot_px: [320.0, 340.0].into(),
        image_size: Size::new(640, 360),
    }
}

/// Every branch sways against its parent, in the picture and towards the viewer.
fn moved(tree: &Skeleton, frame: usize) -> Pose {
    let time_s = frame as f64 / 30.0;
    let mut joints: Vec<JointPose> = Vec::new();
    for (i, node) in tree.nodes.iter().enumerate() {
        let Some(parent) = node.parent.map(NodeId::index) else {
            joints.push(JointPose {
                position: node.position,
                rotation: UnitQuaternion::identity(),
            });
            continue;
        };
        let level = f64::from(node.level);
        let [sway_x, sway_z] = [1.0, 2.0].map(|k| {
            let hz = 0.5 + 0.35 * level + 0.05 * (k * 1.7 + i as f64).sin();
            let phase = k * 2.1 + i as f64 * 0.9;
            (TAU * hz * time_s + phase).sin()
        });
        let turn = Vector3::new(0.02 * sway_x, 0.0, 0.04 * sway_z) * level;
        let rotation = joints[parent].rotation * UnitQuaternion::from_scaled_axis(turn);
        let way = node.position - tree.nodes[parent].position;
        joints.push(JointPose {
            position: joints[parent].position + rotation * way,
            rotation,
        });
    }
    Pose {
        frame: frame as u64,
        time_s,
        joints,
    }
}

/// A place on a branch, from its beginning (0) to its end (1), in a pose.
fn on_branch(tree: &Skeleton, pose: &Pose, node: usize, share: f64) -> Point2<f64> {
    let parent = tree.nodes[node].parent.unwrap().index();
    let (from, to) = (pose.joints[parent].position, pose.joints[node].position);
    tree.image_from_model(&(from + (to - from) * share))
}

/// The tree's points: each branch's own, and where they rest.
fn points(tree: &Skeleton) -> (MotionHierarchy, BTreeMap<TrackId, Point2<f64>>) {
    let rest = Pose {
        frame: 0,
        time_s: 0.0,
        joints: tree
            .nodes
            .iter()
            .map(|n| JointPose {
                position: n.position,
                rotation: UnitQuaternion::identity(),
            })
            .collect(),
    };
    let (mut clusters, mut places) = (Vec::new(), BTreeMap::new());
    for n in 1..tree.nodes.len() {
        clusters.push(Cluster {
            parent: (n > 1).then(|| ClusterId(tree.nodes[n].parent.unwrap().0 - 1)),
            level: tree.nodes[n].level - 1,
            members: Vec::new(),
            centroid_px: [0.0; 2].into(),
            end_px: None,
            certainty: 1.0,
        });
        for k in 0..POINTS {
            let id = TrackId((n * POINTS + k) as u32);
            let share = (k + 1) as f64 / POINTS as f64;
            places.insert(id, on_branch(tree, &rest, n, share));
            // A point is in the cluster of its branch and in those of all branches below.
            let mut at = n;
            while at > 0 {
                clusters[at - 1].members.push(id);
                at = tree.nodes[at].parent.unwrap().index();
            }
        }
    }
    (MotionHierarchy { clusters }, places)
}

fn seen(tree: &Skeleton, truth: &Pose, noise_px: f64, chance: &mut Chance) -> TrackSet {
    let mut observations = Vec::new();
    for node in 1..tree.nodes.len() {
        for k in 0..POINTS {
            let place = on_branch(tree, truth, node, (k + 1) as f64 / POINTS as f64);
            let at = place + noise_px * Vector2::new(chance.normal(), chance.normal());
            if chance.even() < MISSING {
                continue;
            }
            observations.push(Observation {
                id: TrackId((node * POINTS + k) as u32),
                u_px: at.x as f32,
                v_px: at.y as f32,
                fb_error_px: 0.0,
                error_px: None,
                confirmed: true,
                depth: None,
            });
        }
    }
    TrackSet {
        frame: truth.frame,
        time_s: truth.time_s,
        observations,
        ..TrackSet::default()
    }
}

/// How far poses are off.
#[derive(Clone, Copy, Debug)]
struct Off {
    /// Root mean square deviation of the angles between branches from those at rest, degrees.
    shape_deg: f64,
    /// Root mean square distance of the projected nodes from the true ones, px.
    motion_px: f64,
}

fn angle(tree: &Skeleton, at: &dyn Fn(usize) -> Point3<f64>, node: usize) -> Option<f64> {
    let parent = tree.nodes[node].parent?.index();
    let before = tree.nodes[parent].parent?.index();
    Some((at(node) - at(parent)).angle(&(at(parent) - at(before))))
}

fn off(tree: &Skeleton, poses: &[Pose], truth: &[Pose]) -> Off {
    let (mut shape, mut angles, mut motion, mut nodes) = (0.0, 0.0, 0.0, 0.0);
    for (pose, truth) in poses.iter().zip(truth) {
        for i in 1..tree.nodes.len() {
            let (is, was) = (
                tree.image_from_model(&pose.joints[i].position),
                tree.image_from_model(&truth.joints[i].position),
            );
            motion += distance_squared(&is, &was);
            nodes += 1.0;
            let now = angle(tree, &|k| pose.joints[k].position, i);
            let rest = angle(tree, &|k| tree.nodes[k].position, i);
            if let Some((now, rest)) = now.zip(rest) {
                shape += (now - rest).to_degrees().powi(2);
                angles += 1.0;
            }
        }
    }
    Off {
        shape_deg: (shape / f64::max(angles, 1.0)).sqrt(),
        motion_px: (motion / f64::max(nodes, 1.0)).sqrt(),
    }
}

/// Both ways on the same tracks: deterministic, probabilistic.
fn both(noise_px: f64) -> [Off; 2] {
    let tree = Arc::new(tree());
    let truth: Vec<Pose> = (0..FRAMES).map(|k| moved(&tree, k)).collect();
    let (hierarchy, rest_px) = points(&tree);
    [MotionMethod::Deterministic, MotionMethod::Probabilistic].map(|method| {
        let mut chance = Chance::new(11);
        let mut binding = Binding::new(&hierarchy, &rest_px, &tree);
        let mut estimator = PoseEstimator::new(
            tree.clone(),
            &Motion {
                method,
                ..Motion::default()
            },
        );
        let mut poses = Vec::with_capacity(truth.len());
        for truth in &truth {
            let set = seen(&tree, truth, noise_px, &mut chance);
            poses.push(estimator.step(set.frame, set.time_s, &binding.targets_px(&set)));
        }
        off(&tree, &poses, &truth)
    })
}

/// The table of docs/method.md.
#[test]
fn on_noisy_tracks_the_probabilistic_way_is_nearer_to_rest_and_to_the_truth() {
    for noise_px in [0.0, 0.5, 1.0, 2.0, 4.0] {
        let [deterministic, probabilistic] = both(noise_px);
        println!(
            "| {noise_px} px | {:.1} | {:.1} | {:.1} | {:.1} |",
            deterministic.shape_deg,
            probabilistic.shape_deg,
            deterministic.motion_px,
            probabilistic.motion_px
        );
        assert!(
            probabilistic.shape_deg < 0.8 * deterministic.shape_deg,
            "{noise_px} px: angles {deterministic:?} {probabilistic:?}"
        );
        assert!(
            probabilistic.motion_px < 0.9 * deterministic.motion_px,
            "{noise_px} px: motion {deterministic:?} {probabilistic:?}"
        );
    }
}

/// What is left to the probabilistic way is what the tracks do not tell: with all of them, and
/// without noise, it is as near as its points are, whose mean moves less than the branch's end.
#[test]
fn the_pose_smooths_nothing_that_the_film_shows() {
    let tree = Arc::new(tree());
    let mut estimator = PoseEstimator::new(tree.clone(), &Motion::default());
    let (mut moved_px, mut off_px) = (0.0_f64, 0.0_f64);
    for k in 0..FRAMES {
        let truth = moved(&tree, k);
        let targets: Vec<_> = truth
            .joints
            .iter()
            .map(|j| Some(tree.image_from_model(&j.position)))
            .collect();
        let pose = estimator.step(k as u64, truth.time_s, &targets);
        for (i, node) in tree.nodes.iter().enumerate() {
            let [is, should, rest] = [
                pose.joints[i].position,
                truth.joints[i].position,
                node.position,
            ]
            .map(|p| tree.image_from_model(&p));
            off_px += distance_squared(&is, &should);
            moved_px += distance_squared(&rest, &should);
        }
    }
    let share = (off_px / moved_px).sqrt();
    println!("{:.4} of the motion is missed", share);
    assert!(share < 0.06, "{share}");
}

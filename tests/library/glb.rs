//! The written GLB, read back and played by the rules of glTF.

use crate::{bent, synthetic};
use arborcam::config::Config;
use arborcam::export::ExportError;
use arborcam::export::gltf::{KEY_TOLERANCE_PX, Model, glb};
use arborcam::geometry::{Bark, Dressed, Mesh};
use arborcam::model::{JointPose, Node, NodeId, Pose, Rgb, Skeleton};
use arborcam::pipeline::{Seen, dress};
use gltf::animation::util::ReadOutputs;
use nalgebra::{Isometry3, Point2, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use std::collections::HashMap;

fn write(
    skeleton: &Skeleton,
    mesh: &Mesh,
    poses: &[Pose],
    tolerance_px: f64,
    metres_per_px: f64,
) -> Vec<u8> {
    let provenance = json!({"software": "arborcam", "source": "synthetic"});
    let dressed = wooden(mesh);
    glb(&model(
        skeleton,
        &dressed,
        poses,
        tolerance_px,
        metres_per_px,
        &provenance,
    ))
    .unwrap()
    .0
}

fn wooden(mesh: &Mesh) -> Dressed {
    Dressed {
        wood: vec![mesh.clone()],
        bark: Bark {
            rgb: [110, 86, 60],
            ..Bark::default()
        },
        ..Dressed::default()
    }
}

fn model<'a>(
    skeleton: &'a Skeleton,
    dressed: &'a Dressed,
    poses: &'a [Pose],
    tolerance_px: f64,
    metres_per_px: f64,
    provenance: &'a Value,
) -> Model<'a> {
    Model {
        skeleton,
        dressed,
        poses,
        flutter: &[],
        level: 0,
        metres_per_px,
        tolerance_px,
        node_extras: &[],
        provenance,
    }
}

/// With `ARBORCAM_GLB_DIR=DIR` the files stay, for `scripts/validate-glb.mjs` or a viewer.
fn keep(name: &str, bytes: &[u8]) {
    if let Some(dir) = std::env::var_os("ARBORCAM_GLB_DIR") {
        std::fs::write(
            std::path::Path::new(&dir).join(format!("{}.glb", name.replace([' ', ','], "_"))),
            bytes,
        )
        .unwrap();
    }
}

/// Rotation keys of the one animation, by node index.
type Channels = HashMap<usize, (Vec<f32>, Vec<[f32; 4]>)>;

struct Played {
    document: gltf::Document,
    bin: Vec<u8>,
    channels: Channels,
}

impl Played {
    /// Parses with the library's own validation on.
    fn parse(bytes: &[u8]) -> Self {
        let file = gltf::Gltf::from_slice(bytes).expect("the file is valid glTF");
        let bin = file.blob.clone().unwrap_or_default();
        let mut channels = Channels::new();
        assert!(file.animations().len() <= 1);
        for animation in file.animations() {
            assert_eq!(animation.name(), Some("sway"));
            for channel in animation.channels() {
                let reader = channel.reader(|_| Some(&bin));
                let times: Vec<f32> = reader.read_inputs().unwrap().collect();
                let Some(ReadOutputs::Rotations(rotations)) = reader.read_outputs() else {
                    panic!("only rotations are animated");
                };
                let before = channels.insert(
                    channel.target().node().index(),
                    (times, rotations.into_f32().collect()),
                );
                assert!(before.is_none(), "one channel a joint");
            }
        }
        Self {
            document: file.document,
            bin,
            channels,
        }
    }

    fn rotation(&self, node: usize, time: f32) -> UnitQuaternion<f64> {
        let Some((times, keys)) = self.channels.get(&node) else {
            return UnitQuaternion::identity();
        };
        let at = |k: usize| {
            let [x, y, z, w] = keys[k].map(f64::from);
            UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
        };
        let after = times.partition_point(|&t| t < time);
        if after == 0 || times.len() == 1 {
            return at(0);
        }
        if after == times.len() {
            return at(times.len() - 1);
        }
        let (t0, t1) = (f64::from(times[after - 1]), f64::from(times[after]));
        at(after - 1).slerp(&at(after), (f64::from(time) - t0) / (t1 - t0))
    }

    /// Placement of every skeleton node's joint in the scene.
    fn joints(&self, time: f32) -> Vec<Isometry3<f64>> {
        let mut out = vec![Isometry3::identity(); self.document.nodes().len()];
        for node in self.document.nodes() {
            // Parents come first, so their placement is known.
            let (t, _, _) = node.transform().decomposed();
            let own = Translation3::new(t[0].into(), t[1].into(), t[2].into())
                * self.rotation(node.index(), time);
            out[node.index()] *= own;
            for child in node.children() {
                assert!(child.index() > node.index());
                out[child.index()] = out[node.index()];
            }
        }
        out
    }

    fn inverse_bind(&self) -> Vec<Vector3<f64>> {
        let skin = self.document.skins().next().unwrap();
        let matrices = skin
            .reader(|_| Some(&self.bin))
            .read_inverse_bind_matrices()
            .unwrap();
        matrices
            .map(|m| Vector3::new(m[3][0].into(), m[3][1].into(), m[3][2].into()))
            .collect()
    }
}

/// Largest distance between a node in a pose and the same node skinned by the file, px, by the
/// measure of the keys.
fn worst_error_px(played: &Played, skeleton: &Skeleton, poses: &[Pose], metres_per_px: f64) -> f64 {
    let bind = played.inverse_bind();
    let mut worst = 0.0_f64;
    for pose in poses {
        let joints = played.joints((pose.time_s - poses[0].time_s) as f32);
        for (i, node) in skeleton.nodes.iter().enumerate() {
            let skinned =
                joints[i] * (Point3::from(node.position.coords * metres_per_px + bind[i]));
            let off = skinned.coords / metres_per_px - pose.joints[i].position.coords;
            // Depth, which is estimated, counts half.
            worst = worst.max(Vector3::new(off.x, off.y, 0.5 * off.z).norm());
        }
    }
    worst
}

#[test]
fn a_viewer_shows_every_branch_where_the_pose_has_it() {
    let skeleton = synthetic::tree(7, 3);
    let poses = synthetic::sway(&skeleton, 60);
    let mesh = synthetic::skin(&skeleton);
    for (tolerance_px, metres_per_px, allowed) in
        [(0.001, 1.0, 0.01), (0.001, 0.004, 0.01), (0.2, 1.0, 0.201)]
    {
        let played = Played::parse(&write(
            &skeleton,
            &mesh,
            &poses,
            tolerance_px,
            metres_per_px,
        ));
        let worst = worst_error_px(&played, &skeleton, &poses, metres_per_px);
        assert!(
            worst < allowed,
            "{worst} px at a tolerance of {tolerance_px} px"
        );
    }
}

/// Joints follow the tree as it is drawn; a bend turns against nothing, and has no channel.
#[test]
fn bends_and_side_wood_are_shown_where_the_pose_has_them() {
    let straight = synthetic::tree(5, 2);
    let moved = synthetic::sway(&straight, 60);
    for in_the_middle in [false, true] {
        let skeleton = bent::Bent::of(&straight, in_the_middle);
        let poses = bent_poses(&skeleton, &moved);
        let skeleton = skeleton.skeleton;
        let mesh = synthetic::skin(&skeleton);
        for (tolerance_px, allowed) in [(0.001, 0.01), (0.2, 0.3)] {
            let played = Played::parse(&write(&skeleton, &mesh, &poses, tolerance_px, 1.0));
            let worst = worst_error_px(&played, &skeleton, &poses, 1.0);
            assert!(worst < allowed, "{worst} px at {tolerance_px} px");
            for (i, node) in skeleton.nodes.iter().enumerate() {
                let [own, below] =
                    [Some(NodeId(i as u32)), node.parent].map(|n| n.map(|n| skeleton.mover(n)));
                assert!(own != below || !played.channels.contains_key(&i), "{i}");
            }
        }
    }
}

/// The bent tree with every branch turned as in the poses of the straight one.
fn bent_poses(bent: &bent::Bent, straight: &[Pose]) -> Vec<Pose> {
    let mut out = Vec::new();
    for pose in straight {
        let at_rest = |n: &Node| JointPose {
            position: n.position,
            rotation: UnitQuaternion::identity(),
        };
        let mut joints: Vec<JointPose> = bent.skeleton.nodes.iter().map(at_rest).collect();
        let rotations: Vec<_> = pose.joints.iter().map(|j| j.rotation).collect();
        let rotations = bent.spread(&rotations, UnitQuaternion::identity());
        for branch in bent.skeleton.moving_branches() {
            branch.place(&bent.skeleton, rotations[branch.node.index()], &mut joints);
        }
        let pose = Pose {
            joints,
            ..pose.clone()
        };
        bent::assert_rigid(&bent.skeleton, &pose);
        out.push(pose);
    }
    out
}

#[test]
fn turning_all_the_way_round_has_no_jump() {
    // q changes its sign at half a turn; a viewer that interpolates across the jump would spin the
    // branch back.
    let skeleton = synthetic::tree(3, 1);
    let mut poses = synthetic::sway(&skeleton, 200);
    for (k, pose) in poses.iter_mut().enumerate() {
        let q = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.05 * k as f64);
        for i in 1..skeleton.nodes.len() {
            let parent = skeleton.nodes[i].parent.unwrap().index();
            let way = skeleton.nodes[i].position - skeleton.nodes[parent].position;
            // The same rotation under either sign, as an estimator may give it.
            let sign = if k % 3 == 0 { -1.0 } else { 1.0 };
            pose.joints[i].rotation =
                UnitQuaternion::new_unchecked(Quaternion::from(q.coords * sign));
            pose.joints[i].position = pose.joints[parent].position + q * way;
        }
    }
    let played = Played::parse(&write(
        &skeleton,
        &synthetic::skin(&skeleton),
        &poses,
        0.2,
        1.0,
    ));
    assert!(worst_error_px(&played, &skeleton, &poses, 1.0) < 0.201);
    for (_, keys) in played.channels.values() {
        for pair in keys.windows(2) {
            assert!(pair[0].iter().zip(pair[1]).map(|(a, b)| a * b).sum::<f32>() >= 0.0);
        }
    }
    assert_eq!(
        played.channels.len(),
        1,
        "branches that ride on a turning trunk need no keys of their own"
    );
}

#[test]
fn a_branch_that_never_moves_has_no_channel_and_time_starts_at_0() {
    let skeleton = synthetic::tree(4, 2);
    let mut poses = synthetic::sway(&skeleton, 30);
    for pose in &mut poses {
        (pose.joints[1].rotation, pose.joints[2].rotation) =
            (UnitQuaternion::identity(), UnitQuaternion::identity());
    }
    let played = Played::parse(&write(
        &skeleton,
        &synthetic::skin(&skeleton),
        &poses,
        0.01,
        0.0,
    ));
    assert!(!played.channels.is_empty());
    for still in 0..3 {
        assert!(!played.channels.contains_key(&still));
    }
    for (times, _) in played.channels.values() {
        assert_eq!(times[0], 0.0);
        assert!(times.windows(2).all(|w| w[0] < w[1]));
    }
}

#[test]
fn the_smallest_and_oddest_models_are_still_valid_files() {
    let full = synthetic::tree(5, 2);
    let full_mesh = synthetic::skin(&full);
    let poses = synthetic::sway(&full, 4);
    let mut foot_only = full.clone();
    foot_only.nodes.truncate(1);
    let foot_poses = synthetic::sway(&foot_only, 3);
    let mut stuck = poses.clone();
    stuck.iter_mut().for_each(|p| p.time_s = 1.0);
    let mut lost = poses.clone();
    let nan = Quaternion::new(f64::NAN, 0.0, 0.0, 0.0);
    lost[2]
        .joints
        .iter_mut()
        .for_each(|j| j.rotation = UnitQuaternion::new_unchecked(nan));
    let cases: [(&str, &Skeleton, &Mesh, &[Pose]); 7] = [
        ("no poses", &full, &full_mesh, &[]),
        ("one pose", &full, &full_mesh, &poses[..1]),
        ("no mesh", &full, &Mesh::default(), &poses),
        (
            "only a foot",
            &foot_only,
            &synthetic::skin(&foot_only),
            &foot_poses,
        ),
        ("only a foot, no poses", &foot_only, &Mesh::default(), &[]),
        ("a clock that stands still", &full, &full_mesh, &stuck),
        ("a pose that was lost", &full, &full_mesh, &lost),
    ];
    for (name, skeleton, mesh, poses) in cases {
        let bytes = write(skeleton, mesh, poses, KEY_TOLERANCE_PX, 0.0);
        keep(name, &bytes);
        let played = Played::parse(&bytes);
        assert!(played.document.accessors().all(|a| a.count() > 0), "{name}");
        assert_eq!(
            played.document.skins().len(),
            usize::from(!mesh.indices.is_empty()),
            "{name}"
        );
        assert!(
            played
                .channels
                .values()
                .flat_map(|c| &c.1)
                .flatten()
                .all(|x| x.is_finite()),
            "{name}"
        );
    }
    let one = Played::parse(&write(&full, &full_mesh, &poses[..1], 0.001, 0.0));
    assert!(
        worst_error_px(&one, &full, &poses[..1], 1.0) < 0.01,
        "one pose is shown as it is"
    );
}

#[test]
fn a_model_that_no_file_can_hold_is_refused_with_a_reason() {
    let good = synthetic::tree(3, 1);
    let mesh = synthetic::skin(&good);
    let mut other = synthetic::sway(&good, 2);
    other[1].joints.pop();
    let mut nan = good.clone();
    nan.nodes[3].position.x = f64::NAN;
    let mut empty = good.clone();
    empty.nodes.clear();
    let mut torn = mesh.clone();
    torn.normals.pop();
    for (skeleton, mesh, poses, word) in [
        (&good, &mesh, &other[..], "joints"),
        (&nan, &mesh, &[][..], "node 3"),
        (&empty, &mesh, &[][..], "no nodes"),
        (&good, &torn, &[][..], "mesh"),
    ] {
        match glb(&model(
            skeleton,
            &wooden(mesh),
            poses,
            0.2,
            0.0,
            &Value::Null,
        )) {
            Err(ExportError::Unfit { why }) => assert!(why.contains(word), "{why}"),
            other => panic!("{word}: {:?}", other.map(|b| b.0.len())),
        }
    }
}

/// A brown trunk on a lawn, in an outline twice as wide, and a skeleton that passes by it.
#[test]
fn the_bark_has_the_colour_of_the_trunk() {
    let skeleton = synthetic::tree(3, 1);
    let size = skeleton.image_size;
    let (foot, brown, green) = (skeleton.foot_px, [110, 80, 60], [60, 160, 40]);
    let colour = |u: u32| {
        if (f64::from(u) - foot[0]).abs() < 9.0 {
            brown
        } else {
            green
        }
    };
    let picture = Rgb {
        size,
        pixels: (0..size.height)
            .flat_map(|_| (0..size.width).flat_map(colour))
            .collect(),
    };
    let corner = |du: f64, v: f64| Point2::new(foot[0] + du, v);
    let corners = [
        corner(-18.0, 200.0),
        corner(18.0, 200.0),
        corner(18.0, foot[1]),
        corner(-18.0, foot[1]),
    ];
    let outline = arborcam::outline::from_polygon(&corners, size).expect("outline");
    let seen = Seen {
        picture: Some(&picture),
        outline: Some(&outline),
        ..Seen::default()
    };
    assert_eq!(dress(&skeleton, seen, &Config::default()).bark.rgb, brown);
    assert_eq!(
        dress(
            &skeleton,
            Seen {
                outline: None,
                ..seen
            },
            &Config::default()
        )
        .bark
        .rgb,
        brown
    );
    assert_ne!(
        dress(&skeleton, Seen::default(), &Config::default())
            .bark
            .rgb,
        brown,
        "where nothing is seen, a plain one"
    );
}

#[test]
fn names_and_extras_tell_what_was_measured_and_what_was_copied() {
    let skeleton = synthetic::tree(3, 2);
    let mesh = synthetic::skin(&skeleton);
    let provenance = json!({"source": "oak \"Q\".mkv", "frames": 330});
    let extras = [json!({}), json!({"frequency_hz": 0.5})];
    let bytes = glb(&Model {
        node_extras: &extras,
        ..model(&skeleton, &wooden(&mesh), &[], 0.2, 0.0, &provenance)
    })
    .unwrap()
    .0;
    let played = Played::parse(&bytes);
    let root = played.document.clone().into_json();
    let asset: Value = serde_json::from_str(root.asset.extras.as_ref().unwrap().get()).unwrap();
    assert_eq!(asset, provenance);
    let nodes: Vec<gltf::Node> = played.document.nodes().collect();
    let names = skeleton.botanical_branches().piece_names();
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let told: Value = serde_json::from_str(nodes[i].extras().as_ref().unwrap().get()).unwrap();
        assert_eq!(told["level"], json!(node.level));
        assert_eq!(told["copy_of"], json!(node.copy_of.map(|c| c.0)));
        assert_eq!(told["node_id"], json!(node.name.0));
        assert_eq!(nodes[i].name(), Some(names[i].as_str()));
    }
    assert_eq!(names[..3], ["tree", "trunk", "trunk-2"]);
    let told: Value = serde_json::from_str(nodes[1].extras().as_ref().unwrap().get()).unwrap();
    assert_eq!(told["frequency_hz"], json!(0.5));
}

/// Time that this thread has had on a processor, s: what others on the machine do must not count.
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/stat").expect("proc");
    // utime and stime, in hundredths of a second; the name in brackets before may hold anything.
    let fields: Vec<&str> = stat[stat.rfind(')').expect("a name")..]
        .split_whitespace()
        .collect();
    (fields[12].parse::<f64>().expect("utime") + fields[13].parse::<f64>().expect("stime")) / 100.0
}

#[test]
fn a_realistic_tree_is_written_fast_and_small() {
    let skeleton = synthetic::tree(7, 3);
    assert_eq!(skeleton.nodes.len(), 380);
    let poses = synthetic::sway(&skeleton, 330);
    let begin_s = cpu_s();
    let mesh = synthetic::skin(&skeleton);
    let provenance = json!({"software": "arborcam", "frames": 330});
    let (bytes, animation) = glb(&model(
        &skeleton,
        &wooden(&mesh),
        &poses,
        KEY_TOLERANCE_PX,
        0.0,
        &provenance,
    ))
    .unwrap();
    let took_s = cpu_s() - begin_s;
    let triangles = mesh.indices.len() / 3;
    println!(
        "{} bytes, {triangles} triangles, {} of {} keys, {took_s:.2} s",
        bytes.len(),
        animation.keys,
        animation.raw_keys
    );
    assert!(bytes.len() < 10_000_000);
    // Several times what it takes, for a slow machine.
    assert!(took_s < 5.0, "{took_s} s");
    let played = Played::parse(&bytes);
    assert!(worst_error_px(&played, &skeleton, &poses, 1.0) < KEY_TOLERANCE_PX + 0.001);
    keep("realistic", &bytes);
}

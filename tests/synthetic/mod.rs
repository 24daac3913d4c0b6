//! A made-up tree that sways: binary, every branch on its own plane, copies turned about the trunk.

// Every test file compiles this module for itself and uses a part of it.
#![allow(dead_code)]

use arborcam::config::Wood;
use arborcam::geometry::{Foliage, FoliageGroup, Mesh, wood};
use arborcam::model::{JointPose, LeafSwing, Node, NodeId, NodeName, Pose, Size, Skeleton};
use arborcam::shape::{Limb, limbs, thicken};
use nalgebra::{Point2, Point3, Rotation3, UnitQuaternion, Vector3};

/// A number in -1..1 that is always the same for the same arguments.
pub fn noise(a: usize, b: usize) -> f64 {
    let mut x = (a as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (b as u64).wrapping_mul(0xD1B5_4A32_D192_ED03);
    for _ in 0..3 {
        x = (x ^ (x >> 31)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    }
    (x >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// Foot, trunk, and a fork at every node up to level `levels`, on `planes` planes: 7 and 3 make 380
/// nodes.
pub fn tree(levels: u8, planes: usize) -> Skeleton {
    let node = |parent: Option<usize>, level, position| Node {
        name: NodeName(0),
        parent: parent.map(|p| NodeId(p as u32)),
        level,
        position,
        radius: 0.0,
        n_tracks: 400 >> level,
        certainty: 0.75,
        copy_of: None,
        plane_angle: 0.0,
        moves_with: None,
        kind: Default::default(),
    };
    let mut nodes = vec![
        node(None, 0, Point3::origin()),
        node(Some(0), 1, Point3::new(4.0, 160.0, 0.0)),
    ];
    let mut i = 1;
    while i < nodes.len() {
        let (level, at) = (nodes[i].level, nodes[i].position);
        let way = at - nodes[nodes[i].parent.unwrap().index()].position;
        let lean = way.x.atan2(way.y);
        for side in [-1.0, 1.0].into_iter().filter(|_| level < levels) {
            let turn = lean + side * 0.5 + 0.2 * noise(i, side as usize);
            let length = 110.0 * 0.78_f64.powi(i32::from(level) - 1) * (1.0 + 0.2 * noise(i, 7));
            let push = 0.35 * length * noise(i, 9 + side as usize);
            let step = Vector3::new(length * turn.sin(), length * turn.cos(), push);
            nodes.push(node(Some(i), level + 1, at + step));
        }
        i += 1;
    }
    let measured = nodes.len();
    for plane in 1..planes {
        let angle = std::f64::consts::PI * plane as f64 / planes as f64;
        let about_trunk = Rotation3::from_axis_angle(&Vector3::y_axis(), angle);
        let first = nodes.len();
        for original in 2..measured {
            let from = &nodes[original];
            let parent = from.parent.unwrap().index();
            let mut copy = node(
                Some(if parent < 2 {
                    parent
                } else {
                    first + parent - 2
                }),
                from.level,
                from.position,
            );
            let pivot = nodes[1].position;
            copy.position = pivot + about_trunk * (from.position - pivot);
            (copy.n_tracks, copy.copy_of, copy.plane_angle) =
                (0, Some(NodeId(original as u32)), angle);
            nodes.push(copy);
        }
    }
    (0..)
        .zip(&mut nodes)
        .for_each(|(i, n)| n.name = NodeName(i));
    let mut skeleton = Skeleton {
        nodes,
        foot_px: Point2::new(640.0, 700.0),
        image_size: Size::new(1280, 720),
    };
    thicken(&mut skeleton, 14.0, &|_, _| true, &bare(), 1);
    skeleton
}

/// Poses at 30 frames a second; every branch swings against its parent, faster and farther towards
/// the tips, with the jitter of a tracker.
pub fn sway(skeleton: &Skeleton, frames: usize) -> Vec<Pose> {
    let pose = |k: usize| {
        let time_s = 5.0 + k as f64 / 30.0 + 1e-4 * noise(k, 1);
        let mut joints: Vec<JointPose> = Vec::new();
        for (i, node) in skeleton.nodes.iter().enumerate() {
            let Some(parent) = node.parent else {
                joints.push(JointPose {
                    position: node.position,
                    rotation: UnitQuaternion::identity(),
                });
                continue;
            };
            let level = f64::from(node.level);
            let swing = |n: usize| {
                (std::f64::consts::TAU * (0.3 + 0.25 * level) * time_s + 3.0 * noise(i, n)).sin()
            };
            let reach = 0.008 * level;
            let jitter = 0.0005 * level * noise(i, 1000 + k);
            let turn = Vector3::new(
                0.5 * reach * swing(1),
                0.2 * reach * swing(2),
                reach * swing(3) + jitter,
            );
            let from = joints[parent.index()];
            let rotation = from.rotation * UnitQuaternion::from_scaled_axis(turn);
            let way = node.position - skeleton.nodes[parent.index()].position;
            joints.push(JointPose {
                position: from.position + rotation * way,
                rotation,
            });
        }
        Pose {
            frame: 150 + k as u64,
            time_s,
            joints,
        }
    };
    (0..frames).map(pose).collect()
}

/// Wood without twigs.
pub fn bare() -> Wood {
    Wood {
        twig_px: 0.0,
        ..Wood::default()
    }
}

/// The limbs of a skeleton whose twigs may grow anywhere.
pub fn limbs_of(skeleton: &Skeleton, wood: &Wood) -> Vec<Limb> {
    limbs(skeleton, &|_, _| true, wood, 1)
}

/// The skin of a skeleton without twigs.
pub fn skin(skeleton: &Skeleton) -> Mesh {
    wood(&limbs_of(skeleton, &bare()), 60_000)
}

/// Leaves on the tips of the measured branches, one group for each of two, as small squares that
/// swing.
pub fn leaves(skeleton: &Skeleton) -> Foliage {
    let mut groups: Vec<FoliageGroup> = Vec::new();
    for (k, (i, node)) in skeleton
        .nodes
        .iter()
        .enumerate()
        .filter(|(_, n)| n.level == 7 && n.n_tracks > 0)
        .enumerate()
    {
        if k % 2 == 0 {
            groups.push(FoliageGroup {
                node: NodeId(i as u32),
                ..FoliageGroup::default()
            });
        }
        let Some(group) = groups.last_mut() else {
            continue;
        };
        let first = group.mesh.positions.len() as u32;
        for corner in [[0.0, 0.0], [6.0, 0.0], [6.0, 6.0], [0.0, 6.0]] {
            let at = node.position + Vector3::new(corner[0], corner[1], 0.0);
            group
                .mesh
                .positions
                .push([at.x as f32, at.y as f32, at.z as f32]);
            group.mesh.normals.push([0.0, 0.0, 1.0]);
            group
                .mesh
                .uvs
                .push([(corner[0] / 6.0) as f32, (corner[1] / 6.0) as f32]);
            group.mesh.joints.push([i as u16, 0, 0, 0]);
            group.mesh.weights.push([1.0, 0.0, 0.0, 0.0]);
            group.colours.push([60 + k as u8, 110, 40]);
            group.sine.push([0.0, 0.0, corner[0] as f32]);
            group.cosine.push([0.0, 0.0, corner[1] as f32]);
        }
        group
            .mesh
            .indices
            .extend([0, 1, 2, 0, 2, 3].map(|v| first + v));
    }
    let mut png = Vec::new();
    let image = image::RgbaImage::from_fn(8, 8, |x, y| {
        image::Rgba([90, 160, 60, if x + y < 3 { 0 } else { 255 }])
    });
    image
        .write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png)
        .expect("png");
    Foliage {
        groups,
        texture: Some(("image/png", png)),
        frequency_hz: 2.0,
    }
}

/// The weights with which they swing in every pose.
pub fn flutter(foliage: &Foliage, poses: &[Pose]) -> Vec<Vec<LeafSwing>> {
    let swing = |p: &Pose| {
        let phase = std::f64::consts::TAU * foliage.frequency_hz * p.time_s;
        LeafSwing {
            sine: (0.3 * phase.sin()) as f32,
            cosine: (0.3 * phase.cos()) as f32,
        }
    };
    vec![poses.iter().map(swing).collect(); foliage.groups.len()]
}

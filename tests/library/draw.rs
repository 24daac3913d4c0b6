//! Pictures of a made-up tree against what must be seen in them.

use crate::synthetic::{sway, tree};
use arborcam::draw::{BoundingCylinder, Camera, Look, Model, Posed, Rgba, Texture, View, picture};
use arborcam::geometry::{Foliage, FoliageGroup, Mesh, bare_wood};
use arborcam::model::{JointPose, LeafSwing, NodeId, Pose, Size, Skeleton};
use nalgebra::{Point2, Point3, UnitQuaternion, Vector3};

const BARK: [u8; 3] = [104, 84, 66];
const SIZE: Size = Size {
    width: 320,
    height: 240,
};
const LOOK: Look = Look {
    samples: 2,
    shadow: false,
    thicker_px: 0.0,
};

fn wood(skeleton: &Skeleton) -> Mesh {
    bare_wood(skeleton, 20_000)
}

fn bounds(posed: &Posed) -> BoundingCylinder {
    posed.bounds().expect("a tree")
}

/// Share of the pixels that are drawn in `one` and not in `other`.
fn missing(one: &Rgba, other: &Rgba) -> f64 {
    let drawn = |p: &Rgba| {
        p.pixels
            .chunks_exact(4)
            .map(|p| p[3] > 127)
            .collect::<Vec<_>>()
    };
    let (one, other) = (drawn(one), drawn(other));
    let lost = one.iter().zip(&other).filter(|(a, b)| **a && !**b).count();
    lost as f64 / one.iter().filter(|a| **a).count().max(1) as f64
}

/// Every node that is thick enough for a pixel lies under a drawn pixel, at rest and in every pose:
/// what is drawn is what was measured, in its place.
#[test]
fn the_tree_is_drawn_where_its_pose_says_it_is() {
    let skeleton = tree(5, 2);
    let mesh = wood(&skeleton);
    let model = Model::bare(&skeleton, &mesh, BARK);
    let size = Size::new(1280, 720);
    let poses = sway(&skeleton, 40);
    for pose in poses.iter().step_by(13) {
        let posed = model.posed(Some(pose), &[]);
        for (view, camera) in [
            ("film", Camera::of_film(&skeleton, size)),
            (
                "side",
                Camera::fitting(&bounds(&posed), View::SIDE, false, size),
            ),
        ] {
            let drawn = picture(&posed, &camera, &LOOK);
            for (i, joint) in pose.joints.iter().enumerate().skip(1) {
                // Half way up the branch, where a tip is not too thin yet.
                let from = pose.joints[skeleton.nodes[i].parent.unwrap().index()].position;
                let [x, y, _] = camera.project(&nalgebra::center(&from, &joint.position));
                let near = (-2..=2).any(|dx| {
                    (-2..=2)
                        .any(|dy| drawn.at((x as i64 + dx) as u32, (y as i64 + dy) as u32)[3] > 0)
                });
                assert!(
                    near,
                    "{view}: node {i} of frame {} at {x:.1} {y:.1}",
                    pose.frame
                );
            }
        }
    }
}

/// A branch that turns takes its wood along, about its lower end.
#[test]
fn a_turned_branch_is_drawn_turned() {
    let skeleton = tree(1, 1);
    let mesh = wood(&skeleton);
    let model = Model::bare(&skeleton, &mesh, BARK);
    let lying =
        UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, -std::f64::consts::FRAC_PI_2));
    let still = JointPose {
        position: Point3::origin(),
        rotation: UnitQuaternion::identity(),
    };
    let top = JointPose {
        position: lying * skeleton.nodes[1].position,
        rotation: lying,
    };
    let pose = Pose {
        frame: 0,
        time_s: 0.0,
        joints: vec![still, top],
    };
    let camera = Camera::of_film(&skeleton, Size::new(1280, 720));
    let [rest, turned] = [None, Some(&pose)].map(|p| picture(&model.posed(p, &[]), &camera, &LOOK));
    // The foot is at (640, 700), the trunk 160 px long; it bends along its length and lies at its
    // end.
    assert!(rest.at(641, 580)[3] > 0 && rest.at(785, 702)[3] == 0);
    assert!(turned.at(785, 702)[3] > 0 && turned.at(641, 580)[3] == 0);
}

/// Someone who walks round sees the tree in one size, and after a whole round the same picture.
#[test]
fn a_whole_turn_ends_where_it_began() {
    let skeleton = tree(4, 2);
    let mesh = wood(&skeleton);
    let model = Model::bare(&skeleton, &mesh, BARK);
    let posed = model.posed(None, &[]);
    let at = |turn: f64| {
        picture(
            &posed,
            &Camera::fitting(&bounds(&posed), View { turn, down: 0.2 }, true, SIZE),
            &LOOK,
        )
    };
    let (start, quarter, end) = (
        at(0.0),
        at(std::f64::consts::FRAC_PI_2),
        at(std::f64::consts::TAU),
    );
    assert!(
        missing(&start, &quarter) > 0.2,
        "a quarter turn changes the picture"
    );
    assert!(missing(&start, &end) < 0.01 && missing(&end, &start) < 0.01);
}

fn leaf(skeleton: &Skeleton, node: usize, half: f32) -> Foliage {
    let c = skeleton.nodes[node].position;
    let (x, y, z) = (c.x as f32, c.y as f32, c.z as f32 + 50.0);
    let n = node as u16;
    let mesh = Mesh {
        positions: vec![
            [x - half, y - half, z],
            [x + half, y - half, z],
            [x + half, y + half, z],
            [x - half, y + half, z],
        ],
        normals: vec![[0.0, 0.0, 1.0]; 4],
        uvs: vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]],
        joints: vec![[n, 0, 0, 0]; 4],
        weights: vec![[1.0, 0.0, 0.0, 0.0]; 4],
        indices: vec![0, 1, 2, 0, 2, 3],
        made_up: Vec::new(),
    };
    let group = FoliageGroup {
        node: NodeId(node as u32),
        mesh,
        colours: vec![[0, 200, 0]; 4],
        sine: vec![[40.0, 0.0, 0.0]; 4],
        cosine: vec![[0.0, 40.0, 0.0]; 4],
    };
    Foliage {
        groups: vec![group],
        texture: None,
        frequency_hz: 2.0,
    }
}

/// A leaf is seen from both sides, moves with its two parts, and is cut out of its texture.
#[test]
fn leaves_swing_and_are_cut_out() {
    let skeleton = tree(1, 1);
    let (mesh, foliage) = (wood(&skeleton), leaf(&skeleton, 1, 10.0));
    let mut model = Model {
        foliage: &foliage,
        ..Model::bare(&skeleton, &mesh, BARK)
    };
    let camera = Camera::of_film(&skeleton, Size::new(1280, 720));
    let at = skeleton.image_from_model(&skeleton.nodes[1].position);
    let green = |picture: &Rgba, dx: f64, dy: f64| {
        let [r, g, _, a] = picture.at((at.x + dx) as u32, (at.y + dy) as u32);
        a > 0 && g > r
    };
    for (sine, cosine, dx, dy) in [
        (0.0, 0.0, 0.0, 0.0),
        (1.0, 0.0, 40.0, 0.0),
        (0.0, -1.0, 0.0, 40.0),
    ] {
        let swing = LeafSwing { sine, cosine };
        let drawn = picture(&model.posed(None, &[swing]), &camera, &LOOK);
        assert!(green(&drawn, dx, dy), "{swing:?}");
    }
    let behind = Camera {
        view: View {
            turn: std::f64::consts::PI,
            down: 0.0,
        },
        ..camera
    };
    let posed = model.posed(None, &[]);
    let seen = picture(
        &posed,
        &Camera {
            middle_px: Point2::new(640.0, 700.0),
            ..behind
        },
        &LOOK,
    );
    assert!(
        (0..1280).any(|x| (500..700).any(|y| seen.at(x, y)[1] > seen.at(x, y)[0] + 50)),
        "from behind"
    );

    // The texture's left half is cut away.
    let half = image::RgbaImage::from_fn(2, 1, |x, _| {
        image::Rgba([255, 255, 255, if x == 0 { 0 } else { 255 }])
    });
    let mut png = std::io::Cursor::new(Vec::new());
    half.write_to(&mut png, image::ImageFormat::Png).unwrap();
    model.leaf = Texture::read(png.get_ref());
    let drawn = picture(&model.posed(None, &[]), &camera, &LOOK);
    assert!(green(&drawn, 6.0, -8.0) && !green(&drawn, -6.0, -8.0));
}

#[test]
fn the_shadow_lies_on_the_ground_and_only_where_it_is_looked_down_on() {
    let skeleton = tree(4, 2);
    let mesh = wood(&skeleton);
    let model = Model::bare(&skeleton, &mesh, BARK);
    let posed = model.posed(None, &[]);
    let with = |shadow: bool, down: f64| {
        let camera = Camera::fitting(&bounds(&posed), View { turn: 0.3, down }, true, SIZE);
        picture(
            &posed,
            &camera,
            &Look {
                samples: 1,
                shadow,
                thicker_px: 0.0,
            },
        )
    };
    assert_eq!(with(true, 0.0), with(false, 0.0));
    let (shaded, plain) = (with(true, 0.4), with(false, 0.4));
    let soft = |p: &[u8]| p[3] > 10 && p[3] < 140;
    assert!(shaded.pixels.chunks_exact(4).filter(|p| soft(p)).count() > 200);
    assert!(
        missing(&plain, &shaded) == 0.0,
        "the tree itself is drawn over its shadow"
    );
}

/// Damaged models are a user's file away.
#[test]
fn nothing_that_a_file_may_hold_brings_it_down() {
    let mut skeleton = tree(3, 2);
    let mut mesh = wood(&skeleton);
    let pose = |position: Point3<f64>, rotation| Pose {
        frame: 0,
        time_s: 0.0,
        joints: vec![JointPose { position, rotation }; skeleton.nodes.len()],
    };
    let nan = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(f64::NAN, 0.0, 0.0, 0.0));
    let poses = [
        pose(Point3::new(f64::NAN, 0.0, 0.0), UnitQuaternion::identity()),
        pose(Point3::new(1e300, 0.0, 0.0), UnitQuaternion::identity()),
        pose(Point3::origin(), nan),
        Pose {
            frame: 0,
            time_s: 0.0,
            joints: Vec::new(),
        },
    ];
    skeleton.nodes[3].position.x = f64::NAN;
    mesh.positions[5] = [f32::NAN; 3];
    mesh.positions[6] = [f32::MAX; 3];
    mesh.joints[7] = [u16::MAX; 4];
    mesh.indices[9] = u32::MAX;
    mesh.normals.truncate(mesh.positions.len() - 3);
    mesh.uvs.clear();
    let foliage = Foliage {
        groups: vec![FoliageGroup {
            mesh: mesh.clone(),
            ..FoliageGroup::default()
        }],
        ..Foliage::default()
    };
    let model = Model {
        foliage: &foliage,
        ..Model::bare(&skeleton, &mesh, BARK)
    };
    let whole = BoundingCylinder::of([Point3::origin(), Point3::new(100.0, 300.0, 50.0)]).unwrap();
    for pose in &poses {
        let swing = LeafSwing {
            sine: f32::NAN,
            cosine: f32::NAN,
        };
        let posed = model.posed(Some(pose), &[swing]);
        let _ = posed.bounds();
        for size in [SIZE, Size::new(1, 1), Size::new(0, 0), Size::new(0, 7)] {
            picture(
                &posed,
                &Camera::fitting(&whole, View::TOP, true, size),
                &Look {
                    samples: 3,
                    shadow: true,
                    thicker_px: 0.0,
                },
            );
            picture(&posed, &Camera::of_film(&skeleton, size), &LOOK);
        }
    }
}

/// Byte for byte the same twice, as everything that is written.
#[test]
fn the_same_picture_twice() {
    let skeleton = tree(4, 2);
    let mesh = wood(&skeleton);
    let draw = || {
        let model = Model::bare(&skeleton, &mesh, BARK);
        let posed = model.posed(None, &[]);
        picture(
            &posed,
            &Camera::fitting(&bounds(&posed), View::SIDE, false, SIZE),
            &Look {
                samples: 3,
                shadow: true,
                thicker_px: 0.0,
            },
        )
    };
    assert_eq!(draw(), draw());
}

/// What the terminal draws: no twig falls into pieces, however few the dots.
#[test]
fn thicker_wood_shows_every_twig_in_a_coarse_picture() {
    let skeleton = tree(6, 1);
    let mesh = wood(&skeleton);
    let model = Model::bare(&skeleton, &mesh, BARK);
    let posed = model.posed(None, &[]);
    let camera = Camera::fitting(&bounds(&posed), View::FRONT, false, Size::new(60, 80));
    let hit = |look: &Look| {
        let drawn = picture(&posed, &camera, look);
        let middles = (1..skeleton.nodes.len()).map(|i| {
            let from = skeleton.nodes[skeleton.nodes[i].parent.unwrap().index()].position;
            let [x, y, _] = camera.project(&nalgebra::center(&from, &skeleton.nodes[i].position));
            (-1..=1).any(|dx| {
                (-1..=1).any(|dy| drawn.at((x as i64 + dx) as u32, (y as i64 + dy) as u32)[3] > 0)
            })
        });
        middles.filter(|hit| *hit).count()
    };
    let coarse = Look {
        samples: 1,
        shadow: false,
        thicker_px: 0.5,
    };
    assert_eq!(hit(&coarse), skeleton.nodes.len() - 1);
}

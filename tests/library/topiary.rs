//! Topiary: the five shapes of docs/shapes (scripts/shapes.py draws them), what is cut, how it
//! moves, what is refused.

use crate::trees::Flat;
use arborcam::config::{self, Config};
use arborcam::draw;
use arborcam::model::{JointPose, NodeId, Outline, Pose, Rgb, Size, Skeleton};
use arborcam::pipeline::{Seen, cut_to, dress};
use arborcam::shape::{self, Drawn, Topiary, TopiaryError};
use nalgebra::{Point2, UnitQuaternion, Vector3};
use std::path::Path;

const SHAPES: [&str; 5] = ["triangle", "circle", "pentagon", "heart", "vase"];
const SEED: u64 = 1;

fn drawn(name: &str) -> Drawn {
    let path = Path::new("docs/shapes").join(name).with_extension("png");
    Drawn::of_image(&std::fs::read(path).expect("shape")).expect("a shape")
}

/// A shape of the picture's size: opaque where `inside` says so.
fn on_picture(size: Size, inside: impl Fn(u32, u32) -> bool) -> Vec<u8> {
    let pixels = (0..size.height).flat_map(|v| (0..size.width).map(move |u| (u, v)));
    pixels
        .flat_map(|(u, v)| [255, 255, 255, u8::from(inside(u, v)) * 255])
        .collect()
}

fn model(tree: &Flat) -> Skeleton {
    let mut model = shape::build(
        &tree.nodes,
        &tree.tracks,
        &tree.outline,
        &config::Shape::default(),
    );
    shape::thicken(
        &mut model,
        8.0,
        &|_, _| true,
        &config::Wood::default(),
        SEED,
    );
    model
}

fn cut(tree: &Flat, drawn: &Drawn) -> Result<Topiary, TopiaryError> {
    shape::topiary(
        &model(tree),
        &tree.outline,
        drawn,
        &config::Shape::default(),
        SEED,
    )
}

fn is_inside(shape: &Outline, at: Point2<f64>) -> bool {
    [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]
        .iter()
        .any(|d| shape.contains(at.x + d[0], at.y + d[1]))
}

#[test]
fn every_tree_fills_every_shape_and_stays_in_it() {
    for tree in Flat::all() {
        for name in SHAPES {
            let Topiary {
                skeleton,
                shape,
                cut,
                moves_as,
            } = cut(&tree, &drawn(name)).expect(name);
            println!("{} {name}: {cut:?}", tree.name);
            assert!(cut.coverage >= 0.85, "{} {name}: {cut:?}", tree.name);
            assert!(
                !cut.larger && cut.gone + cut.shortened > 0,
                "{} {name}: {cut:?}",
                tree.name
            );
            assert_eq!(moves_as.len(), skeleton.nodes.len());
            let measured = skeleton.measured();
            for (i, node) in skeleton.nodes.iter().enumerate().skip(1) {
                let what = || format!("{} {name}, node {i}", tree.name);
                assert!(node.parent.is_some_and(|p| p.index() < i), "{}", what());
                assert_eq!(node.copy_of.is_some(), i >= measured, "{}", what());
                assert!(
                    node.copy_of.is_none_or(|o| o.index() < measured),
                    "{}",
                    what()
                );
                let at = skeleton.image_from_model(&node.position);
                assert!(is_inside(&shape, at), "{}: at {at:?} it is outside", what());
                assert!(
                    node.radius <= skeleton.nodes[node.parent.expect("a parent").index()].radius,
                    "{}",
                    what()
                );
            }
            let names: std::collections::BTreeSet<_> =
                skeleton.nodes.iter().map(|n| n.name).collect();
            assert_eq!(
                names.len(),
                skeleton.nodes.len(),
                "{} {name}: names are given once",
                tree.name
            );
            // Full from the side as well: not a cut-out of cardboard.
            let spread = |c: usize| {
                let squares = skeleton
                    .nodes
                    .iter()
                    .map(|n| n.position[c] - skeleton.nodes[1].position[c]);
                (squares.map(|d| d * d).sum::<f64>() / skeleton.nodes.len() as f64).sqrt()
            };
            assert!(
                spread(2) > 0.3 * spread(0),
                "{} {name}: {} deep, {} wide",
                tree.name,
                spread(2),
                spread(0)
            );
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_tree_and_another_one_another() {
    let tree = Flat::generated(5);
    let of = |seed| {
        shape::topiary(
            &model(&tree),
            &tree.outline,
            &drawn("heart"),
            &config::Shape::default(),
            seed,
        )
    };
    assert_eq!(of(1), of(1));
    assert_ne!(
        of(1).expect("a tree").skeleton,
        of(2).expect("a tree").skeleton
    );
}

/// Zeng section 6.4: an image larger than the envelope changes nothing; the user must be able to be
/// told.
#[test]
fn a_shape_that_holds_the_whole_outline_changes_nothing() {
    let tree = Flat::generated(5);
    let all_but_a_corner = on_picture(tree.outline.size, |u, v| u + v > 3);
    let larger = Drawn::of_rgba(tree.outline.size, &all_but_a_corner).expect("a shape");
    let Topiary { skeleton, cut, .. } = cut(&tree, &larger).expect("a tree");
    assert!(
        cut.larger && cut.gone + cut.shortened + cut.grown == 0,
        "{cut:?}"
    );
    assert_eq!(skeleton, model(&tree));
}

/// The left half of the crown goes: no branch is there any more, and where one crossed the border
/// it ends at it.
#[test]
fn what_is_outside_is_cut_at_the_border_with_all_that_grows_from_it() {
    let tree = Flat::generated(5);
    let half = on_picture(tree.outline.size, |u, v| {
        u >= 300 && tree.outline.contains(u.into(), v.into())
    });
    let Topiary { skeleton, cut, .. } = cut(
        &tree,
        &Drawn::of_rgba(tree.outline.size, &half).expect("shape"),
    )
    .expect("tree");
    let u = |i: usize| skeleton.image_from_model(&skeleton.nodes[i].position)[0];
    assert!((0..skeleton.nodes.len()).all(|i| u(i) >= 299.0), "{cut:?}");
    assert!(cut.gone > 10 && cut.shortened > 0, "{cut:?}");
    let children = skeleton.children();
    let at_border = (2..skeleton.measured()).filter(|&i| u(i) < 302.0);
    assert!(
        at_border
            .clone()
            .all(|i| children[i].iter().all(|c| c.index() >= skeleton.measured()))
    );
}

/// A damaged capture may call a branch trunk, or a copy of one that is cut: what hangs in the air
/// goes as well, and no branch gets the number of one that is gone.
#[test]
fn what_is_called_trunk_goes_with_its_parent() {
    let tree = Flat::generated(5);
    let half = on_picture(tree.outline.size, |u, v| {
        u >= 300 && tree.outline.contains(u.into(), v.into())
    });
    let half = Drawn::of_rgba(tree.outline.size, &half).expect("shape");
    let whole = model(&tree);
    let mut damaged = whole.clone();
    let outside = |i: usize| {
        whole.nodes[i].level >= 2 && whole.image_from_model(&whole.nodes[i].position)[0] < 298.0
    };
    let hanging = (2..whole.nodes.len())
        .filter(|&i| whole.nodes[i].parent.is_some_and(|p| outside(p.index())));
    let hanging: Vec<usize> = hanging.collect();
    assert!(hanging.len() > 10);
    hanging.into_iter().for_each(|i| damaged.nodes[i].level = 1);
    for whole in [whole, damaged] {
        let cut = shape::topiary(
            &whole,
            &tree.outline,
            &half,
            &config::Shape::default(),
            SEED,
        )
        .expect("a tree");
        let nodes = &cut.skeleton.nodes;
        for (i, node) in nodes.iter().enumerate().skip(1) {
            assert!(
                node.parent.is_some_and(|p| p.index() < i),
                "node {i}: {node:?}"
            );
            assert!(
                node.copy_of.is_none_or(|of| of.index() < nodes.len()),
                "node {i}: {node:?}"
            );
        }
        let before: std::collections::BTreeSet<_> = whole.nodes.iter().map(|n| n.name).collect();
        let grown = &nodes[nodes.len() - cut.cut.grown..];
        assert!(cut.cut.gone > 10 && !grown.is_empty(), "{:?}", cut.cut);
        assert!(grown.iter().all(|n| !before.contains(&n.name)));
        assert_eq!(
            cut.pose(&whole, &pose(&whole, 0.2)).joints.len(),
            nodes.len()
        );
    }
}

/// Numbers that are used up must not begin again at 0, where the trunk is.
#[test]
fn names_that_are_used_up_are_not_given_again() {
    let tree = Flat::generated(5);
    let mut whole = model(&tree);
    whole.nodes.last_mut().expect("a node").name.0 = u32::MAX - 3;
    let cut = shape::topiary(
        &whole,
        &tree.outline,
        &drawn("heart"),
        &config::Shape::default(),
        SEED,
    )
    .expect("a tree");
    let names: std::collections::BTreeSet<_> = cut.skeleton.nodes.iter().map(|n| n.name).collect();
    assert_eq!((names.len(), cut.cut.grown), (cut.skeleton.nodes.len(), 3));
}

/// Every branch of the whole tree swings by its own angle; those of the cut one swing with them.
#[test]
fn the_cut_tree_moves_as_the_measured_one_does() {
    let tree = Flat::generated(5);
    let whole = model(&tree);
    let topiary = cut(&tree, &drawn("vase")).expect("a tree");
    let rest = pose(&whole, 0.0);
    for (joint, node) in topiary
        .pose(&whole, &rest)
        .joints
        .iter()
        .zip(&topiary.skeleton.nodes)
    {
        assert!(
            (joint.position - node.position).norm() < 1e-9,
            "at rest it stands as it was cut"
        );
    }
    let swung = topiary.pose(&whole, &pose(&whole, 0.3));
    let length = |at: &dyn Fn(usize) -> nalgebra::Point3<f64>, i: usize| {
        topiary.skeleton.nodes[i]
            .parent
            .map_or(0.0, |p| (at(i) - at(p.index())).norm())
    };
    let (mut moved, nodes) = (0, &topiary.skeleton.nodes);
    for i in 1..nodes.len() {
        let (is, was) = (
            length(&|k| swung.joints[k].position, i),
            length(&|k| nodes[k].position, i),
        );
        assert!((is - was).abs() < 1e-9, "branch {i}: {was} became {is}");
        moved += usize::from((swung.joints[i].position - nodes[i].position).norm() > 1.0);
        let parent = nodes[i].parent.expect("a parent").index();
        let own = (swung.joints[parent].rotation.inverse() * swung.joints[i].rotation).angle();
        assert!(
            (own - angle(topiary.moves_as[i], 0.3)).abs() < 1e-9,
            "branch {i} turns by {own}"
        );
    }
    assert!(moved > nodes.len() / 2, "{moved} of {}", nodes.len());
}

fn angle(node: NodeId, far: f64) -> f64 {
    far * (0.3 + 0.1 * (node.0 % 5) as f64)
}

/// Every measured branch turned by an angle of its own about the line of sight, copies in their
/// planes.
fn pose(skeleton: &Skeleton, far: f64) -> Pose {
    let mut joints: Vec<JointPose> = Vec::new();
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let parent = node.parent.map(|p| joints[p.index()]);
        let plane = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), node.plane_angle);
        let own = angle(
            node.copy_of.unwrap_or(NodeId(i as u32)),
            if i == 0 { 0.0 } else { far },
        );
        let turn =
            plane * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), own) * plane.inverse();
        let rotation = parent.map_or(turn, |p| p.rotation * turn);
        let way = node.parent.map_or(Vector3::zeros(), |p| {
            node.position - skeleton.nodes[p.index()].position
        });
        let position = parent.map_or(node.position, |p| p.position + rotation * way);
        joints.push(JointPose { position, rotation });
    }
    Pose {
        frame: 7,
        time_s: 0.25,
        joints,
    }
}

#[test]
fn shapes_that_are_none_are_refused_by_name() {
    let tree = Flat::generated(4);
    let size = tree.outline.size;
    let of = |rgba: &[u8]| Drawn::of_rgba(size, rgba);
    assert_eq!(
        of(&on_picture(size, |_, _| true)),
        Err(TopiaryError::NoShape)
    );
    assert_eq!(
        of(&on_picture(size, |_, _| false)),
        Err(TopiaryError::Empty)
    );
    assert!(matches!(
        Drawn::of_image(b"solid tree"),
        Err(TopiaryError::NoImage(_))
    ));
    assert!(matches!(of(&[0; 7]), Err(TopiaryError::NotWhole { .. })));
    assert!(matches!(
        Drawn::of_rgba(Size::new(0, 0), &[]),
        Err(TopiaryError::NotWhole { .. })
    ));
    let corner = of(&on_picture(size, |u, v| u < 20 && v < 20)).expect("a shape");
    assert_eq!(cut(&tree, &corner), Err(TopiaryError::OffTree));
    let nowhere = Outline {
        mask: vec![0; tree.outline.mask.len()],
        ..tree.outline.clone()
    };
    let placed = shape::topiary(
        &model(&tree),
        &nowhere,
        &drawn("heart"),
        &config::Shape::default(),
        SEED,
    );
    assert_eq!(placed.map(|t| t.cut), Err(TopiaryError::OffTree));
}

#[test]
fn a_tree_of_next_to_nothing_is_cut_all_the_same() {
    let tree = Flat::generated(4);
    let whole = model(&tree);
    for left in 0..4 {
        let mut skeleton = whole.clone();
        skeleton.nodes.truncate(left);
        if let Some(last) = skeleton.nodes.get_mut(2) {
            last.position.x = f64::NAN;
        }
        let cut = shape::topiary(
            &skeleton,
            &tree.outline,
            &drawn("circle"),
            &config::Shape::default(),
            SEED,
        );
        let cut = cut.expect("a tree");
        assert!(
            cut.skeleton
                .nodes
                .iter()
                .all(|n| n.position.coords.iter().all(|x| x.is_finite())),
            "{left} nodes"
        );
        let still = Pose {
            frame: 0,
            time_s: 0.0,
            joints: Vec::new(),
        };
        assert_eq!(
            cut.pose(&skeleton, &still).joints.len(),
            cut.skeleton.nodes.len()
        );
    }
}

/// A twig beside the shape is seen at once: the tree was cut, or pushed, to fill it.
/// What is seen in the end: the shape, full of leaves and wood.
#[test]
fn a_shape_is_full_in_the_picture_that_is_drawn_of_it() {
    let mut config = Config::default();
    config.leaves.show = config::LeafShow::On;
    for tree in Flat::all() {
        for name in SHAPES {
            let topiary = cut(&tree, &drawn(name)).expect(name);
            let (skeleton, shape) = (&topiary.skeleton, &topiary.shape);
            let seen = Seen {
                outline: Some(&tree.outline),
                cut_to: Some(shape),
                ..Seen::default()
            };
            let dressed = dress(skeleton, seen, &config);
            let model = draw::Model {
                foliage: &dressed.foliage,
                leaf: dressed
                    .foliage
                    .texture
                    .as_ref()
                    .and_then(|(_, bytes)| draw::Texture::read(bytes)),
                ..draw::Model::bare(skeleton, &dressed.wood[0], dressed.bark.rgb)
            };
            let camera = draw::Camera::of_film(skeleton, shape.size);
            let picture = draw::picture(&model.posed(None, &[]), &camera, &draw::Look::default());
            let inside: Vec<bool> = shape.mask.iter().map(|&m| m != 0).collect();
            let opaque = picture.pixels.chunks_exact(4).map(|p| p[3] > 127);
            let filled = opaque
                .zip(&inside)
                .filter(|(drawn, inside)| *drawn && **inside)
                .count();
            let share = filled as f64 / inside.iter().filter(|i| **i).count() as f64;
            println!("{} {name}: {share:.3} of the pixels", tree.name);
            assert!(
                share >= 0.85,
                "{} {name}: {share:.3} of the pixels",
                tree.name
            );
        }
    }
}

/// The shape says how far a tree goes, not whether it is in leaf: that is asked of the film.
#[test]
fn a_tree_that_was_filmed_bare_is_bare_in_its_shape() {
    let tree = Flat::generated(5);
    let topiary = cut(&tree, &drawn("heart")).expect("heart");
    let grey = Rgb {
        size: tree.outline.size,
        pixels: vec![128; 3 * tree.outline.size.area()],
    };
    let seen = Seen {
        picture: Some(&grey),
        outline: Some(&tree.outline),
        cut_to: Some(&topiary.shape),
        ..Seen::default()
    };
    assert!(
        dress(&topiary.skeleton, seen, &Config::default())
            .foliage
            .groups
            .is_empty()
    );
}

#[test]
fn twigs_keep_to_the_shape_that_the_tree_was_made_to_fill() {
    let tree = &Flat::all()[0];
    let whole = model(tree);
    let mut config = Config::default();
    let twig_ends = |skeleton: &Skeleton, seen: Seen, config: &Config| {
        let limbs = dress(skeleton, seen, config).limbs;
        limbs
            .iter()
            .filter(|l| l.twig)
            .map(|l| l.samples[l.samples.len() - 1].at)
            .collect::<Vec<_>>()
    };
    for name in ["heart", "vase"] {
        let cut = cut_to(&whole, &tree.outline, &drawn(name), &config).expect(name);
        let seen = Seen {
            outline: Some(&tree.outline),
            cut_to: Some(&cut.shape),
            ..Seen::default()
        };
        let envelope = shape::Envelope::of_drawn(&cut.shape, cut.skeleton.foot_px);
        let ends = twig_ends(&cut.skeleton, seen, &config);
        assert!(
            ends.len() > 100 && ends.iter().all(|end| envelope.contains(end)),
            "{name}"
        );
    }
    config.shape.envelope = config::EnvelopeKind::Hull;
    let measured: Vec<_> = whole.nodes[..whole.measured()]
        .iter()
        .map(|n| n.position)
        .collect();
    let hull = shape::Envelope::of_hull(&measured);
    let ends = twig_ends(
        &whole,
        Seen {
            outline: Some(&tree.outline),
            ..Seen::default()
        },
        &config,
    );
    assert!(
        ends.len() > 100 && ends.iter().all(|end| hull.contains(end)),
        "hull"
    );
}

//! The tree's skin: closed, outward, as fine as asked, and with weights that a renderer accepts.

use crate::synthetic;
use arborcam::config::Wood;
use arborcam::geometry::{LEVELS, Mesh, wood, wood_levels};
use arborcam::model::{NodeId, Skeleton};
use arborcam::shape::{CenterlineSample, Limb, SkinWeights};
use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use std::collections::HashMap;

fn vector(v: [f32; 3]) -> Vector3<f64> {
    Vector3::from(v.map(f64::from))
}

fn triangles(mesh: &Mesh) -> usize {
    mesh.indices.len() / 3
}

/// Everything that must hold for any mesh.
fn check(mesh: &Mesh, skeleton: &Skeleton) {
    let n = mesh.positions.len();
    assert_eq!(
        [
            mesh.normals.len(),
            mesh.uvs.len(),
            mesh.joints.len(),
            mesh.weights.len()
        ],
        [n; 4]
    );
    assert!(mesh.indices.len().is_multiple_of(3) && mesh.indices.iter().all(|&i| (i as usize) < n));
    assert!(
        mesh.positions
            .iter()
            .flatten()
            .chain(mesh.uvs.iter().flatten())
            .all(|x| x.is_finite())
    );
    for normal in &mesh.normals {
        assert!((vector(*normal).norm() - 1.0).abs() < 1e-5, "{normal:?}");
    }
    for (weights, joints) in mesh.weights.iter().zip(&mesh.joints) {
        assert!((weights.iter().sum::<f32>() - 1.0).abs() < 2e-7);
        assert!(joints.iter().all(|&j| (j as usize) < skeleton.nodes.len()));
        assert!(
            weights.iter().zip(joints).all(|(&w, &j)| w > 0.0 || j == 0),
            "{weights:?} {joints:?}"
        );
        assert!(
            weights[1] == 0.0 || joints[0] != joints[1],
            "a joint is named twice"
        );
    }
    check_closed(mesh);
}

/// Every edge is run along once in either direction: what is in one place and moves alike is one
/// corner, though texture or normal differ there.
fn check_closed(mesh: &Mesh) {
    let corner = |i: u32| {
        let i = i as usize;
        (
            mesh.positions[i].map(f32::to_bits),
            mesh.joints[i],
            mesh.weights[i].map(f32::to_bits),
        )
    };
    let mut edges = HashMap::new();
    for t in mesh.indices.chunks_exact(3) {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let (a, b) = (corner(a), corner(b));
            *edges.entry((a, b)).or_insert(0i64) += 1;
            *edges.entry((b, a)).or_insert(0i64) -= 1;
        }
    }
    let open = edges.values().filter(|&&n| n != 0).count();
    assert_eq!(open, 0, "edges with an open side, of {}", edges.len());
}

#[test]
fn the_skin_is_whole_from_every_side() {
    let skeleton = synthetic::tree(7, 3);
    let mesh = synthetic::skin(&skeleton);
    check(&mesh, &skeleton);
    let all = synthetic::limbs_of(&skeleton, &synthetic::bare());
    let is_buried = |at: Vector3<f64>| {
        all.iter()
            .flat_map(|l| l.samples.windows(2))
            .any(|s| is_within(at, s))
    };
    let (mut seen_inward, mut inward, mut area, mut flat) = (0.0, 0, 0.0, 0);
    for t in mesh.indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| vector(mesh.positions[i as usize]));
        let face = (b - a).cross(&(c - a));
        let normal: Vector3<f64> = t.iter().map(|&i| vector(mesh.normals[i as usize])).sum();
        flat += usize::from(face.norm() < 1e-9);
        area += face.norm();
        if face.dot(&normal) < 0.0 {
            inward += 1;
            seen_inward += if is_buried((a + b + c) / 3.0) {
                0.0
            } else {
                face.norm()
            };
        }
    }
    assert_eq!(flat, 0, "triangles without area");
    // Where a thick branch bends sharply, and in the fan of rings that rounds an elbow, faces on
    // the inner side fold; they lie inside the wood.
    println!(
        "{inward} of {} triangles look inward, {} of the area in sight",
        triangles(&mesh),
        seen_inward / area
    );
    assert!(
        inward * 200 < triangles(&mesh),
        "{inward} triangles look inward"
    );
    assert!(
        seen_inward < 1e-4 * area,
        "{} of the area is seen from inside",
        seen_inward / area
    );
}

/// Whether a point lies inside the wood between two samples, clearly below the surface.
fn is_within(at: Vector3<f64>, samples: &[CenterlineSample]) -> bool {
    let (from, way) = (samples[0].at.coords, samples[1].at - samples[0].at);
    let t = (at - from).dot(&way) / way.norm_squared();
    let radius = samples[0].radius + (samples[1].radius - samples[0].radius) * t;
    (0.0..=1.0).contains(&t) && (at - from - way * t).norm() < 0.98 * radius
}

#[test]
fn every_branch_reaches_its_node_and_every_tip_is_closed() {
    let skeleton = synthetic::tree(5, 2);
    let mesh = synthetic::skin(&skeleton);
    let children = skeleton.children();
    for (i, node) in skeleton.nodes.iter().enumerate().skip(1) {
        let wholly_own = |k: &usize| mesh.joints[*k][0] as usize == i && mesh.weights[*k][0] == 1.0;
        let own: Vec<usize> = (0..mesh.positions.len()).filter(wholly_own).collect();
        let at = |k: usize| (Point3::from(vector(mesh.positions[k])) - node.position).norm();
        let nearest = own.iter().map(|&k| at(k)).fold(f64::INFINITY, f64::min);
        if children[i].is_empty() {
            assert!(nearest < 1e-4, "the tip of {i} is {nearest} px off");
        } else {
            assert!(
                nearest < node.radius + 0.1,
                "branch {i} ends {nearest} px before its node"
            );
        }
    }
}

/// A crease shows as a corner whose faces disagree with its normal: along a limb that goes on in
/// another there is none.
#[test]
fn a_branch_goes_on_in_the_next_without_a_crease_or_a_step() {
    let mut skeleton = synthetic::tree(1, 1);
    for k in 1..4u32 {
        let mut next = skeleton.nodes[k as usize].clone();
        next.parent = Some(NodeId(k));
        next.level += 1;
        next.position += Vector3::new(20.0 * f64::from(k), 50.0, 10.0);
        skeleton.nodes.push(next);
    }
    skeleton.nodes.iter_mut().for_each(|n| n.radius = 10.0);
    let mesh = synthetic::skin(&skeleton);
    check(&mesh, &skeleton);
    let mut worst: f64 = 0.0;
    for t in mesh.indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| vector(mesh.positions[i as usize]));
        let Some(face) = (b - a).cross(&(c - a)).try_normalize(1e-9) else {
            continue;
        };
        let is_cap = t
            .iter()
            .all(|&i| vector(mesh.normals[i as usize]).dot(&face) > 0.999);
        for &i in t.iter().filter(|_| !is_cap) {
            worst = worst.max(vector(mesh.normals[i as usize]).angle(&face).to_degrees());
        }
    }
    assert!(
        worst < 25.0,
        "a face turns away from the skin by {worst} degrees"
    );
}

#[test]
fn the_number_of_triangles_is_what_was_asked_for() {
    let trees = [
        ("bare", synthetic::tree(7, 3), synthetic::bare()),
        ("twigs", synthetic::tree(6, 3), Wood::default()),
    ];
    let alone = ("a trunk alone", synthetic::tree(1, 1), synthetic::bare());
    for (name, skeleton, settings) in trees.iter().chain([&alone]) {
        let limbs = synthetic::limbs_of(skeleton, settings);
        for budget in [10_000, 20_000, 50_000, 100_000] {
            let mesh = wood(&limbs, budget);
            let ratio = triangles(&mesh) as f64 / budget as f64;
            assert!(
                (0.9..=1.1).contains(&ratio),
                "{name}: {} of {budget}",
                triangles(&mesh)
            );
            check(&mesh, skeleton);
        }
        let levels = wood_levels(&limbs, 30_000);
        for (mesh, share) in levels.iter().zip(LEVELS) {
            let ratio = triangles(mesh) as f64 / (30_000.0 * share);
            assert!(
                (0.9..=1.1).contains(&ratio),
                "{name}: {} at level {share}",
                triangles(mesh)
            );
        }
    }
}

/// u once around, v as long along the branch as u is around it: a picture of bark is neither
/// stretched nor squeezed.
#[test]
fn texture_is_as_long_as_it_is_wide() {
    let skeleton = synthetic::tree(4, 1);
    let mesh = synthetic::skin(&skeleton);
    let (mut off, mut all) = (0, 0);
    for t in mesh.indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| i as usize);
        let area = |p: [Vector3<f64>; 3]| (p[1] - p[0]).cross(&(p[2] - p[0])).norm();
        let on_skin = area([a, b, c].map(|i| vector(mesh.positions[i])));
        let on_picture = area(
            [a, b, c].map(|i| Vector3::new(mesh.uvs[i][0].into(), mesh.uvs[i][1].into(), 0.0)),
        );
        let longest = [a, b, c]
            .map(|i| mesh.uvs[i][0])
            .into_iter()
            .fold(0.0, f32::max)
            - [a, b, c]
                .map(|i| mesh.uvs[i][0])
                .into_iter()
                .fold(1.0, f32::min);
        assert!(
            longest <= 0.5 || on_picture > 0.0,
            "a triangle runs back over the seam"
        );
        // Around a thin limb a px of skin is more of the picture: its circumference says how much.
        let around = on_skin / on_picture.max(1e-12);
        all += 1;
        off += usize::from(!around.is_finite());
    }
    assert!(off * 100 < all, "{off} of {all}");
}

#[test]
fn degenerate_skeletons_give_no_nan_and_no_panic() {
    let good = synthetic::tree(4, 2);
    type Edit = fn(&mut Skeleton);
    let edits: [(&str, Edit); 10] = [
        ("no nodes", |s| s.nodes.clear()),
        ("only a foot", |s| s.nodes.truncate(1)),
        ("all nodes at one place", |s| {
            s.nodes
                .iter_mut()
                .for_each(|n| n.position = Point3::origin())
        }),
        ("a fork of no length", |s| {
            s.nodes[2].position = s.nodes[1].position
        }),
        ("a position that is no number", |s| {
            s.nodes[2].position.x = f64::NAN
        }),
        ("an endless branch", |s| {
            s.nodes[3].position.y = f64::INFINITY
        }),
        ("a huge branch", |s| s.nodes[3].position.y = 1e300),
        ("branches that turn back", |s| {
            s.nodes[2].position = Point3::new(4.0, 10.0, 0.0)
        }),
        ("no thickness", |s| {
            s.nodes.iter_mut().for_each(|n| n.radius = 0.0)
        }),
        ("a thickness that is no number", |s| {
            s.nodes[1].radius = f64::NAN
        }),
    ];
    for (name, edit) in edits {
        let mut skeleton = good.clone();
        edit(&mut skeleton);
        println!("{name}");
        for settings in [synthetic::bare(), Wood::default()] {
            let limbs = synthetic::limbs_of(&skeleton, &settings);
            for budget in [0, 100, 20_000] {
                check(&wood(&limbs, budget), &skeleton);
            }
        }
    }
}

#[test]
fn limbs_from_anywhere_are_drawn_or_left_out() {
    let skin = SkinWeights::between(NodeId(0), NodeId(1), 0.5);
    let at = |x: f64, radius: f64| CenterlineSample {
        at: Point3::new(x, 2.0 * x, 0.0),
        radius,
        skin,
    };
    let limb = |parent, samples| Limb {
        node: NodeId(1),
        parent,
        twig: false,
        made_up: false,
        samples,
    };
    let limbs = [
        limb(None, vec![]),
        limb(None, vec![at(0.0, 1.0)]),
        limb(Some(7), vec![at(0.0, 1.0), at(9.0, 1.0)]),
        limb(Some(0), vec![at(f64::NAN, 1.0), at(9.0, 1.0)]),
        limb(Some(2), vec![at(9.0, 1.0), at(9.0, 1.0)]),
        limb(Some(2), vec![at(9.0, -1.0), at(12.0, 1.0)]),
        limb(Some(2), vec![at(9.0, 1.0), at(12.0, 0.0)]),
    ];
    let mesh = wood(&limbs, 500);
    check(&mesh, &synthetic::tree(1, 1));
    assert!(triangles(&mesh) > 400, "two of them can be drawn");
}

/// Twigs and copies have nothing of what was filmed, nor that of them.
#[test]
fn wood_that_nobody_has_seen_is_marked() {
    let skeleton = synthetic::tree(3, 3);
    let limbs = synthetic::limbs_of(&skeleton, &Wood::default());
    let mesh = wood(&limbs, 30_000);
    let (seen, made_up) = (mesh.part(false), mesh.part(true));
    assert_eq!(triangles(&mesh), mesh.made_up.len());
    assert_eq!(triangles(&seen) + triangles(&made_up), triangles(&mesh));
    let filmed = limbs.iter().filter(|limb| !limb.made_up);
    let filmed: Vec<usize> = filmed.map(|limb| limb.node.index()).collect();
    let measured: Vec<usize> = (1..skeleton.measured()).collect();
    assert_eq!(filmed, measured);
    for joints in &seen.joints {
        let first = usize::from(joints[0]);
        assert!(first < skeleton.measured(), "a copy moves what was filmed");
    }
    assert!(
        triangles(&made_up) > triangles(&seen),
        "two copies of all, and twigs"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Skeletons of any shape, deep chains and stars, with places that are no numbers or the same.
    #[test]
    fn any_skeleton_gives_a_closed_skin(
        nodes in prop::collection::vec((0usize..40, -200.0f64..200.0, -200.0f64..300.0, -200.0f64..200.0, 0u8..12), 0..40),
        radius in prop::sample::select(vec![0.0, 0.3, 9.0, 1e6, f64::NAN, -3.0]),
        curl in 0.0f64..=1.0, twig_px in 0.0f64..40.0, budget in 0usize..30_000,
    ) {
        let mut skeleton = synthetic::tree(1, 1);
        let model = skeleton.nodes[1].clone();
        for (k, &(parent, x, y, z, odd)) in nodes.iter().enumerate() {
            let mut node = model.clone();
            node.parent = Some(NodeId((parent % (k + 2)) as u32));
            node.level = 2 + (k % 6) as u8;
            node.position = match odd {
                0 => skeleton.nodes[parent % (k + 2)].position,
                1 => Point3::new(f64::NAN, y, z),
                _ => Point3::new(x, y, z),
            };
            skeleton.nodes.push(node);
        }
        skeleton.nodes.iter_mut().for_each(|n| n.radius = radius);
        let settings = Wood { curl, twig_px, max_twigs: 300, ..Wood::default() };
        let limbs = synthetic::limbs_of(&skeleton, &settings);
        for limb in &limbs {
            prop_assert!(limb.samples.iter().all(|s| s.at.iter().all(|x| x.is_finite()) && s.radius >= 0.0));
        }
        check(&wood(&limbs, budget), &skeleton);
    }
}

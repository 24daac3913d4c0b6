//! The tree's skin: closed, outward, and with weights that a renderer accepts.

mod synthetic;

use arborcam::model::Skeleton;
use arborcam::shape::{Detail, Mesh, branches};
use nalgebra::{Point3, Vector3};

fn vector(v: [f32; 3]) -> Vector3<f64> {
    Vector3::from(v.map(f64::from))
}

/// Everything that must hold for any mesh.
fn check(mesh: &Mesh, skeleton: &Skeleton) {
    let n = mesh.positions.len();
    assert_eq!([mesh.normals.len(), mesh.uvs.len(), mesh.joints.len(), mesh.weights.len()], [n; 4]);
    assert!(mesh.indices.len().is_multiple_of(3) && mesh.indices.iter().all(|&i| (i as usize) < n));
    assert!(mesh.positions.iter().flatten().chain(mesh.uvs.iter().flatten()).all(|x| x.is_finite()));
    for normal in &mesh.normals {
        assert!((vector(*normal).norm() - 1.0).abs() < 1e-5, "{normal:?}");
    }
    for (weights, joints) in mesh.weights.iter().zip(&mesh.joints) {
        assert!((weights.iter().sum::<f32>() - 1.0).abs() < 2e-7);
        assert!(joints.iter().all(|&j| (j as usize) < skeleton.nodes.len()));
        assert!(weights.iter().zip(joints).all(|(&w, &j)| w > 0.0 || j == 0), "{weights:?} {joints:?}");
        assert!(weights[1] == 0.0 || joints[0] != joints[1], "a joint is named twice");
    }
}

#[test]
fn the_skin_is_whole_from_every_side() {
    let skeleton = synthetic::tree(7, 3);
    let mesh = branches(&skeleton, Detail::default());
    check(&mesh, &skeleton);
    let (mut inward, mut flat) = (0, 0);
    for t in mesh.indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| vector(mesh.positions[i as usize]));
        let face = (b - a).cross(&(c - a));
        let normal: Vector3<f64> = t.iter().map(|&i| vector(mesh.normals[i as usize])).sum();
        flat += usize::from(face.norm() < 1e-9);
        inward += usize::from(face.dot(&normal) < 0.0);
    }
    assert_eq!(flat, 0, "triangles without area");
    // Where a thick branch bends sharply, single faces on its inner side may fold; they lie inside the wood.
    assert!(inward * 1000 < mesh.indices.len() / 3, "{inward} triangles look inward");
}

#[test]
fn every_branch_reaches_its_node_and_every_tip_is_closed() {
    let skeleton = synthetic::tree(5, 2);
    let mesh = branches(&skeleton, Detail::default());
    let children = skeleton.children();
    for (i, node) in skeleton.nodes.iter().enumerate().skip(1) {
        let wholly_own = |k: &usize| mesh.joints[*k][0] as usize == i && mesh.weights[*k][0] == 1.0;
        let own: Vec<usize> = (0..mesh.positions.len()).filter(wholly_own).collect();
        let at = |k: usize| (Point3::from(vector(mesh.positions[k])) - node.position).norm();
        let nearest = own.iter().map(|&k| at(k)).fold(f64::INFINITY, f64::min);
        if children[i].is_empty() {
            assert!(nearest < 1e-4, "the tip of {i} is {nearest} px off");
        } else {
            assert!(nearest < node.radius + 0.1, "branch {i} ends {nearest} px before its node");
        }
    }
}

#[test]
fn degenerate_skeletons_give_no_nan_and_no_panic() {
    let good = synthetic::tree(4, 2);
    type Edit = fn(&mut Skeleton);
    let edits: [(&str, Edit); 8] = [
        ("no nodes", |s| s.nodes.clear()),
        ("only a foot", |s| s.nodes.truncate(1)),
        ("all nodes at one place", |s| s.nodes.iter_mut().for_each(|n| n.position = Point3::origin())),
        ("a fork of no length", |s| s.nodes[2].position = s.nodes[1].position),
        ("a position that is no number", |s| s.nodes[2].position.x = f64::NAN),
        ("branches that turn back", |s| s.nodes[2].position = Point3::new(4.0, 10.0, 0.0)),
        ("no thickness", |s| s.nodes.iter_mut().for_each(|n| n.radius = 0.0)),
        ("a thickness that is no number", |s| s.nodes[1].radius = f64::NAN),
    ];
    for (name, edit) in edits {
        let mut skeleton = good.clone();
        edit(&mut skeleton);
        println!("{name}");
        check(&branches(&skeleton, Detail { sides: 0, rings: 0 }), &skeleton);
        check(&branches(&skeleton, Detail::default()), &skeleton);
    }
}

#[test]
fn a_budget_is_kept() {
    let skeleton = synthetic::tree(7, 3);
    for budget in [20_000, 40_000, 100_000] {
        let detail = Detail::for_budget(skeleton.nodes.len() - 1, budget);
        let triangles = branches(&skeleton, detail).indices.len() / 3;
        assert!(triangles <= budget, "{triangles} triangles of {budget} with {detail:?}");
    }
    assert_eq!(Detail::for_budget(379, 1_000_000), Detail::default());
}

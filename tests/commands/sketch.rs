//! `arborcam sketch`: a tree of drawn strokes, and what bad drawings get.

use crate::support::names_in;
use crate::to_folder::{BAD_USAGE, FAILED, NO_INPUT, arborcam, done};
use arborcam::document::Document;
use arborcam::model::{NodeId, NodeKind, Skeleton};
use arborcam::signal::distance_to_segment;
use nalgebra::Point2;
use std::fs;
use std::path::Path;

const TREE: &str = "docs/sketches/tree.svg";
const CONIFER: &str = "docs/sketches/conifer.svg";

fn sketched(drawing: &str, out: &Path) -> Document {
    let said = done(&["sketch", drawing], out);
    assert!(
        !said.contains("note") && !said.contains("warning"),
        "{said}"
    );
    let document = Document::read(out, 60.0).expect("a document");
    assert_eq!(document.warnings, [""; 0]);
    document
}

/// The pieces of a tree as they appear in the picture, without copies.
fn pieces_px(skeleton: &Skeleton) -> Vec<[Point2<f64>; 2]> {
    let drawn = &skeleton.nodes[..skeleton.measured()];
    let mut pieces = Vec::new();
    for node in drawn {
        if let Some(parent) = node.parent {
            let ends = [&skeleton.nodes[parent.index()], node];
            pieces.push(ends.map(|n| skeleton.image_from_model(&n.position)));
        }
    }
    pieces
}

/// Every place of the drawing is on the tree in the picture, and every node on the drawing.
#[test]
fn the_tree_looks_like_the_sketch() {
    let dir = tempfile::tempdir().expect("tempdir");
    for (name, drawing) in [("tree", TREE), ("conifer", CONIFER)] {
        let tree = sketched(drawing, &dir.path().join(name));
        let sketch = arborcam::import::read_sketch(&fs::read(drawing).expect("drawing"));
        let strokes = sketch.expect("a sketch").strokes;
        let pieces = pieces_px(&tree.skeleton);
        for stroke in &strokes {
            for point in &stroke.points_px {
                let offs = pieces
                    .iter()
                    .map(|[a, b]| distance_to_segment(*point, *a, *b));
                let off = offs.fold(f64::INFINITY, f64::min);
                assert!(
                    off < 1.5,
                    "{}: {point} is {off} px off the tree",
                    stroke.name
                );
            }
        }
        for [_, end] in &pieces {
            let lines = strokes.iter().flat_map(|s| s.points_px.windows(2));
            let offs = lines.map(|pair| distance_to_segment(*end, pair[0], pair[1]));
            let off = offs.fold(f64::INFINITY, f64::min);
            assert!(off < 1.5, "{end} is {off} px off the drawing");
        }
    }
}

#[test]
fn it_is_a_document_that_stands_in_space() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("tree");
    let tree = sketched(TREE, &out);
    assert_eq!(names_in(&out), ["capture.json", "nodes.csv", "tree.glb"]);
    let nodes = &tree.skeleton.nodes;
    assert!(
        nodes
            .iter()
            .all(|n| n.kind == NodeKind::Traced && n.n_tracks == 0)
    );
    assert!(
        nodes.len() > 2 * tree.skeleton.measured(),
        "there are copies"
    );
    assert_eq!(tree.note.source.name, "tree.svg");
    // As thick as it is drawn, and as deep as it is wide.
    assert!((nodes[1].radius - 13.0).abs() < 1e-3, "{}", nodes[1].radius);
    let reach = |axis: usize| {
        nodes
            .iter()
            .map(|n| n.position[axis].abs())
            .fold(0.0, f64::max)
    };
    assert!(
        reach(2) > 0.4 * reach(0),
        "{} deep, {} wide",
        reach(2),
        reach(0)
    );
    // All commands that take a tree that was not filmed.
    let shown = out.to_str().expect("path");
    done(&["render", shown], &dir.path().join("tree.png"));
    done(
        &["export", shown, "--format", "obj"],
        &dir.path().join("tree.obj"),
    );
    done(
        &["animate", shown, "--wind", "4", "--seconds", "2"],
        &dir.path().join("tree.glb"),
    );
    // And it is the same again.
    sketched(TREE, &dir.path().join("again"));
    for file in names_in(&out) {
        let [one, other] =
            ["tree", "again"].map(|d| fs::read(dir.path().join(d).join(&file)).expect("file"));
        assert!(one == other, "{file} differs");
    }
}

/// Li 2011 fig. 9: the trunk that the user marks is neither copied nor pushed.
#[test]
fn the_marked_trunk_of_a_conifer_stays_one() {
    let dir = tempfile::tempdir().expect("tempdir");
    let skeleton = sketched(CONIFER, &dir.path().join("conifer")).skeleton;
    let is_on_trunk = |n: &NodeId| {
        let node = &skeleton.nodes[n.index()];
        node.copy_of.is_none() && node.position.x.abs() < 1e-6
    };
    let trunk: Vec<NodeId> = (0..skeleton.nodes.len() as u32)
        .map(NodeId)
        .filter(is_on_trunk)
        .collect();
    assert!(trunk.len() > 20, "{}", trunk.len());
    for node in trunk {
        assert_eq!(skeleton.nodes[node.index()].position.z, 0.0);
        let is_copied = skeleton.nodes.iter().any(|n| n.copy_of == Some(node));
        assert!(!is_copied, "{node:?}");
    }
}

/// A document without a film is an example as any other.
#[test]
fn trees_are_grown_of_a_sketch() {
    let dir = tempfile::tempdir().expect("tempdir");
    let tree = dir.path().join("tree");
    let drawn = sketched(TREE, &tree).skeleton;
    let shown = tree.to_str().expect("path");
    for (name, more) in [
        ("forks", &["--motion", "none"][..]),
        (
            "angles",
            &[
                "--like",
                "von-mises",
                "--threshold",
                "0.3",
                "--motion",
                "none",
            ],
        ),
        ("wind", &["--motion", "wind"]),
    ] {
        let out = dir.path().join(name);
        done(&[&["grow", shown, "--count", "2"], more].concat(), &out);
        assert_eq!(names_in(&out), ["tree-0001", "tree-0002"]);
        let grown = Document::read(&out.join("tree-0001"), 60.0).expect("a document");
        assert_eq!(grown.poses.is_empty(), name != "wind");
        let ratio = height_px(&grown.skeleton) / height_px(&drawn);
        assert!((0.7..1.3).contains(&ratio), "{name}: {ratio}");
    }
}

fn height_px(skeleton: &Skeleton) -> f64 {
    let heights = skeleton.nodes.iter().map(|n| n.position.y);
    heights.fold(0.0, f64::max)
}

fn svg(inside: &str) -> String {
    format!(r#"<svg xmlns="http://www.w3.org/2000/svg" width="640" height="480">{inside}</svg>"#)
}

#[test]
fn bad_drawings_get_one_line_and_leave_nothing() {
    let dir = tempfile::tempdir().expect("tempdir");
    let trunk = r#"<path id="trunk" d="M320 450 L320 200"/>"#;
    let far = svg(&format!(r#"{trunk}<path id="far" d="M500 100 L600 50"/>"#));
    let cases = [
        ("empty.svg", String::new(), "empty"),
        ("words.svg", "words".into(), "neither SVG nor JSON"),
        ("cut.svg", svg(trunk)[..80].to_owned(), "damaged"),
        (
            "none.svg",
            svg("<rect width='9' height='9'/>"),
            "no strokes",
        ),
        (
            "turned.svg",
            svg(&format!("<g transform='turn(9)'>{trunk}</g>")),
            "transform",
        ),
        ("far.svg", far, "\"far\" meets no other stroke"),
        (
            "nan.json",
            r#"{"width": 640, "height": 480, "strokes": [{"polyline_px": [[NaN, 1], [2, 3]]}]}"#
                .into(),
            "damaged",
        ),
        (
            "two.svg",
            svg(&format!("{trunk}<path class='trunk' d='M1 1 L2 90'/>")),
            "mark one",
        ),
    ];
    let out = dir.path().join("out");
    for (name, content, expected) in cases {
        let file = dir.path().join(name);
        fs::write(&file, content).expect("write");
        let output = arborcam(&["sketch", file.to_str().expect("path")], &out);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(FAILED), "{name}: {said}");
        assert!(
            said.contains(expected) && said.contains(name),
            "{name}: {said}"
        );
        assert_eq!(said.lines().count(), 1, "{name}: {said}");
    }
    let endless = arborcam(&["sketch", "/dev/zero"], &out);
    assert_eq!(endless.status.code(), Some(NO_INPUT));
    assert!(String::from_utf8_lossy(&endless.stderr).contains("more than"));
    let absent = dir.path().join("absent.svg");
    let absent = arborcam(&["sketch", absent.to_str().expect("path")], &out);
    assert_eq!(absent.status.code(), Some(NO_INPUT));
    let planes = arborcam(&["sketch", TREE, "--planes", "900"], &out);
    assert_eq!(planes.status.code(), Some(BAD_USAGE));
    let taken = arborcam(&["sketch", TREE], dir.path());
    assert_eq!(taken.status.code(), Some(FAILED));
    assert!(
        !names_in(dir.path()).iter().any(|n| n.contains("out")),
        "something is left"
    );
}

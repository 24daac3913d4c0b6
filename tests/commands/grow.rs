//! `arborcam grow`: what a user gets from an example, and what bad input gets.

use crate::support::{names_in, replayed as example};
use arborcam::document::note::ModelNote;
use arborcam::document::{CaptureNote, Document};
use arborcam::model::{NodeKind, Skeleton, Swaying, Timing};
use arborcam::pipeline::reshape;
use arborcam::shape::{Angles, Envelope, envelope_distance};
use arborcam::views::{Draft, PrepareError, example_outline, write_document};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::atomic::AtomicBool;

const FAILED: i32 = 1;
const BAD_USAGE: i32 = 2;
const NO_INPUT: i32 = 3;

fn grow(example: &Path, out: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command.arg("grow").arg(example).args(more).arg("--out");
    command.arg(out).output().expect("arborcam")
}

/// Grows into `out` and returns the trees.
fn grown(out: &Path, more: &[&str]) -> Vec<Document> {
    let output = grow(example(), out, more);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    assert!(!told.contains("warning"), "{told}");
    let mut trees = Vec::new();
    for name in names_in(out) {
        let tree = Document::read(&out.join(name), 60.0).expect("a document");
        assert_eq!(tree.warnings, [""; 0]);
        trees.push(tree);
    }
    trees
}

/// Every file below a folder with its bytes.
fn bytes_of(dir: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for name in names_in(dir) {
        let bytes = fs::read(dir.join(&name)).expect("file");
        files.push((name, bytes));
    }
    files
}

/// What distinguishes one tree from another.
fn form(skeleton: &Skeleton) -> Vec<[f64; 3]> {
    let places = skeleton.nodes.iter().map(|n| n.position);
    places.map(|p| [p.x, p.y, p.z]).collect()
}

#[test]
fn each_tree_is_a_document_of_its_own_that_moves() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("trees");
    let trees = grown(&out, &["--count", "3", "--seed", "5"]);
    assert_eq!(names_in(&out), ["tree-0001", "tree-0002", "tree-0003"]);
    let filmed = Document::tree(example()).expect("example");
    let mut files = vec!["capture.json", "motion.csv", "nodes.csv", "tree.glb"];
    if filmed.bark.is_some() {
        files.insert(0, "bark.png");
    }
    assert_eq!(names_in(&out.join("tree-0002")), files);
    for tree in &trees {
        let nodes = &tree.skeleton.nodes;
        assert!(nodes.iter().all(|n| n.kind == NodeKind::Grown));
        assert!(nodes.iter().all(|n| n.n_tracks == 0));
        // As tall as the example, within the outline's own margin.
        let height = |s: &Skeleton| s.nodes.iter().map(|n| n.position.y).fold(0.0, f64::max);
        let ratio = height(&tree.skeleton) / height(&filmed.skeleton);
        assert!((0.7..1.3).contains(&ratio), "{ratio}");
        let (first, last) = (&tree.poses[0], tree.poses.last().expect("poses"));
        for (a, b) in first.joints.iter().zip(&last.joints) {
            assert!(
                (a.position - b.position).norm() < 1e-3,
                "the loop has a seam"
            );
        }
        let middle = &tree.poses[tree.poses.len() / 2];
        let pairs = first.joints.iter().zip(&middle.joints);
        assert!(
            pairs
                .map(|(a, b)| (a.position - b.position).norm())
                .any(|way| way > 0.1)
        );
    }
    assert_ne!(form(&trees[0].skeleton), form(&trees[1].skeleton));
}

/// A tree depends on seed and number, not on how many others there are.
#[test]
fn the_same_seed_gives_the_same_bytes() {
    let dir = tempfile::tempdir().expect("tempdir");
    let at = |name: &str| dir.path().join(name);
    grown(&at("one"), &["--count", "2", "--seed", "9"]);
    grown(&at("more"), &["--count", "3", "--seed", "9"]);
    grown(&at("other"), &["--count", "2", "--seed", "10"]);
    let second = |name: &str| bytes_of(&at(name).join("tree-0002"));
    assert!(
        second("one") == second("more"),
        "the same seed, other bytes"
    );
    assert!(
        second("one") != second("other"),
        "another seed, the same bytes"
    );
}

#[test]
fn von_mises_keeps_the_branches_and_their_lengths() {
    let dir = tempfile::tempdir().expect("tempdir");
    let more = ["--count", "2", "--like", "von-mises", "--threshold", "0.3"];
    let trees = grown(&dir.path().join("trees"), &more);
    let filmed = Document::tree(example()).expect("example").skeleton;
    let measured = filmed.measured();
    let mut turned = 0;
    for tree in &trees {
        let new = &tree.skeleton;
        assert_eq!(new.measured(), measured);
        for (old, own) in filmed.nodes.iter().zip(&new.nodes).take(measured) {
            assert_eq!(old.parent, own.parent);
            let Some(parent) = old.parent.map(|p| p.index()) else {
                continue;
            };
            let flat = |s: &Skeleton, a: usize, b: usize| {
                (s.nodes[a].position - s.nodes[b].position).xy().norm()
            };
            let at = filmed
                .nodes
                .iter()
                .position(|n| n.name == old.name)
                .expect("itself");
            let off = flat(&filmed, at, parent) - flat(new, at, parent);
            assert!(off.abs() < 1e-3, "a branch is longer by {off} px");
            turned += usize::from((old.position - own.position).xy().norm() > 1.0);
        }
    }
    assert!(turned > 0, "no branch was turned");
}

#[test]
fn trees_move_as_they_are_told() {
    let dir = tempfile::tempdir().expect("tempdir");
    let at_rest = grown(
        &dir.path().join("rest"),
        &["--count", "1", "--motion", "none"],
    );
    assert!(at_rest[0].poses.is_empty() && !at_rest[0].has_motion());
    let in_wind = grown(
        &dir.path().join("wind"),
        &["--count", "1", "--motion", "wind"],
    );
    let (first, last) = (
        &in_wind[0].poses[0],
        in_wind[0].poses.last().expect("poses"),
    );
    assert!((last.time_s - first.time_s - 10.0).abs() < 1e-6);
    assert_eq!(form(&at_rest[0].skeleton), form(&in_wind[0].skeleton));
    // An example of one's own: what was grown at rest.
    let again = dir.path().join("again");
    let output = grow(
        &dir.path().join("rest/tree-0001"),
        &again,
        &["--count", "1"],
    );
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && told.contains("stand still"),
        "{told}"
    );
}

/// The same tree, at first as it was grown, then as a scan on which a film was laid.
#[test]
fn frequencies_that_were_measured_on_a_scan_move_its_trees() {
    let dir = tempfile::tempdir().expect("tempdir");
    let at_rest = ["--count", "1", "--motion", "none"];
    grown(&dir.path().join("rest"), &at_rest);
    let example = dir.path().join("rest/tree-0001");
    let known = Document::read(&example, 60.0).expect("a tree").sway;
    assert!(known.iter().any(Result::is_ok), "no branch has a frequency");
    let path = example.join("capture.json");
    let text = fs::read_to_string(&path).expect("note");
    let mut note: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let film = serde_json::json!({
        "turn_deg": 0, "roll_deg": 0, "px_per_metre": 100, "miss": 0.01, "other_side_miss": 0.05, "branches": 3
    });
    let scan = serde_json::json!({
        "foot_m": [0, 0, 0], "points": 1, "ground_points": 0, "noise_points": 0, "apart_points": 0, "cell_m": 0.01,
        "noise_m": 0.001, "twig_radius_m": 0.002
    });
    for (with_film, expected) in [(false, "stand still"), (true, "sway in wind")] {
        note["scan"] = scan.clone();
        if with_film {
            note["scan"]["film"] = film.clone();
        }
        fs::write(&path, note.to_string()).expect("write");
        let out = dir.path().join(expected);
        let output = grow(&example, &out, &["--count", "1"]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && said.contains(expected), "{said}");
        let tree = Document::read(&out.join("tree-0001"), 60.0).expect("a tree");
        assert_eq!(tree.poses.is_empty(), !with_film);
        let hz = |sway: &Swaying| sway.ok().map(|sway| sway.frequency_hz.value);
        let frequencies: Vec<f64> = known.iter().filter_map(hz).collect();
        let mut own = tree.sway.iter().filter_map(hz).peekable();
        assert!(own.peek().is_some(), "no branch has a frequency");
        assert!(own.all(|f| frequencies.contains(&f)));
    }
}

#[test]
fn trees_fill_a_drawn_shape() {
    let dir = tempfile::tempdir().expect("tempdir");
    let polygon = dir.path().join("shape.json");
    let text = r#"{"width": 100, "height": 100, "polygon_px": [[5, 99], [95, 99], [50, 2]]}"#;
    fs::write(&polygon, text).expect("write");
    let image = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/shapes/heart.png");
    for (name, shape) in [
        ("polygon", polygon.to_str().expect("path")),
        ("image", image),
    ] {
        let more = ["--count", "1", "--motion", "none", "--envelope", shape];
        let tree = grown(&dir.path().join(name), &more).remove(0);
        let outline = tree.outline.as_ref().expect("the shape");
        for node in &tree.skeleton.nodes[1..tree.skeleton.measured()] {
            let at = tree.skeleton.image_from_model(&node.position);
            assert!(outline.contains(at.x, at.y), "{name}: {at:?} is outside");
        }
    }
}

#[test]
fn bad_input_gets_one_line_and_leaves_nothing() {
    let dir = tempfile::tempdir().expect("tempdir");
    let at = |name: &str| dir.path().join(name).to_str().expect("path").to_owned();
    fs::write(at("words.json"), "{ words").expect("write");
    fs::write(at("words.png"), "words").expect("write");
    fs::write(
        at("off.json"),
        r#"{"width": 640, "height": 360, "polygon_px": [[1, 1], [9, 1], [9, 5]]}"#,
    )
    .expect("write");
    let flat = r#"{"width": 640, "height": 360, "polygon_px": [[1, 1], [9, 1]]}"#;
    fs::write(at("flat.json"), flat).expect("write");
    let (no_shape, words, off, flat) = (
        at("none.png"),
        at("words.png"),
        at("off.json"),
        at("flat.json"),
    );
    let words_json = at("words.json");
    let cases: [(&[&str], i32, &str); 14] = [
        (&["--count", "0"], BAD_USAGE, "--count"),
        (&["--count", "many"], BAD_USAGE, "--count"),
        (&[], BAD_USAGE, "--count"),
        (&["--count", "1", "--like", "oak"], BAD_USAGE, "--like"),
        (
            &["--count", "1", "--motion", "storm"],
            BAD_USAGE,
            "--motion",
        ),
        (
            &["--count", "1", "--threshold", "0.4"],
            BAD_USAGE,
            "von-mises",
        ),
        (
            &["--count", "1", "--from-level", "3"],
            BAD_USAGE,
            "von-mises",
        ),
        (
            &["--count", "1", "--like", "von-mises", "--threshold", "900"],
            BAD_USAGE,
            "give less",
        ),
        (
            &["--count", "1", "--like", "von-mises", "--envelope", &off],
            BAD_USAGE,
            "dirichlet",
        ),
        (
            &["--count", "1", "--envelope", &no_shape],
            BAD_USAGE,
            "none.png",
        ),
        (
            &["--count", "1", "--envelope", &words],
            BAD_USAGE,
            "no image",
        ),
        (
            &["--count", "1", "--envelope", &words_json],
            BAD_USAGE,
            "polygon_px",
        ),
        (
            &["--count", "1", "--envelope", &off],
            BAD_USAGE,
            "off the trunk",
        ),
        (&["--count", "1", "--envelope", &flat], BAD_USAGE, "corners"),
    ];
    for (more, status, expected) in cases {
        let out = dir.path().join("trees");
        let output = grow(example(), &out, more);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(status), "{more:?}: {told}");
        assert!(told.contains(expected), "{more:?}: {told}");
        assert!(!out.exists(), "{more:?} left something behind");
    }
    let nothing = grow(
        &dir.path().join("nothing"),
        &dir.path().join("trees"),
        &["--count", "1"],
    );
    assert_eq!(nothing.status.code(), Some(NO_INPUT));
    let taken = grow(example(), dir.path(), &["--count", "1"]);
    assert_eq!(taken.status.code(), Some(FAILED));
}

/// Writes the tree of the example without what hangs on its trunk, if it is not stopped.
fn write_bare_trunk(to: &Path, is_stopped: bool) -> Result<(), PrepareError> {
    let filmed = Document::tree(example()).expect("example");
    let mut trunk = Skeleton::clone(&filmed.skeleton);
    let end = trunk.measured_branches().next().expect("a trunk");
    let parts: Vec<usize> = (0..=end.index()).collect();
    trunk.nodes.truncate(parts.len());
    trunk.nodes.retain(|n| n.level < 2);
    let note = CaptureNote {
        timing: Timing::default(),
        model: Some(ModelNote::of(&trunk, 0.0)),
        picture: None,
        bark: None,
        masks: None,
        build: None,
        refinement: None,
        animation: None,
        ..filmed.note
    };
    let draft = Draft {
        note,
        skeleton: &trunk,
        picture: None,
        bark: None,
        at_rest: None,
        poses: Vec::new(),
        pose_in_picture: None,
    };
    write_document(to, draft, &[], &AtomicBool::new(is_stopped))
}

#[test]
fn a_document_is_whole_or_not_there() {
    let dir = tempfile::tempdir().expect("tempdir");
    let trunk = dir.path().join("trunk");
    write_bare_trunk(&trunk, true).expect_err("stopped");
    assert_eq!(fs::read_dir(dir.path()).expect("folder").count(), 0);
    write_bare_trunk(&trunk, false).expect("written");
    assert!(Document::tree(&trunk).is_ok());
}

#[test]
fn an_example_that_says_nothing_is_refused() {
    let dir = tempfile::tempdir().expect("tempdir");
    let trunk = dir.path().join("trunk");
    write_bare_trunk(&trunk, false).expect("written");
    let cases: [(&[&str], &str); 2] = [
        (&["--count", "1"], "0 forks"),
        (
            &["--count", "1", "--motion", "example", "--like", "von-mises"],
            "no motion",
        ),
    ];
    for (more, expected) in cases {
        let out = dir.path().join("trees");
        let output = grow(&trunk, &out, more);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(FAILED), "{told}");
        assert!(told.contains(expected), "{told}");
        assert!(!out.exists());
    }
}

/// A new tree has no film whose length its note could say.
#[test]
fn a_new_tree_is_drawn_at_any_moment_of_its_loop() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("trees");
    grown(&out, &["--count", "1"]);
    for (k, at_s) in ["0", "3", "9.9", "11"].into_iter().enumerate() {
        let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
        command
            .arg("render")
            .arg(out.join("tree-0001"))
            .args(["--at", at_s, "--bare"]);
        let picture = dir.path().join(format!("{k}.png"));
        let output = command
            .arg("--out")
            .arg(&picture)
            .output()
            .expect("arborcam");
        assert_eq!(output.status.success(), at_s != "11", "{at_s} s");
        assert_eq!(picture.exists(), at_s != "11", "{at_s} s");
    }
}

/// New trees fill the example's envelope as well as it does and have angles as likely as its: medians
/// of twenty, with some room for chance.
#[test]
fn new_trees_stand_in_space_as_the_example_does() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("trees");
    let more = ["--count", "20", "--seed", "9", "--motion", "none"];
    let trees = grown(&out, &more);
    let document = Document::read(example(), 0.0).expect("a capture");
    let mut config = document.note.config.clone();
    config.shape.planes = config.shape.planes_of(document.note.is_of_bare());
    let outline = example_outline(&document).expect("an outline");
    let stood = reshape(&document.skeleton, outline, &config);
    let places: Vec<_> = stood.nodes.iter().map(|n| n.position).collect();
    let envelope = Envelope::of_filmed(config.shape.envelope, outline, stood.foot_px, &places);
    let attractors = config.shape.attractors as usize;
    let distance_px = |tree: &Skeleton| envelope_distance(tree, &envelope, attractors);
    let likelihood = |tree: &Skeleton| Angles::of(tree, &config.shape).likelihood(tree);
    let (mut fillings, mut plausibilities) = (Vec::new(), Vec::new());
    for tree in &trees {
        let tree = &tree.skeleton;
        fillings.push(distance_px(&stood) / distance_px(tree));
        plausibilities.push(likelihood(tree) / likelihood(&stood));
    }
    let (filling, plausibility) = (median(fillings), median(plausibilities));
    assert!(filling > 0.9, "{filling}");
    assert!(plausibility > 0.9, "{plausibility}");
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

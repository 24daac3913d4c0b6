//! `arborcam grow` with examples that are no captures: drawings and modelled trees; and what bad
//! ones get, a full disk and Ctrl-C in the middle among them.

use crate::small_disk::SmallDisk;
use crate::support::{names_in, replayed};
use crate::to_folder::{FAILED, NO_INPUT, command, done};
use arborcam::document::Document;
use arborcam::import::{StandingModel, read_model};
use arborcam::model::{NodeId, Skeleton, Sway};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;

const STOPPED: i32 = 130;
const DRAWING: &str = "docs/sketches/tree.svg";

fn text(path: &Path) -> &str {
    path.to_str().expect("path")
}

/// The tree of the drawing, made once, in files of all formats.
fn models() -> &'static Path {
    static MADE: OnceLock<TempDir> = OnceLock::new();
    let dir = MADE.get_or_init(|| {
        let dir = tempfile::tempdir().expect("tempdir");
        let at = |name: &str| dir.path().join(name);
        done(&["sketch", DRAWING], &at("tree"));
        done(
            &["export", text(&at("tree")), "--format", "gltf"],
            &at("tree.gltf"),
        );
        done(
            &["export", text(&at("tree")), "--format", "csv"],
            &at("tables"),
        );
        let skeleton = &Document::read(&at("tree"), 0.0).expect("tree").skeleton;
        fs::write(at("lines.obj"), as_obj(skeleton)).expect("write");
        fs::write(at("edges.ply"), as_ply(skeleton)).expect("write");
        fs::write(at("segments.txt"), as_treefile(skeleton, false)).expect("write");
        fs::write(at("thick.txt"), as_treefile(skeleton, true)).expect("write");
        fs::write(at("nodes.gltf"), as_gltf(skeleton)).expect("write");
        dir
    });
    dir.path()
}

/// Each branch as a line for itself.
fn as_obj(skeleton: &Skeleton) -> String {
    let mut file = String::new();
    for node in &skeleton.nodes {
        let [x, y, z] = node.position.into();
        writeln!(file, "v {x} {y} {z}").expect("text");
    }
    for (i, node) in skeleton.nodes.iter().enumerate() {
        if let Some(parent) = node.parent {
            writeln!(file, "l {} {}", parent.0 + 1, i + 1).expect("text");
        }
    }
    file
}

/// With z up.
fn as_ply(skeleton: &Skeleton) -> String {
    let nodes = skeleton.nodes.len();
    let mut file = format!(
        "ply\nformat ascii 1.0\nelement vertex {nodes}\nproperty double x\nproperty double y\n\
         property double z\nelement edge {}\nproperty int vertex1\nproperty int vertex2\nend_header\n",
        nodes - 1
    );
    for node in &skeleton.nodes {
        let [x, y, z] = node.position.into();
        writeln!(file, "{x} {} {y}", -z).expect("text");
    }
    for (i, node) in skeleton.nodes.iter().enumerate() {
        if let Some(parent) = node.parent {
            writeln!(file, "{} {i}", parent.0).expect("text");
        }
    }
    file
}

/// With z up, as RayCloudTools write it, or without radii.
fn as_treefile(skeleton: &Skeleton, has_radii: bool) -> String {
    let radius = if has_radii { "radius," } else { "" };
    let mut file = format!("# Tree file.\nheight, x,y,z,{radius}parent_id\n1");
    for node in &skeleton.nodes {
        let [x, y, z] = node.position.into();
        let parent = node.parent.map_or(-1, |parent| i64::from(parent.0));
        write!(file, ", {x},{},{y},", -z).expect("text");
        if has_radii {
            write!(file, "{},", node.radius).expect("text");
        }
        write!(file, "{parent}").expect("text");
    }
    file
}

/// A tree of nodes without a skin.
fn as_gltf(skeleton: &Skeleton) -> String {
    let mut nodes = Vec::new();
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let below = node.parent.map(|p| skeleton.nodes[p.index()].position);
        let way = below.map_or(node.position.coords, |below| node.position - below);
        let children = (0..skeleton.nodes.len() as u32)
            .filter(|c| skeleton.nodes[*c as usize].parent == Some(NodeId(i as u32)));
        let children: Vec<u32> = children.collect();
        let children = match children[..] {
            [] => String::new(),
            _ => format!(r#""children": {children:?}, "#),
        };
        nodes.push(format!(
            r#"{{{children}"translation": [{}, {}, {}]}}"#,
            way.x, way.y, way.z
        ));
    }
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{}]}}"#,
        nodes.join(",")
    )
}

fn grown(example: &Path, out: &Path, more: &[&str]) -> Document {
    let said = done(
        &[&["grow", text(example), "--count", "2"], more].concat(),
        out,
    );
    assert!(!said.contains("warning"), "{said}");
    assert_eq!(names_in(out), ["tree-0001", "tree-0002"]);
    Document::read(&out.join("tree-0002"), 60.0).expect("a document")
}

fn forks_and_tips(skeleton: &Skeleton) -> [usize; 2] {
    let children = skeleton.children();
    let count = |wanted: fn(usize) -> bool| children.iter().filter(|c| wanted(c.len())).count();
    [count(|n| n > 1), count(|n| n == 0)]
}

/// The same tree in four formats is the same example.
#[test]
fn lines_edges_segments_and_nodes_make_the_same_trees() {
    let dir = tempfile::tempdir().expect("tempdir");
    let mut tables = Vec::new();
    for name in ["lines.obj", "edges.ply", "segments.txt", "nodes.gltf"] {
        let out = dir.path().join(name);
        let tree = grown(&models().join(name), &out, &["--motion", "none"]);
        assert!(
            tree.note.source.name.contains(name),
            "{}",
            tree.note.source.name
        );
        let table = fs::read_to_string(out.join("tree-0002/nodes.csv")).expect("table");
        tables.push((name, table, tree));
    }
    assert!(tables[0].1 == tables[1].1, "OBJ and PLY differ");
    assert!(tables[0].1 == tables[2].1, "OBJ and treefile differ");
    // Its places are floats, in metres.
    let [obj, gltf] = [0, 3].map(|k| forks_and_tips(&tables[k].2.skeleton));
    assert_eq!(obj, gltf);
    assert!(tables[3].2.metres_per_px() > 0.0 && tables[0].2.metres_per_px() == 0.0);
}

/// Radii of a file are kept, and the trunks of new trees go by them; the form of the example is the same.
#[test]
fn radii_of_a_treefile_are_those_of_its_tree() {
    let dir = tempfile::tempdir().expect("tempdir");
    let tree = Document::read(&models().join("tree"), 0.0)
        .expect("tree")
        .skeleton;
    let standing = |name: &str| {
        let path = models().join(name);
        let model = read_model(&fs::read(&path).expect("file"), &path).expect("a model");
        StandingModel::of(&model.tree).expect("forks")
    };
    let (thick, thin) = (standing("thick.txt"), standing("segments.txt"));
    assert!(thick.has_radii && !thin.has_radii);
    assert_eq!(thick.skeleton.nodes.len(), thin.skeleton.nodes.len());
    let heights = |s: &Skeleton| s.nodes.iter().map(|n| n.position.y).fold(0.0, f64::max);
    let scale = heights(&thick.skeleton) / heights(&tree);
    let radii: Vec<f64> = tree.nodes.iter().map(|n| n.radius * scale).collect();
    for (own, bare) in thick.skeleton.nodes.iter().zip(&thin.skeleton.nodes) {
        assert_eq!((own.position, bare.radius), (bare.position, 0.0));
        assert!(radii.iter().any(|r| (r - own.radius).abs() < 1e-6));
    }
    let grown = grown(
        &models().join("thick.txt"),
        &dir.path().join("trees"),
        &["--motion", "none"],
    );
    let trunk = thick.skeleton.nodes[1].radius;
    let own = grown.skeleton.nodes[1].radius;
    assert!(
        (own / trunk - 1.0).abs() < 0.05,
        "{own} px against {trunk} px"
    );
}

/// Frequency and damping with their intervals go through both tables; what the branches of the file have is
/// what those of the film have.
#[test]
fn sway_and_radii_go_through_tables() {
    let dir = tempfile::tempdir().expect("tempdir");
    let film = Document::read(replayed(), 0.0).expect("a capture");
    let mut measured: Vec<[i64; 6]> = film.sway.iter().flatten().map(rounded).collect();
    measured.sort_unstable();
    measured.dedup();
    assert!(!measured.is_empty(), "the film says nothing");
    let mut radii: Vec<Vec<f64>> = Vec::new();
    for (format, name) in [("qsm", "tree.csv"), ("treefile", "tree.txt")] {
        let path = dir.path().join(name);
        done(&["export", text(replayed()), "--format", format], &path);
        let model = read_model(&fs::read(&path).expect("file"), &path).expect("a model");
        let nodes = &model.tree.nodes;
        let mut own: Vec<[i64; 6]> = nodes
            .iter()
            .filter_map(|n| n.wood.sway.as_ref())
            .map(rounded)
            .collect();
        own.sort_unstable();
        own.dedup();
        assert_eq!(own, measured, "{name}");
        assert!(nodes.iter().all(|n| n.wood.radius > 0.0), "{name}");
        radii.push(nodes.iter().map(|n| n.wood.radius).collect());
        let standing = StandingModel::of(&model.tree).expect("forks");
        let sway = standing.sway(&model.tree);
        assert_eq!(standing.skeleton.nodes.len(), sway.len());
        assert!(sway.iter().any(Result::is_ok), "{name}");
        let out = dir.path().join(format);
        let tree = grown(&path, &out, &["--motion", "wind"]);
        let mut known = tree.sway.iter().flatten().map(rounded).peekable();
        assert!(
            known.peek().is_some() && known.all(|sway| measured.contains(&sway)),
            "{name}"
        );
    }
    for (a, b) in radii[0].iter().zip(&radii[1]) {
        assert!((a - b).abs() <= 1e-3, "{a} against {b}");
    }
    // Rows in any order make the same tree.
    let [table, turned] = ["tree.csv", "turned.csv"].map(|name| dir.path().join(name));
    let rows = fs::read_to_string(&table).expect("table");
    let (header, rows) = rows.split_once('\n').expect("a header");
    let mut lines: Vec<&str> = rows.lines().rev().collect();
    lines.insert(0, header);
    fs::write(&turned, lines.join("\n")).expect("write");
    let trees = [table, turned].map(|path| {
        read_model(&fs::read(&path).expect("file"), &path)
            .expect("a model")
            .tree
    });
    assert_eq!(trees[0].nodes.len(), trees[1].nodes.len());
    for (a, b) in trees[0].nodes.iter().zip(&trees[1].nodes) {
        assert_eq!(
            (a.parent, a.position, a.wood.radius),
            (b.parent, b.position, b.wood.radius)
        );
    }
}

/// A sway in the decimals of tables; 0 where there is no damping.
fn rounded(sway: &Sway) -> [i64; 6] {
    let damping = sway
        .damping_ratio
        .map_or([0.0; 3], |d| [d.value, d.lo, d.hi]);
    let [d, d_lo, d_hi] = damping;
    let f = sway.frequency_hz;
    [f.value, f.lo, f.hi, d, d_lo, d_hi].map(|x| (1e5 * x).round() as i64)
}

#[test]
fn what_export_writes_can_be_read_again() {
    let dir = tempfile::tempdir().expect("tempdir");
    let tree = Document::read(&models().join("tree"), 0.0)
        .expect("tree")
        .skeleton;
    for name in ["tree/tree.glb", "tree.gltf"] {
        let path = models().join(name);
        let model = read_model(&fs::read(&path).expect("file"), &path).expect("a model");
        let forks = StandingModel::of(&model.tree).expect("forks").skeleton;
        // All forks and all tips are there, copies among them; bends are left out.
        assert_eq!(forks_and_tips(&forks), forks_and_tips(&tree), "{name}");
        assert!(model.poses.is_empty());
    }
    for (name, file) in [
        ("glb", "tree/tree.glb"),
        ("gltf", "tree.gltf"),
        ("cylinders", "tables/cylinders.csv"),
        ("drawing", "../drawing"),
    ] {
        let example = match name {
            "drawing" => PathBuf::from(DRAWING),
            _ => models().join(file),
        };
        let tree = grown(&example, &dir.path().join(name), &[]);
        assert!(
            tree.poses.is_empty() && tree.skeleton.measured() > 10,
            "{name}"
        );
    }
}

/// The folder of a sketch is the same example as the sketch.
#[test]
fn a_drawing_needs_no_folder_of_its_own() {
    let dir = tempfile::tempdir().expect("tempdir");
    let more = ["--motion", "none"];
    for (name, example) in [
        ("folder", models().join("tree")),
        ("file", PathBuf::from(DRAWING)),
    ] {
        grown(&example, &dir.path().join(name), &more);
    }
    let [folder, file] = ["folder", "file"]
        .map(|name| fs::read(dir.path().join(name).join("tree-0001/nodes.csv")).expect("table"));
    assert!(folder == file, "they differ");
}

#[test]
fn a_conifer_is_said_to_lose_its_axis() {
    let dir = tempfile::tempdir().expect("tempdir");
    let warning = "the example has one trunk up to the top";
    let conifer = ["grow", "docs/sketches/conifer.svg", "--count", "1"];
    assert!(done(&conifer, &dir.path().join("forks")).contains(warning));
    let like = [&conifer[..], &["--like", "von-mises"]].concat();
    assert!(!done(&like, &dir.path().join("angles")).contains(warning));
    let tree = ["grow", DRAWING, "--count", "1"];
    assert!(!done(&tree, &dir.path().join("tree")).contains(warning));
}

/// Forks and tips keep their places in space; bends are left out.
#[test]
fn a_modelled_tree_is_taken_as_it_stands() {
    let obj = "v 0 0 0\nv 0 10 0\nv 0 20 0\nv 3 14 4\nv 6 16 8\nv 3 18 4\nv -4 13 3\nv 1 25 0\n\
               v -1 24 0\nv 0 4 1\nl 1 10 2 3 8\nl 3 9\nl 2 4 5\nl 4 6\nl 2 7\n";
    let model = read_model(obj.as_bytes(), Path::new("a.obj")).expect("a model");
    let standing = StandingModel::of(&model.tree).expect("forks").skeleton;
    let nodes = &standing.nodes;
    let scale = nodes.iter().map(|n| n.position.y).fold(0.0, f64::max) / 25.0;
    let mut places: Vec<[i64; 3]> = Vec::new();
    for node in nodes {
        assert_eq!(node.copy_of, None);
        let at = node.position.coords / scale;
        places.push([at.x, at.y, at.z].map(|x| (1e3 * x).round() as i64));
    }
    places.sort_unstable();
    let expected = [
        [-4000, 13000, 3000],
        [-1000, 24000, 0],
        [0, 0, 0],
        [0, 10000, 0],
        [0, 20000, 0],
        [1000, 25000, 0],
        [3000, 14000, 4000],
        [3000, 18000, 4000],
        [6000, 16000, 8000],
    ];
    assert_eq!(places, expected);
}

/// Trees of a file that `export` wrote are as large as those of the capture that it was written from, and
/// none of their branches is a copy. Tables hold the twigs, and no more are added.
#[test]
fn trees_of_an_exported_file_are_those_of_its_capture() {
    let dir = tempfile::tempdir().expect("tempdir");
    let [model, table, settings] =
        ["tree.gltf", "tree.csv", "one-plane.toml"].map(|name| dir.path().join(name));
    fs::write(&settings, "[shape]\nplanes = 1\n").expect("write");
    for (format, file) in [("gltf", &model), ("qsm", &table)] {
        let flat = ["--format", format, "--planes", "1"];
        done(&[&["export", text(replayed())], &flat[..]].concat(), file);
    }
    let still = ["--motion", "none"];
    let of = |example: &Path, name: &str| grown(example, &dir.path().join(name), &still);
    let by_model = of(&model, "model");
    let by_table = of(&table, "table");
    let by_film = grown(
        replayed(),
        &dir.path().join("film"),
        &["--motion", "none", "--config", text(&settings)],
    );
    let [tips, of_model, of_table] =
        [&by_film, &by_model, &by_table].map(|tree| forks_and_tips(&tree.skeleton)[1]);
    let ratio = of_model as f64 / tips as f64;
    assert!(
        (0.8..1.25).contains(&ratio),
        "{of_model} tips, {tips} of the film"
    );
    assert!(of_table > tips, "{of_table} tips, {tips} of the film");
    assert_eq!(by_table.note.config.wood.max_twigs, 0);
    assert!(by_model.note.config.wood.max_twigs > 0);
    // The trunk goes up to the main fork of the same tree.
    let [film, model, table] = [&by_film, &by_model, &by_table].map(|tree| {
        let nodes = &tree.skeleton.nodes;
        assert!(nodes.iter().all(|n| n.copy_of.is_none()));
        let height = nodes.iter().map(|n| n.position.y).fold(0.0, f64::max);
        nodes[1].position.y / height
    });
    assert!(
        (model - film).abs() < 0.1,
        "{model} of the height, {film} of the film"
    );
    assert!(
        (table - film).abs() < 0.1,
        "{table} of the height, {film} of the film"
    );
}

/// The joints of a capture's model move, and so do the trees that are grown of it: as fast as those
/// that are grown of the capture itself.
#[test]
fn the_motion_of_a_model_is_learned() {
    let dir = tempfile::tempdir().expect("tempdir");
    let model = replayed().join("tree.glb");
    let by_model = grown(&model, &dir.path().join("model"), &[]);
    let by_film = grown(replayed(), &dir.path().join("film"), &[]);
    assert!(!by_model.poses.is_empty(), "nothing moves");
    let [of_model, of_film] = [&by_model, &by_film].map(sway_px);
    let ratio = of_model / of_film;
    assert!(
        (0.2..5.0).contains(&ratio),
        "{of_model} px against {of_film} px"
    );
    let (first, last) = (&by_model.poses[0], by_model.poses.last().expect("poses"));
    for (a, b) in first.joints.iter().zip(&last.joints) {
        assert!(
            (a.position - b.position).norm() < 1e-3,
            "the loop has a seam"
        );
    }
    // And in the wind.
    let in_wind = grown(&model, &dir.path().join("wind"), &["--motion", "wind"]);
    assert!(!in_wind.poses.is_empty());
}

/// What is read of the animation is what was filmed: the model's places leave those at rest as far as
/// the capture's nodes do.
#[test]
fn the_animation_of_a_model_is_read_as_it_was_written() {
    let path = replayed().join("tree.glb");
    let model = read_model(&fs::read(&path).expect("file"), &path).expect("a model");
    let film = Document::read(replayed(), 60.0).expect("a capture");
    let heights = model.tree.nodes.iter().map(|n| n.position.y);
    let height = heights.fold(0.0, f64::max);
    let (mut sum, mut count) = (0.0, 0.0);
    for pose in &model.poses {
        for (node, place) in model.tree.nodes.iter().zip(pose) {
            sum += (place - node.position).norm_squared();
            count += 1.0;
        }
    }
    let ratio = (sum / f64::max(count, 1.0)).sqrt() / height / sway_px(&film);
    assert!((0.8..1.25).contains(&ratio), "{ratio}");
}

/// How far the nodes are off their places, root of the mean square, as a share of the height.
fn sway_px(tree: &Document) -> f64 {
    let nodes = &tree.skeleton.nodes;
    let height = nodes.iter().map(|n| n.position.y).fold(0.0, f64::max);
    let (mut sum, mut count) = (0.0, 0.0);
    for pose in &tree.poses {
        for (node, joint) in nodes.iter().zip(&pose.joints) {
            sum += (joint.position - node.position).norm_squared();
            count += 1.0;
        }
    }
    (sum / f64::max(count, 1.0)).sqrt() / height
}

/// A node of a glTF file, with what hangs on it.
fn gltf(nodes: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{nodes}]}}"#
    )
}

#[test]
fn bad_examples_get_one_line_and_leave_nothing() {
    let dir = tempfile::tempdir().expect("tempdir");
    let glb = fs::read(models().join("tree/tree.glb")).expect("model");
    let plain = fs::read_to_string(models().join("tree.gltf")).expect("model");
    let fork = "v 0 0 0\nv 0 9 0\nv 3 12 0\nv -3 12 0\n";
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("empty.glb", Vec::new(), "empty"),
        ("empty.obj", b" \n".to_vec(), "empty"),
        ("words.glb", b"words".to_vec(), "damaged"),
        ("cut.glb", glb[..glb.len() / 2].to_vec(), "damaged"),
        ("short.glb", glb[..60].to_vec(), "damaged"),
        // Its binary part lies under another name.
        ("alone.gltf", plain.replace("tree.bin", "absent.bin").into_bytes(), "beside it"),
        ("above.gltf", plain.replace("tree.bin", "../tree.bin").into_bytes(), "not a file beside it"),
        ("one.gltf", gltf(r#"{"translation": [0, 1, 0]}"#).into_bytes(), "no skeleton"),
        (
            "cyclic.gltf",
            gltf(r#"{"children": [1]}, {"children": [2], "translation": [0, 1, 0]}, {"children": [1], "translation": [0, 1, 0]}"#).into_bytes(),
            "circle",
        ),
        ("round.gltf", gltf(r#"{}, {"children": [2]}, {"children": [1]}"#).into_bytes(), "circle"),
        ("round.obj", format!("{fork}l 1 2 3 4 2\n").into_bytes(), "circle"),
        ("pieces.obj", format!("{fork}l 1 2\nl 3 4\n").into_bytes(), "in pieces"),
        ("nan.obj", format!("{fork}v nan 1 2\nl 1 2 3\nl 2 5\n").into_bytes(), "no number"),
        ("faces.obj", format!("{fork}f 1 2 3\n").into_bytes(), "no skeleton"),
        ("flat.obj", b"v 0 0 0\nv 5 0 0\nv 9 0 1\nl 1 2 3\n".to_vec(), "height"),
        ("few.obj", format!("{fork}l 1 2 3\nl 2 4\n").into_bytes(), "1 forks"),
        ("odd.ply", b"ply\nformat ascii 1.0\nend_header\n".to_vec(), "no skeleton"),
        ("odd.csv", b"a,b\n1,2\n".to_vec(), "no column"),
        ("odd.txt", b"a,b\n1,2\n".to_vec(), "no treefile"),
        (
            "round.csv",
            b"ID,parentID,startX,startY,startZ,endX,endY,endZ\n1,2,0,0,0,0,0,1\n2,1,0,0,1,0,0,2\n".to_vec(),
            "grows from itself",
        ),
        (
            "unknown.csv",
            b"ID,parentID,startX,startY,startZ,endX,endY,endZ\n1,0,0,0,0,0,0,1\n2,7,0,0,1,0,0,2\n".to_vec(),
            "piece 2 grows from 7, which is not in it",
        ),
        ("two.txt", b"x,y,z,parent_id\n0,0,0,-1\n0,0,0,-1\n".to_vec(), "2 trees"),
        ("tree.stl", b"solid".to_vec(), "does not say"),
        ("few.svg", fs::read(DRAWING).expect("drawing")[..420].to_vec(), "damaged"),
    ];
    let out = dir.path().join("trees");
    for (name, content, expected) in cases {
        let file = dir.path().join(name);
        fs::write(&file, content).expect("write");
        let output = command(&["grow", text(&file), "--count", "1"], &out)
            .output()
            .expect("arborcam");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(FAILED), "{name}: {said}");
        // Before the error there may be a note that nothing moves.
        let last = said.lines().last().unwrap_or_default();
        assert!(last.contains(expected), "{name}: {said}");
        let notes = said.lines().filter(|l| l.contains(" note: ")).count();
        assert_eq!(said.lines().count(), 1 + notes, "{name}: {said}");
        assert!(!out.exists(), "{name} left something behind");
    }
    let endless = command(&["grow", "/dev/zero", "--count", "1"], &out).output();
    assert_eq!(endless.expect("arborcam").status.code(), Some(NO_INPUT));
    // A file that says it is larger than what is read, and takes no space.
    let huge = dir.path().join("huge.glb");
    let file = fs::File::create(&huge).expect("file");
    file.set_len(1 << 34).expect("length");
    let output = command(&["grow", text(&huge), "--count", "1"], &out).output();
    let output = output.expect("arborcam");
    assert_eq!(output.status.code(), Some(NO_INPUT));
    assert!(String::from_utf8_lossy(&output.stderr).contains("more than"));
}

fn only_whole_trees(out: &Path) -> usize {
    let names = names_in(out);
    for name in &names {
        assert!(name.starts_with("tree-"), "{name} is left");
        let tree = Document::read(&out.join(name), 60.0).expect("a whole document");
        assert_eq!(tree.warnings, [""; 0]);
        assert!(out.join(name).join("tree.glb").exists());
    }
    names.len()
}

/// Ctrl-C in the middle: finished trees stay, and nothing else.
#[test]
fn what_is_finished_stays_when_it_is_stopped() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("trees");
    let mut growing = command(
        &["grow", text(&models().join("tree")), "--count", "100000"],
        &out,
    )
    .stderr(Stdio::null())
    .spawn()
    .expect("arborcam");
    let since = Instant::now();
    while !out.join("tree-0003").exists() {
        assert!(since.elapsed() < Duration::from_secs(120), "no third tree");
        sleep(Duration::from_millis(5));
    }
    let sent = Command::new("kill")
        .args(["-INT", &growing.id().to_string()])
        .status();
    assert!(sent.expect("kill").success());
    assert_eq!(growing.wait().expect("end").code(), Some(STOPPED));
    assert!((3..100_000).contains(&only_whole_trees(&out)));
}

#[test]
fn what_is_finished_stays_when_the_disk_is_full() {
    let Some(disk) = SmallDisk::mount("12m") else {
        return;
    };
    let out = disk.path("trees");
    let output: Output = command(
        &["grow", text(&models().join("tree")), "--count", "1000"],
        &out,
    )
    .output()
    .expect("arborcam");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(FAILED), "{said}");
    assert!(said.contains("disk is full"), "{said}");
    assert!((1..1000).contains(&only_whole_trees(&out)));
    // The one that did not fit has left its space.
    assert_eq!(names_in(disk.dir()), ["trees"]);
}

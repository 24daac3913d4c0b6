//! `arborcam export`: what a user gets from a capture, and what bad input gets.

use crate::support::{names_in, replayed as made};
use arborcam::document::note::ModelNote;
use arborcam::document::{CaptureNote, Document};
use arborcam::model::{
    Excitation, Interval, Node, NodeId, NodeKind, NodeName, Size, Skeleton, Sway, Timing,
    Unidentified,
};
use arborcam::views::{Draft, write_document};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;

const FAILED: i32 = 1;
const BAD_USAGE: i32 = 2;
const NO_INPUT: i32 = 3;

fn export(dir: &Path, format: &str, out: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command
        .arg("export")
        .arg(dir)
        .args(["--format", format, "--out"])
        .arg(out)
        .args(more);
    command.output().expect("arborcam")
}

fn exported(format: &str, name: &str, more: &[&str]) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join(name);
    let output = export(made(), format, &out, more);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    assert!(!told.contains("warning"), "{told}");
    (dir, out)
}

/// Names of the joints, and how many triangles hang on them.
fn look(document: &gltf::Document) -> (Vec<String>, usize) {
    let joints = document.skins().next().expect("a skin").joints();
    let names = joints.map(|j| j.name().expect("name").to_owned()).collect();
    let triangles = document
        .meshes()
        .flat_map(|m| m.primitives().collect::<Vec<_>>());
    (
        names,
        triangles
            .filter_map(|p| p.indices())
            .map(|i| i.count() / 3)
            .sum(),
    )
}

/// Whoever exports without changes gets the model that lies in the capture, byte for byte: with the
/// frequencies and dampings of the table, and their intervals.
#[test]
fn the_glb_is_the_captures_own() {
    let (_dir, out) = exported("glb", "tree.glb", &[]);
    let own = fs::read(made().join("tree.glb")).expect("own");
    assert!(
        own == fs::read(&out).expect("ours"),
        "the model in the capture is another one"
    );
    // To standard output, and a second time: the same bytes.
    let again = export(made(), "glb", Path::new("-"), &[]);
    assert!(again.status.success());
    assert!(again.stdout == own, "standard output differs from the file");
    let model = gltf::Gltf::from_slice(&own).expect("a valid file");
    let table = fs::read_to_string(made().join("nodes.csv")).expect("nodes");
    let mut known = 0;
    for (node, row) in model.nodes().zip(table.lines().skip(1)) {
        let cells: Vec<&str> = row.split(',').collect();
        let extras: serde_json::Value =
            serde_json::from_str(node.extras().as_ref().expect("extras").get()).expect("json");
        assert_eq!(extras["node_id"].to_string(), cells[0]);
        assert_eq!(extras["branch"], cells[25]);
        assert_eq!(extras["order"].to_string(), cells[26]);
        let number = |c: usize| cells[c].parse::<f64>().ok();
        let told = |name: &str| extras.get(name).and_then(serde_json::Value::as_f64);
        let interval = |name: &str| {
            let ends = extras.get(name)?;
            Some([ends[0].as_f64()?, ends[1].as_f64()?])
        };
        assert_eq!(told("frequency_hz"), number(10), "{row}");
        assert_eq!(
            interval("frequency_hz_interval_95"),
            number(11).zip(number(12)).map(|(lo, hi)| [lo, hi]),
            "{row}"
        );
        assert_eq!(told("damping_ratio"), number(13), "{row}");
        assert_eq!(
            interval("damping_ratio_interval_95"),
            number(14).zip(number(15)).map(|(lo, hi)| [lo, hi]),
            "{row}"
        );
        known += usize::from(cells[16] == "true");
    }
    assert!(known >= 4, "{known} branches have an answer");
}

/// The model has the modes of the table; of one that is damaged none, with a warning that says
/// where.
#[test]
fn the_modes_of_the_table_are_in_the_model() {
    let rows = fs::read_to_string(made().join("modes.csv")).expect("modes");
    let (_dir, out) = exported("glb", "tree.glb", &[]);
    let modes = modes_of(&fs::read(out).expect("model"));
    assert_eq!(
        modes.as_array().map(Vec::len),
        Some(rows.lines().count() - 1)
    );
    for (mode, row) in modes
        .as_array()
        .into_iter()
        .flatten()
        .zip(rows.lines().skip(1))
    {
        let cells: Vec<&str> = row.split(',').collect();
        for (name, cell) in [
            ("frequency_hz", 1),
            ("frequency_lo_hz", 2),
            ("amplitude_deg", 8),
        ] {
            assert_eq!(mode[name].as_f64(), cells[cell].parse().ok(), "{row}");
        }
        let energy = mode["energy"].as_array().expect("energy");
        let limbs: Vec<&str> = cells[13].split("; ").collect();
        assert_eq!(energy.len(), limbs.len(), "{row}");
        for (limb, said) in energy.iter().zip(limbs) {
            let (name, share) = said.split_once(' ').expect("a limb and its share");
            assert_eq!(text(&limb["limb"]), name, "{row}");
            // The table has two digits, the model three.
            let off =
                limb["share"].as_f64().unwrap_or(f64::NAN) - share.parse::<f64>().expect(share);
            assert!(off.abs() <= 0.0055, "{row}");
        }
    }

    let dir = tempfile::tempdir().expect("tempdir");
    let (damaged, table) = (
        dir.path().join("damaged"),
        rows.replacen("\n1,", "\n1,x", 1),
    );
    fs::create_dir(&damaged).expect("folder");
    for file in fs::read_dir(made()).expect("capture").flatten() {
        fs::copy(file.path(), damaged.join(file.file_name())).expect("copy");
    }
    fs::write(damaged.join("modes.csv"), table).expect("table");
    let output = export(&damaged, "glb", Path::new("-"), &[]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    assert!(
        told.contains("the modes of the whole tree are left out")
            && told.contains("modes.csv, line 2"),
        "{told}"
    );
    assert!(modes_of(&output.stdout).is_null());
}

fn text(value: &serde_json::Value) -> &str {
    value.as_str().unwrap_or_default()
}

/// What a model's own notes say of the modes of the tree.
fn modes_of(glb: &[u8]) -> serde_json::Value {
    let model = gltf::Gltf::from_slice(glb).expect("a valid file");
    let json = model.document.into_json();
    let extras = json.asset.extras.expect("extras");
    let notes: serde_json::Value = serde_json::from_str(extras.get()).expect("json");
    notes["modes"].clone()
}

#[test]
fn gltf_lies_beside_its_parts_whatever_it_is_called() {
    let (dir, out) = exported("gltf", "my tree, 100%.gltf", &[]);
    assert_eq!(
        names_in(dir.path()),
        ["my tree, 100%.bin", "my tree, 100%.gltf"]
    );
    let text = fs::read_to_string(&out).expect("text");
    let json: serde_json::Value = serde_json::from_str(&text).expect("json");
    assert_eq!(json["buffers"][0]["uri"], "my%20tree%2C%20100%25.bin");
    let bytes = fs::metadata(dir.path().join("my tree, 100%.bin"))
        .expect("bin")
        .len();
    assert_eq!(json["buffers"][0]["byteLength"], bytes);
    let (_dir, plain) = exported("gltf", "tree.gltf", &[]);
    let (document, _, _) = gltf::import(&plain).expect("a glTF with its buffer");
    assert_eq!(
        look(&document).0.len(),
        Document::read(made(), 1.0)
            .expect("capture")
            .skeleton
            .nodes
            .len()
    );
}

#[test]
fn csv_is_the_tables_and_cylinders_that_join() {
    let (_dir, out) = exported("csv", "tables", &[]);
    assert_eq!(
        names_in(&out),
        [
            "camera.csv",
            "cylinders.csv",
            "left_out.csv",
            "modes.csv",
            "motion.csv",
            "nodes.csv",
            "tracks.csv"
        ]
    );
    for name in [
        "camera.csv",
        "left_out.csv",
        "modes.csv",
        "motion.csv",
        "nodes.csv",
        "tracks.csv",
    ] {
        assert!(
            fs::read(out.join(name)).expect(name) == fs::read(made().join(name)).expect(name),
            "{name} differs"
        );
    }
    let text = fs::read_to_string(out.join("cylinders.csv")).expect("cylinders");
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some(
            "ID,parentID,start_x,start_y,start_z,end_x,end_y,end_z,axis_x,axis_y,axis_z,radius,length,branch,branch_order,made_up"
        )
    );
    let rows: Vec<Vec<f64>> = lines
        .map(|l| l.split(',').map(|c| c.parse().expect("number")).collect())
        .collect();
    assert!(rows.len() > 70, "{} cylinders", rows.len());
    let mut order: BTreeMap<u64, f64> = BTreeMap::new();
    for (k, row) in rows.iter().enumerate() {
        assert_eq!((row.len(), row[0]), (16, k as f64 + 1.0));
        let way: Vec<f64> = (0..3).map(|c| row[5 + c] - row[2 + c]).collect();
        let length = way.iter().map(|w| w * w).sum::<f64>().sqrt();
        assert!(
            (length - row[12]).abs() < 0.001 && row[12] > 0.0 && row[11] >= 0.0,
            "{row:?}"
        );
        assert!(
            (0..3).all(|c| (row[8 + c] * length - way[c]).abs() < 0.001),
            "{row:?}"
        );
        // A branch keeps its order, and one that leaves another has one more.
        let known = *order.entry(row[13] as u64).or_insert(row[14]);
        assert_eq!(known, row[14], "{row:?}");
        if row[1] == 0.0 {
            assert_eq!(
                (row[14], row[3].abs() < 1e-6),
                (0.0, true),
                "what stands on the ground: {row:?}"
            );
            continue;
        }
        let parent = &rows[row[1] as usize - 1];
        assert!(
            row[1] < row[0] && (parent[13] == row[13] || parent[14] + 1.0 == row[14]),
            "{parent:?} and {row:?}"
        );
    }
}

/// Both have a picture of the leaf beside them, and nothing is overwritten.
#[test]
fn a_tree_in_leaf_is_exported_as_gltf_and_obj_of_one_name() {
    let dir = tempfile::tempdir().expect("tempdir");
    for format in ["gltf", "obj"] {
        let out = dir.path().join(format!("oak.{format}"));
        let output = export(made(), format, &out, &["--leaves", "on"]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{told}");
    }
    let names = names_in(dir.path()).join(" ");
    assert_eq!(
        names,
        "oak.bin oak.gltf oak.mtl oak.obj oak_leaf.png oak_obj_leaf.png"
    );
    let materials = fs::read_to_string(dir.path().join("oak.mtl")).expect("materials");
    assert!(materials.contains("oak_obj_leaf.png"), "{materials}");
}

#[test]
fn the_still_tree_opens_as_obj_and_ply() {
    let (_, triangles) = look(
        &gltf::Gltf::open(made().join("tree.glb"))
            .expect("glb")
            .document,
    );
    let (dir, out) = exported("obj", "tree.obj", &[]);
    assert_eq!(names_in(dir.path()), ["tree.mtl", "tree.obj"]);
    let text = fs::read_to_string(&out).expect("obj");
    let count = |kind: &str| {
        text.lines()
            .filter(|l| l.split(' ').next() == Some(kind))
            .count()
    };
    assert_eq!((count("f"), count("v")), (triangles, count("vn")));
    let vertices = count("v");
    for corner in text
        .lines()
        .filter_map(|l| l.strip_prefix("f "))
        .flat_map(|l| l.split(' '))
    {
        let of: Vec<usize> = corner
            .split('/')
            .map(|n| n.parse().expect("index"))
            .collect();
        assert!(of.iter().all(|&i| i >= 1 && i <= vertices), "{corner}");
    }
    assert!(
        fs::read_to_string(dir.path().join("tree.mtl"))
            .expect("mtl")
            .contains("newmtl bark\nKd 0.")
    );
    let (_dir, out) = exported("ply", "tree.ply", &[]);
    let bytes = fs::read(&out).expect("ply");
    let end = b"end_header\n";
    let at = bytes
        .windows(end.len())
        .position(|w| w == end)
        .expect("a header")
        + end.len();
    let head = String::from_utf8(bytes[..at].to_vec()).expect("text");
    assert!(
        head.contains(&format!("element vertex {vertices}\n"))
            && head.contains(&format!("face {triangles}\n"))
    );
    assert_eq!(bytes.len() - at, 27 * vertices + 13 * triangles);
}

#[test]
fn another_shape_keeps_what_was_measured() {
    let (_dir, out) = exported("csv", "tables", &["--planes", "5", "--animation-s", "2"]);
    let read = Document::read(made(), 60.0).expect("capture");
    let measured = read.skeleton.measured();
    let rows: Vec<Vec<String>> = fs::read_to_string(out.join("nodes.csv"))
        .expect("nodes")
        .lines()
        .skip(1)
        .map(|l| l.split(',').map(str::to_owned).collect())
        .collect();
    let trunk = read
        .skeleton
        .nodes
        .iter()
        .take(measured)
        .enumerate()
        .map(|(i, _)| read.skeleton.mover(NodeId(i as u32)))
        .filter(|mover| {
            let node = &read.skeleton.nodes[mover.index()];
            // A stem that carries more than half of all points is the trunk.
            node.level < 2 || 2 * node.n_tracks > read.skeleton.nodes[0].n_tracks
        })
        .count();
    assert_eq!(rows.len(), measured + 4 * (measured - trunk));
    let mut names: Vec<&str> = rows.iter().map(|r| r[0].as_str()).collect();
    for (row, node) in rows.iter().zip(&read.skeleton.nodes[..measured]) {
        assert_eq!(row[0], node.name.0.to_string());
        let [u, v] = read.skeleton.image_from_model(&node.position).into();
        let px = |c: usize| row[c].parse::<f64>().expect("px");
        assert!(
            (px(4) - u).abs() < 0.51 && (px(5) - v).abs() < 0.51,
            "{row:?} stood at {u}, {v}"
        );
    }
    names.sort();
    names.dedup();
    assert_eq!(names.len(), rows.len(), "no two nodes have one name");
    let motion = fs::read_to_string(out.join("motion.csv")).expect("motion");
    assert_eq!(
        motion.lines().count(),
        1 + 330 * rows.len(),
        "the whole film, as in tracks.csv"
    );
    // The nodes are where they were in the picture.
    let first: u64 = motion
        .lines()
        .nth(1)
        .expect("row")
        .split(',')
        .next()
        .expect("frame")
        .parse()
        .expect("frame");
    let pose = read.poses.iter().find(|p| p.frame == first).expect("pose");
    for (row, joint) in motion.lines().skip(1).zip(&pose.joints[..measured]) {
        let cells: Vec<f64> = row.split(',').map(|c| c.parse().expect("number")).collect();
        let [u, v] = read.skeleton.image_from_model(&joint.position).into();
        assert!(
            (cells[6] - u).hypot(cells[7] - v) < 8.0,
            "{row} was at {u}, {v}"
        );
    }
}

/// The tables of a tree that was cut join: no point is on a branch that is not there.
#[test]
fn points_of_branches_that_were_cut_are_on_none() {
    let dir = tempfile::tempdir().expect("tempdir");
    let read = Document::read(made(), 1.0).expect("capture");
    let size = read.skeleton.image_size;
    // The right half of the picture, from the trunk on.
    let trunk_u = read.skeleton.foot_px[0].min(
        read.skeleton
            .image_from_model(&read.skeleton.nodes[1].position)[0],
    );
    let half = image::RgbaImage::from_fn(size.width, size.height, |u, _| {
        image::Rgba([0, 0, 0, if f64::from(u) > trunk_u - 3.0 { 255 } else { 0 }])
    });
    let shape = dir.path().join("half.png");
    half.save(&shape).expect("PNG");
    let out = dir.path().join("tables");
    let output = export(
        made(),
        "csv",
        &out,
        &[
            "--envelope",
            shape.to_str().expect("path"),
            "--animation-s",
            "1",
        ],
    );
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let column = |dir: &Path, name: &str, c: usize| -> Vec<String> {
        let text = fs::read_to_string(dir.join(name)).expect(name);
        text.lines()
            .skip(1)
            .map(|l| l.split(',').nth(c).expect("cell").to_owned())
            .collect()
    };
    let nodes = column(&out, "nodes.csv", 0);
    let (before, after) = (
        column(made(), "tracks.csv", 5),
        column(&out, "tracks.csv", 5),
    );
    assert_eq!(before.len(), after.len());
    let gone = before
        .iter()
        .zip(&after)
        .filter(|(b, a)| !b.is_empty() && a.is_empty())
        .count();
    assert!(
        gone > 0 && after.iter().all(|n| n.is_empty() || nodes.contains(n)),
        "{gone} rows without a node"
    );
    assert!(
        before
            .iter()
            .zip(&after)
            .all(|(b, a)| a.is_empty() || a == b)
    );
    assert_eq!(column(&out, "motion.csv", 0).len(), 330 * nodes.len());
}

#[test]
fn settings_go_file_over_capture_and_command_line_over_file() {
    let dir = tempfile::tempdir().expect("tempdir");
    let file = dir.path().join("metres.toml");
    fs::write(
        &file,
        "[export]\nmetres_per_px = 0.5\n[shape]\nplanes = 2\ncopy_bare = true\n",
    )
    .expect("write");
    let (_dir, out) = exported(
        "csv",
        "tables",
        &[
            "--config",
            file.to_str().expect("path"),
            "--metres-per-px",
            "0.01",
        ],
    );
    let at = |path: PathBuf| {
        let text = fs::read_to_string(path).expect("nodes");
        text.lines()
            .nth(2)
            .expect("row")
            .split(',')
            .nth(7)
            .expect("y")
            .parse::<f64>()
            .expect("y")
    };
    let (m, px) = (at(out.join("nodes.csv")), at(made().join("nodes.csv")));
    assert!((m / px - 0.01).abs() < 1e-5, "{m} m of {px} px");
    let nodes = fs::read_to_string(out.join("nodes.csv")).expect("nodes");
    let copies = nodes.lines().filter(|row| row.contains(",copy,")).count();
    let captured = Document::read(made(), 1.0).expect("capture").skeleton;
    assert_eq!(captured.nodes.len(), captured.measured(), "no copies");
    assert!(
        copies > 10 && copies < captured.measured(),
        "one plane more"
    );
}

/// Arguments after `export` ({c} the capture, {w} a folder to write to), status, what the line must
/// say.
type Case = (&'static str, i32, &'static [&'static str]);

const CASES: &[Case] = &[
    (
        "recordings --format glb --out {w}/t.glb",
        NO_INPUT,
        &["recordings is no capture", "--out"],
    ),
    (
        "{w}/nothing --format glb --out {w}/t.glb",
        NO_INPUT,
        &["nothing is not there", "name"],
    ),
    (
        "recordings/README.md --format glb --out {w}/t.glb",
        NO_INPUT,
        &["is no capture"],
    ),
    (
        "{w}/cut --format glb --out {w}/t.glb",
        NO_INPUT,
        &["motion.csv, line", "make the capture anew"],
    ),
    (
        "{w}/bare --format glb --out {w}/t.glb",
        FAILED,
        &["holds tracks but no tree", "film for longer"],
    ),
    (
        "{w}/lone --format ply --out {w}/t.ply",
        FAILED,
        &["no branch of it has a length", "--format csv or glb"],
    ),
    (
        "{c} --format glb --out {w}/there",
        FAILED,
        &["{w}/there exists already", "choose another"],
    ),
    (
        "{c} --format csv --out {w}/there",
        FAILED,
        &["{w}/there exists already", "choose another"],
    ),
    (
        "{c} --format glb --out {w}/there/t.glb",
        FAILED,
        &["{w}/there", "choose another"],
    ),
    (
        "{c} --format glb --out /",
        BAD_USAGE,
        &["--out / is no name for a file"],
    ),
    (
        "{c} --format fbx --out {w}/t.fbx",
        BAD_USAGE,
        &["'fbx'", "glb"],
    ),
    (
        "{c} --format gltf --out {w}/t.glb",
        BAD_USAGE,
        &["does not end in .gltf"],
    ),
    (
        "{c} --format glb --out {w}/t.obj",
        BAD_USAGE,
        &["ends as another format does", ".glb"],
    ),
    (
        "{c} --format obj --out {w}/t",
        BAD_USAGE,
        &["does not end in .obj"],
    ),
    (
        "{c} --format csv --out -",
        BAD_USAGE,
        &["more than one file"],
    ),
    (
        "{c} --format glb --out {w}/t.glb --planes 99",
        BAD_USAGE,
        &["'99'", "--planes", "1 to 8"],
    ),
    (
        "{c} --format glb --out {w}/t.glb --tolerance-px 0",
        BAD_USAGE,
        &["--tolerance-px", "from 0.001"],
    ),
    (
        "{c} --format glb --out {w}/t.glb --metres-per-px NaN",
        BAD_USAGE,
        &["'NaN'", "--metres-per-px", "0.000001 to 10"],
    ),
    (
        "{c} --format glb --out {w}/t.glb --config {w}/bad.toml",
        BAD_USAGE,
        &["bad.toml, line 2", "plains"],
    ),
    (
        "{c} --format glb --out {w}/t.glb --config {w}/none.toml",
        BAD_USAGE,
        &["none.toml", "check the name"],
    ),
    ("{c} --format glb", BAD_USAGE, &["--out"]),
    (
        "{c} --format glb --out {w}/t.glb --leaf {w}/none.glb",
        BAD_USAGE,
        &["none.glb"],
    ),
    (
        "{c} --format glb --out {w}/t.glb --leaf {w}/there",
        BAD_USAGE,
        &["{w}/there"],
    ),
    (
        "{c} --format glb --out {w}/t.glb --density {w}/none.png",
        BAD_USAGE,
        &["none.png"],
    ),
    (
        "{c} --format glb --out {w}/t.glb --density {w}/there",
        BAD_USAGE,
        &["{w}/there"],
    ),
];

/// A leaf of one triangle.
const TRIANGLE: &str = r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "buffers": [{"byteLength": 36,
        "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}]}"#;

/// A reader that has seen enough is no fault.
#[test]
fn a_reader_of_standard_output_may_leave() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    let command = command.arg("export").arg(made());
    let command = command.args(["--format", "ply", "--out", "-"]);
    let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("arborcam");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("its end");
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    assert!(!told.contains("standard output"), "{told}");
}

/// All levels of detail, each a model of its own with the same bones; and metres by a height.
#[test]
fn levels_are_files_beside_each_other() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("oak.glb");
    let more = ["--lods", "--leaves", "on", "--height", "7.5"];
    assert!(export(made(), "glb", &out, &more).status.success());
    let mut triangles = Vec::new();
    let mut bones: Vec<Vec<String>> = Vec::new();
    for name in ["oak.glb", "oak_lod1.glb", "oak_lod2.glb"] {
        let model = gltf::Gltf::open(dir.path().join(name)).expect("a valid file");
        assert_eq!((model.scenes().count(), model.animations().count()), (1, 1));
        let notes = model.as_json().asset.extras.as_ref().expect("notes").get();
        let notes: serde_json::Value = serde_json::from_str(notes).expect("json");
        assert_eq!(
            (&notes["unit"], &notes["scale"]),
            (&"m".into(), &"height".into())
        );
        let mut of: Vec<usize> = Vec::new();
        let mut highest = 0.0_f32;
        let mut looks: Vec<String> = Vec::new();
        for mesh in model.meshes() {
            of.push(0);
            for primitive in mesh.primitives() {
                *of.last_mut().expect("a mesh") +=
                    primitive.indices().expect("indices").count() / 3;
                highest = highest.max(primitive.bounding_box().max[1]);
                looks.extend(primitive.material().name().map(str::to_owned));
            }
        }
        assert_eq!(of.len(), 2, "wood and leaves");
        assert_eq!(looks, ["bark", "bark_made_up", "leaf"]);
        assert!(triangles.is_empty() == (name == "oak.glb"));
        assert!((highest - 7.5).abs() < if triangles.is_empty() { 0.001 } else { 0.3 });
        triangles.push(of);
        let skin = model.skins().next().expect("a skin");
        bones.push(
            skin.joints()
                .map(|j| j.name().expect("name").to_owned())
                .collect(),
        );
    }
    assert!(bones.iter().all(|b| *b == bones[0]));
    assert_eq!(bones[0][..2], ["tree", "trunk"]);
    for part in 0..2 {
        let counts: Vec<usize> = triangles.iter().map(|t| t[part]).collect();
        assert!(
            counts[1] < counts[0] * 6 / 10 && counts[2] < counts[1] * 6 / 10,
            "{counts:?}"
        );
    }
}

/// Whoever asks for what changes nothing is told so, and why, instead of looking for it in the
/// file.
#[test]
fn what_changes_nothing_is_said() {
    let dir = tempfile::tempdir().expect("tempdir");
    let place = |name: &str| dir.path().join(name).display().to_string();
    fs::write(
        place("film.toml"),
        "[detect]\npoints = 99\n[wood]\ncurl = 0.1\n[track]\nlevels = 2\n",
    )
    .expect("write");
    fs::write(place("wood.toml"), "[wood]\ncurl = 0.1\n").expect("write");
    fs::write(place("leaf.gltf"), TRIANGLE).expect("write");
    let (film, wood, leaf) = (place("film.toml"), place("wood.toml"), &place("leaf.gltf"));
    let cases: [(&str, &[&str], Option<&str>); 9] = [
        (
            "ply",
            &["--lods"],
            Some("--lods changes nothing here: only glb and gltf"),
        ),
        ("glb", &["--lods"], None),
        (
            "ply",
            &["--tolerance-px", "3"],
            Some("--tolerance-px changes nothing"),
        ),
        ("glb", &["--tolerance-px", "3"], None),
        ("glb", &["--config", &film], Some("[detect], [track] in")),
        ("glb", &["--config", &wood], None),
        (
            "glb",
            &["--leaf", leaf, "--leaves", "off"],
            Some("--leaf changes nothing here: the tree bears no leaves"),
        ),
        ("glb", &["--leaf", leaf, "--leaves", "on"], None),
        ("glb", &[], None),
    ];
    for (format, more, told) in cases {
        let output = export(made(), format, Path::new("-"), more);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{said}");
        match told {
            Some(words) => assert!(
                said.contains(words) && said.lines().count() == 1,
                "{more:?}: {said}"
            ),
            None => assert!(!said.contains("note"), "{more:?}: {said}"),
        }
    }
}

/// A drawn density puts leaves on a tree that has none in the film, unless they are switched off.
#[test]
fn a_drawn_density_brings_leaves() {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("density.png");
    image::GrayImage::from_pixel(640, 360, image::Luma([255]))
        .save(&path)
        .expect("an image");
    let density = path.display().to_string();
    let leafy = |more: &[&str]| {
        let output = export(
            made(),
            "glb",
            Path::new("-"),
            &[&["--density", &density], more].concat(),
        );
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let file = gltf::Gltf::from_slice(&output.stdout).expect("a valid file");
        file.materials().any(|m| m.name() == Some("leaf"))
    };
    assert!(leafy(&[]));
    assert!(!leafy(&["--leaves", "off"]));
}

#[test]
fn bad_input_gets_one_line_and_leaves_nothing() {
    let dir = tempfile::tempdir().expect("tempdir");
    let work = dir.path();
    for name in ["cut", "bare", "lone"] {
        fs::create_dir(work.join(name)).expect("folder");
        for file in fs::read_dir(made()).expect("capture").flatten() {
            fs::copy(file.path(), work.join(name).join(file.file_name())).expect("copy");
        }
    }
    let motion = fs::read(work.join("cut/motion.csv")).expect("motion");
    fs::write(work.join("cut/motion.csv"), &motion[..motion.len() / 2]).expect("write");
    let note = fs::read_to_string(work.join("bare/capture.json")).expect("note");
    let mut note: serde_json::Value = serde_json::from_str(&note).expect("json");
    note["model"] = serde_json::Value::Null;
    fs::write(work.join("bare/capture.json"), note.to_string()).expect("write");
    // A foot, and nothing on it.
    let rows = |name: &str, kept: fn(&str) -> bool| {
        let text = fs::read_to_string(work.join("lone").join(name)).expect("table");
        let kept: String = text
            .lines()
            .filter(|l| kept(l))
            .map(|l| format!("{l}\n"))
            .collect();
        fs::write(work.join("lone").join(name), kept).expect("write");
    };
    rows("nodes.csv", |l| {
        l.starts_with("node_id") || l.starts_with("0,")
    });
    rows("motion.csv", |l| {
        l.starts_with("frame") || l.split(',').nth(2) == Some("0")
    });
    fs::remove_file(work.join("lone/tree.glb")).expect("remove");
    let lone = export(&work.join("lone"), "glb", Path::new("-"), &[]);
    assert!(
        lone.status.success(),
        "{}",
        String::from_utf8_lossy(&lone.stderr)
    );
    assert_eq!(
        gltf::Gltf::from_slice(&lone.stdout)
            .expect("a valid file")
            .nodes()
            .count(),
        1
    );
    fs::write(work.join("there"), "mine").expect("write");
    fs::write(work.join("bad.toml"), "[shape]\nplains = 3\n").expect("write");
    let before = names_in(work);
    for (words, status, says) in CASES {
        let place = |text: &str| {
            text.replace("{c}", &made().display().to_string())
                .replace("{w}", &work.display().to_string())
        };
        let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
        let output = command
            .arg("export")
            .args(words.split(' ').map(place))
            .output()
            .expect("arborcam");
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(*status), "{words}: {told}");
        assert!(
            says.iter().all(|part| told.contains(&place(part))),
            "{words}: {told}"
        );
        let lines: Vec<&str> = told
            .lines()
            .filter(|l| l.starts_with("arborcam: "))
            .collect();
        assert_eq!(lines.len(), 1, "{words}: {told}");
        assert_eq!(names_in(work), before, "{words}");
        assert_eq!(
            fs::read_to_string(work.join("there")).expect("mine"),
            "mine"
        );
    }
}

/// A capture of `nodes` nodes, each on the one that `parent` says, with a film of two frames.
fn large(dir: &Path, nodes: usize, parent: impl Fn(usize) -> usize) {
    fs::create_dir(dir).expect("folder");
    fs::copy(made().join("capture.json"), dir.join("capture.json")).expect("copy");
    fs::write(
        dir.join("tracks.csv"),
        "track_id,frame,time_s,u_px,v_px,node_id\n",
    )
    .expect("write");
    let head = fs::read_to_string(made().join("nodes.csv")).expect("nodes");
    let mut table = vec![head.lines().next().expect("header").to_owned()];
    let mut motion = vec!["frame,time_s,node_id,x,y,z,u_px,v_px".to_owned()];
    let mut levels: Vec<u32> = Vec::new();
    for i in 0..nodes {
        let above = if i == 0 {
            String::new()
        } else {
            parent(i).to_string()
        };
        levels.push(if i == 0 { 0 } else { levels[parent(i)] + 1 });
        let (x, y) = (i % 400, i / 400 + if i == 0 { 0 } else { 50 });
        table.push(format!(
            "{i},{above},{},1,0,0,{x},{y},{},1,,,,,,,false,,,not_measured,measured,,,0,,,",
            levels[i],
            i % 100
        ));
        motion.push(format!("0,0,{i},{x},{y},{},0,0", i % 100));
    }
    fs::write(dir.join("nodes.csv"), table.join("\n") + "\n").expect("write");
    fs::write(dir.join("motion.csv"), motion.join("\n") + "\n").expect("write");
}

/// As many nodes as a model can have are a matter of seconds, or are refused: never one of hours.
#[test]
fn as_many_nodes_as_can_be_are_exported_or_refused() {
    let dir = tempfile::tempdir().expect("tempdir");
    let (bush, chain) = (dir.path().join("bush"), dir.path().join("chain"));
    large(&bush, 1 << 16, |i| if i == 1 { 0 } else { 1 + (i - 2) / 3 });
    large(&chain, 1 << 16, |i| i - 1);
    let told = |output: &Output| String::from_utf8_lossy(&output.stderr).into_owned();
    let plain = export(
        &bush,
        "glb",
        &dir.path().join("bush.glb"),
        &["--triangles", "10000"],
    );
    assert!(plain.status.success(), "{}", told(&plain));
    for more in [
        &["--planes", "1"][..],
        &["--envelope", "docs/shapes/heart.png"],
    ] {
        let reshaped = export(&bush, "glb", &dir.path().join("other.glb"), more);
        assert_eq!(reshaped.status.code(), Some(FAILED), "{}", told(&reshaped));
        assert!(
            told(&reshaped).contains("at most 4096 can be given one; take fewer"),
            "{}",
            told(&reshaped)
        );
    }
    let deep = export(&chain, "glb", &dir.path().join("chain.glb"), &[]);
    assert_eq!(deep.status.code(), Some(NO_INPUT), "{}", told(&deep));
    assert!(
        told(&deep).contains("line 258: it has more levels than any tree"),
        "{}",
        told(&deep)
    );
}

fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_arborcam"))
        .args(arguments)
        .output()
        .expect("arborcam");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), told)
}

/// What needs no motion takes the document in `dir`, which has no film; what needs it says so in one
/// line. `warned`: the document says itself that its film is missing.
fn goes_without_a_film(dir: &Path, warned: bool) {
    let place = tempfile::tempdir().expect("tempdir");
    let at = |name: &str| place.path().join(name).display().to_string();
    let dir = &dir.display().to_string();
    let fine: [&[&str]; 9] = [
        &["export", dir, "--format", "glb", "--out", &at("a.glb")],
        &["export", dir, "--format", "gltf", "--out", &at("a.gltf")],
        &["export", dir, "--format", "obj", "--out", &at("a.obj")],
        &["export", dir, "--format", "ply", "--out", &at("a.ply")],
        &["export", dir, "--format", "csv", "--out", &at("tables")],
        &[
            "export",
            dir,
            "--format",
            "csv",
            "--planes",
            "2",
            "--out",
            &at("other"),
        ],
        &["render", dir, "--out", &at("a.png")],
        &[
            "render",
            dir,
            "--seconds",
            "0.1",
            "--size",
            "64x48",
            "--out",
            &at("a.mp4"),
        ],
        &[
            "animate",
            dir,
            "--seconds",
            "1",
            "--wind",
            "6",
            "--out",
            &at("a.csv"),
        ],
    ];
    for arguments in fine {
        let (status, told) = run(arguments);
        assert_eq!(status, Some(0), "{arguments:?}: {told}");
        assert_eq!(
            told.contains("the tree is at rest"),
            warned,
            "{arguments:?}: {told}"
        );
    }
    for tables in ["tables", "other"] {
        let names = names_in(&place.path().join(tables));
        assert_eq!(names, ["cylinders.csv", "nodes.csv"]);
    }
    let (status, told) = run(&["export", dir, "--format", "html", "--out", &at("a.html")]);
    assert!(
        status == Some(0) || told.contains("without the HTML viewer"),
        "{told}"
    );
    let film: [(&[&str], &str); 3] = [
        (
            &["render", dir, "--at", "1", "--out", &at("b.png")],
            "motion.csv",
        ),
        (
            &["animate", dir, "--magnify", "2", "--out", &at("b.csv")],
            "motion.csv",
        ),
        (&["analyze", dir], "tracks.csv"),
    ];
    for (arguments, file) in film {
        let (status, told) = run(arguments);
        assert_eq!(status, Some(NO_INPUT), "{arguments:?}: {told}");
        assert!(
            told.contains(&format!("lacks {file}: it holds no film")) && told.lines().count() == 1,
            "{arguments:?}: {told}"
        );
    }
}

#[test]
fn a_tree_whose_film_was_removed_is_exported_drawn_and_moved_by_wind() {
    let dir = tempfile::tempdir().expect("tempdir");
    let bare = dir.path().join("bare");
    fs::create_dir(&bare).expect("folder");
    let kept = [
        "capture.json",
        "nodes.csv",
        "frame.jpg",
        "bark.png",
        "rest.png",
        "wood.png",
        "leaves.png",
        "tree.glb",
    ];
    for name in kept {
        fs::copy(made().join(name), bare.join(name)).expect("copy");
    }
    goes_without_a_film(&bare, true);
}

/// A tree that nobody filmed: a fork, a shoot and a copy.
fn made_up() -> Skeleton {
    let node = |name, parent: Option<u32>, level, at: [f64; 3]| Node {
        name: NodeName(name),
        parent: parent.map(NodeId),
        level,
        position: at.into(),
        radius: 6.0 / f64::from(1 + level),
        n_tracks: 0,
        kind: NodeKind::Grown,
        certainty: 0.123_456,
        copy_of: None,
        plane_angle: 0.0,
        moves_with: None,
    };
    let mut nodes = vec![
        node(0, None, 0, [0.0; 3]),
        node(1, Some(0), 1, [3.0, 120.123_456, 1.0]),
        node(2, Some(1), 2, [-60.0, 180.0, 20.0]),
        node(3, Some(1), 2, [70.0, 190.0, -30.0]),
        node(9, Some(1), 2, [0.0, 190.0, -75.0]),
    ];
    nodes[3].kind = NodeKind::Shoot;
    nodes[4].copy_of = Some(NodeId(2));
    nodes[4].kind = NodeKind::Grown;
    nodes[4].plane_angle = 1.1;
    Skeleton {
        nodes,
        foot_px: [320.25, 340.5].into(),
        image_size: Size::new(640, 360),
    }
}

#[test]
fn a_tree_that_was_not_filmed_is_written_read_and_exported() {
    let dir = tempfile::tempdir().expect("tempdir");
    let tree = made_up();
    let filmed = Document::note(made()).expect("note");
    for metres_per_px in [0.0, 0.0123] {
        let mut note = CaptureNote {
            timing: Timing::default(),
            model: Some(ModelNote::of(&tree, metres_per_px)),
            picture: None,
            bark: None,
            masks: None,
            build: None,
            refinement: None,
            animation: None,
            ..filmed.clone()
        };
        note.config.export.metres_per_px = metres_per_px;
        let draft = Draft {
            bark: None,
            at_rest: None,
            note,
            skeleton: &tree,
            picture: None,
            poses: Vec::new(),
            pose_in_picture: None,
        };
        let around = |value: f64| Interval {
            value,
            lo: 0.9 * value,
            hi: 1.1 * value,
        };
        let sway = [
            Err(Unidentified::NotMeasured),
            Ok(Sway {
                frequency_hz: around(0.123_456_789),
                damping_ratio: Some(around(0.05)),
                excitation: Excitation::Wind,
                amplitude_deg: f64::NAN,
            }),
        ];
        let at = dir.path().join(format!("tree-{metres_per_px}"));
        write_document(&at, draft, &sway, &AtomicBool::new(false)).expect("written");
        assert_eq!(names_in(&at), ["capture.json", "nodes.csv", "tree.glb"]);
        let read = Document::read(&at, 60.0).expect("document");
        assert_eq!(read.warnings, [""; 0]);
        assert_eq!(read.sway[1].expect("known").frequency_hz.value, 0.12346);
        for (a, b) in tree.nodes.iter().zip(&read.skeleton.nodes) {
            assert!((a.position - b.position).norm() < 1e-3, "{a:?} and {b:?}");
            assert_eq!(
                (a.name, a.parent, a.level, a.copy_of),
                (b.name, b.parent, b.level, b.copy_of)
            );
            assert!(
                (a.plane_angle - b.plane_angle).abs() < 1e-5,
                "{a:?} and {b:?}"
            );
            assert!((a.certainty - b.certainty).abs() < 1e-4, "{a:?} and {b:?}");
            assert_eq!(a.kind, b.kind);
        }
        let own = fs::read(at.join("tree.glb")).expect("model");
        let again = export(&at, "glb", Path::new("-"), &[]);
        assert!(again.stdout == own, "the model is not that of `export`");
        goes_without_a_film(&at, false);
    }
}

/// Ctrl-C while an export is worked out and while it is written: nothing is left, and the shell can
/// tell.
#[test]
fn an_export_that_is_stopped_leaves_nothing() {
    let dir = tempfile::tempdir().expect("tempdir");
    let long = dir.path().join("long");
    fs::create_dir(&long).expect("folder");
    for file in fs::read_dir(made()).expect("capture").flatten() {
        fs::copy(file.path(), long.join(file.file_name())).expect("copy");
    }
    // So many frames that writing them takes a while.
    let text = fs::read_to_string(made().join("motion.csv")).expect("motion");
    let (head, rows) = text.split_once('\n').expect("header");
    let mut motion = head.to_owned() + "\n";
    for round in 0..40 {
        for row in rows.lines() {
            let (frame, rest) = row.split_once(',').expect("cells");
            let (time_s, rest) = rest.split_once(',').expect("cells");
            let frame: u64 = frame.parse().expect("frame");
            let time_s: f64 = time_s.parse().expect("time");
            motion += &format!(
                "{},{:.6},{rest}\n",
                frame + 330 * round,
                time_s + 11.0 * round as f64
            );
        }
    }
    fs::write(long.join("motion.csv"), motion).expect("write");
    // Before it is read: whoever opens the other end of the pipe knows that the program is there.
    let waiting = dir.path().join("waiting");
    fs::create_dir(&waiting).expect("folder");
    let pipe = waiting.join("capture.json");
    assert!(
        Command::new("mkfifo")
            .arg(&pipe)
            .status()
            .expect("mkfifo")
            .success()
    );
    let out = dir.path().join("out");
    let cases: [(&str, &Path, &[&str]); 3] = [
        ("INT", &long, &["--format", "csv", "--planes", "2"]),
        (
            "TERM",
            &long,
            &["--format", "csv", "--metres-per-px", "0.01"],
        ),
        ("INT", &waiting, &["--format", "glb"]),
    ];
    for (signal, capture, more) in cases {
        fs::create_dir(&out).expect("folder");
        let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
        command
            .arg("export")
            .arg(capture)
            .args(more)
            .arg("--out")
            .arg(out.join("it"));
        let mut child = command
            .stderr(std::process::Stdio::piped())
            .spawn()
            .expect("arborcam");
        let mut held = None;
        if capture == waiting {
            held = Some(
                fs::OpenOptions::new()
                    .write(true)
                    .open(&pipe)
                    .expect("pipe"),
            );
        } else {
            while !names_in(&out).iter().any(|n| n.contains("partial")) {
                assert!(
                    child.try_wait().expect("status").is_none(),
                    "it was over before it was stopped"
                );
                std::thread::sleep(std::time::Duration::from_millis(2));
            }
        }
        let sent = Command::new("kill")
            .args(["-s", signal, &child.id().to_string()])
            .status();
        assert!(sent.expect("kill").success());
        let output = child.wait_with_output().expect("end");
        drop(held);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(130), "{signal} {more:?}: {told}");
        assert_eq!(names_in(&out), [""; 0], "{signal} {more:?}");
        assert_eq!(told, "", "{signal} {more:?}");
        fs::remove_dir(&out).expect("empty");
    }
}

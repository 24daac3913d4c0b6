//! `arborcam grow --forest`: what a user gets, what others make of it, and what bad input gets.

use crate::small_disk::SmallDisk;
use crate::support::{names_in, replayed as example};
use crate::tools;
use arborcam::document::{Document, ForestDocument};
use gltf::Gltf;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use tempfile::TempDir;

const FAILED: i32 = 1;
const BAD_USAGE: i32 = 2;
const STOPPED: i32 = 130;
const TREES: usize = 14;
const TEMPLATES: usize = 3;

fn arborcam(args: &[&Path], more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command.args(args).args(more).output().expect("arborcam")
}

fn grow(out: &Path, more: &[&str]) -> Output {
    let [grow, to] = ["grow", "--out"].map(Path::new);
    arborcam(&[grow, example(), to, out], more)
}

/// A hill of 20 by 10 pixels, in a file.
fn hill(dir: &Path) -> PathBuf {
    let hill = image::GrayImage::from_fn(20, 10, |u, v| {
        let [x, y] = [f64::from(u) / 19.0 - 0.5, f64::from(v) / 9.0 - 0.5];
        image::Luma([(255.0 * (1.0 - 2.0 * (x * x + y * y))) as u8])
    });
    let file = dir.join("hill.png");
    hill.save(&file).expect("a picture");
    file
}

fn grown(dir: &Path, name: &str, threads: &str) -> PathBuf {
    let out = dir.join(name);
    let hill = hill(dir);
    let more = [
        "--forest",
        "--count",
        "14",
        "--templates",
        "3",
        "--seed",
        "3",
        "--relief",
        "6",
        "--threads",
        threads,
        "--height-map",
        hill.to_str().expect("path"),
    ];
    let output = grow(&out, &more);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    // Standard error is no terminal: no bar.
    assert_eq!(told.lines().count(), 1, "{told}");
    assert!(
        told.contains("a forest of 14 trees of 3 templates"),
        "{told}"
    );
    out
}

/// The forest of one run of the program.
fn forest() -> &'static Path {
    static MADE: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let dir = tempfile::tempdir().expect("tempdir");
        let out = grown(dir.path(), "forest", "1");
        (dir, out)
    });
    &made.1
}

#[test]
fn a_forest_at_rest_has_no_file_in_motion() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("still");
    let more = "--forest --count 2 --templates 1 --motion none";
    let output = grow(&out, &more.split(' ').collect::<Vec<_>>());
    assert!(output.status.success(), "{output:?}");
    let names = names_in(&out);
    assert!(names.iter().any(|name| name == "forest.glb"), "{names:?}");
    let moving = names.iter().any(|name| name == "forest_moving.glb");
    assert!(!moving, "{names:?}");
}

/// The JSON of a GLB file.
fn json_of(name: &str) -> Value {
    let bytes = fs::read(forest().join(name)).expect("file");
    let glb = gltf::binary::Glb::from_slice(&bytes).expect("a GLB");
    serde_json::from_slice(&glb.json).expect("json")
}

fn count(of: &Value) -> usize {
    of.as_array().map_or(0, Vec::len)
}

#[test]
fn a_forest_is_templates_a_table_and_models() {
    let files = [
        "forest.csv",
        "forest.glb",
        "forest.json",
        "forest_instanced.glb",
        "forest_lod1.glb",
        "forest_lod2.glb",
        "forest_moving.glb",
        "ground.png",
        "tree-0001",
        "tree-0002",
        "tree-0003",
    ];
    assert_eq!(names_in(forest()), files);
    let document = ForestDocument::read(forest()).expect("a forest");
    let trees = &document.forest.trees;
    assert_eq!(
        (trees.len(), document.note.templates.len()),
        (TREES, TEMPLATES)
    );
    // Ten metres tall, as no scale is known.
    let template = Document::read(&forest().join("tree-0001"), 60.0).expect("a document");
    let heights = template.skeleton.nodes.iter().map(|n| n.position.y);
    let height_m = heights.fold(0.0, f64::max) * document.forest.metres_per_px;
    assert!((7.0..13.0).contains(&height_m), "{height_m}");
    let ground = &document.forest.ground;
    assert!((ground.depth_m / ground.width_m - 0.5).abs() < 1e-6);
    let mut highest = 0.0_f64;
    for (k, tree) in trees.iter().enumerate() {
        let on_ground = ground.height_m(nalgebra::Point2::new(tree.foot.x, tree.foot.z));
        assert!((tree.foot.y - on_ground).abs() < 1e-3);
        highest = highest.max(tree.foot.y);
        let away = trees[..k]
            .iter()
            .map(|other| (tree.foot - other.foot).xz().norm());
        assert!(away.fold(f64::MAX, f64::min) > document.note.spacing_m - 1e-3);
    }
    assert!((2.0..=6.0).contains(&highest), "{highest}");
}

#[test]
fn trees_share_the_meshes_of_their_templates() {
    for name in ["forest.glb", "forest_lod1.glb", "forest_lod2.glb"] {
        let plain = json_of(name);
        assert_eq!(count(&plain["meshes"]), TEMPLATES + 1, "{name}");
        assert_eq!(count(&plain["nodes"]), TREES + 1);
        assert_eq!(count(&plain["scenes"][0]["nodes"]), TREES + 1);
        assert_eq!(plain["extensionsUsed"], Value::Null);
        assert_eq!(plain["animations"], Value::Null);
        Gltf::open(forest().join(name)).expect("valid");
    }
    let instanced = json_of("forest_instanced.glb");
    assert_eq!(
        instanced["extensionsRequired"],
        json!(["EXT_mesh_gpu_instancing"])
    );
    assert_eq!(count(&instanced["meshes"]), 3 * TEMPLATES + 1);
    // The coarser levels are not in the scene: no tree is drawn twice.
    assert_eq!(count(&instanced["scenes"][0]["nodes"]), TEMPLATES + 1);
    let mut trees = 0;
    for node in instanced["nodes"].as_array().expect("nodes") {
        let levels = &node["extensions"]["MSFT_lod"]["ids"];
        let Some(levels) = levels.as_array() else {
            continue;
        };
        assert_eq!(levels.len(), 2);
        let attributes = &node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
        let places = attributes["TRANSLATION"].as_u64().expect("an accessor") as usize;
        trees += instanced["accessors"][places]["count"]
            .as_u64()
            .expect("a count") as usize;
        for level in levels {
            let level = &instanced["nodes"][level.as_u64().expect("a node") as usize];
            let own = &level["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
            assert_eq!(own, attributes);
        }
    }
    assert_eq!(trees, TREES);
}

/// Triangles of the first template in a file.
fn triangles(name: &str) -> u64 {
    let file = json_of(name);
    let meshes = file["meshes"].as_array().expect("meshes");
    let mesh = meshes
        .iter()
        .find(|m| m["name"] != "ground")
        .expect("a tree");
    let primitives = mesh["primitives"].as_array().expect("primitives");
    let corners = primitives.iter().map(|p| {
        let accessor = p["indices"].as_u64().expect("an accessor") as usize;
        file["accessors"][accessor]["count"]
            .as_u64()
            .expect("a count")
    });
    corners.sum::<u64>() / 3
}

/// The branches of the skeleton stay in the coarsest level, too: it is not much smaller.
#[test]
fn levels_of_detail_have_fewer_triangles() {
    let [finest, middle, coarsest] =
        ["forest.glb", "forest_lod1.glb", "forest_lod2.glb"].map(triangles);
    let share = middle as f64 / finest as f64;
    assert!((0.2..0.3).contains(&share), "{finest} {middle}");
    assert!(coarsest < 4 * middle / 5, "{middle} {coarsest}");
}

/// Every tree of the moving forest has weights of its own, and those of a step ahead are the same a
/// quarter of the loop earlier.
#[test]
fn every_tree_sways_with_its_template() {
    let bytes = fs::read(forest().join("forest_moving.glb")).expect("file");
    let file = Gltf::from_slice(&bytes).expect("valid");
    let blob = file.blob.as_deref().expect("a buffer");
    let document = ForestDocument::read(forest()).expect("a forest");
    let animation = file.animations().next().expect("an animation");
    assert_eq!(animation.channels().count(), TREES);
    let mut seen = vec![vec![None; 4]; TEMPLATES];
    for (tree, channel) in document.forest.trees.iter().zip(animation.channels()) {
        let node = channel.target().node();
        let targets = node
            .mesh()
            .expect("a mesh")
            .weights()
            .expect("weights")
            .len();
        assert_eq!(targets, 16);
        let reader = channel.reader(|_| Some(blob));
        let keys = reader.read_inputs().expect("times").count();
        let Some(gltf::animation::util::ReadOutputs::MorphTargetWeights(weights)) =
            reader.read_outputs()
        else {
            panic!("no weights");
        };
        let weights: Vec<f32> = weights.into_f32().collect();
        assert_eq!(weights.len(), 16 * keys);
        assert_eq!(
            weights[..16],
            weights[16 * (keys - 1)..],
            "the loop has a seam"
        );
        seen[tree.template][usize::from(tree.ahead)] = Some(weights);
    }
    let mut compared = 0;
    for of_template in seen {
        let Some(own) = &of_template[0] else {
            continue;
        };
        let lap = own.len() / 16 - 1;
        for (step, ahead) in of_template.iter().enumerate().skip(1) {
            let from = lap * step / 4;
            if let Some(ahead) = ahead {
                assert_eq!(ahead[..16], own[16 * from..16 * (from + 1)]);
                compared += 1;
            }
        }
    }
    assert!(compared > 0);
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let dir = tempfile::tempdir().expect("tempdir");
    let other = grown(dir.path(), "forest", "4");
    assert_eq!(names_in(&other), names_in(forest()));
    for name in names_in(forest()) {
        let [one, four] = [forest(), &other].map(|out| out.join(&name));
        if one.is_file() {
            assert!(
                fs::read(&one).unwrap() == fs::read(&four).unwrap(),
                "{name}"
            );
            continue;
        }
        for file in names_in(&one) {
            let [one, four] = [&one, &four].map(|tree| fs::read(tree.join(&file)).expect("file"));
            assert!(one == four, "{name}/{file}");
        }
    }
}

#[test]
fn a_forest_is_drawn_and_has_a_page() {
    let dir = tempfile::tempdir().expect("tempdir");
    let [render, export, to] = ["render", "export", "--out"].map(Path::new);
    let [picture, page, glb] = ["a.png", "a.html", "a.glb"].map(|name| dir.path().join(name));
    let drawn = arborcam(
        &[render, forest(), to, &picture],
        &["--view", "turntable", "--size", "320x200"],
    );
    assert!(
        drawn.status.success(),
        "{}",
        String::from_utf8_lossy(&drawn.stderr)
    );
    let drawn = image::open(&picture).expect("a picture").into_rgb8();
    let of = |wanted: fn(&image::Rgb<u8>) -> bool| drawn.pixels().filter(|p| wanted(p)).count();
    let pixels = 320 * 200;
    // White sky, the ground greener than blue, wood darker than both.
    assert!(of(|p| p.0 == [255; 3]) > pixels / 4);
    assert!(of(|p| p.0[1] > p.0[2].saturating_add(25)) > pixels / 20);
    assert!(of(|p| p.0[1] < 90) > pixels / 100);
    let refused = arborcam(&[export, forest(), to, &glb], &["--format", "glb"]);
    assert_eq!(refused.status.code(), Some(BAD_USAGE));
    let film = dir.path().join("b.mp4");
    let filmed = arborcam(&[render, forest(), to, &film], &["--size", "320x200"]);
    assert!(
        filmed.status.success(),
        "{}",
        String::from_utf8_lossy(&filmed.stderr)
    );
    assert!(film.metadata().expect("a film").len() > 1000);
    let made = arborcam(&[export, forest(), to, &page], &["--format", "html"]);
    let told = String::from_utf8_lossy(&made.stderr);
    // A program that was built without npm has no page.
    if made.status.code() == Some(FAILED) && told.contains("npm") {
        eprintln!("SKIPPED: {told}");
        return;
    }
    assert!(made.status.success(), "{told}");
    let page = fs::read_to_string(&page).expect("page");
    assert!(page.contains(r#""forest":{"trees":14,"templates":3}"#));
}

#[test]
fn the_khronos_validator_finds_nothing() {
    let Some(validator) = tools::Validator::find() else {
        return;
    };
    let names = names_in(forest()).into_iter();
    let files: Vec<PathBuf> = names
        .filter(|name| name.ends_with(".glb"))
        .map(|name| forest().join(name))
        .collect();
    assert_eq!(files.len(), 5, "{files:?}");
    validator.finds_nothing_in(&files);
}

fn in_blender(blender: &Path, name: &str) -> Value {
    let output = Command::new(blender)
        .args([
            "-b",
            "--factory-startup",
            "-P",
            "tests/blender_forest.py",
            "--",
        ])
        .arg(forest().join(name))
        .output()
        .expect("blender");
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    let line = told.lines().find_map(|l| l.strip_prefix("FOREST "));
    let line = line.unwrap_or_else(|| panic!("{told}"));
    assert!(!told.contains("Error"), "{told}");
    serde_json::from_str(line).expect("json")
}

#[test]
fn blender_opens_it_with_shared_meshes() {
    let Some(blender) = tools::program("blender", "--version") else {
        return;
    };
    let there = in_blender(&blender, "forest.glb");
    assert_eq!(count(&there["objects"]), TREES + 1, "{there}");
    assert_eq!(there["meshes"], json!(TEMPLATES + 1));
    assert_eq!(there["actions"], json!(0));
    let document = ForestDocument::read(forest()).expect("a forest");
    let highest = document.forest.trees.iter().map(|t| t.foot.y);
    let highest = highest.fold(0.0, f64::max);
    let in_blender_m = there["heights"].as_array().expect("heights").iter();
    let in_blender_m = in_blender_m.filter_map(Value::as_f64).fold(0.0, f64::max);
    assert!((highest - in_blender_m).abs() < 1e-3, "{there}");
    let moving = in_blender(&blender, "forest_moving.glb");
    assert_eq!(count(&moving["objects"]), TREES + 1);
    assert_eq!(moving["actions"], json!(TREES));
    assert_eq!(moving["shape_keys"], json!(17));
}

#[test]
fn bad_input_gets_one_line_and_leaves_nothing() {
    let dir = tempfile::tempdir().expect("tempdir");
    let at = |name: &str| dir.path().join(name).to_str().expect("path").to_owned();
    fs::write(at("words.png"), "words").expect("write");
    fs::write(at("empty.png"), "").expect("write");
    let (words, empty, absent) = (at("words.png"), at("empty.png"), at("none.png"));
    let cases: [(&[&str], &str); 13] = [
        (&["--forest", "--count", "0"], "--count"),
        (&["--forest", "--templates", "0"], "--templates"),
        (&["--forest", "--height-map", &words], "no picture"),
        (&["--forest", "--height-map", &empty], "no picture"),
        (&["--forest", "--height-map", &absent], "none.png"),
        (&["--forest", "--relief", "3"], "--height-map"),
        (&["--forest", "--spacing", "0"], "--spacing"),
        (&["--forest", "--spacing", "9", "--size", "10"], "have room"),
        (
            &["--forest", "--spacing", "0.001", "--size", "1000"],
            "--spacing",
        ),
        (&["--forest", "--size=-1"], "--size"),
        (&["--forest", "--tree-height", "tall"], "--tree-height"),
        (&["--spacing", "3"], "--forest"),
        (&["--threads", "0"], "--threads"),
    ];
    for (more, expected) in cases {
        let out = dir.path().join("forest");
        let count: &[&str] = match more.contains(&"--count") {
            true => &[],
            false => &["--count", "20"],
        };
        let output = grow(&out, &[more, count].concat());
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(BAD_USAGE), "{more:?}: {told}");
        assert!(told.contains(expected), "{more:?}: {told}");
        assert!(!out.exists(), "{more:?} left something behind");
    }
}

/// Ctrl-C keeps the trees that are finished, and leaves nothing that is not.
#[test]
fn ctrl_c_keeps_what_is_finished() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("forest");
    let mut run = Command::new(env!("CARGO_BIN_EXE_arborcam"))
        .arg("grow")
        .arg(example())
        .args(["--forest", "--count", "99", "--templates", "64", "--out"])
        .arg(&out)
        .stderr(Stdio::null())
        .spawn()
        .expect("arborcam");
    let since = Instant::now();
    while !out.join("tree-0003").exists() {
        assert!(
            since.elapsed() < Duration::from_secs(60),
            "no tree was grown"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    let sent = Command::new("kill")
        .args(["-INT", &run.id().to_string()])
        .status();
    assert!(sent.expect("kill").success());
    assert_eq!(run.wait().expect("it ends").code(), Some(STOPPED));
    let there = names_in(&out);
    assert!((3..64).contains(&there.len()), "{there:?}");
    for name in there {
        assert!(name.starts_with("tree-"), "{name}");
        Document::read(&out.join(name), 60.0).expect("a whole tree");
    }
}

/// A full disk keeps the trees that are finished, and no half of one, nor half a scene.
#[test]
fn a_full_disk_keeps_what_is_finished() {
    let Some(disk) = SmallDisk::mount("12m") else {
        return;
    };
    let out = disk.path("forest");
    let output = grow(&out, &["--forest", "--count", "99", "--templates", "64"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(FAILED), "{said}");
    assert!(said.contains("disk is full"), "{said}");
    assert_eq!(names_in(disk.dir()), ["forest"]);
    let there = names_in(&out);
    assert!((1..64).contains(&there.len()), "{there:?}");
    for name in there {
        assert!(name.starts_with("tree-"), "{name}");
        Document::read(&out.join(name), 60.0).expect("a whole tree");
    }
}

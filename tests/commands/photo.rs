//! `arborcam photo`: a tree from one photograph, and what bad photographs and strokes get.

use crate::support::{self, names_in};
use arborcam::document::{Document, ForestDocument};
use arborcam::model::{NodeKind, Skeleton};
use arborcam::signal::distance_to_segment;
use image::{DynamicImage, Rgb, RgbImage};
use nalgebra::Point2;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const FAILED: i32 = 1;
const BAD_USAGE: i32 = 2;
const NO_INPUT: i32 = 3;
const STOPPED: i32 = 130;
const WIDTH: u32 = 480;
const HEIGHT: u32 = 360;
const FOOT: [f64; 2] = [240.0, 330.0];
const FORK: [f64; 2] = [240.0, 220.0];
const ENDS: [[f64; 2]; 2] = [[170.0, 90.0], [320.0, 100.0]];
const CROWN: &str = "[[100, 20], [380, 20], [390, 190], [260, 230], [220, 230], [90, 190]]";

fn limbs() -> [[[f64; 2]; 2]; 3] {
    [[FOOT, FORK], [FORK, ENDS[0]], [FORK, ENDS[1]]]
}

/// A trunk that forks before the sky; in leaf, leaves hide the upper half of both limbs.
fn photograph(in_leaf: bool) -> RgbImage {
    let mut noise = 1_u32;
    RgbImage::from_fn(WIDTH, HEIGHT, |u, v| {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let grain = (noise >> 24) as u8 % 24;
        let at = Point2::new(f64::from(u), f64::from(v));
        let is_wood = limbs()
            .iter()
            .any(|[a, b]| distance_to_segment(at, Point2::from(*a), Point2::from(*b)) <= 5.0);
        let mut clumps = [[190.0, 100.0], [300.0, 105.0], [245.0, 85.0]].iter();
        let is_leaf = in_leaf && clumps.any(|c| (at - Point2::from(*c)).norm() < 58.0);
        let colour = match (is_leaf, is_wood, v > 315) {
            (true, _, _) => [45, 105 - 20 * ((u / 5 + v / 7) % 3) as u8, 35],
            (_, true, _) => [85, 68, 52],
            (_, _, true) => [150, 140, 125],
            _ => [165, 188, 212],
        };
        Rgb(colour.map(|c: u8| c + grain))
    })
}

/// A folder with a photograph and its strokes.
struct Scene {
    dir: tempfile::TempDir,
}

impl Scene {
    fn new(picture: impl Into<DynamicImage>) -> Self {
        let dir = tempfile::tempdir().expect("tempdir");
        let scene = Self { dir };
        picture.into().save(scene.path("photo.png")).expect("png");
        let [foot, fork, end] = [FOOT, FORK, ENDS[0]];
        scene.write(
            "trunk.json",
            &format!(
                r#"{{"width": 480, "height": 360, "polyline_px": [{foot:?}, {fork:?}, {end:?}]}}"#
            ),
        );
        scene.write(
            "crown.json",
            &format!(r#"{{"width": 480, "height": 360, "polygon_px": {CROWN}}}"#),
        );
        scene
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("write");
    }

    /// The command; names of files are those in the folder.
    fn command(&self, arguments: &str, out: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
        command.current_dir(self.dir.path()).arg("photo");
        command.args(arguments.split(' ')).args(["--out", out]);
        command
    }

    /// Runs it.
    fn photo(&self, arguments: &str, out: &str) -> Output {
        self.command(arguments, out).output().expect("arborcam")
    }

    /// The tree of the photograph and its strokes with further options, and what was said.
    fn tree(&self, more: &str, out: &str) -> (Document, String) {
        let arguments = format!("photo.png --crown crown.json --branch trunk.json{more}");
        let output = self.photo(&arguments, out);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        (
            Document::read(&self.path(out), 1.0).expect("a document"),
            said,
        )
    }
}

fn count(skeleton: &Skeleton, kind: NodeKind) -> usize {
    skeleton.nodes.iter().filter(|n| n.kind == kind).count()
}

/// What a command that succeeds says.
fn run(arguments: &[&str], path: &Path) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    let output = command
        .args(arguments)
        .arg(path)
        .output()
        .expect("arborcam");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {said}");
    said
}

#[test]
fn a_tree_in_leaf_becomes_a_document_that_says_what_was_seen() {
    let scene = Scene::new(photograph(true));
    let (tree, said) = scene.tree("", "tree");
    assert!(said.contains("seen") && said.contains("grown"), "{said}");
    assert_eq!(
        names_in(&scene.path("tree")),
        [
            "bark.png",
            "capture.json",
            "frame.jpg",
            "leaves.png",
            "nodes.csv",
            "rest.png",
            "tree.glb",
            "wood.png"
        ]
    );
    let skeleton = &tree.skeleton;
    let grown = count(skeleton, NodeKind::Grown);
    assert!(grown > 20, "{grown}");
    assert_eq!(
        count(skeleton, NodeKind::Traced) + grown,
        skeleton.nodes.len()
    );
    // What was seen lies on the wood of the photograph; what was grown lies within the leaves.
    for node in &skeleton.nodes[1..] {
        let at = skeleton.image_from_model(&node.position);
        let off = limbs()
            .map(|[a, b]| distance_to_segment(at, Point2::from(a), Point2::from(b)))
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        match node.kind {
            NodeKind::Traced => assert!(off < 6.0, "{at} is {off} px off"),
            _ => assert!(at.y < 240.0 && at.y > 20.0, "{at}"),
        }
    }
    let depth = |sign: f64| {
        let depths = skeleton.nodes.iter().map(|n| sign * n.position.z);
        depths.fold(0.0, f64::max)
    };
    assert!(depth(1.0) > 20.0 && depth(-1.0) > 20.0);
    // All commands that take a tree that was not filmed.
    let out = scene.path("tree");
    let dir = out.to_str().expect("path");
    run(&["render", dir, "--out"], &scene.path("front.png"));
    run(
        &["export", dir, "--format", "obj", "--out"],
        &scene.path("tree.obj"),
    );
    run(
        &["animate", dir, "--wind", "4", "--seconds", "2", "--out"],
        &scene.path("wind.glb"),
    );
    let still = ["render", dir, "--seconds", "0.1", "--out"];
    let said = run(&still, &scene.path("still.mp4"));
    assert!(said.contains("arborcam animate"), "{said}");
}

#[test]
fn a_bare_tree_is_as_it_is_seen() {
    let scene = Scene::new(photograph(false));
    let (tree, _) = scene.tree("", "tree");
    let skeleton = &tree.skeleton;
    assert_eq!(count(skeleton, NodeKind::Grown), 0);
    let tips = skeleton.children().iter().filter(|c| c.is_empty()).count();
    assert_eq!(tips, 2, "{:?}", skeleton.nodes);
    for end in ENDS {
        let off = |n: &arborcam::model::Node| {
            (skeleton.image_from_model(&n.position) - Point2::from(end)).norm()
        };
        assert!(skeleton.nodes.iter().any(|n| off(n) < 9.0), "{end:?}");
    }
    let trunk = skeleton.nodes[1].radius;
    assert!((trunk - 5.0).abs() < 1.2, "{trunk}");
}

#[test]
fn a_grey_photograph_of_a_bare_tree_gets_a_warning() {
    let scene = Scene::new(DynamicImage::from(photograph(false)).to_luma8());
    let (tree, said) = scene.tree("", "tree");
    let warning = "arborcam: warning: photo.png: the photograph has no colours";
    assert!(said.contains(warning), "{said}");
    assert!(tree.note.warnings.iter().any(|w| w.contains("no colours")));
    assert_eq!(count(&tree.skeleton, NodeKind::Grown), 0);
}

#[test]
fn of_a_tree_that_is_said_to_be_bare_no_leaves_are_missed() {
    let scene = Scene::new(DynamicImage::from(photograph(false)).to_luma8());
    let (tree, said) = scene.tree(" --foliage bare", "tree");
    assert!(!said.contains("no colours"), "{said}");
    assert_eq!(count(&tree.skeleton, NodeKind::Grown), 0);
}

/// A hand never draws the same line twice.
#[test]
fn strokes_half_a_pixel_beside_give_nearly_the_same_tree() {
    let scene = Scene::new(photograph(true));
    let (first, _) = scene.tree("", "first");
    let moved = |line: &str| {
        let mut line: serde_json::Value = serde_json::from_str(line).expect("json");
        for at in line.as_array_mut().expect("a line") {
            at[0] = (at[0].as_f64().expect("a number") + 0.5).into();
        }
        line
    };
    let trunk = format!("[{FOOT:?}, {FORK:?}, {:?}]", ENDS[0]);
    for (name, key, line) in [
        ("crown.json", "polygon_px", CROWN),
        ("trunk.json", "polyline_px", &trunk),
    ] {
        let line = moved(line);
        scene.write(
            name,
            &format!(r#"{{"width": 480, "height": 360, "{key}": {line}}}"#),
        );
    }
    let (second, _) = scene.tree("", "second");
    // New branches put joints where they begin, so that only the lines can be compared.
    let second = traced_px(&second);
    for [_, end] in traced_px(&first) {
        let offs = second.iter().map(|[a, b]| distance_to_segment(end, *a, *b));
        let off_px = offs.fold(f64::INFINITY, f64::min);
        assert!(off_px < 6.0, "{end}: {second:?}");
    }
}

/// A short stroke beside the middle of the trunk gives the tree of one along all of it: its radius, and both
/// limbs.
#[test]
fn a_careless_stroke_gives_the_tree_of_a_careful_one() {
    let scene = Scene::new(photograph(false));
    let (careful, _) = scene.tree("", "careful");
    let short = [
        [FOOT[0] + 4.0, FOOT[1] - 5.0],
        [FOOT[0] + 4.0, FORK[1] + 50.0],
    ];
    scene.write(
        "trunk.json",
        &format!(r#"{{"width": 480, "height": 360, "polyline_px": {short:?}}}"#),
    );
    let (careless, _) = scene.tree("", "careless");
    for end in ENDS {
        let offs = traced_px(&careless)
            .into_iter()
            .map(|[_, tip]| (tip - Point2::from(end)).norm());
        assert!(
            offs.fold(f64::INFINITY, f64::min) < 12.0,
            "no limb to {end:?}"
        );
    }
    let [careful, careless] = [&careful, &careless].map(|tree| tree.skeleton.nodes[1].radius);
    let ratio = careless / careful;
    assert!(
        (0.8..1.25).contains(&ratio),
        "{careless} px, {careful} px of the careful one"
    );
}

/// The pieces of branches that were traced, in the picture.
fn traced_px(tree: &Document) -> Vec<[Point2<f64>; 2]> {
    let mut pieces = Vec::new();
    for node in &tree.skeleton.nodes {
        if let (NodeKind::Traced, Some(parent)) = (node.kind, node.parent) {
            let ends = [&tree.skeleton.nodes[parent.index()], node];
            pieces.push(ends.map(|n| tree.skeleton.image_from_model(&n.position)));
        }
    }
    pieces
}

#[test]
fn the_same_seed_gives_the_same_files_and_another_another_tree() {
    let scene = Scene::new(photograph(true));
    scene.tree("", "first");
    scene.tree("", "second");
    scene.tree(" --seed 2", "third");
    for name in names_in(&scene.path("first")) {
        let read = |dir: &str| fs::read(scene.path(dir).join(&name)).expect("file");
        assert!(read("first") == read("second"), "{name}");
        if name == "nodes.csv" {
            assert!(read("first") != read("third"), "{name}");
        }
    }
}

#[test]
fn without_strokes_the_tree_in_the_middle_is_found_and_it_says_how_sure_it_is() {
    let scene = Scene::new(photograph(true));
    let output = scene.photo("photo.png", "tree");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    let sure = "right with a chance of";
    assert!(said.contains(sure), "{said}");
    let tree = Document::read(&scene.path("tree"), 1.0).expect("a document");
    assert!(tree.note.warnings.iter().any(|w| w.contains(sure)));
    let foot = tree.skeleton.foot_px;
    assert!((foot - Point2::from(FOOT)).norm() < 25.0, "{foot}");
    let found = tree.note.found.expect("how sure it is");
    assert!(found.chance >= 0.5 && found.trunk_deviations > 5.0);
}

/// Whether it is in leaf cannot be seen.
#[test]
fn a_grey_photograph_needs_strokes() {
    let scene = Scene::new(DynamicImage::from(photograph(true)).to_luma8());
    let output = scene.photo("photo.png", "tree");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(FAILED), "{said}");
    assert!(
        said.contains("--crown") && !scene.path("tree").exists(),
        "{said}"
    );
}

#[test]
fn strokes_are_in_the_pixels_of_a_large_photograph() {
    let small = photograph(true);
    let large = image::imageops::resize(&small, 1920, 1440, image::imageops::FilterType::Nearest);
    let scene = Scene::new(large);
    let line = "[960, 1320], [960, 880], [680, 360]";
    scene.write(
        "trunk.json",
        &format!(r#"{{"width": 1920, "height": 1440, "polyline_px": [{line}]}}"#),
    );
    let (tree, _) = scene.tree_with_crown(1920);
    assert_eq!(tree.skeleton.image_size.width, 1536);
    let foot = tree.skeleton.foot_px * (480.0 / 1536.0);
    assert!((foot - Point2::from(FOOT)).norm() < 4.0, "{foot}");
}

/// Crown and trunk in one file, so far to the right.
fn sketch(right_px: f64) -> String {
    let corners: Vec<[f64; 2]> = serde_json::from_str(CROWN).expect("corners");
    let moved = |line: &[[f64; 2]]| -> Vec<[f64; 2]> {
        line.iter().map(|[u, v]| [u + right_px, *v]).collect()
    };
    let (crown, trunk) = (moved(&corners), moved(&[FOOT, FORK, ENDS[0]]));
    format!(
        r#"{{"width": 480, "height": 360, "polygon_px": {crown:?}, "strokes": [{{"polyline_px": {trunk:?}}}]}}"#
    )
}

#[test]
fn several_trees_of_one_photograph_stand_in_one_scene() {
    let one = photograph(true);
    let mut both = RgbImage::new(2 * WIDTH, HEIGHT);
    image::imageops::replace(&mut both, &one, 0, 0);
    // The right one stands farther away: its foot is higher in the picture.
    image::imageops::replace(&mut both, &one, i64::from(WIDTH), 0);
    let raised = image::imageops::crop_imm(&one, 0, 30, WIDTH, HEIGHT - 30).to_image();
    image::imageops::replace(&mut both, &raised, i64::from(WIDTH), 0);
    let scene = Scene::new(both);
    let wide = |text: String| text.replace(r#""width": 480"#, r#""width": 960"#);
    scene.write("left.json", &wide(sketch(0.0)));
    let right = wide(sketch(480.0));
    let mut right: serde_json::Value = serde_json::from_str(&right).expect("json");
    let up = |line: &mut serde_json::Value| {
        for at in line.as_array_mut().expect("a line") {
            at[1] = (at[1].as_f64().expect("a number") - 30.0).max(0.0).into();
        }
    };
    up(&mut right["polygon_px"]);
    up(&mut right["strokes"][0]["polyline_px"]);
    scene.write("right.json", &right.to_string());
    let trees = "photo.png --tree left.json --tree right.json --horizon 270";
    let output = scene.photo(trees, "wood");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    let wood = scene.path("wood");
    let names = names_in(&wood);
    for name in [
        "tree-0001",
        "tree-0002",
        "forest.csv",
        "forest.json",
        "forest.glb",
    ] {
        assert!(names.iter().any(|n| n == name), "{names:?}");
    }
    let forest = ForestDocument::read(&wood).expect("a forest").forest;
    let [left, right] = &forest.trees[..] else {
        panic!("{forest:?}");
    };
    // 60 rows below the horizon, and 30.
    assert!((left.scale - 1.0).abs() < 1e-9);
    assert!((right.scale - 2.0).abs() < 0.2, "{}", right.scale);
    assert!(left.foot.x < right.foot.x && left.foot.z > right.foot.z);
    for name in ["tree-0001", "tree-0002"] {
        let tree = Document::read(&wood.join(name), 1.0).expect("a document");
        assert!(count(&tree.skeleton, NodeKind::Grown) > 10);
    }
    let dir = wood.to_str().expect("path");
    run(&["render", dir, "--out"], &scene.path("wood.png"));
    // All of them sway as one scene.
    let windy = ["animate", dir, "--wind", "5", "--seconds", "1", "--out"];
    for name in ["windy.glb", "windy.png"] {
        let said = run(&windy, &scene.path(name));
        let warnings = said.matches("warning:").count();
        assert!(warnings == 1 && said.contains("2 of 2 trees"), "{said}");
    }
    let glb = fs::read(scene.path("windy.glb")).expect("glb");
    let long = u32::from_le_bytes(glb[12..16].try_into().expect("four bytes")) as usize;
    let note: serde_json::Value = serde_json::from_slice(&glb[20..20 + long]).expect("json");
    let channels = note["animations"][0]["channels"].as_array().map(Vec::len);
    assert_eq!(channels, Some(2), "{}", note["animations"]);
    let read = |name: &str| fs::read(scene.path(name)).expect("png");
    assert!(read("windy.png") != read("wood.png"));
}

#[test]
fn a_frame_of_a_film_is_a_photograph() {
    let Some(film) = fs::canonicalize(support::CLIP).ok() else {
        panic!("{} is missing", support::CLIP);
    };
    let outline = fs::canonicalize(support::OUTLINE).expect("outline");
    let scene = Scene::new(photograph(true));
    let trunk = fs::canonicalize("docs/sketches/winter-trunk.json").expect("trunk");
    let arguments = format!(
        "{} --frame 3 --crown {} --branch {}",
        film.display(),
        outline.display(),
        trunk.display()
    );
    let output = scene.photo(&arguments, "tree");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    let tree = Document::read(&scene.path("tree"), 1.0).expect("a document");
    assert!(tree.skeleton.nodes.len() > 5, "{:?}", tree.skeleton.nodes);
    let picture = tree.note.picture.expect("a picture");
    assert_eq!(picture.frame, 3);
    assert!((picture.time_s - 0.1).abs() < 0.01, "{}", picture.time_s);
    let beyond = arguments.replace("--frame 3", "--frame 99999");
    let output = scene.photo(&beyond, "beyond");
    assert_eq!(output.status.code(), Some(BAD_USAGE));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("frames, counted from 0"), "{said}");
    let first = format!("{} --branch {}", film.display(), trunk.display());
    let output = scene.photo(&first, "first");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!said.contains("no picture"), "{said}");
}

impl Scene {
    /// The tree with a crown stroke for a photograph of this width.
    fn tree_with_crown(&self, width: u32) -> (Document, String) {
        let scale = width / WIDTH;
        let corners: Vec<[u32; 2]> = serde_json::from_str(CROWN).expect("corners");
        let corners: Vec<[u32; 2]> = corners.iter().map(|c| c.map(|x| scale * x)).collect();
        let height = scale * HEIGHT;
        self.write(
            "crown.json",
            &format!(r#"{{"width": {width}, "height": {height}, "polygon_px": {corners:?}}}"#),
        );
        self.tree("", "tree")
    }
}

#[test]
fn what_is_not_seen_may_be_like_another_tree() {
    let scene = Scene::new(photograph(true));
    let sketch = fs::canonicalize("docs/sketches/tree.svg").expect("sketch");
    let (own, _) = scene.tree("", "own");
    let (like, _) = scene.tree(&format!(" --like {}", sketch.display()), "like");
    assert!(count(&like.skeleton, NodeKind::Grown) > 20);
    assert_ne!(own.skeleton.nodes.len(), like.skeleton.nodes.len());
}

#[test]
fn a_jpeg_that_is_damaged_within_is_used_with_a_warning() {
    let scene = Scene::new(photograph(true));
    let mut jpeg = std::io::Cursor::new(Vec::new());
    let sound = DynamicImage::from(photograph(true));
    sound
        .write_to(&mut jpeg, image::ImageFormat::Jpeg)
        .expect("jpeg");
    let mut jpeg = jpeg.into_inner();
    // What stands below the foot of the tree.
    let (from, to) = (jpeg.len() - 400, jpeg.len() - 2);
    jpeg[from..to].fill(0);
    fs::write(scene.path("hole.jpg"), &jpeg).expect("write");
    let output = scene.photo("hole.jpg --crown crown.json --branch trunk.json", "tree");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    let warning = "arborcam: warning: hole.jpg: the JPEG is damaged";
    assert!(said.lines().any(|l| l.starts_with(warning)), "{said}");
    let tree = Document::read(&scene.path("tree"), 1.0).expect("a document");
    assert!(tree.note.warnings.iter().any(|w| w.contains("damaged")));
}

/// Ctrl-C as soon as there is anything of the tree on the disk.
#[test]
fn a_signal_ends_it_in_its_second_half_too_and_leaves_nothing() {
    let scene = Scene::new(photograph(true));
    let before = names_in(scene.dir.path());
    let mut stopped = 0;
    for _ in 0..5 {
        let mut command = scene.command("photo.png --crown crown.json --branch trunk.json", "tree");
        let mut child = command.stderr(Stdio::null()).spawn().expect("arborcam");
        let mut ended = None;
        while ended.is_none() && names_in(scene.dir.path()) == before {
            ended = child.try_wait().expect("status");
        }
        if ended.is_none() {
            // SAFETY: the child is ours and not yet waited for.
            unsafe { libc::kill(child.id() as i32, libc::SIGINT) };
        }
        let status = child.wait().expect("status");
        if status.success() {
            // It was there already.
            fs::remove_dir_all(scene.path("tree")).expect("a whole tree");
            continue;
        }
        assert_eq!((status.code(), status.signal()), (Some(STOPPED), None));
        assert_eq!(names_in(scene.dir.path()), before);
        stopped += 1;
    }
    assert!(stopped > 0);
}

#[test]
fn bad_photographs_and_strokes_get_one_line_and_leave_nothing() {
    let scene = Scene::new(photograph(true));
    DynamicImage::new_luma8(10_000, 10_000)
        .save(scene.path("huge.png"))
        .expect("png");
    let whole = fs::read(scene.path("photo.png")).expect("photo");
    fs::write(scene.path("half.png"), &whole[..whole.len() / 2]).expect("write");
    RgbImage::from_pixel(WIDTH, HEIGHT, Rgb([160, 180, 210]))
        .save(scene.path("sky.png"))
        .expect("png");
    let mut jpeg = std::io::Cursor::new(Vec::new());
    DynamicImage::from(photograph(true))
        .write_to(&mut jpeg, image::ImageFormat::Jpeg)
        .expect("jpeg");
    let jpeg = jpeg.into_inner();
    fs::write(scene.path("cut.jpg"), &jpeg[..2 * jpeg.len() / 3]).expect("write");
    scene.write("one.json", &sketch(0.0));
    scene.write("copy.json", &sketch(0.25));
    scene.write("beside.json", &sketch(2.0));
    let line = |text: &str| format!(r#"{{"width": 480, "height": 360, "polyline_px": {text}}}"#);
    let crown = |text: &str| format!(r#"{{"width": 480, "height": 360, "polygon_px": {text}}}"#);
    scene.write("off.json", &line("[[240, 330], [240, 900]]"));
    scene.write("sky.json", &line("[[20, 60], [60, 20]]"));
    scene.write("flat.json", &crown("[[100, 100], [200, 100], [300, 100]]"));
    scene.write("two.json", &crown("[[100, 100], [200, 100]]"));
    scene.write(
        "other.json",
        &line("[[1, 2], [3, 4]]").replace("480", "640"),
    );
    scene.write(
        "bare.svg",
        r#"<svg width="300" height="300"><path d="M150 290 V20"/></svg>"#,
    );
    scene.write(
        "all.json",
        &crown("[[0, 0], [479, 0], [479, 359], [0, 359]]"),
    );
    scene.write(
        "away.json",
        &crown("[[400, 15], [470, 15], [470, 110], [400, 110]]"),
    );
    scene.write(
        "geo.json",
        r#"{"type": "FeatureCollection", "features": []}"#,
    );
    scene.write(
        "round.svg",
        r#"<svg width="480" height="360"><path d="M100 20 L380 20 L390 190 L90 190 Z"/></svg>"#,
    );
    fs::write(scene.path("some.gif"), b"GIF89a\x01\0\x01\0").expect("write");
    DynamicImage::from(photograph(false))
        .to_luma8()
        .save(scene.path("grey.png"))
        .expect("png");
    let strokes = "--crown crown.json --branch trunk.json";
    for (arguments, status, expected) in [
        (format!("none.png {strokes}"), NO_INPUT, "cannot read"),
        (format!("huge.png {strokes}"), FAILED, "100 megapixels"),
        (
            format!("half.png {strokes}"),
            FAILED,
            "half.png: it is damaged: the PNG is cut off",
        ),
        (format!("crown.json {strokes}"), FAILED, "no picture"),
        (
            format!("sky.png {strokes}"),
            FAILED,
            "trunk.json: along the trunk's stroke",
        ),
        ("sky.png".into(), FAILED, "no tree"),
        (
            "photo.png --crown crown.json --branch off.json".into(),
            BAD_USAGE,
            "off.json",
        ),
        (
            "photo.png --crown crown.json --branch trunk.json --branch sky.json".into(),
            BAD_USAGE,
            "sky.json: stroke 2 meets no",
        ),
        (
            "photo.png --crown crown.json --branch sky.json".into(),
            FAILED,
            "along the trunk's stroke",
        ),
        (
            "photo.png --crown away.json --branch trunk.json".into(),
            FAILED,
            "away.json: within the crown stroke are neither leaves nor branches",
        ),
        (
            "photo.png --crown all.json --branch trunk.json".into(),
            BAD_USAGE,
            "all.json: the crown stroke is round all of the photograph",
        ),
        (
            "photo.png --crown trunk.json --branch crown.json".into(),
            BAD_USAGE,
            "its line is open",
        ),
        (
            "photo.png --crown crown.json --branch crown.json".into(),
            BAD_USAGE,
            "no line along a branch",
        ),
        (
            "photo.png --crown crown.json --branch round.svg".into(),
            BAD_USAGE,
            "is closed",
        ),
        (
            format!("photo.png {strokes} --foliage red"),
            FAILED,
            "no red leaves",
        ),
        (
            format!("grey.png {strokes} --foliage red"),
            FAILED,
            "no red leaves",
        ),
        (format!("some.gif {strokes}"), FAILED, "a GIF picture"),
        (
            "photo.png --crown geo.json --branch trunk.json".into(),
            BAD_USAGE,
            "holds no stroke",
        ),
        (
            "photo.png --crown flat.json --branch trunk.json".into(),
            BAD_USAGE,
            "crown stroke",
        ),
        (
            "photo.png --crown two.json --branch trunk.json".into(),
            BAD_USAGE,
            "3 are needed",
        ),
        (
            "photo.png --crown crown.json --branch other.json".into(),
            BAD_USAGE,
            "480x360",
        ),
        (
            format!("photo.png {strokes} --like bare.svg"),
            BAD_USAGE,
            "branches",
        ),
        (format!("photo.png {strokes} --like none"), NO_INPUT, "none"),
        (format!("cut.jpg {strokes}"), FAILED, "cut off"),
        (
            format!("photo.png {strokes} --frame 3"),
            BAD_USAGE,
            "single picture",
        ),
        (
            format!("none.mkv {strokes} --frame 3"),
            NO_INPUT,
            "none.mkv",
        ),
        ("photo.png --tree bare.svg".into(), BAD_USAGE, "480x360"),
        (
            "photo.png --tree one.json --tree trunk.json".into(),
            BAD_USAGE,
            "trunk.json: each of several trees",
        ),
        (
            "photo.png --tree one.json --tree beside.json --horizon 350".into(),
            BAD_USAGE,
            "--horizon",
        ),
        (
            "photo.png --tree one.json --tree one.json".into(),
            BAD_USAGE,
            "one.json: it is the tree of --tree one.json once more",
        ),
        (
            "photo.png --tree one.json --tree copy.json".into(),
            BAD_USAGE,
            "copy.json: it is the tree of --tree one.json once more",
        ),
        (
            "photo.png --tree one.json --tree off.json".into(),
            BAD_USAGE,
            "outside",
        ),
        (
            format!("photo.png {strokes} --draw"),
            BAD_USAGE,
            "no terminal",
        ),
    ] {
        let output = scene.photo(&arguments, "out");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let lines: Vec<&str> = said.lines().filter(|l| !l.contains("note:")).collect();
        assert_eq!(output.status.code(), Some(status), "{arguments}: {said}");
        assert!(
            lines.len() == 1 && lines[0].contains(expected),
            "{arguments}: {said}"
        );
        assert!(
            !names_in(scene.dir.path())
                .iter()
                .any(|n| n.starts_with("out")),
            "{arguments}"
        );
    }
    scene.tree("", "out");
    let again = scene.photo(&format!("photo.png {strokes}"), "out");
    assert_eq!(again.status.code(), Some(FAILED));
}

//! The model in other people's hands: the Khronos validator, and Blender. Where they are absent the
//! tests say so and do nothing; with `ARBORCAM_REQUIRE_TOOLS=1` they fail.

use crate::{still, synthetic, tools};
use arborcam::config::Config;
use arborcam::export::gltf::{KEY_TOLERANCE_PX, Model, glb, gltf_files};
use arborcam::geometry::{Bark, Dressed, Foliage, Mesh, bare_wood};
use arborcam::model::{Pose, Skeleton};
use arborcam::pipeline::{Seen, dress};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn dressed(skeleton: &Skeleton, levels: usize, foliage: Foliage) -> Dressed {
    let wood = |k: usize| bare_wood(skeleton, 40_000 >> k);
    Dressed {
        wood: (0..levels).map(wood).collect(),
        foliage,
        bark: Bark {
            rgb: [110, 86, 60],
            ..Bark::default()
        },
        ..Dressed::default()
    }
}

fn model<'a>(
    skeleton: &'a Skeleton,
    dressed: &'a Dressed,
    poses: &'a [Pose],
    provenance: &'a Value,
) -> Model<'a> {
    Model {
        skeleton,
        dressed,
        poses,
        flutter: &[],
        level: 0,
        metres_per_px: 0.0,
        tolerance_px: KEY_TOLERANCE_PX,
        node_extras: &[],
        provenance,
    }
}

/// Every kind of file that there can be, in `dir`.
fn all_kinds(dir: &Path) -> Vec<PathBuf> {
    let skeleton = synthetic::tree(7, 3);
    let poses = synthetic::sway(&skeleton, 60);
    let note = json!({"software": "arborcam", "source": "a \"b\" <c>"});
    let foliage = synthetic::leaves(&skeleton);
    let flutter = synthetic::flutter(&foliage, &poses);
    let plain = Foliage {
        texture: None,
        ..foliage.clone()
    };
    let (bare, leafy, uncut) = (
        dressed(&skeleton, 1, Foliage::default()),
        dressed(&skeleton, 3, foliage),
        dressed(&skeleton, 1, plain),
    );
    let mut lone = skeleton.clone();
    lone.nodes.truncate(1);
    let lone_poses = synthetic::sway(&lone, 3);
    let nothing = Dressed {
        wood: vec![Mesh::default()],
        ..Dressed::default()
    };
    // Two nodes at one place: a branch without length.
    let mut short = skeleton.clone();
    short.nodes[5].position = short.nodes[short.nodes[5].parent.unwrap().index()].position;
    let short_dressed = dressed(&short, 1, Foliage::default());
    let short_poses = synthetic::sway(&short, 20);
    let with_leaves = Model {
        flutter: &flutter,
        ..model(&skeleton, &leafy, &poses, &note)
    };
    let roughest = Model {
        level: 2,
        ..model(&skeleton, &leafy, &poses, &note)
    };
    let cases = [
        ("bare", model(&skeleton, &bare, &poses, &note)),
        ("still", model(&skeleton, &bare, &[], &note)),
        ("leaves-that-swing", with_leaves),
        ("roughest-level", roughest),
        (
            "leaves-in-metres",
            Model {
                metres_per_px: 0.01,
                ..with_leaves
            },
        ),
        (
            "leaves-without-texture",
            model(&skeleton, &uncut, &poses, &note),
        ),
        ("one-node", model(&lone, &nothing, &lone_poses, &note)),
        (
            "no-length",
            model(&short, &short_dressed, &short_poses, &note),
        ),
    ];
    let mut paths = Vec::new();
    for (name, model) in cases {
        let path = dir.join(format!("{name}.glb"));
        fs::write(&path, glb(&model).expect(name).0).expect("write");
        paths.push(path);
    }
    for (name, bytes) in gltf_files(&with_leaves, "my tree").expect("gltf").0 {
        fs::write(dir.join(&name), bytes).expect("write");
        paths.extend(name.ends_with(".gltf").then(|| dir.join(name)));
    }
    paths
}

#[test]
fn the_khronos_validator_finds_nothing() {
    let Some(validator) = tools::Validator::find() else {
        return;
    };
    let dir = tempfile::tempdir().expect("tempdir");
    let mut files = all_kinds(dir.path());
    let out = dir.path().join("out");
    let clip = [
        "recordings/sparse_winter.mkv",
        "--outline",
        "recordings/sparse_winter.outline.json",
    ];
    let mut replay = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    replay
        .args(["replay", "--fast", "--headless"])
        .args(clip)
        .arg("--out")
        .arg(&out);
    assert!(
        replay
            .stderr(std::process::Stdio::null())
            .status()
            .expect("arborcam")
            .success()
    );
    files.push(out.join("tree.glb"));
    validator.finds_nothing_in(&files);
}

/// What a script that is run in Blender says of a file, in its line that begins with `word`.
fn told_by_blender(blender: &Path, script: &str, file: &Path, word: &str) -> Value {
    let mut run = Command::new(blender);
    run.args(["-b", "--factory-startup", "-P", script, "--"])
        .arg(file);
    let output = run.output().expect("blender");
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    let line = told
        .lines()
        .find_map(|l| l.strip_prefix(word))
        .unwrap_or_else(|| panic!("{told}{errors}"));
    assert!(
        !told.contains("Error") && !errors.contains("Traceback"),
        "{told}{errors}"
    );
    serde_json::from_str(line).expect("json")
}

#[test]
fn blender_gets_every_bone_and_the_whole_animation() {
    let Some(blender) = tools::program("blender", "--version") else {
        return;
    };
    let dir = tempfile::tempdir().expect("tempdir");
    let skeleton = synthetic::tree(7, 2);
    let poses = synthetic::sway(&skeleton, 91);
    let foliage = synthetic::leaves(&skeleton);
    let flutter = synthetic::flutter(&foliage, &poses);
    let groups = foliage.groups.len();
    let dressed = dressed(&skeleton, 1, foliage);
    let file = dir.path().join("tree.glb");
    let (bytes, _) = glb(&Model {
        flutter: &flutter,
        ..model(&skeleton, &dressed, &poses, &Value::Null)
    })
    .expect("glb");
    fs::write(&file, bytes).expect("write");
    let there = told_by_blender(&blender, "tests/blender_import.py", &file, "IMPORTED ");
    println!("{there}");
    let names = skeleton.botanical_branches().piece_names();
    let bones: Vec<&str> = there["bones"]
        .as_array()
        .expect("bones")
        .iter()
        .filter_map(Value::as_str)
        .collect();
    assert_eq!(bones.len(), names.len());
    assert!(
        names.iter().all(|name| bones.contains(&name.as_str())),
        "bones are named by their branches"
    );
    let end_s = there["end_s"].as_f64().expect("end");
    let length_s = poses[90].time_s - poses[0].time_s;
    assert!((end_s - length_s).abs() < 0.01, "{end_s} s of {length_s} s");
    assert_eq!(
        there["meshes"].as_array().expect("meshes").len(),
        1 + groups
    );
    assert_eq!(
        there["shape_keys"],
        3 * groups,
        "the rest and two swings for every group"
    );
    assert_eq!(there["materials"], json!(["bark", "bark_made_up", "leaf"]));
}

/// Leaves that do not swing on their own: one tree, one armature, one action, nothing beside them.
#[test]
fn blender_gets_one_armature_and_one_action() {
    let Some(blender) = tools::program("blender", "--version") else {
        return;
    };
    let dir = tempfile::tempdir().expect("tempdir");
    let skeleton = synthetic::tree(7, 2);
    let poses = synthetic::sway(&skeleton, 31);
    let dressed = dressed(&skeleton, 3, synthetic::leaves(&skeleton));
    for level in 0..3 {
        let file = dir.path().join(format!("tree{level}.glb"));
        let model = Model {
            level,
            ..model(&skeleton, &dressed, &poses, &Value::Null)
        };
        fs::write(&file, glb(&model).expect("glb").0).expect("write");
        let there = told_by_blender(&blender, "tests/blender_import.py", &file, "IMPORTED ");
        println!("{there}");
        assert_eq!(there["armatures"], json!(["tree"]));
        assert_eq!(there["actions"].as_array().map(Vec::len), Some(1));
        assert_eq!(there["empties"], json!([]));
        assert_eq!(there["meshes"], json!(["leaves", "wood"]));
        assert_eq!(there["materials"], json!(["bark", "bark_made_up", "leaf"]));
        assert_eq!(there["shape_keys"], 0);
        let bones = there["bones"].as_array().expect("bones");
        assert!(
            ["tree", "trunk", "limb_1", "limb_1.1"]
                .iter()
                .all(|n| bones.contains(&json!(n)))
        );
    }
}

/// The crown of a tree as it is filmed in leaf, imported with the importer's own settings and lit by
/// a sun and a sky: green and not black, from the front and from behind.
#[test]
fn blender_shows_a_green_crown() {
    let Some(blender) = tools::program("blender", "--version") else {
        return;
    };
    let film = still::still(true);
    let seen = Seen {
        picture: Some(&film.picture),
        outline: Some(&film.outline),
        ..Seen::default()
    };
    let dressed = dress(&film.skeleton, seen, &Config::default());
    let dir = tempfile::tempdir().expect("tempdir");
    let file = dir.path().join("tree.glb");
    let (bytes, _) = glb(&model(&film.skeleton, &dressed, &[], &Value::Null)).expect("glb");
    fs::write(&file, bytes).expect("write");
    let looks = told_by_blender(&blender, "tests/blender_look.py", &file, "LOOKS ");
    println!("{looks}");
    for side in ["front", "back"] {
        let of = |what: &str| looks[side][what].as_f64().expect("a number");
        let [r, g, b] = ["red", "green", "blue"].map(of);
        // The leaves of the picture have 2.6 and 7.4 times as much green as red and blue in linear
        // light, 0.16 of white; a crown lit from behind its leaves shows a twentieth of that.
        assert!(of("cover") > 0.1, "{looks}");
        assert!(g > 1.5 * r && g > 2.0 * b, "{side}: {looks}");
        assert!(g > 0.025, "{side}: {looks}");
    }
}

//! A capture folder read back: what is in it comes out again, and what is damaged is named.

use crate::support::{self, CLIP, OUTLINE, replayed, replayed_by_motion as made};
use arborcam::bounds::Bounds;
use arborcam::document::{CaptureNote, Document, DocumentError};
use arborcam::model::Skeleton;
use nalgebra::distance;
use std::fs;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

const WHOLE: f64 = 60.0;

/// A copy of the capture that a test may spoil.
fn copy() -> TempDir {
    copy_of(made())
}

fn copy_of(capture: &Path) -> TempDir {
    let dir = tempfile::tempdir().expect("tempdir");
    for file in fs::read_dir(capture).expect("capture").flatten() {
        fs::copy(file.path(), dir.path().join(file.file_name())).expect("copy");
    }
    dir
}

fn edit(dir: &Path, name: &str, change: impl Fn(String) -> String) {
    let file = dir.join(name);
    let text = fs::read_to_string(&file).expect("text");
    fs::write(file, change(text)).expect("write");
}

fn lengths(skeleton: &Skeleton, at: impl Fn(usize) -> nalgebra::Point3<f64>) -> Vec<f64> {
    let own = |(i, n): (usize, &arborcam::model::Node)| {
        n.parent.map_or(0.0, |p| (at(i) - at(p.index())).norm())
    };
    skeleton.nodes.iter().enumerate().map(own).collect()
}

/// Whoever exports from a folder must get the tree that was filmed, in every frame.
#[test]
fn what_was_written_is_read_again() {
    let read = Document::read(made(), WHOLE).expect("capture");
    assert_eq!(read.warnings, [""; 0]);
    let note = read.note.model.as_ref().expect("model");
    let copies = read.skeleton.nodes.len() - read.skeleton.measured();
    assert_eq!(
        (read.skeleton.nodes.len(), copies),
        (note.nodes as usize, note.copies as usize)
    );
    assert!(copies > 10 && read.skeleton.nodes[0].certainty >= 0.0);
    assert!(
        read.skeleton.nodes[2..].iter().any(|n| n.certainty > 0.5),
        "how sure the forks are is known"
    );
    assert_eq!(read.poses.len(), 330);
    // Every node where the table has it, copies among them: these are read by their originals.
    let rows = fs::read_to_string(made().join("motion.csv")).expect("motion.csv");
    let mut worst = 0.0_f64;
    for (k, row) in rows.lines().skip(1).enumerate() {
        let cells: Vec<f64> = row.split(',').map(|c| c.parse().expect("number")).collect();
        let joint =
            &read.poses[k / read.skeleton.nodes.len()].joints[k % read.skeleton.nodes.len()];
        worst = (0..3)
            .map(|c| (joint.position[c] - cells[3 + c]).abs())
            .fold(worst, f64::max);
    }
    println!("a node is at most {worst:.5} px off its row");
    assert!(worst < 0.01, "{worst} px");
    let rest = lengths(&read.skeleton, |i| read.skeleton.nodes[i].position);
    for pose in &read.poses {
        let now = lengths(&read.skeleton, |i| pose.joints[i].position);
        assert!(rest.iter().zip(now).all(|(a, b)| (a - b).abs() < 1e-6));
    }
}

#[test]
fn the_picture_is_the_first_frame_and_the_tree_stands_in_it() {
    let read = Document::read(made(), WHOLE).expect("capture");
    let picture = read.picture.expect("picture");
    assert_eq!((picture.frame, picture.time_s), (0, 0.0));
    let mut decoder = arborcam::source::Decoder::new().expect("decoder");
    let first = decoder
        .preview(&support::recording()[0], support::SIZE.width)
        .expect("picture");
    assert_eq!(picture.rgb.size, first.size);
    let off: f64 = picture
        .rgb
        .pixels
        .iter()
        .zip(&first.pixels)
        .map(|(a, b)| f64::from(a.abs_diff(*b)))
        .sum();
    assert!(
        off / (first.pixels.len() as f64) < 4.0,
        "the picture is another one"
    );
    assert_eq!(read.pose_in_picture.as_ref(), read.poses.first());
    let outline = read.outline.expect("outline");
    assert_eq!(outline.polygon_px, support::outline().polygon_px);
}

#[test]
fn the_end_of_the_film_is_kept_and_the_pose_of_the_picture_with_it() {
    let read = Document::read(made(), 2.0).expect("capture");
    let (first, last) = (&read.poses[0], read.poses.last().expect("poses"));
    assert_eq!((last.frame, read.poses.len()), (329, 61));
    assert!(last.time_s - first.time_s <= 2.0);
    assert_eq!(read.pose_in_picture.expect("pose").frame, 0);
}

/// A tree without a film is a tree at rest.
#[test]
fn a_document_without_a_film_is_read_at_rest() {
    let dir = copy();
    for name in ["motion.csv", "tracks.csv", "tree.glb"] {
        fs::remove_file(dir.path().join(name)).expect("remove");
    }
    let read = Document::read(dir.path(), WHOLE).expect("document");
    assert!(read.poses.is_empty() && read.pose_in_picture.is_none());
    assert!(
        matches!(&read.warnings[..], [one] if one.contains("at rest")),
        "{:?}",
        read.warnings
    );
    let whole = Document::read(made(), WHOLE).expect("capture");
    assert_eq!(read.skeleton, whole.skeleton);
    let film = read.film().err().map(|e| e.to_string());
    assert!(film.is_some_and(|e| e.contains("lacks motion.csv") && !e.contains('\n')));
    let points = read.tracked_within(60.0, Bounds::new(0.0, 60.0)).err();
    assert!(points.is_some_and(|e| e.to_string().contains("lacks tracks.csv")));
}

#[test]
fn a_model_in_metres_is_read_in_pixels() {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    let settings = dir.path().join("short.toml");
    fs::write(
        &settings,
        "[export]\nanimation_s = 2.5\n[skeleton]\nalong_wood = false\n",
    )
    .expect("settings");
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command.args([
        "replay",
        CLIP,
        "--fast",
        "--headless",
        "--config",
        settings.to_str().expect("path"),
        "--metres-per-px",
        "0.01",
        "--outline",
        OUTLINE,
        "--out",
    ]);
    assert!(
        command
            .arg(&out)
            .stderr(std::process::Stdio::null())
            .status()
            .expect("arborcam")
            .success()
    );
    let (px, m) = (
        Document::read(made(), WHOLE).expect("px"),
        Document::read(&out, WHOLE).expect("m"),
    );
    for (a, b) in px.skeleton.nodes.iter().zip(&m.skeleton.nodes) {
        assert!((a.position - b.position).norm() < 1e-3 && (a.radius - b.radius).abs() < 1e-3);
    }
    // Its model is that of `export`, with so much of the film as the settings say.
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command.arg("export").arg(&out);
    let again = command.args(["--format", "glb", "--out", "-"]).output();
    let own = fs::read(out.join("tree.glb")).expect("model");
    assert!(
        again.expect("arborcam").stdout == own,
        "the model is not that of `export`"
    );
    let frames = m.note.animation.expect("animation").frames;
    assert!((74..=76).contains(&frames), "{frames} frames");
}

/// Followed anew from the same places in the picture, the same tree moves as before.
#[test]
fn a_tree_of_the_same_shape_is_posed_as_it_was() {
    let read = Document::read(made(), WHOLE).expect("capture");
    let again = read.reposed(&read.skeleton, &read.note.config, &read.poses);
    let mut off: Vec<f64> = Vec::new();
    for (a, b) in read.poses.iter().zip(&again).skip(60) {
        let front = |j: &arborcam::model::JointPose| read.skeleton.image_from_model(&j.position);
        off.extend(
            a.joints[..read.skeleton.measured()]
                .iter()
                .zip(&b.joints)
                .map(|(a, b)| distance(&front(a), &front(b))),
        );
    }
    off.sort_by(f64::total_cmp);
    println!(
        "in the picture: median {:.4} px, worst {:.3} px",
        off[off.len() / 2],
        off[off.len() - 1]
    );
    assert!(off[off.len() / 2] < 0.1 && off[off.len() * 99 / 100] < 1.0);
}

/// One damage each: the file that is edited, how, and a word that the message must hold.
#[test]
fn damage_is_named_with_file_and_line() {
    type Edit = fn(String) -> String;
    fn with(text: String, line: usize, column: usize, value: &str) -> String {
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        let mut cells: Vec<&str> = lines[line - 1].split(',').collect();
        cells[column] = value;
        lines[line - 1] = cells.join(",");
        lines.join("\n") + "\n"
    }
    fn of_frame(text: &str, frame: usize) -> usize {
        1 + text
            .lines()
            .position(|l| l.starts_with(&format!("{frame},")))
            .expect("a line of the frame")
    }
    fn noted(text: String, change: fn(&mut serde_json::Value)) -> String {
        let mut note = serde_json::from_str(&text).expect("json");
        change(&mut note);
        note.to_string()
    }
    let cases: &[(&str, Edit, &str)] = &[
        (
            "nodes.csv",
            |t| with(t, 5, 6, "NaN"),
            "nodes.csv, line 5: x is \"NaN\"",
        ),
        (
            "nodes.csv",
            |t| with(t, 5, 6, ""),
            "nodes.csv, line 5: x is \"\"",
        ),
        (
            "nodes.csv",
            |t| with(t, 5, 1, "4000000000"),
            "line 5: its parent is node 4000000000",
        ),
        (
            "nodes.csv",
            |t| with(t, 5, 0, "0"),
            "line 5: there are two nodes 0",
        ),
        ("nodes.csv", |t| with(t, 3, 1, ""), "line 3: the first node"),
        ("nodes.csv", |t| with(t, 4, 2, "-1"), "line 4: level"),
        (
            "nodes.csv",
            |t| with(t, 5, 2, "1"),
            "nodes.csv, line 5: level is 1, and must be",
        ),
        (
            "nodes.csv",
            |t| with(t, 2, 2, "7"),
            "nodes.csv, line 2: level is 7, and must be 0",
        ),
        (
            "nodes.csv",
            |t| with(t, 5, 0, "4294967295"),
            "nodes.csv, line 5: node_id is 4294967295",
        ),
        (
            "nodes.csv",
            |t| with(t, 5, 6, "2e6"),
            "nodes.csv, line 5: x is \"2e6\", which is 2000000 px",
        ),
        (
            "nodes.csv",
            |t| with(t, 5, 9, "2e6"),
            "nodes.csv, line 5: radius is \"2e6\"",
        ),
        (
            "nodes.csv",
            |t| with(t, 5, 9, "-1"),
            "nodes.csv, line 5: radius is -1",
        ),
        (
            "nodes.csv",
            |t| with(t, 5, 10, "fast"),
            "nodes.csv, line 5: frequency_hz is \"fast\"",
        ),
        (
            "nodes.csv",
            |t| with(with(with(t, 5, 10, "3"), 5, 11, "1"), 5, 12, "2"),
            "line 5: frequency_hz is \"3\", and must lie between 1 and 2",
        ),
        (
            "motion.csv",
            |t| with(t, 90, 4, "-1e7"),
            "motion.csv, line 90: y is \"-1e7\"",
        ),
        (
            "capture.json",
            |t| noted(t, |n| n["model"]["foot_px"] = [1e18, 300.0].into()),
            "foot_px is far from",
        ),
        (
            "capture.json",
            |t| noted(t, |n| n["model"]["metres_per_px"] = 1e-9.into()),
            "no tree is so large",
        ),
        (
            "nodes.csv",
            |t| t.replacen("radius", "diameter", 1),
            "line 1: the column radius is missing",
        ),
        (
            "motion.csv",
            |t| with(t, 90, 3, "inf"),
            "motion.csv, line 90: x is \"inf\"",
        ),
        (
            "motion.csv",
            |t| with(t, 90, 2, "3999"),
            "line 90: here stands node 3999",
        ),
        (
            "motion.csv",
            |t| with(t.clone(), of_frame(&t, 1), 0, "0"),
            "motion.csv, line",
        ),
        (
            "motion.csv",
            |t| t[..t.len() - 40].to_owned(),
            "motion.csv, line",
        ),
        (
            "motion.csv",
            |t| t.lines().take(100).map(|l| format!("{l}\n")).collect(),
            "in the middle of frame 1",
        ),
        (
            "motion.csv",
            |_| String::new(),
            "line 1: the column frame is missing",
        ),
        (
            "capture.json",
            |t| t[..t.len() / 2].to_owned(),
            "capture.json: ",
        ),
        (
            "capture.json",
            |t| t.replacen("\"schema_version\": 1", "\"schema_version\": 99", 1),
            "newer version",
        ),
        (
            "capture.json",
            |t| t.replacen("\"fold\"", "\"unfold\"", 1),
            "newer version",
        ),
        (
            "capture.json",
            |t| t.replacen("\"width\": 640", "\"width\": 4000000000", 1),
            "of this size",
        ),
        (
            "capture.json",
            |t| t.replacen("\"fold\": 0.4", "\"fold\": 40.0", 1),
            "out of range",
        ),
    ];
    for (name, change, word) in cases {
        let dir = copy();
        edit(dir.path(), name, change);
        let error = Document::read(dir.path(), WHOLE)
            .expect_err(word)
            .to_string();
        assert!(
            error.contains(word) && !error.contains('\n'),
            "{word}: {error}"
        );
    }
    let dir = copy();
    fs::remove_file(dir.path().join("nodes.csv")).expect("remove");
    let error = Document::read(dir.path(), WHOLE)
        .expect_err("missing")
        .to_string();
    assert!(error.contains("lacks nodes.csv"), "{error}");
    let nowhere = Document::read(Path::new("recordings"), WHOLE).expect_err("no capture");
    assert!(
        matches!(nowhere, DocumentError::NotACapture { .. }),
        "{nowhere}"
    );
}

/// What a table says of copies may be wrong as well: a branch that repeats one of another level, or
/// a copy, could not be posed, or not be cut with it.
#[test]
fn a_copy_of_what_cannot_be_repeated_is_refused() {
    let table = fs::read_to_string(made().join("nodes.csv")).expect("nodes");
    let rows: Vec<Vec<&str>> = table.lines().map(|l| l.split(',').collect()).collect();
    let (copies, level): (Vec<usize>, &str) = {
        let copies: Vec<usize> = (1..rows.len()).filter(|&i| rows[i][20] == "copy").collect();
        let level = rows[copies[1]][2];
        (copies, level)
    };
    let other = (2..copies[0])
        .find(|&i| rows[i][2] != level)
        .expect("a node of another level");
    let cases = [
        (20, "trunk", "kind is \"trunk\""),
        (20, "measured", "it stands after a copy"),
        (21, "0", "copy_of is 0, which is no branch"),
        (21, "4000000", "copy_of is 4000000, which is no branch"),
        (21, rows[copies[0]][0], "a copy itself or of another level"),
        (21, rows[other][0], "a copy itself or of another level"),
        (22, "", "plane_deg is \"\""),
        (23, "1.5", "certainty is 1.5"),
    ];
    for (column, value, words) in cases {
        let dir = copy();
        let mut rows = rows.clone();
        rows[copies[1]][column] = value;
        let text: String = rows.iter().map(|r| r.join(",") + "\n").collect();
        fs::write(dir.path().join("nodes.csv"), text).expect("write");
        let error = Document::read(dir.path(), WHOLE)
            .expect_err(words)
            .to_string();
        let line = format!("nodes.csv, line {}: ", copies[1] + 1);
        assert!(
            error.contains(words) && error.contains(&line) && !error.contains('\n'),
            "{words}: {error}"
        );
    }
}

/// A film of hours is gone through pose by pose; it must be the same film.
#[test]
fn the_film_has_every_pose_once() {
    let read = Document::read(made(), WHOLE).expect("capture");
    let film: Vec<_> = read
        .film()
        .expect("film")
        .collect::<Result<_, _>>()
        .expect("poses");
    assert_eq!(film, read.poses);
    let dir = copy();
    let read = Document::read(dir.path(), WHOLE).expect("capture");
    edit(dir.path(), "motion.csv", |t| {
        t.lines().take(200).map(|l| format!("{l}\n")).collect()
    });
    let film: Vec<_> = read.film().expect("film").collect();
    assert!(
        film.len() > 2
            && film[..film.len() - 1].iter().all(Result::is_ok)
            && film[film.len() - 1].is_err()
    );
}

#[test]
fn a_film_without_a_tree_is_no_damage() {
    let dir = copy();
    edit(dir.path(), "capture.json", |text| {
        let mut note: CaptureNote = serde_json::from_str(&text).expect("json");
        note.model = None;
        serde_json::to_string(&note).expect("json")
    });
    let error = Document::read(dir.path(), WHOLE).expect_err("no tree");
    assert!(matches!(error, DocumentError::NoTree { .. }), "{error}");
}

/// Of masks and picture of rest of a film little is made: what is wrong with them disturbs nobody.
#[test]
fn damaged_masks_disturb_nothing() {
    let dir = copy_of(replayed());
    fs::write(dir.path().join("wood.png"), b"no picture").expect("written");
    for name in ["rest.png", "leaves.png"] {
        fs::remove_file(dir.path().join(name)).expect("removed");
    }
    let read = Document::read(dir.path(), WHOLE).expect("the tree is there");
    assert!(read.bark.is_some() && read.warnings.is_empty());
}

mod fuzz {
    use super::*;
    use arborcam::config::{Config, EnvelopeKind, LeafShow, Leaves, Shape};
    use arborcam::export::gltf::{KEY_TOLERANCE_PX, Model, glb};
    use arborcam::model::Pose;
    use arborcam::pipeline::{Seen, cut_to, dress, flutter, reshape};
    use proptest::prelude::*;
    use std::sync::Arc;

    const FILES: [&str; 9] = [
        "nodes.csv",
        "motion.csv",
        "capture.json",
        "tree.glb",
        "frame.jpg",
        "bark.png",
        "rest.png",
        "wood.png",
        "leaves.png",
    ];

    proptest! {
        #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

        /// Whatever happened to the bytes, the program says so or goes on; it does not fall.
        #[test]
        fn no_damage_makes_the_reader_fall(
            name in prop::sample::select(FILES.to_vec()),
            at in prop::collection::vec(0.0..1.0f64, 1..6),
            with in prop::sample::select(vec![b',', b'\n', b'"', b'9', b'-', b'e', 0u8, 0xff]),
            cut in prop::option::of(0.0..1.0f64),
        ) {
            // Only where wood was looked for there is a picture of it.
            let dir = copy_of(if name.ends_with("png") { replayed() } else { made() });
            let file = dir.path().join(name);
            let mut bytes = fs::read(&file).expect("read");
            // The front of a large file is as good as all of it, and read faster.
            bytes.truncate(200_000);
            for at in at {
                let i = (at * bytes.len() as f64) as usize;
                bytes[i] = with;
            }
            if let Some(cut) = cut {
                bytes.truncate((cut * bytes.len() as f64) as usize);
            }
            fs::write(&file, &bytes).expect("write");
            if let Err(e) = Document::read(dir.path(), 1.0) {
                prop_assert!(!e.to_string().contains('\n'), "{}", e);
            }
        }
    }
    /// Numbers that no stage would expect.
    const ODD: [&str; 8] = ["1e18", "-1", "NaN", "0", "65535", "9e5", "1e-300", "255"];

    /// A table with a number in some of its cells changed, a note with some of its numbers.
    fn spoilt(name: &str, text: &str, picks: &[(f64, &str)]) -> String {
        if name == "capture.json" {
            let mut note: serde_json::Value = serde_json::from_str(text).expect("json");
            for (at, odd) in picks {
                let mut numbers = Vec::new();
                collect(&mut note, &mut numbers);
                let k = (at * numbers.len() as f64) as usize;
                *numbers[k] = serde_json::from_str(odd).unwrap_or(serde_json::Value::Null);
            }
            return note.to_string();
        }
        let mut rows: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
        for (at, odd) in picks {
            let cells = (rows.len() - 1) * rows[0].len();
            let k = (at * cells as f64) as usize;
            let (row, column) = (1 + k / rows[0].len(), k % rows[0].len());
            rows[row][column] = odd;
        }
        rows.iter().map(|r| r.join(",") + "\n").collect()
    }

    fn collect<'a>(value: &'a mut serde_json::Value, into: &mut Vec<&'a mut serde_json::Value>) {
        match value {
            serde_json::Value::Number(_) => into.push(value),
            serde_json::Value::Array(all) => all.iter_mut().for_each(|v| collect(v, into)),
            serde_json::Value::Object(all) => all.values_mut().for_each(|v| collect(v, into)),
            _ => {}
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 32, failure_persistence: None, ..ProptestConfig::default() })]

        /// What the reader takes, every later stage takes: the model of it, another shape, a cut
        /// one.
        #[test]
        fn no_odd_number_makes_an_export_fall(
            name in prop::sample::select(vec!["nodes.csv", "motion.csv", "capture.json"]),
            picks in prop::collection::vec((0.0..1.0f64, prop::sample::select(ODD.to_vec())), 1..4),
        ) {
            let dir = copy();
            edit(dir.path(), name, |text| spoilt(name, &text, &picks));
            let read = match Document::read(dir.path(), 0.2) {
                Ok(read) => read,
                Err(e) => {
                    prop_assert!(!e.to_string().contains('\n'), "{}", e);
                    return Ok(());
                }
            };
            let mut config = read.note.config.clone();
            // Any would do, and these are fast.
            config.shape = Shape { planes: 2, attractors: 32, push_options: 5, passes: 1, ..config.shape };
            config.wood.triangles = config.wood.triangles.min(2000);
            config.leaves = Leaves { show: LeafShow::On, triangles: 1000, ..config.leaves };
            exported(&read, &read.skeleton, &read.poses, &config);
            if let Some(outline) = &read.outline {
                let heart = fs::read("docs/shapes/heart.png").expect("shape");
                let heart = arborcam::shape::Drawn::of_image(&heart).expect("a shape");
                if let Ok(cut) = cut_to(&read.skeleton, outline, &heart, &config) {
                    let poses: Vec<Pose> = read.poses.iter().map(|p| cut.pose(&read.skeleton, p)).collect();
                    exported(&read, &cut.skeleton, &poses, &config);
                }
                for envelope in [EnvelopeKind::Revolution, EnvelopeKind::Hull] {
                    config.shape.envelope = envelope;
                    let new = Arc::new(reshape(&read.skeleton, outline, &config));
                    exported(&read, &new, &read.reposed(&new, &config, &read.poses), &config);
                }
            }
        }
    }

    /// Places for twigs are as far apart as the shortest one is long.
    #[test]
    fn twigs_of_next_to_no_length_take_no_more_room() {
        let read = Document::read(made(), 0.2).expect("a capture");
        for twig_px in [1e-300, 1e-6] {
            let mut config = read.note.config.clone();
            config.wood.twig_px = twig_px;
            config.wood.triangles = 2000;
            config.leaves.show = LeafShow::Off;
            exported(&read, &read.skeleton, &read.poses, &config);
        }
    }

    /// To a model that opens, or to a refusal of one line.
    fn exported(read: &Document, skeleton: &Skeleton, poses: &[Pose], config: &Config) {
        let seen = Seen {
            picture: read.picture.as_ref().map(|p| &*p.rgb),
            outline: read.outline.as_ref(),
            ..Seen::default()
        };
        let dressed = dress(skeleton, seen, config);
        let model = Model {
            skeleton,
            dressed: &dressed,
            poses,
            flutter: &flutter(&dressed, poses, skeleton, config),
            level: 0,
            metres_per_px: config.export.metres_per_px,
            tolerance_px: KEY_TOLERANCE_PX,
            node_extras: &[],
            provenance: &serde_json::Value::Null,
        };
        match glb(&model) {
            Ok((bytes, _)) => assert!(
                gltf::Gltf::from_slice(&bytes).is_ok(),
                "the file cannot be opened"
            ),
            Err(e) => assert!(!e.to_string().contains('\n'), "{e}"),
        }
    }
}

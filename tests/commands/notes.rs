//! When a film was made, what its user noted and what it is worth: through all files of a capture.

use crate::support::{CLIP, OUTLINE};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// When the clip of the test was filmed, in UTC as video files have it.
const FILMED: &str = "2023-05-03T12:07:12.000+00:00";

fn arborcam(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_arborcam"))
        .args(args)
        .output()
        .expect("arborcam runs")
}

/// What a command that must succeed has written to standard output and error.
fn said(args: &[&str]) -> (String, String) {
    let run = arborcam(args);
    let [out, err] = [&run.stdout, &run.stderr].map(|b| String::from_utf8_lossy(b).into_owned());
    assert!(run.status.success(), "{args:?}: {err}");
    (out, err)
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

fn capture(dir: &Path) -> Value {
    let text = fs::read(dir.join("capture.json")).expect("capture.json");
    serde_json::from_slice(&text).expect("json")
}

/// The notes of a model's file on itself.
fn extras(glb: &Path) -> Value {
    let bytes = fs::read(glb).expect("a model");
    let length = u32::from_le_bytes(bytes[12..16].try_into().expect("four bytes")) as usize;
    let root: Value = serde_json::from_slice(&bytes[20..20 + length]).expect("json");
    root["asset"]["extras"].clone()
}

/// The shipped clip with a date.
fn dated_clip(to: &Path) {
    let run = Command::new("ffmpeg")
        .args(["-v", "error", "-i", CLIP, "-c", "copy", "-metadata"])
        .args(["creation_time=2023-05-03T12:07:12Z", text(to)])
        .output()
        .expect("ffmpeg runs");
    assert!(run.status.success());
}

#[test]
fn date_and_notes_go_from_the_film_into_every_file() {
    let home = tempfile::tempdir().expect("tempdir");
    let at = |name: &str| home.path().join(name);
    let (clip, recording, first, again) = (at("a.mkv"), at("a.mcap"), at("first"), at("again"));
    dated_clip(&clip);
    let fast = ["--fast", "--headless", "--outline", OUTLINE];
    let noted = ["--note", "species=Quercus", "--note", "site=north meadow"];
    let place = ["--record", text(&recording), "--out", text(&first)];
    let all = [&["replay", text(&clip)], &fast[..], &noted, &place].concat();
    let (_, err) = said(&all);
    let told = capture(&first);
    assert_eq!(told["captured_at"], FILMED);
    let notes = json!({"species": "Quercus", "site": "north meadow"});
    assert_eq!(told["notes"], notes);
    let model = extras(&first.join("tree.glb"));
    assert_eq!(
        (&model["captured_at"], &model["notes"]),
        (&json!(FILMED), &notes)
    );
    // The verdict is in the file and in the closing lines, in the same words.
    let reasons = told["verdict"]["reasons"].as_array().expect("reasons");
    let grade = told["verdict"]["grade"].as_str().expect("a grade");
    let line = err.lines().find_map(|l| l.strip_prefix("verdict: "));
    let line = line.expect("a verdict");
    assert!(line.starts_with(grade), "{line}");
    for reason in reasons {
        assert!(line.contains(reason.as_str().expect("text")), "{line}");
    }

    // A recording knows both, whenever it is replayed; what is given anew takes precedence.
    let noted = ["--note", "wind=3bft", "--note", "site=south meadow"];
    let place = ["--out", text(&again)];
    said(&[&["replay", text(&recording)], &fast[..], &noted, &place].concat());
    let told = capture(&again);
    assert_eq!(told["captured_at"], FILMED);
    let notes = json!({"species": "Quercus", "site": "south meadow", "wind": "3bft"});
    assert_eq!(told["notes"], notes);

    // Afterwards, too: the model's file is then what an export writes.
    let (out, _) = said(&["note", text(&again), "species=Tilia", "--remove", "wind"]);
    assert_eq!(out, "site=south meadow\nspecies=Tilia\n");
    let notes = json!({"species": "Tilia", "site": "south meadow"});
    assert_eq!(capture(&again)["notes"], notes);
    assert_eq!(extras(&again.join("tree.glb"))["notes"], notes);
    let glb = at("again.glb");
    said(&[
        "export",
        text(&again),
        "--format",
        "glb",
        "--out",
        text(&glb),
    ]);
    assert!(fs::read(&glb).expect("glb") == fs::read(again.join("tree.glb")).expect("glb"));

    for (format, file, expected) in [
        ("obj", "again.obj", "# species: Tilia\n"),
        ("ply", "again.ply", "comment species: Tilia\n"),
    ] {
        let to = at(file);
        said(&[
            "export",
            text(&again),
            "--format",
            format,
            "--out",
            text(&to),
        ]);
        let bytes = fs::read(&to).expect("a file");
        assert!(
            String::from_utf8_lossy(&bytes).contains(expected),
            "{format}"
        );
    }
    let report = at("report.html");
    let (table, _) = said(&[
        "analyze",
        text(&again),
        "--update",
        "--report",
        text(&report),
    ]);
    assert!(
        table.contains("species: Tilia") && table.contains("verdict: "),
        "{table}"
    );
    let page = fs::read_to_string(&report).expect("a page");
    assert!(page.contains("<dt>species</dt><dd>Tilia</dd>") && page.contains(FILMED));
    assert_eq!(extras(&again.join("tree.glb"))["notes"], notes);
    let (text_json, _) = said(&["analyze", text(&again), "--json"]);
    let told: Value = serde_json::from_str(&text_json).expect("json");
    assert_eq!(told["captures"][0]["user_notes"], notes);
    assert_eq!(told["captures"][0]["captured_at"], FILMED);
}

#[test]
fn what_is_no_note_is_refused_before_anything_is_filmed() {
    let home = tempfile::tempdir().expect("tempdir");
    let out = home.path().join("out");
    let many: Vec<String> = (0..33).map(|k| format!("--note=k{k}=1")).collect();
    let many: Vec<&str> = many.iter().map(String::as_str).collect();
    for (notes, expected) in [
        (&["--note", "species"][..], "give KEY=VALUE"),
        (&["--note", "two words=x"], "is no key"),
        (&["--note", "species="], "is empty"),
        (&["--note", "a=1", "--note", "a=2"], "is given twice"),
        (&many, "more than 32 notes"),
    ] {
        let run = arborcam(&[&["replay", CLIP, "--headless", "--out", text(&out)], notes].concat());
        let err = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(2), "{notes:?}: {err}");
        assert!(err.contains(expected), "{notes:?}: {err}");
        assert!(!out.exists());
    }
    let run = arborcam(&["note", text(home.path()), "a=1"]);
    assert_eq!(run.status.code(), Some(3), "a folder that is no capture");
}

//! `arborcam analyze`: what a user gets from captures, and what bad input gets.

use crate::support::{self, names_in, replayed_by_motion};
use crate::to_folder::records;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::os::fd::FromRawFd;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

const FAILED: i32 = 1;
const BAD_USAGE: i32 = 2;
const NO_INPUT: i32 = 3;
const STOPPED: i32 = 130;

fn analyze(dirs: &[&Path], more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command
        .arg("analyze")
        .args(dirs)
        .args(more)
        .output()
        .expect("arborcam")
}

fn told(dirs: &[&Path], more: &[&str]) -> Value {
    let output = analyze(dirs, &[more, &["--json"]].concat());
    assert!(
        output.status.success(),
        "{more:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("folder");
    for entry in fs::read_dir(from).expect("folder").flatten() {
        fs::copy(entry.path(), to.join(entry.file_name())).expect("copy");
    }
}

/// A copy of the shipped recording's capture under a name.
fn captured(name: &str) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().expect("tempdir");
    let to = dir.path().join(name);
    copy(replayed_by_motion(), &to);
    (dir, to)
}

/// The tables of points: of the tree, and left out of it.
const POINTS: [&str; 2] = ["tracks.csv", "left_out.csv"];

/// Changes the tables of points in `dir` as texts.
fn change_points(dir: &Path, change: impl Fn(&str) -> String) {
    for table in POINTS {
        let text = fs::read_to_string(dir.join(table)).expect(table);
        fs::write(dir.join(table), change(&text)).expect(table);
    }
}

/// Changes the tables of points in `dir` cell by cell.
fn edit_points(dir: &Path, change: impl Fn(&str, &str) -> String) {
    for table in POINTS {
        edit(&dir.join(table), &change);
    }
}

/// Changes a table cell by cell: `change` gets the column's name and the text.
fn edit(file: &Path, change: impl Fn(&str, &str) -> String) {
    let text = fs::read_to_string(file).expect("table");
    let mut lines = text.lines();
    let header = lines.next().expect("header").to_owned();
    let names: Vec<&str> = header.split(',').collect();
    let row = |line: &str| {
        names
            .iter()
            .zip(line.split(','))
            .map(|(n, c)| change(n, c))
            .collect::<Vec<_>>()
            .join(",")
    };
    let rows: Vec<String> = std::iter::once(header.clone())
        .chain(lines.map(row))
        .collect();
    fs::write(file, rows.join("\n") + "\n").expect("table");
}

/// The columns of `nodes.csv` that are not of the sway, as they stand.
fn others(dir: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(dir.join("nodes.csv")).expect("nodes");
    text.lines()
        .map(|l| l.split(',').take(10).map(str::to_owned).collect())
        .collect()
}

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or_else(|| panic!("a number, not {v}"))
}

fn branches(told: &Value) -> &[Value] {
    told["captures"][0]["branches"]
        .as_array()
        .expect("branches")
}

fn answered(told: &Value) -> Vec<&Value> {
    branches(told)
        .iter()
        .filter(|b| b["identifiable"] == true)
        .collect()
}

/// The table that is printed, the JSON and `nodes.csv` say the same, and nothing else of the
/// capture changes.
#[test]
fn the_answers_stand_in_the_table_in_json_and_in_the_capture() {
    let (_dir, dir) = captured("tree");
    edit(&dir.join("nodes.csv"), |name, cell| {
        if name.starts_with("frequency") {
            String::new()
        } else {
            cell.into()
        }
    });
    let (before, files) = (others(&dir), names_in(&dir));
    let told = told(&[&dir], &["--update"]);
    let capture = &told["captures"][0];
    assert_eq!(
        (&capture["name"], &capture["excitation"]),
        (&"tree".into(), &"release".into())
    );
    assert!(
        (number(&capture["rate_hz"]) - 30.0).abs() < 0.1
            && capture["gaps"].as_array().is_some_and(Vec::is_empty)
    );
    assert!(told["comparison"].is_null());
    assert_eq!((others(&dir), names_in(&dir)), (before, files));
    // The trunk of the recording sways at 0.70 Hz; a peak of eleven seconds is broader than the
    // truth's 2 %.
    let known = answered(&told);
    assert!(known.len() >= 3, "{} answers", known.len());
    let trunk = known
        .iter()
        .find(|b| b["parent_id"].is_null())
        .expect("the trunk has an answer");
    assert!(
        (number(&trunk["frequency_hz"]["value"]) / 0.7 - 1.0).abs() < 0.01,
        "{trunk}"
    );
    assert!((number(&trunk["spectrum_peak_hz"]) - 0.7).abs() < 0.1);
    assert!(number(&trunk["half_power_damping"]) > number(&trunk["damping_ratio"]["value"]));
    let dominant = &capture["dominant_peaks"];
    let resolution_hz = number(&dominant["resolution_hz"]);
    assert!((0.05..0.2).contains(&resolution_hz), "{dominant}");
    let of_trunk = &dominant["levels"][0]["peaks"][0]["frequency_hz"];
    assert!((number(of_trunk) - 0.7).abs() < resolution_hz, "{dominant}");
    let common = dominant["common"].as_array().expect("common peaks");
    assert_eq!(common.is_empty(), dominant["why"].is_string(), "{dominant}");
    for branch in branches(&told) {
        let sound = branch["identifiable"] == branch["unidentified"].is_null();
        assert!(
            sound && branch["frequency_hz"].is_null() == branch["why"].is_string(),
            "{branch}"
        );
    }
    let text = fs::read_to_string(dir.join("nodes.csv")).expect("nodes");
    let plain = analyze(&[&dir], &[]);
    let plain = String::from_utf8(plain.stdout).expect("text");
    for branch in known {
        let (id, f) = (
            branch["node_id"].to_string(),
            number(&branch["frequency_hz"]["value"]),
        );
        let row = text
            .lines()
            .find(|l| l.split(',').next() == Some(&id))
            .expect("its row");
        let written: f64 = row
            .split(',')
            .nth(10)
            .expect("cell")
            .parse()
            .expect("number");
        assert!(
            (written - f).abs() < 1e-5 && row.contains(",true,release,"),
            "{row}"
        );
        let line = plain
            .lines()
            .find(|l| l.starts_with("  ") && l.split_whitespace().next() == Some(&id))
            .expect("its line");
        let shown: f64 = line
            .split_whitespace()
            .nth(4)
            .expect("cell")
            .parse()
            .expect("number");
        assert!((shown - f).abs() < 6e-4, "{line} lacks {f}");
        // One amplitude in all, that of the curve in the report; none where points and angle
        // contradict each other.
        let [told, points, angle] = [
            "amplitude_deg",
            "amplitude_by_points_deg",
            "amplitude_in_angle_deg",
        ]
        .map(|key| branch[key].as_f64());
        let agree = points
            .zip(angle)
            .filter(|(p, a)| (p / a).ln().abs() < 1.5_f64.ln());
        assert_eq!(told, agree.map(|(_, angle)| angle), "{branch}");
        let cell = row.split(',').nth(18).expect("cell").parse::<f64>().ok();
        assert!(
            cell.zip(told)
                .map_or(cell == told, |(c, t)| (c - t).abs() < 1e-3),
            "{row} lacks {told:?}"
        );
    }
    // Once more: nothing is left to change. Unasked nothing is changed either.
    analyze(&[&dir], &["--update"]);
    assert_eq!(
        fs::read_to_string(dir.join("nodes.csv")).expect("nodes"),
        text
    );
    analyze(&[&dir], &["--excitation", "wind"]);
    assert_eq!(
        fs::read_to_string(dir.join("nodes.csv")).expect("nodes"),
        text
    );
    analyze(&[&dir], &["--update", "--excitation", "wind"]);
    assert_ne!(
        fs::read_to_string(dir.join("nodes.csv")).expect("nodes"),
        text
    );
}

/// `capture.json` of a capture.
/// The answers of `nodes.csv` but for how far branches sway: an update takes that of their angles.
fn answers(dir: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(dir.join("nodes.csv")).expect("nodes");
    let names: Vec<&str> = text.lines().next().expect("header").split(',').collect();
    let row = |line: &str| {
        let cells = names.iter().zip(line.split(','));
        let kept = cells.filter(|(name, _)| **name != "amplitude_deg");
        kept.map(|(_, cell)| cell.to_owned()).collect()
    };
    text.lines().map(row).collect()
}

/// An analysis of a capture that is as it was written finds what the capture says, to the last digit.
#[test]
fn an_analysis_of_a_capture_finds_what_the_capture_says() {
    let (_dir, dir) = captured("tree");
    let modes = || fs::read_to_string(dir.join("modes.csv")).expect("modes");
    let (said, swings) = (answers(&dir), modes());
    assert!(
        said.iter()
            .filter(|row| row.contains(&"true".into()))
            .count()
            >= 3
    );
    told(&[&dir], &["--update"]);
    assert_eq!(answers(&dir), said);
    assert_eq!(modes(), swings);
}

fn note(dir: &Path) -> Value {
    let text = fs::read(dir.join("capture.json")).expect("capture.json");
    serde_json::from_slice(&text).expect("JSON")
}

/// A capture whose frequencies were not found when it was made is judged by those that are found
/// now; one of which it is not known what it was judged by keeps what it has.
#[test]
fn an_update_judges_anew() {
    let (_dir, dir) = captured("tree");
    let made = note(&dir);
    let mut old = made.clone();
    old["verdict"] = serde_json::json!({
        "grade": "poor", "reasons": ["no frequency identified"], "advice": []
    });
    old["judged_by"]["sway"] = Value::Null;
    let put = |note: &Value| {
        fs::write(dir.join("capture.json"), note.to_string()).expect("capture.json");
    };
    put(&old);
    let unasked = told(&[&dir], &[]);
    assert_eq!(unasked["captures"][0]["verdict"], old["verdict"]);
    assert_eq!(note(&dir), old);
    let updated = told(&[&dir], &["--update"]);
    let renewed = note(&dir);
    assert_eq!(renewed["verdict"], made["verdict"]);
    assert_eq!(updated["captures"][0]["verdict"], made["verdict"]);
    let [found, known] =
        [&renewed, &made].map(|note| number(&note["judged_by"]["sway"]["trunk_hz"]));
    assert!((found / known - 1.0).abs() < 0.01, "{found} Hz, {known} Hz");

    old.as_object_mut().expect("object").remove("judged_by");
    put(&old);
    told(&[&dir], &["--update"]);
    assert_eq!(note(&dir), old);
}

/// A table of points without a second of film from 4 s on, after which the times run on.
fn without_a_second(text: &str) -> String {
    let mut out = String::new();
    for line in text.lines() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        // The header has none.
        if let Ok(time_s) = cells[2].parse::<f64>() {
            if (4.0..5.0).contains(&time_s) {
                continue;
            }
            if time_s >= 5.0 {
                cells[2] = format!("{:.6}", time_s - 1.0);
            }
        }
        out += &(cells.join(",") + "\n");
    }
    out
}

/// Phases do not join across a cut: what is fitted across it is no tree's.
#[test]
fn a_film_that_is_cut_is_analysed_up_to_there_and_the_user_is_warned() {
    let (_dir, dir) = captured("tree");
    change_points(&dir, without_a_second);
    let before_s = number(&note(&dir)["judged_by"]["filmed_s"]);
    let cut = analyze(&[&dir], &["--json", "--update"]);
    let said = String::from_utf8_lossy(&cut.stderr).into_owned();
    assert!(
        cut.status.success()
            && said.contains("the film is cut, or its picture stands still, at 4.0 s"),
        "{said}"
    );
    let found: Value = serde_json::from_slice(&cut.stdout).expect("JSON");
    let capture = &found["captures"][0];
    let ends_s = [&capture["from_s"], &capture["to_s"]].map(number);
    assert!(ends_s[0] > 3.9 || ends_s[1] < 4.1, "{ends_s:?}");
    let note = note(&dir);
    let reasons = note["verdict"]["reasons"].to_string();
    assert!(
        reasons.contains("film cut or stalled at 4.0 s"),
        "{reasons}"
    );
    assert!((number(&note["judged_by"]["cut_at_s"]) - 4.0).abs() < 0.05);
    // The part that is not used does not count as filmed.
    let filmed_s = number(&note["judged_by"]["filmed_s"]);
    assert!(filmed_s < before_s - 3.0, "{filmed_s} of {before_s} s");
    // A part that the user chooses is in one piece; of the film it stays known.
    let part = analyze(&[&dir], &["--to", "3.9", "--update"]);
    let said = String::from_utf8_lossy(&part.stderr).into_owned();
    assert!(part.status.success() && !said.contains("cut"), "{said}");
    assert!(
        self::note(&dir)["verdict"]["reasons"]
            .to_string()
            .contains("film cut")
    );
    assert_eq!(number(&self::note(&dir)["judged_by"]["filmed_s"]), filmed_s);
}

#[test]
fn the_part_of_the_film_and_its_cause_can_be_chosen() {
    let (_dir, dir) = captured("tree");
    let part = told(
        &[&dir],
        &["--from", "2", "--to", "9", "--excitation", "release"],
    );
    let capture = &part["captures"][0];
    assert!(
        (number(&capture["from_s"]) - 2.0).abs() < 0.04
            && (number(&capture["to_s"]) - 9.0).abs() < 0.04
    );
    assert_eq!(
        (&capture["excitation_given"], &capture["from_rest"]),
        (&true.into(), &false.into())
    );
    let short = told(&[&dir], &["--to", "0.6"]);
    assert!(
        branches(&short)
            .iter()
            .all(|b| b["unidentified"] == "too_short"),
        "{}",
        short["captures"][0]
    );
    let text = String::from_utf8(analyze(&[&dir], &["--to", "0.6"]).stdout).expect("text");
    assert!(
        text.contains("none: the film is too short") && text.contains("0.0 to 0.6 s of the film"),
        "{text}"
    );
    // Beyond the end there is no film, and so none that is too long.
    let beyond = analyze(&[&dir], &["--to", "1000"]);
    assert!(
        beyond.status.success() && beyond.stderr.is_empty(),
        "{}",
        String::from_utf8_lossy(&beyond.stderr)
    );
}

#[test]
fn a_known_length_gives_amplitudes_in_metres() {
    let (_dir, dir) = captured("tree");
    let of = |more: &[&str]| {
        let told = told(&[&dir], more);
        let trunk = branches(&told)[0].clone();
        (
            trunk["amplitude_px"].as_f64().expect("px"),
            trunk["amplitude_m"].as_f64(),
        )
    };
    assert_eq!(of(&[]).1, None);
    let (px, m) = of(&["--scale", "10,20:10,120=2m"]);
    assert!((m.expect("metres") - 0.02 * px).abs() < 1e-9);
    assert_eq!(of(&["--metres-per-px", "0.02"]).1, m);
    // A capture that was made with a scale needs none: its tables are in metres.
    let made = dir.with_file_name("in-metres");
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command.args([
        "replay",
        support::CLIP,
        "--fast",
        "--headless",
        "--outline",
        support::OUTLINE,
    ]);
    let settings = dir.with_file_name("motion.toml");
    fs::write(&settings, "[skeleton]\nalong_wood = false\n").expect("settings");
    command.arg("--config").arg(&settings);
    command
        .args(["--scale", "10,20:10,120=2", "--out"])
        .arg(&made);
    assert!(command.output().expect("arborcam").status.success());
    let refused = |more: &[&str]| analyze(&[&dir], more).status.code();
    assert_eq!(refused(&["--metres-per-px", "nan"]), Some(BAD_USAGE));
    assert_eq!(refused(&["--metres-per-px", "1e9"]), Some(BAD_USAGE));
    let own = told(&[&made], &[]);
    let trunk = &branches(&own)[0];
    assert!(
        (number(&trunk["amplitude_m"]) / m.expect("metres") - 1.0).abs() < 0.01,
        "{trunk}"
    );
    assert!((number(&trunk["amplitude_px"]) / px - 1.0).abs() < 0.01);
}

/// The same tree filmed again: other numbers, from twice as far, a little to the side.
fn again(dir: &Path, to: &Path, slower: f64) {
    copy(dir, to);
    let renamed = |id: &str| {
        id.parse::<u32>().map_or_else(
            |_| id.to_owned(),
            |n| if n < 2 { n } else { n + 300 }.to_string(),
        )
    };
    let number = |c: &str| c.parse::<f64>().expect("number");
    let is_id = |name: &str| ["node_id", "parent_id", "copy_of"].contains(&name);
    let time = |c: &str| format!("{:.6}", number(c) * slower);
    edit(&to.join("nodes.csv"), |name, cell| match name {
        name if is_id(name) => renamed(cell),
        "x" | "y" => format!("{:.4}", 0.5 * number(cell)),
        "u_px" | "v_px" => format!("{:.3}", 0.5 * number(cell) + 100.0),
        _ => cell.into(),
    });
    edit(&to.join("motion.csv"), |name, cell| match name {
        "node_id" => renamed(cell),
        "time_s" => time(cell),
        "x" | "y" => format!("{:.4}", 0.5 * number(cell)),
        _ => cell.into(),
    });
    edit_points(to, |name, cell| match name {
        "node_id" => renamed(cell),
        "time_s" => time(cell),
        "u_px" | "v_px" => format!("{:.3}", 0.5 * number(cell) + 100.0),
        _ => cell.into(),
    });
    let mut moved = note(to);
    for px in moved["model"]["foot_px"].as_array_mut().expect("foot") {
        *px = (0.5 * px.as_f64().expect("number") + 100.0).into();
    }
    fs::write(to.join("capture.json"), moved.to_string()).expect("capture.json");
}

#[test]
fn the_same_branch_is_found_again_and_its_frequency_compared() {
    let (_dir, first) = captured("hard");
    let (gentle, slow) = (first.with_file_name("gentle"), first.with_file_name("slow"));
    again(&first, &gentle, 1.0);
    again(&first, &slow, 1.1);
    let told = told(&[&first, &gentle, &slow], &[]);
    let comparison = &told["comparison"];
    assert_eq!(
        (&comparison["same_tree"], &comparison["same_tree_given"]),
        (&true.into(), &false.into())
    );
    let mut compared = 0;
    for row in comparison["branches"].as_array().expect("rows") {
        let id = row["node_id"].as_u64().expect("id");
        let renamed = if id < 2 { id } else { id + 300 };
        let [_, gentle, slow] = [0, 1, 2].map(|k| &row["in"][k]);
        // Two that grow close together may be unclear; none is taken for another.
        for found in [gentle, slow] {
            assert!(
                found["node_id"].is_null() || found["node_id"] == renamed,
                "{row}"
            );
        }
        if let Some(percent) = gentle["frequency_change_percent"]["value"].as_f64() {
            assert!(
                percent.abs() < 1.0 && gentle["frequency_change_percent"]["beyond"] == false,
                "{row}"
            );
        }
        if let Some(percent) = slow["frequency_change_percent"]["value"].as_f64() {
            assert!(
                (percent + 100.0 / 11.0).abs() < 1.0
                    && slow["frequency_change_percent"]["beyond"] == true,
                "{row}"
            );
            compared += 1;
        }
    }
    assert!(compared >= 3, "{compared} frequencies compared");
    for name in ["gentle", "slow"] {
        let share = number(&comparison["found_again"][name]);
        assert!(share > 0.8, "{share} found again in {name}");
    }
    let text = String::from_utf8(analyze(&[&first, &slow], &[]).stdout).expect("text");
    assert!(
        text.contains("Compared with hard as one tree")
            && text.contains("% (-")
            && text.contains(" *"),
        "{text}"
    );
    // Said to be two trees, their trunks alone are compared.
    let two = told_of_two(&first, &slow);
    assert_eq!(
        two["comparison"]["branches"].as_array().map(Vec::len),
        Some(1)
    );
    assert_eq!(
        two["comparison"]["branches"][0]["in"][1]["frequency_change_percent"]["beyond"],
        true
    );
}

fn told_of_two(a: &Path, b: &Path) -> Value {
    told(&[a, b], &["--trees", "different"])
}

/// The table of `--csv`, each row by the names of its columns.
fn tidy(dirs: &[&Path], more: &[&str]) -> Vec<BTreeMap<String, String>> {
    let output = analyze(dirs, &[more, &["--csv"]].concat());
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{more:?}: {error}");
    let mut reader = csv::Reader::from_reader(&output.stdout[..]);
    reader.deserialize().map(|row| row.expect("row")).collect()
}

/// One table for statistics: the same branch has the same number in all captures, wherever its
/// number differs from capture to capture.
#[test]
fn several_captures_are_one_tidy_table() {
    let (_dir, first) = captured("hard, \"first\"");
    let (gentle, slow) = (first.with_file_name("gentle"), first.with_file_name("slow"));
    again(&first, &gentle, 1.0);
    again(&first, &slow, 1.1);
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command.arg("note").arg(&slow);
    let noted = command.args(["site=meadow, \"north\"", "wind=3"]).output();
    assert!(noted.expect("arborcam").status.success());
    let rows = tidy(&[&first, &gentle, &slow], &[]);
    let of = |name: &str| -> Vec<&BTreeMap<String, String>> {
        rows.iter().filter(|row| row["capture"] == name).collect()
    };
    let hard = of("hard, \"first\"");
    assert_eq!(rows.len(), 3 * hard.len());
    let told = told(&[&first], &[]);
    assert_eq!(hard.len(), branches(&told).len());
    for (row, branch) in hard.iter().zip(branches(&told)) {
        assert_eq!(row["node_id"], branch["node_id"].to_string());
        let written = row["frequency_hz"].parse::<f64>().ok();
        let expected = branch["frequency_hz"]["value"].as_f64();
        assert_eq!(written.is_some(), expected.is_some(), "{row:?}");
        assert!(
            written
                .zip(expected)
                .is_none_or(|(w, e)| (w - e).abs() < 1e-5)
        );
        assert_eq!(row["unidentified"].is_empty(), written.is_some(), "{row:?}");
    }
    let by_id: BTreeMap<&str, &str> = hard
        .iter()
        .map(|row| (&*row["tree_branch"], &*row["node_id"]))
        .collect();
    assert_eq!(by_id.len(), hard.len());
    let (mut compared, mut matched) = (0, 0);
    for row in of("gentle").into_iter().chain(of("slow")) {
        let is_slow = row["capture"] == "slow";
        assert_eq!(
            row["note_site"],
            if is_slow { "meadow, \"north\"" } else { "" }
        );
        let Some(first_id) = by_id.get(&*row["tree_branch"]) else {
            assert_eq!(row["matched_by"], "none");
            continue;
        };
        matched += 1;
        assert_ne!(row["matched_by"], "none", "{row:?}");
        let first_id: u32 = first_id.parse().expect("number");
        let renamed = if first_id < 2 {
            first_id
        } else {
            first_id + 300
        };
        assert_eq!(row["node_id"], renamed.to_string());
        if row["matched_by"] == "trunk" {
            assert_eq!((&*row["tree_branch"], &*row["parent_id"]), ("1", ""));
        }
        if let Ok(ratio) = row["frequency_to_first"].parse::<f64>() {
            let expected = if is_slow { 1.0 / 1.1 } else { 1.0 };
            assert!((ratio - expected).abs() < 0.01, "{row:?}");
            compared += 1;
        }
    }
    assert!(
        10 * matched > 8 * 2 * hard.len(),
        "{matched} of {} matched",
        2 * hard.len()
    );
    assert!(compared >= 6, "{compared} frequencies compared");
}

/// One capture is a table, too, and so is one that is given twice.
#[test]
fn a_capture_alone_and_one_given_twice_are_tables() {
    let (_dir, dir) = captured("tree");
    let one = tidy(&[&dir], &[]);
    assert!(one.iter().all(|row| row["frequency_to_first"].is_empty()));
    let ids: BTreeSet<&str> = one.iter().map(|row| &*row["tree_branch"]).collect();
    assert_eq!(ids.len(), one.len());
    let twice = tidy(&[&dir, &dir], &["--trees", "same"]);
    let (a, b) = twice.split_at(one.len());
    assert_eq!((&*a[0]["capture"], &*b[0]["capture"]), ("tree", "tree#2"));
    for (a, b) in a.iter().zip(b) {
        assert_eq!(a["tree_branch"], b["tree_branch"]);
        assert_ne!(b["matched_by"], "none");
        assert!(b["frequency_hz"].is_empty() || b["frequency_to_first"] == "1");
    }
}

/// Every element is closed where it must be, so that a browser shows what was meant.
fn well_formed(html: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = &html[html.find("<html").expect("html")..];
    while let Some(at) = rest.find('<') {
        rest = &rest[at + 1..];
        let end = rest.find('>').expect("a tag that ends");
        let tag = &rest[..end];
        rest = &rest[end..];
        let name = tag
            .trim_start_matches('/')
            .split([' ', '/'])
            .next()
            .expect("name");
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.ends_with('/') && !["meta", "br"].contains(&name) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

/// A row for each branch and frame; the largest amplitude of a branch's spectrum is at its peak in the table.
#[test]
fn angles_and_their_spectra_are_written_as_tables() {
    let (_dir, dir) = captured("tables");
    let [angles, spectra] = ["new/angles.csv", "new/spectra.csv"].map(|name| {
        let path = dir.with_file_name(name);
        path.display().to_string()
    });
    let told = told(&[&dir], &["--angles", &angles, "--spectra", &spectra]);
    let capture = &told["captures"][0];
    let frames = capture["frames"].as_u64().expect("frames");
    let branches = capture["branches"].as_array().expect("branches");
    let rows = records(Path::new(&angles));
    assert_eq!(rows.len() as u64, frames * branches.len() as u64);
    let known = rows.iter().filter(|row| !row["angle_deg"].is_empty());
    assert!(known.count() > rows.len() / 2);
    let mut largest: BTreeMap<String, (f64, f64)> = BTreeMap::new();
    for row in records(Path::new(&spectra)) {
        let [hz, deg] =
            ["frequency_hz", "amplitude_deg"].map(|name| row[name].parse().expect("number"));
        let peak = largest.entry(row["node_id"].clone()).or_insert((hz, deg));
        if deg > peak.1 && hz > 0.3 {
            *peak = (hz, deg);
        }
    }
    let mut with_peak = 0;
    for branch in branches {
        let Some(peak_hz) = branch["spectrum_peak_hz"].as_f64().filter(|hz| *hz > 0.3) else {
            continue;
        };
        let (hz, _) = largest[&branch["node_id"].to_string()];
        assert!((hz - peak_hz).abs() < 0.05, "{hz}, not {peak_hz}");
        with_peak += 1;
    }
    assert!(with_peak > 0);
    let again = analyze(&[&dir], &["--angles", &angles]);
    assert_eq!(again.status.code(), Some(FAILED), "it was overwritten");
}

#[test]
fn the_report_is_one_file_that_needs_nothing_else_and_tells_all() {
    let (_dir, first) = captured("<b>&\"calm");
    let second = first.with_file_name("storm");
    again(&first, &second, 1.1);
    let page = first.with_file_name("new/report.html");
    let shown = page.display().to_string();
    let told = told(
        &[&first, &second],
        &["--report", &shown, "--scale", "0,0:0,100=1"],
    );
    let html = fs::read_to_string(&page).expect("report");
    for forbidden in [
        "<script",
        "http:",
        "https:",
        "url(",
        "@import",
        "<link",
        "<b>&\"calm",
        "NaN",
        "inf ",
    ] {
        assert!(!html.contains(forbidden), "{forbidden} is in the page");
    }
    well_formed(&html);
    assert!(html.contains("&lt;b&gt;&amp;&quot;calm"));
    assert!(!html.contains("src=") && html.matches("href=\"data:image/jpeg;base64,").count() == 2);
    for what in [
        "pulled and let go at",
        "frames/s",
        "no gaps",
        "m in a pixel",
        "What this does not say",
        "How to read this",
        "Dominant peaks across levels",
        "dominant peak common to levels 1 to 3",
    ] {
        assert!(html.contains(what), "the page lacks {what:?}");
    }
    for capture in told["captures"].as_array().expect("captures") {
        for branch in capture["branches"].as_array().expect("branches") {
            let part = format!("Branch {},", branch["node_id"]);
            assert!(html.contains(&part), "the page lacks {part}");
            if let Some(why) = branch["why"].as_str() {
                assert!(html.contains(why), "the page lacks {why:?}");
            }
        }
    }
    // Its bytes are the same every time.
    let again = first.with_file_name("again.html");
    analyze(
        &[&first, &second],
        &[
            "--report",
            &again.display().to_string(),
            "--scale",
            "0,0:0,100=1",
        ],
    );
    assert!(
        fs::read_to_string(&again).expect("report") == html,
        "two runs differ"
    );
}

/// A capture without motion, model and picture.
#[test]
fn what_a_capture_lacks_is_told_and_it_is_analysed_with_the_rest() {
    let (_dir, dir) = captured("old");
    for name in ["motion.csv", "tree.glb", "frame.jpg"] {
        fs::remove_file(dir.join(name)).expect("remove");
    }
    let page = dir.with_file_name("old.html");
    let output = analyze(
        &[&dir],
        &["--update", "--report", &page.display().to_string()],
    );
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    assert!(
        told.contains("lacks motion.csv")
            && told.contains("the picture of the capture is left out"),
        "{told}"
    );
    let printed = String::from_utf8_lossy(&output.stdout);
    let peaks = "dominant peak common to levels 1 to 3: none: there are no poses";
    assert!(printed.contains(peaks), "{printed}");
    let text = fs::read_to_string(dir.join("nodes.csv")).expect("nodes");
    assert!(text.contains(",true,release,"), "{text}");
    assert!(!dir.join("tree.glb").exists());
    well_formed(&fs::read_to_string(page).expect("report"));
}

/// What is done to the text of a table.
type Damage<'a> = &'a dyn Fn(&str) -> String;

/// What is no number, or no film, gives no number that is not supported.
#[test]
fn damaged_tracks_give_reasons_and_no_numbers() {
    let cases: &[(&str, Damage)] = &[
        ("empty", &|text| {
            format!("{}\n", text.lines().next().expect("header"))
        }),
        ("nowhere", &|text| {
            let row = |l: &str| {
                let c: Vec<&str> = l.split(',').collect();
                format!("{},{},{},NaN,inf,{}", c[0], c[1], c[2], c[5])
            };
            let (header, rows) = text.split_once('\n').expect("header");
            format!(
                "{header}\n{}\n",
                rows.lines().map(row).collect::<Vec<_>>().join("\n")
            )
        }),
        ("still", &|text| {
            let row = |l: &str| {
                let c: Vec<&str> = l.split(',').collect();
                format!("{},{},{},{},50,{}", c[0], c[1], c[2], c[0], c[5])
            };
            let (header, rows) = text.split_once('\n').expect("header");
            format!(
                "{header}\n{}\n",
                rows.lines().map(row).collect::<Vec<_>>().join("\n")
            )
        }),
    ];
    for (name, change) in cases {
        let (_dir, dir) = captured(name);
        change_points(&dir, change);
        let page = dir.with_file_name("page.html");
        let told = told(&[&dir], &["--report", &page.display().to_string()]);
        assert!(answered(&told).is_empty(), "{name}: {:?}", answered(&told));
        assert!(
            branches(&told).iter().all(|b| b["why"].is_string()),
            "{name}"
        );
        well_formed(&fs::read_to_string(page).expect("report"));
    }
}

/// Half a table was analysed as a whole film, "no gaps".
#[test]
fn a_table_of_points_that_was_cut_off_between_rows_is_said_to_be() {
    let (_dir, dir) = captured("cut");
    change_points(&dir, |text| {
        let rows: Vec<&str> = text.lines().collect();
        rows[..rows.len() / 2].join("\n") + "\n"
    });
    let told = told(&[&dir], &[]);
    let notes = told["captures"][0]["notes"].to_string();
    assert!(notes.contains("tracks.csv was cut off"), "{notes}");
}

#[test]
fn a_tree_of_one_branch_is_a_tree() {
    let (_dir, dir) = captured("pole");
    let text = fs::read_to_string(dir.join("nodes.csv")).expect("nodes");
    fs::write(
        dir.join("nodes.csv"),
        text.lines().take(3).collect::<Vec<_>>().join("\n") + "\n",
    )
    .expect("nodes");
    edit_points(&dir, |name, cell| {
        if name == "node_id" && !cell.is_empty() {
            "1".into()
        } else {
            cell.into()
        }
    });
    let told = told(
        &[&dir],
        &[
            "--report",
            &dir.with_file_name("pole.html").display().to_string(),
        ],
    );
    assert_eq!(branches(&told).len(), 1);
}

/// One branch that stands where the other's trunk does says nothing of whether the two are one
/// tree.
#[test]
fn captures_that_may_be_of_one_tree_or_of_two_are_not_compared_by_a_guess() {
    let (_dir, first) = captured("tree");
    let other = first.with_file_name("other");
    copy(&first, &other);
    let text = fs::read_to_string(other.join("nodes.csv")).expect("nodes");
    fs::write(
        other.join("nodes.csv"),
        text.lines().take(3).collect::<Vec<_>>().join("\n") + "\n",
    )
    .expect("nodes");
    let pole = |name: &str, cell: &str| {
        if name == "node_id" && !cell.is_empty() {
            "1".into()
        } else {
            cell.into()
        }
    };
    edit_points(&other, pole);
    fs::remove_file(other.join("motion.csv")).expect("remove");
    let page = first.with_file_name("page.html");
    let output = analyze(
        &[&first, &other],
        &["--report", &page.display().to_string()],
    );
    let (text, error) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert!(
        output.status.success() && error.contains("--trees same or different"),
        "{error}"
    );
    assert!(
        text.contains("Not compared with tree") && !text.contains("frequency against"),
        "{text}"
    );
    let rows = tidy(&[&first, &other], &[]);
    let matched = rows.iter().filter(|row| row["matched_by"] != "none");
    assert_eq!(matched.count(), 2, "the trunks alone");
    let html = fs::read_to_string(page).expect("report");
    assert!(html.contains("Not compared with tree") && !html.contains("called there"));
    well_formed(&html);
    let told = told(&[&first, &other], &[]);
    assert!(
        told["comparison"]["same_tree"].is_null(),
        "{}",
        told["comparison"]
    );
    assert!(
        told["comparison"]["branches"]
            .as_array()
            .is_some_and(Vec::is_empty)
    );
    // Who knows says so.
    assert_eq!(
        told_of_two(&first, &other)["comparison"]["branches"]
            .as_array()
            .map(Vec::len),
        Some(1)
    );
}

/// The answers stand in the model too, which is the one that `export` makes.
#[test]
fn the_model_in_the_capture_is_made_anew_with_the_answers() {
    let (_dir, dir) = captured("tree");
    edit(&dir.join("nodes.csv"), |name, cell| match (name, cell) {
        ("frequency_hz" | "frequency_lo_hz" | "frequency_hi_hz", c) if !c.is_empty() => {
            "1.5".into()
        }
        _ => cell.into(),
    });
    let all = |dir: &Path| -> Vec<(String, Vec<u8>)> {
        let read = |name: String| (name.clone(), fs::read(dir.join(name)).expect("file"));
        names_in(dir).into_iter().map(read).collect()
    };
    // Unasked nothing is written into it.
    let before = all(&dir);
    assert!(analyze(&[&dir], &[]).status.success());
    assert!(before == all(&dir), "something in the capture has changed");
    let output = analyze(&[&dir], &["--update"]);
    assert!(
        output.status.success() && output.stderr.is_empty(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let after = all(&dir);
    let changed: Vec<&str> = before
        .iter()
        .zip(&after)
        .filter(|(a, b)| a != b)
        .map(|(a, _)| a.0.as_str())
        .collect();
    assert_eq!(before.len(), after.len());
    let may_change = ["capture.json", "modes.csv", "nodes.csv", "tree.glb"];
    assert!(
        changed.contains(&"nodes.csv") && changed.iter().all(|name| may_change.contains(name)),
        "{changed:?}"
    );
    analyze(&[&dir], &["--update", "--excitation", "wind"]);
    let model = fs::read(dir.join("tree.glb")).expect("model");
    assert!(
        Some(&("tree.glb".to_owned(), model.clone())) != after.iter().find(|f| f.0 == "tree.glb")
    );
    let made = Command::new(env!("CARGO_BIN_EXE_arborcam"))
        .arg("export")
        .arg(&dir)
        .args(["--format", "glb", "--out", "-"])
        .output()
        .expect("arborcam");
    assert!(made.stdout == model, "the model is not that of `export`");
}

/// The modes of the tree are the same in the JSON, in the table of the capture and in its model; a
/// branch without a frequency of its own says with which of them it moves.
#[test]
fn the_modes_stand_in_the_answers_in_the_capture_and_in_its_model() {
    let (_dir, dir) = captured("tree");
    // Older captures have none.
    fs::remove_file(dir.join("modes.csv")).expect("remove");
    let page = dir.with_file_name("modes.html");
    let shown = page.display().to_string();
    let told = told(&[&dir], &["--update", "--report", &shown]);
    let capture = &told["captures"][0];
    let modes = capture["modes"].as_array().expect("modes");
    let table = fs::read_to_string(dir.join("modes.csv")).expect("table");
    let rows: Vec<Vec<&str>> = table
        .lines()
        .skip(1)
        .map(|row| row.split(',').collect())
        .collect();
    assert_eq!(modes.len(), rows.len());
    assert!(modes.len() >= 3, "{modes:?}");
    for (mode, row) in modes.iter().zip(&rows) {
        assert_eq!(mode["mode"].to_string(), row[0]);
        assert_eq!(mode["frequency_hz"].as_f64(), row[1].parse().ok());
        assert_eq!(mode["n_points"].to_string(), row[10]);
        assert_eq!(mode["branch"].as_str().unwrap_or_default(), row[12]);
    }
    let model = gltf::Gltf::open(dir.join("tree.glb")).expect("model");
    let json = model.document.into_json();
    let asset: Value =
        serde_json::from_str(json.asset.extras.expect("extras").get()).expect("json");
    assert_eq!(&asset["modes"], &capture["modes"]);

    let html = fs::read_to_string(page).expect("report");
    let text = String::from_utf8(analyze(&[&dir], &[]).stdout).expect("text");
    assert!(html.contains("Modes of the whole tree") && text.contains("modes of the whole tree"));
    let mut explained = 0;
    for branch in branches(&told) {
        let moves_with = branch["participation"].as_array().expect("participation");
        let shares = moves_with.iter().map(|p| number(&p["share"]));
        assert!(shares.sum::<f64>() <= 1.001, "{branch}");
        for one in moves_with {
            let mode = &modes[one["mode"].as_u64().expect("number") as usize - 1];
            assert_eq!(one["frequency_hz"], mode["frequency_hz"], "{branch}");
            assert_eq!(one["branch"], mode["branch"], "{branch}");
        }
        let why = branch["why"].as_str().unwrap_or_default();
        if let (Some(most), false) = (moves_with.first(), why.is_empty()) {
            let hz = format!("({:.2} Hz)", number(&most["frequency_hz"]));
            assert!(why.contains("moves with") && why.contains(&hz), "{branch}");
            assert!(html.contains(why) && text.contains(why), "{why}");
            explained += 1;
        }
    }
    assert!(explained > 0, "{told}");
}

/// A capture from somebody else may hold links to files of the user: none of them is written
/// through, whatever it is called.
#[test]
fn links_in_a_foreign_capture_lead_nowhere() {
    let (_dir, dir) = captured("tree");
    let mine = dir.with_file_name("mine");
    fs::write(&mine, "mine").expect("write");
    fs::set_permissions(&mine, fs::Permissions::from_mode(0o600)).expect("mode");
    let to_mine = |at: &Path| std::os::unix::fs::symlink(&mine, at).expect("link");
    // The name of the file that is made meanwhile must not be known beforehand: here the traps are
    // set for the process that the shell becomes.
    let mut command = Command::new("sh");
    command.args([
        "-c",
        "for name in nodes.csv tree.glb; do ln -s \"$2\" \"$1/.$name.partial-$$\"; done; exec \"$0\" analyze \"$1\" --update",
    ]);
    let moved = dir.with_file_name("nodes.csv");
    fs::rename(dir.join("nodes.csv"), &moved).expect("move");
    std::os::unix::fs::symlink(&moved, dir.join("nodes.csv")).expect("link");
    fs::remove_file(dir.join("tree.glb")).expect("remove");
    to_mine(&dir.join("tree.glb"));
    edit(&moved, |name, cell| {
        if name.starts_with("frequency") {
            String::new()
        } else {
            cell.into()
        }
    });
    let table = fs::read(&moved).expect("nodes");
    let output = command
        .arg(env!("CARGO_BIN_EXE_arborcam"))
        .arg(&dir)
        .arg(&mine)
        .output()
        .expect("sh");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert_eq!(fs::read_to_string(&mine).expect("mine"), "mine");
    let mode = fs::metadata(&mine).expect("mine").permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
    // What the link led to is as it was, and a file stands in the place of the link.
    assert!(fs::read(&moved).expect("nodes") == table);
    for name in ["nodes.csv", "tree.glb"] {
        let kind = fs::symlink_metadata(dir.join(name))
            .expect(name)
            .file_type();
        assert!(kind.is_file(), "{name} is {kind:?}");
    }
    assert!(
        fs::read_to_string(dir.join("nodes.csv"))
            .expect("nodes")
            .contains(",true,release,")
    );
}

/// A film in which the tree was let go twice: the answers are of one release at most, and the user
/// is told.
#[test]
fn several_releases_in_one_film_are_told_of() {
    let (_dir, dir) = captured("twice");
    // Pulled again while the camera looks away.
    prolong(&dir, 2, 14.0);
    lasts(&dir, 25);
    let told = told(&[&dir], &[]);
    let notes = told["captures"][0]["notes"].to_string();
    assert!(
        notes.contains("let go 2 times, at 0.")
            && notes.contains(", 14.")
            && notes.contains("--from and --to"),
        "{notes}"
    );
    let one = analyze(&[&dir], &["--from", "0", "--to", "10.9"]);
    assert!(
        one.stderr.is_empty(),
        "{}",
        String::from_utf8_lossy(&one.stderr)
    );
}

/// A terminal of so many columns, and what it shows of the table.
fn on_a_terminal(dir: &Path, columns: u16) -> String {
    let (mut ours, mut theirs) = (0, 0);
    let size = libc::winsize {
        ws_row: 24,
        ws_col: columns,
        ws_xpixel: 0,
        ws_ypixel: 0,
    };
    let null = std::ptr::null_mut();
    // SAFETY: the pointers are of variables that live on, or null, which is allowed for name and
    // settings.
    assert_eq!(
        unsafe { libc::openpty(&mut ours, &mut theirs, null, null.cast(), &size) },
        0
    );
    // SAFETY: both are open and nobody else's.
    let (mut ours, theirs) =
        unsafe { (fs::File::from_raw_fd(ours), fs::File::from_raw_fd(theirs)) };
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command
        .arg("analyze")
        .arg(dir)
        .stdout(theirs)
        .stderr(Stdio::null());
    // In a session of its own, so that the terminal of whoever runs the tests is not asked.
    // SAFETY: it takes nothing and touches no memory.
    let alone = || {
        if unsafe { libc::setsid() } < 0 {
            Err(std::io::Error::last_os_error())
        } else {
            Ok(())
        }
    };
    // SAFETY: setsid may be called between fork and exec.
    unsafe { command.pre_exec(alone) };
    let mut child = command.spawn().expect("arborcam");
    drop(command);
    let (mut all, mut buffer) = (Vec::new(), [0; 4096]);
    // An error is the end of a terminal.
    while let Ok(n @ 1..) = ours.read(&mut buffer) {
        all.extend_from_slice(&buffer[..n]);
    }
    assert!(child.wait().expect("status").success());
    String::from_utf8_lossy(&all).replace('\r', "")
}

#[test]
fn on_a_narrow_terminal_no_line_is_wider_and_elsewhere_the_table_is_whole() {
    let (_dir, dir) = captured("tree");
    let whole = String::from_utf8(analyze(&[&dir], &[]).stdout).expect("text");
    assert!(
        whole.lines().any(|line| line.ends_with("peak, Hz  eq. 6")),
        "{whole}"
    );
    assert_eq!(on_a_terminal(&dir, 200), whole);
    let narrow = on_a_terminal(&dir, 80);
    assert!(
        narrow.lines().all(|line| line.chars().count() <= 80),
        "{narrow}"
    );
    assert!(
        narrow.contains("frequency, Hz")
            && narrow.contains("sway, deg")
            && !narrow.contains("peak, Hz  "),
        "{narrow}"
    );
    assert!(
        narrow.contains("for want of room without: peak, Hz; eq. 6"),
        "{narrow}"
    );
}

#[test]
fn bad_input_gets_a_line_and_the_right_status() {
    let (_dir, dir) = captured("tree");
    let at = |name: &str| dir.with_file_name(name);
    let variant = |name: &str, change: &dyn Fn(&Path)| {
        copy(&dir, &at(name));
        change(&at(name));
        at(name)
    };
    fs::create_dir(at("empty")).expect("folder");
    let no_tracks = variant("no-tracks", &|d| {
        fs::remove_file(d.join("tracks.csv")).expect("remove")
    });
    let bad_time = variant("bad-time", &|d| {
        edit(&d.join("tracks.csv"), |n, c| {
            if n == "time_s" {
                "soon".into()
            } else {
                c.into()
            }
        })
    });
    let cyclic = variant("cyclic", &|d| {
        edit(&d.join("nodes.csv"), |n, c| {
            if n == "parent_id" && c == "1" {
                "9999".into()
            } else {
                c.into()
            }
        })
    });
    // In any other order every row would be a frame of its own: rows times points of memory.
    let reordered = |name: &str, order: &dyn Fn(&mut Vec<&str>)| {
        variant(name, &|d| {
            let text = fs::read_to_string(d.join("tracks.csv")).expect("tracks");
            let mut rows: Vec<&str> = text.lines().collect();
            let header = rows.remove(0);
            order(&mut rows);
            fs::write(
                d.join("tracks.csv"),
                format!("{header}\n{}\n", rows.join("\n")),
            )
            .expect("tracks");
        })
    };
    let backwards = reordered("backwards", &|rows| rows.reverse());
    let by_point = reordered("by-point", &|rows| {
        rows.sort_by_key(|r| r.split(',').next().map(str::len))
    });
    let taken = at("taken.html");
    fs::write(&taken, "mine").expect("file");
    let taken = taken.display().to_string();
    let settings = at("bad.toml");
    fs::write(&settings, "[dynamics]\nwindow_s = -1\n").expect("file");
    let settings = settings.display().to_string();
    let (absent, empty) = (at("absent"), at("empty"));
    let cases: Vec<(Vec<&Path>, Vec<&str>, i32, &str)> = vec![
        (vec![], vec![], BAD_USAGE, "<DIR>"),
        (vec![&absent], vec![], NO_INPUT, "is not there"),
        (vec![&empty], vec![], NO_INPUT, "is no capture"),
        (vec![&dir, &absent], vec![], NO_INPUT, "absent is not there"),
        (vec![&no_tracks], vec![], NO_INPUT, "lacks tracks.csv"),
        (
            vec![&bad_time],
            vec![],
            NO_INPUT,
            "line 2: time_s is \"soon\"",
        ),
        (vec![&cyclic], vec![], NO_INPUT, "9999"),
        (
            vec![&backwards],
            vec![],
            NO_INPUT,
            "rows of one frame stand together, in order of time",
        ),
        (
            vec![&by_point],
            vec![],
            NO_INPUT,
            "rows of one frame stand together, in order of time",
        ),
        (vec![&dir, &dir], vec![], BAD_USAGE, "is given twice"),
        (
            vec![&dir],
            vec!["--csv", "--json"],
            BAD_USAGE,
            "cannot be used with",
        ),
        (
            vec![&dir, &empty],
            vec!["--csv"],
            NO_INPUT,
            "empty is no capture",
        ),
        (
            vec![&dir],
            vec!["--from", "5", "--to", "5"],
            BAD_USAGE,
            "--from 5 is not before --to 5",
        ),
        (
            vec![&dir],
            vec!["--from", "3600"],
            BAD_USAGE,
            "--from 3600 is after the end of",
        ),
        (
            vec![&dir],
            vec!["--from", "3600", "--to", "3700"],
            BAD_USAGE,
            "--from 3600 is after the end of",
        ),
        (
            vec![&dir],
            vec!["--from", "-1"],
            BAD_USAGE,
            "give a number of seconds",
        ),
        (
            vec![&dir],
            vec!["--from", "nan"],
            BAD_USAGE,
            "give a number of seconds",
        ),
        (
            vec![&dir],
            vec!["--scale", "1,1:1,1=2"],
            BAD_USAGE,
            "at least a pixel apart",
        ),
        (
            vec![&dir],
            vec!["--scale", "10,10:5000,1=2"],
            BAD_USAGE,
            "5000,1 lies off the picture",
        ),
        (
            vec![&dir],
            vec!["--scale", "1,1:9,1=2", "--metres-per-px", "1"],
            BAD_USAGE,
            "cannot be used with",
        ),
        (
            vec![&dir],
            vec!["--report", &taken],
            FAILED,
            "exists already",
        ),
        (
            vec![&dir],
            vec!["--config", &settings],
            BAD_USAGE,
            "dynamics.window_s",
        ),
        (
            vec![&dir],
            vec!["--excitation", "storm"],
            BAD_USAGE,
            "storm",
        ),
    ];
    let before = fs::read(dir.join("nodes.csv")).expect("nodes");
    for (dirs, more, status, words) in cases {
        let output = analyze(&dirs, &more);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(
            output.status.code(),
            Some(status),
            "{dirs:?} {more:?}: {error}"
        );
        assert!(
            error.contains(words) && error.starts_with("arborcam: "),
            "{dirs:?} {more:?}: {error}"
        );
        assert!(
            output.stdout.is_empty(),
            "{dirs:?} {more:?} printed something"
        );
    }
    assert_eq!(fs::read(dir.join("nodes.csv")).expect("nodes"), before);
}

/// The table is there for who cannot write, or has no room; the capture is then as it was.
#[test]
fn where_nothing_can_be_written_the_table_is_printed_all_the_same() {
    let (_dir, dir) = captured("tree");
    edit(&dir.join("nodes.csv"), |name, cell| {
        if name.starts_with("frequency") {
            String::new()
        } else {
            cell.into()
        }
    });
    let old = fs::read_to_string(dir.join("nodes.csv")).expect("nodes");
    let before = names_in(&dir);
    // No file may grow: as on a full disk, also for root.
    let mut command = Command::new("sh");
    command.args([
        "-c",
        "trap '' XFSZ; ulimit -f 0; exec \"$0\" analyze \"$1\" --update",
    ]);
    let output = command
        .arg(env!("CARGO_BIN_EXE_arborcam"))
        .arg(&dir)
        .output()
        .expect("sh");
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(FAILED), "{error}");
    let last = error.lines().last().expect("a line");
    assert!(
        last.starts_with("arborcam: cannot write") && last.contains("nodes.csv"),
        "{error}"
    );
    assert!(String::from_utf8_lossy(&output.stdout).contains("frequency, Hz"));
    assert_eq!(
        fs::read_to_string(dir.join("nodes.csv")).expect("nodes"),
        old
    );
    assert_eq!(names_in(&dir), before);
}

/// The film again and again: its analysis takes a while.
fn prolong(dir: &Path, times: u32, every_s: f64) {
    change_points(dir, |text| {
        let (header, rows) = text.split_once('\n').expect("header");
        let lap = |k: u32| {
            let row = move |line: &str| {
                let cells: Vec<&str> = line.split(',').collect();
                let time_s = cells[2].parse::<f64>().expect("time") + every_s * f64::from(k);
                format!(
                    "{},{},{time_s:.6},{}\n",
                    cells[0],
                    cells[1],
                    cells[3..].join(",")
                )
            };
            rows.lines().map(row).collect::<String>()
        };
        let all: String = (0..times).map(lap).collect();
        format!("{header}\n{all}")
    });
}

fn lasts(dir: &Path, seconds: u32) {
    let note = dir.join("capture.json");
    let mut told: Value = serde_json::from_slice(&fs::read(&note).expect("note")).expect("JSON");
    told["timing"]["duration_s"] = seconds.into();
    fs::write(&note, told.to_string()).expect("note");
}

/// Points do not live for ever: of the whole of a long film there are few that last, and good
/// answers would go.
#[test]
fn of_a_long_film_the_end_is_looked_at_as_the_capture_did() {
    let (_dir, dir) = captured("long");
    // Half a second is missing between two laps: a gap is no cut.
    prolong(&dir, 7, 11.5);
    lasts(&dir, 80);
    let part = |more: &[&str]| {
        let told = told(&[&dir], &[&["--excitation", "release"], more].concat());
        let capture = &told["captures"][0];
        let noted = capture["notes"]
            .to_string()
            .contains("of 80 s of film the last 60 (dynamics.window_s)");
        (
            [number(&capture["from_s"]), number(&capture["to_s"])].map(f64::round),
            noted,
        )
    };
    assert_eq!(part(&[]), ([20.0, 80.0], true));
    assert_eq!(part(&["--from", "0"]), ([0.0, 80.0], false));
    assert_eq!(part(&["--to", "66"]), ([0.0, 66.0], false));
    let settings = dir.with_file_name("window.toml");
    fs::write(&settings, "[dynamics]\nwindow_s = 300\n").expect("file");
    assert_eq!(
        part(&["--config", &settings.display().to_string()]),
        ([0.0, 80.0], false)
    );
    let output = analyze(&[&dir], &["--excitation", "release"]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains(" to 80.0 s of the film"), "{text}");
}

#[test]
fn whoever_stops_it_finds_everything_as_it_was() {
    let (_dir, dir) = captured("tree");
    prolong(&dir, 8, 11.0);
    // Told before the work begins: the sign to stop it.
    lasts(&dir, 900);
    let (before, page) = (
        fs::read(dir.join("nodes.csv")).expect("nodes"),
        dir.with_file_name("page.html"),
    );
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command
        .arg("analyze")
        .arg(&dir)
        .arg("--report")
        .arg(&page)
        .args(["--update", "--excitation", "wind", "--from", "0"]);
    let mut child = command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("arborcam");
    let mut line = String::new();
    BufReader::new(child.stderr.take().expect("pipe"))
        .read_line(&mut line)
        .expect("line");
    assert!(line.contains("longer than 600 s"), "{line}");
    // SAFETY: the child is ours and not yet waited for.
    unsafe { libc::kill(child.id() as i32, libc::SIGINT) };
    let status = child.wait().expect("status");
    assert_eq!((status.code(), status.signal()), (Some(STOPPED), None));
    assert_eq!(fs::read(dir.join("nodes.csv")).expect("nodes"), before);
    assert_eq!(names_in(dir.parent().expect("folder")), ["tree"]);
    assert!(names_in(&dir).iter().all(|n| !n.contains("partial")));
}

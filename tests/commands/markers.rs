//! `replay --markers` and `analyze --markers`: coloured markers on branches, and what bad ones get.

use image::{Rgb, RgbImage};
use nalgebra::{Point2, distance};
use std::f64::consts::TAU;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

const FAILED: i32 = 1;
const BAD_USAGE: i32 = 2;
const WIDTH: u32 = 320;
const HEIGHT: u32 = 240;
const FRAMES: usize = 180;
const RATE_HZ: f64 = 30.0;
const FOOT: [f64; 2] = [160.0, 230.0];
/// Natural frequencies of the trunk and of the branch on it, Hz.
const TRUNK_HZ: f64 = 1.0;
const BRANCH_HZ: f64 = 2.3;
const DAMPING: f64 = 0.03;
const RED: [f64; 3] = [205.0, 30.0, 38.0];

/// Where the markers are in frame `k`: on the trunk's top and on a branch that it carries, px.
fn markers_px(k: usize) -> [[f64; 2]; 2] {
    let time_s = k as f64 / RATE_HZ;
    let trunk = 0.06 * decay(TRUNK_HZ, time_s);
    let branch = 0.10 * decay(BRANCH_HZ, time_s);
    let top = [FOOT[0] + 120.0 * trunk.sin(), FOOT[1] - 120.0 * trunk.cos()];
    let turn = trunk + branch + 0.6;
    [
        top,
        [top[0] + 70.0 * turn.sin(), top[1] - 70.0 * turn.cos()],
    ]
}

/// A sway of this natural frequency, released at 0 s.
fn decay(natural_hz: f64, time_s: f64) -> f64 {
    let rate = TAU * natural_hz;
    let phase = rate * (1.0 - DAMPING * DAMPING).sqrt() * time_s;
    (-DAMPING * rate * time_s).exp() * phase.cos()
}

/// Two discs of one colour before a grey wall.
fn frame(k: usize, colour: [f64; 3]) -> RgbImage {
    let discs = markers_px(k).map(Point2::from);
    RgbImage::from_fn(WIDTH, HEIGHT, |u, v| {
        let here = Point2::new(f64::from(u), f64::from(v));
        let nearest = discs
            .iter()
            .map(|d| distance(d, &here))
            .fold(f64::INFINITY, f64::min);
        let share = (5.5 - nearest).clamp(0.0, 1.0);
        let wall = 110.0 + f64::from((u / 8 * 7 + v / 8 * 5) % 9) * 3.0;
        Rgb(colour.map(|c| (share * c + (1.0 - share) * wall) as u8))
    })
}

/// A folder with a film as pictures, an outline and a file of markers.
struct Scene {
    dir: tempfile::TempDir,
}

impl Scene {
    fn new(frames: usize, colour: [f64; 3]) -> Self {
        let scene = Self {
            dir: tempfile::tempdir().expect("tempdir"),
        };
        fs::create_dir(scene.path("film")).expect("folder");
        for k in 0..frames {
            let name = format!("film/{k:04}.png");
            frame(k, colour).save(scene.path(&name)).expect("png");
        }
        let corners = [
            [60, 20],
            [300, 20],
            [300, 150],
            [170, 238],
            [150, 238],
            [60, 150],
        ];
        scene.write(
            "outline.json",
            &format!(
                r#"{{"frame": 0, "width": {WIDTH}, "height": {HEIGHT}, "polygon_px": {corners:?}}}"#
            ),
        );
        let [a, b] = markers_px(0);
        scene.markers(&format!(
            "{}, {}",
            window("A", a, ""),
            window("B", b, r#", "parent": "A""#)
        ));
        scene
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("write");
    }

    fn markers(&self, list: &str) {
        let text = format!(r#"{{"width": {WIDTH}, "height": {HEIGHT}, "markers": [{list}]}}"#);
        self.write("markers.json", &text);
    }

    fn run(&self, arguments: &str) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
        command.current_dir(self.dir.path());
        command
            .args(arguments.split_whitespace())
            .output()
            .expect("arborcam")
    }

    /// Replays the film with these markers, without a screen.
    fn replay(&self, markers: &str, out: &str) -> Output {
        self.run(&format!(
            "replay film --fast --headless --outline outline.json --markers {markers} --out {out}"
        ))
    }

    fn refused(&self, status: i32, expected: &str) {
        let output = self.replay("markers.json", "refused");
        let said = said(&output);
        assert_eq!(output.status.code(), Some(status), "{said}");
        assert!(!self.path("refused").exists(), "{said}");
        assert!(said.contains(expected), "{said:?} lacks {expected:?}");
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
    }
}

fn window(name: &str, middle: [f64; 2], more: &str) -> String {
    let [u, v] = middle.map(|x| x.round() - 9.0);
    format!(r#"{{"name": "{name}", "window_px": [{u}, {v}, 18, 18]{more}}}"#)
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The branches that `analyze` finds in a capture.
fn branches(scene: &Scene, arguments: &str) -> Vec<serde_json::Value> {
    listed(scene, arguments, "branches")
}

/// A list of what `analyze` finds in a capture.
fn listed(scene: &Scene, arguments: &str, what: &str) -> Vec<serde_json::Value> {
    let output = scene.run(&format!("analyze {arguments} --json"));
    assert!(output.status.success(), "{}", said(&output));
    let all: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    all["captures"][0][what].as_array().expect("a list").clone()
}

#[test]
fn two_markers_tell_the_frequencies_of_two_branches() {
    let scene = Scene::new(FRAMES, RED);
    // So few points make no tree; the markers are there all the same.
    let output = scene.replay("markers.json", "out");
    assert_eq!(output.status.code(), Some(FAILED), "{}", said(&output));
    let tracks = fs::read_to_string(scene.path("out/tracks.csv")).expect("tracks");
    for (k, truth) in (0..FRAMES).map(|k| (k, markers_px(k))) {
        for (id, truth) in (1_000_000_000_u32..).zip(truth) {
            let row = tracks
                .lines()
                .find(|l| l.starts_with(&format!("{id},{k},")));
            let cells: Vec<&str> = row.expect("a row").split(',').collect();
            let at = Point2::new(cells[3].parse().expect("u"), cells[4].parse().expect("v"));
            assert!(
                distance(&at, &truth.into()) < 0.3,
                "marker {id}, frame {k}: {at}, {truth:?}"
            );
        }
    }
    let note = fs::read_to_string(scene.path("out/capture.json")).expect("note");
    let note: serde_json::Value = serde_json::from_str(&note).expect("JSON");
    let [total, alive] =
        ["tracks_total", "tracks_alive_end"].map(|k| note["quality"][k].as_u64().expect("a count"));
    assert!(
        2 <= alive && alive <= total,
        "{alive} of {total} points, markers among them"
    );
    let found = branches(&scene, "out --markers");
    let named: Vec<&str> = found.iter().filter_map(|b| b["branch"].as_str()).collect();
    assert_eq!(named, ["A", "B"]);
    assert_eq!(found[1]["parent_id"], found[0]["node_id"]);
    // Modes are called as the markers are, not as limbs.
    let modes = listed(&scene, "out --markers", "modes");
    let of_modes: Vec<&str> = modes.iter().filter_map(|m| m["branch"].as_str()).collect();
    assert_eq!(of_modes, ["A", "B"]);
    for limb in modes
        .iter()
        .flat_map(|m| m["energy"].as_array().expect("energy"))
    {
        let limb = limb["limb"].as_str().expect("a name");
        assert!(["A", "B"].contains(&limb), "{limb}");
    }
    for (branch, hz) in found.iter().zip([TRUNK_HZ, BRANCH_HZ]) {
        let peak = branch["spectrum_peak_hz"].as_f64().expect("a peak");
        assert!((peak - hz).abs() < 0.05, "{peak} for {hz}");
        // One marker is enough: it was bound to its branch by hand.
        let frequency = &branch["frequency_hz"];
        let [lo, value, hi] =
            ["lo", "value", "hi"].map(|k| frequency[k].as_f64().expect("a number"));
        assert!((value / hz - 1.0).abs() < 0.01, "{value} for {hz}");
        assert!(
            lo < value && value < hi && hi - lo < 0.1 * hz,
            "{frequency}"
        );
    }
    let [a, b] = markers_px(0);
    // What stands on the branch by a file, and moves with the trunk alone, has nothing but its peak.
    scene.markers(&format!(
        "{}, {}",
        window("A", a, r#", "parent": "B""#),
        window("B", b, "")
    ));
    let output = scene.run("analyze out --markers=markers.json");
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(table.matches("; peak ").count(), 1, "{table}");
    // By a file that says that both stand on the foot.
    scene.markers(&format!("{}, {}", window("A", a, ""), window("B", b, "")));
    let found = branches(&scene, "out --markers=markers.json");
    assert!(found.iter().all(|b| b["parent_id"].is_null()), "{found:?}");
    // One that the file does not name is left out.
    scene.markers(&window("A", a, ""));
    let found = branches(&scene, "out --markers=markers.json");
    assert_eq!(found.len(), 1, "{found:?}");
    scene.markers(&window("C", a, ""));
    let output = scene.run("analyze out --markers=markers.json");
    assert!(
        said(&output).contains("has no marker C"),
        "{}",
        said(&output)
    );
}

/// The table of branches by forces: two films whose markers are named in another order.
#[test]
fn markers_of_two_films_are_matched_by_their_names() {
    let scene = Scene::new(FRAMES, RED);
    scene.replay("markers.json", "small");
    let [a, b] = markers_px(0);
    let carried = window("B", b, r#", "parent": "A""#);
    scene.markers(&format!("{carried}, {}", window("A", a, "")));
    scene.replay("markers.json", "large");
    let output = scene.run("analyze small large --markers --json");
    assert!(output.status.success(), "{}", said(&output));
    let all: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let comparison = &all["comparison"];
    assert_eq!(comparison["same_tree"], true, "{comparison}");
    for row in comparison["branches"].as_array().expect("branches") {
        assert_eq!(row["in"][1]["matched_by"], "name", "{row}");
        let names = [0, 1].map(|k| {
            let found = all["captures"][k]["branches"].as_array().expect("branches");
            let node = &row["in"][k]["node_id"];
            let branch = found.iter().find(|b| b["node_id"] == *node);
            branch.expect("a branch")["branch"].clone()
        });
        assert_eq!(names[0], names[1], "{row}");
    }
}

/// AprilTag 36h11, number 7: its 6 x 6 bits and the black rim.
const TAG: [&str; 8] = [
    "########", "###.#.##", "#...####", "##...#.#", "###.#.##", "##..####", "###.####", "########",
];
/// Where its black square begins, and the side of a bit, px.
const TAG_PX: [u32; 2] = [14, 150];
const BIT_PX: u32 = 6;

/// Hangs the tag before the wall, with its white rim.
fn hang_tag(picture: &mut RgbImage) {
    let side = BIT_PX * TAG.len() as u32;
    let [left, top] = TAG_PX.map(|px| px - BIT_PX);
    for u in 0..side + 2 * BIT_PX {
        for v in 0..side + 2 * BIT_PX {
            // The rim is what lies beside all rows.
            let [column, row] = [u, v].map(|x| (x / BIT_PX).wrapping_sub(1) as usize);
            let bits = TAG.get(row).map(|bits| bits.as_bytes());
            let is_black = bits.is_some_and(|bits| bits.get(column) == Some(&b'#'));
            let grey = if is_black { 15 } else { 240 };
            picture.put_pixel(left + u, top + v, Rgb([grey; 3]));
        }
    }
}

/// The tag gives the scale and its upright from the first frames of a film.
#[test]
fn a_tag_gives_the_scale_of_its_film() {
    let scene = Scene::new(60, RED);
    for k in 0..60 {
        let path = scene.path(&format!("film/{k:04}.png"));
        let mut picture = frame(k, RED);
        hang_tag(&mut picture);
        picture.save(path).expect("png");
    }
    scene.replay("markers.json --tag 0.24", "out");
    let note = fs::read_to_string(scene.path("out/capture.json")).expect("note");
    let note: serde_json::Value = serde_json::from_str(&note).expect("JSON");
    let tag = &note["tag"];
    assert_eq!(tag["id"], 7, "{tag}");
    let [lo, scale, hi] = ["metres_per_px_lo", "metres_per_px", "metres_per_px_hi"]
        .map(|key| tag[key].as_f64().expect("a scale"));
    let true_scale = 0.24 / f64::from(8 * BIT_PX);
    assert!((scale / true_scale - 1.0).abs() < 0.01, "{tag}");
    assert!((lo..hi).contains(&true_scale), "{tag}");
    assert!(
        tag["roll_deg"]
            .as_f64()
            .is_some_and(|roll| roll.abs() < 1.0),
        "{tag}"
    );
    let export = &note["config"]["export"]["metres_per_px"];
    assert_eq!(export, &tag["metres_per_px"]);
}

/// Windows of CamShift follow as those of mean shift do.
#[test]
fn camshift_tells_the_same_frequencies() {
    let scene = Scene::new(FRAMES, RED);
    scene.write("camshift.toml", "[markers]\nmethod = \"camshift\"\n");
    scene.replay("markers.json --config camshift.toml", "out");
    let found = branches(&scene, "out --markers");
    for (branch, hz) in found.iter().zip([TRUNK_HZ, BRANCH_HZ]) {
        let value = branch["frequency_hz"]["value"]
            .as_f64()
            .expect("a frequency");
        assert!((value / hz - 1.0).abs() < 0.01, "{value} for {hz}");
    }
    assert_eq!(found.len(), 2);
}

#[test]
fn a_lens_and_the_time_of_rows_change_what_is_told() {
    let scene = Scene::new(60, RED);
    scene.replay("markers.json", "out");
    let profile = format!(
        r#"{{"calib_dimension": {{"w": {WIDTH}, "h": {HEIGHT}}}, "orig_dimension": {{"w": {WIDTH}, "h": {HEIGHT}}},
            "fisheye_params": {{"camera_matrix": [[200, 0, 160], [0, 200, 120], [0, 0, 1]],
            "distortion_coeffs": [0.1, 0.02, 0.0, 0.0]}}}}"#
    );
    scene.write("lens.json", &profile);
    let plain = branches(&scene, "out --markers");
    let output = scene.run("analyze out --markers --lens lens.json --readout-ms 20 --json");
    assert!(output.status.success(), "{}", said(&output));
    for what in ["where no lens distorts (lens.json)", "within 20.0 ms"] {
        assert!(said(&output).contains(what), "{}", said(&output));
    }
    let long = scene.run("analyze out --markers --readout-ms 200");
    assert_eq!(long.status.code(), Some(BAD_USAGE));
    assert!(
        said(&long).contains("the next comes after"),
        "{}",
        said(&long)
    );
    let straight = branches(&scene, "out --markers --lens lens.json");
    let end = |found: &[serde_json::Value]| found[1]["end_px"][0].as_f64().expect("a place");
    assert!((end(&plain) - end(&straight)).abs() > 0.5);
    let endless = scene.run("analyze out --markers --lens /dev/zero");
    assert_eq!(endless.status.code(), Some(BAD_USAGE));
    assert!(
        said(&endless).contains("more than 16 MB"),
        "{}",
        said(&endless)
    );
}

/// The page shows names as they are, and is not made of them.
#[test]
fn names_of_markers_are_no_part_of_the_page() {
    let scene = Scene::new(60, RED);
    let [a, b] = markers_px(0);
    let carried = window("<b>B", b, r#", "parent": "<i>&A""#);
    scene.markers(&format!("{}, {carried}", window("<i>&A", a, "")));
    scene.replay("markers.json", "out");
    let output = scene.run("analyze out --markers --report page.html");
    assert!(output.status.success(), "{}", said(&output));
    let page = fs::read_to_string(scene.path("page.html")).expect("a page");
    assert!(page.contains("&lt;b&gt;B") && page.contains("&lt;i&gt;&amp;A"));
    assert!(!page.contains("<b>B") && !page.contains("<i>&A"));
}

#[test]
fn markers_are_found_by_their_hue() {
    let scene = Scene::new(60, RED);
    scene.replay("auto", "out");
    let note = fs::read_to_string(scene.path("out/capture.json")).expect("note");
    let note: serde_json::Value = serde_json::from_str(&note).expect("JSON");
    let windows = note["config"]["markers"]["windows"]
        .as_array()
        .expect("windows");
    let names: Vec<&str> = windows.iter().filter_map(|w| w["name"].as_str()).collect();
    assert_eq!(names, ["m1", "m2"], "from the bottom up");
}

#[test]
fn bad_markers_get_a_clear_line() {
    let scene = Scene::new(4, RED);
    let [a, b] = markers_px(0);
    scene.markers(&window("A", [600.0, 20.0], ""));
    scene.refused(
        BAD_USAGE,
        "the window of marker A lies off the picture, which is 320x240",
    );
    let corrected = r#"], "corrections": [{"marker": "A", "frame": 2, "at_px": [20, 300]}"#;
    scene.markers(&format!("{}{corrected}", window("A", a, "")));
    scene.refused(
        BAD_USAGE,
        "the place of marker A in frame 2 lies off the picture",
    );
    scene.markers(&window("A", [40.0, 200.0], ""));
    scene.refused(FAILED, "marker A has no colour in its window");
    scene.markers(&format!(
        "{}, {}",
        window("A", a, ""),
        window("B", [a[0] + 4.0, a[1]], "")
    ));
    scene.refused(FAILED, "the windows of markers A and B show the same blob");
    scene.markers(&window("A", b, r#", "parent": "Z""#));
    scene.refused(BAD_USAGE, "the parent Z is no marker");
    scene.write(
        "markers.json",
        r#"{"width": 640, "height": 360, "markers": []}"#,
    );
    scene.refused(BAD_USAGE, "it holds no markers");
    let grey = Scene::new(4, [70.0; 3]);
    grey.refused(FAILED, "the film is grey");
}

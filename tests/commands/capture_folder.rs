//! The capture folder of the shipped recording, read as other programs read it.

use crate::support::{self, CLIP, OUTLINE, recording};
use arborcam::config::Config;
use arborcam::document::Document;
use arborcam::model::{Luma, Unidentified};
use arborcam::outline::{AutoOutline, Found};
use arborcam::track::WholeView;
use nalgebra::Point2;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;
use tempfile::TempDir;

/// One replay and what came out of it.
struct Replay {
    dir: TempDir,
    stream: String,
}

impl Replay {
    fn out(&self) -> PathBuf {
        self.dir.path().join("out")
    }

    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.out().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    fn capture(&self) -> serde_json::Value {
        serde_json::from_str(&self.text("capture.json")).expect("capture.json")
    }

    /// Rows of a table without its header, which must be `header`.
    fn rows(&self, name: &str, header: &str) -> Vec<Vec<String>> {
        let text = self.text(name);
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some(header), "header of {name}");
        lines
            .map(|l| l.split(',').map(str::to_owned).collect())
            .collect()
    }

    fn motion(&self) -> Vec<Moved> {
        self.rows("motion.csv", "frame,time_s,node_id,x,y,z,u_px,v_px")
            .iter()
            .map(|r| Moved::of(r))
            .collect()
    }

    fn nodes(&self) -> Vec<Vec<String>> {
        self.rows(
            "nodes.csv",
            "node_id,parent_id,level,n_tracks,u_px,v_px,x,y,z,radius,frequency_hz,frequency_lo_hz,frequency_hi_hz,\
             damping_ratio,damping_lo,damping_hi,identifiable,excitation,amplitude_deg,unidentified,\
             kind,copy_of,plane_deg,certainty,moves_with,branch,order",
        )
    }

    fn tracks(&self) -> Vec<Vec<String>> {
        self.rows("tracks.csv", "track_id,frame,time_s,u_px,v_px,node_id")
    }
}

/// A row of `motion.csv`.
struct Moved {
    frame: usize,
    time_s: f64,
    node: usize,
    at: [f64; 3],
    seen_px: Point2<f64>,
}

impl Moved {
    fn of(row: &[String]) -> Self {
        let [time_s, x, y, z, u, v] = [1, 3, 4, 5, 6, 7].map(|c| number(&row[c]));
        Self {
            frame: index(&row[0]),
            time_s,
            node: index(&row[2]),
            at: [x, y, z],
            seen_px: Point2::new(u, v),
        }
    }
}

fn number(cell: &str) -> f64 {
    cell.parse().unwrap_or_else(|e| panic!("{cell:?}: {e}"))
}

fn index(cell: &str) -> usize {
    cell.parse().unwrap_or_else(|e| panic!("{cell:?}: {e}"))
}

fn replay(before: &[&str], more: &[&str]) -> Replay {
    let dir = tempfile::tempdir().expect("tempdir");
    let words = [
        before,
        &[env!("CARGO_BIN_EXE_arborcam"), "replay", CLIP, "--fast"],
        more,
    ]
    .concat();
    let output = Command::new(words[0])
        .args(&words[1..])
        .arg("--out")
        .arg(dir.path().join("out"))
        .output();
    let output = output.unwrap_or_else(|e| panic!("{}: {e}", words[0]));
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    Replay {
        dir,
        stream: String::from_utf8(output.stdout).expect("text"),
    }
}

/// The replay that most tests look at.
fn made() -> &'static Replay {
    static MADE: OnceLock<Replay> = OnceLock::new();
    MADE.get_or_init(|| replay(&[], &["--outline", OUTLINE, "--stream", "ndjson"]))
}

/// Row of the node that is called `id`.
fn place(nodes: &[Vec<String>], id: &str) -> usize {
    nodes
        .iter()
        .position(|n| n[0] == id)
        .unwrap_or_else(|| panic!("no node is called {id:?}"))
}

#[test]
fn the_tree_stands_on_its_foot_and_parents_come_first() {
    let nodes = made().nodes();
    assert!(nodes.len() > 50, "{} nodes", nodes.len());
    assert_eq!(nodes[0][1], "", "the root has no parent");
    assert_eq!(
        [6, 7, 8].map(|c| number(&nodes[0][c])),
        [0.0; 3],
        "the foot is the origin"
    );
    assert_eq!(index(&nodes[0][0]), 0, "the foot is 0");
    let trunk = &nodes[place(&nodes, "1")];
    assert_eq!(
        [2, 20].map(|c| trunk[c].as_str()),
        ["1", "measured"],
        "the trunk is 1"
    );
    for (i, node) in nodes.iter().enumerate() {
        let place_of = |id: &str| place(&nodes, id);
        let before = |id: &str| nodes[..i].iter().position(|n| n[0] == id);
        assert!(
            before(&node[0]).is_none(),
            "two nodes are called {}",
            node[0]
        );
        let parent = before(&node[1]);
        assert!(
            i == 0 || parent.is_some(),
            "node {i} stands before its parent {}",
            node[1]
        );
        // One above what carries it; a part of a branch has the level of that, or is side wood.
        let mover = |n: &[String]| {
            if n[24].is_empty() {
                n[0].clone()
            } else {
                n[24].clone()
            }
        };
        let carrier = parent
            .map(|p| mover(&nodes[p]))
            .filter(|m| *m != mover(node));
        let carrier = carrier.map(|name| index(&nodes[place_of(&name)][2]));
        assert!(
            !node[24].is_empty() || carrier.is_none_or(|c| index(&node[2]) == c + 1),
            "level of node {i}"
        );
        assert!(number(&node[9]) > 0.0, "radius of node {i}");
        // Nothing is claimed that has not been identified.
        assert!(
            node[16] == "true" || (10..16).all(|c| node[c].is_empty()),
            "node {i} claims {:?}",
            &node[10..]
        );
    }
}

/// Along the wood a branch may carry others than the motion alone says: it has the points of those
/// that it carries now.
#[test]
fn a_branch_has_the_points_of_what_it_carries() {
    let read = Document::read(&made().out(), 0.0).expect("a capture");
    let skeleton = read.skeleton;
    let mut carried = vec![0; skeleton.nodes.len()];
    let mut carriers = 0;
    for node in skeleton.measured_branches() {
        if let Some(carrier) = skeleton.moving_parent(node) {
            carried[carrier.index()] += skeleton.nodes[node.index()].n_tracks;
            carriers += u32::from(carrier.index() > 0);
        }
    }
    assert!(carriers > 5, "{carriers} branches on others");
    for (node, carried) in skeleton.nodes.iter().zip(carried) {
        assert!(node.n_tracks >= carried, "{:?}: {carried}", node.name);
    }
}

#[test]
fn every_node_is_posed_in_every_frame_those_before_the_build_among_them() {
    let (motion, names) = (made().motion(), made().nodes());
    let nodes = names.len();
    assert_eq!(motion.len(), nodes * recording().len());
    for (k, row) in motion.iter().enumerate() {
        assert_eq!(
            (row.frame, row.node),
            (k / nodes, index(&names[k % nodes][0]))
        );
    }
    // The tree moves, also in the frames from before it was known.
    let build = made().capture()["build"]["frame"]
        .as_u64()
        .expect("build.frame") as usize;
    let sway = |frames: std::ops::Range<usize>| {
        let of_node = |n: usize| frames.clone().map(move |f| f * nodes + n);
        let reach = |n: usize| {
            let us: Vec<f64> = of_node(n).map(|k| motion[k].seen_px.x).collect();
            us.iter().copied().fold(f64::MIN, f64::max)
                - us.iter().copied().fold(f64::MAX, f64::min)
        };
        (0..nodes).map(reach).fold(0.0, f64::max)
    };
    assert!(build > 0 && sway(0..build) > 5.0 && sway(build..recording().len()) > 5.0);
}

#[test]
fn branches_keep_their_lengths() {
    let (motion, nodes) = (made().motion(), made().nodes());
    let mut reach: Vec<(f64, f64)> = vec![(f64::MAX, 0.0); nodes.len()];
    for pose in motion.chunks(nodes.len()) {
        for (i, node) in nodes.iter().enumerate().skip(1) {
            let parent = pose[place(&nodes, &node[1])].at;
            let length = (0..3)
                .map(|c| (pose[i].at[c] - parent[c]).powi(2))
                .sum::<f64>()
                .sqrt();
            reach[i] = (reach[i].0.min(length), reach[i].1.max(length));
        }
    }
    for (i, (short, long)) in reach.iter().enumerate().skip(1) {
        assert!(
            long - short <= 0.001 * long,
            "branch {i} is {short} to {long} px long"
        );
    }
}

#[test]
fn the_projection_is_the_models_seen_from_the_front() {
    let foot = &made().capture()["model"]["foot_px"];
    let foot = [0, 1].map(|c| foot[c].as_f64().expect("foot_px"));
    for row in made().motion() {
        let expected = Point2::new(foot[0] + row.at[0], foot[1] - row.at[1]);
        let off = (row.seen_px - expected).amax();
        assert!(
            off < 0.002,
            "frame {} node {}: {:?} instead of {expected:?}",
            row.frame,
            row.node,
            row.seen_px
        );
    }
}

#[test]
fn times_are_the_files_own() {
    let own: Vec<f64> = recording()
        .iter()
        .map(|f| f.sensor_time_s - recording()[0].sensor_time_s)
        .collect();
    assert!(own.windows(2).all(|w| w[0] < w[1]));
    let steps: BTreeSet<i64> = own
        .windows(2)
        .map(|w| ((w[1] - w[0]) * 1e6).round() as i64)
        .collect();
    assert!(
        steps.len() > 1,
        "the clip's times must differ from a nominal rate for this to show anything"
    );
    for row in made().motion() {
        assert!(
            (row.time_s - own[row.frame]).abs() < 1e-6,
            "frame {} is at {}",
            row.frame,
            row.time_s
        );
    }
    for row in made().tracks() {
        assert!(
            (number(&row[2]) - own[index(&row[1])]).abs() < 1e-6,
            "{row:?}"
        );
    }
}

#[test]
fn tracks_belong_to_nodes_that_exist_and_keep_their_ids() {
    let (capture, nodes) = (made().capture(), made().nodes());
    let model = |key: &str| capture["model"][key].as_u64().expect("count") as usize;
    let measured: BTreeSet<&str> = nodes[..model("nodes") - model("copies")]
        .iter()
        .map(|n| n[0].as_str())
        .collect();
    let coast_s = capture["config"]["track"]["coast_s"]
        .as_f64()
        .expect("coast");
    let mut last: BTreeMap<usize, f64> = BTreeMap::new();
    let mut bound = 0;
    let tracks = made().tracks();
    for row in &tracks {
        let (id, time_s) = (index(&row[0]), number(&row[2]));
        if let Some(before_s) = last.insert(id, time_s) {
            let away = before_s..before_s + coast_s + 0.1;
            assert!(
                time_s > before_s && away.contains(&time_s),
                "track {id} is back after {before_s} s at {time_s} s"
            );
        }
        assert!(
            row[5].is_empty() || measured.contains(row[5].as_str()),
            "{row:?}"
        );
        bound += usize::from(!row[5].is_empty());
    }
    assert!(
        bound * 2 > tracks.len(),
        "{bound} of {} observations belong to a node",
        tracks.len()
    );
    // No point is in both tables, and all that were followed are in one.
    let mut left_out = BTreeSet::new();
    for row in made().rows("left_out.csv", "track_id,frame,time_s,u_px,v_px,node_id") {
        let id = index(&row[0]);
        assert!(!last.contains_key(&id), "{row:?}");
        assert!(
            row[5].is_empty() || measured.contains(row[5].as_str()),
            "{row:?}"
        );
        left_out.insert(id);
    }
    let quality = &capture["quality"];
    let (all, out) = (last.len() + left_out.len(), left_out.len());
    assert_eq!(Some(all as u64), quality["tracks_total"].as_u64());
    assert_eq!(Some(out as u64), quality["tracks_left_out"].as_u64());
    assert!(out > 0, "a quarter of those that move");
}

/// Every answer of a branch is a mode of the tree, and none is there twice.
#[test]
fn the_modes_of_the_tree_hold_those_of_its_branches() {
    let header = "mode,frequency_hz,frequency_lo_hz,frequency_hi_hz,damping_ratio,damping_lo,\
                  damping_hi,excitation,amplitude_deg,collinearity,n_points,node_id,branch,energy,\
                  motion_px2";
    let rows = made().rows("modes.csv", header);
    assert!(!rows.is_empty());
    let mut of_nodes: Vec<u32> = Vec::new();
    let mut slowest_hz = 0.0;
    for row in &rows {
        let frequency_hz: f64 = row[1].parse().expect("number");
        assert!(frequency_hz >= slowest_hz, "{row:?}");
        slowest_hz = frequency_hz;
        assert!(index(&row[10]) >= 4, "{row:?}");
        if !row[11].is_empty() {
            of_nodes.push(index(&row[11]) as u32);
        }
        let shares = row[13].split("; ").filter_map(|s| s.split(' ').nth(1));
        let sum: f64 = shares.filter_map(|s| s.parse::<f64>().ok()).sum();
        assert!((sum - 1.0).abs() < 0.05, "{row:?}");
        for pair in row[14].split("; ") {
            let (node, px2) = pair.split_once(' ').expect("node and motion");
            assert!(index(node) > 0 && number(px2) > 0.0, "{row:?}");
        }
    }
    let nodes = made().rows("nodes.csv", &arborcam::document::nodes_header());
    let mut known: Vec<u32> = nodes
        .iter()
        .filter(|row| row[16] == "true" && row[20] != "copy")
        .map(|row| index(&row[0]) as u32)
        .collect();
    known.sort_unstable();
    of_nodes.sort_unstable();
    assert_eq!(of_nodes, known);
}

/// The clip was filmed from a tripod that stands still.
#[test]
fn the_camera_s_motion_has_a_row_for_each_frame() {
    let header = "frame,time_s,dx_px,dy_px,roll_deg,scale,inliers,rms_px,sd_px,background";
    let rows = made().rows("camera.csv", header);
    assert_eq!(rows.len(), 330);
    for row in &rows {
        assert_eq!(row[9], "seen", "{row:?}");
        assert!(index(&row[6]) >= 100, "{row:?}");
        for shift in &row[2..4] {
            let shift_px: f64 = shift.parse().expect("number");
            assert!(shift_px.abs() < 0.05, "{row:?}");
        }
    }
    let capture = made().capture();
    let quality = &capture["quality"];
    assert_eq!(quality["camera_seen_share"].as_f64(), Some(1.0));
    assert!(
        quality["camera_shake_px"]
            .as_f64()
            .is_some_and(|px| px < 0.02)
    );
}

#[test]
fn the_model_opens_with_skin_and_animation() {
    let bytes = fs::read(made().out().join("tree.glb")).expect("tree.glb");
    let (document, buffers, _) = gltf::import_slice(bytes).expect("a valid GLB");
    let (nodes, capture) = (made().nodes().len(), made().capture());
    let joints = document.skins().next().expect("a skin").joints().count();
    assert!(joints + 1 >= nodes, "{joints} joints for {nodes} nodes");
    assert!(
        document
            .nodes()
            .any(|n| n.mesh().is_some() && n.skin().is_some()),
        "the mesh hangs on the skin"
    );
    let animation = document.animations().next().expect("an animation");
    let mut end_s = 0.0f32;
    for channel in animation.channels() {
        let reader = channel.reader(|b| Some(&buffers[b.index()]));
        let times: Vec<f32> = reader.read_inputs().expect("times").collect();
        assert!(times.windows(2).all(|w| w[0] < w[1]) && times[0] >= 0.0);
        end_s = times.iter().copied().fold(end_s, f32::max);
    }
    let duration_s = capture["timing"]["duration_s"]
        .as_f64()
        .expect("duration_s");
    assert!(
        (f64::from(end_s) - duration_s).abs() < 0.05,
        "{end_s} s of {duration_s} s"
    );
}

#[test]
fn capture_json_says_what_was_seen() {
    let capture = made().capture();
    let frames = recording().len() as u64;
    let says = |path: &str| {
        capture
            .pointer(path)
            .unwrap_or_else(|| panic!("{path} is missing"))
            .clone()
    };
    assert_eq!(
        (says("/source/width"), says("/source/height")),
        (640.into(), 360.into())
    );
    assert_eq!(says("/source/name"), CLIP);
    for count in ["camera", "tracker"] {
        assert_eq!(says(&format!("/timing/frames_dropped_{count}")), 0);
    }
    assert_eq!(
        (says("/timing/frames_seen"), says("/animation/frames")),
        (frames.into(), frames.into())
    );
    let rate = says("/timing/measured_rate_hz").as_f64().expect("rate");
    assert!((rate - 30.0).abs() < 0.1, "{rate} Hz");
    // What a viewer has to hold: a quarter of a key for every joint and frame is enough.
    let (keys, raw) = (
        says("/animation/keys").as_f64().expect("keys"),
        says("/animation/raw_keys").as_f64().expect("raw"),
    );
    println!("{keys} of {raw} keys are kept: {:.1} %", 100.0 * keys / raw);
    assert!(keys > 0.0 && keys <= 0.27 * raw, "{keys} of {raw} keys");
    assert_eq!(says("/model/nodes"), made().nodes().len());
    assert_eq!(says("/build/forced"), false);
    // A bare tree has no branches but those that were filmed.
    assert_eq!(says("/model/copies"), 0);
    assert_eq!(says("/model/bare"), true);
    assert_eq!(
        says("/config"),
        serde_json::to_value(Config::default()).expect("config")
    );
    assert!(says("/quality/median_fb_error_px").as_f64().expect("error") < 0.1);
}

#[test]
fn the_stream_is_what_the_capture_says() {
    // Built early, so that a refinement comes while the film lasts.
    let mut early = tempfile::NamedTempFile::new().expect("a file");
    early
        .write_all(b"[accumulate]\nmin_s = 5.0\n")
        .expect("written");
    let early = early.path().to_str().expect("a path");
    let made = replay(
        &[],
        &[
            "--outline",
            OUTLINE,
            "--stream",
            "ndjson",
            "--config",
            early,
        ],
    );
    let (motion, names, capture) = (made.motion(), made.nodes(), made.capture());
    let nodes = names.len();
    let frame = |key: &str| {
        capture
            .pointer(key)
            .and_then(|f| f.as_u64())
            .unwrap_or_else(|| panic!("no {key}")) as usize
    };
    let (build, refined) = (frame("/build/frame"), frame("/refinement/shown_from"));
    assert!(
        build < refined && refined < recording().len(),
        "built in {build}, refined in {refined}"
    );
    assert_eq!(capture["refinement"]["count"], 1);
    let (mut kept_names, mut measured_names) = (0, 0);
    let lines: Vec<serde_json::Value> = made
        .stream
        .lines()
        .map(|l| serde_json::from_str(l).unwrap_or_else(|e| panic!("{l}: {e}")))
        .collect();
    assert_eq!(
        lines.len(),
        recording().len() - build,
        "a line for each frame from the build on"
    );
    for (k, line) in lines.iter().enumerate() {
        let frame = build + k;
        assert_eq!(line["frame"], frame);
        let streamed = line["nodes"].as_array().expect("nodes");
        for node in streamed {
            let id = node[0].as_u64().expect("id").to_string();
            if frame < refined {
                // The tree as it was then: most of its nodes are in the files, and are the same
                // branches.
                kept_names += usize::from(frame + 1 == refined && names.iter().any(|n| n[0] == id));
                measured_names += usize::from(frame + 1 == refined);
                continue;
            }
            let kept = &motion[frame * nodes + place(&names, &id)];
            let off = (0..3)
                .map(|c| (node[c + 1].as_f64().expect("number") - kept.at[c]).abs())
                .fold(0.0, f64::max);
            assert!(
                off < 0.001,
                "frame {frame} node {id}: {node} and {:?}",
                kept.at
            );
        }
        assert!(streamed.len() > 15, "{} nodes", streamed.len());
    }
    assert!(
        4 * kept_names >= 3 * measured_names,
        "{kept_names} of {measured_names} nodes keep their numbers"
    );
}

/// Undamped frequencies of the clip's ten largest branches, Hz, the trunk's first; and its damping
/// ratio.
const TRUE_HZ: [f64; 10] = [
    0.7, 0.784, 0.8781, 0.9481, 1.0129, 1.0191, 1.0364, 1.1007, 1.1453, 1.2232,
];
const TRUE_DAMPING: f64 = 0.02;

/// What a scientist takes from the table is true: every interval holds the frequency of a branch
/// that there is, and the trunk's its own.
#[test]
fn the_frequencies_are_those_of_the_tree() {
    let nodes = made().nodes();
    let known: Vec<&Vec<String>> = nodes.iter().filter(|n| n[16] == "true").collect();
    assert!(known.len() >= 4, "{} branches have an answer", known.len());
    for node in &known {
        let [lo, hi] = [11, 12].map(|c| number(&node[c]));
        assert!(
            TRUE_HZ.iter().any(|f| (lo..=hi).contains(f)),
            "no branch sways at {lo} to {hi} Hz: {node:?}"
        );
        assert!(hi / lo < 1.05, "{node:?}");
    }
    let trunk = known
        .iter()
        .find(|n| n[0] == "1")
        .expect("the trunk's answer");
    assert!(
        (number(&trunk[11])..=number(&trunk[12])).contains(&TRUE_HZ[0]),
        "{trunk:?}"
    );
    assert!(
        (number(&trunk[13]) / TRUE_DAMPING - 1.0).abs() < 0.1,
        "{trunk:?}"
    );
}

/// The stream says what the film is worth so far, with the first line and whenever that is another
/// verdict, at most once a second.
#[test]
fn the_stream_says_what_the_film_is_worth() {
    let mut told: Vec<(f64, serde_json::Value)> = Vec::new();
    for (i, line) in made().stream.lines().enumerate() {
        let line: serde_json::Value = serde_json::from_str(line).expect("json");
        let Some(verdict) = line.get("verdict") else {
            assert!(i > 0, "the first line has none");
            continue;
        };
        let time_s = line["time_s"].as_f64().expect("a time");
        if let Some((last_s, last)) = told.last() {
            assert!(time_s - last_s > 0.99, "{last_s} s and {time_s} s");
            assert_ne!(last, verdict, "said twice");
        }
        told.push((time_s, verdict.clone()));
    }
    let note = made().capture();
    assert!(told.len() > 1, "{told:?}");
    for (_, verdict) in &told {
        let grade = verdict["grade"].as_str().expect("a grade");
        assert!(["good", "fair", "poor"].contains(&grade), "{verdict}");
    }
    // The last one is of the same film but for its last second.
    let (_, last) = told.last().expect("a verdict");
    assert_eq!(last["grade"], note["verdict"]["grade"], "{last} {note}");
}

/// Once a second the stream says how the branches sway, by the names and with the units of the
/// files.
#[test]
fn the_stream_tells_the_sway_once_a_second() {
    let lines = made()
        .stream
        .lines()
        .map(|l| serde_json::from_str::<serde_json::Value>(l).expect("json"));
    let told: Vec<serde_json::Value> = lines.filter(|l| l.get("sway").is_some()).collect();
    assert!(told.len() >= 2, "told {} times", told.len());
    for line in &told {
        let number = |of: &serde_json::Value, key: &str| {
            of[key].as_f64().unwrap_or_else(|| panic!("{key} in {of}"))
        };
        let sway = &line["sway"];
        // It is from the frame in which it was asked for, a second before.
        let late_s = number(line, "time_s") - number(sway, "time_s");
        assert!((late_s - 1.0).abs() < 0.05, "{late_s} s late");
        assert!(
            (number(sway, "span_s") - number(sway, "time_s")).abs() < 0.05,
            "all of the film so far: {sway}"
        );
        assert_eq!(sway["excitation"], "release");
        let ids: Vec<u64> = line["nodes"]
            .as_array()
            .expect("nodes")
            .iter()
            .filter_map(|n| n[0].as_u64())
            .collect();
        let branches = sway["branches"].as_array().expect("branches");
        // The foot is no branch.
        assert!(
            branches.len() > 15 && branches.len() < ids.len(),
            "{} of {} nodes",
            branches.len(),
            ids.len()
        );
        let mut known = 0;
        for branch in branches {
            assert!(
                ids.contains(&branch["node_id"].as_u64().expect("id")),
                "{branch} is not in the tree"
            );
            if branch["identifiable"] == false {
                let why = branch["unidentified"].as_str().expect("a reason");
                assert!(
                    Unidentified::of_word(why).is_some() && branch.get("frequency_hz").is_none(),
                    "{branch}"
                );
                continue;
            }
            known += 1;
            let [f, lo, hi] =
                ["frequency_hz", "frequency_lo_hz", "frequency_hi_hz"].map(|k| number(branch, k));
            assert!(0.1 < lo && lo < f && f < hi && hi < 5.0, "{branch}");
            assert!(
                branch["excitation"] == "release" && branch.get("unidentified").is_none(),
                "{branch}"
            );
        }
        assert!(known >= 2, "{known} branches are identified");
    }
}

/// The bark in the files has the colour of the filmed trunk, not that of the snow beside it.
#[test]
fn bark_has_the_colour_of_the_filmed_trunk() {
    // The lower trunk stands still, and is 17 px wide about column 325; within 57 degrees to either
    // side, which the tile shows, that is 14 px of it.
    let film = picture("frame.jpg");
    let trunk = image::imageops::crop_imm(&film, 318, 292, 14, 28).to_image();
    let snow = image::imageops::crop_imm(&film, 280, 300, 20, 20).to_image();
    let bark = picture("bark.png");
    let [wanted, snow, found] = [&trunk, &snow, &bark].map(mean);
    for ((found, wanted), snow) in found.iter().zip(wanted).zip(snow) {
        assert!((found - wanted).abs() < 8.0, "{found} of {wanted}");
        assert!((found - snow).abs() > 20.0, "{found}, snow {snow}");
    }
    assert_eq!(made().capture()["bark"]["file"], "bark.png");
    let file = fs::read(made().out().join("tree.glb")).expect("a model");
    let model = gltf::Gltf::from_slice(&file).expect("glTF").document;
    let material = model.materials().find(|m| m.name() == Some("bark"));
    let look = material.expect("bark").pbr_metallic_roughness();
    // The tile is sRGB, and nothing is multiplied with it.
    assert_eq!(look.base_color_factor(), [1.0; 4]);
    assert!(look.base_color_texture().is_some());
}

/// The masks lie on the film: the trunk is wood, the snow beside it is not, and no leaves are there.
#[test]
fn masks_show_the_wood_of_a_bare_tree() {
    let [frame, wood, leaves] = ["frame.jpg", "wood.png", "leaves.png"].map(picture);
    for other in [&wood, &leaves, &picture("rest.png")] {
        assert_eq!(other.dimensions(), frame.dimensions());
    }
    let in_mask = |mask: &image::RgbImage, u, v, width, height| {
        let part = image::imageops::crop_imm(mask, u, v, width, height);
        let pixels = part.to_image();
        pixels.pixels().filter(|p| p.0[0] > 127).count()
    };
    let on_trunk = in_mask(&wood, 321, 270, 8, 20);
    assert!(on_trunk > 120, "{on_trunk} of 160 pixels of the trunk");
    let on_snow = in_mask(&wood, 280, 300, 20, 20);
    assert!(on_snow == 0, "{on_snow} pixels of snow");
    let (width, height) = leaves.dimensions();
    let n_leaves = in_mask(&leaves, 0, 0, width, height);
    let n_wood = in_mask(&wood, 0, 0, width, height);
    assert!(
        100 * n_leaves < n_wood,
        "{n_leaves} of leaves, {n_wood} of wood"
    );
    let note = &made().capture()["masks"];
    let expected = serde_json::json!({
        "wood": "wood.png", "leaves": "leaves.png", "rest": "rest.png",
    });
    assert_eq!(*note, expected);
}

/// In the first frame the tree is pulled aside; the wood lies on the picture of it at rest.
#[test]
fn the_masks_lie_on_the_picture_of_the_tree_at_rest() {
    let [frame, rest, wood] = ["frame.jpg", "rest.png", "wood.png"].map(picture);
    // Mean level of the surest wood of the crown: bare wood before a bright sky.
    let level = |picture: &image::RgbImage| {
        let mut sum = 0.0;
        let mut n = 0.0;
        for (pixel, mask) in picture.pixels().zip(wood.pixels()).take(640 * 200) {
            if mask.0[0] > 240 {
                sum += pixel.0.map(f64::from).iter().sum::<f64>() / 3.0;
                n += 1.0;
            }
        }
        sum / n
    };
    let [at_first, at_rest] = [&frame, &rest].map(level);
    assert!(at_rest + 10.0 < at_first, "{at_rest} and {at_first}");
}

fn picture(name: &str) -> image::RgbImage {
    let picture = image::open(made().out().join(name));
    picture.expect("a picture").into_rgb8()
}

fn mean(picture: &image::RgbImage) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for pixel in picture.pixels() {
        (0..3).for_each(|k| sum[k] += f64::from(pixel.0[k]));
    }
    sum.map(|s| s / f64::from(picture.width() * picture.height()))
}

/// The same clip gives the same bytes, however the threads happen to run.
#[test]
fn a_replay_is_reproducible_to_the_byte() {
    let on_one_core = Command::new("taskset")
        .args(["-c", "0", "true"])
        .status()
        .is_ok_and(|s| s.success());
    let before: &[&str] = if on_one_core {
        &["taskset", "-c", "0"]
    } else {
        &[]
    };
    let again = replay(before, &["--outline", OUTLINE, "--stream", "ndjson"]);
    assert!(
        again.stream == made().stream,
        "the stream differs from one run to the next"
    );
    for name in [
        "capture.json",
        "tracks.csv",
        "left_out.csv",
        "nodes.csv",
        "motion.csv",
        "tree.glb",
        "frame.jpg",
        "bark.png",
        "rest.png",
        "wood.png",
        "leaves.png",
    ] {
        let [a, b] = [made(), &again].map(|r| fs::read(r.out().join(name)).expect("file"));
        assert!(a == b, "{name} differs from one run to the next");
    }
}

/// Without an outline the tree is found by its motion.
#[test]
fn the_tree_is_found_without_an_outline() {
    let found = replay(&[], &["--headless"]);
    assert_eq!(
        found.capture()["picture"]["frame"],
        0,
        "the frames that were held back are in the tables, the first among them"
    );
    assert!(found.nodes().len() > 50, "{} nodes", found.nodes().len());
    let given = support::outline();
    let inside = |r: &Vec<String>| given.contains(number(&r[3]), number(&r[4]));
    let bound: Vec<Vec<String>> = found
        .tracks()
        .into_iter()
        .filter(|r| r[1] == "0" && !r[5].is_empty())
        .collect();
    let hits = bound.iter().filter(|r| inside(r)).count();
    assert!(
        4 * hits >= 3 * bound.len() && hits > 50,
        "{hits} of {} points are on the tree",
        bound.len()
    );
}

/// A camera that trembles by some pixels moves all that it films, and the tree is found all the
/// same.
#[test]
fn the_outline_is_found_by_a_camera_that_trembles() {
    let still = outline_found(&[[0, 0]]);
    assert!(still >= 0.8, "{still:.2}");
    let trembling = outline_found(&[[0, 0], [2, -1], [3, 0], [1, 2], [-2, 1], [-3, -2], [-1, 0]]);
    assert!(trembling >= 0.8, "{trembling:.2}");
}

/// Intersection over union of the outline that was drawn, and the one that is found where each
/// frame in turn is shifted by the next of `shifts`, px.
fn outline_found(shifts: &[[i32; 2]]) -> f64 {
    let config = Config::default();
    let (mut search, mut view) = (
        AutoOutline::new(&config.outline),
        WholeView::new(&config.track),
    );
    let mut decode = support::decoding();
    let frames = (0..recording().len()).map(|k| support::decoded(&mut decode, k));
    let outline = frames
        .zip(shifts.iter().cycle())
        .find_map(|(mut frame, shift)| {
            shift_picture(&mut frame.luma, *shift);
            let camera = view.step(&frame);
            match search.step(&frame.luma, frame.time_s, &camera) {
                Found::Tree(outline) => Some(outline),
                Found::NotYet(_) | Found::NoMotion(_) => None,
            }
        })
        .expect("an outline");
    let given = support::outline();
    let (mut both, mut either) = (0.0, 0.0);
    for (a, b) in outline.mask.iter().zip(&given.mask) {
        both += f64::from(u8::from(*a != 0 && *b != 0));
        either += f64::from(u8::from(*a != 0 || *b != 0));
    }
    println!("intersection over union: {:.2}", both / either);
    both / either
}

/// Moves a picture; its edge goes on where it has left.
fn shift_picture(luma: &mut Luma, [across, down]: [i32; 2]) {
    let before = luma.pixels.clone();
    let (width, height) = (luma.size.width as i32, luma.size.height as i32);
    for (i, pixel) in (0..).zip(&mut luma.pixels) {
        let u = (i % width - across).clamp(0, width - 1);
        let v = (i / width - down).clamp(0, height - 1);
        *pixel = before[(v * width + u) as usize];
    }
}

//! CSV, capture.json and the folder that they go to.

use crate::small_disk::SmallDisk;
use crate::synthetic;
use arborcam::config::Config;
use arborcam::document::note::{ModelNote, Quality, json};
use arborcam::document::{CaptureNote, MotionCsv, SCHEMA_VERSION, TracksCsv, nodes};
use arborcam::files::{OutputFolder, WriteError};
use arborcam::model::{
    DepthSeen, Excitation, Gap, Interval, MAX_GAPS, NodeId, NodeName, Observation, Sway, Timing,
    TrackId, TrackSet, Unidentified,
};
use std::collections::HashMap;
use std::fs;
use std::path::Path;

fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).unwrap()
}

#[test]
fn tracks_have_the_agreed_columns_and_an_empty_cell_where_no_node_is() {
    let mut csv = TracksCsv::new(Vec::new(), false).unwrap();
    let o = |id, u_px| Observation {
        id: TrackId(id),
        u_px,
        v_px: 7.0,
        fb_error_px: 0.1,
        error_px: None,
        confirmed: true,
        depth: None,
    };
    let set = TrackSet {
        frame: 3,
        time_s: 0.1,
        observations: vec![o(1, 10.25), o(2, -0.0)],
        ..TrackSet::default()
    };
    csv.set(&set, |id| (id == TrackId(1)).then_some(NodeName(5)))
        .unwrap();
    let later = TrackSet {
        frame: 4,
        time_s: 1.0 / 3.0,
        ..TrackSet::default()
    };
    csv.row(&later, &o(9, f32::NAN), None).unwrap();
    let expected = "track_id,frame,time_s,u_px,v_px,node_id\n1,3,0.1,10.25,7,5\n2,3,0.1,0,7,\n9,4,0.333333,,,\n";
    assert_eq!(text(csv.finish().unwrap()), expected);
    let mut csv = TracksCsv::new(Vec::new(), true).unwrap();
    let seen = Observation {
        depth: Some(DepthSeen {
            depth_m: 2.5,
            sd_m: 0.0125,
        }),
        ..o(1, 10.25)
    };
    csv.row(&set, &seen, Some(NodeName(5))).unwrap();
    csv.row(&set, &o(2, 0.0), None).unwrap();
    let expected = "track_id,frame,time_s,u_px,v_px,node_id,depth_m,depth_sd_m\n\
                    1,3,0.1,10.25,7,5,2.5,0.0125\n2,3,0.1,0,7,,,\n";
    assert_eq!(text(csv.finish().unwrap()), expected);
}

#[test]
fn nodes_say_what_is_not_identifiable() {
    let skeleton = synthetic::tree(2, 1);
    let sway = Sway {
        frequency_hz: Interval {
            value: 0.512_34,
            lo: 0.5,
            hi: 0.53,
        },
        damping_ratio: Some(Interval {
            value: 0.04,
            lo: 0.02,
            hi: 0.07,
        }),
        excitation: Excitation::Release,
        amplitude_deg: 1.5,
    };
    let half = Sway {
        damping_ratio: None,
        excitation: Excitation::Wind,
        ..sway
    };
    let all = [
        Err(Unidentified::NotMeasured),
        Ok(sway),
        Ok(half),
        Err(Unidentified::TooShort),
    ];
    let out = text(nodes(Vec::new(), &skeleton, &all, 0.0).unwrap());
    let lines: Vec<&str> = out.lines().collect();
    let header = "node_id,parent_id,level,n_tracks,u_px,v_px,x,y,z,radius,frequency_hz,frequency_lo_hz,\
                  frequency_hi_hz,damping_ratio,damping_lo,damping_hi,identifiable,excitation,amplitude_deg,unidentified,\
                  kind,copy_of,plane_deg,certainty,moves_with,branch,order";
    assert_eq!(lines[0], header);
    assert_eq!(
        lines[1],
        "0,,0,400,640,700,0,0,0,14,,,,,,,false,,,not_measured,measured,,,0.75,,trunk,0"
    );
    assert_eq!(
        lines[2],
        "1,0,1,200,644,540,4,160,0,14,0.51234,0.5,0.53,0.04,0.02,0.07,true,release,1.5,,measured,,,0.75,,trunk,0"
    );
    assert!(
        lines[3].contains(",0.51234,0.5,0.53,,,,true,wind,1.5,,measured,,,0.75,,"),
        "{}",
        lines[3]
    );
    assert!(
        lines[4].contains(",,,,,,,false,,,too_short,measured,,,0.75,,"),
        "{}",
        lines[4]
    );
    // Of a fork one goes on with the trunk, the other is a limb.
    let mut ends = [lines[3], lines[4]].map(|l| l.rsplit_once(",,").expect("a branch").1);
    ends.sort_unstable();
    assert_eq!(ends, ["limb_1,1", "trunk,0"]);
    assert_eq!(lines.len(), 5);
}

/// Length of every branch in every frame, from the text.
fn lengths(motion: &str, parents: &[Option<NodeId>]) -> HashMap<usize, Vec<f64>> {
    let mut at: HashMap<(u64, usize), [f64; 3]> = HashMap::new();
    for row in csv::Reader::from_reader(motion.as_bytes()).deserialize() {
        let (frame, _, node, x, y, z, _, _): (u64, f64, usize, f64, f64, f64, f64, f64) =
            row.unwrap();
        at.insert((frame, node), [x, y, z]);
    }
    let mut out: HashMap<usize, Vec<f64>> = HashMap::new();
    for (&(frame, node), p) in &at {
        if let Some(parent) = parents[node] {
            let q = at[&(frame, parent.index())];
            let squares: f64 = p.iter().zip(q).map(|(a, b)| (a - b).powi(2)).sum();
            out.entry(node).or_default().push(squares.sqrt());
        }
    }
    out
}

#[test]
fn rounding_does_not_stretch_even_the_shortest_branch() {
    let mut skeleton = synthetic::tree(4, 1);
    // The last branch is a pixel long.
    let last = skeleton.nodes.len() - 1;
    let parent = skeleton.nodes[skeleton.nodes[last].parent.unwrap().index()].position;
    skeleton.nodes[last].position = parent + (skeleton.nodes[last].position - parent).normalize();
    let poses = synthetic::sway(&skeleton, 20);
    let parents: Vec<_> = skeleton.nodes.iter().map(|n| n.parent).collect();
    for metres_per_px in [0.0, 0.004, 1e-5] {
        let mut csv = MotionCsv::new(Vec::new(), &skeleton.clone().into(), metres_per_px).unwrap();
        poses.iter().for_each(|p| csv.pose(p).unwrap());
        let out = text(csv.finish().unwrap());
        assert!(out.starts_with("frame,time_s,node_id,x,y,z,u_px,v_px\n150,"));
        assert_eq!(out.lines().count(), 1 + 20 * skeleton.nodes.len());
        for (node, lengths) in lengths(&out, &parents) {
            let (low, high) = lengths
                .iter()
                .fold((f64::MAX, 0.0_f64), |(l, h), &x| (l.min(x), h.max(x)));
            assert!(
                high / low - 1.0 < 1e-3,
                "branch {node}: {low} to {high} at {metres_per_px} m a pixel"
            );
        }
    }
}

#[test]
fn a_capture_reads_back_as_it_was_written_and_is_the_same_every_time() {
    let skeleton = synthetic::tree(3, 2);
    let mut timing = Timing {
        nominal_rate_hz: Some(30.0),
        ..Timing::default()
    };
    for k in 0..MAX_GAPS as u64 + 5 {
        timing.push_gap(Gap {
            after_frame: 2 * k,
            time_s: k as f64,
            missing: 1,
            ..Gap::default()
        });
    }
    assert_eq!((timing.gaps.len(), timing.gaps_not_listed), (MAX_GAPS, 5));
    let capture = CaptureNote {
        schema_version: SCHEMA_VERSION,
        software: Default::default(),
        captured_at: None,
        notes: Default::default(),
        source: Default::default(),
        timing,
        config: Config::default(),
        outline: None,
        picture: None,
        tag: None,
        depth: None,
        leaves: None,
        bark: None,
        masks: None,
        scan: None,
        found: None,
        build: None,
        refinement: None,
        quality: Quality {
            median_fb_error_px: Some(0.05),
            ..Quality::default()
        },
        verdict: None,
        judged_by: None,
        model: Some(ModelNote::of(&skeleton, 0.004)),
        animation: None,
        warnings: vec!["the camera dropped 3 frames".into()],
    };
    let bytes = json(&capture).unwrap();
    assert_eq!(bytes, json(&capture).unwrap());
    assert_eq!(
        serde_json::from_slice::<CaptureNote>(&bytes).unwrap(),
        capture
    );
    assert!(!text(bytes).contains("captured_at"));
}

fn names_in(dir: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(dir)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_folder_appears_only_when_it_is_complete() {
    let home = tempfile::tempdir().unwrap();
    let dir = home.path().join("new/deep/oak");
    let folder = OutputFolder::create(&dir).unwrap();
    let again = OutputFolder::create(&dir).unwrap();
    folder.write("capture.json", b"{}").unwrap();
    assert!(!dir.exists());
    folder.publish().unwrap();
    assert_eq!(fs::read(dir.join("capture.json")).unwrap(), b"{}");
    // A second capture that began before the first was finished must not replace it.
    again.write("capture.json", b"other").unwrap();
    assert!(matches!(again.publish(), Err(WriteError::Exists { .. })));
    assert_eq!(fs::read(dir.join("capture.json")).unwrap(), b"{}");
    assert_eq!(names_in(&home.path().join("new/deep")), ["oak"]);
}

#[test]
fn a_capture_that_is_given_up_leaves_nothing_behind() {
    let home = tempfile::tempdir().unwrap();
    let folder = OutputFolder::create(&home.path().join("a/b/oak")).unwrap();
    folder.write("tracks.csv", b"half").unwrap();
    drop(folder);
    assert_eq!(names_in(home.path()), [""; 0]);
}

#[test]
fn what_exists_is_never_touched_and_the_message_says_what_to_do() {
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("file"), "mine").unwrap();
    fs::create_dir(home.path().join("empty")).unwrap();
    std::os::unix::fs::symlink("nowhere", home.path().join("link")).unwrap();
    for taken in ["file", "empty", "link"] {
        let error = OutputFolder::create(&home.path().join(taken)).unwrap_err();
        assert!(
            matches!(error, WriteError::Exists { .. }),
            "{taken}: {error}"
        );
        let line = error.to_string();
        assert!(
            line.contains("choose another") && !line.contains('\n'),
            "{line}"
        );
    }
    let below_a_file = OutputFolder::create(&home.path().join("file/oak")).unwrap_err();
    assert!(
        matches!(below_a_file, WriteError::NotAFolder { .. }),
        "{below_a_file}"
    );
    assert!(OutputFolder::create(Path::new("")).is_err());
    assert_eq!(names_in(home.path()), ["empty", "file", "link"]);
}

#[test]
fn a_full_disk_is_named_by_the_row_writers() {
    let full = || {
        fs::OpenOptions::new()
            .write(true)
            .open("/dev/full")
            .unwrap()
    };
    let skeleton = synthetic::tree(5, 3);
    let poses = synthetic::sway(&skeleton, 100);
    let mut csv = MotionCsv::new(full(), &skeleton.clone().into(), 0.0).unwrap();
    // Far more than any buffer: the error must come while writing, not at the end of an hour.
    let error = poses
        .iter()
        .find_map(|p| csv.pose(p).err())
        .expect("nothing fits on a full disk");
    assert!(matches!(error, WriteError::DiskFull { .. }), "{error}");
    let short = TracksCsv::new(full(), false).unwrap().finish().unwrap_err();
    assert!(matches!(short, WriteError::DiskFull { .. }), "{short}");
}

/// Needs a small file system of its own, which only root can mount.
#[test]
fn a_full_disk_leaves_no_half_written_folder() {
    let Some(disk) = SmallDisk::mount("256k") else {
        return;
    };
    let folder = OutputFolder::create(&disk.path("oak")).unwrap();
    folder.write("capture.json", &[b' '; 100_000]).unwrap();
    let error = folder.write("tree.glb", &vec![0; 1_000_000]).unwrap_err();
    drop(folder);
    let left = names_in(disk.dir());
    assert_eq!(left, [""; 0]);
    assert!(
        matches!(
            error,
            WriteError::DiskFull {
                bytes: 1_100_000,
                ..
            }
        ),
        "{error:?}"
    );
    assert!(error.to_string().contains("1.1 MB"), "{error}");
}

//! `arborcam render`: what is drawn of a real capture, and what bad input gets.

use crate::support::{CLIP, OUTLINE};
use arborcam::document::Document;
use image::RgbaImage;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use tempfile::TempDir;

fn arborcam(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_arborcam"))
        .args(arguments)
        .output()
        .expect("arborcam")
}

/// One replay of the shipped recording.
fn capture() -> &'static str {
    static MADE: OnceLock<(TempDir, String)> = OnceLock::new();
    let (_, out) = MADE.get_or_init(|| {
        let dir = tempfile::tempdir().expect("tempdir");
        let out = dir.path().join("out").display().to_string();
        let run = arborcam(&[
            "replay",
            CLIP,
            "--fast",
            "--headless",
            "--outline",
            OUTLINE,
            "--out",
            &out,
        ]);
        assert!(
            run.status.success(),
            "{}",
            String::from_utf8_lossy(&run.stderr)
        );
        (dir, out)
    });
    out
}

/// Draws into a new file of a folder that goes with the test.
fn render(dir: &Path, name: &str, more: &[&str]) -> PathBuf {
    let out = dir.join(name);
    let text = out.display().to_string();
    let run = arborcam(&[&["render", capture(), "--out", &text], more].concat());
    assert!(
        run.status.success(),
        "{more:?}: {}",
        String::from_utf8_lossy(&run.stderr)
    );
    assert!(run.stdout.is_empty(), "standard output is for data");
    out
}

fn read(path: &Path) -> RgbaImage {
    image::open(path).expect("picture").into_rgba8()
}

fn drawn(picture: &RgbaImage) -> usize {
    picture.pixels().filter(|p| p[3] > 127).count()
}

/// The picture over the film is that film's tree: the joints lie on drawn pixels, in the film's own
/// coordinates.
#[test]
fn the_front_view_lies_over_the_filmed_frame() {
    let dir = tempfile::tempdir().unwrap();
    let behind = read(&render(dir.path(), "behind.png", &["--film", "behind"]));
    let beside = read(&render(
        dir.path(),
        "beside.png",
        &["--film", "beside", "--background", "#ff00ff"],
    ));
    let film = read(&Path::new(capture()).join("frame.jpg"));
    assert_eq!(
        (behind.dimensions(), beside.dimensions()),
        ((640, 360), (1280, 360))
    );
    assert!(
        (0..360).all(|y| (0..640).all(|x| beside.get_pixel(x, y) == film.get_pixel(x, y))),
        "the frame as it is"
    );
    assert_eq!(beside.get_pixel(1279, 0).0, [255, 0, 255, 255]);
    let captured = Document::read(Path::new(capture()), 0.0).unwrap();
    let pose = captured.pose_in_picture.as_ref().unwrap();
    // Forks: between them branches curl, and a tip is thinner than a pixel.
    let children = captured.skeleton.children();
    for (i, joint) in pose
        .joints
        .iter()
        .enumerate()
        .skip(1)
        .filter(|(i, _)| !children[*i].is_empty())
    {
        let [u, v] = captured.skeleton.image_from_model(&joint.position).into();
        if !(0.0..640.0).contains(&u) || !(0.0..360.0).contains(&v) {
            continue;
        }
        let covered = (-3..=3).any(|dy| {
            (-3..=3).any(|dx| {
                let (x, y) = (
                    (u.round() as i64 + dx) as u32,
                    (v.round() as i64 + dy) as u32,
                );
                x < 640 && y < 360 && beside.get_pixel(640 + x, y).0 != [255, 0, 255, 255]
            })
        });
        assert!(covered, "node {i} at {u:.0} {v:.0}");
    }
}

#[test]
fn each_view_shows_another_side_of_the_whole_tree() {
    let dir = tempfile::tempdir().unwrap();
    let mut seen = Vec::new();
    for view in ["front", "side", "back", "top", "turntable"] {
        let name = format!("{view}.png");
        let path = render(
            dir.path(),
            &name,
            &[
                "--view",
                view,
                "--size",
                "200x150",
                "--background",
                "transparent",
            ],
        );
        let picture = read(&path);
        assert_eq!(picture.dimensions(), (200, 150));
        assert!(drawn(&picture) > 500, "{view}: {} pixels", drawn(&picture));
        let cut_off = (0..200)
            .any(|x| picture.get_pixel(x, 0)[3] > 127 || picture.get_pixel(x, 149)[3] > 127);
        assert!(!cut_off, "{view} is cut off");
        seen.push(fs::read(path).unwrap());
    }
    let turned = render(
        dir.path(),
        "turned.png",
        &[
            "--turn",
            "90",
            "--size",
            "200x150",
            "--background",
            "transparent",
        ],
    );
    assert!(
        fs::read(turned).unwrap() == seen[1],
        "a quarter turn from the front is the side"
    );
    seen.sort();
    seen.dedup();
    assert_eq!(seen.len(), 5);
}

#[test]
fn moments_differ_and_the_same_moment_does_not() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = |name: &str, more: &[&str]| fs::read(render(dir.path(), name, more)).unwrap();
    let (rest, first, later) = (
        bytes("rest.png", &["--pose", "rest"]),
        bytes("0.png", &["--at", "0"]),
        bytes("3.png", &["--at", "3"]),
    );
    assert!(rest != first && first != later);
    assert!(first == bytes("again.png", &["--at", "0"]));
}

/// A video plays: right size, right length, it moves, and the same twice.
#[test]
fn a_video_moves() {
    let dir = tempfile::tempdir().unwrap();
    let more = ["--seconds", "0.5", "--fps", "20", "--size", "161x120"];
    let path = render(dir.path(), "a.mp4", &more);
    let probe = Command::new("ffprobe")
        .args([
            "-v",
            "error",
            "-count_frames",
            "-select_streams",
            "v",
            "-of",
            "csv=p=0",
        ])
        .args([
            "-show_entries",
            "stream=codec_name,width,height,nb_read_frames",
        ])
        .arg(&path)
        .output()
        .expect("ffprobe");
    assert_eq!(
        String::from_utf8_lossy(&probe.stdout).trim(),
        "h264,162,120,10"
    );
    let frames = Command::new("ffmpeg")
        .args(["-v", "error", "-i"])
        .arg(&path)
        .args(["-f", "rawvideo", "-pix_fmt", "gray", "-"])
        .output()
        .expect("ffmpeg");
    let frames: Vec<&[u8]> = frames.stdout.chunks_exact(162 * 120).collect();
    let moved = frames[0]
        .iter()
        .zip(frames[9])
        .filter(|(a, b)| a.abs_diff(**b) > 60)
        .count();
    assert!(moved > 20, "{moved} pixels differ");
    assert!(fs::read(&path).unwrap() == fs::read(render(dir.path(), "b.mp4", &more)).unwrap());
}

/// One line that says what to do, the exit status of the contract, and nothing left behind.
#[test]
fn bad_input_gets_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).display().to_string();
    fs::create_dir(at("empty")).unwrap();
    fs::write(at("there.png"), b"mine").unwrap();
    fs::create_dir(at("spoilt")).unwrap();
    for file in ["capture.json", "nodes.csv", "motion.csv"] {
        fs::copy(
            Path::new(capture()).join(file),
            Path::new(&at("spoilt")).join(file),
        )
        .unwrap();
    }
    fs::write(
        Path::new(&at("spoilt")).join("motion.csv"),
        b"frame,time_s\n1,2\n",
    )
    .unwrap();
    fs::create_dir(at("old")).unwrap();
    for file in ["nodes.csv", "motion.csv", "tree.glb"] {
        fs::copy(
            Path::new(capture()).join(file),
            Path::new(&at("old")).join(file),
        )
        .unwrap();
    }
    // A capture of an older version has no picture in it.
    let note = fs::read_to_string(Path::new(capture()).join("capture.json")).unwrap();
    let mut note: serde_json::Value = serde_json::from_str(&note).unwrap();
    note["picture"] = serde_json::Value::Null;
    fs::write(Path::new(&at("old")).join("capture.json"), note.to_string()).unwrap();
    let (new, video, there, odd, below) = (
        at("a.png"),
        at("a.mp4"),
        at("there.png"),
        at("a.gif"),
        at("there.png/b.png"),
    );
    let good = capture();
    let cases: &[(&[&str], i32, &str)] = &[
        (&[&at("absent"), "--out", &new], 3, "is not there"),
        (&[&at("empty"), "--out", &new], 3, "no capture"),
        (&[&at("spoilt"), "--out", &new], 3, "motion.csv"),
        (
            &[&at("old"), "--film", "behind", "--out", &new],
            1,
            "leave --film out",
        ),
        (&[good, "--out", &there], 1, "exists already"),
        (&[good, "--out", &below], 1, "cannot be a folder"),
        (&[good, "--out", &odd], 2, "does not end in .png or .mp4"),
        (&[good, "--out", &new, "--size", "0x480"], 2, "as 640x480"),
        (
            &[good, "--out", &new, "--size", "640x99999"],
            2,
            "as 640x480",
        ),
        (&[good, "--out", &new, "--size", "large"], 2, "as 640x480"),
        (
            &[good, "--out", &new, "--at", "500"],
            2,
            "give less with --at",
        ),
        (
            &[good, "--out", &new, "--at", "nan"],
            2,
            "number of seconds",
        ),
        (
            &[good, "--out", &new, "--background", "#12345é"],
            2,
            "#rrggbb",
        ),
        (&[good, "--out", &new, "--seconds", "2"], 2, "--at"),
        (
            &[good, "--out", &video, "--background", "transparent"],
            2,
            "--background white",
        ),
        (&[good, "--out", &video, "--seconds", "1e9"], 2, "give less"),
        (&[good, "--out", &video, "--fps", "0"], 2, "1 to 120"),
        (
            &[good, "--out", &new, "--film", "behind", "--view", "side"],
            2,
            "--film beside",
        ),
        (
            &[good, "--out", &new, "--film", "behind", "--at", "5"],
            2,
            "leave out --at",
        ),
        (&[good, "--out", "/proc/a.png"], 1, "/proc/a.png"),
    ];
    for (arguments, status, told) in cases {
        let run = arborcam(&[&["render"], *arguments].concat());
        let said = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(*status), "{arguments:?}: {said}");
        assert!(said.contains(told), "{arguments:?}: {said}");
        assert!(
            said.starts_with("arborcam: ") && said.trim_end().lines().count() <= 3,
            "{said}"
        );
    }
    let run = arborcam(&["render", &at("old"), "--out", &new]);
    assert!(
        run.status.success() && String::from_utf8_lossy(&run.stderr).contains("warning"),
        "an older capture is drawn"
    );
    fs::remove_file(&new).unwrap();
    let mut left: Vec<_> = fs::read_dir(dir.path())
        .unwrap()
        .flatten()
        .map(|f| f.file_name())
        .collect();
    left.sort();
    assert_eq!(left, ["empty", "old", "spoilt", "there.png"]);
    assert_eq!(fs::read(&there).unwrap(), b"mine");
}

/// Ctrl-C in the middle of a video: nothing is left of it, and the shell can tell.
#[test]
fn a_video_that_is_stopped_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("a.mp4");
    let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
    command
        .args([
            "render",
            capture(),
            "--pose",
            "rest",
            "--view",
            "turntable",
            "--seconds",
            "100",
            "--out",
        ])
        .arg(&out);
    let mut child = command
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    while fs::read_dir(dir.path()).unwrap().count() == 0 {
        assert!(
            child.try_wait().unwrap().is_none(),
            "it was over before it was stopped"
        );
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert!(
        Command::new("kill")
            .args(["-s", "INT", &child.id().to_string()])
            .status()
            .unwrap()
            .success()
    );
    let output = child.wait_with_output().unwrap();
    assert_eq!(
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stderr).as_ref()
        ),
        (Some(130), "")
    );
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}

/// Without ffmpeg a picture is still drawn, and a video says what to install.
#[test]
fn without_ffmpeg_a_video_names_the_remedy() {
    let dir = tempfile::tempdir().unwrap();
    for (name, status) in [("a.mp4", 1), ("a.png", 0)] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
        command
            .args(["render", capture(), "--out"])
            .arg(dir.path().join(name))
            .env("PATH", "/nowhere");
        let run = command.output().unwrap();
        let said = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(status), "{said}");
        assert!(status == 0 || said.contains("apt install ffmpeg"), "{said}");
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
}

//! What bad input gets: the exit status of the contract, one line that names the thing and says
//! what to do, and nothing left behind but what was asked for.

use crate::small_disk::SmallDisk;
use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use tempfile::TempDir;

const CLIP: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/sparse_winter.mkv");
const OUTLINE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/recordings/sparse_winter.outline.json"
);
const DONE: i32 = 0;
const FAILED: i32 = 1;
const BAD_USAGE: i32 = 2;
const NO_INPUT: i32 = 3;
const STOPPED: i32 = 130;
/// Builds as soon as there are points that move, which keeps clips short.
const EAGER: &str = "[accumulate]\nmin_s = 0.5\nthreshold = 0.0\n";

/// What is in the folder given with `--out` afterwards.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Out {
    Nothing,
    Tracks,
    Model,
}
use Out::{Model, Nothing, Tracks};

fn ffmpeg(arguments: &[&str], out: &Path) {
    let status = Command::new("ffmpeg")
        .args(["-v", "error", "-nostdin", "-y"])
        .args(arguments)
        .arg(out)
        .status();
    assert!(status.expect("ffmpeg").success(), "ffmpeg {arguments:?}");
}

/// Every bad input, made once; also for a user who is not root.
fn fixtures() -> &'static Path {
    static MADE: OnceLock<TempDir> = OnceLock::new();
    MADE.get_or_init(|| {
        let dir = tempfile::tempdir().expect("tempdir");
        let at = |name: &str| dir.path().join(name);
        let write = |name: &str, content: &[u8]| fs::write(at(name), content).expect("write");
        fs::set_permissions(dir.path(), fs::Permissions::from_mode(0o755)).expect("chmod");
        for folder in ["nothing", "one", "sizes", "odd"] {
            fs::create_dir(at(folder)).expect("folder");
        }
        let clip = fs::read(CLIP).expect("clip");
        write("clip.mkv", &clip);
        write("cut.mkv", &clip[..clip.len() / 2]);
        write("text.mkv", "This is no video.\n".repeat(300).as_bytes());
        write("empty.mkv", b"");
        ffmpeg(
            &["-i", CLIP, "-c", "copy", "-frames:v", "1"],
            &at("one.mkv"),
        );
        ffmpeg(
            &["-i", CLIP, "-c", "copy", "-frames:v", "60"],
            &at("short.mkv"),
        );
        ffmpeg(
            &["-i", CLIP, "-c", "copy", "-frames:v", "1", "-f", "image2"],
            &at("one/1.jpg"),
        );
        ffmpeg(
            &[
                "-loop",
                "1",
                "-i",
                at("one/1.jpg").to_str().expect("path"),
                "-t",
                "3",
                "-c",
                "copy",
            ],
            &at("still.mkv"),
        );
        ffmpeg(
            &["-i", CLIP, "-c", "copy", "-frames:v", "5", "-f", "image2"],
            &at("sizes/%d.jpg"),
        );
        ffmpeg(
            &[
                "-i",
                CLIP,
                "-frames:v",
                "1",
                "-s",
                "320x180",
                "-f",
                "image2",
            ],
            &at("sizes/6.jpg"),
        );
        // One stream of JPEGs of two sizes, as a camera with a firmware of its own delivers them.
        let stream: Vec<u8> = (1..=6)
            .flat_map(|n| fs::read(at(&format!("sizes/{n}.jpg"))).expect("picture"))
            .collect();
        write("sizes.mjpeg", &stream);
        ffmpeg(
            &[
                "-i",
                at("sizes.mjpeg").to_str().expect("path"),
                "-c",
                "copy",
            ],
            &at("sizes.mkv"),
        );
        for n in 1..=2 {
            write(&format!("odd/{n}.jpg"), b"no picture");
        }

        let polygon = |name: &str, size: &str, corners: &str| {
            write(
                name,
                format!(r#"{{"frame": 0, {size}, "polygon_px": [{corners}]}}"#).as_bytes(),
            );
        };
        let size = r#""width": 640, "height": 360"#;
        polygon(
            "other.json",
            r#""width": 1280, "height": 720"#,
            "[10, 10], [90, 10], [90, 90]",
        );
        polygon("outside.json", size, "[10, 10], [990, 10], [90, 90]");
        polygon(
            "crossing.json",
            size,
            "[10, 10], [90, 90], [90, 10], [10, 90]",
        );
        polygon("two.json", size, "[10, 10], [90, 90]");
        let trunk = |name: &str, size: &str, points: &str| {
            write(
                name,
                format!(r#"{{{size}, "polyline_px": [{points}]}}"#).as_bytes(),
            );
        };
        trunk(
            "trunk-other.json",
            r#""width": 1280, "height": 720"#,
            "[10, 90], [10, 10]",
        );
        trunk("trunk-point.json", size, "[10, 10]");
        write("cut.json", br#"{"frame": 0, "width": 640,"#);
        write(
            "half.json",
            br#"{"width": 640, "height": 360, "markers": [{"name": "A"#,
        );
        write("words.json", b"the tree is in the middle");
        let mask = |name: &str, size: [u32; 2], shade: u8| {
            image::GrayImage::from_pixel(size[0], size[1], image::Luma([shade]))
                .save(at(name))
                .expect("mask");
        };
        mask("small.png", [64, 36], 255);
        mask("black.png", [640, 360], 0);
        mask("grey.png", [640, 360], 128);
        let scribbles = |name: &str, shades: &[u8]| {
            let shade = |u: u32| shades.get(u as usize / 40).copied().unwrap_or(128);
            image::GrayImage::from_fn(640, 360, |u, _| image::Luma([shade(u)]))
                .save(at(name))
                .expect("scribbles");
        };
        scribbles("only-tree.png", &[255]);
        scribbles("only-background.png", &[128, 0]);
        image::DynamicImage::new_rgba8(640, 360)
            .save(at("clear.png"))
            .expect("picture");
        let slope = |u: u32, v: u32| image::Luma([(u * 255 / 640) as u8 ^ (v as u8 & 1)]);
        image::GrayImage::from_fn(640, 360, slope)
            .save(at("photo.png"))
            .expect("picture");

        write("unknown.toml", b"[track]\nwindow_px = 15\nwindw_px = 17\n");
        write("section.toml", b"[trak]\nwindow_px = 15\n");
        write("type.toml", b"\n[detect]\npoints = \"many\"\n");
        write("range.toml", b"[track]\nwindow_px = 3\n");
        write("even.toml", b"[track]\nwindow_px = 16\n");
        write("syntax.toml", b"[track\n");
        write("eager.toml", EAGER.as_bytes());
        dir
    })
    .path()
}

/// Runs the program in a folder of its own, words split at blanks, `{f}` standing for the fixtures.
struct Run {
    work: TempDir,
    command: Command,
}

impl Run {
    fn new(words: &str) -> Self {
        let work = tempfile::tempdir().expect("tempdir");
        fs::set_permissions(work.path(), fs::Permissions::from_mode(0o777)).expect("chmod");
        let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
        let made = fixtures().display().to_string();
        command.args(
            words
                .split_whitespace()
                .map(|w| w.replace("{f}", &made).replace("{outline}", OUTLINE)),
        );
        command
            .current_dir(work.path())
            .stdin(Stdio::null())
            .env_remove("ARBORCAM_LOG");
        Self { work, command }
    }

    fn out(&self) -> PathBuf {
        self.work.path().join("out")
    }

    fn end(&mut self) -> Output {
        self.command.output().expect("arborcam starts")
    }
}

/// The helper: status, one line with all of `says`, nothing on standard output, no panic, and
/// `left` in the folder.
#[track_caller]
fn check(name: &str, run: &Run, output: &Output, status: i32, says: &[&str], left: Out) {
    let stderr = String::from_utf8_lossy(&output.stderr);
    let fail = |what: &str| {
        panic!(
            "{name}: {what}\nstatus {:?}, standard error:\n{stderr}",
            output.status
        )
    };
    if output.status.code() != Some(status) {
        fail(&format!("status {status} is wanted"));
    }
    if !output.stdout.is_empty() {
        fail("something on standard output");
    }
    if ["panicked", "RUST_BACKTRACE", "unwrap", "os error 0"]
        .iter()
        .any(|w| stderr.contains(w))
    {
        fail("a panic");
    }
    let of_libraries = [
        "os error",
        "EOF while",
        "IoError",
        "CSV error",
        "is not in ",
        "invalid digit",
    ];
    if of_libraries.iter().any(|w| stderr.contains(w)) {
        fail("words of a library");
    }
    let ours: Vec<&str> = stderr
        .lines()
        .filter(|l| l.starts_with("arborcam: "))
        .collect();
    let (warnings, errors): (Vec<&str>, Vec<&str>) = ours
        .into_iter()
        .partition(|l| l.starts_with("arborcam: warning: "));
    let wanted = usize::from(status != DONE && status != STOPPED);
    if errors.len() != wanted {
        fail(&format!("{} error lines instead of {wanted}", errors.len()));
    }
    let told = if wanted == 1 {
        errors[0].to_owned()
    } else {
        warnings.join("\n")
    };
    for part in says {
        let part = part.replace("{f}", &fixtures().display().to_string());
        if !told.contains(&part) {
            fail(&format!("it does not say {part:?}"));
        }
    }
    let mut entries: Vec<String> = fs::read_dir(run.work.path())
        .expect("work folder")
        .map(|e| e.expect("entry").file_name().to_string_lossy().into_owned())
        .collect();
    entries.retain(|e| e != "mine");
    let files = |dir: PathBuf| -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(dir).map_or(Vec::new(), |d| {
            d.flatten()
                .map(|e| e.file_name().to_string_lossy().into())
                .collect()
        });
        // There only where the film shows a trunk, and wood.
        let of_wood = ["bark.png", "rest.png", "wood.png", "leaves.png"];
        names.retain(|name| !of_wood.contains(&name.as_str()));
        names.sort();
        names
    };
    let tables = [
        "camera.csv",
        "capture.json",
        "frame.jpg",
        "motion.csv",
        "nodes.csv",
        "tracks.csv",
    ];
    let mut of_a_tree = [&tables[..], &["left_out.csv", "modes.csv", "tree.glb"]].concat();
    of_a_tree.sort_unstable();
    match left {
        Nothing if entries.is_empty() => {}
        Tracks if entries == ["out"] && files(run.out()) == tables => {}
        Model if entries == ["out"] && files(run.out()) == of_a_tree => {}
        _ => fail(&format!(
            "left behind: {entries:?}, in out: {:?}",
            files(run.out())
        )),
    }
}

/// Words of the command line, status, what the line must say, what is left.
type Case = (&'static str, i32, &'static [&'static str], Out);

const CASES: &[Case] = &[
    // Inputs that are none.
    (
        "replay {f}/missing.mkv",
        NO_INPUT,
        &["{f}/missing.mkv is not there", "check the name"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv/x.mkv",
        NO_INPUT,
        &["{f}/clip.mkv/x.mkv", "check the name"],
        Nothing,
    ),
    (
        "replay {f}/text.mkv",
        NO_INPUT,
        &["{f}/text.mkv", "no video that ffmpeg can read", "try"],
        Nothing,
    ),
    (
        "replay {f}/empty.mkv",
        NO_INPUT,
        &["{f}/empty.mkv", "no content", "film again"],
        Nothing,
    ),
    (
        "replay {f}/nothing",
        NO_INPUT,
        &["{f}/nothing is empty", "no .png, .jpg"],
        Nothing,
    ),
    (
        "replay {f}/odd",
        NO_INPUT,
        &["{f}/odd/1.jpg", "no readable picture", "replace it"],
        Nothing,
    ),
    (
        "replay {f}/one",
        NO_INPUT,
        &["{f}/one has one frame only", "film for"],
        Nothing,
    ),
    (
        "replay {f}/one.mkv",
        NO_INPUT,
        &["{f}/one.mkv has one frame only", "film for"],
        Nothing,
    ),
    (
        "replay {f}/one/1.jpg",
        NO_INPUT,
        &["{f}/one/1.jpg", "single picture", "give the folder"],
        Nothing,
    ),
    (
        "capture /dev/video99",
        NO_INPUT,
        &["/dev/video99 is not there", "arborcam devices"],
        Nothing,
    ),
    (
        "capture /dev/null",
        NO_INPUT,
        &["/dev/null", "no camera"],
        Nothing,
    ),
    (
        "capture {f}/missing.mkv",
        NO_INPUT,
        &["{f}/missing.mkv is not there", "check the name"],
        Nothing,
    ),
    // Inputs that turn bad: what came before is kept.
    (
        "replay {f}/sizes",
        FAILED,
        &["{f}/sizes/6.jpg", "320x180", "640x360", "one size"],
        Tracks,
    ),
    (
        "replay {f}/sizes.mkv",
        FAILED,
        &["frame 5", "320x180", "640x360", "must not change"],
        Tracks,
    ),
    (
        "replay {f}/cut.mkv --outline {outline}",
        DONE,
        &["clip ends early", "are used"],
        Model,
    ),
    (
        "replay {f}/still.mkv",
        FAILED,
        &["no tree", "wait for wind"],
        Tracks,
    ),
    (
        "replay {f}/still.mkv --outline {outline}",
        FAILED,
        &["no tree", "wait for wind"],
        Tracks,
    ),
    // Outlines.
    (
        "replay {f}/clip.mkv --outline {f}/other.json",
        BAD_USAGE,
        &["other.json", "1280x720", "640x360", "draw it"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --outline {f}/outside.json",
        BAD_USAGE,
        &["outside.json", "(990, 10)", "640x360", "draw it"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --outline {f}/crossing.json",
        BAD_USAGE,
        &["crossing.json", "edge 1 cuts edge 3", "draw it"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --outline {f}/two.json",
        BAD_USAGE,
        &["two.json", "at least 3", "draw it"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --outline {f}/cut.json",
        BAD_USAGE,
        &["cut.json", "line 1", "it is cut off", "draw it"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --outline {f}/words.json",
        BAD_USAGE,
        &["words.json", "neither a JSON polygon", "draw it"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --trunk {f}/trunk-other.json",
        BAD_USAGE,
        &["--trunk", "1280x720", "640x360", "draw it"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --trunk {f}/trunk-point.json",
        BAD_USAGE,
        &["--trunk", "at least two points"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --branch-stroke {f}/trunk-other.json",
        BAD_USAGE,
        &["--branch-stroke", "1280x720", "640x360", "draw it"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --branch-stroke {f}/trunk-point.json",
        BAD_USAGE,
        &["--branch-stroke", "at least two points"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --branch-stroke {f}/none.json",
        BAD_USAGE,
        &["--branch-stroke", "none.json", "give a file"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --trunk {f}/words.json",
        BAD_USAGE,
        &["words.json", "polyline_px"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --trunk {f}/none.json",
        BAD_USAGE,
        &["none.json", "or auto"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --envelope sphere",
        BAD_USAGE,
        &["sphere", "give revolution, hull, or a file"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --outline {f}/none.json",
        BAD_USAGE,
        &["none.json", "check the name"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --outline {f}/small.png",
        BAD_USAGE,
        &["small.png", "64x36", "640x360", "draw it"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --outline {f}/black.png",
        BAD_USAGE,
        &["black.png", "nothing in it is white"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --outline {f}/grey.png",
        BAD_USAGE,
        &["grey.png", "has no scribbles", "white strokes"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --outline {f}/clear.png",
        BAD_USAGE,
        &["clear.png", "has no scribbles"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --outline {f}/only-tree.png",
        BAD_USAGE,
        &["only-tree.png", "black strokes"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --outline {f}/only-background.png",
        BAD_USAGE,
        &["only-background", "white strokes"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --outline {f}/photo.png",
        BAD_USAGE,
        &["photo.png", "neither a mask", "scribbles"],
        Nothing,
    ),
    // Configuration.
    (
        "replay {f}/clip.mkv --config {f}/unknown.toml",
        BAD_USAGE,
        &["unknown.toml, line 3", "windw_px", "window_px"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --config {f}/section.toml",
        BAD_USAGE,
        &["section.toml, line 1", "trak", "track"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --config {f}/type.toml",
        BAD_USAGE,
        &["type.toml, line 3", "many", "expected u32"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --config {f}/range.toml",
        BAD_USAGE,
        &["track.window_px = 3", "5 to 61"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --config {f}/even.toml",
        BAD_USAGE,
        &["track.window_px = 16", "odd"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --config {f}/syntax.toml",
        BAD_USAGE,
        &["syntax.toml, line 1"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --config {f}/none.toml",
        BAD_USAGE,
        &["none.toml", "check the name"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --config {f}/nothing",
        BAD_USAGE,
        &["nothing", "it is a folder", "check the name"],
        Nothing,
    ),
    // Options.
    (
        "replay {f}/clip.mkv --markers {f}/half.json",
        BAD_USAGE,
        &[
            "--markers",
            "half.json",
            "it is cut off at line 1",
            "must hold width",
        ],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --trunk {f}/nothing",
        BAD_USAGE,
        &["--trunk", "it is a folder", "give a file, or auto"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --branch-stroke {f}/empty.mkv",
        BAD_USAGE,
        &["--branch-stroke", "it is empty", "polyline_px"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --metres-per-px 1e9",
        BAD_USAGE,
        &["--metres-per-px", "0.000001 to 10"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --tag 100",
        BAD_USAGE,
        &["--tag", "0.005 to 5"],
        Nothing,
    ),
    (
        "capture /dev/video99 --device-timeout 0",
        BAD_USAGE,
        &["--device-timeout", "0.05 to 3600"],
        Nothing,
    ),
    (
        "replay {f}/one --fps 0",
        BAD_USAGE,
        &["--fps 0", "above 0"],
        Nothing,
    ),
    (
        "replay {f}/one --fps fast",
        BAD_USAGE,
        &["fast", "--fps"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --metres-per-px=-1",
        BAD_USAGE,
        &["'-1'", "--metres-per-px", "0.000001 to 10"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --slow",
        BAD_USAGE,
        &["--slow"],
        Nothing,
    ),
    (
        "replay {f}/clip.mkv --stream xml",
        BAD_USAGE,
        &["xml", "--stream"],
        Nothing,
    ),
    ("film {f}/clip.mkv", BAD_USAGE, &["film"], Nothing),
    (
        "forest",
        BAD_USAGE,
        &[
            "no command `forest`",
            "arborcam grow EXAMPLE --count N --forest",
        ],
        Nothing,
    ),
    (
        "anaylze {f}/one",
        BAD_USAGE,
        &["no command `anaylze`", "is `analyze` meant?"],
        Nothing,
    ),
];

#[test]
fn every_bad_input_gets_its_status_and_a_line_and_leaves_nothing_half_done() {
    for &(words, status, says, left) in CASES {
        let mut run = Run::new(words);
        run.command.args(["--headless", "--out", "out"]);
        if words.starts_with("replay") {
            run.command.arg("--fast");
        }
        let output = run.end();
        check(words, &run, &output, status, says, left);
    }
}

/// The message on what is out of range names the option, and not the setting behind it.
#[test]
fn options_are_told_by_their_names() {
    for (words, says) in [
        (
            "animate x --wind 99",
            "'--wind <FORCE>': give a number: 0 (still) to 12",
        ),
        (
            "animate x --wind fast",
            "'--wind <FORCE>': give a number: 0",
        ),
        (
            "animate x --direction 999",
            "'--direction <DEGREES>': give a number: -360 to 360",
        ),
        ("animate x --gusts 2", "'--gusts <SHARE>'"),
        ("animate x --beta 9", "'--beta <BETA>'"),
        (
            "render x --out x.png --planes 99",
            "'--planes <N>': give a whole number: 1 to 8",
        ),
        (
            "render x --out x.png --triangles 1",
            "'--triangles <N>': give a whole number: 100 to",
        ),
        (
            "render x --out x.png --animation-s 0",
            "'--animation-s <SECONDS>': give a number: 0.1 to",
        ),
        (
            "sketch x --out x --planes 0",
            "'--planes <N>': give a whole number: 1 to 8",
        ),
        (
            "grow x --out x --count 0",
            "'--count <N>': give a number from 1 to 100000",
        ),
        (
            "grow x --out x --count 2 --seed x",
            "'--seed <N>': give a whole number",
        ),
        (
            "cloud x --out x --tree 0",
            "'--tree <N>': give a number from 1 on",
        ),
        ("replay x --fps fast", "'--fps <RATE>': give a number"),
    ] {
        let mut run = Run::new(words);
        let output = run.end();
        check(words, &run, &output, BAD_USAGE, &[says], Nothing);
        assert_eq!(
            String::from_utf8_lossy(&output.stderr).lines().count(),
            1,
            "{words}"
        );
    }
}

/// A still picture has no tree in it, but where its points are is known.
#[test]
fn a_clip_without_motion_still_gives_its_tracks() {
    let mut run = Run::new("replay {f}/still.mkv --outline {outline} --fast --headless --out out");
    let output = run.end();
    check("still", &run, &output, FAILED, &["0 points moved"], Tracks);
    let rows = fs::read_to_string(run.out().join("tracks.csv"))
        .expect("tracks.csv")
        .lines()
        .count();
    assert!(
        rows > 75 * 100,
        "75 frames with hundreds of points: {rows} rows"
    );
}

/// What stands in the place of the wanted folder stays as it is.
#[test]
fn a_folder_that_cannot_be_made_is_told_before_anything_is_filmed() {
    for (out, says) in [
        ("mine", &["mine exists already", "choose another"][..]),
        (
            "mine/notes.txt",
            &["mine/notes.txt exists already", "choose another"],
        ),
        (
            "mine/notes.txt/out",
            &["mine/notes.txt", "file", "choose another"],
        ),
        ("mine/link", &["mine/link exists already", "choose another"]),
    ] {
        let mut run = Run::new("replay {f}/clip.mkv --fast --headless --out");
        let mine = run.work.path().join("mine");
        fs::create_dir(&mine).expect("folder");
        fs::write(mine.join("notes.txt"), "keep me").expect("file");
        std::os::unix::fs::symlink("/no/such/place", mine.join("link")).expect("link");
        run.command.arg(out);
        let output = run.end();
        check(out, &run, &output, FAILED, says, Nothing);
        assert_eq!(
            fs::read_to_string(mine.join("notes.txt")).expect("notes"),
            "keep me"
        );
        assert_eq!(fs::read_dir(&mine).expect("mine").count(), 2, "{out}");
    }
}

#[test]
fn what_may_not_be_read_or_written_says_what_to_do() {
    let root =
        fs::metadata("/proc/self").is_ok_and(|m| std::os::unix::fs::MetadataExt::uid(&m) == 0);
    let secret = fixtures().join("secret.mkv");
    fs::copy(CLIP, &secret).expect("copy");
    fs::set_permissions(&secret, fs::Permissions::from_mode(0o000)).expect("chmod");
    for (words, status, says) in [
        (
            "replay {f}/secret.mkv --out out",
            NO_INPUT,
            &["secret.mkv", "chmod +r"][..],
        ),
        (
            "replay {f}/short.mkv --out mine/out",
            FAILED,
            &["not allowed to write", "mine", "choose a place of your own"],
        ),
    ] {
        let mut run = Run::new(words);
        let mine = run.work.path().join("mine");
        fs::create_dir(&mine).expect("folder");
        fs::set_permissions(&mine, fs::Permissions::from_mode(0o555)).expect("chmod");
        run.command.args(["--fast", "--headless"]);
        if root {
            // Root may do everything; nobody may not.
            run.command.uid(65534).gid(65534);
        }
        match run.command.output() {
            Ok(output) => check(words, &run, &output, status, says, Nothing),
            Err(e) => eprintln!("SKIPPED: {words}: the program cannot be run as nobody ({e})"),
        }
    }
}

#[test]
fn a_full_disk_is_told_and_nothing_is_left_on_it() {
    let mut run = Run::new(
        "replay {f}/short.mkv --outline {outline} --fast --headless --config {f}/eager.toml",
    );
    let Some(disk) = SmallDisk::mount("200k") else {
        return;
    };
    let output = run
        .command
        .arg("--out")
        .arg(disk.path("out"))
        .output()
        .expect("arborcam starts");
    check(
        "full disk",
        &run,
        &output,
        FAILED,
        &["No space left", "free some space"],
        Nothing,
    );
    assert_eq!(
        fs::read_dir(disk.dir()).expect("disk").count(),
        0,
        "nothing is left on the disk"
    );
}

#[test]
fn without_a_terminal_the_screen_is_refused_at_once() {
    let mut run = Run::new("replay {f}/clip.mkv --fast --out out");
    let output = run.end();
    check(
        "no terminal",
        &run,
        &output,
        BAD_USAGE,
        &["no terminal", "use --headless"],
        Nothing,
    );
}

/// `arborcam ... --stream ndjson | head -1` has done its work when the reader has gone.
#[test]
fn a_reader_that_goes_away_ends_the_stream_quietly() {
    let mut run = Run::new(
        "replay {f}/clip.mkv --outline {outline} --fast --stream ndjson --config {f}/eager.toml --out out",
    );
    let mut child = run
        .command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("arborcam starts");
    let mut line = String::new();
    let mut reader = BufReader::with_capacity(64, child.stdout.take().expect("pipe"));
    reader.read_line(&mut line).expect("a line");
    drop(reader);
    assert!(line.starts_with("{\"frame\":"), "{line}");
    let output = child.wait_with_output().expect("end");
    check("| head -1", &run, &output, DONE, &[], Model);
}

/// Ctrl-C in the middle: what was seen until then is a whole capture. `timeout` signals the program and then
/// its group: that is one end.
#[test]
fn a_replay_that_is_stopped_keeps_what_it_has() {
    for (signal, times) in [("INT", 1), ("TERM", 1), ("TERM", 2)] {
        let mut run = Run::new(
            "replay {f}/clip.mkv --outline {outline} --stream ndjson --config {f}/eager.toml --out out",
        );
        let mut child = run
            .command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("arborcam starts");
        let mut poses = BufReader::new(child.stdout.take().expect("pipe")).lines();
        poses.next().expect("a pose").expect("a line");
        for _ in 0..times {
            Command::new("kill")
                .args(["-s", signal, &child.id().to_string()])
                .status()
                .expect("kill");
        }
        let streamed = 1 + poses.map_while(Result::ok).count() as u64;
        let output = child.wait_with_output().expect("end");
        check(signal, &run, &output, STOPPED, &[], Model);
        let text = fs::read_to_string(run.out().join("capture.json")).expect("capture.json");
        let capture: serde_json::Value = serde_json::from_str(&text).expect("json");
        let seen = capture["timing"]["frames_seen"]
            .as_u64()
            .expect("frames_seen");
        assert!(
            seen >= streamed && seen < 330,
            "SIG{signal}: {seen} frames seen, {streamed} streamed"
        );
    }
}

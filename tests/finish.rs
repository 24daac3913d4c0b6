//! A run that was cut: what was filmed is kept, and `arborcam finish` completes it.

#[path = "support/small_disk.rs"]
mod small_disk;
mod support;

use small_disk::SmallDisk;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use support::{CLIP, OUTLINE};
use tempfile::TempDir;

/// What has not happened after so long will not.
const HANGS: Duration = Duration::from_secs(60);
const TABLES: [&str; 5] = [
    "tracks.csv",
    "camera.csv",
    "left_out.csv",
    "nodes.csv",
    "motion.csv",
];
const PICTURES: [&str; 4] = ["bark.png", "rest.png", "wood.png", "leaves.png"];

/// A replay in a process of its own.
struct Run {
    child: Child,
    out: PathBuf,
}

impl Run {
    fn start(out: &Path, more: &[&str]) -> Self {
        let child = Command::new(env!("CARGO_BIN_EXE_arborcam"))
            .args(["replay", CLIP, "--outline", OUTLINE, "--headless"])
            .args(more)
            .arg("--out")
            .arg(out)
            .stderr(Stdio::piped())
            .spawn()
            .expect("arborcam starts");
        Self {
            child,
            out: out.to_owned(),
        }
    }

    fn unfinished(&self) -> PathBuf {
        PathBuf::from(format!("{}.unfinished", self.out.display()))
    }

    fn wait_until_it_films(&self) {
        let began = Instant::now();
        while !self.unfinished().join("tracks.log").exists() {
            assert!(began.elapsed() < HANGS, "it does not film");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn end(self) -> Output {
        self.child.wait_with_output().expect("it ends")
    }
}

fn finish(out: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_arborcam"))
        .arg("finish")
        .arg(out)
        .output()
        .expect("arborcam starts")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn temporary() -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().expect("tempdir");
    let out = dir.path().join("out");
    (dir, out)
}

/// Time of the last row of `tracks.csv`, s.
fn filmed_s(out: &Path) -> f64 {
    let text = fs::read_to_string(out.join("tracks.csv")).expect("tracks.csv");
    let last = text.lines().last().expect("a row");
    let time_s = last.split(',').nth(2).and_then(|cell| cell.parse().ok());
    time_s.expect("a time")
}

/// The battery is empty, the process is killed: no more than a second of film is lost.
#[test]
fn a_run_that_is_killed_is_finished_from_its_log() {
    let (_dir, out) = temporary();
    let mut run = Run::start(&out, &[]);
    run.wait_until_it_films();
    let filmed = Duration::from_millis(10_000);
    std::thread::sleep(filmed);
    let unfinished = run.unfinished();
    let busy = finish(&out);
    assert_eq!(busy.status.code(), Some(1));
    assert!(
        said(&busy).contains("still being filmed"),
        "{}",
        said(&busy)
    );
    run.child.kill().expect("kill -9");
    run.end();
    assert!(unfinished.is_dir() && !out.exists());

    let again = Run::start(&out, &["--fast"]).end();
    assert_eq!(again.status.code(), Some(1), "{}", said(&again));
    assert!(said(&again).contains("arborcam finish"), "{}", said(&again));

    let done = finish(&out);
    assert!(done.status.success(), "{}", said(&done));
    assert!(!unfinished.exists(), "nothing is left to finish");
    for file in TABLES
        .iter()
        .chain(&["tree.glb", "capture.json", "frame.jpg"])
    {
        assert!(out.join(file).is_file(), "{file}");
    }
    let kept_s = filmed_s(&out);
    assert!(
        kept_s > filmed.as_secs_f64() - 1.5,
        "{kept_s} s of {filmed:?} are kept"
    );
}

/// What a finished log gives is what the run itself would have given.
#[test]
fn a_finished_log_is_the_capture_of_the_run() {
    let (_dir, out) = temporary();
    let run = Run::start(&out, &["--fast"]);
    run.wait_until_it_films();
    // Somebody takes the name meanwhile: the capture cannot be written.
    fs::create_dir(&out).expect("folder");
    let unfinished = run.unfinished();
    let output = run.end();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(
        said(&output).contains("what was filmed is kept"),
        "{}",
        said(&output)
    );
    fs::remove_dir(&out).expect("folder");
    // The folder itself may be named as well.
    let done = finish(&unfinished);
    assert!(done.status.success(), "{}", said(&done));

    let (_whole_dir, whole) = temporary();
    assert!(Run::start(&whole, &["--fast"]).end().status.success());
    for file in TABLES.iter().chain(&PICTURES) {
        let [a, b] = [&out, &whole].map(|dir| fs::read(dir.join(file)).expect(file));
        assert!(a == b, "{file} differs");
    }
}

/// A run that has filmed on the disk for ten seconds.
fn filming(disk: &SmallDisk) -> Run {
    let run = Run::start(&disk.path("out"), &[]);
    run.wait_until_it_films();
    std::thread::sleep(Duration::from_secs(10));
    run
}

/// Fills the disk to its last page.
fn fill(filler: &mut fs::File) {
    while filler.write_all(&[0; 1 << 12]).is_ok() {}
}

/// Something else fills the disk while a tree is filmed: the results have their space.
#[test]
fn a_disk_that_fills_up_ends_the_film_and_not_the_capture() {
    let Some(disk) = SmallDisk::mount("100m") else {
        return;
    };
    let run = filming(&disk);
    let out = run.out.clone();
    fill(&mut fs::File::create(disk.path("filler")).expect("filler"));
    let unfinished = run.unfinished();
    let output = run.end();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("No space left"), "{}", said(&output));
    assert!(out.join("tree.glb").is_file(), "{}", said(&output));
    let filmed_s = filmed_s(&out);
    assert!(filmed_s > 8.0, "{filmed_s}: {}", said(&output));
    assert!(!unfinished.exists(), "{}", said(&output));
}

/// The other program takes whatever is given free, until the capture has given up: what was filmed
/// is there when the disk has room again.
#[test]
fn a_disk_that_stays_full_costs_nothing_that_was_filmed() {
    let Some(disk) = SmallDisk::mount("100m") else {
        return;
    };
    let run = filming(&disk);
    let out = run.out.clone();
    let ended = AtomicBool::new(false);
    let filler_path = disk.path("filler");
    let unfinished = run.unfinished();
    let output = std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut filler = fs::File::create(&filler_path).expect("filler");
            while !ended.load(Ordering::SeqCst) {
                fill(&mut filler);
                std::thread::yield_now();
            }
        });
        let output = run.end();
        ended.store(true, Ordering::SeqCst);
        output
    });
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(
        said(&output).contains("what was filmed is kept"),
        "{}",
        said(&output)
    );
    assert!(unfinished.is_dir() && !out.exists(), "{}", said(&output));
    fs::remove_file(&filler_path).expect("filler");
    let done = finish(&out);
    assert!(done.status.success(), "{}", said(&done));
    let filmed_s = filmed_s(&out);
    assert!(filmed_s > 8.0, "{filmed_s}: {}", said(&output));
}

#[test]
fn what_cannot_be_finished_is_refused_with_a_reason() {
    let (dir, out) = temporary();
    let unfinished = dir.path().join("out.unfinished");
    let refused = |reason: &str| {
        let output = finish(&out);
        assert_eq!(output.status.code(), Some(1));
        assert!(
            said(&output).contains(reason),
            "{reason}: {}",
            said(&output)
        );
        assert_eq!(said(&output).lines().count(), 1, "{}", said(&output));
        assert!(!out.exists());
    };
    refused("nothing to finish");
    fs::create_dir(&unfinished).expect("folder");
    refused("nothing to finish");
    fs::write(unfinished.join("tracks.log"), "no log at all").expect("file");
    refused("no track log");
    fs::write(unfinished.join("tracks.log"), b"arborlog\x02\0\0\0").expect("file");
    refused("cannot be finished");
    fs::write(unfinished.join("capture.json"), "{}").expect("file");
    refused("cannot be finished");
    assert!(
        unfinished.join("tracks.log").exists(),
        "nothing is taken away"
    );
}

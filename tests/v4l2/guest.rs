//! The virtual machine: made once, booted once a group, its results read from a folder.

use arborcam::config::Config;
use arborcam::model::RawFrame;
use arborcam::recording::{Head, Limits, Series};
use arborcam::source;
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, Once};

const PREPARE: &str = "tests/vm/prepare.sh";
const RUN: &str = "tests/vm/run";
/// A group's folder is in here, and stays until its next run.
const RUNS: &str = "target/vm-runs";

/// Cases that share a boot.
pub struct Group {
    pub name: &'static str,
    /// Run in the guest with the program and this binary as arguments; in tests/vm/guest.
    pub script: &'static str,
    /// First process of the guest: `script`, or `systemd`.
    pub first: &'static str,
    /// The guest is ended after so long.
    pub limit_s: u32,
    /// Puts what the script needs into the group's folder.
    pub provide: fn(&Path) -> Result<(), String>,
    pub cases: &'static [super::Case],
}

/// The machine, or why there is none.
pub struct Guest {
    absent: Option<String>,
    /// Two cores: a second guest beside the first would make both too slow to judge.
    one_at_a_time: Mutex<()>,
}

impl Guest {
    /// For a list of the cases.
    pub fn unused() -> Self {
        Self {
            absent: None,
            one_at_a_time: Mutex::new(()),
        }
    }

    /// Makes the machine if it is not there.
    pub fn prepare() -> Self {
        let made = Command::new(PREPARE).stdin(Stdio::null()).output();
        let absent = match made {
            Err(e) => Some(format!("{PREPARE}: {e}")),
            Ok(done) if done.status.success() => None,
            Ok(done) => Some(String::from_utf8_lossy(&done.stderr).trim().to_owned()),
        };
        Self {
            absent,
            ..Self::unused()
        }
    }

    /// No machine, and none is demanded.
    pub fn is_absent(&self) -> bool {
        self.absent.is_some() && !demanded()
    }

    /// The line that must not be overlooked, on the real standard error.
    pub fn say_absent(&self) {
        if let Some(why) = &self.absent {
            let line = "=".repeat(80);
            let text = format!(
                "{line}\nTHE V4L2 TESTS WERE NOT RUN: no virtual machine.\n{why}\n{line}\n"
            );
            let _ = std::io::stderr().write_all(text.as_bytes());
            // `make test` repeats it after the other tests.
            let _ = fs::create_dir_all(RUNS);
            let _ = fs::write(Path::new(RUNS).join("absent"), text);
        }
    }

    /// Boots the guest for `group`; the group's folder.
    pub fn run(&self, group: &Group) -> Result<Results, String> {
        if let Some(why) = &self.absent {
            return Err(format!("there is no virtual machine: {why}"));
        }
        let _alone = self
            .one_at_a_time
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        let folder = Path::new(RUNS).join(group.name);
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        (group.provide)(&folder)?;
        let script = fs::canonicalize(Path::new("tests/vm/guest").join(group.script))
            .map_err(|e| e.to_string())?;
        // Another build may be put to the test, to find out which one brought a fault.
        let program = std::env::var_os("ARBORCAM_VM_PROGRAM")
            .unwrap_or_else(|| env!("CARGO_BIN_EXE_arborcam").into());
        let own = std::env::current_exe().map_err(|e| e.to_string())?;
        let ran = Command::new(RUN)
            .args(["-i", group.first, "-t", &group.limit_s.to_string()])
            .args([&folder, &script, &PathBuf::from(program), &own])
            .stdin(Stdio::null())
            .output()
            .map_err(|e| format!("{RUN}: {e}"))?;
        let said = format!(
            "{}{}",
            String::from_utf8_lossy(&ran.stdout),
            String::from_utf8_lossy(&ran.stderr)
        );
        if ran.status.success() {
            let _ = write!(
                std::io::stderr(),
                "{}",
                String::from_utf8_lossy(&ran.stdout)
            );
            return Ok(Results::of(folder));
        }
        // Once, not with every case.
        let _ = writeln!(std::io::stderr(), "{said}");
        Results::of(folder.clone()).say_stacks();
        Err(format!(
            "the guest's script failed; what it left is in {}",
            folder.display()
        ))
    }
}

fn demanded() -> bool {
    ["CI", "ARBORCAM_REQUIRE_VM"]
        .iter()
        .any(|name| std::env::var_os(name).is_some_and(|v| !v.is_empty()))
}

/// What a group's script wrote to its folder, `/vm` in the guest.
pub struct Results {
    folder: PathBuf,
    stacks: Once,
}

impl Results {
    fn of(folder: PathBuf) -> Self {
        Self {
            folder,
            stacks: Once::new(),
        }
    }

    /// Where every thread was when something stood still in the guest, once, on the real standard
    /// error: what went wrong is rarely seen again when it is looked for.
    pub fn say_stacks(&self) {
        self.stacks.call_once(|| {
            let text = fs::read(self.path("stacks")).unwrap_or_default();
            let _ = std::io::stderr().write_all(&text);
        });
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    pub fn text(&self, name: &str) -> Result<String, String> {
        fs::read_to_string(self.path(name))
            .map_err(|e| format!("{}: {e}", self.path(name).display()))
    }

    /// A file with one number.
    pub fn number(&self, name: &str) -> Result<f64, String> {
        let text = self.text(name)?;
        text.trim()
            .parse()
            .map_err(|_| format!("{name} is no number: {text}"))
    }

    /// Seconds between two of a case's moments, each a file.
    pub fn seconds(&self, case: &str, from: &str, to: &str) -> Result<f64, String> {
        Ok(self.number(&format!("{case}/{to}"))? - self.number(&format!("{case}/{from}"))?)
    }

    /// Exit status of a case, `hung` if it had to be killed.
    pub fn status(&self, case: &str) -> Result<String, String> {
        Ok(self.text(&format!("{case}/status"))?.trim().to_owned())
    }

    pub fn messages(&self, case: &str) -> Result<String, String> {
        self.text(&format!("{case}/stderr"))
    }

    /// `capture.json` of a case.
    pub fn capture(&self, case: &str) -> Result<Value, String> {
        let text = self.text(&format!("{case}/capture/capture.json"))?;
        serde_json::from_str(&text).map_err(|e| format!("{case}: {e}"))
    }

    /// A count of the case's timing.
    pub fn count(&self, case: &str, name: &str) -> Result<u64, String> {
        let capture = self.capture(case)?;
        capture["timing"][name]
            .as_u64()
            .ok_or_else(|| format!("{case}: no count {name} in {}", capture["timing"]))
    }
}

/// The shipped recording, small enough for an emulated processor: `clip.mjpg`, pictures one after
/// the other, and the same in `clip.mkv`.
pub fn clip(folder: &Path) -> Result<(), String> {
    let film = |input: &Path, output: &Path, how: &[&str]| -> Result<(), String> {
        let run = Command::new("ffmpeg")
            .args(["-v", "error", "-y", "-i"])
            .arg(input)
            .args(how)
            .arg(output)
            .stdin(Stdio::null())
            .output()
            .map_err(|e| format!("ffmpeg: {e}"))?;
        claim(run.status.success(), || {
            String::from_utf8_lossy(&run.stderr).into_owned()
        })
    };
    let pictures = folder.join("clip.mjpg");
    // Tables as every camera sends them.
    let small = [
        "-vf",
        "scale=320:180",
        "-c:v",
        "mjpeg",
        "-q:v",
        "3",
        "-huffman",
        "default",
        "-f",
        "mjpeg",
    ];
    film(Path::new("recordings/sparse_winter.mkv"), &pictures, &small)?;
    film(&pictures, &folder.join("clip.mkv"), &["-c", "copy"])
}

/// The frames of a recording or a video file.
pub fn frames_of(path: &Path) -> Result<Vec<RawFrame>, String> {
    let mut source = source::open(path, &Config::default(), None).map_err(|e| e.to_string())?;
    let mut frames = Vec::new();
    while let Some(frame) = source.next_frame().map_err(|e| e.to_string())? {
        frames.push(frame);
    }
    Ok(frames)
}

/// Makes a recording of `frames`.
pub fn record(path: &Path, frames: &[RawFrame]) -> Result<(), String> {
    let mut series = Series::create(path, Head::default(), Limits::default(), || 0)
        .map_err(|e| e.to_string())?;
    for (raw, index) in frames.iter().zip(0..) {
        series.frame(raw, index).map_err(|e| e.to_string())?;
    }
    series.close().map_err(|e| e.to_string())
}

/// From the wish to stop to the end, s: five for what may be given up, the rest for what must be
/// built and written. The scripts wait twice as long, so that it can be measured.
pub fn end_limit_s() -> f64 {
    10.0 * slack()
}

/// By how much a time that holds for a real machine may be exceeded: an emulated processor is many
/// times slower, and shares the host with whatever else runs there.
pub fn slack() -> f64 {
    if is_emulated() { 2.0 } else { 1.0 }
}

/// Whether the guest's processor is an emulated one.
pub fn is_emulated() -> bool {
    fs::read_to_string("target/vm/accelerator").is_ok_and(|text| text.contains("tcg"))
}

/// Fails with what was found, unless `holds`.
pub fn claim(holds: bool, otherwise: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(otherwise()) }
}

//! The service: what a service manager is told, what a hang-up does, what the unit's helper does,
//! what is installed.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::{PermissionsExt, chown, symlink};
use std::os::unix::net::UnixDatagram;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tempfile::TempDir;

const CLIP: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/sparse_winter.mkv");
const OUTLINE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/recordings/sparse_winter.outline.json"
);
/// Longest wait for anything here.
const PATIENCE: Duration = Duration::from_secs(60);

/// Ends what a failing test would leave running.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Running {
    fn signal(&self, signal: &str) {
        let status = Command::new("kill")
            .args([signal, &self.0.id().to_string()])
            .status();
        assert!(status.expect("kill").success());
    }

    fn end(mut self) -> Option<i32> {
        self.0.wait().expect("end").code()
    }
}

/// A service manager's ear.
struct Manager {
    dir: TempDir,
    socket: UnixDatagram,
    /// Times are told here: one capture at a time.
    _alone: MutexGuard<'static, ()>,
}

impl Manager {
    fn new() -> Self {
        static ALONE: Mutex<()> = Mutex::new(());
        let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let dir = tempfile::tempdir().expect("tempdir");
        let socket = UnixDatagram::bind(dir.path().join("notify")).expect("socket");
        Self {
            dir,
            socket,
            _alone,
        }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    /// A replay at its own pace, in a session of its own and so without a terminal, with a watchdog
    /// of 4 s.
    fn start(&self, more: &[&str]) -> Running {
        let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
        command
            .args(["replay", CLIP, "--outline", OUTLINE, "--headless", "--out"])
            .arg(self.at("out"))
            .args(more);
        self.spawn(&mut command)
    }

    /// Starts a program as the service manager would.
    fn spawn(&self, command: &mut Command) -> Running {
        command
            .env("NOTIFY_SOCKET", self.at("notify"))
            .env("WATCHDOG_USEC", "4000000")
            .env_remove("WATCHDOG_PID");
        command
            .stdin(Stdio::null())
            .stderr(fs::File::create(self.at("stderr")).expect("file"));
        // SAFETY: setsid is safe to call between fork and exec.
        unsafe {
            command.pre_exec(|| {
                if libc::setsid() < 0 {
                    Err(std::io::Error::last_os_error())
                } else {
                    Ok(())
                }
            });
        }
        Running(command.spawn().expect("arborcam"))
    }

    /// Lines that come until one begins with `wanted`, that one included; with `None` those of a
    /// time.
    fn hear(&self, wanted: Option<&str>, limit: Duration) -> Vec<String> {
        let (until, mut heard, mut bytes) = (Instant::now() + limit, Vec::new(), [0; 4096]);
        loop {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                assert!(
                    wanted.is_none(),
                    "no {wanted:?} in {heard:#?}; {}",
                    self.stderr()
                );
                return heard;
            }
            self.socket
                .set_read_timeout(Some(left))
                .expect("time limit");
            let Ok(n) = self.socket.recv(&mut bytes) else {
                continue;
            };
            heard.extend(
                String::from_utf8_lossy(&bytes[..n])
                    .lines()
                    .map(str::to_owned),
            );
            if wanted.is_some_and(|w| heard.iter().any(|line| line.starts_with(w))) {
                return heard;
            }
        }
    }

    fn stderr(&self) -> String {
        fs::read_to_string(self.at("stderr")).unwrap_or_default()
    }
}

fn holds(lines: &[String], start: &str) -> bool {
    lines.iter().any(|line| line.starts_with(start))
}

#[test]
fn ready_when_frames_flow_alive_while_they_do_and_stopping_while_it_writes() {
    let manager = Manager::new();
    let running = manager.start(&[]);
    let before = manager.hear(Some("READY=1"), PATIENCE);
    assert!(
        !holds(&before, "WATCHDOG=1"),
        "alive before a frame came: {before:?}"
    );
    let flowing = manager.hear(None, Duration::from_secs(3));
    assert!(
        flowing.iter().filter(|l| *l == "WATCHDOG=1").count() >= 2,
        "{flowing:?}"
    );
    let state = flowing
        .iter()
        .rev()
        .find_map(|l| l.strip_prefix("STATUS="))
        .expect("a line of state");
    assert!(
        state.contains(" a second, 0 lost, ") && state.contains(" points"),
        "{state}"
    );
    let asked = Instant::now();
    running.signal("-TERM");
    let ending = manager.hear(Some("STOPPING=1"), PATIENCE);
    assert!(!holds(&ending, "READY=1"), "{ending:?}");
    assert_eq!(running.end(), Some(130), "{}", manager.stderr());
    assert!(
        asked.elapsed() < Duration::from_secs(2),
        "the end took {:?}",
        asked.elapsed()
    );
    assert!(manager.at("out/capture.json").is_file() && manager.at("out/tracks.csv").is_file());
}

/// A program that hangs must look like one: the watchdog is fed by work and not by a timer.
#[test]
fn a_program_that_hangs_gives_no_sign_of_life() {
    let manager = Manager::new();
    let running = manager.start(&[]);
    manager.hear(Some("WATCHDOG=1"), PATIENCE);
    running.signal("-STOP");
    manager.hear(None, Duration::from_millis(200));
    assert_eq!(
        manager.hear(None, Duration::from_secs(2)),
        Vec::<String>::new()
    );
    running.signal("-CONT");
    manager.hear(Some("WATCHDOG=1"), PATIENCE);
}

#[test]
fn a_length_ends_the_capture_by_itself() {
    let manager = Manager::new();
    let running = manager.start(&["--for", "1.5", "--config", "/dev/null"]);
    manager.hear(Some("STOPPING=1"), PATIENCE);
    // Nobody has stopped it: done, as at the end of a clip.
    assert_eq!(running.end(), Some(0), "{}", manager.stderr());
    let capture = fs::read_to_string(manager.at("out/capture.json")).expect("capture");
    let capture: serde_json::Value = serde_json::from_str(&capture).expect("JSON");
    let seconds = capture["timing"]["duration_s"].as_f64().expect("duration");
    // Frames that wait between the threads when the time is up are taken in as well.
    assert!((1.4..5.0).contains(&seconds), "{seconds}");
}

#[test]
fn a_hang_up_without_a_terminal_reads_the_settings_again() {
    let manager = Manager::new();
    let settings = manager.at("arborcam.toml");
    fs::write(&settings, "[camera]\ntimeout_s = 3.5\n").expect("settings");
    let running = manager.start(&["--config", settings.to_str().expect("path")]);
    manager.hear(Some("READY=1"), PATIENCE);
    let reload = |text: &str| {
        fs::write(&settings, text).expect("settings");
        running.signal("-HUP");
        let heard = manager.hear(Some("RELOADING=1"), PATIENCE);
        if !holds(&heard, "READY=1") {
            manager.hear(Some("READY=1"), PATIENCE);
        }
    };
    reload("[camera]\ntimeout_s = 2.5\n[detect]\npoints = 50\n");
    reload("[camera]\ntimeout_s = -2.0\n");
    running.signal("-TERM");
    assert_eq!(
        running.end(),
        Some(130),
        "a hang-up must not end it: {}",
        manager.stderr()
    );
    let said = manager.stderr();
    for line in [
        "reload: camera.timeout_s is now 2.5 (was 3.5)",
        "reload: detect.points stays 400; 50 counts from the next start: the points that are followed",
        "camera.timeout_s = -2 is out of range; allowed: 0.05 to 3600; nothing is changed",
    ] {
        assert!(said.contains(line), "no {line:?} in {said}");
    }
    let capture: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(manager.at("out/capture.json")).expect("capture"))
            .expect("JSON");
    let config = &capture["config"];
    assert_eq!(
        (
            config["camera"]["timeout_s"].as_f64(),
            config["detect"]["points"].as_u64()
        ),
        (Some(2.5), Some(400))
    );
}

/// The unit's helper, with a program that only says how it was called.
struct Helper {
    dir: TempDir,
}

impl Helper {
    fn new() -> Self {
        let dir = tempfile::tempdir().expect("tempdir");
        for name in ["state", "run"] {
            fs::create_dir(dir.path().join(name)).expect("folder");
        }
        let program = dir.path().join("arborcam");
        fs::write(&program, "#!/bin/sh\nprintf '%s\\n' \"$@\"\n").expect("program");
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("chmod");
        Self { dir }
    }

    /// Its program films as before, and completes captures as the real one does.
    fn finishes_with(&self, program: &str) {
        let text = format!(
            "#!/bin/sh\n[ $1 != finish ] || exec {program} \"$@\"\nprintf '%s\\n' \"$@\"\n"
        );
        fs::write(self.dir.path().join("arborcam"), text).expect("program");
    }

    fn run(&self, verb: &str, set: &[(&str, &str)]) -> Output {
        let at = |name: &str| self.dir.path().join(name);
        let mut command = Command::new("systemd/arborcam-service");
        command.args([verb, "/dev/v4l/by-id/usb-A_cam-video-index0"]);
        command
            .env("STATE_DIRECTORY", at("state"))
            .env("RUNTIME_DIRECTORY", at("run"));
        command
            .env("ARBORCAM_BIN", at("arborcam"))
            .env("ARBORCAM_LENGTH_S", "300")
            .envs(set.iter().copied());
        let output = command.output().expect("helper");
        assert!(
            output.status.success(),
            "{verb}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        output
    }

    fn state(&self) -> PathBuf {
        self.dir.path().join("state/usb-A_cam-video-index0")
    }

    /// What is in the camera's folder.
    fn names(&self) -> BTreeSet<String> {
        let entries = fs::read_dir(self.state()).expect("folder").flatten();
        entries
            .map(|e| e.file_name().to_string_lossy().into_owned())
            .collect()
    }
}

#[test]
fn each_start_names_its_own_capture() {
    let helper = Helper::new();
    let output = helper.run(
        "run",
        &[
            ("ARBORCAM_RECORD", "yes"),
            ("ARBORCAM_ARGS", "--config /etc/arborcam/a.toml"),
        ],
    );
    let said = String::from_utf8(output.stdout).expect("text");
    let words: Vec<&str> = said.lines().collect();
    let state = helper.state().display().to_string();
    assert_eq!(
        words[..4],
        [
            "capture",
            "/dev/v4l/by-id/usb-A_cam-video-index0",
            "--headless",
            "--out"
        ]
    );
    let name = words[4]
        .strip_prefix(&format!("{state}/"))
        .expect("in the state folder");
    assert!(
        name.len() == 20 && name.ends_with('Z') && name.as_bytes()[10] == b'T',
        "{name}"
    );
    let recording = format!("{}.mcap", words[4]);
    let expected = [
        "--for",
        "300",
        "--record",
        recording.as_str(),
        "--config",
        "/etc/arborcam/a.toml",
    ];
    assert_eq!(words[5..], expected);
}

/// A full disk must not end the filming, and nothing that the user has named may go.
#[test]
fn the_oldest_captures_make_room_and_nothing_else_does() {
    let helper = Helper::new();
    let mine = ["2024-01-01T00-00-00Z", "2024-01-02T00-00-00Z"];
    let kept = ["the good one", "2024-01-01T00-00-00Z keep", "notes.mcap"];
    for name in mine
        .iter()
        .chain(&kept)
        .chain(&[".2024-01-03T00-00-00Z.partial-17"])
    {
        fs::create_dir_all(helper.state().join(name)).expect("folder");
    }
    fs::write(helper.state().join("2024-01-01T00-00-00Z.mcap"), "").expect("file");
    // Some capture that was killed before it was written has left a recording alone.
    fs::write(helper.state().join("2023-12-31T00-00-00Z.mcap"), "").expect("file");
    helper.run("before", &[("ARBORCAM_KEEP_FREE_MB", "1")]);
    assert_eq!(
        helper.names().len(),
        7,
        "there is room, and only the half-written one goes: {:?}",
        helper.names()
    );
    helper.run("before", &[("ARBORCAM_KEEP_FREE_MB", "0")]);
    assert_eq!(helper.names().len(), 7, "told to remove nothing");
    let output = helper.run("before", &[("ARBORCAM_KEEP_FREE_MB", "999999999999")]);
    assert_eq!(
        helper.names(),
        kept.iter().map(|k| (*k).to_owned()).collect()
    );
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let at = |what: &str| {
        said.find(what)
            .unwrap_or_else(|| panic!("no {what} in {said}"))
    };
    assert!(
        at("2023-12-31") < at("2024-01-01") && at("2024-01-01") < at("2024-01-02"),
        "oldest first: {said}"
    );
    assert!(said.contains("no older capture is left"), "{said}");
}

/// What the service made is removed by its exact name; whatever else begins like it is the user's.
#[test]
fn only_names_that_the_service_gave_are_removed() {
    let helper = Helper::new();
    let elsewhere = helper.dir.path().join("elsewhere");
    let own_folders = [
        "2024-01-01T00-00-00Z",
        "2024-01-02T00-00-00Z.unfinished",
        ".2024-01-03T00-00-00Z.partial-17",
        ".2024-01-03T00-00-00Z.partial-17-2",
    ];
    let own_files = [
        "2024-01-01T00-00-00Z.mcap",
        "2024-01-01T00-00-00Z-1.mcap",
        "2024-01-01T00-00-00Z-12.mcap",
    ];
    let kept_folders = [
        "2024-01-01T00-00-00Z keep",
        "2024-01-02T00-00-00Z keep.unfinished",
        "2024-01-02T00-00-00Z.unfinished-1",
        "2024-01-01T00-00-00Z-1",
        "storm 2024-01-01T00-00-00Z",
        // A recording is a file.
        "2024-01-04T00-00-00Z.mcap",
        ".notes.partial-1",
        ".2024-01-01T00-00-00Z.partial-mine",
        ".2024-01-01T00-00-00Z.partial-17-mine",
    ];
    let kept_files = [
        "2024-01-01T00-00-00Z keep.mcap",
        "2024-01-01T00-00-00Z-storm.mcap",
        "2024-01-01T00-00-00Z-1-storm.mcap",
        "2024-01-01T00-00-00Z-01.mcap",
        "2024-01-01T00-00-00Z-.mcap",
        "2024-01-01T00-00-00Z_1.mcap",
        "2024-01-01T00-00-00Z.mcap.mcap",
        "2024-01-01T00-00-00Z.mcap\n2024-01-01T00-00-00Z.mcap",
        // No time of the day.
        "2024-01-01T99-00-00Z.mcap",
        // A capture is a folder.
        "2024-01-05T00-00-00Z",
        ".2024-01-05T00-00-00Z.partial-17",
    ];
    let kept_links = [
        "2024-01-06T00-00-00Z",
        "2024-01-06T00-00-00Z.mcap",
        ".2024-01-06T00-00-00Z.partial-17",
    ];
    for name in own_folders.iter().chain(&kept_folders) {
        fs::create_dir_all(helper.state().join(name)).expect("folder");
    }
    for name in own_files.iter().chain(&kept_files) {
        fs::write(helper.state().join(name), "film").expect("file");
    }
    fs::create_dir(&elsewhere).expect("folder");
    fs::write(elsewhere.join("film"), "film").expect("file");
    for name in kept_links {
        symlink(&elsewhere, helper.state().join(name)).expect("link");
    }
    let mut kept: BTreeSet<String> = [&kept_folders[..], &kept_files, &kept_links]
        .concat()
        .into_iter()
        .map(str::to_owned)
        .collect();
    // Only root can give a file to somebody else.
    let foreign = "2024-01-07T00-00-00Z.mcap";
    fs::write(helper.state().join(foreign), "film").expect("file");
    if chown(helper.state().join(foreign), Some(65_534), None).is_ok() {
        kept.insert(foreign.to_owned());
    }
    helper.run("before", &[("ARBORCAM_KEEP_FREE_MB", "999999999999")]);
    assert_eq!(helper.names(), kept);
    assert!(elsewhere.join("film").is_file(), "a link was followed");
}

/// The helper knows the names of the program: what a killed run leaves is found again and completed.
#[test]
fn what_a_killed_program_has_filmed_is_completed() {
    let manager = Manager::new();
    let helper = Helper::new();
    let start = helper.state().join("2024-01-01T00-00-00Z");
    let recording = helper.state().join("2024-01-01T00-00-00Z.mcap");
    fs::create_dir(helper.state()).expect("folder");
    let arguments = [
        "replay",
        CLIP,
        "--outline",
        OUTLINE,
        "--headless",
        "--max-time",
        "1s",
    ];
    let running = manager.spawn(
        Command::new(env!("CARGO_BIN_EXE_arborcam"))
            .args(arguments)
            .arg("--out")
            .arg(&start)
            .arg("--record")
            .arg(&recording),
    );
    manager.hear(Some("READY=1"), PATIENCE);
    let note = helper
        .state()
        .join("2024-01-01T00-00-00Z.unfinished/capture.json");
    let second_file = helper.state().join("2024-01-01T00-00-00Z-1.mcap");
    let until = Instant::now() + PATIENCE;
    while !(note.exists() && second_file.exists()) {
        assert!(Instant::now() < until, "{}", manager.stderr());
        std::thread::sleep(Duration::from_millis(50));
    }
    running.signal("-KILL");
    running.end();
    helper.finishes_with(env!("CARGO_BIN_EXE_arborcam"));
    // The output ends when all that was begun has ended.
    helper.run("run", &[]);
    assert!(start.join("tracks.csv").is_file(), "{:?}", helper.names());
    let mut left = helper.names();
    left.remove("2024-01-01T00-00-00Z");
    assert!(left.iter().all(|name| name.ends_with(".mcap")), "{left:?}");
    helper.run("before", &[("ARBORCAM_KEEP_FREE_MB", "999999999999")]);
    assert_eq!(helper.names(), BTreeSet::new());
}

/// The pause grows as long as starts fail, and a long run or a good end makes an end of it.
#[test]
fn failures_are_counted_until_something_works() {
    let helper = Helper::new();
    let file = helper.dir.path().join("run/failures");
    let count = || {
        fs::read_to_string(&file)
            .expect("count")
            .split(' ')
            .next()
            .map(str::to_owned)
            .expect("number")
    };
    for n in ["1", "2", "3"] {
        helper.run("run", &[]);
        helper.run("after", &[("SERVICE_RESULT", "exit-code")]);
        assert_eq!(count(), n);
    }
    fs::write(&file, "3 1000000\n").expect("write");
    helper.run("after", &[("SERVICE_RESULT", "watchdog")]);
    assert_eq!(count(), "1", "it had run for long");
    helper.run("run", &[]);
    helper.run("after", &[("SERVICE_RESULT", "success")]);
    assert_eq!(count(), "0");
    let began = Instant::now();
    helper.run("before", &[]);
    assert!(
        began.elapsed() < Duration::from_secs(4),
        "no pause without a failure"
    );
}

const INSTALLED: &[&str] = &[
    "usr/bin/arborcam",
    "usr/lib/arborcam/arborcam-service",
    "usr/lib/systemd/system/arborcam@.service",
    "usr/lib/sysusers.d/arborcam.conf",
    "usr/lib/tmpfiles.d/arborcam.conf",
    "usr/lib/udev/rules.d/70-arborcam.rules",
    "usr/share/arborcam/arborcam.toml",
    "usr/share/arborcam/lenses/LICENSE",
    "usr/share/arborcam/lenses/README.md",
    "usr/share/arborcam/lenses/apple-iphone-11.json",
    "usr/share/arborcam/lenses/arducam-imx477-6mm.json",
    "usr/share/arborcam/lenses/google-pixel-4a.json",
    "usr/share/arborcam/lenses/raspberry-pi-camera-3.json",
    "usr/share/arborcam/lenses/raspberry-pi-hq-3.2mm.json",
    "usr/share/arborcam/sbc.toml",
    "usr/share/doc/arborcam/README.md",
    "usr/share/doc/arborcam/camera.md",
    "usr/share/doc/arborcam/method.md",
    "usr/share/doc/arborcam/outline.md",
    "usr/share/doc/arborcam/photo.md",
    "usr/share/doc/arborcam/sweep.md",
    "usr/share/doc/arborcam/recordings.md",
    "usr/share/doc/arborcam/files.md",
    "usr/share/doc/arborcam/service.md",
    "usr/share/doc/arborcam/settings.md",
    "usr/share/doc/arborcam/using.md",
    "usr/share/doc/arborcam/grow.md",
    "usr/share/doc/arborcam/forest.md",
    "usr/share/doc/arborcam/viewer.md",
    "usr/share/doc/arborcam/animate.md",
    "usr/share/doc/arborcam/analyze.md",
    "usr/share/doc/arborcam/dynamics.md",
    "usr/share/doc/arborcam/gallery.md",
    "usr/share/doc/arborcam/markers.md",
    "usr/share/doc/arborcam/depth.md",
    "usr/share/doc/arborcam/clouds.md",
    "usr/share/doc/arborcam/sketch.md",
];

fn make(goal: &str, root: &Path) {
    let binary = format!("BINARY={}", env!("CARGO_BIN_EXE_arborcam"));
    let root = format!("DESTDIR={}", root.display());
    let output = Command::new("make")
        .args(["-s", goal, "PREFIX=/usr", &root, &binary])
        .output()
        .expect("make");
    assert!(
        output.status.success(),
        "make {goal}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
}

fn files(root: &Path) -> BTreeSet<String> {
    let found = Command::new("find")
        .arg(root)
        .args(["-type", "f", "-printf", "%P\\n"])
        .output()
        .expect("find");
    String::from_utf8(found.stdout)
        .expect("names")
        .lines()
        .map(str::to_owned)
        .collect()
}

#[test]
fn install_puts_every_part_in_its_place_and_uninstall_takes_all_of_it_away() {
    let root = tempfile::tempdir().expect("tempdir");
    make("install", root.path());
    assert_eq!(
        files(root.path()),
        INSTALLED.iter().map(|f| (*f).to_owned()).collect()
    );
    let mode = |name: &str| {
        fs::metadata(root.path().join(name))
            .expect("file")
            .permissions()
            .mode()
            & 0o777
    };
    for name in INSTALLED {
        let runs = name.starts_with("usr/bin/") || name.ends_with("arborcam-service");
        assert_eq!(mode(name), if runs { 0o755 } else { 0o644 }, "{name}");
    }
    for name in [
        "usr/lib/systemd/system/arborcam@.service",
        "usr/lib/arborcam/arborcam-service",
    ] {
        let text = fs::read_to_string(root.path().join(name)).expect("file");
        assert!(
            !text.contains("@PREFIX@") && text.contains("/usr/"),
            "{name}"
        );
    }
    unit_is_clean_and_tight(root.path());
    make("uninstall", root.path());
    assert_eq!(files(root.path()), BTreeSet::new());
}

/// systemd's own verdict on the unit: no complaint, and an exposure of at most 2.0 of 10.
fn unit_is_clean_and_tight(root: &Path) {
    let analyze = |arguments: &[&str]| Command::new("systemd-analyze").args(arguments).output();
    if !analyze(&["--version"]).is_ok_and(|o| o.status.success()) {
        eprintln!("SKIPPED: systemd-analyze is not installed; the unit was not checked");
        return;
    }
    let unit = root.join("usr/lib/systemd/system/arborcam@.service");
    let text = fs::read_to_string(&unit).expect("unit");
    // An instance whose programs are where verify can find them.
    let instance = root.join("arborcam@video0.service");
    fs::write(
        &instance,
        text.replace(
            "=/usr/lib/arborcam",
            &format!("={}/usr/lib/arborcam", root.display()),
        ),
    )
    .expect("unit");
    let verified = analyze(&["verify", instance.to_str().expect("path")]).expect("systemd-analyze");
    let said = String::from_utf8_lossy(&verified.stderr).into_owned();
    assert!(
        verified.status.success() && said.trim().is_empty(),
        "{said}"
    );
    let scored = analyze(&[
        "security",
        "--offline=true",
        "--threshold=20",
        instance.to_str().expect("path"),
    ])
    .expect("analyze");
    let said = String::from_utf8_lossy(&scored.stdout).into_owned();
    fs::remove_file(&instance).expect("remove");
    assert!(scored.status.success(), "exposure above 2.0: {said}");
}

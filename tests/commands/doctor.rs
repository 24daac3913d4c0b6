//! What the doctor says of made-up machines: each trouble has its verdict and its remedy; and that
//! it runs on this one.

use arborcam::config::Config;
use arborcam::doctor::{
    Check, Disk, Facts, Film, Installed, Load, Node, Part, Screen, Seen, Verdict, judge,
};
use std::path::PathBuf;
use std::process::Command;

/// A machine on which nothing is wrong.
fn sound() -> Facts {
    let times_s: Vec<f64> = (0..15).map(|k| 100.0 + f64::from(k) / 30.0).collect();
    let format = "MJPG 1280x720 @ 30".to_owned();
    Facts {
        config: Config::default(),
        config_error: None,
        seen: Seen {
            films: vec![(PathBuf::from("/dev/video0"), "Cam".into())],
            depths: vec![(PathBuf::from("/dev/video2"), "Depth".into())],
            chosen: Some(PathBuf::from("/dev/video0")),
        },
        node: Some(Node::Opens),
        film: Some(Film::Frames {
            asked: format.clone(),
            given: format,
            now_s: times_s[14] + 0.02,
            times_s,
            bytes: 100_000,
        }),
        decode_ms: Ok(1.4),
        ffmpeg: Some("ffmpeg version 5.1".into()),
        disk: Ok(Disk {
            folder: "/data".into(),
            free_bytes: 1 << 40,
            bytes_per_s: 2e8,
        }),
        load: Load {
            cores: 4,
            frames_per_s: 120.0,
            celsius: Some(50.0),
            clock_share: Some(1.0),
        },
        screen: Screen {
            cells: Some((80, 24)),
            utf8: true,
            colours: "all",
            pictures: "kitty",
        },
        installed: Installed {
            unit: Part::Same,
            helper: Part::Same,
            rule: Part::Same,
            enabled: vec!["arborcam@video0.service".into()],
        },
    }
}

fn one(facts: &Facts, name: &str) -> Check {
    judge(facts)
        .into_iter()
        .find(|c| c.name == name)
        .unwrap_or_else(|| panic!("no check {name}"))
}

#[test]
fn a_sound_machine_has_nothing_to_remedy() {
    let checks = judge(&sound());
    assert_eq!(checks.len(), 11);
    for check in checks {
        assert_eq!(
            (check.verdict, check.remedy.as_str()),
            (Verdict::Ok, ""),
            "{check}"
        );
    }
}

fn disk(free_bytes: u64, bytes_per_s: f64) -> Result<Disk, String> {
    Ok(Disk {
        folder: "/data".into(),
        free_bytes,
        bytes_per_s,
    })
}

/// Sets the times so that they come at `rate_hz`.
fn film(facts: &mut Facts, rate_hz: f64, late_s: f64) {
    if let Some(Film::Frames { times_s, now_s, .. }) = &mut facts.film {
        *times_s = (0..15).map(|k| 100.0 + f64::from(k) / rate_hz).collect();
        *now_s = times_s[14] + late_s;
    }
}

#[test]
fn every_trouble_has_its_verdict_and_its_remedy() {
    type Break = fn(&mut Facts);
    let cases: &[(&str, Break, Verdict, &str, &str)] = &[
        (
            "settings",
            |f| f.config_error = Some("line 3: unknown field".into()),
            Verdict::Fail,
            "line 3",
            "mend",
        ),
        (
            "camera",
            |f| f.seen = Seen::default(),
            Verdict::Fail,
            "none that films",
            "plug one in",
        ),
        (
            "permission",
            |f| f.node = None,
            Verdict::Warn,
            "not looked at",
            "name the device",
        ),
        (
            "permission",
            |f| f.node = Some(Node::Absent),
            Verdict::Fail,
            "/dev/video0 is not there",
            "plug it in",
        ),
        (
            "permission",
            |f| f.node = Some(Node::Denied(Some("video".into()))),
            Verdict::Fail,
            "the group video",
            "sudo usermod -aG video $USER",
        ),
        (
            "permission",
            |f| f.node = Some(Node::Denied(None)),
            Verdict::Fail,
            "no group",
            "sudo chgrp video /dev/video0 && sudo chmod 660 /dev/video0",
        ),
        (
            "permission",
            |f| f.node = Some(Node::Refuses("no such device".into())),
            Verdict::Fail,
            "no such",
            "unplug",
        ),
        (
            "frames",
            |f| f.film = None,
            Verdict::Warn,
            "not looked at",
            "above",
        ),
        (
            "frames",
            |f| f.film = Some(Film::Busy("in use by zoom".into())),
            Verdict::Warn,
            "zoom",
            "free",
        ),
        (
            "frames",
            |f| f.film = Some(Film::Failed("no frame for 3 s".into())),
            Verdict::Fail,
            "no frame",
            "using.md",
        ),
        (
            "frames",
            |f| film(f, 14.9, 0.02),
            Verdict::Warn,
            "14.9 a second",
            "exposure",
        ),
        (
            "frames",
            |f| {
                if let Some(Film::Frames { given, .. }) = &mut f.film {
                    *given = "YUYV 640x480 @ 30".into();
                }
            },
            Verdict::Warn,
            "the camera gives YUYV 640x480",
            "arborcam devices",
        ),
        (
            "time stamps",
            |f| film(f, 30.0, 1.7e9),
            Verdict::Warn,
            "monotonic",
            "clock=CLOCK_MONOTONIC",
        ),
        (
            "time stamps",
            |f| f.film = None,
            Verdict::Warn,
            "not looked at",
            "above",
        ),
        (
            "decoder",
            |f| f.decode_ms = Err("no decoder".into()),
            Verdict::Fail,
            "no decoder",
            "make build",
        ),
        (
            "decoder",
            |f| f.decode_ms = Ok(20.0),
            Verdict::Fail,
            "20.0 ms a frame, of 33.3",
            "smaller picture",
        ),
        (
            "decoder",
            |f| f.decode_ms = Ok(10.0),
            Verdict::Warn,
            "10.0 ms",
            "smaller picture",
        ),
        (
            "ffmpeg",
            |f| f.ffmpeg = None,
            Verdict::Warn,
            "cannot be replayed",
            "apt install ffmpeg",
        ),
        (
            "disk",
            |f| f.disk = Err("/data: read-only".into()),
            Verdict::Fail,
            "read-only",
            "--out",
        ),
        // 3 MB/s of film and 1 MB/s of capture.
        (
            "disk",
            |f| f.disk = disk(1 << 40, 3.9e6),
            Verdict::Fail,
            "writes 4 MB/s, 4 MB/s are needed",
            "another disk",
        ),
        (
            "disk",
            |f| f.disk = disk(1 << 40, 7e6),
            Verdict::Warn,
            "writes 7 MB/s",
            "another disk",
        ),
        (
            "disk",
            |f| f.disk = disk(200_000_000, 2e8),
            Verdict::Fail,
            "0.2 GB free",
            "free some space",
        ),
        (
            "disk",
            |f| f.disk = disk(10_000_000_000, 2e8),
            Verdict::Warn,
            "42 min of film",
            "free some space",
        ),
        (
            "processor",
            |f| f.load.frames_per_s = 29.0,
            Verdict::Fail,
            "tracks 29.0 frames of 1280x720",
            "sbc.toml",
        ),
        (
            "processor",
            |f| f.load.frames_per_s = 40.0,
            Verdict::Warn,
            "30 are asked",
            "sbc.toml",
        ),
        (
            "processor",
            |f| f.load.celsius = Some(84.0),
            Verdict::Warn,
            "84 °C",
            "cool",
        ),
        (
            "processor",
            |f| f.load.clock_share = Some(0.6),
            Verdict::Warn,
            "held down",
            "power supply",
        ),
        (
            "processor",
            |f| f.load.cores = 1,
            Verdict::Warn,
            "1 cores",
            "without a screen",
        ),
        (
            "terminal",
            |f| f.screen.cells = Some((59, 24)),
            Verdict::Warn,
            "59x24",
            "80x24",
        ),
        (
            "terminal",
            |f| f.screen.cells = Some((70, 20)),
            Verdict::Warn,
            "70x20",
            "80x24",
        ),
        (
            "terminal",
            |f| f.screen.utf8 = false,
            Verdict::Warn,
            "not UTF-8",
            "LANG=C.UTF-8",
        ),
        (
            "terminal",
            |f| f.screen.colours = "none",
            Verdict::Warn,
            "colours: none",
            "NO_COLOR",
        ),
        (
            "terminal",
            |f| f.screen.cells = None,
            Verdict::Ok,
            "--headless",
            "",
        ),
        (
            "service",
            |f| f.installed.helper = Part::Missing,
            Verdict::Fail,
            "in part",
            "make install",
        ),
        (
            "service",
            |f| f.installed.unit = Part::Missing,
            Verdict::Fail,
            "video0.service is enabled",
            "make install",
        ),
        (
            "service",
            |f| f.installed.unit = Part::Differs,
            Verdict::Warn,
            "another version",
            "systemctl edit",
        ),
        (
            "service",
            |f| f.installed.enabled.clear(),
            Verdict::Warn,
            "no camera is enabled",
            "systemctl enable",
        ),
        (
            "service",
            |f| (f.installed.unit, f.installed.enabled) = (Part::Missing, Vec::new()),
            Verdict::Ok,
            "not installed",
            "",
        ),
    ];
    for (name, damage, verdict, found, remedy) in cases {
        let mut facts = sound();
        damage(&mut facts);
        let check = one(&facts, name);
        assert_eq!(check.verdict, *verdict, "{check}");
        assert!(check.found.contains(found), "no {found:?} in {check}");
        assert!(check.remedy.contains(remedy), "no {remedy:?} in {check}");
        assert_eq!(check.remedy.is_empty(), *verdict == Verdict::Ok, "{check}");
        assert!(!check.to_string().contains('\n'), "one line: {check}");
    }
}

/// On any machine: one line a check, a status that fits the verdicts, and nothing left on the disk.
#[test]
fn it_runs_here() {
    let dir = tempfile::tempdir().expect("tempdir");
    let doctor = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
        command
            .arg("doctor")
            .arg("--out")
            .arg(dir.path().join("new"))
            .args(arguments)
            .output()
            .expect("doctor")
    };
    let output = doctor(&["--json", "--config", "config/sbc.toml"]);
    let checks: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let checks = checks.as_array().expect("a list");
    assert_eq!(checks.len(), 11);
    let of = |name: &str| checks.iter().find(|c| c["name"] == name).expect("check");
    assert_eq!(
        (&of("settings")["verdict"], &of("decoder")["verdict"]),
        (&"ok".into(), &"ok".into())
    );
    assert!(
        of("disk")["found"]
            .as_str()
            .expect("text")
            .contains(" GB free")
    );
    assert!(
        of("processor")["found"]
            .as_str()
            .expect("text")
            .contains("frames of 640x480 a second")
    );
    let failed = checks.iter().any(|c| c["verdict"] == "fail");
    assert_eq!(output.status.code(), Some(i32::from(failed)));
    assert_eq!(
        std::fs::read_dir(dir.path()).expect("folder").count(),
        0,
        "nothing is left"
    );

    let output = doctor(&["/dev/video999", "--config", "Cargo.toml"]);
    assert_eq!(output.status.code(), Some(1));
    let lines = String::from_utf8(output.stdout).expect("text");
    assert_eq!(lines.lines().count(), 11, "{lines}");
    assert!(
        lines.contains("FAIL  settings     configuration Cargo.toml, line "),
        "{lines}"
    );
    assert!(
        lines.contains("FAIL  permission   /dev/video999 is not there; plug it in"),
        "{lines}"
    );
    let said = String::from_utf8(output.stderr).expect("text");
    assert!(
        said.contains(" of 11 checks failed") && said.lines().count() == 1,
        "{said}"
    );
}

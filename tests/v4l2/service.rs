//! The service as it is installed, under a real systemd, with a camera that appears, is silent, and
//! hangs.

use crate::guest::{Group, Results, claim, clip, end_limit_s, is_emulated};
use std::path::Path;
use std::process::Command;

pub const GROUP: Group = Group {
    name: "service",
    script: "service.sh",
    first: "systemd",
    limit_s: 400,
    provide,
    cases: &[
        ("it_starts_when_the_camera_appears", starts),
        ("it_is_ready_only_when_frames_flow", ready),
        ("it_runs_as_its_own_user", own_user),
        ("the_watchdog_restarts_it_when_it_hangs", watchdog),
        (
            "it_stops_within_two_seconds_with_its_capture_complete",
            stops,
        ),
        ("its_recording_is_readable_after_a_kill", killed),
    ],
};

fn provide(folder: &Path) -> Result<(), String> {
    clip(folder)?;
    let root = std::path::absolute(folder.join("installed")).map_err(|e| e.to_string())?;
    let binary = format!("BINARY={}", env!("CARGO_BIN_EXE_arborcam"));
    let make = Command::new("make")
        .args(["-s", "install", "PREFIX=/usr", &binary])
        .arg(format!("DESTDIR={}", root.display()))
        .output()
        .map_err(|e| format!("make: {e}"))?;
    claim(make.status.success(), || {
        format!("make install: {}", String::from_utf8_lossy(&make.stderr))
    })
}

fn said(r: &Results) -> String {
    r.text("journal").unwrap_or_default()
}

fn starts(r: &Results) -> Result<(), String> {
    let (before, filming) = (r.text("before")?, r.text("filming")?);
    claim(before.starts_with("inactive/"), || {
        format!("before the camera came: {before}")
    })?;
    claim(filming.starts_with("activating/"), || {
        format!("with the camera: {filming}{}", said(r))
    })
}

fn ready(r: &Results) -> Result<(), String> {
    let (filming, flowing) = (r.text("filming")?, r.text("flowing")?);
    claim(filming.trim() == "activating/start", || {
        format!("without a frame: {filming}{}", said(r))
    })?;
    claim(flowing.trim() == "active/running", || {
        format!("with frames: {flowing}{}", said(r))
    })?;
    let took = r.number("ready")? - r.number("flows")?;
    claim(took < 5.0, || {
        format!("ready {took} s after the first frame")
    })
}

fn own_user(r: &Results) -> Result<(), String> {
    let user = r.text("user")?;
    claim(user.trim() == "arborcam arborcam", || user.clone())
}

fn watchdog(r: &Results) -> Result<(), String> {
    let restarts = r.number("restarts")?;
    claim(restarts >= 1.0, || format!("not restarted: {}", said(r)))?;
    claim(said(r).contains("atchdog timeout"), || said(r))?;
    // The limit, the time to abort, and the pause before the next start.
    let took = r.number("restarted")? - r.number("stopped")?;
    claim((3.0..30.0).contains(&took), || {
        format!("back after {took} s: {}", said(r))
    })
}

fn stops(r: &Results) -> Result<(), String> {
    let took = r.number("ended")? - r.number("asked")?;
    let limit_s = if is_emulated() { end_limit_s() } else { 2.0 };
    claim(took <= limit_s, || {
        format!("ended {took} s after SIGTERM: {}", said(r))
    })?;
    let result = r.text("stopping")?;
    claim(result.trim() == "success 130", || {
        format!("{result}{}", said(r))
    })?;
    for file in ["capture.json", "tracks.csv", "nodes.csv", "motion.csv"] {
        claim(r.path("capture").join(file).exists(), || {
            format!("{file} is missing: {}", said(r))
        })?;
    }
    let json: serde_json::Value = serde_json::from_str(&r.text("capture/capture.json")?)
        .map_err(|e| format!("capture.json: {e}"))?;
    let seen = json["timing"]["frames_seen"].as_u64().unwrap_or(0);
    claim(seen >= 20, || format!("{seen} frames"))
}

fn killed(r: &Results) -> Result<(), String> {
    let frames = crate::guest::frames_of(&r.path("killed.mcap"))?;
    // Five seconds at 15 Hz, of which the last may be lost.
    claim(frames.len() >= 45, || {
        format!("{} frames in the recording", frames.len())
    })
}

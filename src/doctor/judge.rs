//! Verdicts on what was found: pure, so that every remedy can be held by a test.

use super::Check;
use super::camera::{Film, Node, Seen};
use super::facts::{Facts, Load, Screen};
use super::measure::Disk;
use super::service::{Installed, Part};
use crate::config::Config;

/// Share by which a machine should be faster than it must: other programs run as well, and trees
/// differ.
const MARGIN: f64 = 1.5;
/// Film for which there must be room, and should be, s.
const LEAST_ROOM_S: f64 = 60.0;
const GOOD_ROOM_S: f64 = 3600.0;
/// A capture's own files, bytes a second (60 MB a minute at 400 points and 30 frames a second).
const CAPTURE_BYTES_PER_S: f64 = 1e6;
/// Bytes that JPEG takes for a pixel of a tree, generously.
const JPEG_BYTES_PER_PX: f64 = 0.4;
/// A board slows itself down from about here, degrees Celsius.
const HOT: f64 = 80.0;
/// The least screen that anything can be drawn on, and the one that it is made for, cells.
const LEAST_COLUMNS: u16 = 60;
const LEAST_ROWS: u16 = 16;
const GOOD_COLUMNS: u16 = 80;
const GOOD_ROWS: u16 = 24;

/// One finding for each subject, in the order in which a capture needs them.
pub fn judge(facts: &Facts) -> Vec<Check> {
    let config = &facts.config;
    vec![
        settings(facts.config_error.as_deref()),
        camera(&facts.seen),
        permission(&facts.seen, facts.node.as_ref()),
        frames(facts.film.as_ref(), config),
        stamps(facts.film.as_ref()),
        decoder(&facts.decode_ms, config),
        ffmpeg(facts.ffmpeg.as_deref()),
        disk(&facts.disk, facts.film.as_ref(), config),
        processor(&facts.load, config),
        terminal(&facts.screen),
        service(&facts.installed),
    ]
}

fn settings(error: Option<&str>) -> Check {
    match error {
        None => Check::ok("settings", "valid"),
        Some(e) => Check::fail(
            "settings",
            e,
            "mend that line; docs/settings.md has every key",
        ),
    }
}

/// Depth cameras that may be used beside the camera.
fn depth_words(seen: &Seen) -> String {
    let beside = seen
        .depths
        .iter()
        .filter(|(path, _)| Some(path) != seen.chosen.as_ref());
    let paths: Vec<String> = beside.map(|(path, _)| path.display().to_string()).collect();
    match paths.as_slice() {
        [] => String::new(),
        paths => format!("; depth, for --depth: {}", paths.join(", ")),
    }
}

fn camera(seen: &Seen) -> Check {
    match &seen.chosen {
        Some(chosen) => {
            let others = seen.films.iter().filter(|(path, _)| path != chosen).count();
            let name = seen
                .films
                .iter()
                .find(|(path, _)| path == chosen)
                .map_or("", |(_, name)| name.as_str());
            Check::ok(
                "camera",
                format!(
                    "{} {name} would be taken; {others} more there{}",
                    chosen.display(),
                    depth_words(seen)
                )
                .replace("  ", " "),
            )
        }
        None => Check::fail(
            "camera",
            "none that films",
            "plug one in, and look whether /dev/video0 appears; a virtual machine or container must be given it",
        ),
    }
}

fn permission(seen: &Seen, node: Option<&Node>) -> Check {
    let path = seen
        .chosen
        .as_ref()
        .map_or(String::new(), |p| p.display().to_string());
    match node {
        None => Check::warn(
            "permission",
            "not looked at, for lack of a camera",
            "name the device: arborcam doctor /dev/video0",
        ),
        Some(Node::Opens) => Check::ok("permission", format!("{path} can be opened")),
        Some(Node::Absent) => Check::fail(
            "permission",
            format!("{path} is not there"),
            "plug it in; `arborcam devices` lists what is there",
        ),
        Some(Node::Denied(Some(group))) => Check::fail(
            "permission",
            format!("{path} may be opened by the group {group}, and you are not in it"),
            format!("run `sudo usermod -aG {group} $USER`, log out and log in again"),
        ),
        Some(Node::Denied(None)) => Check::fail(
            "permission",
            format!("{path} may be opened by no group"),
            format!(
                "run `sudo chgrp video {path} && sudo chmod 660 {path}`, and be in the group video"
            ),
        ),
        Some(Node::Refuses(why)) => Check::fail(
            "permission",
            format!("{path} cannot be opened: {why}"),
            "unplug it and plug it in again",
        ),
    }
}

fn frames(film: Option<&Film>, config: &Config) -> Check {
    let name = "frames";
    match film {
        None => Check::warn(
            name,
            "not looked at, for lack of a camera that opens",
            "see above",
        ),
        Some(Film::Busy(why)) => Check::warn(
            name,
            format!("not looked at: {why}"),
            "try again when it is free",
        ),
        Some(Film::Failed(why)) => {
            Check::fail(name, why, "docs/using.md explains each of these messages")
        }
        Some(Film::Frames { times_s, .. }) if times_s.len() < 2 => Check::fail(
            name,
            "the camera gives no film",
            "unplug it and plug it in again, without a hub between",
        ),
        Some(Film::Frames {
            asked,
            given,
            times_s,
            ..
        }) => {
            let span_s = times_s[times_s.len() - 1] - times_s[0];
            let (rate, wanted) = (
                (times_s.len() - 1) as f64 / span_s.max(1e-6),
                f64::from(config.camera.rate_hz),
            );
            if rate < 0.9 * wanted {
                return Check::warn(
                    name,
                    format!("{given}, but {rate:.1} a second come"),
                    "give it more light or lock the exposure (docs/camera.md); on USB 2 ask for \
                     mjpeg or a smaller picture",
                );
            }
            if asked != given {
                return Check::warn(
                    name,
                    format!("asked for {asked}, the camera gives {given}"),
                    "set [camera] to what it offers (`arborcam devices`)",
                );
            }
            Check::ok(name, format!("{given}, {rate:.1} a second come"))
        }
    }
}

fn stamps(film: Option<&Film>) -> Check {
    let name = "time stamps";
    let Some(Film::Frames { times_s, now_s, .. }) =
        film.filter(|f| matches!(f, Film::Frames { times_s, .. } if times_s.len() > 1))
    else {
        return Check::warn(name, "not looked at, for lack of frames", "see above");
    };
    let age_s = now_s - times_s[times_s.len() - 1];
    if !(-0.01..5.0).contains(&age_s) {
        return Check::warn(
            name,
            "the driver does not stamp frames with the kernel's monotonic clock",
            "times are as good as the driver's own clock; for uvcvideo load it with clock=CLOCK_MONOTONIC",
        );
    }
    Check::ok(
        name,
        format!(
            "the kernel's monotonic clock, {:.0} ms from stamp to program",
            age_s * 1e3
        ),
    )
}

fn decoder(ms: &Result<f64, String>, config: &Config) -> Check {
    let budget_ms = 1e3 / f64::from(config.camera.rate_hz);
    let remedy =
        "build with `make build` (it needs nasm for the fast decoder), or take a smaller picture";
    match ms {
        Err(e) => Check::fail("decoder", e, "build arborcam anew: make build"),
        // Tracking has to fit in beside it.
        Ok(ms) if *ms > budget_ms / 2.0 => Check::fail(
            "decoder",
            format!("{ms:.1} ms a frame, of {budget_ms:.1} there are"),
            remedy,
        ),
        Ok(ms) if *ms > budget_ms / 4.0 => Check::warn(
            "decoder",
            format!("{ms:.1} ms a frame, of {budget_ms:.1} there are"),
            remedy,
        ),
        Ok(ms) => Check::ok(
            "decoder",
            format!("JPEG in {ms:.1} ms a frame, of {budget_ms:.1} there are"),
        ),
    }
}

fn ffmpeg(version: Option<&str>) -> Check {
    match version {
        Some(version) => Check::ok("ffmpeg", version),
        None => Check::warn(
            "ffmpeg",
            "not installed; video files cannot be replayed",
            "run `sudo apt install ffmpeg`",
        ),
    }
}

/// Bytes a second of a recording and a capture: as measured where there was film, else estimated.
fn need_bytes_per_s(film: Option<&Film>, config: &Config) -> f64 {
    let camera = &config.camera;
    let pixels = f64::from(camera.width) * f64::from(camera.height);
    let frame = match film {
        Some(Film::Frames { bytes, .. }) if *bytes > 0 => *bytes as f64,
        _ if camera.format == crate::config::CameraFormat::Yuyv => 2.0 * pixels,
        _ => JPEG_BYTES_PER_PX * pixels,
    };
    frame * f64::from(camera.rate_hz) + CAPTURE_BYTES_PER_S
}

fn disk(disk: &Result<Disk, String>, film: Option<&Film>, config: &Config) -> Check {
    let disk = match disk {
        Ok(disk) => disk,
        Err(e) => {
            return Check::fail(
                "disk",
                e,
                "choose a folder in which you may write, with --out",
            );
        }
    };
    let need = need_bytes_per_s(film, config);
    let room_s = disk.free_bytes as f64 / need;
    let found = format!(
        "{}: {:.1} GB free, {:.0} min of film; writes {:.0} MB/s, {:.0} MB/s are needed",
        disk.folder,
        disk.free_bytes as f64 / 1e9,
        room_s / 60.0,
        disk.bytes_per_s / 1e6,
        need / 1e6
    );
    let slow = "take another disk, mjpeg, a smaller picture, or film without --record";
    let small = "free some space, or choose another disk with --out";
    match () {
        () if disk.bytes_per_s < need => Check::fail("disk", found, slow),
        () if room_s < LEAST_ROOM_S => Check::fail("disk", found, small),
        () if disk.bytes_per_s < 2.0 * need => Check::warn("disk", found, slow),
        () if room_s < GOOD_ROOM_S => Check::warn("disk", found, small),
        () => Check::ok("disk", found),
    }
}

fn processor(load: &Load, config: &Config) -> Check {
    let asked = f64::from(config.camera.rate_hz);
    let heat = load
        .celsius
        .map_or(String::new(), |c| format!(", {c:.0} °C"));
    let found = format!(
        "{} cores{heat}; tracks {:.1} frames of {}x{} a second, {asked} are asked",
        load.cores, load.frames_per_s, config.camera.width, config.camera.height
    );
    let slower = "take a smaller picture, fewer points or a lower rate: --config config/sbc.toml";
    if load.frames_per_s < asked {
        return Check::fail("processor", found, slower);
    }
    if load.celsius.is_some_and(|c| c >= HOT) {
        return Check::warn(
            "processor",
            found,
            "cool it: from about here it slows itself down",
        );
    }
    if load.clock_share.is_some_and(|share| share < 0.9) {
        return Check::warn(
            "processor",
            format!("{found}; its clock is held down"),
            "look at power supply and governor",
        );
    }
    if load.frames_per_s < MARGIN * asked {
        return Check::warn("processor", found, slower);
    }
    if load.cores < 2 {
        return Check::warn(
            "processor",
            found,
            "with one core frames wait while the tree is built; film without a screen",
        );
    }
    Check::ok("processor", found)
}

fn terminal(screen: &Screen) -> Check {
    let Some((columns, rows)) = screen.cells else {
        return Check::ok("terminal", "none; captures run with --headless");
    };
    let found = format!(
        "{columns}x{rows}, colours: {}, pictures: {}",
        screen.colours, screen.pictures
    );
    if columns < LEAST_COLUMNS || rows < LEAST_ROWS {
        return Check::warn(
            "terminal",
            found,
            "make it 80x24 or larger; below 60x16 nothing is drawn",
        );
    }
    if !screen.utf8 {
        return Check::warn(
            "terminal",
            format!("{found}, not UTF-8"),
            "set a UTF-8 locale: export LANG=C.UTF-8",
        );
    }
    if screen.colours == "none" {
        return Check::warn(
            "terminal",
            found,
            "unset NO_COLOR to see pictures in colour",
        );
    }
    if columns < GOOD_COLUMNS || rows < GOOD_ROWS {
        return Check::warn("terminal", found, "it is made for 80x24");
    }
    Check::ok("terminal", found)
}

fn service(installed: &Installed) -> Check {
    let name = "service";
    let parts = [installed.unit, installed.helper, installed.rule];
    let install = "run `sudo make install`";
    match (&installed.enabled[..], installed.unit) {
        ([], Part::Missing) => Check::ok(
            name,
            "not installed; it is for filming unattended (docs/service.md)",
        ),
        (enabled, Part::Missing) => Check::fail(
            name,
            format!("{} is enabled and not installed", enabled.join(", ")),
            install,
        ),
        (_, _) if parts.contains(&Part::Missing) => Check::fail(name, "installed in part", install),
        (_, _) if parts.contains(&Part::Differs) => Check::warn(
            name,
            "installed from another version, or changed",
            format!("{install}; own changes belong in a drop-in (`systemctl edit`)"),
        ),
        ([], _) => Check::warn(
            name,
            "installed; no camera is enabled",
            "run `sudo systemctl enable --now arborcam@video0.service`",
        ),
        (enabled, _) => Check::ok(name, format!("installed; {} enabled", enabled.join(", "))),
    }
}

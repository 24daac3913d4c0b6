//! A USB camera with a serial number, pulled out and plugged in again under a running capture.

use crate::guest::{Group, Results, claim, clip, end_limit_s, frames_of, slack};
use std::path::Path;

/// Times that the script unplugs it.
const CYCLES: usize = 20;
/// From the device's return to the next pose, s.
const RECOVERY_S: f64 = 2.0;

pub const GROUP: Group = Group {
    name: "replug",
    script: "replug.sh",
    first: "script",
    limit_s: 440,
    provide,
    cases: &[
        (
            "each_of_twenty_returns_is_taken_within_two_seconds",
            recovered,
        ),
        ("tree_and_tracks_last_through_the_gaps", one_tree),
        ("a_wish_to_stop_is_granted_soon_after_a_minute", ends),
        (
            "another_camera_is_not_taken_for_the_one_that_is_awaited",
            not_another,
        ),
        ("a_camera_that_hangs_is_waited_for", hang),
        (
            "a_camera_that_hangs_ends_a_capture_that_is_to_end_with_it",
            hang_once,
        ),
        (
            "a_camera_that_answers_nothing_does_not_keep_the_capture",
            deaf,
        ),
        ("a_camera_is_known_by_its_serial_number", identity),
        ("a_depth_camera_is_listed_as_one", depth_is_listed),
        ("depth_comes_through_the_kernel_as_it_was_sent", depth),
        (
            "a_depth_camera_that_is_pulled_out_comes_back",
            depth_returns,
        ),
    ],
};

/// Depth images that are sent over and over, and their size.
const DEPTH_IMAGES: u16 = 30;
const WIDTH: u16 = 320;
const HEIGHT: u16 = 180;

/// What the depth camera sends: a plane that is farther away to the right and downwards, mm. The
/// first pixel has the image's number.
fn depth_mm(image: u16, u: u16, v: u16) -> u16 {
    if (u, v) == (0, 0) {
        return 1000 + image;
    }
    1500 + 3 * u + v
}

fn provide(folder: &Path) -> Result<(), String> {
    clip(folder)?;
    let mut bytes = Vec::new();
    for image in 0..DEPTH_IMAGES {
        for v in 0..HEIGHT {
            bytes.extend((0..WIDTH).flat_map(|u| depth_mm(image, u, v).to_le_bytes()));
        }
    }
    let camera = r#"{"fx": 300.0, "fy": 300.0, "cx": 160.0, "cy": 90.0}"#;
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.join(name), bytes).map_err(|e| format!("{name}: {e}"))
    };
    write("depth.z16", &bytes)?;
    write("depth-camera.json", camera.as_bytes())
}

/// Seconds of each cycle: pulled, back, frames again; and the count of poses before and after.
fn cycles(r: &Results) -> Result<Vec<Vec<f64>>, String> {
    let text = r.text("cycles")?;
    let line = |l: &str| {
        l.split_whitespace()
            .take(5)
            .filter_map(|w| w.parse().ok())
            .collect()
    };
    Ok(text.lines().map(line).collect())
}

fn recovered(r: &Results) -> Result<(), String> {
    let cycles = cycles(r)?;
    claim(cycles.len() == CYCLES, || {
        format!("{} cycles of {CYCLES}: {}", cycles.len(), said(r))
    })?;
    let mut late = 0;
    for (n, cycle) in cycles.iter().enumerate() {
        let [_, back, again, before, after] = cycle[..] else {
            return Err(format!("cycle {n}: {cycle:?}"));
        };
        claim(after > before, || {
            format!("cycle {n}: no pose after the return: {}", said(r))
        })?;
        late += usize::from(again - back > RECOVERY_S);
        claim(again - back <= RECOVERY_S * slack(), || {
            format!("cycle {n}: {:.2} s until the next pose", again - back)
        })?;
    }
    claim(late <= 1, || {
        format!("{late} of {CYCLES} later than {RECOVERY_S} s")
    })?;
    let status = r.status("replug")?;
    claim(status == "130", || format!("status {status}: {}", said(r)))
}

fn said(r: &Results) -> String {
    r.messages("replug").unwrap_or_default()
}

fn one_tree(r: &Results) -> Result<(), String> {
    let capture = r.capture("replug")?;
    let built = capture["build"]["time_s"].as_f64().ok_or("no tree")?;
    let first = cycles(r)?
        .first()
        .and_then(|c| c.first().copied())
        .ok_or("no cycle")?;
    let begun = r.number("replug/begun")?;
    claim(built < first - begun, || {
        format!("built at {built} s, unplugged at {} s", first - begun)
    })?;
    // Marked: each is a gap of at least the time that the camera was away.
    let gaps = capture["timing"]["gaps"]
        .as_array()
        .cloned()
        .unwrap_or_default();
    let long = gaps
        .iter()
        .filter(|g| g["missing"].as_u64().is_some_and(|n| n >= 3))
        .count();
    claim(long >= CYCLES, || {
        format!("{long} gaps for {CYCLES} cycles: {gaps:?}")
    })?;
    // Points that were followed before the first are followed after the last.
    let tracks = r.text("replug/capture/tracks.csv")?;
    let cell = |l: &str, n: usize| {
        l.split(',')
            .nth(n)
            .and_then(|c| c.parse::<f64>().ok())
            .unwrap_or(f64::NAN)
    };
    let last = tracks
        .lines()
        .skip(1)
        .map(|l| cell(l, 2))
        .fold(0.0, f64::max);
    let ids = |from: f64, to: f64| -> std::collections::BTreeSet<u64> {
        let within = |l: &&str| (from..=to).contains(&cell(l, 2));
        tracks
            .lines()
            .skip(1)
            .filter(within)
            .map(|l| cell(l, 0) as u64)
            .collect()
    };
    let (before, after) = (ids(built - 1.0, built), ids(last - 0.5, last));
    let kept = before.intersection(&after).count();
    claim(2 * kept > before.len(), || {
        format!("{kept} of {} points are left", before.len())
    })
}

fn ends(r: &Results) -> Result<(), String> {
    let took = r.seconds("replug", "asked", "ended")?;
    claim(took <= end_limit_s(), || {
        format!("ended {took} s after the wish: {}", said(r))
    })
}

fn not_another(r: &Results) -> Result<(), String> {
    let text = r.text("another")?;
    let counts: Vec<u64> = text
        .split_whitespace()
        .filter_map(|w| w.parse().ok())
        .collect();
    claim(counts.len() == 2 && counts[0] == counts[1], || {
        format!("poses went on with another camera: {counts:?}")
    })
}

fn hang(r: &Results) -> Result<(), String> {
    let status = r.status("hang")?;
    let said = r.messages("hang")?;
    claim(status == "130" && said.contains("no frame for 1 s"), || {
        format!("status {status}: {said}")
    })?;
    let length = r.capture("hang")?["timing"]["duration_s"]
        .as_f64()
        .unwrap_or(0.0);
    claim(length > 5.0, || format!("not taken up again: {length} s"))
}

fn hang_once(r: &Results) -> Result<(), String> {
    let (status, said) = (r.status("hang-once")?, r.messages("hang-once")?);
    claim(status == "1" && said.contains("no frame for 1 s"), || {
        format!("status {status}: {said}")
    })?;
    r.capture("hang-once").map(drop)
}

fn deaf(r: &Results) -> Result<(), String> {
    let (status, said) = (r.status("deaf")?, r.messages("deaf")?);
    claim(status == "130" && said.contains("no frame for 1 s"), || {
        format!("status {status}: {said}")
    })?;
    let took = r.seconds("deaf", "asked", "written")?;
    claim(took <= end_limit_s(), || {
        format!("written {took} s after the wish: {said}")
    })?;
    let away_s = r.capture("deaf")?["timing"]["away_s"].as_f64();
    claim(away_s.is_some_and(|s| s > 5.0), || {
        format!("the lost time is not counted: {away_s:?}")
    })
}

fn identity(r: &Results) -> Result<(), String> {
    let text = r.text("devices.json")?;
    let devices: serde_json::Value =
        serde_json::from_str(&text).map_err(|e| format!("{e}: {text}"))?;
    let films = devices
        .as_array()
        .and_then(|all| all.iter().find(|d| d["films"] == true))
        .cloned();
    let films = films.ok_or("no camera is listed")?;
    claim(
        films["serial"] == "one" && films["product"] == "1209:a4b0",
        || films.to_string(),
    )?;
    claim(
        films["identity"]
            .as_str()
            .is_some_and(|i| i.contains("one")),
        || films.to_string(),
    )?;
    let mode = &films["modes"][0];
    claim(
        mode["format"] == "MJPG" && mode["width"] == 320 && mode["rates_hz"][0] == 15.0,
        || films.to_string(),
    )
}

fn depth_is_listed(r: &Results) -> Result<(), String> {
    let text = r.text("devices-depth.json")?;
    let devices: serde_json::Value =
        serde_json::from_str(&text).map_err(|e| format!("{e}: {text}"))?;
    let depth = devices
        .as_array()
        .and_then(|all| all.iter().find(|d| d["serial"] == "depth"));
    let mode = &depth.ok_or_else(|| text.clone())?["depth_modes"][0];
    claim(
        mode["format"] == "Z16" && mode["width"] == WIDTH && mode["rates_hz"][0] == 30.0,
        || text.clone(),
    )
}

fn depth_said(r: &Results) -> String {
    r.messages("depth").unwrap_or_default()
}

/// Every image that was recorded is one that was sent, to the last pixel, and the depth of every
/// point is that of the plane.
fn depth(r: &Results) -> Result<(), String> {
    let status = r.status("depth")?;
    claim(status == "130", || {
        format!("status {status}: {}", depth_said(r))
    })?;
    let frames = frames_of(&r.path("depth.mcap"))?;
    let images: Vec<_> = frames.iter().filter_map(|f| f.depth.as_ref()).collect();
    claim(2 * images.len() > frames.len() && images.len() > 50, || {
        let said = depth_said(r);
        format!(
            "{} of {} frames have depth: {said}",
            images.len(),
            frames.len()
        )
    })?;
    for image in images {
        let is_sent = |number: u16| {
            let pixels = (0..HEIGHT).flat_map(|v| (0..WIDTH).map(move |u| (u, v)));
            let sent = pixels.map(|(u, v)| depth_mm(number, u, v));
            sent.eq(image.counts.iter().copied())
        };
        claim((0..DEPTH_IMAGES).any(is_sent), || {
            format!("an image was not sent: {:?}", &image.counts[..8])
        })?;
    }
    let tracks = r.text("depth/capture/tracks.csv")?;
    let head: Vec<&str> = tracks
        .lines()
        .next()
        .unwrap_or_default()
        .split(',')
        .collect();
    let column = |name: &str| {
        head.iter()
            .position(|h| *h == name)
            .ok_or("no depth column")
    };
    let columns = [column("u_px")?, column("v_px")?, column("depth_m")?];
    let mut known = 0;
    for row in tracks.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        let [u, v, depth_m] = columns.map(|c| cells.get(c).and_then(|c| c.parse::<f64>().ok()));
        let (Some(u), Some(v), Some(depth_m)) = (u, v, depth_m) else {
            continue;
        };
        known += 1;
        let plane_m = 0.001 * (1500.0 + 3.0 * u + v);
        // The nearest thing among the pixels about it counts: the plane is 16 mm deep there.
        claim((depth_m - plane_m).abs() < 0.02, || {
            format!("{depth_m} m instead of {plane_m} at {u}, {v}")
        })?;
    }
    claim(known > 1000, || {
        format!("{known} depths: {}", depth_said(r))
    })
}

fn depth_returns(r: &Results) -> Result<(), String> {
    let timing = &r.capture("depth")?["timing"]["depth"];
    claim(timing["absences"] == 1, || {
        format!("{timing}: {}", depth_said(r))
    })?;
    let said = depth_said(r);
    claim(said.contains("the depth camera was lost at"), || {
        said.clone()
    })
}

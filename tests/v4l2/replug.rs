//! A USB camera with a serial number, pulled out and plugged in again under a running capture.

use crate::guest::{Group, Results, claim, clip, end_limit_s, slack};

/// Times that the script unplugs it.
const CYCLES: usize = 20;
/// From the device's return to the next pose, s.
const RECOVERY_S: f64 = 2.0;

pub const GROUP: Group = Group {
    name: "replug",
    script: "replug.sh",
    first: "script",
    limit_s: 400,
    provide: clip,
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
    ],
};

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

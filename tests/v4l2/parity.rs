//! A clip through a real device gives what the file gives: the same luma, and from it the same
//! tracks and tree.

use crate::guest::{Group, Results, claim, clip, frames_of};
use arborcam::model::{Luma, PixelFormat, RawFrame, Size};
use arborcam::source::Decoder;
use std::path::Path;

pub const GROUP: Group = Group {
    name: "parity",
    script: "parity.sh",
    first: "script",
    // An emulated guest on a busy host takes a minute to boot, and as long for each replay.
    limit_s: 800,
    provide,
    cases: &[
        ("mjpeg_has_the_luma_of_the_file", |r| luma(r, "mjpeg")),
        ("yuyv_has_the_luma_of_the_file", |r| luma(r, "yuyv")),
        ("mjpeg_gives_the_tracks_and_the_tree_of_its_replay", |r| {
            replay(r, "mjpeg")
        }),
        ("yuyv_gives_the_tracks_and_the_tree_of_its_replay", |r| {
            replay(r, "yuyv")
        }),
    ],
};

/// Rates at which the clip is played, Hz. An emulated processor follows the first without dropping
/// a frame; where its host is busy, the script takes the next.
const RATES_HZ: [u32; 3] = [8, 4, 2];

/// Frames that may be passed over at once.
const LATE: usize = 4;

/// Decoded pictures, one after the other.
fn lumas(frames: &[RawFrame]) -> Result<Vec<Vec<u8>>, String> {
    let mut decoder = Decoder::new().map_err(|e| e.to_string())?;
    let decoded = frames.iter().map(|raw| {
        let mut luma = Luma {
            size: raw.size,
            pixels: Vec::new(),
        };
        decoder.luma(raw, &mut luma).map_err(|e| e.to_string())?;
        Ok(luma.pixels)
    });
    decoded.collect()
}

/// Writes `clip-FORMAT-RATE.mcap` for each rate at which the clip may be played.
fn record_at_each_rate(folder: &Path, format: &str, frames: &mut [RawFrame]) -> Result<(), String> {
    for rate_hz in RATES_HZ {
        for (n, frame) in frames.iter_mut().enumerate() {
            frame.sensor_time_s = n as f64 / f64::from(rate_hz);
            frame.sequence = Some(n as u64);
        }
        let file = folder.join(format!("clip-{format}-{rate_hz}.mcap"));
        crate::guest::record(&file, frames)?;
    }
    Ok(())
}

/// The clip as recordings, in both formats.
fn provide(folder: &Path) -> Result<(), String> {
    clip(folder)?;
    let mut frames = frames_of(&folder.join("clip.mkv"))?;
    record_at_each_rate(folder, "mjpeg", &mut frames)?;
    let lumas = lumas(&frames)?;
    for (frame, luma) in frames.iter_mut().zip(lumas) {
        frame.format = PixelFormat::Yuyv;
        // Without colour.
        frame.bytes = luma.iter().flat_map(|y| [*y, 128]).collect();
    }
    record_at_each_rate(folder, "yuyv", &mut frames)
}

/// Each filmed frame is the clip's next, from wherever the filming began. The device does not wait
/// for a reader that is late: where the whole machine stood still, it has gone on by a few frames.
fn luma(r: &Results, format: &str) -> Result<(), String> {
    let clip = format!("clip-{format}-{}.mcap", RATES_HZ[0]);
    let clip = lumas(&frames_of(&r.path(&clip))?)?;
    let filmed = frames_of(&r.path(&format!("live-{format}.mcap")))?;
    claim(filmed.len() > 100, || {
        format!("{} frames filmed: {}", filmed.len(), said(r, format))
    })?;
    let right = PixelFormat::from_fourcc(if format == "mjpeg" { "MJPG" } else { "YUYV" });
    claim(
        filmed
            .iter()
            .all(|f| Some(f.format) == right && f.size == Size::new(320, 180)),
        || "another format".into(),
    )?;
    let filmed = lumas(&filmed)?;
    let first = clip
        .iter()
        .position(|l| *l == filmed[0])
        .ok_or("the first frame is none of the clip's")?;
    let (mut at, mut passed_over) = (first, 0);
    for (n, luma) in filmed.iter().enumerate().skip(1) {
        let step = (1..=LATE)
            .find(|step| clip[(at + step) % clip.len()] == *luma)
            .ok_or_else(|| {
                let is = clip.iter().position(|l| l == luma);
                format!(
                    "filmed frame {n} is the clip's {is:?} instead of {}",
                    (at + 1) % clip.len()
                )
            })?;
        (at, passed_over) = (at + step, passed_over + step - 1);
    }
    claim(20 * passed_over <= filmed.len(), || {
        format!("{passed_over} passed over beside {} filmed", filmed.len())
    })
}

fn said(r: &Results, format: &str) -> String {
    let of = |name: String| r.messages(&name).unwrap_or_default();
    format!(
        "{}{}",
        of(format!("live-{format}")),
        of(format!("replay-{format}"))
    )
}

fn replay(r: &Results, format: &str) -> Result<(), String> {
    let (live, again) = (format!("live-{format}"), format!("replay-{format}"));
    let statuses = (r.status(&live)?, r.status(&again)?);
    claim(statuses == ("0".into(), "0".into()), || {
        format!("{statuses:?}: {}", said(r, format))
    })?;
    // A frame that the tracker had no time for would be a difference of its own.
    let dropped = r.count(&live, "frames_dropped_tracker")?;
    claim(dropped == 0, || {
        format!("the guest was too slow: {dropped} frames dropped")
    })?;
    for file in ["tracks.csv", "nodes.csv", "motion.csv"] {
        let [a, b] = [&live, &again].map(|name| r.text(&format!("{name}/capture/{file}")));
        let (a, b) = (a?, b?);
        claim(a.lines().count() > 10, || {
            format!("{live}: {file} has {} lines", a.lines().count())
        })?;
        let differ = a.lines().zip(b.lines()).find(|(a, b)| a != b);
        claim(a == b, || {
            format!("{file}: live and replay differ: {differ:?}")
        })?;
    }
    Ok(())
}

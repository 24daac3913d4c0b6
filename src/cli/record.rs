//! `arborcam record DEVICE FILE.mcap`: frames into a file, and nothing else.

use super::camera::CameraArgs;
use super::hangup::Hangup;
use super::recording::{self, LimitArgs, parse_time_ns};
use super::session::{init_log, no_input, stop_on_signals};
use super::{Ended, say};
use crate::config::Config;
use crate::runtime::{self, Failure, Pace, RecordJob};
use clap::Args;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Time between two looks at what is going on.
const TICK: Duration = Duration::from_millis(20);

#[derive(Debug, Args)]
pub struct RecordArgs {
    /// The camera, e.g. /dev/video0; `arborcam devices` lists them. Any other input is taken at its
    /// own pace.
    device: PathBuf,
    /// The recording; it must not exist, and ends in .mcap.
    file: PathBuf,
    /// Stop after this time of filming, e.g. 90s, 10min or 2h; without it, record until Ctrl-C.
    #[arg(long, value_name = "TIME", value_parser = parse_time_ns)]
    duration: Option<u64>,
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    limits: LimitArgs,
    /// Settings that differ from the defaults (TOML; see config/arborcam.toml); only `[camera]` is
    /// used.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

pub fn run(args: &RecordArgs) -> Result<(), Ended> {
    let mut config = match &args.config {
        Some(path) => Config::load(path).map_err(|e| Ended::BadUsage(e.into()))?,
        None => Config::default(),
    };
    args.camera.set(&mut config.camera);
    config.check().map_err(|e| Ended::BadUsage(e.into()))?;
    recording::refuse_unfit(&args.file)?;
    let source = runtime::open(&args.device, &config.camera, None).map_err(no_input)?;
    let info = source.describe();
    // There are no settings to read again: whoever hangs up on it wants it to end.
    let stop = stop_on_signals(Hangup::of_this_process() != Hangup::Ignored)?;
    init_log(true);
    if info.live && info.format.asked != info.format.given {
        say(&format!(
            "arborcam: asked for {}, the camera gives {}",
            info.format.asked, info.format.given
        ));
    }
    let pace = if info.live {
        Pace::Live
    } else {
        Pace::Recorded
    };
    let job = RecordJob {
        to: recording::target(&args.file, args.limits.limits(), &*source),
        pace,
        camera: config.camera,
    };
    let running = runtime::record(source, job)?;
    while !running.finished() {
        let (_, _, time_s, _) = running.counts();
        let over = args
            .duration
            .is_some_and(|limit| time_s * 1e9 >= limit as f64);
        if over || running.broken() || stop.load(Ordering::SeqCst) {
            running.stop();
        }
        // At once: whoever films in a field is to hear of a full disk while it can still be helped.
        for line in running.news() {
            say(&format!("arborcam: {line}"));
        }
        std::thread::sleep(TICK);
    }
    let (seen, lost, time_s, missing) = running.counts();
    for line in running.news() {
        say(&format!("arborcam: {line}"));
    }
    let (recorded, failure) = running.join();
    let lost = if lost > 0 {
        format!(", {lost} lost in the camera")
    } else {
        String::new()
    };
    say(&format!("{seen} frames in {time_s:.1} s{lost}"));
    recorded
        .iter()
        .for_each(|recorded| say(&recording::closing_line(recorded, missing)));
    let broken = recorded.is_some_and(|r| r.stopped);
    match failure {
        Some(Failure::Source(e)) if seen == 0 => Err(no_input(e)),
        Some(failure) => Err(failure.into()),
        None if broken => Err(Ended::Failed(anyhow::anyhow!(
            "the recording is not complete; see the warning above"
        ))),
        None if stop.load(Ordering::SeqCst) => Err(Ended::Stopped),
        None => Ok(()),
    }
}

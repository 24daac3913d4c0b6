//! `arborcam record DEVICE FILE.mcap`: frames into a file, and nothing else.

use super::camera::CameraArgs;
use super::ended::Ended;
use super::hangup::SighupAction;
use super::output::say;
use super::recording::{self, LimitArgs, parse_time_ns};
use super::session::{init_log, no_input, stop_on_signals, warn_of_other_format};
use crate::config::Config;
use crate::runtime::{self, Failure, Pace, RecordJob, RunningRecord};
use clap::Args;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
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
    let config = Config::default().layered(args.config.as_deref(), |config| {
        args.camera.set(&mut config.camera);
    })?;
    recording::refuse_unfit(&args.file)?;
    let source = runtime::open(&args.device, &config.camera, None).map_err(no_input)?;
    let info = source.describe();
    let stop = stop_on_signals(SighupAction::ends_this_process())?;
    init_log(true);
    warn_of_other_format(&info);
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
    watch(&running, args.duration, &stop);
    report(running, stop.load(Ordering::SeqCst))
}

/// Waits for the end, and asks for it when the time is over or the user or a full disk wants it.
fn watch(running: &RunningRecord, duration_ns: Option<u64>, stop: &AtomicBool) {
    let limit_ns = duration_ns.map_or(f64::INFINITY, |ns| ns as f64);
    while !running.finished() {
        let (_, _, time_s, _) = running.counts();
        if time_s * 1e9 >= limit_ns || running.broken() || stop.load(Ordering::SeqCst) {
            running.stop();
        }
        // At once: a full disk can still be helped while the camera films.
        print_news(running);
        std::thread::sleep(TICK);
    }
    print_news(running);
}

fn print_news(running: &RunningRecord) {
    for line in running.news() {
        say(&format!("arborcam: {line}"));
    }
}

/// The closing lines, and the exit status.
fn report(running: RunningRecord, stopped: bool) -> Result<(), Ended> {
    let (seen, lost, time_s, missing) = running.counts();
    let (recorded, failure) = running.join();
    let lost = if lost > 0 {
        format!(", {lost} lost in the camera")
    } else {
        String::new()
    };
    say(&format!("{seen} frames in {time_s:.1} s{lost}"));
    if let Some(recorded) = &recorded {
        say(&recording::closing_line(recorded, missing));
    }
    let broken = recorded.is_some_and(|r| r.stopped);
    match failure {
        Some(Failure::Source(e)) if seen == 0 => Err(no_input(e)),
        Some(failure) => Err(failure.into()),
        None if broken => Err(Ended::Failed(anyhow::anyhow!(
            "the recording is not complete; see the warning above"
        ))),
        None if stopped => Err(Ended::Stopped),
        None => Ok(()),
    }
}

//! `arborcam record DEVICE FILE.mcap`: records frames to a file, without tracking.

use super::camera::{CameraArgs, check_depth};
use super::command_error::CommandError;
use super::depth::DepthArgs;
use super::hangup::SighupAction;
use super::notes::NoteArgs;
use super::output::eprint_line;
use super::recording::{self, LimitArgs, parse_time_ns};
use super::session::{init_log, warn_of_other_format};
use super::signals::stop_on_signals;
use crate::config::Config;
use crate::runtime::{self, Failure, Pace, RecordJob, RunningRecord};
use clap::Args;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Interval at which the recording is checked.
const TICK: Duration = Duration::from_millis(20);

#[derive(Debug, Args)]
pub struct RecordArgs {
    /// The camera, e.g. /dev/video0; `arborcam devices` lists them. Any other input is recorded at
    /// its own pace.
    device: PathBuf,
    /// The recording (.mcap); it must not exist.
    file: PathBuf,
    /// Stop after this duration, e.g. 90s, 10min or 2h. Default: record until Ctrl-C.
    #[arg(long, value_name = "TIME", value_parser = parse_time_ns)]
    duration: Option<u64>,
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    depth: DepthArgs,
    #[command(flatten)]
    limits: LimitArgs,
    #[command(flatten)]
    notes: NoteArgs,
    /// Settings that differ from the defaults (TOML; see config/arborcam.toml); only `[camera]` and
    /// `[depth]` are used.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

pub fn run(args: &RecordArgs) -> Result<(), CommandError> {
    let config = Config::default().layered(args.config.as_deref(), |config| {
        args.camera.set(config);
        args.depth.set(&mut config.depth);
    })?;
    args.notes.check()?;
    recording::check_new_file(&args.file)?;
    let source = runtime::open(&args.device, &config, None).map_err(CommandError::no_input)?;
    let info = source.describe();
    check_depth(&args.camera, &info)?;
    let notes = args.notes.over(&*source)?;
    let stop = stop_on_signals(SighupAction::ends_this_process(), None)?;
    init_log(true);
    warn_of_other_format(&info);
    let pace = if info.live {
        Pace::Live
    } else {
        Pace::Recorded
    };
    let job = RecordJob {
        to: recording::target(&args.file, args.limits.limits(), &*source, &notes),
        pace,
        camera: config.camera,
    };
    let running = runtime::record(source, job)?;
    watch(&running, args.duration, &stop);
    report(running, stop.load(Ordering::SeqCst))
}

/// Waits for the end of the recording; ends it after `duration_ns`, on a signal or if the disk is
/// full.
fn watch(running: &RunningRecord, duration_ns: Option<u64>, stop: &AtomicBool) {
    let limit_ns = duration_ns.map_or(f64::INFINITY, |ns| ns as f64);
    while !running.finished() {
        let (_, _, time_s, _) = running.counts();
        if time_s * 1e9 >= limit_ns || running.broken() || stop.load(Ordering::SeqCst) {
            running.stop();
        }
        // Printed at once: the user can free disk space while the camera films.
        print_news(running);
        std::thread::sleep(TICK);
    }
    print_news(running);
}

fn print_news(running: &RunningRecord) {
    for line in running.news() {
        eprint_line(&format!("arborcam: {line}"));
    }
}

/// Prints the closing lines, and returns the error that decides the exit status.
fn report(running: RunningRecord, stopped: bool) -> Result<(), CommandError> {
    let (seen, lost, time_s, missing) = running.counts();
    let (recorded, failure) = running.join();
    let lost = if lost > 0 {
        format!(", {lost} lost in the camera")
    } else {
        String::new()
    };
    eprint_line(&format!("{seen} frames in {time_s:.1} s{lost}"));
    if let Some(recorded) = &recorded {
        eprint_line(&recording::closing_line(recorded, missing));
    }
    let broken = recorded.is_some_and(|r| r.stopped);
    match failure {
        Some(Failure::Source(e)) if seen == 0 => Err(CommandError::no_input(e)),
        Some(failure) => Err(failure.into()),
        None if broken => Err(CommandError::Failed(anyhow::anyhow!(
            "the recording is not complete; see the warning above"
        ))),
        None if stopped => Err(CommandError::Stopped),
        None => Ok(()),
    }
}

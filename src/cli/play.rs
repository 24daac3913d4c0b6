//! `arborcam play INPUT --to /dev/videoN`: a recording becomes a camera.

use super::ended::Ended;
use super::hangup::SighupAction;
use super::output::say;
use super::session::{init_log, no_input, stop_on_signals};
use crate::config;
use crate::runtime;
use crate::source::{self, Loopback};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct PlayArgs {
    /// A recording (.mcap), a video file (.mkv .avi .mp4) or a folder of pictures.
    input: PathBuf,
    /// The v4l2loopback device to feed, e.g. /dev/video9.
    #[arg(long, value_name = "DEVICE")]
    to: PathBuf,
    /// Start over at the end, until Ctrl-C.
    #[arg(long = "loop")]
    again: bool,
    /// Rate of a folder of pictures, frames a second.
    #[arg(long, value_name = "RATE", default_value_t = 30.0)]
    fps: f64,
}

pub fn run(args: &PlayArgs) -> Result<(), Ended> {
    if !(args.fps.is_finite() && args.fps > 0.0) {
        return Err(Ended::BadUsage(anyhow::anyhow!(
            "--fps {} is no rate; give a number above 0",
            args.fps
        )));
    }
    let stop = stop_on_signals(SighupAction::ends_this_process())?;
    init_log(true);
    let mut output = None;
    let mut frames = 0;
    let stopped = loop {
        let camera = config::Camera::default();
        let mut source = source::open(&args.input, &camera, Some(args.fps)).map_err(no_input)?;
        source.stop_when(stop.clone());
        let rate_hz = source.describe().nominal_rate_hz;
        let played = runtime::play(
            source.as_mut(),
            &mut output,
            |first| Loopback::open(&args.to, first, rate_hz),
            &stop,
        );
        for warning in source.warnings() {
            say(&format!("arborcam: warning: {warning}"));
        }
        let played = played.map_err(|e| {
            if frames == 0 {
                no_input(e)
            } else {
                Ended::Failed(e.into())
            }
        })?;
        frames += played.frames;
        if played.stopped || !args.again {
            break played.stopped;
        }
    };
    say(&format!("{frames} frames played to {}", args.to.display()));
    if stopped { Err(Ended::Stopped) } else { Ok(()) }
}

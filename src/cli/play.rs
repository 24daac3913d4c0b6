//! `arborcam play INPUT --to /dev/videoN`: plays a recording to a virtual camera.

use super::command_error::CommandError;
use super::common::check_fps;
use super::hangup::SighupAction;
use super::output::eprint_line;
use super::session::init_log;
use super::signals::stop_on_signals;
use crate::config::Config;
use crate::runtime::{self, Played};
use crate::source::{self, Loopback, Source, SourceError};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

#[derive(Debug, Args)]
pub struct PlayArgs {
    /// A recording (.mcap), a video file (.mkv .avi .mp4) or a folder of pictures.
    input: PathBuf,
    /// The v4l2loopback device to play to, e.g. /dev/video9.
    #[arg(long, value_name = "DEVICE")]
    to: PathBuf,
    /// Start again at the end, until Ctrl-C.
    #[arg(long = "loop")]
    again: bool,
    /// Rate of a folder of pictures, frames per second.
    #[arg(long, value_name = "RATE", default_value_t = 30.0)]
    fps: f64,
}

pub fn run(args: &PlayArgs) -> Result<(), CommandError> {
    check_fps(args.fps)?;
    let stop = stop_on_signals(SighupAction::ends_this_process(), None)?;
    init_log(true);
    let mut output = None;
    let mut frames = 0;
    let stopped = loop {
        let mut config = Config::default();
        // A loopback device has colours alone.
        config.depth.read = false;
        let mut source =
            source::open(&args.input, &config, Some(args.fps)).map_err(CommandError::no_input)?;
        source.stop_when(stop.clone());
        let played = match play_once(source.as_mut(), &args.to, &mut output, &stop) {
            Ok(played) => played,
            Err(e) if frames == 0 => return Err(CommandError::no_input(e)),
            Err(e) => return Err(CommandError::failed(e)),
        };
        frames += played.frames;
        if played.stopped || !args.again {
            break played.stopped;
        }
    };
    eprint_line(&format!("{frames} frames played to {}", args.to.display()));
    if stopped {
        Err(CommandError::Stopped)
    } else {
        Ok(())
    }
}

/// Plays `source` to its end, and prints its warnings. The device `to` is opened for the first
/// frame and kept in `output`.
fn play_once(
    source: &mut dyn Source,
    to: &Path,
    output: &mut Option<Loopback>,
    stop: &AtomicBool,
) -> Result<Played, SourceError> {
    let rate_hz = source.describe().nominal_rate_hz;
    let played = runtime::play(
        source,
        output,
        |first| Loopback::open(to, first, rate_hz),
        stop,
    );
    for warning in source.warnings() {
        eprint_line(&format!("arborcam: warning: {warning}"));
    }
    played
}

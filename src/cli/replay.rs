//! `arborcam replay INPUT`: the whole way from a recording.

use super::common::Common;
use super::ended::Ended;
use super::recording::RecordOption;
use super::session::{self, Plan};
use crate::runtime::Pace;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// A recording (.mcap), a video file (.mkv .avi .mp4) or a folder of pictures (.png .jpg .bmp,
    /// in name order).
    input: PathBuf,
    /// As fast as the machine allows; nothing is dropped. Without it the recording's own pace is
    /// kept.
    #[arg(long)]
    fast: bool,
    /// Rate of a folder of pictures, frames a second.
    #[arg(long, value_name = "RATE", default_value_t = 30.0)]
    fps: f64,
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    record: RecordOption,
}

pub fn run(args: &ReplayArgs) -> Result<(), Ended> {
    if !(args.fps.is_finite() && args.fps > 0.0) {
        return Err(Ended::BadUsage(anyhow::anyhow!(
            "--fps {} is no rate; give a number above 0",
            args.fps
        )));
    }
    let pace = if args.fast {
        Pace::Fast
    } else {
        Pace::Recorded
    };
    session::run(
        &args.common,
        Plan {
            input: &args.input,
            fps: Some(args.fps),
            pace: Some(pace),
            camera: None,
            record: &args.record,
        },
    )
}

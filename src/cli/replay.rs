//! `arborcam replay INPUT`: from a recording to a moving tree.

use super::command_error::CommandError;
use super::common::{Common, check_fps};
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
    /// Process the frames as fast as the machine can, without dropping any. Without it the
    /// recording's own pace is kept.
    #[arg(long)]
    fast: bool,
    /// Rate of a folder of pictures, frames per second.
    #[arg(long, value_name = "RATE", default_value_t = 30.0)]
    fps: f64,
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    record: RecordOption,
}

pub fn run(args: &ReplayArgs) -> Result<(), CommandError> {
    check_fps(args.fps)?;
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

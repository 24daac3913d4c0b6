//! `arborcam replay INPUT`: from a recording to a moving tree.

use super::command_error::CommandError;
use super::common::{Common, check_fps};
use super::recording::RecordOption;
use super::session::{self, Plan};
use super::unused;
use crate::runtime::Pace;
use clap::Args;
use std::path::PathBuf;

/// Rate of a folder of pictures that nothing is said of, Hz.
const PICTURES_FPS: f64 = 30.0;

#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// A recording (.mcap), a ROS 1 recording with depth (.bag), a video file (.mkv .avi .mp4; of an Azure
    /// Kinect with its depth) or a folder: of pictures (.png .jpg .bmp, in name order), or with depth (rgb.txt,
    /// depth.txt).
    input: PathBuf,
    /// Process the frames as fast as the machine can, without dropping any. Without it the
    /// recording's own pace is kept.
    #[arg(long)]
    fast: bool,
    /// Rate of a folder of pictures, frames per second; 30 if not given.
    #[arg(long, value_name = "RATE")]
    fps: Option<f64>,
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    record: RecordOption,
}

pub fn run(args: &ReplayArgs) -> Result<(), CommandError> {
    let fps = args.fps.unwrap_or(PICTURES_FPS);
    check_fps(fps)?;
    if args.fps.is_some() && !args.input.is_dir() {
        unused::note("--fps", "a film has its own times");
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
            fps: Some(fps),
            pace: Some(pace),
            camera: None,
            record: &args.record,
        },
    )
}

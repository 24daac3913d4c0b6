//! `arborcam capture DEVICE`: from a camera to a moving tree, live.

use super::camera::CameraArgs;
use super::command_error::CommandError;
use super::common::Common;
use super::recording::RecordOption;
use super::session::{self, Plan};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct CaptureArgs {
    /// The camera: /dev/video0, a link to it, or its permanent name, as listed by
    /// `arborcam devices`. A recording is played at its own pace.
    device: PathBuf,
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    record: RecordOption,
}

pub fn run(args: &CaptureArgs) -> Result<(), CommandError> {
    session::run(
        &args.common,
        Plan {
            input: &args.device,
            fps: None,
            pace: None,
            camera: Some(&args.camera),
            record: &args.record,
        },
    )
}

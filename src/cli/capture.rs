//! `arborcam capture DEVICE`: the whole way, live.

use super::camera::CameraArgs;
use super::common::Common;
use super::ended::Ended;
use super::recording::RecordOption;
use super::session::{self, Plan};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct CaptureArgs {
    /// The camera: /dev/video0, a link to it, or the name that stays, all as `arborcam devices`
    /// lists them. A recording is taken at its own pace.
    device: PathBuf,
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    record: RecordOption,
}

pub fn run(args: &CaptureArgs) -> Result<(), Ended> {
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

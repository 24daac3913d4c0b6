//! `arborcam capture DEVICE`: the whole way, live.

use super::recording::RecordOption;
use super::session::{self, Plan};
use super::{Common, Ended};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct CaptureArgs {
    /// The camera, e.g. /dev/video0; `arborcam devices` lists them. A recording is taken at its own pace.
    device: PathBuf,
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    record: RecordOption,
}

pub fn run(args: &CaptureArgs) -> Result<(), Ended> {
    session::run(&args.common, Plan { input: &args.device, fps: None, pace: None, record: &args.record })
}

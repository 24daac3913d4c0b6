//! What can be asked of a camera on the command line, whatever is done with its frames.

use crate::config::{self, Backend};
use clap::Args;

#[derive(Debug, Args)]
pub struct CameraArgs {
    /// Take what the camera gives where it is not what was asked for.
    #[arg(long)]
    accept_format: bool,
    /// A camera that is silent for so many seconds counts as hung.
    #[arg(long, value_name = "S")]
    device_timeout: Option<f64>,
    /// A lost camera that is there again but does not start is tried again after so many seconds.
    #[arg(long, value_name = "S", conflicts_with = "once")]
    retry_delay: Option<f64>,
    /// End when the camera is lost, instead of waiting for it.
    #[arg(long)]
    once: bool,
    /// What the camera is read through; see docs/camera.md.
    #[arg(long, value_name = "v4l2|nokhwa", value_parser = backend)]
    backend: Option<Backend>,
}

fn backend(name: &str) -> Result<Backend, String> {
    match name {
        "v4l2" => Ok(Backend::V4l2),
        "nokhwa" => Ok(Backend::Nokhwa),
        _ => Err("give v4l2 or nokhwa".into()),
    }
}

impl CameraArgs {
    /// The command line goes before the file.
    pub fn set(&self, camera: &mut config::Camera) {
        camera.accept_format |= self.accept_format;
        camera.reconnect &= !self.once;
        camera.timeout_s = self.device_timeout.unwrap_or(camera.timeout_s);
        camera.retry_delay_s = self.retry_delay.unwrap_or(camera.retry_delay_s);
        camera.backend = self.backend.unwrap_or(camera.backend);
    }
}

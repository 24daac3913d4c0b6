//! Camera options, for every command that films.

use crate::config::{self, Backend};
use clap::Args;

#[derive(Debug, Args)]
pub struct CameraArgs {
    #[arg(long, help = config::help("camera.accept_format"))]
    accept_format: bool,
    #[arg(long, value_name = "S", help = config::help("camera.timeout_s"))]
    device_timeout: Option<f64>,
    #[arg(long, value_name = "S", conflicts_with = "once", help = config::help("camera.retry_delay_s"))]
    retry_delay: Option<f64>,
    /// End when the camera is lost, instead of waiting for it to return.
    #[arg(long)]
    once: bool,
    #[arg(long, value_name = "v4l2|nokhwa", value_parser = backend, help = config::help("camera.backend"))]
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
    /// Applies the options of the command line.
    pub fn set(&self, camera: &mut config::Camera) {
        camera.accept_format |= self.accept_format;
        camera.reconnect &= !self.once;
        camera.timeout_s = self.device_timeout.unwrap_or(camera.timeout_s);
        camera.retry_delay_s = self.retry_delay.unwrap_or(camera.retry_delay_s);
        camera.backend = self.backend.unwrap_or(camera.backend);
    }
}

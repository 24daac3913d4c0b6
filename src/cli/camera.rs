//! Camera options, for every command that films.

use super::command_error::CommandError;
use super::common::setting;
use crate::config::{self, Backend};
use crate::source::SourceInfo;
use anyhow::anyhow;
use clap::Args;

#[derive(Debug, Args)]
pub struct CameraArgs {
    #[arg(long, help = config::help("camera.accept_format"))]
    accept_format: bool,
    #[arg(long, value_name = "S", value_parser = setting("camera.timeout_s"), help = config::help("camera.timeout_s"))]
    device_timeout: Option<f64>,
    #[arg(
        long,
        value_name = "S",
        conflicts_with = "once",
        value_parser = setting("camera.retry_delay_s"),
        help = config::help("camera.retry_delay_s")
    )]
    retry_delay: Option<f64>,
    /// End when the camera is lost, instead of waiting for it to return.
    #[arg(long)]
    once: bool,
    /// A depth camera beside the camera: its device, e.g. /dev/video2, or its permanent name, as
    /// listed by `arborcam devices`. Needs --depth-unit, and --depth-camera with both cameras unless
    /// its images are registered with the colours. See docs/depth.md.
    #[arg(long, value_name = "DEVICE", conflicts_with = "no_depth")]
    depth: Option<String>,
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

/// Refuses a depth camera beside what is no camera.
///
/// # Errors
/// There is one.
pub fn check_depth(args: &CameraArgs, info: &SourceInfo) -> Result<(), CommandError> {
    if args.names_depth() && !info.live {
        return Err(CommandError::BadUsage(anyhow!(
            "--depth is for a camera, and {} is none; its own depth is read without it",
            info.name
        )));
    }
    Ok(())
}

impl CameraArgs {
    /// Whether a depth camera is named.
    pub fn names_depth(&self) -> bool {
        self.depth.is_some()
    }

    /// Applies the options of the command line.
    pub fn set(&self, config: &mut config::Config) {
        if let Some(device) = &self.depth {
            config.depth.device.clone_from(device);
        }
        let camera = &mut config.camera;
        camera.accept_format |= self.accept_format;
        camera.reconnect &= !self.once;
        camera.timeout_s = self.device_timeout.unwrap_or(camera.timeout_s);
        camera.retry_delay_s = self.retry_delay.unwrap_or(camera.retry_delay_s);
        camera.backend = self.backend.unwrap_or(camera.backend);
    }
}

//! Where frames come from: a camera, a recording, a video file or a folder of pictures, all behind
//! one trait.
//!
//! A source hands frames out as they left the camera or the file, with their own number and time;
//! [`Decoder`] turns them into the pictures that the tracker and the screen want.

mod camera_file;
mod choice;
mod clock;
mod decode;
mod depth_camera;
mod depth_format;
mod depth_tally;
mod devices;
mod error;
mod identity;
mod images;
mod interface;
mod kinect;
mod kinect_calibration;
mod loopback;
mod opened;
mod photograph;
mod probe;
mod recording;
mod rgbd_folder;
#[cfg(feature = "nokhwa")]
mod through_nokhwa;
mod v4l2;
mod video;
mod video_pipe;

pub use camera_file::{CameraFile, CameraFileError};
pub use choice::Mode;
pub use clock::ClockKind;
pub use decode::{DecodeError, Decoder};
pub use depth_tally::DepthTally;
pub use devices::{Device, list, list_for};
pub use error::{SourceError, group_name};
pub use identity::{Identity, Places};
pub use interface::{Health, Source, SourceInfo, Successor};
pub use kinect_calibration::kinect_rig;
pub use loopback::Loopback;
pub use photograph::{Photograph, PhotographError, image_format};

use crate::config::{self, Config};
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

/// Opens whatever `input` is, a path or the identity of a camera; `fps` is the rate of a folder of
/// pictures (30 if not given), nothing else needs it.
///
/// # Errors
/// There is nothing that can be read as frames; the error says why and what to do.
pub fn open(
    input: &Path,
    config: &Config,
    fps: Option<f64>,
) -> Result<Box<dyn Source>, SourceError> {
    let name = input.display().to_string();
    let named;
    let input = match input.to_str() {
        Some(name) => {
            named = device(name)?;
            &named
        }
        None => input,
    };
    let kind = std::fs::metadata(input)
        .map_err(|e| SourceError::of_file(input, &e))?
        .file_type();
    if kind.is_char_device() {
        open_cameras(input, config)
    } else if kind.is_dir() && rgbd_folder::is_one(input) {
        Ok(Box::new(rgbd_folder::RgbdFolder::open(
            input,
            &config.depth,
        )?))
    } else if kind.is_dir() {
        Ok(Box::new(images::Images::open(input, fps.unwrap_or(30.0))?))
    } else if !kind.is_file() {
        let what = "it is neither a camera, nor a video file, nor a folder of pictures".to_owned();
        Err(SourceError::BadFormat { input: name, what })
    } else if input
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("mcap") || e.eq_ignore_ascii_case("bag"))
    {
        Ok(Box::new(recording::Recording::open(input, &config.depth)?))
    } else if config.depth.read
        && let Some(tracks) = kinect::Tracks::of(input)
    {
        Ok(Box::new(kinect::Kinect::open(
            input,
            tracks,
            &config.depth,
        )?))
    } else {
        Ok(Box::new(video::Video::open(input)?))
    }
}

/// Where an input is: itself, or the device of this identity.
fn device(name: &str) -> Result<PathBuf, SourceError> {
    let path = PathBuf::from(name);
    match devices::is_identity(name) && !path.exists() {
        true => devices::by_identity(name, &Places::default()),
        false => Ok(path),
    }
}

/// Opens a camera, and the depth camera beside it if there is to be one.
fn open_cameras(path: &Path, config: &Config) -> Result<Box<dyn Source>, SourceError> {
    let camera = open_camera(path, &config.camera)?;
    let settings = &config.depth;
    if !settings.read || settings.device.is_empty() {
        return Ok(camera);
    }
    let depth = device(&settings.device)?;
    let depth = depth_camera::DepthCamera::open(&depth, config, camera.describe().size)?;
    Ok(Box::new(depth_camera::Beside::new(camera, Box::new(depth))))
}

fn open_camera(path: &Path, config: &config::Camera) -> Result<Box<dyn Source>, SourceError> {
    match config.backend {
        config::Backend::V4l2 => Ok(Box::new(v4l2::Camera::open(path, config)?)),
        #[cfg(feature = "nokhwa")]
        config::Backend::Nokhwa => Ok(Box::new(through_nokhwa::NokhwaCamera::open(path, config)?)),
        #[cfg(not(feature = "nokhwa"))]
        config::Backend::Nokhwa => Err(SourceError::BadFormat {
            input: path.display().to_string(),
            what: "the backend \"nokhwa\" was left out of this build; use --backend v4l2, \
                   or build with the cargo feature nokhwa"
                .to_owned(),
        }),
    }
}

#[cfg(all(test, not(feature = "nokhwa")))]
mod tests {
    use super::*;
    use crate::config::Backend;

    #[test]
    fn a_backend_that_was_left_out_is_named() {
        let mut wanted = Config::default();
        wanted.camera.backend = Backend::Nokhwa;
        // Any character device; it is not even opened.
        let refused = open(Path::new("/dev/null"), &wanted, None).err();
        let said = refused.map(|e| e.to_string()).unwrap_or_default();
        assert!(
            said.contains("\"nokhwa\" was left out of this build"),
            "{said}"
        );
    }
}

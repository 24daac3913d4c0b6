//! Cameras that are plugged in.

use nokhwa::utils::{ApiBackend, CameraIndex};
use std::path::PathBuf;

/// A video device of this machine; not every one of them films.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    pub path: PathBuf,
    /// What the driver calls it.
    pub name: String,
    /// Driver and bus where they can be asked, e.g. `uvcvideo at usb-0000:00:14.0-1`, else what is known.
    pub description: String,
}

/// All video devices, by number; none is no error.
pub fn list() -> Vec<Device> {
    // An error means that there is nothing to list: no V4L2 in the kernel, or a sandbox without /dev.
    let mut found: Vec<(u32, Device)> = nokhwa::query(ApiBackend::Video4Linux)
        .unwrap_or_default()
        .into_iter()
        .filter_map(|camera| {
            let CameraIndex::Index(number) = camera.index() else { return None };
            let path = PathBuf::from(format!("/dev/video{number}"));
            let description = describe(&path).unwrap_or_else(|| camera.description().to_owned());
            Some((*number, Device { path, name: camera.human_name().trim().to_owned(), description }))
        })
        .collect();
    found.sort_by_key(|(number, _)| *number);
    found.into_iter().map(|(_, device)| device).collect()
}

fn describe(path: &std::path::Path) -> Option<String> {
    let caps = v4l::Device::with_path(path).ok()?.query_caps().ok()?;
    let films = caps.capabilities.contains(v4l::capability::Flags::VIDEO_CAPTURE);
    let kind = if films { "" } else { ", does not film" };
    Some(format!("{} at {}{kind}", caps.driver, caps.bus))
}

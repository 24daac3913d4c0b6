//! What there is to film with, and a second of film.

use crate::config::{self, Config};
use crate::source::{self, SourceError};
use std::fs::OpenOptions;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Frames of the sample, and the time that is taken for it at most.
const SAMPLE: usize = 15;
const SAMPLE_LIMIT: Duration = Duration::from_secs(4);
/// A camera that says nothing for so long here is called silent, s.
const SILENCE_S: f64 = 3.0;

/// The cameras, and the one that would be taken.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seen {
    /// Path and name of everything that films.
    pub films: Vec<(PathBuf, String)>,
    /// The same of what gives depth.
    pub depths: Vec<(PathBuf, String)>,
    /// The named one, else the first that films.
    pub chosen: Option<PathBuf>,
}

/// What opening the device says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Node {
    Opens,
    Absent,
    /// With the group that may, where there is one.
    Denied(Option<String>),
    Refuses(String),
}

/// A short sample of film.
#[derive(Clone, Debug, PartialEq)]
pub enum Film {
    Frames {
        asked: String,
        given: String,
        /// Sensor times, s, and the kernel's monotonic clock when the last frame was handed over,
        /// s.
        times_s: Vec<f64>,
        now_s: f64,
        /// Mean size of a frame as delivered, bytes.
        bytes: usize,
    },
    /// Somebody else films with it at present.
    Busy(String),
    Failed(String),
}

pub fn seen(device: Option<&Path>) -> Seen {
    let (mut films, mut depths) = (Vec::new(), Vec::new());
    for device in source::list() {
        if !device.depth_modes.is_empty() {
            depths.push((device.path.clone(), device.name.clone()));
        }
        if device.films {
            films.push((device.path, device.name));
        }
    }
    let chosen = device
        .map(Path::to_path_buf)
        .or_else(|| films.first().map(|(path, _)| path.clone()));
    Seen {
        films,
        depths,
        chosen,
    }
}

pub fn node(device: &Path) -> Node {
    match OpenOptions::new().read(true).write(true).open(device) {
        Ok(_) => Node::Opens,
        Err(e) if e.kind() == ErrorKind::NotFound => Node::Absent,
        Err(e) if e.kind() == ErrorKind::PermissionDenied => Node::Denied(group(device)),
        Err(e) => Node::Refuses(e.to_string()),
    }
}

fn group(device: &Path) -> Option<String> {
    use std::os::unix::fs::MetadataExt;
    let gid = std::fs::metadata(device)
        .ok()
        .filter(|m| m.mode() & 0o060 == 0o060 && m.gid() != 0)?
        .gid();
    source::group_name(gid)
}

pub fn film(device: &Path, settings: &config::Camera) -> Film {
    // Never through nokhwa, which may wait for ever; what is looked at here is the same either way.
    let (timeout_s, backend) = (settings.timeout_s.min(SILENCE_S), config::Backend::V4l2);
    let settings = config::Camera {
        timeout_s,
        backend,
        ..settings.clone()
    };
    match sample(device, &settings) {
        Ok(film) => film,
        Err(e @ SourceError::Busy { .. }) => Film::Busy(e.to_string()),
        Err(e) => Film::Failed(e.to_string()),
    }
}

fn sample(device: &Path, settings: &config::Camera) -> Result<Film, SourceError> {
    let config = Config {
        camera: settings.clone(),
        ..Config::default()
    };
    let mut source = source::open(device, &config, None)?;
    let format = source.describe().format;
    let (until, mut times_s, mut bytes, mut now_s) =
        (Instant::now() + SAMPLE_LIMIT, Vec::new(), 0, 0.0);
    while times_s.len() < SAMPLE && Instant::now() < until {
        let Some(frame) = source.next_frame()? else {
            break;
        };
        now_s = monotonic_s();
        times_s.push(frame.sensor_time_s);
        bytes += frame.bytes.len();
    }
    let bytes = bytes / times_s.len().max(1);
    Ok(Film::Frames {
        asked: format.asked,
        given: format.given,
        times_s,
        now_s,
        bytes,
    })
}

/// The kernel's monotonic clock, which drivers stamp frames with, s.
fn monotonic_s() -> f64 {
    let mut now = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: the pointer is to a timespec that lives through the call.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut now) };
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

//! A camera read through the nokhwa crate, for those that fail with our own way. It waits for a frame without a limit, and
//! tells neither numbers nor flags nor times: the time is that of reception, and whoever runs it must watch it.

use super::choice::{Granted, Wish};
use super::clock::ClockKind;
use super::identity::{Known, Places};
use super::v4l2::prospect;
use super::{Health, Source, SourceError, SourceInfo};
use crate::config;
use crate::model::{FormatNote, PixelFormat, RawFrame, Size};
use nokhwa::utils::{
    ApiBackend, CameraFormat, CameraIndex, FrameFormat, RequestedFormat, RequestedFormatType, Resolution,
};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A camera that films through nokhwa.
pub(super) struct NokhwaCamera {
    known: Known,
    path: PathBuf,
    name: String,
    asked: Wish,
    granted: Granted,
    substitute: bool,
    camera: Option<nokhwa::Camera>,
    timeout: Duration,
    opened: Instant,
    last_s: f64,
    damaged: u64,
}

impl NokhwaCamera {
    pub(super) fn open(path: &Path, config: &config::Camera) -> Result<Self, SourceError> {
        let asked = Wish::of(config);
        // What it lists is asked for in our own way: nokhwa leaves out ranges and what it has no name for.
        let prospect = prospect(path, config)?;
        let best = prospect.chosen.map(|(granted, _)| granted);
        let wanted = best.unwrap_or(Granted {
            format: asked.format.unwrap_or(PixelFormat::Mjpeg),
            size: asked.size,
            rate_hz: Some(asked.rate_hz),
        });
        if !asked.is_met_by(&wanted) && !config.accept_format {
            let what = format!("asked for {asked}, it offers {wanted}; take that with --accept-format");
            return Err(SourceError::BadFormat { input: path.display().to_string(), what });
        }
        let known = Known::new(Places::default(), path);
        let (camera, granted) = start(path, &wanted, asked.rate_hz)?;
        Ok(Self {
            known,
            path: path.to_owned(),
            name: prospect.card,
            asked,
            granted,
            substitute: !asked.is_met_by(&granted),
            camera: Some(camera),
            timeout: config.time_limit(),
            opened: Instant::now(),
            last_s: 0.0,
            damaged: 0,
        })
    }
}

impl Source for NokhwaCamera {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        let Granted { format, size, .. } = self.granted;
        let shown = self.path.display().to_string();
        loop {
            let Some(camera) = &mut self.camera else {
                return Err(SourceError::Disconnected { input: shown, reason: "it is closed".into() });
            };
            let taken = guarded(|| camera.frame_raw().map(|bytes| picture(&bytes, format, size)));
            let bytes = match taken {
                Ok(bytes) => bytes,
                Err(reason) => {
                    self.camera = None;
                    return Err(SourceError::Disconnected { input: shown, reason });
                }
            };
            let Some(bytes) = bytes else {
                self.damaged += 1;
                continue;
            };
            // Two frames that come at once are told apart by the least step.
            self.last_s = self.opened.elapsed().as_secs_f64().max(self.last_s + 1e-4);
            return Ok(Some(RawFrame { sequence: None, sensor_time_s: self.last_s, size, format, bytes }));
        }
    }

    fn describe(&self) -> SourceInfo {
        let identity = self.known.identity().map_or(String::new(), |i| format!(", {}", i.id));
        let given = self.granted.to_string();
        SourceInfo {
            name: format!("{} ({}{identity}, through nokhwa)", self.path.display(), self.name),
            format: FormatNote { asked: if self.substitute { self.asked.to_string() } else { given.clone() }, given },
            size: self.granted.size,
            nominal_rate_hz: self.granted.rate_hz,
            frames_total: None,
            live: true,
        }
    }

    fn returns(&self) -> bool {
        true
    }

    fn reopen(&mut self) -> Result<(), SourceError> {
        self.camera = None;
        let absent = || SourceError::Absent { input: self.path.display().to_string(), hint: "plug it in again" };
        let path = self.known.find().ok_or_else(absent)?;
        let (camera, granted) = start(&path, &self.granted, self.asked.rate_hz)?;
        if granted != self.granted {
            let what = format!("it came back with {granted} instead of {}; set it back, or start anew", self.granted);
            return Err(SourceError::BadFormat { input: path.display().to_string(), what });
        }
        (self.camera, self.path) = (Some(camera), path);
        Ok(())
    }

    fn health(&self) -> Health {
        Health { damaged: self.damaged, stale: 0, clock: ClockKind::Received }
    }

    fn waits_without_limit(&self) -> Option<Duration> {
        Some(self.timeout)
    }
}

/// The crate divides by what drivers tell it and steps by it, which may be zero.
fn guarded<T>(call: impl FnOnce() -> Result<T, nokhwa::NokhwaError>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(done) => done.map_err(|e| e.to_string().replace('\n', " ")),
        Err(_) => Err("nokhwa cannot cope with this camera; use --backend v4l2".into()),
    }
}

fn start(path: &Path, wanted: &Granted, rate_hz: f64) -> Result<(nokhwa::Camera, Granted), SourceError> {
    let input = path.display().to_string();
    let bad = |what: String| SourceError::BadFormat { input: input.clone(), what };
    let target = std::fs::canonicalize(path).map_err(|e| SourceError::of_file(path, &e))?;
    let number = target.file_name().and_then(|n| n.to_str()?.strip_prefix("video")?.parse().ok());
    let number = number.ok_or_else(|| bad("nokhwa takes /dev/videoN only".into()))?;
    let format = frame_format(wanted.format).ok_or_else(|| {
        bad(format!("nokhwa does not read {}; set camera.format, or use --backend v4l2", wanted.format))
    })?;
    let size = Resolution::new(wanted.size.width, wanted.size.height);
    let exact = CameraFormat::new(size, format, wanted.rate_hz.unwrap_or(rate_hz).round() as u32);
    let formats = [format];
    let request = RequestedFormat::with_formats(RequestedFormatType::Exact(exact), &formats);
    let opened = guarded(|| {
        let mut camera = nokhwa::Camera::with_backend(CameraIndex::Index(number), request, ApiBackend::Video4Linux)?;
        camera.open_stream()?;
        Ok(camera)
    });
    let camera = opened.map_err(|e| bad(format!("nokhwa: {e}; try --backend v4l2")))?;
    let given = camera.camera_format();
    let granted = Granted {
        format: wanted.format,
        size: Size::new(given.width(), given.height()),
        rate_hz: Some(f64::from(given.frame_rate())),
    };
    if given.format() != format || granted.size != wanted.size {
        return Err(bad(format!("nokhwa gives {given} where {wanted} was asked; use --backend v4l2")));
    }
    Ok((camera, granted))
}

/// nokhwa's grey goes by a name that no driver uses.
fn frame_format(format: PixelFormat) -> Option<FrameFormat> {
    match format {
        PixelFormat::Mjpeg => Some(FrameFormat::MJPEG),
        PixelFormat::Yuyv => Some(FrameFormat::YUYV),
        PixelFormat::Nv12 => Some(FrameFormat::NV12),
        PixelFormat::Rgb24 => Some(FrameFormat::RAWRGB),
        PixelFormat::Uyvy | PixelFormat::Grey => None,
    }
}

/// The picture within the whole buffer, of which nokhwa does not say how much was written.
fn picture(buffer: &[u8], format: PixelFormat, size: Size) -> Option<Vec<u8>> {
    let length = match format.picture_bytes(size) {
        Some(length) => length,
        None => jpeg_length(buffer)?,
    };
    buffer.get(..length).filter(|b| !b.is_empty()).map(<[u8]>::to_vec)
}

/// Length of the JPEG at the start of `buffer`: behind it may lie the rest of an older and longer one.
fn jpeg_length(buffer: &[u8]) -> Option<usize> {
    if !buffer.starts_with(&[0xFF, 0xD8]) {
        return None;
    }
    let mut at = 2;
    // Segments with their lengths up to the start of the scan; a preview inside of one has an end mark of its own.
    loop {
        let [mark, kind, high, low] = *buffer.get(at..at + 4)?.first_chunk()?;
        if mark != 0xFF {
            return None;
        }
        at += 2 + (usize::from(high) << 8 | usize::from(low));
        if kind == 0xDA {
            break;
        }
    }
    let end = buffer.get(at..)?.windows(2).position(|w| w == [0xFF, 0xD9])?;
    Some(at + end + 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jpeg_ends_at_its_own_end_mark() {
        let mut jpeg = vec![0xFF, 0xD8, 0xFF, 0xE1, 0x00, 0x06, 0xFF, 0xD9, 1, 2, 0xFF, 0xDA, 0x00, 0x02];
        jpeg.extend([7, 7, 0xFF, 0x00, 7, 0xFF, 0xD9]);
        let length = jpeg.len();
        jpeg.extend([3, 3, 0xFF, 0xD9, 0, 0]);
        assert_eq!(jpeg_length(&jpeg), Some(length));
        for cut in 0..length {
            assert_eq!(jpeg_length(&jpeg[..cut]), None, "{cut}");
        }
        assert_eq!(picture(&[0; 7], PixelFormat::Yuyv, Size::new(2, 2)), None);
        assert_eq!(picture(&[0; 9], PixelFormat::Yuyv, Size::new(2, 2)).map(|b| b.len()), Some(8));
    }
}

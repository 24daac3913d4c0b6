//! A camera read through the nokhwa crate, for those that fail with our own way. It waits for a
//! frame without a limit, and tells neither numbers nor flags nor times: the time is that of
//! reception.

use super::choice::{Granted, Wish};
use super::clock::ClockKind;
use super::error::SourceError;
use super::identity::{Known, Places};
use super::interface::{Health, Source, SourceInfo, Successor};
use super::opened::{describe, same_again};
use super::v4l2::prospect;
use crate::caught::caught;
use crate::config;
use crate::model::{PixelFormat, RawFrame, Size};
use nokhwa::utils::{
    ApiBackend, CameraFormat, CameraIndex, FrameFormat, RequestedFormat, RequestedFormatType,
    Resolution,
};
use std::fs::OpenOptions;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// What a camera is known by, and what was agreed with it.
#[derive(Clone)]
struct Agreed {
    known: Known,
    path: PathBuf,
    name: String,
    asked: Wish,
    granted: Granted,
    timeout: Duration,
    /// Zero of the frames' times.
    opened: Instant,
}

/// What goes on from one opening to the next.
#[derive(Clone, Default)]
struct Progress {
    last_s: f64,
    damaged: u64,
}

/// A camera that films through nokhwa.
pub(super) struct NokhwaCamera {
    agreed: Agreed,
    /// Its successor reads this while a call to nokhwa hangs: never locked during one.
    progress: Arc<Mutex<Progress>>,
    camera: Opened,
}

impl NokhwaCamera {
    pub(super) fn open(path: &Path, config: &config::Camera) -> Result<Self, SourceError> {
        let asked = Wish::of(config);
        // What it lists is asked for in our own way: nokhwa leaves out ranges and what it has no
        // name for.
        let prospect = prospect(path, config)?;
        let best = prospect.chosen.map(|(granted, _)| granted);
        let wanted = best.unwrap_or(Granted {
            format: asked.format.unwrap_or(PixelFormat::Mjpeg),
            size: asked.size,
            rate_hz: Some(asked.rate_hz),
        });
        accept(path, config, &asked, &wanted)?;
        let known = Known::new(Places::default(), path);
        let (camera, granted) = start(path, &wanted, asked.rate_hz)?;
        accept(path, config, &asked, &granted)?;
        Ok(Self {
            agreed: Agreed {
                known,
                path: path.to_owned(),
                name: prospect.card,
                asked,
                granted,
                timeout: config.time_limit(),
                opened: Instant::now(),
            },
            progress: Arc::default(),
            camera,
        })
    }

    fn progress(&self) -> MutexGuard<'_, Progress> {
        lock(&self.progress)
    }

    fn disconnected(&self, reason: String) -> SourceError {
        SourceError::Disconnected {
            input: self.agreed.path.display().to_string(),
            reason,
        }
    }
}

fn lock(progress: &Mutex<Progress>) -> MutexGuard<'_, Progress> {
    progress.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Refuses what was not asked for, unless the settings take whatever comes.
fn accept(
    path: &Path,
    config: &config::Camera,
    asked: &Wish,
    offered: &Granted,
) -> Result<(), SourceError> {
    if asked.is_met_by(offered) || config.accept_format {
        return Ok(());
    }
    let what = format!("asked for {asked}, it offers {offered}; take that with --accept-format");
    Err(SourceError::bad_format(path, what))
}

/// The crate panics, too, where a driver does not take back what it gave, as one does that is gone.
struct Opened(Option<nokhwa::Camera>);

impl Opened {
    fn close(&mut self) {
        let camera = self.0.take();
        let _ = caught(|| drop(camera));
    }
}

impl Drop for Opened {
    fn drop(&mut self) {
        self.close();
    }
}

impl Source for NokhwaCamera {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        let Granted { format, size, .. } = self.agreed.granted;
        let Some(camera) = &mut self.camera.0 else {
            return Err(self.disconnected("it is closed".into()));
        };
        let mut damaged = 0;
        let taken = first_usable(
            || {
                guarded(|| {
                    let bytes = camera.frame_raw()?;
                    Ok(picture(&bytes, format, size))
                })
            },
            self.agreed.timeout,
            &mut damaged,
        );
        let received_s = self.agreed.opened.elapsed().as_secs_f64();
        let mut progress = self.progress();
        progress.damaged += damaged;
        match taken {
            Ok(Some(bytes)) => {
                // Two frames that come at once are told apart by the least step.
                progress.last_s = received_s.max(progress.last_s + 1e-4);
                Ok(Some(RawFrame {
                    sequence: None,
                    sensor_time_s: progress.last_s,
                    size,
                    format,
                    bytes,
                    depth: None,
                }))
            }
            Ok(None) => Err(SourceError::Timeout {
                input: self.agreed.path.display().to_string(),
                seconds: self.agreed.timeout.as_secs_f64(),
            }),
            Err(reason) => Err(self.disconnected(reason)),
        }
    }

    fn describe(&self) -> SourceInfo {
        let agreed = &self.agreed;
        let name = format!("{}, through nokhwa", agreed.name);
        describe(
            &agreed.path,
            &name,
            &agreed.known,
            &agreed.asked,
            &agreed.granted,
        )
    }

    fn adopt(&mut self, config: &config::Camera) {
        self.agreed.timeout = config.time_limit();
    }

    fn close(&mut self) {
        self.camera.close();
    }

    fn returns(&self) -> bool {
        true
    }

    fn reopen(&mut self) -> Result<(), SourceError> {
        self.close();
        let agreed = &self.agreed;
        let path = agreed.known.find().ok_or_else(|| SourceError::Absent {
            input: agreed.path.display().to_string(),
            hint: "plug it in again",
        })?;
        let (camera, granted) = start(&path, &agreed.granted, agreed.asked.rate_hz)?;
        same_again(&path, &agreed.granted, &granted)?;
        self.camera = camera;
        self.agreed.path = path;
        Ok(())
    }

    fn successor(&self) -> Option<Successor> {
        let (agreed, progress) = (self.agreed.clone(), self.progress.clone());
        Some(Box::new(move || {
            let so_far = lock(&progress).clone();
            Box::new(NokhwaCamera {
                agreed: agreed.clone(),
                progress: Arc::new(Mutex::new(so_far)),
                camera: Opened(None),
            })
        }))
    }

    fn health(&self) -> Health {
        Health {
            damaged: self.progress().damaged,
            stale: 0,
            clock: ClockKind::Received,
        }
    }
}

/// The crate divides by what drivers tell it and steps by it, which may be zero.
fn guarded<T>(call: impl FnOnce() -> Result<T, nokhwa::NokhwaError>) -> Result<T, String> {
    match caught(call) {
        Some(done) => done.map_err(|e| e.to_string().replace('\n', " ")),
        None => Err("nokhwa cannot cope with this camera; use --backend v4l2".into()),
    }
}

fn start(path: &Path, wanted: &Granted, rate_hz: f64) -> Result<(Opened, Granted), SourceError> {
    let target = std::fs::canonicalize(path).map_err(|e| SourceError::of_file(path, &e))?;
    let number = target
        .file_name()
        .and_then(|n| n.to_str()?.strip_prefix("video")?.parse().ok());
    let number =
        number.ok_or_else(|| SourceError::bad_format(path, "nokhwa takes /dev/videoN only"))?;
    // nokhwa gives no reason that could be told from another: one that may not be opened yet is to
    // be looked at again.
    let may_open = OpenOptions::new().read(true).write(true).open(&target);
    may_open.map_err(|e| SourceError::of_driver(path, "opening it", &e))?;
    let format = frame_format(wanted.format).ok_or_else(|| {
        let what = format!(
            "nokhwa does not read {}; set camera.format, or use --backend v4l2",
            wanted.format
        );
        SourceError::bad_format(path, what)
    })?;
    let size = Resolution::new(wanted.size.width, wanted.size.height);
    let exact = CameraFormat::new(
        size,
        format,
        wanted.rate_hz.unwrap_or(rate_hz).round() as u32,
    );
    let formats = [format];
    let request = RequestedFormat::with_formats(RequestedFormatType::Exact(exact), &formats);
    let opened = guarded(|| {
        let mut camera = nokhwa::Camera::with_backend(
            CameraIndex::Index(number),
            request,
            ApiBackend::Video4Linux,
        )?;
        camera.open_stream()?;
        Ok(camera)
    });
    let camera = Opened(Some(opened.map_err(|e| {
        SourceError::bad_format(path, format!("nokhwa: {e}; try --backend v4l2"))
    })?));
    let given = camera
        .0
        .as_ref()
        .map_or(exact, nokhwa::Camera::camera_format);
    let granted = Granted {
        format: wanted.format,
        size: Size::new(given.width(), given.height()),
        rate_hz: Some(f64::from(given.frame_rate())),
    };
    if given.format() != format || granted.size != wanted.size {
        let what = format!("nokhwa gives {given} where {wanted} was asked; use --backend v4l2");
        return Err(SourceError::bad_format(path, what));
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
        PixelFormat::Uyvy | PixelFormat::Grey | PixelFormat::Z16 | PixelFormat::Y16 => None,
    }
}

/// The first picture of any use among those that `take` gives; `None` if there is none within the
/// limit.
fn first_usable(
    mut take: impl FnMut() -> Result<Option<Vec<u8>>, String>,
    limit: Duration,
    damaged: &mut u64,
) -> Result<Option<Vec<u8>>, String> {
    let until = Instant::now() + limit;
    loop {
        if let Some(bytes) = take()? {
            return Ok(Some(bytes));
        }
        *damaged += 1;
        if Instant::now() >= until {
            return Ok(None);
        }
    }
}

/// The picture within the whole buffer, of which nokhwa does not say how much was written.
fn picture(buffer: &[u8], format: PixelFormat, size: Size) -> Option<Vec<u8>> {
    let length = match format.picture_bytes(size) {
        Some(length) => length,
        None => jpeg_length(buffer)?,
    };
    buffer
        .get(..length)
        .filter(|b| !b.is_empty())
        .map(<[u8]>::to_vec)
}

/// Length of the JPEG at the start of `buffer`: behind it may lie the rest of an older and longer
/// one.
fn jpeg_length(buffer: &[u8]) -> Option<usize> {
    if !buffer.starts_with(&[0xFF, 0xD8]) {
        return None;
    }
    let mut at = 2;
    // Segments with their lengths up to the start of the scan; a preview inside of one has an end
    // mark of its own.
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
    let end = buffer
        .get(at..)?
        .windows(2)
        .position(|w| w == [0xFF, 0xD9])?;
    Some(at + end + 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_no_use_are_counted_and_end_in_time() {
        let (mut taken, mut damaged) = (0, 0);
        let third = || {
            taken += 1;
            Ok((taken == 3).then(|| vec![7]))
        };
        assert_eq!(
            first_usable(third, Duration::from_secs(60), &mut damaged),
            Ok(Some(vec![7]))
        );
        assert_eq!(damaged, 2);
        let never = || {
            std::thread::sleep(Duration::from_millis(1));
            Ok(None)
        };
        assert_eq!(
            first_usable(never, Duration::from_millis(20), &mut damaged),
            Ok(None)
        );
        assert!(damaged > 2);
    }

    #[test]
    fn a_jpeg_ends_at_its_own_end_mark() {
        let mut jpeg = vec![
            0xFF, 0xD8, 0xFF, 0xE1, 0x00, 0x06, 0xFF, 0xD9, 1, 2, 0xFF, 0xDA, 0x00, 0x02,
        ];
        jpeg.extend([7, 7, 0xFF, 0x00, 7, 0xFF, 0xD9]);
        let length = jpeg.len();
        jpeg.extend([3, 3, 0xFF, 0xD9, 0, 0]);
        assert_eq!(jpeg_length(&jpeg), Some(length));
        for cut in 0..length {
            assert_eq!(jpeg_length(&jpeg[..cut]), None, "{cut}");
        }
        assert_eq!(picture(&[0; 7], PixelFormat::Yuyv, Size::new(2, 2)), None);
        assert_eq!(
            picture(&[0; 9], PixelFormat::Yuyv, Size::new(2, 2)).map(|b| b.len()),
            Some(8)
        );
    }
}

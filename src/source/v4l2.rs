//! A V4L2 camera: one negotiation of the format, then frames from mapped buffers, each copied once.

use super::clock::Clock;
use super::{Source, SourceError, SourceInfo};
use crate::config::{self, CameraFormat};
use crate::model::{FormatNote, PixelFormat, RawFrame, Size};
use std::io;
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use v4l::buffer::{Flags, Type};
use v4l::capability::Flags as Caps;
use v4l::io::traits::{CaptureStream, Stream as _};
use v4l::video::Capture;
use v4l::video::capture::Parameters;
use v4l::{Device, Format, FourCC};

/// One is with us, one is being filled, and two wait in between for as long as the system has other things to do.
const BUFFERS: u32 = 4;
/// Longest wait after which a wish to stop is heard, ms.
const NAP_MS: i32 = 50;

/// The first picture of this driver is what happens to lie in its buffer, with a fresh time on it.
const LOOPBACK: &str = "v4l2 loopback";

/// A camera that films.
pub(super) struct Camera {
    path: PathBuf,
    name: String,
    asked: String,
    rate_hz: Option<f64>,
    /// Its own drop panics if the driver refuses to stop, see [`Drop`] below.
    stream: ManuallyDrop<v4l::io::mmap::Stream<'static>>,
    size: Size,
    format: PixelFormat,
    /// Bytes from one line to the next one in the driver's buffer.
    stride: usize,
    timeout: Duration,
    clock: Clock,
    /// Frames still to be left out at the beginning.
    leave_out: u32,
    stop: Arc<AtomicBool>,
    damaged: u64,
    stale: u64,
}

impl Camera {
    pub(super) fn open(path: &Path, config: &config::Camera) -> Result<Self, SourceError> {
        let input = path.display().to_string();
        let failed = |doing: &'static str| move |e: io::Error| SourceError::of_driver(path, doing, &e);
        let device = Device::with_path(path).map_err(failed("opening it"))?;
        let caps = device.query_caps().map_err(failed("asking for its abilities"))?;
        if !caps.capabilities.contains(Caps::VIDEO_CAPTURE | Caps::STREAMING) {
            let what = "it does not film (or nothing feeds it yet); `arborcam devices` lists what does".to_owned();
            return Err(SourceError::BadFormat { input, what });
        }
        let (granted, asked) = negotiate(&device, config).map_err(failed("setting the picture format"))?;
        let format = granted.fourcc.str().ok().and_then(PixelFormat::from_fourcc);
        let Some(format) = format.filter(|_| granted.width % 2 == 0) else {
            let what = format!("it delivers {}, which is none of the formats that can be read", granted.fourcc);
            return Err(SourceError::BadFormat { input, what });
        };
        // Many devices have no rate to set; the frames' own times tell what it is.
        let _ = device.set_params(&Parameters::with_fps(config.rate_hz));
        let interval = device.params().ok().map(|p| p.interval);
        let rate_hz = interval.map(|i| f64::from(i.denominator) / f64::from(i.numerator));
        let stream = v4l::io::mmap::Stream::with_buffers(&device, Type::VideoCapture, BUFFERS)
            .map_err(failed("asking for buffers"))?;
        let size = Size::new(granted.width, granted.height);
        let mut camera = Self {
            path: path.to_owned(),
            name: caps.card.trim().to_owned(),
            asked: format!("{asked} {}x{} @ {}", config.width, config.height, config.rate_hz),
            rate_hz: rate_hz.filter(|hz| hz.is_finite() && *hz > 0.0),
            stream: ManuallyDrop::new(stream),
            size,
            format,
            stride: (granted.stride as usize).max(line_bytes(format, size)),
            timeout: time_limit(config),
            clock: Clock::default(),
            leave_out: u32::from(caps.driver == LOOPBACK),
            stop: Arc::default(),
            damaged: 0,
            stale: 0,
        };
        camera.start().map_err(failed("starting it"))?;
        Ok(camera)
    }

    /// Queues all buffers but the first, which `next` queues before it takes one out. If `next` had to start the
    /// stream itself, we could not wait for the first frame with a time limit.
    fn start(&mut self) -> io::Result<()> {
        for index in 1..32 {
            match CaptureStream::queue(&mut *self.stream, index) {
                // The driver may have granted fewer buffers than asked for, and more.
                Err(e) if e.raw_os_error() == Some(libc::EINVAL) && index > 1 => break,
                other => other?,
            }
        }
        self.stream.start()
    }

    /// Waits until a frame is there; after a time-out inside the crate's `next` the stream could not go on.
    /// `false` when asked to stop meanwhile.
    fn wait(&self, until: Instant) -> Result<bool, SourceError> {
        let handle = self.stream.handle();
        loop {
            if self.stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            let left = until.saturating_duration_since(Instant::now());
            let left_ms = i32::try_from(left.as_millis()).unwrap_or(i32::MAX).min(NAP_MS);
            match handle.poll(libc::POLLIN, left_ms) {
                Ok(0) if until <= Instant::now() + Duration::from_millis(1) => {
                    let seconds = self.timeout.as_secs_f64();
                    return Err(SourceError::Timeout { input: self.path.display().to_string(), seconds });
                }
                Ok(0) => {}
                Ok(_) => return Ok(true),
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(SourceError::of_driver(&self.path, "waiting for a frame", &e)),
            }
        }
    }
}

impl Source for Camera {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        let until = Instant::now() + self.timeout;
        loop {
            if !self.wait(until)? {
                return Ok(None);
            }
            let taken = CaptureStream::next(&mut *self.stream);
            let (buffer, meta) = match taken {
                Ok(taken) => taken,
                // Woken for nothing. `next` has queued its buffer and would queue it again: take one out without it.
                Err(e) if e.kind() == io::ErrorKind::WouldBlock => {
                    if !self.wait(until)? {
                        return Ok(None);
                    }
                    let taken = CaptureStream::dequeue(&mut *self.stream);
                    taken.map_err(|e| SourceError::of_driver(&self.path, "taking a frame", &e))?;
                    continue;
                }
                Err(e) => return Err(SourceError::of_driver(&self.path, "taking a frame", &e)),
            };
            if self.leave_out > 0 {
                self.leave_out -= 1;
                continue;
            }
            let used = &buffer[..buffer.len().min(meta.bytesused as usize)];
            // A damaged frame's number is not taken in: it shows up as a gap in the count, which it is.
            let bytes = if meta.flags.contains(Flags::ERROR) {
                None
            } else {
                without_padding(used, self.format, self.size, self.stride)
            };
            let Some(bytes) = bytes else {
                self.damaged += 1;
                continue;
            };
            let Some((sequence, sensor_time_s)) = self.clock.take(meta) else {
                self.stale += 1;
                continue;
            };
            return Ok(Some(RawFrame {
                sequence: Some(sequence),
                sensor_time_s,
                size: self.size,
                format: self.format,
                bytes,
            }));
        }
    }

    fn stop_when(&mut self, stop: Arc<AtomicBool>) {
        self.stop = stop;
    }

    fn adopt(&mut self, config: &config::Camera) {
        self.timeout = time_limit(config);
    }

    fn describe(&self) -> SourceInfo {
        let rate = self.rate_hz.map_or(String::new(), |hz| format!(" @ {}", (hz * 100.0).round() / 100.0));
        SourceInfo {
            name: format!("{} ({})", self.path.display(), self.name),
            format: FormatNote { asked: self.asked.clone(), given: format!("{} {}{rate}", self.format, self.size) },
            size: self.size,
            nominal_rate_hz: self.rate_hz,
            frames_total: None,
            live: true,
        }
    }

    fn warnings(&mut self) -> Vec<String> {
        let name = self.path.display();
        let kinds = [(&mut self.damaged, "damaged"), (&mut self.stale, "not later than the one before")];
        kinds
            .into_iter()
            .filter(|(count, _)| **count > 0)
            .map(|(count, what)| format!("{name}: frames left out because they were {what}: {}", std::mem::take(count)))
            .collect()
    }
}

impl Drop for Camera {
    fn drop(&mut self) {
        // The stream's own drop stops it again, and panics where that fails with anything but ENODEV. Where the driver
        // refuses, the buffers are left to it until the program ends.
        let stopped = self.stream.stop();
        if stopped.map_or_else(|e| e.raw_os_error() == Some(libc::ENODEV), |()| true) {
            // SAFETY: `stream` is not touched again: this is the end of the value that holds it.
            unsafe { ManuallyDrop::drop(&mut self.stream) }
        }
    }
}

/// Sets the format and says what the driver made of it, and what was asked for.
fn negotiate(device: &Device, config: &config::Camera) -> io::Result<(Format, &'static str)> {
    let ask = |code| device.set_format(&Format::new(config.width, config.height, FourCC::new(code)));
    match config.format {
        CameraFormat::Mjpeg => Ok((ask(b"MJPG")?, "MJPG")),
        CameraFormat::Yuyv => Ok((ask(b"YUYV")?, "YUYV")),
        // Compressed first: uncompressed pictures of that size often come at a few frames a second over USB.
        CameraFormat::Auto => match ask(b"MJPG") {
            Ok(granted) if &granted.fourcc.repr == b"MJPG" => Ok((granted, "MJPG or YUYV")),
            // A device with a fixed format refuses both, or answers with what it has.
            first => Ok((ask(b"YUYV").or(first)?, "MJPG or YUYV")),
        },
    }
}

fn time_limit(config: &config::Camera) -> Duration {
    Duration::from_secs_f64(config.timeout_s.clamp(0.001, 1e6))
}

/// The picture without what the driver puts at the end of each line; `None` if there is too little of it.
fn without_padding(used: &[u8], format: PixelFormat, size: Size, stride: usize) -> Option<Vec<u8>> {
    if format == PixelFormat::Mjpeg {
        return (!used.is_empty()).then(|| used.to_vec());
    }
    let line = line_bytes(format, size);
    let rows = size.height as usize;
    let height = if format == PixelFormat::Nv12 { rows + rows / 2 } else { rows };
    // The last line's padding need not be there.
    if height == 0 || used.len() < stride * (height - 1) + line {
        return None;
    }
    if stride == line {
        return Some(used[..line * height].to_vec());
    }
    let mut bytes = Vec::with_capacity(line * height);
    used.chunks(stride).take(height).for_each(|padded| bytes.extend_from_slice(&padded[..line]));
    Some(bytes)
}

/// Bytes of a line without padding, 0 where there are no lines.
fn line_bytes(format: PixelFormat, size: Size) -> usize {
    let bytes_per_pixel = match format {
        PixelFormat::Mjpeg => 0,
        PixelFormat::Yuyv | PixelFormat::Uyvy => 2,
        PixelFormat::Grey | PixelFormat::Nv12 => 1,
        PixelFormat::Rgb24 => 3,
    };
    bytes_per_pixel * size.width as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn padding_is_cut_off_and_a_short_picture_refused() {
        let size = Size::new(2, 2);
        let padded = [1, 2, 3, 4, 9, 9, 5, 6, 7, 8];
        let whole = without_padding(&padded, PixelFormat::Yuyv, size, 6);
        assert_eq!(whole.as_deref(), Some(&[1, 2, 3, 4, 5, 6, 7, 8][..]));
        assert_eq!(without_padding(&padded[..9], PixelFormat::Yuyv, size, 6), None);
        assert_eq!(without_padding(&padded[..4], PixelFormat::Mjpeg, size, 0).map(|b| b.len()), Some(4));
        assert_eq!(without_padding(&[], PixelFormat::Mjpeg, size, 0), None);
    }
}

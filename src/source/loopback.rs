//! The other direction: frames into a v4l2loopback device, which other programs then see as a camera. Through mapped
//! buffers: with `write()` a device made with `exclusive_caps=1` hangs when its feeder goes.

use super::SourceError;
use crate::model::{PixelFormat, RawFrame, Size};
use std::io;
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use v4l::buffer::Type;
use v4l::capability::Flags as Caps;
use v4l::io::mmap::Stream;
use v4l::io::traits::{OutputStream, Stream as _};
use v4l::video::Output as _;
use v4l::video::output::Parameters;
use v4l::{Device, Format, FourCC};

const BUFFERS: u32 = 4;

/// A device that is fed.
pub struct Loopback {
    path: PathBuf,
    /// Its own drop panics if the driver refuses to stop.
    stream: ManuallyDrop<Stream<'static>>,
    format: PixelFormat,
    size: Size,
}

impl Loopback {
    /// Opens the device for frames like this one.
    ///
    /// # Errors
    /// It is not there, takes no frames, is in use, or takes no frames of that format or size.
    pub fn open(path: &Path, first: &RawFrame, rate_hz: Option<f64>) -> Result<Self, SourceError> {
        let input = path.display().to_string();
        let failed = |doing: &'static str| move |e: io::Error| SourceError::of_driver(path, doing, &e);
        let bad = |what: String| SourceError::BadFormat { input: input.clone(), what };
        let device = Device::with_path(path).map_err(|e| match SourceError::of_driver(path, "opening it", &e) {
            SourceError::Absent { input, .. } => {
                SourceError::Absent { input, hint: "make it with `sudo modprobe v4l2loopback`, then see /dev/video*" }
            }
            other => other,
        })?;
        let caps = device.query_caps().map_err(failed("asking for its abilities"))?;
        if !caps.capabilities.contains(Caps::VIDEO_OUTPUT) {
            let what =
                "it takes no frames; give a device made with `sudo modprobe v4l2loopback` that nothing feeds yet";
            return Err(bad(what.to_owned()));
        }
        let fourcc: [u8; 4] = first.format.fourcc().as_bytes().try_into().unwrap_or(*b"MJPG");
        let wanted = Format::new(first.size.width, first.size.height, FourCC::new(&fourcc));
        let granted = device.set_format(&wanted).map_err(failed("setting the picture format"))?;
        let same = (granted.width, granted.height, granted.fourcc) == (wanted.width, wanted.height, wanted.fourcc);
        if !same {
            let given = format!("{} {}x{}", granted.fourcc, granted.width, granted.height);
            return Err(bad(format!("it takes {given} and not {} {}", first.format, first.size)));
        }
        if let Some(hz) = rate_hz.filter(|hz| (1.0..=1000.0).contains(hz)) {
            // Only what readers are told; the frames' own times pace them.
            let _ = device.set_params(&Parameters::new(v4l::Fraction::new(1, hz.round() as u32)));
        }
        let stream = Stream::with_buffers(&device, Type::VideoOutput, BUFFERS).map_err(failed("asking for buffers"))?;
        let stream = ManuallyDrop::new(stream);
        Ok(Self { path: path.to_owned(), stream, format: first.format, size: first.size })
    }

    /// Hands the frame that was put last to the device, which gives it the time of this moment, and takes this one in
    /// for the next call: so a frame can be copied before it is due, and goes when it is.
    ///
    /// # Errors
    /// The device refuses, or the frame is none of those it was opened for.
    pub fn put(&mut self, raw: &RawFrame) -> Result<(), SourceError> {
        let input = || self.path.display().to_string();
        if (raw.format, raw.size) != (self.format, self.size) {
            let what = format!("frames change from {} {} to {} {}", self.format, self.size, raw.format, raw.size);
            return Err(SourceError::BadFormat { input: input(), what });
        }
        // Queues the buffer that was filled last, if any was, and gives the next one.
        let next = OutputStream::next(&mut *self.stream);
        let (buffer, meta) = next.map_err(|e| SourceError::of_driver(&self.path, "handing over a frame", &e))?;
        let Some(room) = buffer.get_mut(..raw.bytes.len()) else {
            let what = format!("a frame of {} bytes does not fit into its buffers", raw.bytes.len());
            return Err(SourceError::BadFormat { input: input(), what });
        };
        room.copy_from_slice(&raw.bytes);
        meta.bytesused = raw.bytes.len() as u32;
        meta.field = 1; // V4L2_FIELD_NONE: whole pictures
        Ok(())
    }

    /// Hands over the frame that was put last.
    ///
    /// # Errors
    /// The device refuses.
    pub fn finish(&mut self) -> Result<(), SourceError> {
        let next = OutputStream::next(&mut *self.stream);
        next.map(drop).map_err(|e| SourceError::of_driver(&self.path, "handing over a frame", &e))
    }
}

impl Drop for Loopback {
    fn drop(&mut self) {
        let stopped = self.stream.stop();
        if stopped.map_or_else(|e| e.raw_os_error() == Some(libc::ENODEV), |()| true) {
            // SAFETY: `stream` is not touched again: this is the end of the value that holds it.
            unsafe { ManuallyDrop::drop(&mut self.stream) }
        }
    }
}

//! The other direction: frames into a v4l2loopback device, which other programs then see as a
//! camera. Through mapped buffers: with `write()` a device made with `exclusive_caps=1` hangs when
//! its feeder goes. The `v4l` crate's stream takes each buffer back as soon as it has handed it
//! over, and would overwrite what others still read; so this keeps a ring.

use super::error::SourceError;
use crate::model::{PixelFormat, RawFrame, Size};
use std::io;
use std::path::{Path, PathBuf};
use std::ptr::{null_mut, slice_from_raw_parts_mut};
use v4l::buffer::Type;
use v4l::capability::Flags as Caps;
use v4l::memory::Memory;
use v4l::v4l_sys::{v4l2_buffer, v4l2_requestbuffers};
use v4l::v4l2::{self, vidioc};
use v4l::video::Output as _;
use v4l::video::output::Parameters;
use v4l::{Device, Format, FourCC};

const BUFFERS: u32 = 4;
const OUTPUT: u32 = Type::VideoOutput as u32;
/// Whole pictures, not every other line.
const FIELD_NONE: u32 = 1;

/// A device that is fed.
pub struct Loopback {
    path: PathBuf,
    device: Device,
    buffers: Vec<*mut [u8]>,
    /// Frames handed over.
    frames: u64,
    format: PixelFormat,
    size: Size,
}

impl Loopback {
    /// Opens the device for frames like this one.
    ///
    /// # Errors
    /// It is not there, takes no frames, is in use, or takes no frames of that format or size.
    pub fn open(path: &Path, first: &RawFrame, rate_hz: Option<f64>) -> Result<Self, SourceError> {
        let device = Device::with_path(path).map_err(|e| {
            match SourceError::of_driver(path, "opening it", &e) {
                SourceError::Absent { input, .. } => SourceError::Absent {
                    input,
                    hint: "make it with `sudo modprobe v4l2loopback`, then see /dev/video*",
                },
                other => other,
            }
        })?;
        let caps = device
            .query_caps()
            .map_err(SourceError::refused(path, "asking for its abilities"))?;
        if !caps.capabilities.contains(Caps::VIDEO_OUTPUT) {
            let what = "it takes no frames; give a device made with `sudo modprobe v4l2loopback` \
                        that nothing feeds yet";
            return Err(SourceError::bad_format(path, what));
        }
        let fourcc: [u8; 4] = first
            .format
            .fourcc()
            .as_bytes()
            .try_into()
            .unwrap_or(*b"MJPG");
        let wanted = Format::new(first.size.width, first.size.height, FourCC::new(&fourcc));
        let granted = device
            .set_format(&wanted)
            .map_err(SourceError::refused(path, "setting the picture format"))?;
        if (granted.width, granted.height, granted.fourcc)
            != (wanted.width, wanted.height, wanted.fourcc)
        {
            let given = format!("{} {}x{}", granted.fourcc, granted.width, granted.height);
            let what = format!("it takes {given} and not {} {}", first.format, first.size);
            return Err(SourceError::bad_format(path, what));
        }
        if let Some(hz) = rate_hz.filter(|hz| (1.0..=1000.0).contains(hz)) {
            // Only what readers are told; the frames' own times pace them.
            let _ = device.set_params(&Parameters::with_fps(hz.round() as u32));
        }
        let (format, size) = (first.format, first.size);
        let mut output = Self {
            path: path.to_owned(),
            device,
            buffers: Vec::new(),
            frames: 0,
            format,
            size,
        };
        output
            .map_buffers()
            .map_err(SourceError::refused(path, "asking for buffers"))?;
        Ok(output)
    }

    /// Asks for buffers and maps them.
    fn map_buffers(&mut self) -> io::Result<()> {
        let mut request = v4l2_requestbuffers {
            count: BUFFERS,
            type_: OUTPUT,
            memory: Memory::Mmap as u32,
            ..zeroed()
        };
        self.call(vidioc::VIDIOC_REQBUFS, &mut request)?;
        for index in 0..request.count {
            let mut buffer = v4l2_buffer {
                index,
                ..described()
            };
            self.call(vidioc::VIDIOC_QUERYBUF, &mut buffer)?;
            let length = buffer.length as usize;
            let (access, fd) = (
                libc::PROT_READ | libc::PROT_WRITE,
                self.device.handle().fd(),
            );
            // SAFETY: the driver has just said which of the union's fields holds, and where the
            // buffer lies; the mapping is private to this value and ends with it.
            let start = unsafe {
                v4l2::mmap(
                    null_mut(),
                    length,
                    access,
                    libc::MAP_SHARED,
                    fd,
                    buffer.m.offset.into(),
                )
            }?;
            self.buffers
                .push(slice_from_raw_parts_mut(start.cast(), length));
        }
        if self.buffers.is_empty() {
            Err(io::Error::from_raw_os_error(libc::ENOMEM))
        } else {
            Ok(())
        }
    }

    /// Hands a frame to the device, which gives it the time of this moment.
    ///
    /// # Errors
    /// The device refuses, or the frame is none of those it was opened for.
    pub fn put(&mut self, raw: &RawFrame) -> Result<(), SourceError> {
        const DOING: &str = "handing over a frame";
        if (raw.format, raw.size) != (self.format, self.size) {
            let (format, size) = (self.format, self.size);
            let what = format!(
                "frames change from {format} {size} to {} {}",
                raw.format, raw.size
            );
            return Err(SourceError::bad_format(&self.path, what));
        }
        let mut buffer = v4l2_buffer {
            index: self.frames as u32,
            ..described()
        };
        // Each buffer goes round once before the first is taken back: it is the one that was read
        // longest ago.
        if self.frames >= self.buffers.len() as u64 {
            self.call(vidioc::VIDIOC_DQBUF, &mut buffer)
                .map_err(SourceError::refused(&self.path, DOING))?;
        }
        let mapped = self.buffers.get(buffer.index as usize).copied();
        let Some(mapped) = mapped.filter(|m| m.len() >= raw.bytes.len()) else {
            let length = raw.bytes.len();
            let what = format!("a frame of {length} bytes does not fit into its buffers");
            return Err(SourceError::bad_format(&self.path, what));
        };
        // SAFETY: the mapping lasts as long as `self`, is as long as was just compared, and the
        // driver has given the buffer to us. Other programs may read it; a torn picture is all that
        // they can get.
        unsafe {
            std::ptr::copy_nonoverlapping(raw.bytes.as_ptr(), mapped.cast::<u8>(), raw.bytes.len())
        };
        let index = buffer.index;
        let mut buffer = v4l2_buffer {
            index,
            bytesused: raw.bytes.len() as u32,
            field: FIELD_NONE,
            ..described()
        };
        if self.frames == 0 {
            let mut kind = OUTPUT;
            self.call(vidioc::VIDIOC_STREAMON, &mut kind)
                .map_err(SourceError::refused(&self.path, DOING))?;
        }
        self.call(vidioc::VIDIOC_QBUF, &mut buffer)
            .map_err(SourceError::refused(&self.path, DOING))?;
        self.frames += 1;
        Ok(())
    }

    fn call<T>(&self, request: vidioc::_IOC_TYPE, argument: &mut T) -> io::Result<()> {
        // SAFETY: each request is made with the type that it is declared for; the descriptor is
        // open.
        unsafe {
            v4l2::ioctl(
                self.device.handle().fd(),
                request,
                std::ptr::from_mut(argument).cast(),
            )
        }
    }
}

impl Drop for Loopback {
    fn drop(&mut self) {
        let mut kind = OUTPUT;
        // A device that refuses to stop is left to the end of the program.
        let _ = self.call(vidioc::VIDIOC_STREAMOFF, &mut kind);
        for mapped in &self.buffers {
            // SAFETY: mapped by `map_buffers`, unmapped once.
            let _ = unsafe { v4l2::munmap(mapped.cast(), mapped.len()) };
        }
    }
}

/// A buffer of ours to be filled in.
fn described() -> v4l2_buffer {
    v4l2_buffer {
        type_: OUTPUT,
        memory: Memory::Mmap as u32,
        ..zeroed()
    }
}

/// The kernel's structures as it wants to get them.
fn zeroed<T: Kernel>() -> T {
    // SAFETY: plain numbers and unions of them, for which all bits zero is a value.
    unsafe { std::mem::zeroed() }
}

trait Kernel {}
impl Kernel for v4l2_buffer {}
impl Kernel for v4l2_requestbuffers {}

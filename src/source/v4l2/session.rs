//! A device that is open and streams: buffers mapped once, frames taken out with a time limit.

use crate::caught::caught;
use std::io;
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use v4l::buffer::{Metadata, Type};
use v4l::io::traits::{CaptureStream, Stream as _};

/// One is with us, one is being filled, and two wait in between for as long as the system has other
/// things to do.
const BUFFERS: u32 = 4;
/// Longest wait after which a wish to stop is heard, ms.
const NAP_MS: i32 = 20;

/// The stream of one device.
pub(super) struct Session {
    /// Its own drop panics if the driver refuses to stop, see [`Drop`] below.
    stream: ManuallyDrop<v4l::io::mmap::Stream<'static>>,
}

/// What waiting for a frame came to.
pub(super) enum Waited {
    Ready,
    Stopped,
    Silent,
}

/// What taking a frame out came to.
pub(super) enum Taken<'a> {
    /// The bytes that the driver wrote, and what it says of them.
    Frame(&'a [u8], &'a Metadata),
    /// Woken for nothing: take with [`Session::take_lost`] after the next wait.
    Nothing,
}

impl Session {
    /// Maps the buffers and starts the stream.
    pub(super) fn start(device: &v4l::Device) -> Result<Self, (&'static str, io::Error)> {
        let stream = v4l::io::mmap::Stream::with_buffers(device, Type::VideoCapture, BUFFERS)
            .map_err(|e| ("asking for buffers", e))?;
        let mut session = Self {
            stream: ManuallyDrop::new(stream),
        };
        session.queue_all().map_err(|e| ("starting it", e))?;
        Ok(session)
    }

    /// Queues all buffers but the first, which `next` queues before it takes one out. If `next` had
    /// to start the stream itself, we could not wait for the first frame with a time limit.
    fn queue_all(&mut self) -> io::Result<()> {
        for index in 1..32 {
            match CaptureStream::queue(&mut *self.stream, index) {
                // The driver may have granted fewer buffers than asked for, and more.
                Err(e) if e.raw_os_error() == Some(libc::EINVAL) && index > 1 => break,
                other => other?,
            }
        }
        self.stream.start()
    }

    /// Waits until a frame is there; after a time-out inside the crate's `next` the stream could
    /// not go on.
    pub(super) fn wait(&self, until: Instant, stop: &AtomicBool) -> io::Result<Waited> {
        let handle = self.stream.handle();
        loop {
            if stop.load(Ordering::Relaxed) {
                return Ok(Waited::Stopped);
            }
            let left = until.saturating_duration_since(Instant::now());
            let left_ms = i32::try_from(left.as_millis())
                .unwrap_or(i32::MAX)
                .min(NAP_MS);
            match handle.poll(libc::POLLIN, left_ms) {
                Ok(0) if until <= Instant::now() + Duration::from_millis(1) => {
                    return Ok(Waited::Silent);
                }
                Ok(0) => {}
                Ok(_) => return Ok(Waited::Ready),
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(e),
            }
        }
    }

    /// The next frame, which a wait has announced.
    pub(super) fn take(&mut self) -> io::Result<Taken<'_>> {
        match CaptureStream::next(&mut *self.stream) {
            Ok((buffer, meta)) => Ok(Taken::Frame(
                &buffer[..buffer.len().min(meta.bytesused as usize)],
                meta,
            )),
            Err(e) if e.kind() == io::ErrorKind::WouldBlock => Ok(Taken::Nothing),
            Err(e) => Err(e),
        }
    }

    /// Takes the frame out that comes after [`Taken::Nothing`]. `next` had queued its buffer and
    /// would queue it again, so this one goes without it, and its content is out of reach.
    pub(super) fn take_lost(&mut self) -> io::Result<()> {
        CaptureStream::dequeue(&mut *self.stream).map(drop)
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // The stream's own drop stops it again, and panics where that fails with anything but
        // ENODEV. Where the driver refuses, the buffers are left to it until the program ends.
        let stopped = self.stream.stop();
        if stopped.map_or_else(|e| e.raw_os_error() == Some(libc::ENODEV), |()| true) {
            let stream = &mut self.stream;
            // The crate panics as well where the driver does not take its buffers back; the device
            // is closed all the same. SAFETY: `stream` is not touched again: this is the end of the
            // value that holds it.
            let _ = caught(|| unsafe { ManuallyDrop::drop(stream) });
        }
    }
}

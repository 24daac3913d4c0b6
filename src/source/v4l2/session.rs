//! A device that is open and streams: buffers mapped once, frames taken out with a time limit.

use crate::caught::caught;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use v4l::buffer::{Metadata, Type};
use v4l::device::Handle;
use v4l::io::traits::{CaptureStream, Stream as _};

/// One is with us, one is being filled, and two wait in between for as long as the system has other
/// things to do.
const BUFFERS: u32 = 4;
/// Longest wait after which a request to stop is heard, ms.
const NAP_MS: i32 = 20;
/// A frame that a wait has announced can be taken out at once. Without a limit the crate would wait
/// for ever where the driver has announced nothing.
const ANNOUNCED_WITHIN: Duration = Duration::from_millis(100);
/// The kernel takes an unplugged device away within so long after its last frame.
const GOES_WITHIN: Duration = Duration::from_secs(1);

/// The stream of one device.
pub(super) struct Session {
    /// `None` once the buffers were given back.
    stream: Option<v4l::io::mmap::Stream<'static>>,
    /// The last owner of it closes the device; `None` once it is closed.
    handle: Option<Arc<Handle>>,
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
        let mut stream = v4l::io::mmap::Stream::with_buffers(device, Type::VideoCapture, BUFFERS)
            .map_err(|e| ("asking for buffers", e))?;
        stream.set_timeout(ANNOUNCED_WITHIN);
        let mut session = Self {
            stream: Some(stream),
            handle: Some(device.handle()),
        };
        session.queue_all().map_err(|e| ("starting it", e))?;
        Ok(session)
    }

    fn stream(&mut self) -> io::Result<&mut v4l::io::mmap::Stream<'static>> {
        self.stream.as_mut().ok_or_else(closed)
    }

    /// Queues all buffers but the first, which `next` queues before it takes one out. If `next` had
    /// to start the stream itself, we could not wait for the first frame with a time limit.
    fn queue_all(&mut self) -> io::Result<()> {
        let stream = self.stream()?;
        for index in 1..32 {
            match CaptureStream::queue(stream, index) {
                // The driver may have granted fewer buffers than asked for, and more.
                Err(e) if e.raw_os_error() == Some(libc::EINVAL) && index > 1 => break,
                other => other?,
            }
        }
        stream.start()
    }

    /// Waits until a frame is there; after a time-out inside the crate's `next` the stream could
    /// not go on.
    pub(super) fn wait(&self, until: Instant, stop: &AtomicBool) -> io::Result<Waited> {
        let handle = self.handle.as_ref().ok_or_else(closed)?;
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
        match CaptureStream::next(self.stream()?) {
            Ok((buffer, meta)) => Ok(Taken::Frame(
                &buffer[..buffer.len().min(meta.bytesused as usize)],
                meta,
            )),
            Err(e)
                if matches!(
                    e.kind(),
                    io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut
                ) =>
            {
                Ok(Taken::Nothing)
            }
            Err(e) => Err(e),
        }
    }

    /// Takes the frame out that comes after [`Taken::Nothing`]. `next` had queued its buffer and
    /// would queue it again, so this one goes without it, and its content is out of reach.
    pub(super) fn take_lost(&mut self) -> io::Result<()> {
        CaptureStream::dequeue(self.stream()?).map(drop)
    }

    /// Gives a device back that may be about to vanish: the buffers at once, so that it can be
    /// opened again, and the device itself once `interface`, its folder below /sys, is gone or
    /// seems to stay.
    ///
    /// Linux up to 6.1 at least crashes in a close that meets its own removal of the device
    /// (`media_device_unregister_entity` looks before it takes the lock), and the thread that
    /// closes ends there without a word.
    pub(super) fn close_lost(mut self, interface: Option<&Path>) {
        self.give_back();
        if let Some(interface) = interface {
            wait_until_gone(interface, GOES_WITHIN);
        }
    }

    /// Stops the stream and gives its buffers back.
    fn give_back(&mut self) {
        let Some(mut stream) = self.stream.take() else {
            return;
        };
        // The stream's own drop stops it again, and panics where that fails with anything but
        // ENODEV. Where the driver refuses, the buffers are left to it until the program ends.
        let refused = matches!(stream.stop(), Err(e) if e.raw_os_error() != Some(libc::ENODEV));
        if refused {
            std::mem::forget(stream);
        } else {
            // The crate panics as well where the driver does not take its buffers back; the device
            // is closed all the same.
            let _ = caught(|| drop(stream));
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.give_back();
        let handle = self.handle.take();
        // The crate panics where closing fails; there is nothing else to be done then.
        let _ = caught(|| drop(handle));
    }
}

fn closed() -> io::Error {
    io::Error::from_raw_os_error(libc::ENODEV)
}

fn wait_until_gone(folder: &Path, limit: Duration) {
    let until = Instant::now() + limit;
    while folder.exists() && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(NAP_MS.unsigned_abs().into()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_vanishes_is_waited_for_and_one_that_stays_is_not_for_long() {
        let folder = tempfile::tempdir().expect("tempdir");
        let since = Instant::now();
        wait_until_gone(folder.path(), Duration::from_millis(50));
        assert!(since.elapsed() >= Duration::from_millis(50));
        let path = folder.path().to_owned();
        let remove = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(50));
            folder.close().expect("removed");
        });
        wait_until_gone(&path, Duration::from_secs(60));
        assert!(!path.exists() && since.elapsed() < Duration::from_secs(30));
        remove.join().expect("the folder was removed");
    }
}

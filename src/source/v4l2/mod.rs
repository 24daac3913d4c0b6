//! A V4L2 camera: one negotiation of the format, then frames from mapped buffers, each copied once.
//! One that was lost is found again by its identity, and must grant what it granted before.

mod offers;
mod session;

use super::choice::{Granted, Mode, Wish, choose};
use super::clock::Clock;
use super::error::SourceError;
use super::identity::{Known, Places};
use super::interface::{Health, Source, SourceInfo, Successor};
use super::opened::{describe, same_again};
use crate::config;
use crate::model::{PixelFormat, RawFrame, Size};
use offers::{Negotiated, negotiate};
use session::{Session, Taken, Waited};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use v4l::buffer::{Flags, Metadata};
use v4l::capability::{Capabilities, Flags as Caps};

/// The first picture of this driver is what happens to lie in its buffer, with a fresh time on it;
/// and it does not count.
const LOOPBACK: &str = "v4l2 loopback";

/// What a camera is known by, and what was agreed with it.
#[derive(Clone)]
struct Agreed {
    known: Known,
    path: PathBuf,
    name: String,
    asked: Wish,
    granted: Granted,
    /// Bytes from the start of a line to the next.
    stride: usize,
    timeout: Duration,
    loopback: bool,
    /// Zero of the times of reception.
    opened: Instant,
}

/// What goes on from one opening to the next.
#[derive(Clone)]
struct Progress {
    clock: Clock,
    damaged: u64,
    stale: u64,
}

/// A camera that films, or did until a moment ago.
pub(super) struct Camera {
    agreed: Agreed,
    /// Its successor reads this while a call to the driver hangs: never locked during one.
    progress: Arc<Mutex<Progress>>,
    /// `None` between a failure and the next attempt to open it.
    session: Option<Session>,
    /// Its folder below /sys, which says when it is gone for good; only on USB.
    interface: Option<PathBuf>,
    /// The driver says that the device is gone, or behaves like it.
    vanishing: bool,
    /// Frames still to be left out at the beginning.
    leave_out: u32,
    stop: Arc<AtomicBool>,
}

/// A device that has been opened and has granted a format.
struct Opened {
    caps: Capabilities,
    negotiated: Negotiated,
    device: v4l::Device,
}

impl Camera {
    pub(super) fn open(path: &Path, config: &config::Camera) -> Result<Self, SourceError> {
        Self::open_as(path, config, &Wish::of(config))
    }

    /// Opens it for what is asked for; of depth whatever is granted is taken.
    pub(super) fn open_as(
        path: &Path,
        config: &config::Camera,
        asked: &Wish,
    ) -> Result<Self, SourceError> {
        let asked = *asked;
        let Opened {
            caps,
            negotiated,
            device,
        } = open(path, &asked)?;
        let Negotiated {
            granted,
            stride,
            modes,
        } = negotiated;
        let takes_any = config.accept_format || asked.is_of_depth();
        if !asked.is_met_by(&granted) && !takes_any {
            return Err(SourceError::bad_format(
                path,
                refusal(&asked, &granted, &modes),
            ));
        }
        let session = start(path, &device)?;
        let loopback = caps.driver == LOOPBACK;
        let agreed = Agreed {
            known: Known::new(Places::default(), path),
            path: path.to_owned(),
            name: caps.card.trim().to_owned(),
            asked,
            granted,
            stride: stride.max(line_bytes(granted.format, granted.size)),
            timeout: config.time_limit(),
            loopback,
            opened: Instant::now(),
        };
        let progress = Progress {
            clock: Clock::new(!loopback),
            damaged: 0,
            stale: 0,
        };
        let mut camera = Self::closed(agreed, progress);
        camera.filming(session);
        Ok(camera)
    }

    fn closed(agreed: Agreed, progress: Progress) -> Self {
        Self {
            agreed,
            progress: Arc::new(Mutex::new(progress)),
            session: None,
            interface: None,
            vanishing: false,
            leave_out: 0,
            stop: Arc::default(),
        }
    }

    fn filming(&mut self, session: Session) {
        self.session = Some(session);
        self.interface = self.agreed.known.interface_of(&self.agreed.path);
        self.vanishing = false;
        self.leave_out = u32::from(self.agreed.loopback);
    }

    fn progress(&self) -> MutexGuard<'_, Progress> {
        lock(&self.progress)
    }

    fn shown(&self) -> String {
        self.agreed.path.display().to_string()
    }

    /// `Ok(None)`: asked to stop meanwhile.
    fn wait(&self, session: &Session, until: Instant) -> Result<Option<()>, SourceError> {
        match session.wait(until, &self.stop) {
            Ok(Waited::Ready) => Ok(Some(())),
            Ok(Waited::Stopped) => Ok(None),
            Ok(Waited::Silent) => Err(SourceError::Timeout {
                input: self.shown(),
                seconds: self.agreed.timeout.as_secs_f64(),
            }),
            Err(e) => Err(SourceError::of_driver(
                &self.agreed.path,
                "waiting for a frame",
                &e,
            )),
        }
    }

    fn next_of(&mut self, session: &mut Session) -> Result<Option<RawFrame>, SourceError> {
        let until = Instant::now() + self.agreed.timeout;
        loop {
            if self.wait(session, until)?.is_none() {
                return Ok(None);
            }
            let (used, meta) = match session.take().map_err(|e| self.untaken(&e))? {
                Taken::Frame(used, meta) => (used, meta),
                Taken::Nothing => {
                    if self.wait(session, until)?.is_none() {
                        return Ok(None);
                    }
                    session.take_lost().map_err(|e| self.untaken(&e))?;
                    self.progress().damaged += 1;
                    continue;
                }
            };
            if self.leave_out > 0 {
                self.leave_out -= 1;
                continue;
            }
            if let Some(frame) = self.accept(used, meta) {
                return Ok(Some(frame));
            }
        }
    }

    fn untaken(&self, e: &io::Error) -> SourceError {
        SourceError::of_driver(&self.agreed.path, "taking a frame", e)
    }

    /// The frame, if it is whole and later than the one before; else it is counted.
    fn accept(&self, used: &[u8], meta: &Metadata) -> Option<RawFrame> {
        let Granted { format, size, .. } = self.agreed.granted;
        // A damaged frame's number is not taken in: it shows up as a hole in the count, as frames
        // that were lost do, and differs from them by the count of damaged ones.
        let bytes = if meta.flags.contains(Flags::ERROR) {
            None
        } else {
            without_padding(used, format, size, self.agreed.stride)
        };
        let Some(bytes) = bytes else {
            self.progress().damaged += 1;
            return None;
        };
        let received_s = self.agreed.opened.elapsed().as_secs_f64();
        let mut progress = self.progress();
        let Some((sequence, sensor_time_s)) = progress.clock.take(meta, received_s) else {
            progress.stale += 1;
            return None;
        };
        Some(RawFrame {
            sequence,
            sensor_time_s,
            size,
            format,
            bytes,
            depth: None,
        })
    }
}

impl Source for Camera {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        let Some(mut session) = self.session.take() else {
            return Err(SourceError::Disconnected {
                input: self.shown(),
                reason: "it is closed".into(),
            });
        };
        let next = self.next_of(&mut session);
        self.vanishing = matches!(next, Err(SourceError::Disconnected { .. }));
        self.session = Some(session);
        next
    }

    fn close(&mut self) {
        let Some(session) = self.session.take() else {
            return;
        };
        if self.vanishing {
            session.close_lost(self.interface.as_deref());
        }
    }

    fn returns(&self) -> bool {
        true
    }

    fn reopen(&mut self) -> Result<(), SourceError> {
        self.close();
        let hint = "plug it in again";
        let path = self
            .agreed
            .known
            .find()
            .ok_or_else(|| SourceError::Absent {
                input: self.shown(),
                hint,
            })?;
        // Exactly what was granted, and not what was asked for: the pictures must stay as they
        // were.
        let Granted {
            format,
            size,
            rate_hz,
        } = self.agreed.granted;
        let wish = Wish {
            format: Some(format),
            size,
            rate_hz: rate_hz.unwrap_or(self.agreed.asked.rate_hz),
        };
        let Opened {
            negotiated, device, ..
        } = open(&path, &wish)?;
        same_again(&path, &self.agreed.granted, &negotiated.granted)?;
        self.agreed.stride = negotiated.stride.max(line_bytes(format, size));
        let session = start(&path, &device)?;
        self.agreed.path = path;
        self.filming(session);
        self.progress().clock.returned();
        Ok(())
    }

    fn successor(&self) -> Option<Successor> {
        let (agreed, progress) = (self.agreed.clone(), self.progress.clone());
        Some(Box::new(move || {
            let so_far = lock(&progress).clone();
            Box::new(Camera::closed(agreed.clone(), so_far))
        }))
    }

    fn adopt(&mut self, config: &config::Camera) {
        self.agreed.timeout = config.time_limit();
    }

    fn stop_when(&mut self, stop: Arc<AtomicBool>) {
        self.stop = stop;
    }

    fn describe(&self) -> SourceInfo {
        let agreed = &self.agreed;
        describe(
            &agreed.path,
            &agreed.name,
            &agreed.known,
            &agreed.asked,
            &agreed.granted,
        )
    }

    fn health(&self) -> Health {
        let progress = self.progress();
        Health {
            damaged: progress.damaged,
            stale: progress.stale,
            clock: progress.clock.kind(),
        }
    }
}

fn lock(progress: &Mutex<Progress>) -> MutexGuard<'_, Progress> {
    progress.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Opens the device and negotiates.
fn open(path: &Path, wish: &Wish) -> Result<Opened, SourceError> {
    let (device, caps) = open_device(path)?;
    if !films(&caps) {
        let what = "it does not film (or nothing feeds it yet); `arborcam devices` lists what does";
        return Err(SourceError::bad_format(path, what.to_owned()));
    }
    let negotiated = negotiate(&device, wish, is_usb(&caps)).map_err(|e| match e {
        Ok(name) if wish.is_of_depth() => SourceError::bad_format(
            path,
            format!("it delivers {name}, which is no depth; `arborcam devices` lists what does"),
        ),
        Ok(name) => SourceError::bad_format(
            path,
            format!("it delivers {name}, which is none of the formats that can be read"),
        ),
        Err(e) => SourceError::of_driver(path, "setting the picture format", &e),
    })?;
    if !negotiated.granted.size.width.is_multiple_of(2) {
        let what = format!(
            "its pictures have an odd width ({})",
            negotiated.granted.size
        );
        return Err(SourceError::bad_format(path, what));
    }
    Ok(Opened {
        caps,
        negotiated,
        device,
    })
}

fn open_device(path: &Path) -> Result<(v4l::Device, Capabilities), SourceError> {
    let device =
        v4l::Device::with_path(path).map_err(|e| SourceError::of_driver(path, "opening it", &e))?;
    let caps = device
        .query_caps()
        .map_err(SourceError::refused(path, "asking for its abilities"))?;
    Ok((device, caps))
}

fn films(caps: &Capabilities) -> bool {
    caps.capabilities
        .contains(Caps::VIDEO_CAPTURE | Caps::STREAMING)
}

fn start(path: &Path, device: &v4l::Device) -> Result<Session, SourceError> {
    Session::start(device).map_err(|(doing, e)| SourceError::of_driver(path, doing, &e))
}

fn is_usb(caps: &Capabilities) -> bool {
    caps.bus.starts_with("usb")
}

/// What was asked, what there is instead, and what to do.
fn refusal(asked: &Wish, granted: &Granted, modes: &[Mode]) -> String {
    /// More of them make no line any more.
    const LISTED: usize = 8;
    let mut sizes: Vec<Size> = Vec::new();
    for mode in modes.iter().filter(|m| m.format == granted.format) {
        if !sizes.contains(&mode.size) {
            sizes.push(mode.size);
        }
    }
    sizes.sort_unstable_by_key(|s| std::cmp::Reverse(s.area()));
    let listed: Vec<String> = sizes.iter().take(LISTED).map(Size::to_string).collect();
    let more = if listed.is_empty() {
        String::new()
    } else {
        format!(" (it lists {})", listed.join(", "))
    };
    format!(
        "asked for {asked}, it offers {granted}{more}; take that with --accept-format, or set \
         camera.format, width, height and rate_hz to what `arborcam devices` lists"
    )
}

/// What `capture` would film with this device, and why; with all that it lists.
pub(super) struct Prospect {
    pub card: String,
    pub driver: String,
    pub bus: String,
    pub films: bool,
    pub modes: Vec<Mode>,
    /// What it can do as a depth camera.
    pub depth_modes: Vec<Mode>,
    pub chosen: Option<(Granted, String)>,
}

/// Asks the device without changing anything about it.
pub(super) fn prospect(path: &Path, config: &config::Camera) -> Result<Prospect, SourceError> {
    let (device, caps) = open_device(path)?;
    let films = films(&caps);
    let wish = Wish::of(config);
    let of_depth = Wish {
        format: Some(PixelFormat::DEPTH[0]),
        ..wish
    };
    let (mut modes, mut depth_modes) = (Vec::new(), Vec::new());
    if films {
        modes = offers::modes(&device, &wish);
        depth_modes = offers::modes(&device, &of_depth);
    }
    let chosen = choose(&modes, &wish, is_usb(&caps));
    Ok(Prospect {
        card: caps.card.trim().to_owned(),
        driver: caps.driver.trim().to_owned(),
        bus: caps.bus.trim().to_owned(),
        films,
        modes,
        depth_modes,
        chosen,
    })
}

/// The picture without what the driver puts at the end of each line; `None` if there is too little
/// of it.
fn without_padding(used: &[u8], format: PixelFormat, size: Size, stride: usize) -> Option<Vec<u8>> {
    if format == PixelFormat::Mjpeg {
        return (!used.is_empty()).then(|| used.to_vec());
    }
    let line = line_bytes(format, size);
    let rows = size.height as usize;
    let height = if format == PixelFormat::Nv12 {
        rows + rows / 2
    } else {
        rows
    };
    // The last line's padding need not be there.
    if height == 0 || used.len() < stride * (height - 1) + line {
        return None;
    }
    if stride == line {
        return Some(used[..line * height].to_vec());
    }
    let mut bytes = Vec::with_capacity(line * height);
    used.chunks(stride)
        .take(height)
        .for_each(|padded| bytes.extend_from_slice(&padded[..line]));
    Some(bytes)
}

/// Bytes of a line without padding, 0 where there are no lines.
fn line_bytes(format: PixelFormat, size: Size) -> usize {
    let bytes_per_pixel = match format {
        PixelFormat::Mjpeg => 0,
        PixelFormat::Yuyv | PixelFormat::Uyvy | PixelFormat::Z16 | PixelFormat::Y16 => 2,
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
        assert_eq!(
            without_padding(&padded[..9], PixelFormat::Yuyv, size, 6),
            None
        );
        assert_eq!(
            without_padding(&padded[..4], PixelFormat::Mjpeg, size, 0).map(|b| b.len()),
            Some(4)
        );
        assert_eq!(without_padding(&[], PixelFormat::Mjpeg, size, 0), None);
    }
}

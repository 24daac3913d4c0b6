//! A V4L2 camera: one negotiation of the format, then frames from mapped buffers, each copied once.
//! One that was lost is found again by its identity, and must grant what it granted before.

mod offers;
mod session;

use super::choice::{Granted, Mode, Wish, choose};
use super::clock::Clock;
use super::identity::{Known, Places};
use super::opened::{describe, same_again};
use super::{Health, Source, SourceError, SourceInfo};
use crate::config;
use crate::model::{PixelFormat, RawFrame, Size};
use offers::{Negotiated, negotiate};
use session::{Session, Taken, Waited};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use v4l::buffer::Flags;
use v4l::capability::{Capabilities, Flags as Caps};

/// The first picture of this driver is what happens to lie in its buffer, with a fresh time on it;
/// and it does not count.
const LOOPBACK: &str = "v4l2 loopback";

/// A camera that films, or did until a moment ago.
pub(super) struct Camera {
    known: Known,
    path: PathBuf,
    name: String,
    asked: Wish,
    granted: Granted,
    stride: usize,
    /// `None` between a failure and the next attempt to open it.
    session: Option<Session>,
    timeout: Duration,
    clock: Clock,
    opened: Instant,
    /// Frames still to be left out at the beginning.
    leave_out: u32,
    loopback: bool,
    stop: Arc<AtomicBool>,
    damaged: u64,
    stale: u64,
}

/// A device that has been opened and has granted a format.
struct Opened {
    caps: Capabilities,
    negotiated: Negotiated,
    device: v4l::Device,
}

impl Camera {
    pub(super) fn open(path: &Path, config: &config::Camera) -> Result<Self, SourceError> {
        let asked = Wish::of(config);
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
        if !asked.is_met_by(&granted) && !config.accept_format {
            let what = refusal(&asked, &granted, &modes);
            return Err(SourceError::BadFormat {
                input: path.display().to_string(),
                what,
            });
        }
        let session = start(path, &device)?;
        let loopback = caps.driver == LOOPBACK;
        Ok(Self {
            known: Known::new(Places::default(), path),
            path: path.to_owned(),
            name: caps.card.trim().to_owned(),
            asked,
            granted,
            stride: stride.max(line_bytes(granted.format, granted.size)),
            session: Some(session),
            timeout: config.time_limit(),
            clock: Clock::new(!loopback),
            opened: Instant::now(),
            leave_out: u32::from(loopback),
            loopback,
            stop: Arc::default(),
            damaged: 0,
            stale: 0,
        })
    }

    fn shown(&self) -> String {
        self.path.display().to_string()
    }

    /// `Ok(None)`: asked to stop meanwhile.
    fn wait(&self, session: &Session, until: Instant) -> Result<Option<()>, SourceError> {
        match session.wait(until, &self.stop) {
            Ok(Waited::Ready) => Ok(Some(())),
            Ok(Waited::Stopped) => Ok(None),
            Ok(Waited::Silent) => Err(SourceError::Timeout {
                input: self.shown(),
                seconds: self.timeout.as_secs_f64(),
            }),
            Err(e) => Err(SourceError::of_driver(
                &self.path,
                "waiting for a frame",
                &e,
            )),
        }
    }

    fn next_of(&mut self, session: &mut Session) -> Result<Option<RawFrame>, SourceError> {
        let until = Instant::now() + self.timeout;
        let failed = |e: io::Error| SourceError::of_driver(&self.path, "taking a frame", &e);
        loop {
            if self.wait(session, until)?.is_none() {
                return Ok(None);
            }
            let (used, meta) = match session.take().map_err(failed)? {
                Taken::Frame(used, meta) => (used, meta),
                Taken::Nothing => {
                    if self.wait(session, until)?.is_none() {
                        return Ok(None);
                    }
                    session.take_lost().map_err(failed)?;
                    self.damaged += 1;
                    continue;
                }
            };
            if self.leave_out > 0 {
                self.leave_out -= 1;
                continue;
            }
            // A damaged frame's number is not taken in: it shows up as a hole in the count, as
            // frames that were lost do, and is told from them by the count of damaged ones.
            let whole = !meta.flags.contains(Flags::ERROR);
            let bytes = whole.then(|| {
                without_padding(used, self.granted.format, self.granted.size, self.stride)
            });
            let Some(bytes) = bytes.flatten() else {
                self.damaged += 1;
                continue;
            };
            let Some((sequence, sensor_time_s)) =
                self.clock.take(meta, self.opened.elapsed().as_secs_f64())
            else {
                self.stale += 1;
                continue;
            };
            let (size, format) = (self.granted.size, self.granted.format);
            return Ok(Some(RawFrame {
                sequence,
                sensor_time_s,
                size,
                format,
                bytes,
            }));
        }
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
        // After an error the device is closed, so that it can go and come back.
        self.session = next.is_ok().then_some(session);
        next
    }

    fn returns(&self) -> bool {
        true
    }

    fn reopen(&mut self) -> Result<(), SourceError> {
        self.session = None;
        let hint = "plug it in again";
        let path = self.known.find().ok_or_else(|| SourceError::Absent {
            input: self.shown(),
            hint,
        })?;
        // Exactly what was granted, and not what was asked for: the pictures must stay as they
        // were.
        let Granted {
            format,
            size,
            rate_hz,
        } = self.granted;
        let wish = Wish {
            format: Some(format),
            size,
            rate_hz: rate_hz.unwrap_or(self.asked.rate_hz),
        };
        let Opened {
            negotiated, device, ..
        } = open(&path, &wish)?;
        same_again(&path, &self.granted, &negotiated.granted)?;
        self.stride = negotiated.stride.max(line_bytes(format, size));
        self.session = Some(start(&path, &device)?);
        self.path = path;
        self.leave_out = u32::from(self.loopback);
        self.clock.returned();
        Ok(())
    }

    fn adopt(&mut self, config: &config::Camera) {
        self.timeout = config.time_limit();
    }

    fn stop_when(&mut self, stop: Arc<AtomicBool>) {
        self.stop = stop;
    }

    fn describe(&self) -> SourceInfo {
        describe(
            &self.path,
            &self.name,
            &self.known,
            &self.asked,
            &self.granted,
        )
    }

    fn health(&self) -> Health {
        Health {
            damaged: self.damaged,
            stale: self.stale,
            clock: self.clock.kind(),
        }
    }
}

/// Opens the device and negotiates.
fn open(path: &Path, wish: &Wish) -> Result<Opened, SourceError> {
    let bad = |what: String| SourceError::BadFormat {
        input: path.display().to_string(),
        what,
    };
    let failed = |doing: &'static str| move |e: io::Error| SourceError::of_driver(path, doing, &e);
    let device = v4l::Device::with_path(path).map_err(failed("opening it"))?;
    let caps = device
        .query_caps()
        .map_err(failed("asking for its abilities"))?;
    if !caps
        .capabilities
        .contains(Caps::VIDEO_CAPTURE | Caps::STREAMING)
    {
        let what = "it does not film (or nothing feeds it yet); `arborcam devices` lists what does";
        return Err(bad(what.to_owned()));
    }
    let negotiated = negotiate(&device, wish, is_usb(&caps)).map_err(|e| match e {
        Ok(name) => bad(format!(
            "it delivers {name}, which is none of the formats that can be read"
        )),
        Err(e) => failed("setting the picture format")(e),
    })?;
    if !negotiated.granted.size.width.is_multiple_of(2) {
        return Err(bad(format!(
            "its pictures have an odd width ({})",
            negotiated.granted.size
        )));
    }
    Ok(Opened {
        caps,
        negotiated,
        device,
    })
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
        "asked for {asked}, it offers {granted}{more}; take that with --accept-format, or set camera.format, width, height and \
         rate_hz to what `arborcam devices` lists"
    )
}

/// What `capture` would film with this device, and why; with all that it lists.
pub(super) struct Prospect {
    pub card: String,
    pub driver: String,
    pub bus: String,
    pub films: bool,
    pub modes: Vec<Mode>,
    pub chosen: Option<(Granted, String)>,
}

/// Asks the device without changing anything about it.
pub(super) fn prospect(path: &Path, config: &config::Camera) -> Result<Prospect, SourceError> {
    let failed = |doing: &'static str| move |e: io::Error| SourceError::of_driver(path, doing, &e);
    let device = v4l::Device::with_path(path).map_err(failed("opening it"))?;
    let caps = device
        .query_caps()
        .map_err(failed("asking for its abilities"))?;
    let films = caps
        .capabilities
        .contains(Caps::VIDEO_CAPTURE | Caps::STREAMING);
    let wish = Wish::of(config);
    let modes = if films {
        offers::modes(&device, &wish)
    } else {
        Vec::new()
    };
    let chosen = choose(&modes, &wish, is_usb(&caps));
    let text = |s: &str| s.trim().to_owned();
    Ok(Prospect {
        card: text(&caps.card),
        driver: text(&caps.driver),
        bus: text(&caps.bus),
        films,
        modes,
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

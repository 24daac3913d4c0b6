//! What a device says it can do, and the negotiation of one of those things.

use super::super::choice::{Granted, Mode, Wish, choose};
use crate::model::{PixelFormat, Size};
use std::io;
use v4l::fraction::Fraction;
use v4l::frameinterval::FrameIntervalEnum;
use v4l::framesize::FrameSizeEnum;
use v4l::parameters::Capabilities;
use v4l::video::Capture;
use v4l::video::capture::Parameters;
use v4l::{Device, Format, FourCC};

/// Tried in this order where a device lists nothing: compressed first, as such devices are mostly
/// old webcams.
const UNLISTED: [PixelFormat; 6] = [
    PixelFormat::Mjpeg,
    PixelFormat::Yuyv,
    PixelFormat::Uyvy,
    PixelFormat::Nv12,
    PixelFormat::Grey,
    PixelFormat::Rgb24,
];

fn fourcc(format: PixelFormat) -> FourCC {
    let mut repr = [b' '; 4];
    repr.iter_mut()
        .zip(format.fourcc().bytes())
        .for_each(|(to, from)| *to = from);
    FourCC::new(&repr)
}

fn hz(interval: Fraction) -> Option<f64> {
    let hz = f64::from(interval.denominator) / f64::from(interval.numerator);
    (hz.is_finite() && hz > 0.0).then_some(hz)
}

/// All that the device lists and we can read: depth or pictures, whichever is wished for. Of a range
/// the size or rate nearest to `wish` stands for all, beside its ends.
pub(super) fn modes(device: &Device, wish: &Wish) -> Vec<Mode> {
    let mut modes = Vec::new();
    let listed = device.enum_formats().unwrap_or_default();
    let formats = listed
        .iter()
        .filter_map(|f| Some((f.fourcc, PixelFormat::from_fourcc(f.fourcc.str().ok()?)?)))
        .filter(|(_, format)| format.is_depth() == wish.is_of_depth());
    for (code, format) in formats {
        for size in sizes(device, code, wish.size) {
            let rates_hz = rates(device, code, size, wish.rate_hz);
            modes.push(Mode {
                format,
                size,
                rates_hz,
            });
        }
    }
    modes
}

/// The largest step of the range that is not beyond `x`.
fn on_step(x: u32, min: u32, max: u32, step: u32) -> u32 {
    let x = x.clamp(min, max.max(min));
    min + (x - min) / step.max(1) * step.max(1)
}

fn sizes(device: &Device, code: FourCC, wish: Size) -> Vec<Size> {
    let mut sizes = Vec::new();
    for listed in device.enum_framesizes(code).unwrap_or_default() {
        match listed.size {
            FrameSizeEnum::Discrete(d) => sizes.push(Size::new(d.width, d.height)),
            FrameSizeEnum::Stepwise(s) => {
                let width = on_step(wish.width, s.min_width, s.max_width, s.step_width);
                let height = on_step(wish.height, s.min_height, s.max_height, s.step_height);
                sizes.push(Size::new(width, height));
                sizes.push(Size::new(s.min_width, s.min_height));
                sizes.push(Size::new(s.max_width, s.max_height));
            }
        }
    }
    let mut seen = Vec::new();
    sizes.retain(|s| {
        s.area() > 0 && !seen.contains(s) && {
            seen.push(*s);
            true
        }
    });
    sizes
}

fn rates(device: &Device, code: FourCC, size: Size, wish_hz: f64) -> Vec<f64> {
    let mut rates = Vec::new();
    for listed in device
        .enum_frameintervals(code, size.width, size.height)
        .unwrap_or_default()
    {
        match listed.interval {
            FrameIntervalEnum::Discrete(interval) => rates.extend(hz(interval)),
            FrameIntervalEnum::Stepwise(s) => {
                if let (Some(slow), Some(fast)) = (hz(s.max), hz(s.min)) {
                    rates.extend([slow, wish_hz.clamp(slow.min(fast), fast.max(slow)), fast]);
                }
            }
        }
    }
    rates.sort_unstable_by(|a, b| b.total_cmp(a));
    rates.dedup();
    rates
}

/// What came of a negotiation.
pub(super) struct Negotiated {
    pub granted: Granted,
    /// Bytes from one line to the next in the driver's buffer.
    pub stride: usize,
    /// All that the device listed.
    pub modes: Vec<Mode>,
}

/// Asks for the best of what the device lists and reads back what it makes of it. `Err(Ok(name))`
/// where that is a format of this name, which we cannot read.
pub(super) fn negotiate(
    device: &Device,
    wish: &Wish,
    usb: bool,
) -> Result<Negotiated, Result<String, io::Error>> {
    let modes = modes(device, wish);
    let granted = match choose(&modes, wish, usb) {
        Some((best, _)) => ask(device, best.format, best.size),
        None => {
            let mut answer = Err(io::Error::from_raw_os_error(libc::EINVAL));
            for format in unlisted(wish) {
                let next = ask(device, format, wish.size);
                let taken = next.as_ref().is_ok_and(|g| g.fourcc == fourcc(format));
                // A device with a fixed format refuses all, or answers with what it has.
                answer = next.or(answer);
                if taken {
                    break;
                }
            }
            answer
        }
    };
    let granted = granted.map_err(Err)?;
    let format = granted.fourcc.str().ok().and_then(PixelFormat::from_fourcc);
    let Some(format) = format.filter(|f| f.is_depth() == wish.is_of_depth()) else {
        return Err(Ok(granted.fourcc.to_string()));
    };
    // Many devices have no rate to set; the frames' own times tell what it is.
    let _ = device.set_params(&Parameters::new(interval_of(wish.rate_hz)));
    let told = device
        .params()
        .ok()
        .filter(|p| p.capabilities.contains(Capabilities::TIME_PER_FRAME));
    let granted_rate_hz = told.and_then(|p| hz(p.interval));
    Ok(Negotiated {
        granted: Granted {
            format,
            size: Size::new(granted.width, granted.height),
            rate_hz: granted_rate_hz,
        },
        stride: granted.stride as usize,
        modes,
    })
}

/// What a device is asked for that lists nothing.
fn unlisted(wish: &Wish) -> Vec<PixelFormat> {
    match wish.format {
        Some(format) if format.is_depth() => PixelFormat::DEPTH.to_vec(),
        Some(format) => vec![format],
        None => UNLISTED.to_vec(),
    }
}

fn ask(device: &Device, format: PixelFormat, size: Size) -> io::Result<Format> {
    device.set_format(&Format::new(size.width, size.height, fourcc(format)))
}

/// 1/30 for 30, 1001/30000 for 29.97.
fn interval_of(rate_hz: f64) -> Fraction {
    if rate_hz.fract() == 0.0 {
        return Fraction::new(1, rate_hz as u32);
    }
    Fraction::new(1001, (rate_hz * 1001.0).round() as u32)
}

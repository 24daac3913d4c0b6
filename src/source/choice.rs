//! Which of the things that a camera can do is asked of it.
//!
//! The size that was asked for first, then a rate that reaches the one asked for, then what is
//! cheapest. Uncompressed pictures cost the processor least and show most, but over USB they crowd
//! each other out: there they are taken up to [`USB_BYTES_PER_S`], and MJPEG beyond it.

use crate::config::{self, CameraFormat};
use crate::model::{PixelFormat, Size};

/// Half of what USB 2 carries: the other half is for whatever else is plugged in.
pub(super) const USB_BYTES_PER_S: f64 = 20e6;
/// Rates that differ by less are the same: 30 and 29.97.
const SAME_RATE: f64 = 0.02;
/// Uncompressed formats, the best first: least to carry and to read, and colour before none.
const PREFERENCE: [PixelFormat; 6] = [
    PixelFormat::Nv12,
    PixelFormat::Yuyv,
    PixelFormat::Uyvy,
    PixelFormat::Rgb24,
    PixelFormat::Grey,
    PixelFormat::Mjpeg,
];

/// Something that a camera says it can do.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    pub format: PixelFormat,
    pub size: Size,
    /// Frames a second; empty where the camera does not say.
    pub rates_hz: Vec<f64>,
}

/// What is asked of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wish {
    /// `None` leaves it to the camera and to us.
    pub format: Option<PixelFormat>,
    pub size: Size,
    pub rate_hz: f64,
}

/// What a camera grants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Granted {
    pub format: PixelFormat,
    pub size: Size,
    /// `None` where the driver cannot tell.
    pub rate_hz: Option<f64>,
}

impl Wish {
    pub(super) fn of(config: &config::Camera) -> Self {
        let format = match config.format {
            CameraFormat::Auto => None,
            CameraFormat::Mjpeg => Some(PixelFormat::Mjpeg),
            CameraFormat::Yuyv => Some(PixelFormat::Yuyv),
            CameraFormat::Uyvy => Some(PixelFormat::Uyvy),
            CameraFormat::Nv12 => Some(PixelFormat::Nv12),
            CameraFormat::Grey => Some(PixelFormat::Grey),
            CameraFormat::Rgb24 => Some(PixelFormat::Rgb24),
        };
        Self {
            format,
            size: Size::new(config.width, config.height),
            rate_hz: f64::from(config.rate_hz),
        }
    }

    /// Whether depth is wanted, and no pictures.
    pub(super) fn is_of_depth(&self) -> bool {
        self.format.is_some_and(PixelFormat::is_depth)
    }

    /// Whether this is what was asked for. A rate that is not told is none that was substituted.
    pub(super) fn is_met_by(&self, granted: &Granted) -> bool {
        self.format.is_none_or(|f| f == granted.format)
            && self.size == granted.size
            && granted
                .rate_hz
                .is_none_or(|hz| is_same_rate(hz, self.rate_hz))
    }
}

impl std::fmt::Display for Wish {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let format = self.format.map_or("any format", PixelFormat::fourcc);
        write!(f, "{format} {} @ {}", self.size, rate(self.rate_hz))
    }
}

impl std::fmt::Display for Granted {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.format, self.size)?;
        self.rate_hz
            .map_or(Ok(()), |hz| write!(f, " @ {}", rate(hz)))
    }
}

pub(super) fn is_same_rate(a_hz: f64, b_hz: f64) -> bool {
    (a_hz / b_hz - 1.0).abs() <= SAME_RATE
}

/// `29.97`, but `30`.
pub(super) fn rate(hz: f64) -> f64 {
    (hz * 100.0).round() / 100.0
}

/// The best of `modes`, and why; `None` if there is none that can be read.
pub(super) fn choose(modes: &[Mode], wish: &Wish, usb: bool) -> Option<(Granted, String)> {
    let all: Vec<Granted> = modes
        .iter()
        .map(|m| Granted {
            format: m.format,
            size: m.size,
            rate_hz: nearest_rate(&m.rates_hz, wish.rate_hz),
        })
        .collect();
    let mut fitting = all.clone();
    fitting.retain(|g| wish.format.is_none_or(|f| f == g.format));
    let chosen = cheapest(&fitting, wish, usb).or_else(|| cheapest(&all, wish, usb))?;
    Some((chosen, why(&chosen, wish, usb)))
}

/// The first of those with the least [`cost`].
fn cheapest(all: &[Granted], wish: &Wish, usb: bool) -> Option<Granted> {
    all.iter().copied().min_by(|a, b| {
        cost(a, wish, usb)
            .partial_cmp(&cost(b, wish, usb))
            .unwrap_or(std::cmp::Ordering::Equal)
    })
}

/// The slowest rate that reaches the one asked for, else the fastest.
fn nearest_rate(rates_hz: &[f64], asked_hz: f64) -> Option<f64> {
    let reaching = rates_hz
        .iter()
        .copied()
        .filter(|hz| *hz >= asked_hz * (1.0 - SAME_RATE));
    reaching
        .min_by(f64::total_cmp)
        .or_else(|| rates_hz.iter().copied().max_by(f64::total_cmp))
}

/// Absolute logarithm of the ratio of two lengths in pixels.
fn log_ratio(a: u32, b: u32) -> f64 {
    (f64::from(a.max(1)) / f64::from(b.max(1))).ln().abs()
}

/// Smaller is better, from the first entry to the last.
fn cost(g: &Granted, wish: &Wish, usb: bool) -> (f64, f64, bool, usize) {
    let size =
        log_ratio(g.size.width, wish.size.width) + log_ratio(g.size.height, wish.size.height);
    let hz = g.rate_hz.unwrap_or(wish.rate_hz);
    // Too slow is worse than any surplus.
    let rate = if is_same_rate(hz, wish.rate_hz) {
        0.0
    } else if hz > wish.rate_hz {
        1e-3 * hz / wish.rate_hz
    } else {
        wish.rate_hz / hz.max(1e-3)
    };
    let order = PREFERENCE
        .iter()
        .position(|f| *f == g.format)
        .unwrap_or(PREFERENCE.len());
    (
        size,
        rate,
        usb && bytes_per_s(g, wish).is_some_and(|b| b > USB_BYTES_PER_S),
        order,
    )
}

/// `None` for compressed pictures.
fn bytes_per_s(g: &Granted, wish: &Wish) -> Option<f64> {
    g.format
        .picture_bytes(g.size)
        .map(|bytes| bytes as f64 * g.rate_hz.unwrap_or(wish.rate_hz))
}

fn why(g: &Granted, wish: &Wish, usb: bool) -> String {
    let mut reasons = Vec::new();
    if g.size != wish.size {
        reasons.push(format!("nearest to the asked {}", wish.size));
    }
    match g.rate_hz {
        Some(hz) if is_same_rate(hz, wish.rate_hz) => {}
        Some(hz) if hz > wish.rate_hz => reasons.push(format!(
            "it has no {} a second, only more",
            rate(wish.rate_hz)
        )),
        Some(_) => reasons.push(format!(
            "the fastest at that size; {} a second were asked",
            rate(wish.rate_hz)
        )),
        None => reasons.push("it does not tell its rates".into()),
    }
    let megabytes = bytes_per_s(g, wish).map(|b| b / 1e6);
    reasons.push(match (wish.format, megabytes) {
        (Some(f), _) if f == g.format => "the format that was asked for".into(),
        (Some(f), _) => format!("it has no {f}"),
        (None, None) => {
            "compressed, as uncompressed it is not to be had or too much for USB".into()
        }
        (None, Some(mb)) if usb && mb * 1e6 > USB_BYTES_PER_S => {
            format!("uncompressed, {mb:.0} MB/s: much for USB, but there is no MJPEG")
        }
        (None, Some(mb)) => format!("uncompressed, {mb:.0} MB/s"),
    });
    reasons.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use PixelFormat::{Grey, Mjpeg, Nv12, Yuyv};

    fn mode(format: PixelFormat, width: u32, height: u32, rates_hz: &[f64]) -> Mode {
        Mode {
            format,
            size: Size::new(width, height),
            rates_hz: rates_hz.to_vec(),
        }
    }

    /// A usual webcam.
    fn webcam() -> Vec<Mode> {
        vec![
            mode(Yuyv, 640, 480, &[30.0, 15.0]),
            mode(Yuyv, 1280, 720, &[10.0]),
            mode(Mjpeg, 640, 480, &[60.0, 30.0]),
            mode(Mjpeg, 1280, 720, &[60.0, 30.0]),
        ]
    }

    const HD: Size = Size {
        width: 1280,
        height: 720,
    };
    const VGA: Size = Size {
        width: 640,
        height: 480,
    };

    /// What is chosen of `modes` for these wishes and 30 frames a second; `usb` says on which bus.
    fn chosen(modes: &[Mode], format: Option<PixelFormat>, size: Size, usb: bool) -> String {
        let wish = Wish {
            format,
            size,
            rate_hz: 30.0,
        };
        let (chosen, why) = choose(modes, &wish, usb).expect("something");
        assert!(!why.is_empty());
        chosen.to_string()
    }

    #[test]
    fn the_size_decides_and_then_the_rate() {
        let webcam = webcam();
        assert_eq!(chosen(&webcam, None, HD, true), "MJPG 1280x720 @ 30");
        let larger = Size::new(1920, 1080);
        assert_eq!(chosen(&webcam, None, larger, true), "MJPG 1280x720 @ 30");
        // What is asked for by name is taken, slow as it is.
        let by_name = chosen(&webcam, Some(Yuyv), HD, true);
        assert_eq!(by_name, "YUYV 1280x720 @ 10");
        let slow = [mode(Yuyv, 1280, 720, &[10.0, 5.0])];
        assert_eq!(chosen(&slow, None, HD, true), "YUYV 1280x720 @ 10");
        // Too fast is better than too slow.
        let fast = [mode(Mjpeg, 1280, 720, &[120.0, 60.0])];
        assert_eq!(chosen(&fast, None, HD, true), "MJPG 1280x720 @ 60");
    }

    #[test]
    fn of_equals_the_cheapest_is_taken() {
        // 18 MB/s are no burden for USB, 55 are; another bus carries them.
        assert_eq!(chosen(&webcam(), None, VGA, true), "YUYV 640x480 @ 30");
        let both = [
            mode(Yuyv, 1280, 720, &[30.0]),
            mode(Mjpeg, 1280, 720, &[30.0]),
        ];
        assert_eq!(chosen(&both, None, HD, true), "MJPG 1280x720 @ 30");
        assert_eq!(chosen(&both, None, HD, false), "YUYV 1280x720 @ 30");
        let without_rates = [mode(Grey, 1280, 720, &[]), mode(Nv12, 1280, 720, &[])];
        assert_eq!(chosen(&without_rates, None, HD, false), "NV12 1280x720");
    }

    #[test]
    fn a_format_that_is_not_offered_is_replaced_and_said() {
        let wish = Wish {
            format: Some(Nv12),
            size: VGA,
            rate_hz: 30.0,
        };
        assert_eq!(choose(&[], &wish, true), None);
        let (chosen, why) = choose(&webcam(), &wish, true).expect("something");
        assert!(
            !wish.is_met_by(&chosen) && why.contains("no NV12"),
            "{chosen} {why}"
        );
    }

    #[test]
    fn what_is_not_told_is_not_substituted() {
        let wish = Wish {
            format: None,
            size: Size::new(640, 480),
            rate_hz: 30.0,
        };
        let granted = |width, rate_hz| Granted {
            format: Yuyv,
            size: Size::new(width, 480),
            rate_hz,
        };
        assert!(
            wish.is_met_by(&granted(640, None))
                && wish.is_met_by(&granted(640, Some(30000.0 / 1001.0)))
        );
        assert!(!wish.is_met_by(&granted(640, Some(25.0))) && !wish.is_met_by(&granted(648, None)));
    }
}

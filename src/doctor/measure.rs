//! Figures of this machine: decoding, tracking, disk.

use crate::config::Config;
use crate::model::{Frame, Luma, PixelFormat, RawFrame, Size};
use crate::outline::whole;
use crate::pipeline::FrontEnd;
use crate::source::Decoder;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Time for each measurement.
const SPAN: Duration = Duration::from_secs(1);
/// Bytes that are written to find out how fast the disk is, at most.
const WRITTEN: usize = 64 << 20;
const PIECE: usize = 1 << 20;

/// A picture of our own, so that decoding can be tried without a camera.
const PROBE: &[u8] = include_bytes!("probe.jpg");
const PROBE_SIZE: Size = Size {
    width: 320,
    height: 180,
};

/// Time to decode a picture of `size` from JPEG to luma, ms.
///
/// # Errors
/// What the decoder says.
pub fn decode_ms(size: Size) -> Result<f64, String> {
    let mut decoder = Decoder::new().map_err(|e| e.to_string())?;
    let raw = RawFrame {
        sequence: Some(0),
        sensor_time_s: 0.0,
        size: PROBE_SIZE,
        format: PixelFormat::Mjpeg,
        bytes: PROBE.to_vec(),
        depth: None,
    };
    let mut luma = Luma {
        size: PROBE_SIZE,
        pixels: Vec::new(),
    };
    decoder.luma(&raw, &mut luma).map_err(|e| e.to_string())?;
    let (began, mut n) = (Instant::now(), 0_u32);
    while began.elapsed() < SPAN / 4 {
        decoder.luma(&raw, &mut luma).map_err(|e| e.to_string())?;
        n += 1;
    }
    let one_ms = began.elapsed().as_secs_f64() * 1e3 / f64::from(n.max(1));
    // Decoding costs by the pixel.
    Ok(one_ms * size.area() as f64 / PROBE_SIZE.area() as f64)
}

/// Frames a second that the tracker manages at the configured size, on one core.
pub fn frames_per_s(config: &Config) -> f64 {
    let size = Size::new(config.camera.width, config.camera.height);
    let mut front = FrontEnd::new(config, Some(whole(size)));
    let pictures = [0, 1].map(|shift| texture(size, shift));
    // The first frame is for detection, which comes once and does not have to keep up.
    let (mut began, mut n) = (Instant::now(), 0_u64);
    loop {
        let mut luma = front.spare().unwrap_or(Luma {
            size,
            pixels: Vec::new(),
        });
        luma.pixels.clear();
        luma.pixels.extend_from_slice(&pictures[n as usize % 2]);
        drop(front.step(Frame {
            index: n,
            time_s: n as f64 / f64::from(config.camera.rate_hz),
            received: Instant::now(),
            luma,
            preview: None::<Arc<_>>,
            colour: None,
            raw: None,
            depth: None,
        }));
        if n == 0 {
            began = Instant::now();
        } else if began.elapsed() >= SPAN {
            return n as f64 / began.elapsed().as_secs_f64();
        }
        n += 1;
    }
}

/// Blocks of pseudo-random brightness, full of corners, moved by `shift` px.
fn texture(size: Size, shift: usize) -> Vec<u8> {
    let (width, height) = (size.width as usize, size.height as usize);
    let mut pixels = Vec::with_capacity(width * height);
    for v in 0..height {
        for u in 0..width {
            pixels.push(block_brightness(u + shift, v));
        }
    }
    pixels
}

/// Brightness of the block of 8 by 8 pixels that holds pixel (u, v): a hash of its place.
fn block_brightness(u: usize, v: usize) -> u8 {
    let mixed =
        ((u / 8) as u32).wrapping_mul(0x9e37_79b1) ^ ((v / 8) as u32).wrapping_mul(0x85eb_ca6b);
    (mixed.wrapping_mul(0xc2b2_ae35) >> 24) as u8
}

/// A disk that is to be written to.
#[derive(Clone, Debug, PartialEq)]
pub struct Disk {
    pub folder: String,
    pub free_bytes: u64,
    pub bytes_per_s: f64,
}

/// Writes a nameless file to `folder` to see how fast that goes; nothing stays.
///
/// # Errors
/// It cannot be written to; what the system says.
pub fn disk(folder: &Path) -> std::io::Result<Disk> {
    let mut file = tempfile::tempfile_in(folder)?;
    let free_bytes = free_bytes(folder)?;
    let piece = vec![0x5a; PIECE];
    let most = WRITTEN.min(usize::try_from(free_bytes / 4).unwrap_or(WRITTEN));
    let (began, mut written) = (Instant::now(), 0);
    // At least one piece, or there would be no figure.
    while written == 0 || (written < most && began.elapsed() < SPAN) {
        file.write_all(&piece)?;
        written += PIECE;
        file.sync_data()?;
    }
    let bytes_per_s = written as f64 / began.elapsed().as_secs_f64().max(1e-6);
    Ok(Disk {
        folder: folder.display().to_string(),
        free_bytes,
        bytes_per_s,
    })
}

fn free_bytes(folder: &Path) -> std::io::Result<u64> {
    use std::os::unix::ffi::OsStrExt;
    let path = std::ffi::CString::new(folder.as_os_str().as_bytes())?;
    let mut stat = std::mem::MaybeUninit::<libc::statvfs>::zeroed();
    // SAFETY: the path ends with a zero byte, and the call fills the structure that the pointer is
    // to.
    if unsafe { libc::statvfs(path.as_ptr(), stat.as_mut_ptr()) } != 0 {
        return Err(std::io::Error::last_os_error());
    }
    // SAFETY: filled by the call, and zero is a value of every field of it.
    let stat = unsafe { stat.assume_init() };
    // Narrower on boards of 32 bits.
    #[allow(clippy::unnecessary_cast)]
    Ok(stat.f_bavail as u64 * stat.f_frsize as u64)
}

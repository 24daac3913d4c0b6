//! A USB camera without hardware: a UVC device spoken over USB/IP to the guest's own kernel,
//! through `vhci_hcd`. The kernel sees it as plugged into a port, with vendor, product and serial
//! number; `uvcvideo` makes the /dev/video device. Ending this process pulls the plug.
//!
//!     usb-camera CLIP WIDTH HEIGHT FPS SERIAL PORT GATE
//!
//! It delivers the pictures of CLIP over and over, as they are, while the file GATE is there: JPEG
//! pictures, or, where its name ends in `.z16`, depth images of 16 bits a pixel;
//! without it, it is a camera that answers and films nothing. While GATE.deaf is there it answers
//! nothing at all, and whoever closes it waits in the kernel until it is pulled out.

mod descriptors;
mod usbip;

use std::collections::VecDeque;
use std::io;
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use usbip::{Request, Submit};

/// What a transfer of pictures may hold, with its header of two bytes: what `uvcvideo` asks for at
/// once.
const PAYLOAD: usize = 16 * 1024;
const HEADER: usize = 2;
/// Time between two looks while nothing is to be sent.
const IDLE: Duration = Duration::from_millis(50);

/// What a picture is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    Jpeg,
    Depth,
}

/// What is filmed.
pub struct Mode {
    pub encoding: Encoding,
    pub width: u16,
    pub height: u16,
    pub fps: u32,
    pub serial: String,
}

impl Mode {
    /// Time between two pictures, 100 ns, as UVC counts it.
    fn interval(&self) -> u32 {
        10_000_000 / self.fps
    }

    /// No picture is larger than this, bytes.
    fn picture_bytes(&self) -> u32 {
        u32::from(self.width) * u32::from(self.height) * 2
    }
}

pub fn main(args: &[String]) -> ExitCode {
    match plug_in(args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("usb-camera: {e}");
            ExitCode::FAILURE
        }
    }
}

fn plug_in(args: &[String]) -> io::Result<()> {
    let [clip, width, height, fps, serial, port, gate] = args else {
        return Err(io::Error::other(
            "usb-camera CLIP WIDTH HEIGHT FPS SERIAL PORT GATE",
        ));
    };
    let number = |text: &str| {
        text.parse::<u16>()
            .map_err(|_| io::Error::other(format!("{text} is no number")))
    };
    let mode = Mode {
        encoding: if clip.ends_with(".z16") {
            Encoding::Depth
        } else {
            Encoding::Jpeg
        },
        width: number(width)?,
        height: number(height)?,
        fps: u32::from(number(fps)?).max(1),
        serial: serial.clone(),
    };
    let port = number(port)?;
    let clip = std::fs::read(clip)?;
    let pictures = match mode.encoding {
        Encoding::Jpeg => jpeg_pictures(&clip),
        Encoding::Depth => {
            let images = clip.chunks_exact(mode.picture_bytes() as usize);
            images.map(<[u8]>::to_vec).collect()
        }
    };
    if pictures.is_empty() {
        return Err(io::Error::other("no picture in the clip"));
    }
    let (ours, kernels) = UnixStream::pair()?;
    // Port, socket, bus and device number of the other side, speed (3: high).
    let attach = format!("{port} {} {} 3", kernels.as_raw_fd(), 0x0001_0002);
    // Just after another one was pulled out, the port is not free yet.
    let until = Instant::now() + Duration::from_secs(2);
    while let Err(e) = std::fs::write("/sys/devices/platform/vhci_hcd.0/attach", &attach) {
        if Instant::now() > until {
            return Err(io::Error::other(format!("port {port}: {e}")));
        }
        std::thread::sleep(IDLE);
    }
    drop(kernels);
    let gate = PathBuf::from(gate);
    Camera {
        socket: ours,
        mode,
        pictures,
        gate,
        waiting: VecDeque::new(),
        probe: [0; 26],
        filming: None,
    }
    .run()
}

/// The JPEG pictures of a file that holds nothing else, one after the other.
fn jpeg_pictures(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut found = Vec::new();
    let mut from = 0;
    while let Some(at) = bytes[from..].windows(2).position(|w| w == [0xff, 0xd9]) {
        found.push(bytes[from..from + at + 2].to_vec());
        from += at + 2;
    }
    found
}

/// Pictures under way, from the first transfer that was asked for.
struct Filming {
    started: Instant,
    picture: u64,
    /// Bytes of the picture that have gone.
    sent: usize,
}

struct Camera {
    socket: UnixStream,
    mode: Mode,
    pictures: Vec<Vec<u8>>,
    gate: PathBuf,
    /// Transfers of pictures that the kernel waits for.
    waiting: VecDeque<Submit>,
    /// The format as it was last negotiated.
    probe: [u8; 26],
    filming: Option<Filming>,
}

impl Camera {
    fn run(mut self) -> io::Result<()> {
        self.probe = descriptors::probe(&self.mode);
        let deaf = self.gate.with_extension("deaf");
        loop {
            if deaf.exists() {
                std::thread::sleep(IDLE);
                continue;
            }
            self.deliver()?;
            let nap = self.filming.as_ref().map_or(IDLE, |f| self.due(f));
            self.socket
                .set_read_timeout(Some(nap.max(Duration::from_millis(1))))?;
            let request = match usbip::read(&mut self.socket) {
                Ok(request) => request,
                Err(e)
                    if matches!(
                        e.kind(),
                        io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut
                    ) =>
                {
                    continue;
                }
                // The port was switched off.
                Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => return Ok(()),
                Err(e) => return Err(e),
            };
            match request {
                Request::Submit(submit) if submit.endpoint == 0 => self.control(&submit)?,
                Request::Submit(submit) => self.waiting.push_back(submit),
                Request::Unlink { sequence, of } => self.unlink(sequence, of)?,
            }
        }
    }

    /// Time until the next picture.
    fn due(&self, filming: &Filming) -> Duration {
        let at = Duration::from_secs(filming.picture) / self.mode.fps;
        if self.waiting.is_empty() {
            return IDLE;
        }
        (filming.started + at).saturating_duration_since(Instant::now())
    }

    /// Sends what is due into the transfers that wait. A camera whose host is late leaves pictures
    /// out.
    fn deliver(&mut self) -> io::Result<()> {
        if self.waiting.is_empty() {
            return Ok(());
        }
        if !self.gate.exists() {
            self.filming = None;
            return Ok(());
        }
        let filming = self.filming.get_or_insert_with(|| Filming {
            started: Instant::now(),
            picture: 0,
            sent: 0,
        });
        while let Some(transfer) = self.waiting.front() {
            let due = filming.started + Duration::from_secs(filming.picture) / self.mode.fps;
            if Instant::now() < due {
                break;
            }
            let picture = &self.pictures[(filming.picture % self.pictures.len() as u64) as usize];
            let room = (transfer.length as usize)
                .min(PAYLOAD)
                .saturating_sub(HEADER);
            let part = &picture[filming.sent..(filming.sent + room).min(picture.len())];
            let last = filming.sent + part.len() == picture.len();
            // End of header, the picture's parity, end of picture.
            let flags = 0x80 | u8::from(filming.picture % 2 == 1) | (u8::from(last) << 1);
            let payload = [&[HEADER as u8, flags], part].concat();
            usbip::answer(&mut self.socket, transfer, 0, &payload)?;
            self.waiting.pop_front();
            filming.sent += part.len();
            if last {
                filming.sent = 0;
                filming.picture += 1;
            }
        }
        Ok(())
    }

    fn unlink(&mut self, sequence: u32, of: u32) -> io::Result<()> {
        let known = self.waiting.iter().position(|t| t.sequence == of);
        if let Some(at) = known {
            self.waiting.remove(at);
        }
        if self.waiting.is_empty() {
            self.filming = None;
        }
        usbip::unlinked(&mut self.socket, sequence, known.is_some())
    }

    /// Requests to the device as a whole: descriptors, and UVC's negotiation.
    fn control(&mut self, submit: &Submit) -> io::Result<()> {
        let [kind, request, value_lo, value_hi, ..] = submit.setup;
        let wanted = usize::from(u16::from_le_bytes([submit.setup[6], submit.setup[7]]));
        let answer: Option<Vec<u8>> = match (kind, request) {
            (0x80, 6) => descriptors::descriptor(&self.mode, value_hi, value_lo),
            // Status; configuration; alternate setting.
            (0x80..=0x82, 0) => Some(vec![0, 0]),
            (0x80, 8) => Some(vec![1]),
            (0x81, 10) => Some(vec![0]),
            // Address, configuration, interface, and a cleared halt, which is how streaming over
            // bulk is stopped.
            (0x00..=0x02, _) => {
                if request == 1 {
                    self.filming = None;
                }
                Some(Vec::new())
            }
            // Video streaming: what is offered is what there is, whatever is asked for.
            (0xa1, 0x85) => Some(vec![26, 0]),
            (0xa1, 0x86) => Some(vec![3]),
            (0xa1, 0x81..=0x87) => Some(self.probe.to_vec()),
            (0x21, 1) => Some(Vec::new()),
            _ => None,
        };
        match answer {
            Some(mut data) => {
                data.truncate(wanted);
                usbip::answer(&mut self.socket, submit, 0, &data)
            }
            // Stalled: the device does not know this.
            None => usbip::answer(&mut self.socket, submit, -libc::EPIPE, &[]),
        }
    }
}

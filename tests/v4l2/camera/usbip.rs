//! USB/IP as the kernel speaks it on an attached socket: a header of 48 bytes, big-endian, then the
//! data.

use std::io::{self, Read, Write};

const SUBMIT: u32 = 1;
const UNLINK: u32 = 2;
const RETURN_SUBMIT: u32 = 3;
const RETURN_UNLINK: u32 = 4;
const HEADER: usize = 48;

/// What the kernel wants.
pub enum Request {
    Submit(Submit),
    /// Forget the transfer `of`.
    Unlink {
        sequence: u32,
        of: u32,
    },
}

/// A transfer.
pub struct Submit {
    pub sequence: u32,
    pub endpoint: u32,
    /// To the host.
    pub incoming: bool,
    /// Bytes that are sent or that there is room for.
    pub length: u32,
    pub setup: [u8; 8],
}

/// Waits for a request for as long as the socket's time limit.
pub fn read(socket: &mut (impl Read + Write)) -> io::Result<Request> {
    let mut header = [0; HEADER];
    // The kernel writes a header in one go: a time-out comes before its first byte, or not at all.
    socket.read_exact(&mut header)?;
    let word = |at: usize| {
        u32::from_be_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]])
    };
    match word(0) {
        SUBMIT => {
            let mut setup = [0; 8];
            setup.copy_from_slice(&header[40..48]);
            let submit = Submit {
                sequence: word(4),
                incoming: word(12) == 1,
                endpoint: word(16),
                length: word(24),
                setup,
            };
            if !submit.incoming {
                let mut data = vec![0; submit.length as usize];
                socket.read_exact(&mut data)?;
            }
            Ok(Request::Submit(submit))
        }
        UNLINK => Ok(Request::Unlink {
            sequence: word(4),
            of: word(20),
        }),
        other => Err(io::Error::other(format!("unknown USB/IP command {other}"))),
    }
}

/// Ends a transfer with `status` (0 or a negative error number) and, towards the host, with `data`.
pub fn answer(
    socket: &mut impl Write,
    submit: &Submit,
    status: i32,
    data: &[u8],
) -> io::Result<()> {
    let length = if submit.incoming {
        data.len() as u32
    } else {
        submit.length
    };
    let mut packet = header(RETURN_SUBMIT, submit.sequence, status);
    packet[24..28].copy_from_slice(&length.to_be_bytes());
    if submit.incoming {
        packet.extend_from_slice(data);
    }
    socket.write_all(&packet)
}

/// Confirms that a transfer is forgotten, if it was `known` still.
pub fn unlinked(socket: &mut impl Write, sequence: u32, known: bool) -> io::Result<()> {
    let status = if known { -libc::ECONNRESET } else { 0 };
    socket.write_all(&header(RETURN_UNLINK, sequence, status))
}

fn header(command: u32, sequence: u32, status: i32) -> Vec<u8> {
    let mut bytes = vec![0; HEADER];
    bytes[0..4].copy_from_slice(&command.to_be_bytes());
    bytes[4..8].copy_from_slice(&sequence.to_be_bytes());
    bytes[20..24].copy_from_slice(&status.to_be_bytes());
    bytes
}

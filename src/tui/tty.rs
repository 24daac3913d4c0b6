//! Waiting for the keyboard without being caught by a terminal that has gone.

use std::fs::File;
use std::io::{self, IsTerminal};
use std::os::fd::{AsRawFd, RawFd};
use std::time::Duration;

/// What came of waiting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// Something can be read.
    Ready,
    /// The time is over.
    Quiet,
    /// There is no terminal any more.
    Gone,
}

/// The terminal that the keyboard belongs to: standard input, or where that is something else
/// `/dev/tty`.
///
/// crossterm spins for ever in a read once the terminal has hung up, so it must be asked only when
/// this says `Ready`.
#[derive(Debug)]
pub struct Tty(Option<File>);

impl Tty {
    /// # Errors
    /// The process has no terminal.
    pub fn open() -> io::Result<Self> {
        let own = if io::stdin().is_terminal() {
            None
        } else {
            Some(File::open("/dev/tty")?)
        };
        Ok(Self(own))
    }

    /// Waits until there is something to read, at most `limit`; a signal counts as something.
    pub fn wait(&self, limit: Duration) -> Input {
        let mut fd = libc::pollfd {
            fd: self.fd(),
            events: libc::POLLIN,
            revents: 0,
        };
        let limit_ms = limit.as_millis().min(10_000) as libc::c_int;
        // SAFETY: the pointer is to one pollfd that lives through the call, as the count says.
        let n = unsafe { libc::poll(&mut fd, 1, limit_ms) };
        if n < 0 {
            let interrupted = io::Error::last_os_error().kind() == io::ErrorKind::Interrupted;
            return if interrupted {
                Input::Quiet
            } else {
                Input::Gone
            };
        }
        match fd.revents {
            0 => Input::Quiet,
            r if r & (libc::POLLHUP | libc::POLLERR | libc::POLLNVAL) != 0 => Input::Gone,
            _ => Input::Ready,
        }
    }

    /// Reads what is there, after [`wait`](Self::wait) has said `Ready`.
    ///
    /// # Errors
    /// The terminal cannot be read.
    pub fn read(&self, into: &mut [u8]) -> io::Result<usize> {
        // SAFETY: the pointer and length are those of one slice that may be written to.
        let n = unsafe { libc::read(self.fd(), into.as_mut_ptr().cast(), into.len()) };
        usize::try_from(n).map_err(|_| io::Error::last_os_error())
    }

    fn fd(&self) -> RawFd {
        self.0
            .as_ref()
            .map_or(libc::STDIN_FILENO, AsRawFd::as_raw_fd)
    }
}

//! ffmpeg as a child process: what reading and writing videos have in common.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek};
use std::os::unix::process::CommandExt;
#[cfg(feature = "camera")]
use std::process::ChildStdout;
use std::process::{Child, ChildStdin, Command, ExitStatus};

/// So much of what ffmpeg says is looked at, bytes.
const LOOKED_AT: u64 = 1 << 16;

/// ffmpeg while it runs. Ends with the value.
#[derive(Debug)]
pub struct Ffmpeg {
    child: Child,
    /// What it complains about; a file, for a pipe would want to be read.
    log: File,
}

impl Ffmpeg {
    /// Starts it, in a process group of its own: Ctrl-C at the terminal is for us, and would look
    /// like the end of a clip if ffmpeg got it.
    ///
    /// # Errors
    /// `NotFound` if the program is not there; or there is no room for what it says.
    pub fn start(command: &mut Command) -> io::Result<Self> {
        let log = tempfile::tempfile().map_err(not_the_program)?;
        command.stderr(log.try_clone().map_err(not_the_program)?);
        command.process_group(0);
        Ok(Self {
            child: command.spawn()?,
            log,
        })
    }

    /// Its standard input, if it is a pipe and was not taken yet.
    pub fn input(&mut self) -> Option<ChildStdin> {
        self.child.stdin.take()
    }

    /// Its standard output, if it is a pipe and was not taken yet.
    #[cfg(feature = "camera")]
    pub fn output(&mut self) -> Option<ChildStdout> {
        self.child.stdout.take()
    }

    /// Waits until it ends by itself.
    ///
    /// # Errors
    /// It cannot be waited for.
    pub fn wait(&mut self) -> io::Result<ExitStatus> {
        self.child.wait()
    }

    /// Ends it.
    pub fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// What it has complained about, line by line. It must have ended.
    pub fn complaints(&mut self) -> Vec<String> {
        let _ = self.log.rewind();
        let lines = BufReader::new((&self.log).take(LOOKED_AT)).lines();
        lines
            .map_while(Result::ok)
            .filter(|line| !line.trim().is_empty())
            .collect()
    }
}

impl Drop for Ffmpeg {
    fn drop(&mut self) {
        self.kill();
    }
}

/// A complaint without the part of ffmpeg that it comes from, `[libx264 @ 0x5581] `: the address
/// tells nobody anything.
pub fn plain(complaint: &str) -> &str {
    match complaint.split_once("] ") {
        Some((_, what)) => what.trim(),
        None => complaint.trim(),
    }
}

fn not_the_program(e: io::Error) -> io::Error {
    io::Error::other(e.to_string())
}

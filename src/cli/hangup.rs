//! What SIGHUP means: to a program in a terminal that the terminal is gone, to one without that its
//! settings are to be read again.

use super::{Common, say};
use crate::config::{Change, Config};
use crate::runtime::Running;
use signal_hook::consts::SIGHUP;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What a hang-up asks for; decided once, because the terminal may be gone when the signal comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hangup {
    /// No terminal that could hang up: somebody has sent it, and means what a service is told by
    /// it.
    Reload,
    /// The terminal is gone: end in good order.
    Stop,
    /// Whoever started us, `nohup` for one, wants us to outlive the terminal.
    Ignored,
}

impl Hangup {
    /// What holds for this process.
    pub fn of_this_process() -> Self {
        let read =
            |name: &str| std::fs::read_to_string(format!("/proc/self/{name}")).unwrap_or_default();
        Self::of(&read("stat"), &read("status"))
    }

    /// From the contents of `/proc/self/stat` and `/proc/self/status`.
    fn of(stat: &str, status: &str) -> Self {
        // The name in brackets may itself hold blanks and brackets; the terminal is the fifth field
        // after it.
        let terminal = stat
            .rsplit_once(')')
            .and_then(|(_, rest)| rest.split_whitespace().nth(4));
        if terminal == Some("0") {
            return Hangup::Reload;
        }
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let bits = mask
            .and_then(|m| u64::from_str_radix(m.trim(), 16).ok())
            .unwrap_or(0);
        if bits & (1 << (SIGHUP - 1)) != 0 {
            Hangup::Ignored
        } else {
            Hangup::Stop
        }
    }
}

/// Waits for the wish to read the settings again, and fulfils it.
pub struct Reload<'a> {
    common: &'a Common,
    set: &'a dyn Fn(&mut Config),
    wanted: Arc<AtomicBool>,
    current: Config,
}

impl<'a> Reload<'a> {
    /// `current` is what the capture runs with. Listens to SIGHUP where `hangup` says so.
    ///
    /// # Errors
    /// The signal cannot be caught.
    pub fn new(
        (common, set): (&'a Common, &'a dyn Fn(&mut Config)),
        current: &Config,
        hangup: Hangup,
    ) -> std::io::Result<Self> {
        let wanted = Arc::<AtomicBool>::default();
        if hangup == Hangup::Reload {
            signal_hook::flag::register(SIGHUP, wanted.clone())?;
        }
        Ok(Self {
            common,
            set,
            wanted,
            current: current.clone(),
        })
    }

    /// What holds for the camera now.
    pub fn camera(&self) -> &crate::config::Camera {
        &self.current.camera
    }

    /// Whether somebody asks.
    pub fn is_wanted(&self) -> bool {
        self.wanted.load(Ordering::SeqCst)
    }

    /// Reads the settings, passes on what can be changed, and says of every difference what becomes
    /// of it.
    pub fn fulfil(&mut self, running: &Running) {
        self.wanted.store(false, Ordering::SeqCst);
        for line in self.read_again(running) {
            say(&format!("arborcam: reload: {line}"));
        }
    }

    fn read_again(&mut self, running: &Running) -> Vec<String> {
        if self.common.config.is_none() {
            return vec!["there is no --config file to read again; nothing is changed".to_owned()];
        }
        let wanted = match self.common.config(self.set) {
            Ok(wanted) => wanted,
            Err(e) => return vec![format!("{e}; nothing is changed")],
        };
        let (next, changes) = self.current.reload(&wanted);
        if changes.is_empty() {
            return vec!["the settings are what they were".to_owned()];
        }
        running.reload(next.clone());
        self.current = next;
        changes.iter().map(Change::to_string).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hang_up_means_what_the_process_was_started_as() {
        let stat = |terminal: i32| format!("42 (a) b (c) S 1 42 42 {terminal} -1 4194560");
        let status =
            |mask: &str| format!("Name:\tarborcam\nSigBlk:\t0000000000000001\nSigIgn:\t{mask}\n");
        for (terminal, mask, expected) in [
            (0, "0000000000001000", Hangup::Reload),
            (0, "0000000000001001", Hangup::Reload),
            (34816, "0000000000001000", Hangup::Stop),
            (34816, "0000000000001001", Hangup::Ignored),
        ] {
            assert_eq!(
                Hangup::of(&stat(terminal), &status(mask)),
                expected,
                "{terminal} {mask}"
            );
        }
        // Without /proc nothing is known, and losing a capture would be worse than not reading
        // settings.
        assert_eq!(Hangup::of("", ""), Hangup::Stop);
    }
}

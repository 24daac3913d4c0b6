//! What SIGHUP means: to a program in a terminal that the terminal is gone, to one without that its
//! settings are to be read again.

use super::camera::CameraArgs;
use super::common::Common;
use super::output::say;
use crate::config::{Change, Config};
use crate::runtime::Running;
use signal_hook::consts::SIGHUP;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What SIGHUP asks for; decided once, because the terminal may be gone when the signal comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SighupAction {
    /// There is no terminal that could hang up: it was sent on purpose, as to a service.
    Reload,
    /// The terminal is gone: end in good order.
    Stop,
    /// The program was started to outlive the terminal, by `nohup` for example.
    Ignored,
}

impl SighupAction {
    /// What holds for this process.
    pub fn of_this_process() -> Self {
        let stat = std::fs::read_to_string("/proc/self/stat");
        let status = std::fs::read_to_string("/proc/self/status");
        Self::of(&stat.unwrap_or_default(), &status.unwrap_or_default())
    }

    /// Whether it is to end this process, which has no settings that could be read again.
    pub fn ends_this_process() -> bool {
        Self::of_this_process() != Self::Ignored
    }

    /// From the contents of `/proc/self/stat` and `/proc/self/status`.
    fn of(stat: &str, status: &str) -> Self {
        // The name in brackets may itself hold blanks and brackets; the terminal is the fifth field
        // after it.
        let terminal = stat
            .rsplit_once(')')
            .and_then(|(_, rest)| rest.split_whitespace().nth(4));
        if terminal == Some("0") {
            return SighupAction::Reload;
        }
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let bits = mask
            .and_then(|m| u64::from_str_radix(m.trim(), 16).ok())
            .unwrap_or(0);
        if bits & (1 << (SIGHUP - 1)) != 0 {
            SighupAction::Ignored
        } else {
            SighupAction::Stop
        }
    }
}

/// Reads the settings again when SIGHUP asks for it.
pub struct Reload<'a> {
    common: &'a Common,
    camera: Option<&'a CameraArgs>,
    wanted: Arc<AtomicBool>,
    current: Config,
}

impl<'a> Reload<'a> {
    /// Listens to SIGHUP if `action` says so. `common` and `camera` are the arguments of the
    /// command, `current` the settings that the capture runs with.
    ///
    /// # Errors
    /// The signal cannot be caught.
    pub fn new(
        common: &'a Common,
        camera: Option<&'a CameraArgs>,
        current: &Config,
        action: SighupAction,
    ) -> std::io::Result<Self> {
        let wanted = Arc::<AtomicBool>::default();
        if action == SighupAction::Reload {
            signal_hook::flag::register(SIGHUP, wanted.clone())?;
        }
        Ok(Self {
            common,
            camera,
            wanted,
            current: current.clone(),
        })
    }

    /// What holds for the camera now.
    pub fn camera(&self) -> &crate::config::Camera {
        &self.current.camera
    }

    /// Whether SIGHUP came since the settings were last read.
    pub fn is_wanted(&self) -> bool {
        self.wanted.load(Ordering::SeqCst)
    }

    /// Reads the settings, applies what can be changed, and prints for every difference what becomes
    /// of it.
    pub fn run(&mut self, running: &Running) {
        self.wanted.store(false, Ordering::SeqCst);
        for line in self.read_again(running) {
            say(&format!("arborcam: reload: {line}"));
        }
    }

    fn read_again(&mut self, running: &Running) -> Vec<String> {
        if self.common.config.is_none() {
            return vec!["there is no --config file to read again; nothing is changed".to_owned()];
        }
        let wanted = match self.common.config(self.camera) {
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
        for (terminal, mask, expected) in [
            (0, "0000000000001000", SighupAction::Reload),
            (0, "0000000000001001", SighupAction::Reload),
            (34816, "0000000000001000", SighupAction::Stop),
            (34816, "0000000000001001", SighupAction::Ignored),
        ] {
            let stat = format!("42 (a) b (c) S 1 42 42 {terminal} -1 4194560");
            let status = format!("Name:\tarborcam\nSigBlk:\t0000000000000001\nSigIgn:\t{mask}\n");
            assert_eq!(
                SighupAction::of(&stat, &status),
                expected,
                "{terminal} {mask}"
            );
        }
        // Without /proc nothing is known, and losing a capture would be worse than not reading
        // settings.
        assert_eq!(SighupAction::of("", ""), SighupAction::Stop);
    }
}

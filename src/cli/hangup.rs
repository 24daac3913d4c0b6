//! The meaning of SIGHUP: a program in a terminal ends, because the terminal is closed; one without
//! a terminal reads its settings again.

use super::camera::CameraArgs;
use super::common::Common;
use super::output::eprint_line;
use crate::config::{Change, Config};
use crate::runtime::Running;
use signal_hook::consts::SIGHUP;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What SIGHUP does. Decided at the start, because the terminal may be gone when the signal comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SighupAction {
    /// No terminal: the signal is sent on purpose, e.g. to a service. Read the settings again.
    Reload,
    /// The terminal is closed: end in order.
    Stop,
    /// The program was started to outlive its terminal, e.g. by `nohup`.
    Ignored,
}

impl SighupAction {
    /// The action for this process.
    pub fn of_this_process() -> Self {
        let stat = std::fs::read_to_string("/proc/self/stat");
        let status = std::fs::read_to_string("/proc/self/status");
        Self::of(&stat.unwrap_or_default(), &status.unwrap_or_default())
    }

    /// Whether SIGHUP ends this process, if it has no settings that could be read again.
    pub fn ends_this_process() -> bool {
        Self::of_this_process() != Self::Ignored
    }

    /// From the contents of `/proc/self/stat` and `/proc/self/status`.
    fn of(stat: &str, status: &str) -> Self {
        // The process name in brackets may contain blanks and brackets itself; the terminal is the
        // fifth field after it.
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

/// Reads the settings again after SIGHUP.
pub struct Reload<'a> {
    common: &'a Common,
    camera: Option<&'a CameraArgs>,
    requested: Arc<AtomicBool>,
    current: Config,
}

impl<'a> Reload<'a> {
    /// Catches SIGHUP if `action` is [`SighupAction::Reload`]. `common` and `camera` are the
    /// arguments of the command, `current` the settings that the capture runs with.
    ///
    /// # Errors
    /// The signal cannot be caught.
    pub fn new(
        common: &'a Common,
        camera: Option<&'a CameraArgs>,
        current: &Config,
        action: SighupAction,
    ) -> std::io::Result<Self> {
        let requested = Arc::<AtomicBool>::default();
        if action == SighupAction::Reload {
            signal_hook::flag::register(SIGHUP, requested.clone())?;
        }
        Ok(Self {
            common,
            camera,
            requested,
            current: current.clone(),
        })
    }

    /// The current camera settings.
    pub fn camera(&self) -> &crate::config::Camera {
        &self.current.camera
    }

    /// Whether SIGHUP came since the settings were last read.
    pub fn is_requested(&self) -> bool {
        self.requested.load(Ordering::SeqCst)
    }

    /// Reads the settings, applies what can be changed while filming, and prints a line for every
    /// difference.
    pub fn run(&mut self, running: &Running) {
        self.requested.store(false, Ordering::SeqCst);
        for line in self.read_again(running) {
            eprint_line(&format!("arborcam: reload: {line}"));
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
        // Without /proc the action is unknown. Losing a capture would be worse than not reloading.
        assert_eq!(SighupAction::of("", ""), SighupAction::Stop);
    }
}

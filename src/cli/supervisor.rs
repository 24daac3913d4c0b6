//! Supervises a running capture, with or without a screen: its settings, its service manager.

use super::command_error::CommandError;
use super::hangup::Reload;
use super::plain::plain;
use super::service::Service;
use crate::model::{Control, Snapshot};
use crate::runtime::Running;
use crate::tui;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Interval at which a capture without a screen is checked.
const HEADLESS_TICK: Duration = Duration::from_millis(20);

/// Supervises a capture until it has ended.
pub struct CaptureSupervisor<'a> {
    pub running: &'a Running,
    pub reload: Reload<'a>,
    pub service: Option<Service>,
}

impl CaptureSupervisor<'_> {
    /// Supervises without a screen; prints messages and progress to standard error.
    pub fn watch(&mut self, stop: &AtomicBool) {
        let progress = tui::Progress::new();
        while !self.running.finished() {
            if stop.load(Ordering::SeqCst) {
                self.running.stop();
            }
            for line in self.running.news() {
                progress.tell(&plain(&format!("arborcam: {line}")));
            }
            if let Some(snapshot) = self.check() {
                progress.update(&snapshot);
            }
            std::thread::sleep(HEADLESS_TICK);
        }
        progress.finish();
    }

    /// Supervises with a screen, and after the user has left it until everything is written.
    ///
    /// # Errors
    /// The terminal cannot be used.
    pub fn show(&mut self, stop: &AtomicBool) -> Result<(), CommandError> {
        let shown = tui::run(self, tui::Options::from_env(), stop);
        if shown.is_err() {
            self.running.stop();
        }
        while !self.running.finished() {
            self.check();
            std::thread::sleep(HEADLESS_TICK);
        }
        shown.map_err(CommandError::bad_usage)
    }

    /// Checks the settings and the service manager; returns the newest state if it is
    /// new.
    fn check(&mut self) -> Option<Arc<Snapshot>> {
        let snapshot = self.running.latest();
        if self.reload.is_requested() {
            self.reload_settings();
        }
        if let Some(service) = &mut self.service {
            service.tick(self.running, snapshot.as_deref());
        }
        snapshot
    }

    fn reload_settings(&mut self) {
        let Some(service) = &self.service else {
            self.reload.run(self.running);
            return;
        };
        service.reloading(|| self.reload.run(self.running));
        service.warn_of_limit(self.reload.camera().timeout_s);
    }
}

impl tui::Session for CaptureSupervisor<'_> {
    fn latest(&mut self) -> Option<Arc<Snapshot>> {
        self.check()
    }

    fn send(&mut self, control: Control) {
        self.running.send(control);
    }

    fn warn(&mut self, warning: &str) {
        self.running.warn(warning);
    }

    fn finished(&self) -> bool {
        self.running.finished()
    }
}

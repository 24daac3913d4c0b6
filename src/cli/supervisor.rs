//! Looks after a running capture, with and without a screen: its length, its settings, the service
//! manager.

use super::ended::Ended;
use super::hangup::Reload;
use super::service::Service;
use crate::model::{Control, Snapshot};
use crate::runtime::Running;
use crate::tui;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Time between two looks at a capture without a screen.
const HEADLESS_TICK: Duration = Duration::from_millis(20);

/// Looks after a capture from outside until it has ended.
pub struct CaptureSupervisor<'a> {
    pub running: &'a Running,
    pub reload: Reload<'a>,
    pub service: Option<Service>,
    /// Sensor time of the capture at which it ends, s.
    pub end_s: f64,
}

impl CaptureSupervisor<'_> {
    /// Without a screen: messages and progress on standard error.
    pub fn watch(&mut self, stop: &AtomicBool) {
        let progress = tui::Progress::new();
        while !self.running.finished() {
            if stop.load(Ordering::SeqCst) {
                self.running.stop();
            }
            for line in self.running.news() {
                progress.tell(&format!("arborcam: {line}"));
            }
            if let Some(snapshot) = self.look() {
                progress.update(&snapshot);
            }
            std::thread::sleep(HEADLESS_TICK);
        }
        progress.finish();
    }

    /// With a screen, and after it is left until all is written.
    ///
    /// # Errors
    /// The terminal cannot be used.
    pub fn show(&mut self, stop: &AtomicBool) -> Result<(), Ended> {
        let shown = tui::run(self, tui::Options::from_env(), stop);
        if shown.is_err() {
            self.running.stop();
        }
        while !self.running.finished() {
            self.look();
            std::thread::sleep(HEADLESS_TICK);
        }
        shown.map_err(|e| Ended::BadUsage(e.into()))
    }

    /// Newest state, if there is a new one.
    fn look(&mut self) -> Option<Arc<Snapshot>> {
        let snapshot = self.running.latest();
        if snapshot.as_ref().is_some_and(|s| s.time_s >= self.end_s) {
            self.running.end();
        }
        if self.reload.is_wanted() {
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
        self.look()
    }

    fn send(&mut self, control: Control) {
        self.running.send(control);
    }

    fn finished(&self) -> bool {
        self.running.finished()
    }
}

//! What the screen remembers between two redraws.

use super::drawing::Drawing;
use crate::model::Snapshot;
use std::sync::Arc;

/// Redraws for which the screen's own notice stays, about six seconds.
const NOTICE_TICKS: u32 = 120;

/// The newest snapshot and what the user is doing.
#[derive(Debug, Default)]
pub struct State {
    pub snapshot: Arc<Snapshot>,
    /// The outline being drawn, if one is.
    pub drawing: Option<Drawing>,
    pub help: bool,
    /// The user has asked for the end and the capture is being written.
    pub quitting: bool,
    /// Paused as far as the user is concerned: the last wish, until the capture says otherwise.
    pub paused: bool,
    notice: Option<(String, u32)>,
}

impl State {
    /// Takes over a newer snapshot.
    pub fn take(&mut self, snapshot: Arc<Snapshot>) {
        // A snapshot from before the wish was honoured must not undo the wish.
        if snapshot.paused != self.snapshot.paused {
            self.paused = snapshot.paused;
        }
        if snapshot.messages != self.snapshot.messages && !snapshot.messages.is_empty() {
            self.notice = None;
        }
        self.snapshot = snapshot;
    }

    /// Tells the user something that the capture does not know of.
    pub fn say(&mut self, text: impl Into<String>) {
        self.notice = Some((text.into(), NOTICE_TICKS));
    }

    /// One redraw has passed.
    pub fn tick(&mut self) {
        if let Some((_, left)) = &mut self.notice {
            *left = left.saturating_sub(1);
            if *left == 0 {
                self.notice = None;
            }
        }
    }

    /// Everything to be told, the newest last.
    pub fn messages(&self) -> impl DoubleEndedIterator<Item = &str> {
        self.snapshot.messages.iter().map(String::as_str).chain(self.notice.iter().map(|(text, _)| text.as_str()))
    }
}

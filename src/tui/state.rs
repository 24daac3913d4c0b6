//! What the screen remembers between two redraws.

use super::drawing::Drawing;
use super::solid::Solid;
use crate::model::Snapshot;
use std::sync::Arc;

/// Redraws for which the screen's own notice stays, about six seconds.
const NOTICE_TICKS: u32 = 120;

/// One press of a key turns the tree by so much.
pub const TURN_DEGREES: u16 = 15;
const TURNS: u16 = 360 / TURN_DEGREES;

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
    /// How far the tree is turned, in steps of [`TURN_DEGREES`], 0 to a whole turn.
    pub turned: u16,
    /// The tree's wood, while it is shown instead of its lines.
    pub solid: Option<Solid>,
    /// The first row of the table of branches that is shown.
    pub first_branch: usize,
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
        self.first_branch = self.first_branch.min(self.snapshot.branches.len().saturating_sub(1));
        if let Some(solid) = self.solid.take() {
            self.solid = Some(self.snapshot.skeleton.as_ref().map_or_else(Solid::default, |s| solid.followed_by(s)));
        }
    }

    /// Walks round the tree by some steps.
    pub fn turn(&mut self, steps: i16) {
        self.turned = (self.turned as i16 + steps).rem_euclid(TURNS as i16) as u16;
    }

    /// Shows the tree's wood, or its lines again.
    pub fn switch_mesh(&mut self) {
        self.solid = match self.solid.take() {
            Some(_) => None,
            None => {
                Some(self.snapshot.skeleton.as_ref().map_or_else(Solid::default, |s| Solid::default().followed_by(s)))
            }
        };
    }

    /// Moves the table of branches by some rows.
    pub fn scroll(&mut self, rows: i16) {
        let last = self.snapshot.branches.len().saturating_sub(1);
        self.first_branch = self.first_branch.saturating_add_signed(rows.into()).min(last);
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

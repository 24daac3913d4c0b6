//! What the screen remembers between two redraws.

use super::drawing::{Drawing, Subject};
use super::solid::Solid;
use crate::model::{BranchGraph, NodeName, Snapshot};
use std::sync::Arc;

/// Redraws for which the screen's own notice stays, about six seconds.
const NOTICE_TICKS: u32 = 120;

/// The warning where the film ended while a line was drawn.
const LINE_LOST: &str = "the film ended before the line along a branch was finished with Enter: it \
                         is not used";

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
    /// Paused as far as the user is concerned: the last command, until the capture says otherwise.
    pub paused: bool,
    /// How far the tree is turned, in steps of [`TURN_DEGREES`], 0 to a whole turn.
    pub turned: u16,
    /// The tree's wood, while it is shown instead of its lines.
    pub solid: Option<Solid>,
    /// The wood that was found is shown in the picture, also while no line is drawn.
    pub wood: bool,
    /// The branch that the user has chosen, and its row when he did.
    chosen: Option<(NodeName, usize)>,
    /// The chosen branch is looked at, where there is no room for it beside all else.
    pub close_up: bool,
    notice: Option<(String, u32)>,
}

impl State {
    /// Takes over a newer snapshot.
    pub fn take(&mut self, snapshot: Arc<Snapshot>) {
        // A snapshot from before the command was obeyed must not undo it.
        if snapshot.paused != self.snapshot.paused {
            self.paused = snapshot.paused;
        }
        if snapshot.messages != self.snapshot.messages && !snapshot.messages.is_empty() {
            self.notice = None;
        }
        self.snapshot = snapshot;
        if let Some(solid) = self.solid.take() {
            self.solid = Some(
                self.snapshot
                    .skeleton
                    .as_ref()
                    .map_or_else(Solid::default, |s| solid.followed_by(s)),
            );
        }
    }

    /// Where the film has ended, the wood is not looked for along what is being drawn: leaves it,
    /// and gives what is to be said of a line with points.
    pub fn leave_drawing_at_end(&mut self) -> Option<&'static str> {
        if !self.snapshot.ended || self.drawing.as_ref()?.subject() != Subject::Branch {
            return None;
        }
        let line = self.drawing.take()?;
        (!line.points_px().is_empty()).then_some(LINE_LOST)
    }

    /// Walks round the tree by some steps.
    pub fn turn(&mut self, steps: i16) {
        self.turned = (self.turned as i16 + steps).rem_euclid(TURNS as i16) as u16;
    }

    /// Shows the tree's wood, or its lines again.
    pub fn switch_mesh(&mut self) {
        self.solid = match self.solid.take() {
            Some(_) => None,
            None => Some(
                self.snapshot
                    .skeleton
                    .as_ref()
                    .map_or_else(Solid::default, |s| Solid::default().followed_by(s)),
            ),
        };
    }

    /// The lines of the wood that was found, as far as they are shown in the picture; while an
    /// outline is drawn they would hide its tree.
    pub fn shown_wood(&self) -> Option<&BranchGraph> {
        let is_shown = match self.drawing.as_ref().map(Drawing::subject) {
            Some(Subject::Branch) => true,
            Some(Subject::Outline | Subject::Markers | Subject::MarkerOrder) => false,
            None => self.wood,
        };
        let wood = self.snapshot.wood.as_ref().filter(|_| is_shown)?;
        Some(&wood.branches)
    }

    /// Row of the chosen branch; one that is gone with a refinement leaves its row to another.
    pub fn chosen(&self) -> usize {
        let rows = &self.snapshot.branches;
        let Some((name, row)) = self.chosen else {
            return 0;
        };
        rows.iter()
            .position(|b| b.node == name)
            .unwrap_or(row.min(rows.len().saturating_sub(1)))
    }

    /// Chooses the branch some rows farther down, and looks at it.
    pub fn choose(&mut self, rows: i16) {
        let last = self.snapshot.branches.len().saturating_sub(1);
        let row = self.chosen().saturating_add_signed(rows.into()).min(last);
        self.chosen = self.snapshot.branches.get(row).map(|b| (b.node, row));
        self.close_up = self.chosen.is_some();
    }

    /// Tells the user something that the capture does not know of.
    pub fn say(&mut self, text: impl Into<String>) {
        self.notice = Some((text.into(), NOTICE_TICKS));
    }

    /// What was told is no longer so.
    pub fn unsay(&mut self) {
        self.notice = None;
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

    /// All messages, the newest last.
    pub fn messages(&self) -> impl DoubleEndedIterator<Item = &str> {
        self.snapshot
            .messages
            .iter()
            .map(String::as_str)
            .chain(self.notice.iter().map(|(text, _)| text.as_str()))
    }
}

//! How a photograph looks with what is drawn on it and found along it.

use super::sheet::{KEYS, Sheet};
use crate::model::{BranchGraph, Masks, Rgb, Snapshot, Wood, WoodNode};
use crate::tui::format::keep_begin;
use crate::tui::panels::preview::{self, Preview};
use crate::tui::panels::{help, messages};
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::Line;
use std::sync::Arc;

/// What leaves and wood are tinted with where they are found, and how far the tint covers the picture.
const LEAVES_TINT: [u8; 3] = [0x20, 0xe0, 0x40];
const WOOD_TINT: [u8; 3] = [0xff, 0x90, 0x30];
const TINT: f64 = 0.45;

impl Sheet {
    /// Puts what is drawn and found into what the picture is made of.
    pub(super) fn show(&mut self) {
        let mut snapshot = Snapshot {
            image_size: Some(self.picture.size),
            ..Snapshot::default()
        };
        let mut shown = None;
        let mut branches = BranchGraph::default();
        for tree in &self.trees {
            for line in &tree.strokes.branches_px {
                let points = line.iter().map(|at| [at.x, at.y]);
                snapshot.strokes_px.push(points.collect());
            }
            let Some(Ok(found)) = tree.found.as_deref() else {
                continue;
            };
            append(&mut branches, &found.wood.branches);
            if let (true, Some(at_rest)) = (self.state.wood, &found.wood.at_rest) {
                let own = shown.get_or_insert_with(|| Rgb::clone(&self.picture));
                tint(own, &at_rest.masks);
            }
        }
        if let Some(tree) = self.trees.last() {
            let corners = tree.strokes.crown_px.iter();
            snapshot.outline_px = corners.map(|at| at.map(|x| x.round() as i32)).collect();
        }
        snapshot.preview = Some(shown.map_or_else(|| self.picture.clone(), Arc::new));
        snapshot.wood = Some(Arc::new(Wood {
            branches,
            ..Wood::default()
        }));
        self.state.take(Arc::new(snapshot));
    }

    pub fn render(&self, frame: &mut Frame, theme: Theme, picture: &mut Preview) {
        let window = frame.area();
        let standing = self.standing();
        let newest = self.state.messages().last().unwrap_or(&standing);
        let key_rows = messages::key_rows(named_keys(), window.width).len() as u16;
        let [line, sheet, message, keys] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Fill(1),
            Constraint::Length(message_rows(newest, window)),
            Constraint::Length(key_rows.min(window.height / 5).max(1)),
        ])
        .areas(window);
        let number = self.trees.len();
        let strokes = self.trees.last().map(|tree| &tree.strokes);
        let crown = strokes.is_some_and(|s| !s.crown_px.is_empty());
        let branches = strokes.map_or(0, |s| s.branches_px.len());
        let crown = if crown { "a crown" } else { "no crown" };
        let plural = if branches == 1 { "" } else { "es" };
        // The name comes last, as it may be cut.
        let title = format!(
            " arborcam  tree {number}: {crown}, {branches} branch{plural} drawn  {}",
            self.name
        );
        let title = keep_begin(&title, window.width as usize);
        frame.render_widget(Line::styled(title, theme.strong()), line);
        preview::render(frame, &self.state, sheet, theme, picture);
        match (self.looking, self.state.messages().next()) {
            (_, Some(_)) => messages::render(frame, &self.state, message, theme),
            (Some(_), None) => messages::standing(frame, &standing, message, theme.strong()),
            (None, None) => messages::standing(frame, &standing, message, theme.faint()),
        }
        match self.state.drawing {
            Some(_) => messages::keys(frame, &self.state, keys, theme),
            None => messages::key_line(frame, named_keys(), keys, theme),
        }
        if self.state.help {
            help::of_photograph(frame, &KEYS, &self.state, theme);
        }
    }
}

/// The keys that have a word beside them on the screen.
fn named_keys() -> impl Iterator<Item = (&'static str, &'static str)> {
    let named = KEYS.iter().filter(|b| !b.short.is_empty());
    named.map(|b| (b.shown, b.short))
}

impl Sheet {
    /// What is so while there is no message.
    fn standing(&self) -> String {
        match self.looking {
            Some(looking) => {
                let since_s = looking.began.elapsed().as_secs_f64();
                format!("Looking… {since_s:.1} s (keys work meanwhile)")
            }
            None => self.told(),
        }
    }
}

/// Rows for what is said: as many as most of it takes, so that the picture seldom changes its size, and for what
/// is longer as many as it takes, up to a share of the window.
fn message_rows(text: &str, window: Rect) -> u16 {
    let usual = match window.width {
        0..80 => 3,
        80..160 => 2,
        160.. => 1,
    };
    let rows = messages::rows(text, window.width).max(usual);
    rows.min(window.height / 4).max(1)
}

/// Adds the branches of another tree.
fn append(all: &mut BranchGraph, tree: &BranchGraph) {
    let first = all.nodes.len();
    let nodes = tree.nodes.iter().map(|node| WoodNode {
        parent: node.parent.map(|parent| first + parent),
        ..node.clone()
    });
    all.nodes.extend(nodes);
}

/// Tints leaves and wood in a picture of the size of their masks.
fn tint(picture: &mut Rgb, masks: &Masks) {
    if masks.leaves.size != picture.size || masks.wood.size != picture.size {
        return;
    }
    let found = masks.leaves.pixels.iter().zip(&masks.wood.pixels);
    for (pixel, (leaf, wood)) in picture.pixels.chunks_exact_mut(3).zip(found) {
        let colour = match (*leaf > Masks::MOST_OUTSIDE, *wood > Masks::MOST_OUTSIDE) {
            (true, _) => LEAVES_TINT,
            (_, true) => WOOD_TINT,
            _ => continue,
        };
        for (own, tint) in pixel.iter_mut().zip(colour) {
            *own = (TINT * f64::from(tint) + (1.0 - TINT) * f64::from(*own)) as u8;
        }
    }
}

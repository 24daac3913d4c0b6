//! The last lines: what the program has to say, and the keys.

use crate::tui::format::wrap;
use crate::tui::input::{Action, DRAWING, WATCHING};
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

/// The newest messages, whole as far as there is room; the newest brightest.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let room = area.width.saturating_sub(4) as usize;
    // Collected from the newest back, last line first, as that is what must be kept.
    let mut lines: Vec<Line> = Vec::new();
    for (age, message) in state.messages().rev().enumerate() {
        let left = (area.height as usize).saturating_sub(lines.len());
        let mut wrapped = wrap(message, room);
        if wrapped.len() > left {
            // The newest is cut; an older one that does not fit is left out.
            if age > 0 || left == 0 {
                break;
            }
            wrapped.truncate(left);
            wrapped
                .iter_mut()
                .skip(left - 1)
                .for_each(|line| line.push('…'));
        }
        let (mark, style) = if age == 0 {
            (" ▸ ", theme.strong())
        } else {
            (" · ", theme.faint())
        };
        for (i, text) in wrapped.into_iter().enumerate().rev() {
            lines.push(Line::styled(
                format!("{}{text}", if i == 0 { mark } else { "   " }),
                style,
            ));
        }
    }
    lines.reverse();
    // At the bottom, so that the newest is always in the same place.
    let height = (lines.len() as u16).min(area.height);
    frame.render_widget(
        Paragraph::new(lines),
        Rect {
            y: area.bottom() - height,
            height,
            ..area
        },
    );
}

/// Keys that mean something now.
pub fn keys(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    match &state.drawing {
        Some(_) => {
            let drawing = DRAWING
                .iter()
                .filter(|b| !b.short.is_empty())
                .map(|b| (b.shown, b.short));
            key_line(
                frame,
                std::iter::once(("click", "set")).chain(drawing),
                area,
                theme,
            );
        }
        None => {
            let keys = WATCHING
                .iter()
                .filter(|b| is_useful(b.action, state))
                .map(|b| (b.shown, b.short));
            key_line(frame, keys, area, theme);
        }
    }
}

/// Whether a key does anything now.
fn is_useful(action: Action, state: &State) -> bool {
    match action {
        Action::Build => state.snapshot.skeleton.is_none(),
        Action::Turn(_) | Action::Mesh | Action::Wood => state.snapshot.skeleton.is_some(),
        Action::Choose(_) => !state.snapshot.branches.is_empty(),
        _ => true,
    }
}

/// Keys and what they do, as many as there is room for.
pub fn key_line(
    frame: &mut Frame,
    keys: impl Iterator<Item = (&'static str, &'static str)>,
    area: Rect,
    theme: Theme,
) {
    let mut spans = Vec::new();
    let mut room = area.width as usize;
    for (key, word) in keys.filter(|(key, _)| !key.is_empty()) {
        // A word cut in two says nothing; the help has them all.
        let width = key.chars().count() + word.chars().count() + 3;
        if width > room + 1 {
            break;
        }
        room = room.saturating_sub(width);
        spans.push(Span::styled(format!(" {key}"), theme.title()));
        spans.push(Span::raw(format!(" {word} ")));
    }
    frame.render_widget(Line::from(spans), area);
}

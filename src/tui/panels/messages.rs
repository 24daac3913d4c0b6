//! The last lines: what the program has to say, and the keys.

use crate::tui::format::wrap;
use crate::tui::input::{DRAWING, WATCHING};
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
            wrapped.iter_mut().skip(left - 1).for_each(|line| line.push('…'));
        }
        let (mark, style) = if age == 0 { (" ▸ ", theme.strong()) } else { (" · ", theme.faint()) };
        for (i, text) in wrapped.into_iter().enumerate().rev() {
            lines.push(Line::styled(format!("{}{text}", if i == 0 { mark } else { "   " }), style));
        }
    }
    lines.reverse();
    // At the bottom, so that the newest is always in the same place.
    let height = (lines.len() as u16).min(area.height);
    frame.render_widget(Paragraph::new(lines), Rect { y: area.bottom() - height, height, ..area });
}

/// Keys that mean something now.
pub fn keys(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let mut spans = Vec::new();
    let mut room = area.width as usize;
    let mut add = |key: &'static str, word: &'static str| {
        // A word cut in two says nothing; the help has them all.
        let width = key.len() + word.len() + 3;
        if key.is_empty() || width > room + 1 {
            room = if key.is_empty() { room } else { 0 };
            return;
        }
        room = room.saturating_sub(width);
        spans.push(Span::styled(format!(" {key}"), theme.title()));
        spans.push(Span::raw(format!(" {word} ")));
    };
    match &state.drawing {
        Some(_) => {
            add("click", "set");
            DRAWING.iter().filter(|b| !b.short.is_empty()).for_each(|b| add(b.shown, b.short));
        }
        None => WATCHING.iter().for_each(|b| add(b.shown, b.short)),
    }
    frame.render_widget(Line::from(spans), area);
}

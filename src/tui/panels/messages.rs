//! The last lines: what the program has to say, and the keys.

use crate::tui::format::wrap;
use crate::tui::input::{Action, DRAWING, WATCHING};
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

/// The newest messages, whole as far as there is room; the newest brightest.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let room = room(area.width);
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
            cut(&mut wrapped, left);
        }
        let (mark, style) = if age == 0 {
            (" ▸ ", theme.strong())
        } else {
            (" · ", theme.faint())
        };
        lines.extend(marked(wrapped, mark, style).into_iter().rev());
    }
    lines.reverse();
    at_bottom(frame, lines, area);
}

/// What is so now and is no message, whole as far as there is room.
pub fn standing(frame: &mut Frame, text: &str, area: Rect, style: Style) {
    let mut wrapped = wrap(text, room(area.width));
    cut(&mut wrapped, area.height as usize);
    at_bottom(frame, marked(wrapped, " · ", style), area);
}

/// Rows that a text takes in a window so wide.
pub fn rows(text: &str, width: u16) -> u16 {
    wrap(text, room(width)).len() as u16
}

/// Columns for text beside its mark.
fn room(width: u16) -> usize {
    width.saturating_sub(4) as usize
}

/// Leaves `most` lines; the last says that there were more.
fn cut(lines: &mut Vec<String>, most: usize) {
    if lines.len() > most {
        lines.truncate(most);
        if let Some(last) = lines.last_mut() {
            last.push('…');
        }
    }
}

/// The lines of one text, the first with its mark.
fn marked(texts: Vec<String>, mark: &str, style: Style) -> Vec<Line<'static>> {
    let marks = std::iter::once(mark).chain(std::iter::repeat("   "));
    let lines = marks.zip(texts);
    lines
        .map(|(mark, text)| Line::styled(format!("{mark}{text}"), style))
        .collect()
}

fn at_bottom(frame: &mut Frame, lines: Vec<Line>, area: Rect) {
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
    let rows = key_rows(keys, area.width).into_iter();
    let lines = rows.map(|row| key_spans(row, theme));
    frame.render_widget(Paragraph::new(lines.collect::<Vec<Line>>()), area);
}

/// Keys and what they do, row by row of a window so wide.
pub fn key_rows(
    keys: impl Iterator<Item = (&'static str, &'static str)>,
    width: u16,
) -> Vec<Vec<(&'static str, &'static str)>> {
    let mut rows: Vec<Vec<(&str, &str)>> = Vec::new();
    let mut room = 0;
    for (key, word) in keys.filter(|(key, _)| !key.is_empty()) {
        // A word cut in two says nothing; the help has them all.
        let needed = key.chars().count() + word.chars().count() + 3;
        if needed > room + 1 {
            room = width as usize;
            rows.push(Vec::new());
        }
        if needed > room + 1 {
            rows.pop();
            break;
        }
        room = room.saturating_sub(needed);
        if let Some(row) = rows.last_mut() {
            row.push((key, word));
        }
    }
    rows
}

fn key_spans(row: Vec<(&'static str, &'static str)>, theme: Theme) -> Line<'static> {
    let mut spans = Vec::with_capacity(2 * row.len());
    for (key, word) in row {
        spans.push(Span::styled(format!(" {key}"), theme.title()));
        spans.push(Span::raw(format!(" {word} ")));
    }
    Line::from(spans)
}

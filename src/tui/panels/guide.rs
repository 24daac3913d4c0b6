//! Third line: what is awaited, and what the user can do now.

use crate::tui::awaited::awaited;
use crate::tui::format::keep_begin;
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

/// One line, cut where there is no room for all of it.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let awaited = awaited(state);
    let style = if awaited.is_trouble {
        theme.warning()
    } else {
        theme.strong()
    };
    let room = usize::from(area.width).saturating_sub(2);
    let text = keep_begin(&awaited.text, room);
    let line = Line::from(vec![Span::raw("  "), Span::styled(text, style)]);
    frame.render_widget(line, area);
}

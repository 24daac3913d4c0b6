//! One file for each panel; each draws a part of the state into its area and changes nothing.

pub mod branch;
pub mod branches;
pub mod camera;
pub mod guide;
pub mod header;
pub mod help;
pub mod messages;
pub mod phase;
pub mod preview;
pub mod skeleton;
pub mod tracks;
pub mod verdict;

use super::theme::Theme;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::Line;
use ratatui::widgets::{Block, Borders, Paragraph};

/// Draws a rule with a title and returns what is left below it.
fn titled(frame: &mut Frame, area: Rect, title: &str, theme: Theme) -> Rect {
    let block = Block::new()
        .borders(Borders::TOP)
        .border_style(theme.faint())
        .title(format!(" {title} "))
        .title_style(theme.title());
    let inner = block.inner(area);
    frame.render_widget(block, area);
    inner
}

/// Says in the middle of an empty panel what it waits for.
fn waiting(frame: &mut Frame, area: Rect, text: &str, theme: Theme) {
    let lines = super::format::wrap(text, area.width.saturating_sub(2) as usize);
    let top = area.height.saturating_sub(lines.len() as u16) / 2;
    let area = Rect {
        y: area.y + top,
        height: area.height - top,
        ..area
    };
    let lines: Vec<Line> = lines.into_iter().map(Line::from).collect();
    frame.render_widget(Paragraph::new(lines).centered().style(theme.faint()), area);
}

//! The table of branches.

use super::{titled, waiting};
use crate::model::{BranchRow, Phase};
use crate::tui::format::{count, value};
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::{Constraint, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Row, Table};

/// A wider table would be harder to read along a line.
const WIDEST: u16 = 48;
/// Names and widths of the columns after the first.
const COLUMNS: [(&str, u16); 4] = [("lvl", 3), ("pts", 5), ("ampl/px", 7), ("f/Hz", 5)];

/// One line for each branch as far as there is room; the title says how many there are.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let s = &state.snapshot;
    let shown = area.height.saturating_sub(1) as usize;
    let total = s.branches.len();
    if total == 0 {
        let inner = titled(frame, area, "Branches", theme);
        let text = match s.phase {
            Phase::Live => "no branch was found",
            _ => "listed once the tree is built",
        };
        waiting(frame, inner, text, theme);
        return;
    }
    let title = if total > shown { format!("Branches, {shown} of {total}") } else { format!("Branches, {total}") };
    titled(frame, area, &title, theme);

    let room = Rect { width: area.width.min(WIDEST), ..area };
    let colour = |row: &BranchRow| s.node_colour.get(row.node as usize).copied().flatten();
    let right = |text: String| Line::from(text).right_aligned();
    let rows = s.branches.iter().take(shown).map(|b| {
        Row::new([
            Line::from(vec![Span::styled(" ● ", theme.branch(colour(b))), Span::raw(b.node.to_string())]),
            right(b.level.to_string()),
            right(count(b.n_tracks.into())),
            right(value(b.amplitude_px)),
            right(b.frequency_hz.map_or("–".to_owned(), value)),
        ])
    });
    let below = Rect { y: room.y + 1, height: room.height.saturating_sub(1), ..room };
    let widths = [Constraint::Min(6)].into_iter().chain(COLUMNS.map(|(_, width)| Constraint::Length(width)));
    frame.render_widget(Table::new(rows, widths).column_spacing(1), below);

    // The columns' names lie on the rule, beside the title: a line saved is a branch shown.
    let names: String =
        COLUMNS.iter().map(|(name, width)| format!(" {name:>0$}", *width as usize)).chain([" ".to_owned()]).collect();
    let names_width = (names.chars().count() as u16).min(room.width);
    let beside = Rect { x: room.right().saturating_add(1).min(area.right()) - names_width, width: names_width, height: 1, ..room };
    if beside.x >= room.x + title.chars().count() as u16 + 2 {
        frame.render_widget(Line::styled(names, theme.faint()), beside);
    }
}

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

/// A wider table would be harder to read along a line; there are as many side by side as there is room for.
const WIDEST: u16 = 48;
/// Names and widths of the columns after the first.
const COLUMNS: [(&str, u16); 4] = [("lvl", 3), ("pts", 5), ("ampl/px", 7), ("f/Hz", 5)];

/// One line for each branch as far as there is room; the title says how many there are.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let s = &state.snapshot;
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
    let height = area.height.saturating_sub(1) as usize;
    let room = (area.width / (WIDEST + 2)).max(1) as usize;
    let tables = room.min(total.div_ceil(height.max(1)));
    let shown = total.min(tables * height);
    let first = if total > shown { state.first_branch.min(total - 1) } else { 0 };
    let title = match first {
        0 if total > shown => format!("Branches, {shown} of {total}"),
        0 => format!("Branches, {total}"),
        _ => format!("Branches, {}–{} of {total}", first + 1, (first + shown).min(total)),
    };
    let below = titled(frame, area, &title, theme);
    for (i, rows) in s.branches[first..].chunks(height.max(1)).take(tables).enumerate() {
        let x = below.x + i as u16 * (WIDEST + 2);
        let place = Rect { x, width: (below.right() - x).min(WIDEST), ..below };
        let taken = if i == 0 { title.chars().count() as u16 + 3 } else { 0 };
        names(frame, Rect { y: area.y, height: 1, ..place }, taken, theme);
        table(frame, rows, place, theme);
    }
}

fn table(frame: &mut Frame, rows: &[BranchRow], area: Rect, theme: Theme) {
    let right = |text: String| Line::from(text).right_aligned();
    let rows = rows.iter().map(|b| {
        let colour = theme.branch(b.colour);
        Row::new([
            Line::from(vec![Span::styled(" ● ", colour), Span::raw(b.node.0.to_string())]),
            right(b.level.to_string()),
            right(count(b.n_tracks.into())),
            right(value(b.amplitude_px)),
            right(b.frequency_hz.map_or("–".to_owned(), value)),
        ])
    });
    let widths = [Constraint::Min(6)].into_iter().chain(COLUMNS.map(|(_, width)| Constraint::Length(width)));
    frame.render_widget(Table::new(rows, widths).column_spacing(1), area);
}

/// The columns' names lie on the rule, beside the title: a line saved is a branch shown.
fn names(frame: &mut Frame, area: Rect, taken: u16, theme: Theme) {
    let names = COLUMNS.iter().map(|(name, width)| format!(" {name:>0$}", *width as usize)).collect::<String>() + " ";
    let width = names.chars().count() as u16;
    if taken + width <= area.width.saturating_add(1) {
        let area = Rect { x: area.right() + 1 - width, width, ..area };
        frame.render_widget(Line::styled(names, theme.faint()), area);
    }
}

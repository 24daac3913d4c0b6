//! The line above the messages: what the capture would be worth if it ended now.

use crate::model::Grade;
use crate::tui::format::keep_begin;
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

const LABEL: &str = " Verdict ";

/// Grade, reasons and advice, as much as fits, the worst first.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let label = Span::styled(LABEL, theme.title());
    let room = usize::from(area.width).saturating_sub(LABEL.len() + 1);
    let verdict = match &state.snapshot.verdict {
        Some(verdict) => {
            let style = match verdict.grade {
                Grade::Poor => theme.warning(),
                Grade::Good | Grade::Fair => theme.strong(),
            };
            // Letters may be wider than a column.
            let line = keep_begin(&verdict.line_within(room), room);
            let grade = verdict.grade.word().len().min(line.len());
            let (grade, rest) = line.split_at(grade);
            vec![
                Span::styled(grade.to_owned(), style),
                Span::raw(rest.to_owned()),
            ]
        }
        None => vec![Span::styled("–", theme.faint())],
    };
    let spans: Vec<Span> = std::iter::once(label).chain(verdict).collect();
    frame.render_widget(Line::from(spans), area);
}

//! Second line: the phases, the present one marked, and how far it is.

use crate::model::Phase;
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::LineGauge;

/// The way through the phases and a gauge.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let now = state.snapshot.phase;
    let mut spans = vec![Span::raw(" ")];
    for phase in Phase::ALL {
        if phase != Phase::Outline {
            spans.push(Span::styled("›", theme.faint()));
        }
        let style = if phase == now {
            theme.here()
        } else {
            theme.faint()
        };
        spans.push(Span::styled(format!(" {} ", phase.name()), style));
    }
    let way = Line::from(spans);
    let [left, right] = Layout::horizontal([
        Constraint::Length(way.width() as u16 + 1),
        Constraint::Min(0),
    ])
    .areas(area);
    frame.render_widget(way, left);

    // The gauge refuses what lies outside 0 to 1.
    let progress = state.snapshot.progress;
    let done = if progress.is_nan() {
        0.0
    } else {
        progress.clamp(0.0, 1.0)
    };
    let gauge = LineGauge::default()
        .ratio(done)
        .label(format!("{:3.0} %", 100.0 * done))
        .filled_symbol("█")
        .unfilled_symbol("░")
        .filled_style(theme.title())
        .unfilled_style(theme.faint());
    frame.render_widget(
        gauge,
        Rect {
            width: right.width.saturating_sub(1),
            ..right
        },
    );
}

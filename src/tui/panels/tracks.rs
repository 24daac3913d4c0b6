//! The tracked points: how many, how fast they are lost, how well they are followed.

use super::titled;
use crate::tui::format::{count, value};
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Sparkline;

/// Numbers above, the history of the error beside or below them.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let s = &state.snapshot;
    let inner = titled(frame, area, "Points", theme);
    let [Some(first), Some(second)] = [0, 1].map(|i| inner.rows().nth(i)) else {
        return;
    };
    frame.render_widget(
        Line::from(vec![
            Span::styled(format!(" {}", count(s.tracks_alive.into())), theme.strong()),
            Span::raw(format!(" alive  {} lost/s", value(s.lost_per_s))),
        ]),
        first,
    );
    let error = Line::from(vec![
        Span::styled(" error ", theme.faint()),
        Span::styled(
            format!("{} px ", value(s.error_px.unwrap_or(f64::NAN))),
            theme.strong(),
        ),
        Span::styled(format!("fb {} ", value(s.fb_error_px)), theme.faint()),
    ]);
    let used = (error.width() as u16).min(second.width);
    frame.render_widget(error, second);

    let below = Rect {
        y: second.bottom(),
        height: inner.bottom().saturating_sub(second.bottom()),
        ..inner
    };
    let beside = Rect {
        x: second.x + used,
        width: second.width - used,
        ..second
    };
    let area = if below.height > 0 {
        Rect {
            x: below.x + 1,
            width: below.width.saturating_sub(1),
            ..below
        }
    } else {
        beside
    };
    sparkline(frame, &s.fb_history_px, area, theme);
    if below.height > 0 {
        let note =
            Line::styled(scale_note(&s.fb_history_px, area.width), theme.faint()).right_aligned();
        frame.render_widget(note, beside);
    }
}

/// The newest values that there is room for, the newest at the right.
fn newest(history: &[f64], width: u16) -> &[f64] {
    &history[history.len().saturating_sub(width as usize)..]
}

fn scale_note(history: &[f64], width: u16) -> String {
    let top = newest(history, width)
        .iter()
        .copied()
        .filter(|x| x.is_finite())
        .fold(0.0, f64::max);
    if top > 0.0 {
        format!("up to {} ", value(top))
    } else {
        String::new()
    }
}

fn sparkline(frame: &mut Frame, history: &[f64], area: Rect, theme: Theme) {
    // In thousandths of a pixel, as bars are whole numbers.
    let bars: Vec<Option<u64>> = newest(history, area.width)
        .iter()
        .map(|x| x.is_finite().then(|| (x * 1000.0).clamp(0.0, 1e12) as u64))
        .collect();
    let area = Rect {
        x: area.right().saturating_sub(bars.len() as u16).max(area.x),
        ..area
    };
    // Without a floor to its scale the line would make mountains of nothing.
    let top = bars.iter().flatten().copied().max().unwrap_or(0).max(100);
    let area = Rect {
        width: area.width.min(bars.len() as u16),
        ..area
    };
    frame.render_widget(
        Sparkline::default()
            .data(bars)
            .max(top)
            .style(theme.title()),
        area,
    );
}

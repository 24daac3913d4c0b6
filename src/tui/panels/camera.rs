//! What was asked of the camera, what it gives, and what is lost on the way.

use super::titled;
use crate::tui::format::{count, millis, value};
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

/// Six lines, the last of which tells only of losses that seldom happen.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let s = &state.snapshot;
    let inner = titled(frame, area, "Camera", theme);
    let row = |name: &'static str, value: Vec<Span<'static>>| {
        let mut spans = vec![Span::styled(format!(" {name:<6}"), theme.faint())];
        spans.extend(value);
        Line::from(spans)
    };
    let or_dash = |text: &str| Span::raw(if text.is_empty() { "–".to_owned() } else { text.to_owned() });
    let loss = |name: &'static str, n: u64| {
        let style = if n > 0 { theme.warning() } else { theme.faint() };
        [Span::raw(format!("{name} ")), Span::styled(count(n), style)]
    };
    let pair = |a: [Span<'static>; 2], b: [Span<'static>; 2]| {
        let mut spans: Vec<_> = a.into();
        spans.push(Span::raw("  "));
        spans.extend(b);
        spans
    };
    // A file is asked for nothing.
    let other = !s.format.asked.is_empty() && s.format.asked != s.format.given;
    let given_style = if other { theme.warning() } else { theme.strong() };
    let lines = vec![
        row("asked", vec![or_dash(&s.format.asked)]),
        row("given", vec![or_dash(&s.format.given).style(given_style)]),
        row(
            "rate",
            vec![
                Span::styled(format!("{} Hz", value(s.sensor_rate_hz)), theme.strong()),
                Span::raw(format!("  worked {}", value(s.work_rate_hz))),
            ],
        ),
        row(
            "delay",
            vec![
                Span::styled(format!("p50 {}", millis(s.latency_p50_ms)), theme.strong()),
                Span::raw(format!("  p99 {}", millis(s.latency_p99_ms))),
            ],
        ),
        row("lost", pair(loss("camera", s.lost_in_camera), loss("queue", s.dropped_before_tracker))),
        row("", pair(loss("broken", s.undecodable), loss("unshown", s.not_shown))),
    ];
    frame.render_widget(Paragraph::new(lines), inner);
}

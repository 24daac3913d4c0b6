//! What was asked of the camera, what it gives, and what is lost on the way.

use super::titled;
use crate::tui::format::{count, millis, value};
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

/// Seven lines; where there is no room for all, the last ones tell only of losses that seldom
/// happen.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let s = &state.snapshot;
    let inner = titled(frame, area, "Camera", theme);
    let row = |name: &'static str, value: Vec<Span<'static>>| {
        let mut spans = vec![Span::styled(format!(" {name:<6}"), theme.faint())];
        spans.extend(value);
        Line::from(spans)
    };
    let or_dash = |text: &str| {
        Span::raw(if text.is_empty() {
            "–".to_owned()
        } else {
            text.to_owned()
        })
    };
    let loss = |name: &'static str, n: u64| {
        let style = if n > 0 {
            theme.warning()
        } else {
            theme.faint()
        };
        [Span::raw(format!("{name} ")), Span::styled(count(n), style)]
    };
    let joined = |parts: &[[Span<'static>; 2]]| {
        let mut spans: Vec<_> = parts
            .iter()
            .flat_map(|part| [part.as_slice(), &[Span::raw("  ")]].concat())
            .collect();
        spans.pop();
        spans
    };
    let rate = || format!("{} Hz", value(s.sensor_rate_hz));
    let rate = match &s.camera.away {
        Some(reason) => vec![Span::styled(format!("gone: {reason}"), theme.warning())],
        None if s.camera.rate_off => vec![Span::styled(
            format!("{}  not as given", rate()),
            theme.warning(),
        )],
        None => vec![
            Span::styled(rate(), theme.strong()),
            Span::raw(format!("  worked {}", value(s.work_rate_hz))),
        ],
    };
    // Both counts of what was lost before us: by the driver's numbers, where it has them, and by
    // the times.
    let by_number = match s.camera.lost_by_sequence {
        Some(n) => loss("numbers", n),
        None => [Span::raw("numbers "), Span::styled("–", theme.faint())],
    };
    let broken = s
        .undecodable
        .saturating_add(s.camera.damaged)
        .saturating_add(s.camera.stale);
    // A file is asked for nothing.
    let other = !s.format.asked.is_empty() && s.format.asked != s.format.given;
    let given_style = if other {
        theme.warning()
    } else {
        theme.strong()
    };
    let lines = vec![
        row("asked", vec![or_dash(&s.format.asked)]),
        row("given", vec![or_dash(&s.format.given).style(given_style)]),
        row("rate", rate),
        row(
            "delay",
            vec![
                Span::styled(format!("p50 {}", millis(s.latency_p50_ms)), theme.strong()),
                Span::raw(format!("  p99 {}", millis(s.latency_p99_ms))),
            ],
        ),
        row(
            "lost",
            joined(&[
                loss("camera", s.lost_in_camera),
                loss("queue", s.dropped_before_tracker),
            ]),
        ),
        row(
            "",
            joined(&[loss("broken", broken), loss("unshown", s.not_shown)]),
        ),
        row(
            "",
            joined(&[by_number, loss("times", s.camera.lost_by_time)]),
        ),
    ];
    frame.render_widget(Paragraph::new(lines), inner);
}

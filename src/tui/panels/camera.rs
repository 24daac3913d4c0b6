//! What was asked of the camera, what it gives, and what is lost on the way.

use super::titled;
use crate::model::Snapshot;
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
    let numbers = match s.camera.lost_by_sequence {
        Some(n) => loss("numbers", n, theme),
        None => vec![Span::raw("numbers "), Span::styled("–", theme.faint())],
    };
    let broken = s
        .undecodable
        .saturating_add(s.camera.damaged)
        .saturating_add(s.camera.stale);
    let delay = vec![
        Span::styled(format!("p50 {}", millis(s.latency_p50_ms)), theme.strong()),
        Span::raw(format!("  p99 {}", millis(s.latency_p99_ms))),
    ];
    let lost = beside(
        loss("camera", s.lost_in_camera, theme),
        loss("queue", s.dropped_before_tracker, theme),
    );
    let useless = beside(
        loss("broken", broken, theme),
        loss("unshown", s.not_shown, theme),
    );
    // Both counts of what was lost before us: by the driver's numbers, where it has them, and by
    // the times.
    let counted = beside(numbers, loss("times", s.camera.lost_by_time, theme));
    let lines = vec![
        row("asked", vec![or_dash(&s.format.asked)], theme),
        row("given", vec![given(s, theme)], theme),
        row("rate", rate(s, theme), theme),
        row("delay", delay, theme),
        row("lost", lost, theme),
        row("", useless, theme),
        row("", counted, theme),
    ];
    frame.render_widget(Paragraph::new(lines), inner);
}

fn row(name: &'static str, value: Vec<Span<'static>>, theme: Theme) -> Line<'static> {
    let mut spans = vec![Span::styled(format!(" {name:<6}"), theme.faint())];
    spans.extend(value);
    Line::from(spans)
}

fn or_dash(text: &str) -> Span<'static> {
    let text = if text.is_empty() { "–" } else { text };
    Span::raw(text.to_owned())
}

/// The format that the camera gives, in the colour of a warning if another was asked for.
fn given(s: &Snapshot, theme: Theme) -> Span<'static> {
    // A file is asked for nothing.
    let other = !s.format.asked.is_empty() && s.format.asked != s.format.given;
    or_dash(&s.format.given).style(if other {
        theme.warning()
    } else {
        theme.strong()
    })
}

/// The camera's rate and that at which frames are worked off, or why there is none.
fn rate(s: &Snapshot, theme: Theme) -> Vec<Span<'static>> {
    if let Some(reason) = &s.camera.away {
        return vec![Span::styled(format!("gone: {reason}"), theme.warning())];
    }
    let rate = format!("{} Hz", value(s.sensor_rate_hz));
    if s.camera.rate_off {
        return vec![Span::styled(
            format!("{rate}  not as given"),
            theme.warning(),
        )];
    }
    vec![
        Span::styled(rate, theme.strong()),
        Span::raw(format!("  worked {}", value(s.work_rate_hz))),
    ]
}

/// A count that ought to be 0.
fn loss(name: &'static str, n: u64, theme: Theme) -> Vec<Span<'static>> {
    let style = if n > 0 {
        theme.warning()
    } else {
        theme.faint()
    };
    vec![Span::raw(format!("{name} ")), Span::styled(count(n), style)]
}

fn beside(mut left: Vec<Span<'static>>, right: Vec<Span<'static>>) -> Vec<Span<'static>> {
    left.push(Span::raw("  "));
    left.extend(right);
    left
}

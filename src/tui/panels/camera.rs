//! What was asked of the camera, what it gives, and what is lost on the way.

use super::titled;
use crate::model::{Background, DepthCameraState, Snapshot, TagState};
use crate::tui::format::{count, millis, value};
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

/// At most seven lines; where there is no room for all, the last one tells only of losses that
/// seldom happen. While nothing is lost one word says so.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let s = &state.snapshot;
    let inner = titled(frame, area, "Camera", theme);
    let broken = s
        .undecodable
        .saturating_add(s.camera.damaged)
        .saturating_add(s.camera.stale);
    let delay = vec![
        Span::styled(format!("p50 {}", millis(s.latency_p50_ms)), theme.strong()),
        Span::raw(format!("  p99 {}", millis(s.latency_p99_ms))),
    ];
    // With a depth camera there is no line to spare for what was asked for, and with a tag besides none
    // for what is given.
    let mut lines = Vec::new();
    if let Some(depth) = &s.camera.depth {
        lines.push(row("depth", of_depth(depth, theme), theme));
    }
    if let Some(tag) = &s.camera.tag {
        lines.push(row("tag", vec![of_tag(tag, theme)], theme));
    }
    if lines.is_empty() {
        lines.push(row("asked", vec![or_dash(&s.format.asked)], theme));
    }
    if lines.len() < 2 {
        lines.push(row("given", vec![given(s, theme)], theme));
    }
    lines.extend([
        row("rate", rate(s, theme), theme),
        row("delay", delay, theme),
        row("shake", shake(s, theme), theme),
    ]);
    let counts = [
        s.lost_in_camera,
        s.dropped_before_tracker,
        broken,
        s.not_shown,
    ];
    if counts == [0; 4] {
        let nothing = Span::styled("nothing", theme.faint());
        lines.push(row("lost", vec![nothing], theme));
    } else {
        let [camera, queue, broken, unshown] = counts;
        let lost = beside(loss("camera", camera, theme), loss("queue", queue, theme));
        let useless = beside(
            loss("broken", broken, theme),
            loss("unshown", unshown, theme),
        );
        lines.push(row("lost", lost, theme));
        lines.push(row("", useless, theme));
    }
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

/// Images of the depth camera that were lost or dropped, and frames without one, or why it is gone.
fn of_depth(depth: &DepthCameraState, theme: Theme) -> Vec<Span<'static>> {
    if let Some(reason) = &depth.away {
        return vec![Span::styled(format!("gone: {reason}"), theme.warning())];
    }
    let counts = depth.counts;
    let lost = counts.images_lost.saturating_add(counts.images_dropped);
    beside(
        loss("lost", lost, theme),
        loss("frames without", counts.frames_without, theme),
    )
}

/// How long a pixel is by the tag, with half of the 95 % interval, or that the tag is not seen now.
fn of_tag(tag: &TagState, theme: Theme) -> Span<'static> {
    let scale = &tag.scale;
    let length = format!(
        "{:.5} m/px ±{:.1} %",
        scale.metres_per_px,
        100.0 * scale.relative_error()
    );
    if tag.is_seen {
        Span::styled(length, theme.strong())
    } else {
        Span::styled(format!("not seen  {length}"), theme.warning())
    }
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

/// By how much the camera itself trembles, and how fast.
fn shake(s: &Snapshot, theme: Theme) -> Vec<Span<'static>> {
    let shake = match (s.background, s.shake) {
        (Some(Background::Lost), _) => return vec![Span::styled("turned away", theme.warning())],
        (Some(Background::Unclear), _) => return vec![Span::styled("not known", theme.warning())],
        (None, _) | (_, None) => return vec![Span::raw("–")],
        (Some(Background::Seen(_) | Background::Foot(_)), Some(shake)) => shake,
    };
    let mut words = format!("{} px", value(shake.rms_px));
    if let Some(hz) = shake.frequency_hz {
        words += &format!("  {} Hz", value(hz));
    }
    let style = if shake.is_strong() {
        theme.warning()
    } else {
        theme.strong()
    };
    vec![Span::styled(words, style)]
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

//! First line: what is filmed, and how far it has come.

use crate::tui::format;
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

/// Source on the left, state and frame on the right.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let s = &state.snapshot;
    let word = match (state.quitting, s.ended, state.paused) {
        (true, ..) => Some(" WRITING "),
        (_, true, _) => Some(" ENDED "),
        _ if s.camera.away.is_some() => Some(" CAMERA GONE "),
        (.., true) => Some(" PAUSED "),
        _ => None,
    };
    let count = match s.frames_total {
        Some(total) => format!(
            "frame {} of {}",
            format::count(s.frame),
            format::count(total)
        ),
        None => format!("frame {}", format::count(s.frame)),
    };
    let recorded = match s.recorded {
        Some((_, 0)) => Some(Span::styled(" REC ", theme.here())),
        Some((_, missing)) => Some(Span::styled(
            format!(" REC, {} missing ", format::count(missing)),
            theme.warning(),
        )),
        None => None,
    };
    let mut right: Vec<Span> = recorded.into_iter().collect();
    right.push(Span::raw(format!(" {count}  {} ", format::clock(s.time_s))));
    right.extend(word.map(|w| Span::styled(w, theme.here())));
    let right = Line::from(right);

    let size = s
        .image_size
        .map_or(String::new(), |size| format!("  {size}"));
    let taken = right.width() + format::width(&size) + format::width(" arborcam  ");
    let source = format::keep_end(&s.source, (area.width as usize).saturating_sub(taken));
    let left = Line::from(vec![
        Span::styled(" arborcam  ", theme.title()),
        Span::styled(source, theme.strong()),
        Span::raw(size),
    ]);
    frame.render_widget(left, area);
    let width = (right.width() as u16).min(area.width);
    frame.render_widget(
        right,
        Rect {
            x: area.right() - width,
            width,
            ..area
        },
    );
}

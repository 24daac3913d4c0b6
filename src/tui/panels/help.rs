//! The help, laid over everything else.

use crate::tui::input::{Binding, DRAWING, WATCHING};
use crate::tui::layout::SMALLEST;
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::{Constraint, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Padding, Paragraph};

/// What stands in the table and the panel of the branches.
const MEANINGS: [(&str, &str); 3] = [
    (
        "f/Hz",
        "sway against the branch that carries it; ± half of 95 %",
    ),
    (
        "damping",
        "share of the critical; no number where the film tells none",
    ),
    ("▲", "the answer in the spectrum of its angle, for the eye"),
];

/// All keys of the capture, from the same tables that they are read with.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let mut lines = rows(&WATCHING, theme);
    lines.push(Line::styled("What is shown of a branch", theme.faint()));
    lines.extend(MEANINGS.map(|(shown, help)| row(shown, help, theme)));
    panel(frame, lines, state, area, theme);
}

/// All keys of the screen on which a user draws on a photograph.
pub fn of_photograph<A>(frame: &mut Frame, keys: &[Binding<A>], state: &State, theme: Theme) {
    panel(frame, rows(keys, theme), state, frame.area(), theme);
}

/// These lines and the keys while something is drawn.
fn panel<'a>(frame: &mut Frame, mut lines: Vec<Line<'a>>, state: &State, area: Rect, theme: Theme) {
    let mut drawing = vec![
        Line::styled("While an outline or a line is drawn", theme.faint()),
        row("click", "sets a point", theme),
    ];
    drawing.extend(rows(&DRAWING, theme));
    // Where there is no room for both, those that mean something now.
    if lines.len() + drawing.len() + 2 <= area.height as usize {
        lines.append(&mut drawing);
    } else if state.drawing.is_some() {
        lines = drawing;
    }
    let (width, height) = (74, lines.len() as u16 + 2);
    let area = area.centered(Constraint::Length(width), Constraint::Length(height));
    let block = Block::bordered()
        .title(" Keys ")
        .title_style(theme.title())
        .border_style(theme.title())
        .padding(Padding::horizontal(1));
    frame.render_widget(Clear, area);
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// The keys that have an explanation.
fn rows<A>(keys: &[Binding<A>], theme: Theme) -> Vec<Line<'static>> {
    let explained = keys.iter().filter(|b| !b.help.is_empty());
    explained.map(|b| row(b.shown, b.help, theme)).collect()
}

fn row(key: &'static str, help: &'static str, theme: Theme) -> Line<'static> {
    Line::from(vec![
        Span::styled(format!("{key:<10}"), theme.title()),
        Span::raw(help),
    ])
}

/// What is said in a window in which nothing can be shown. While the user draws, `q` waits.
pub fn too_small(frame: &mut Frame, area: Rect) {
    let (width, height) = SMALLEST;
    let text =
        format!("arborcam needs {width}x{height} characters; enlarge the window. Ctrl-C ends.");
    let lines: Vec<Line> = crate::tui::format::wrap(&text, area.width as usize)
        .into_iter()
        .map(Line::from)
        .collect();
    frame.render_widget(Paragraph::new(lines), area);
}

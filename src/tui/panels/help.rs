//! The help, laid over everything else.

use crate::tui::format::wrap;
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

/// Columns of the panel at most, of its frame with the gaps beside it, and of the keys.
const WIDEST: u16 = 74;
const FRAME_WIDTH: u16 = 4;
const KEY_WIDTH: usize = 10;

/// A line of the help.
enum Row {
    Head(&'static str),
    Key(&'static str, &'static str),
}

/// All keys of the capture, from the same tables that they are read with.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let mut rows = explained(&WATCHING);
    rows.push(Row::Head("What is shown of a branch"));
    rows.extend(MEANINGS.map(|(shown, help)| Row::Key(shown, help)));
    panel(frame, rows, state, area, theme);
}

/// All keys of the screen on which a user draws on a photograph.
pub fn of_photograph<A>(frame: &mut Frame, keys: &[Binding<A>], state: &State, theme: Theme) {
    panel(frame, explained(keys), state, frame.area(), theme);
}

/// These rows and the keys while something is drawn.
fn panel(frame: &mut Frame, rows: Vec<Row>, state: &State, area: Rect, theme: Theme) {
    let mut drawing = vec![
        Row::Head("While an outline or a line is drawn"),
        Row::Key("click", "sets a point"),
    ];
    drawing.extend(explained(&DRAWING));
    let width = WIDEST.min(area.width);
    let most = area.height.saturating_sub(2) as usize;
    let mut lines = lines_of(&rows, width, most, theme);
    let mut drawing = lines_of(&drawing, width, most, theme);
    // Where there is no room for both, those that mean something now.
    if lines.len() + drawing.len() <= most {
        lines.append(&mut drawing);
    } else if state.drawing.is_some() {
        lines = drawing;
    }
    let height = lines.len() as u16 + 2;
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
fn explained<A>(keys: &[Binding<A>]) -> Vec<Row> {
    let explained = keys.iter().filter(|b| !b.help.is_empty());
    explained.map(|b| Row::Key(b.shown, b.help)).collect()
}

/// The rows in a panel so wide: whole if that takes `most` lines, else each in one line, which may be cut.
fn lines_of(rows: &[Row], width: u16, most: usize, theme: Theme) -> Vec<Line<'static>> {
    let room = width.saturating_sub(FRAME_WIDTH) as usize;
    let whole: Vec<Line> = rows.iter().flat_map(|row| row.lines(room, theme)).collect();
    if whole.len() <= most {
        return whole;
    }
    let cut = rows.iter().flat_map(|row| row.lines(usize::MAX, theme));
    cut.collect()
}

impl Row {
    /// As lines of at most so many columns.
    fn lines(&self, room: usize, theme: Theme) -> Vec<Line<'static>> {
        let (key, help) = match *self {
            Self::Head(text) => return vec![Line::styled(text, theme.faint())],
            Self::Key(key, help) => (key, help),
        };
        let keys = std::iter::once(key).chain(std::iter::repeat(""));
        let texts = wrap(help, room.saturating_sub(KEY_WIDTH));
        let lines = keys.zip(texts).map(|(key, text)| {
            let key = Span::styled(format!("{key:<KEY_WIDTH$}"), theme.title());
            Line::from(vec![key, Span::raw(text)])
        });
        lines.collect()
    }
}

/// What is said in a window in which nothing can be shown. While the user draws, `q` waits.
pub fn too_small(frame: &mut Frame, area: Rect) {
    let (width, height) = SMALLEST;
    let text =
        format!("arborcam needs {width}x{height} characters; enlarge the window. Ctrl-C ends.");
    let lines: Vec<Line> = wrap(&text, area.width as usize)
        .into_iter()
        .map(Line::from)
        .collect();
    frame.render_widget(Paragraph::new(lines), area);
}

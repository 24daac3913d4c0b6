//! The table of branches.

use super::{titled, waiting};
use crate::model::{BranchRow, Participation, Phase, Snapshot, Unidentified};
use crate::tui::format::{count, plus_minus, value, width};
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};

/// A wider table would be harder to read along a line; there are as many side by side as there is
/// room for.
const WIDEST: u16 = 60;
/// Width of a value with its interval.
const SURE: usize = 13;
/// What stands between the name and the sway: name and width of the columns, where there is room
/// for all.
const COLUMNS: [(&str, usize); 2] = [("pts", 5), ("ampl/px", 7)];
/// A narrower table has the name and the sway alone.
const ALL_FROM: u16 = 56;
/// And one that is narrower yet the frequency alone: names would be cut to what many have in common.
const DAMPING_FROM: u16 = 44;
/// Columns that stay free about a title, and between it and the modes.
const AROUND_TITLE: usize = 5;
/// Stands behind the frequencies of the modes.
const HZ: &str = " Hz";
/// With so many lines one can be spared for the names of the columns.
const NAMED_FROM: usize = 4;

/// One line for each branch as far as there is room, the chosen one among them; the title says how
/// many there are.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let s = &state.snapshot;
    let total = s.branches.len();
    if total == 0 {
        let inner = titled(frame, area, "Branches", theme);
        let text = match s.phase {
            Phase::Live => "no branch was found",
            _ => "listed once the tree is built",
        };
        waiting(frame, inner, text, theme);
        return;
    }
    let tables = Tables::new(total, state.chosen().min(total - 1), area);
    let mut title = tables.title();
    if tables.named_below {
        let room = usize::from(area.width).saturating_sub(width(&title) + AROUND_TITLE);
        let modes = modes(s, room);
        title += if modes.is_empty() { "" } else { "; " };
        title += &modes;
    }
    let inner = titled(frame, area, &title, theme);
    let [head, below] = Layout::vertical([
        Constraint::Length(u16::from(tables.named_below)),
        Constraint::Min(1),
    ])
    .areas(inner);
    let all = s.branches[tables.first..].chunks(tables.height);
    for (i, rows) in all.take(tables.beside).enumerate() {
        let x = below.x + i as u16 * (WIDEST + 2);
        let place = Rect {
            x,
            width: (below.right() - x).min(WIDEST),
            ..below
        };
        let on_title = Rect {
            y: if tables.named_below { head.y } else { area.y },
            height: 1,
            ..place
        };
        let taken = if tables.named_below || i > 0 {
            0
        } else {
            title.chars().count() as u16 + 3
        };
        names(frame, on_title, taken, theme);
        for ((k, row), line) in rows.iter().enumerate().zip(place.rows()) {
            let marked = tables.first + i * tables.height + k == tables.chosen;
            frame.render_widget(branch(s, row, marked, place.width, theme), line);
        }
    }
}

/// Which branches are shown: in tables side by side, the chosen one among them.
struct Tables {
    total: usize,
    chosen: usize,
    /// The first branch that is shown, and how many are.
    first: usize,
    shown: usize,
    beside: usize,
    /// Rows of each.
    height: usize,
    /// The names of the columns have a line of their own: beside the title there is no room for
    /// all of them.
    named_below: bool,
}

impl Tables {
    fn new(total: usize, chosen: usize, area: Rect) -> Self {
        let lines = area.height.saturating_sub(1).max(1) as usize;
        let named_below = lines >= NAMED_FROM && area.width >= ALL_FROM;
        let height = lines - usize::from(named_below);
        let room = (area.width / (WIDEST + 2)).max(1) as usize;
        let beside = room.min(total.div_ceil(height));
        let shown = total.min(beside * height);
        Self {
            total,
            chosen,
            first: chosen.saturating_sub(shown / 2).min(total - shown),
            shown,
            beside,
            height,
            named_below,
        }
    }

    fn title(&self) -> String {
        let (first, total) = (self.first, self.total);
        if total > self.shown {
            format!("Branches, {}–{} of {total}", first + 1, first + self.shown)
        } else {
            format!("Branches, {total}")
        }
    }
}

fn branch(s: &Snapshot, b: &BranchRow, marked: bool, width: u16, theme: Theme) -> Line<'static> {
    let middle = if width >= ALL_FROM {
        let cells = [count(b.n_tracks.into()), value(b.amplitude_px)];
        cells
            .iter()
            .zip(COLUMNS)
            .map(|(text, (_, width))| format!(" {text:>width$}"))
            .collect()
    } else {
        String::new()
    };
    let has_damping = width >= DAMPING_FROM;
    let (sway, style) = sway(s, b, has_damping, theme);
    let others = middle.chars().count() + self::width(&sway) + 3;
    let name = shortened(&b.name, (width as usize).saturating_sub(others));
    let used = name.chars().count() + others;
    let gap = " ".repeat((width as usize).saturating_sub(used));
    let style_of_name = if marked { theme.strong() } else { Style::new() };
    Line::from(vec![
        Span::styled(if marked { "▸" } else { " " }, theme.title()),
        Span::styled("● ", theme.branch(b.colour)),
        Span::styled(name, style_of_name),
        Span::raw(format!("{gap}{middle}")),
        Span::styled(sway, style),
    ])
}

/// A name in so many letters: of a longer one the end, which tells it from its neighbours.
fn shortened(name: &str, most: usize) -> String {
    let letters = name.chars().count();
    if letters <= most {
        return name.to_owned();
    }
    let end = name.chars().skip(letters - most.saturating_sub(1));
    std::iter::once('…').chain(end).collect()
}

/// Frequency and, where it has a column, damping with half their intervals, or why there are none.
fn sway(s: &Snapshot, b: &BranchRow, has_damping: bool, theme: Theme) -> (String, Style) {
    let room = (SURE + 1) * (1 + usize::from(has_damping));
    let branch = s.sway.as_ref().and_then(|s| s.branches.get(&b.node));
    let (text, style) = match branch.map(|branch| branch.swaying) {
        Some(Ok(sway)) => {
            let damping = sway.damping_ratio.as_ref();
            let damping = damping.map_or_else(|| "–".to_owned(), plus_minus);
            let cells = [plus_minus(&sway.frequency_hz), damping];
            (columns(&cells, has_damping), theme.strong())
        }
        Some(Err(why)) => {
            let moves_with = branch.map_or(&[][..], |branch| &branch.moves_with);
            (in_short(why, moves_with, room - 1), theme.faint())
        }
        None => {
            let unknown = ["–", "–"].map(str::to_owned);
            (columns(&unknown, has_damping), theme.faint())
        }
    };
    (format!("{text:>room$}"), style)
}

/// The columns of the sway, those that there are.
fn columns(cells: &[String; 2], has_damping: bool) -> String {
    let shown = &cells[..1 + usize::from(has_damping)];
    shown.iter().map(|cell| format!(" {cell:>SURE$}")).collect()
}

/// Two or three words of at most so many letters; the branch's own panel has them all.
fn in_short(why: Unidentified, moves_with: &[Participation], room: usize) -> String {
    if why == Unidentified::AncestorsSway
        && let Some(most) = moves_with.first()
    {
        let words = format!("with {most}");
        if width(&words) <= room {
            return words;
        }
        return format!("with {} Hz", value(most.frequency_hz));
    }
    let (words, fewer) = match why {
        Unidentified::NotMeasured => ("not measured", "not measured"),
        Unidentified::TooShort => ("film too short", "too short"),
        Unidentified::TooLittleMotion => ("too little motion", "moves little"),
        Unidentified::AncestorsSway => ("moves with its parent", "as its parent"),
        Unidentified::AboveSampling => ("too fast for the frames", "too fast"),
        Unidentified::NoOscillation => ("no oscillation", "no own swing"),
        Unidentified::TooUncertain => ("too uncertain", "too uncertain"),
        Unidentified::NotInTime => ("not in time", "not in time"),
    };
    let shown = if width(words) <= room { words } else { fewer };
    shown.to_owned()
}

/// The frequencies of the tree's modes, as many as there is room for.
fn modes(s: &Snapshot, room: usize) -> String {
    let mut text = String::new();
    for mode in s.sway.iter().flat_map(|sway| &sway.modes) {
        let gap = if text.is_empty() { "modes at " } else { ", " };
        let longer = format!("{text}{gap}{}", value(mode.sway.frequency_hz.value));
        if width(&longer) + HZ.len() > room {
            break;
        }
        text = longer;
    }
    match text.is_empty() {
        true => text,
        false => text + HZ,
    }
}

/// The columns' names, as many from the right as there is room for. On the rule, beside the title,
/// they cost no line.
fn names(frame: &mut Frame, area: Rect, taken: u16, theme: Theme) {
    let mut names: Vec<(&str, usize)> = if area.width >= ALL_FROM {
        COLUMNS.to_vec()
    } else {
        Vec::new()
    };
    names.push(("f/Hz", SURE));
    if area.width >= DAMPING_FROM {
        names.push(("damping", SURE));
    }
    let mut end = area.right();
    for (name, width) in names.into_iter().rev() {
        let own = name.chars().count() as u16;
        let start = end.saturating_sub(own);
        if start < area.x + taken + 1 {
            break;
        }
        let place = Rect {
            x: start.saturating_sub(1),
            width: own + 2,
            ..area
        }
        .intersection(frame.area());
        frame.render_widget(Line::styled(format!(" {name} "), theme.faint()), place);
        end = end.saturating_sub(width as u16 + 1);
    }
}

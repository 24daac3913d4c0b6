//! The chosen branch: how it sways, its angle, and its spectrum with the answer in it.

use super::{titled, waiting};
use crate::bounds::Bounds;
use crate::model::{BranchRow, BranchSway, Interval, Snapshot, reason};
use crate::tui::format::{clock, count, plus_minus, value, wrap};
use crate::tui::plot;
use crate::tui::state::State;
use crate::tui::theme::Theme;
use nalgebra::Point2;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

/// Time that a column of the plot of the angle stands for, s: a sway of 2 Hz is still seen as one.
const COLUMN_S: f64 = 0.25;
/// What was not seen for longer is left open, s.
const GAP_S: f64 = 1.0;
/// Ends of the axis of frequencies, Hz. One is taken for all branches, so that they can be
/// compared.
const AXES_HZ: [f64; 5] = [1.0, 2.0, 3.0, 5.0, 10.0];
/// Room that is left beyond the highest answer.
const BEYOND: f64 = 1.3;
/// Periods that a frequency must have had in the film to be judged by its height.
const LEAST_PERIODS: f64 = 2.0;

/// Text above, the angle below it, the spectrum at the bottom.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme) {
    let s = &state.snapshot;
    let Some(branch) = s.branches.get(state.chosen()) else {
        let inner = titled(frame, area, "Branch", theme);
        waiting(frame, inner, "no branch yet", theme);
        return;
    };
    let points = count(branch.n_tracks.into());
    let title = format!("Branch {}, {points} points", branch.name);
    let inner = titled(frame, area, &title, theme);
    let answer = s
        .sway
        .as_ref()
        .and_then(|sway| sway.branches.get(&branch.node));
    let mut text = told(s, answer, inner.width, theme);
    if let Some(sway) = s.sway.as_ref().filter(|_| s.sway_passed_over > 0) {
        let late = format!(
            " as of {}, {} left out",
            clock(sway.time_s),
            count(s.sway_passed_over)
        );
        text.push(Line::styled(late, theme.faint()));
    }
    let height = (text.len() as u16).min(inner.height);
    let [words, plots] =
        Layout::vertical([Constraint::Length(height), Constraint::Min(0)]).areas(inner);
    frame.render_widget(Paragraph::new(text), words);
    // A plot without its scale would say nothing.
    if plots.height < 4 {
        return;
    }
    let [angle_note, angle, spectrum, axis] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Fill(1),
        Constraint::Fill(1),
        Constraint::Length(1),
    ])
    .areas(plots);
    let colour = theme.branch(branch.colour);
    sways(frame, s, branch, angle_note, angle, colour, theme);
    spectrum_of(frame, s, answer, spectrum, axis, colour, theme);
}

fn told(s: &Snapshot, answer: Option<&BranchSway>, width: u16, theme: Theme) -> Vec<Line<'static>> {
    let width = width.saturating_sub(2) as usize;
    let sway = match answer {
        None if s.sway_at_end => {
            return words(
                "how it sways is found at the end (dynamics.every_s is 0)",
                width,
            );
        }
        None => return words("how it sways: being looked at", width),
        Some(answer) => match answer.swaying {
            Err(why) => {
                let why = reason(why, &answer.moves_with);
                return words(&format!("no frequency: {why}"), width);
            }
            Ok(sway) => sway,
        },
    };
    let damping = match &sway.damping_ratio {
        Some(damping) => row("damping", plus_minus(damping), "", theme),
        None => row("damping", "–".into(), "  too uncertain", theme),
    };
    // The largest swing of a release; of wind one that is usual.
    let amplitude = match sway.amplitude_deg.is_finite() {
        true => format!(", ±{}°", value(sway.amplitude_deg)),
        false => String::new(),
    };
    let cause = sway.excitation.word().to_owned();
    vec![
        row("sways at", plus_minus(&sway.frequency_hz), " Hz", theme),
        damping,
        row("made by", cause, &amplitude, theme),
    ]
}

fn row(name: &str, value: String, more: &str, theme: Theme) -> Line<'static> {
    Line::from(vec![
        Span::styled(format!(" {name:<9}"), theme.faint()),
        Span::styled(value, theme.strong()),
        Span::raw(more.to_owned()),
    ])
}

fn words(text: &str, width: usize) -> Vec<Line<'static>> {
    wrap(text, width)
        .into_iter()
        .map(|line| Line::raw(format!(" {line}")))
        .collect()
}

/// The newest angles that there is room for, the newest at the right; `note` says what they span.
fn sways(
    frame: &mut Frame,
    s: &Snapshot,
    b: &BranchRow,
    note: Rect,
    area: Rect,
    colour: Color,
    theme: Theme,
) {
    let span_s = COLUMN_S * f64::from(area.width);
    let newest_s = s.angles.rows.last().map_or(0.0, |(t, _)| *t);
    let seen: Vec<(f64, f64)> = s
        .angles
        .of(b.node)
        .filter(|(t, a)| newest_s - t <= span_s && a.is_finite())
        .collect();
    let Some(range) = Bounds::of(seen.iter().map(|(_, a)| *a)) else {
        frame.render_widget(
            Line::styled(" angle: none in this picture", theme.faint()),
            note,
        );
        return;
    };
    // A branch may be younger than the panel is wide.
    let drawn_s = seen.first().map_or(0.0, |(t, _)| newest_s - t);
    let text = format!(
        " angle {} to {}°, last {drawn_s:.0} s",
        value(range.lo),
        value(range.hi)
    );
    frame.render_widget(Line::styled(text, theme.faint()), note);
    // Tracking noise must not look like a storm.
    let range = plot::widened(range, 1.0);
    let points: Vec<Point2<f64>> = seen
        .iter()
        .map(|(t, a)| {
            Point2::new(
                1.0 - (newest_s - t) / span_s,
                (a - range.lo) / range.length(),
            )
        })
        .collect();
    plot::curve(frame, &points, GAP_S / span_s, area, colour);
}

/// Bars, those within the answer's interval marked, and the answer on the axis below.
fn spectrum_of(
    frame: &mut Frame,
    s: &Snapshot,
    answer: Option<&BranchSway>,
    area: Rect,
    axis: Rect,
    colour: Color,
    theme: Theme,
) {
    let Some((spectrum, span_s)) = answer
        .and_then(|a| a.spectrum.as_ref())
        .zip(s.sway.as_ref().map(|sway| sway.span_s))
    else {
        return;
    };
    let highest_hz = spectrum.bin_hz * spectrum.amplitude_deg.len() as f64;
    let frequencies = FrequencyAxis {
        top_hz: axis_hz(s, highest_hz),
        columns: area.width.max(1),
    };
    let interval = answer
        .and_then(|a| a.swaying.ok())
        .map(|sway| sway.frequency_hz);
    let bars: Vec<f64> = (0..area.width)
        .map(|k| {
            let range_hz = Bounds::new(frequencies.hz(k), frequencies.hz(k + 1));
            plot::highest(spectrum, range_hz)
        })
        .collect();
    // Drift makes the lowest frequencies the highest bars, whatever the branch does.
    let from = frequencies.column(LEAST_PERIODS / span_s.max(0.1));
    let most = bars
        .get(usize::from(from)..)
        .unwrap_or(&[])
        .iter()
        .copied()
        .fold(0.0, f64::max);
    let marked = interval.map(|i| frequencies.column(i.lo)..=frequencies.column(i.hi));
    plot::bars(frame, &bars, most, area, |k| match &marked {
        Some(marked) if marked.contains(&k) => theme.warning(),
        _ if k < from => theme.faint(),
        _ => colour.into(),
    });
    axis_below(frame, interval, &frequencies, axis, theme);
}

/// Frequencies from 0 to `top_hz` over the columns of a panel.
struct FrequencyAxis {
    top_hz: f64,
    /// At least 1.
    columns: u16,
}

impl FrequencyAxis {
    /// The lower end of a column, Hz.
    fn hz(&self, column: u16) -> f64 {
        f64::from(column) / f64::from(self.columns) * self.top_hz
    }

    /// The column of a frequency; what lies beyond the ends goes into the last ones.
    fn column(&self, hz: f64) -> u16 {
        let columns = f64::from(self.columns);
        (hz / self.top_hz * columns)
            .floor()
            .clamp(0.0, columns - 1.0) as u16
    }
}

/// `0`, the answer below its bar, and the end of the axis; where they would touch, the answer goes
/// first.
fn axis_below(
    frame: &mut Frame,
    interval: Option<Interval>,
    frequencies: &FrequencyAxis,
    area: Rect,
    theme: Theme,
) {
    // Frames that are few, or a limit that the user has set, end it anywhere.
    let top_hz = format!("{:.1}", frequencies.top_hz);
    let end = format!("{} Hz", top_hz.trim_end_matches(".0"));
    let end_from = area.width.saturating_sub(end.len() as u16);
    put(frame, area, 0, "0", theme.faint());
    let mut taken_to = 0;
    if let Some(i) = interval {
        let at = frequencies.column(i.value);
        let text = value(i.value);
        let room = text.chars().count() as u16;
        taken_to = at + 1;
        put(frame, area, at, "▲", theme.warning());
        if at + 1 + room < end_from {
            put(frame, area, at + 1, &text, theme.strong());
            taken_to += room;
        } else if at > room {
            put(frame, area, at - room, &text, theme.strong());
        }
    }
    if taken_to < end_from {
        put(frame, area, end_from, &end, theme.faint());
    }
}

/// Writes from column `x` of an area on, as far as there is room.
fn put(frame: &mut Frame, area: Rect, x: u16, text: &str, style: Style) {
    let width = (text.chars().count() as u16).min(area.width.saturating_sub(x));
    let place = Rect {
        x: area.x + x,
        width,
        ..area
    };
    frame.render_widget(Line::styled(text.to_owned(), style), place);
}

/// The least end of the axis that shows every branch's answer, and not more than `highest_hz`.
fn axis_hz(s: &Snapshot, highest_hz: f64) -> f64 {
    let answers = s
        .sway
        .iter()
        .flat_map(|sway| sway.branches.values())
        .filter_map(|b| b.swaying.ok());
    let most = answers
        .map(|sway| BEYOND * sway.frequency_hz.value)
        .fold(0.0, f64::max);
    let least_hz = if most > 0.0 { most } else { 2.0 };
    AXES_HZ
        .into_iter()
        .find(|hz| *hz >= least_hz)
        .unwrap_or(20.0)
        .min(highest_hz.max(0.1))
}

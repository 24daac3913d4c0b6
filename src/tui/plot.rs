//! Curves and bars in characters.

use crate::bounds::Bounds;
use crate::model::AngleSpectrum;
use nalgebra::Point2;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::widgets::canvas::{Canvas, Line};

const EIGHTHS: [&str; 9] = [" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"];

/// A range that is at least `least` wide, about the same middle.
pub fn widened(range: Bounds, least: f64) -> Bounds {
    let more = (0.5 * (least - range.length())).max(0.0);
    Bounds::new(range.lo - more, range.hi + more)
}

/// A curve through `points`, each from the left and from below, 0 to 1; broken where two are
/// farther apart than `gap`.
pub fn curve(frame: &mut Frame, points: &[Point2<f64>], gap: f64, area: Rect, colour: Color) {
    let canvas = Canvas::default()
        .marker(Marker::Braille)
        .x_bounds([0.0, 1.0])
        .y_bounds([0.0, 1.0])
        .paint(|context| {
            for pair in points.windows(2).filter(|p| p[1].x - p[0].x <= gap) {
                let (a, b) = (pair[0], pair[1]);
                context.draw(&Line::new(a.x, a.y, b.x, b.y, colour));
            }
        });
    frame.render_widget(canvas, area);
}

/// A bar a column, the highest `most`; what is higher is cut.
pub fn bars(
    frame: &mut Frame,
    values: &[f64],
    most: f64,
    area: Rect,
    style: impl Fn(u16) -> Style,
) {
    for (k, value) in (0..area.width).zip(values) {
        let share = if most > 0.0 && value.is_finite() {
            (value / most).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let mut eighths = (share * f64::from(area.height) * 8.0).round() as usize;
        for y in (area.top()..area.bottom()).rev() {
            let part = eighths.min(8);
            eighths -= part;
            if let Some(cell) = frame.buffer_mut().cell_mut((area.x + k, y)) {
                cell.set_symbol(EIGHTHS[part]).set_style(style(k));
            }
        }
    }
}

/// The largest amplitude between two frequencies, degrees; between bins that of the nearest.
pub fn highest(spectrum: &AngleSpectrum, range_hz: Bounds) -> f64 {
    let last = spectrum.amplitude_deg.len().saturating_sub(1);
    let [from, to] = [range_hz.lo, range_hz.hi].map(|hz| {
        let bin = (hz / spectrum.bin_hz).round().clamp(0.0, 1e9) as usize;
        bin.min(last)
    });
    let bins = spectrum
        .amplitude_deg
        .get(from..=to.max(from))
        .unwrap_or(&[]);
    bins.iter()
        .map(|a| f64::from(*a))
        .filter(|a| a.is_finite())
        .fold(0.0, f64::max)
}

//! Values with their intervals side by side: across levels (Hu et al. sect. 5.4) and across
//! captures (fig. 15).

use super::HEIGHT;
use super::axes::{Axes, range};
use super::svg::{Anchor, Svg};
use crate::bounds::Bounds;
use crate::model::Interval;
use nalgebra::{Point2, Vector2};

/// Room for one value, and between two places.
const STEP: f64 = 11.0;
const BETWEEN: f64 = 16.0;
const LEAST_WIDTH: f64 = 360.0;
/// Room beside the frame.
const BESIDE: f64 = 54.0;

/// One place of the plot.
pub struct Slot {
    pub name: String,
    pub marks: Vec<Mark>,
}

/// One value.
pub struct Mark {
    pub of: Interval,
    /// Colour and shape: that of a capture.
    pub kind: usize,
}

/// A dot and its interval for every value. `None` if there are none.
pub fn across(slots: &[Slot], x_label: &str, y_label: &str, label: &str) -> Option<String> {
    let ends = range(
        slots
            .iter()
            .flat_map(|s| s.marks.iter().flat_map(|m| [m.of.lo, m.of.hi])),
    );
    // A single huge interval must not flatten all others.
    let values = range(
        slots
            .iter()
            .flat_map(|s| s.marks.iter().map(|m| m.of.value)),
    );
    if !values.lo.is_finite() {
        return None;
    }
    let top = ends.hi.min(1.6 * values.hi);
    let needs: Vec<f64> = slots
        .iter()
        .map(|s| STEP * s.marks.len().max(1) as f64 + BETWEEN)
        .collect();
    let sum: f64 = needs.iter().sum();
    let width = (sum + BESIDE).max(LEAST_WIDTH);
    let stretch = (width - BESIDE) / sum;
    let mut svg = Svg::new(width, HEIGHT, label);
    let shown = Bounds::new(0.0, 1.1 * top);
    let size = Vector2::new(width, HEIGHT);
    let axes = Axes::new(size, Bounds::new(0.0, sum), shown);
    axes.draw_y(&mut svg, y_label);
    axes.draw_base(&mut svg, x_label);
    let apart = STEP * stretch.min(1.5);
    let mut from = 0.0;
    for (slot, need) in slots.iter().zip(&needs) {
        let middle = axes.x(from + 0.5 * need);
        svg.text(
            Point2::new(middle, axes.bottom() + 13.0),
            Anchor::Middle,
            "tick",
            &slot.name,
        );
        for (k, mark) in slot.marks.iter().enumerate() {
            let beside = k as f64 - 0.5 * (slot.marks.len() as f64 - 1.0);
            draw_mark(&mut svg, &axes, mark, shown, middle + beside * apart);
        }
        from += need;
    }
    Some(svg.finish())
}

/// A value and its interval, as far as they are `shown`, at `x`.
fn draw_mark(svg: &mut Svg, axes: &Axes, mark: &Mark, shown: Bounds, x: f64) {
    let class = format!("c{}", mark.kind % 6);
    let [lo, value, hi] =
        [mark.of.lo, mark.of.value, mark.of.hi].map(|v| Point2::new(x, axes.y(shown.clamp(v))));
    svg.line(lo, hi, &format!("{class} bar"));
    svg.dot(value, mark.kind, &format!("{class} dot"));
}

//! A frame with two scales.

use super::svg::{Anchor, Svg};
use crate::bounds::Bounds;
use nalgebra::{Point2, Vector2};

/// Room beside and under the frame for the numbers, and beyond it.
const LEFT: f64 = 44.0;
const BOTTOM: f64 = 32.0;
const TOP: f64 = 10.0;
const RIGHT: f64 = 10.0;
/// Numbers on a scale, about.
const TICKS: f64 = 5.0;

/// Where nothing is drawn.
const NO_PLACE: Point2<f64> = Point2::new(f64::NAN, f64::NAN);

/// Values to places in a drawing.
pub struct Axes {
    x: Bounds,
    y: Bounds,
    /// Left, top, right and bottom of the frame.
    frame: [f64; 4],
}

impl Axes {
    /// For values within `x` and `y` in a drawing of a size. Ranges that hold nothing are made
    /// wider.
    pub fn new(size: Vector2<f64>, x: Bounds, y: Bounds) -> Self {
        let frame = [LEFT, TOP, size.x - RIGHT, size.y - BOTTOM];
        Self {
            x: sound(x),
            y: sound(y),
            frame,
        }
    }

    /// The same with one scale for both directions, as in a picture.
    pub fn even(size: Vector2<f64>, x: Bounds, y: Bounds) -> Self {
        let (x, y) = (sound(x), sound(y));
        let frame = [LEFT, TOP, size.x - RIGHT, size.y - BOTTOM];
        let per = (x.length() / (frame[2] - frame[0])).max(y.length() / (frame[3] - frame[1]));
        Self {
            x: about(x, per * (frame[2] - frame[0])),
            y: about(y, per * (frame[3] - frame[1])),
            frame,
        }
    }

    pub fn x(&self, value: f64) -> f64 {
        let [left, _, right, _] = self.frame;
        left + (value - self.x.lo) / self.x.length() * (right - left)
    }

    pub fn y(&self, value: f64) -> f64 {
        let [_, top, _, bottom] = self.frame;
        bottom - (value - self.y.lo) / self.y.length() * (bottom - top)
    }

    /// No number outside of the frame's sides.
    pub fn at(&self, value: Point2<f64>) -> Point2<f64> {
        if value.x < self.x.lo || value.x > self.x.hi {
            NO_PLACE
        } else {
            Point2::new(self.x(value.x), self.y(value.y))
        }
    }

    pub fn top(&self) -> f64 {
        self.frame[1]
    }

    pub fn bottom(&self) -> f64 {
        self.frame[3]
    }

    /// From the left to the right one.
    pub fn sides(&self) -> Bounds {
        Bounds::new(self.frame[0], self.frame[2])
    }

    /// Lines and numbers of both scales, and what they are.
    pub fn draw(&self, svg: &mut Svg, x_label: &str, y_label: &str) {
        self.draw_x(svg, x_label);
        self.draw_y(svg, y_label);
    }

    pub fn draw_x(&self, svg: &mut Svg, label: &str) {
        let (top, bottom) = (self.top(), self.bottom());
        for (value, text) in ticks(self.x) {
            let x = self.x(value);
            svg.line(Point2::new(x, top), Point2::new(x, bottom), "grid");
            svg.text(Point2::new(x, bottom + 13.0), Anchor::Middle, "tick", &text);
        }
        self.draw_base(svg, label);
    }

    /// The line below without numbers, and what it stands for.
    pub fn draw_base(&self, svg: &mut Svg, label: &str) {
        let [left, _, right, bottom] = self.frame;
        svg.line(
            Point2::new(left, bottom),
            Point2::new(right, bottom),
            "axis",
        );
        svg.text(
            Point2::new(0.5 * (left + right), bottom + 27.0),
            Anchor::Middle,
            "label",
            label,
        );
    }

    pub fn draw_y(&self, svg: &mut Svg, label: &str) {
        let [left, top, right, bottom] = self.frame;
        for (value, text) in ticks(self.y) {
            let y = self.y(value);
            svg.line(Point2::new(left, y), Point2::new(right, y), "grid");
            svg.text(Point2::new(left - 5.0, y + 3.5), Anchor::End, "tick", &text);
        }
        svg.line(Point2::new(left, top), Point2::new(left, bottom), "axis");
        // Upright, as it is read.
        svg.text(
            Point2::new(left + 5.0, top + 9.0),
            Anchor::Start,
            "label",
            label,
        );
    }
}

/// A range that can be drawn.
fn sound(range: Bounds) -> Bounds {
    let Bounds { lo, hi } = range;
    match (lo.is_finite() && hi.is_finite(), hi - lo) {
        (false, _) => Bounds::new(0.0, 1.0),
        (true, wide) if wide > 1e-9 * (lo.abs() + hi.abs()) && wide > 1e-12 => range,
        (true, _) => Bounds::new(lo - 0.5, lo + 0.5),
    }
}

/// Round values within a range, and as text.
fn ticks(range: Bounds) -> Vec<(f64, String)> {
    let rough = range.length() / TICKS;
    let power = 10.0_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|m| m * power)
        .find(|s| *s >= rough)
        .unwrap_or(rough);
    let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    let (first, last) = (
        (range.lo / step).ceil() as i64,
        (range.hi / step).floor() as i64,
    );
    (first..=last.min(first + 20))
        .map(|k| k as f64 * step)
        .map(|v| (v, tick_text(v, decimals)))
        .collect()
}

fn tick_text(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let mut digits = text.trim_start_matches('-').chars();
    if digits.all(|c| c == '0' || c == '.') {
        "0".into()
    } else {
        text
    }
}

/// A range of this length about the middle of another.
fn about(range: Bounds, length: f64) -> Bounds {
    let middle = 0.5 * (range.lo + range.hi);
    Bounds::new(middle - 0.5 * length, middle + 0.5 * length)
}

/// At most `most` points or so of a line: of every stretch its lowest and its highest, so that no
/// swing is lost.
pub fn thinned(points: &[Point2<f64>], most: usize) -> Vec<Point2<f64>> {
    if points.len() <= most {
        return points.to_vec();
    }
    let stretch = (2 * points.len()).div_ceil(most.max(2));
    points.chunks(stretch).flat_map(extremes).collect()
}

/// The lowest and the highest point in the order of the line; one without numbers where there is
/// none.
fn extremes(stretch: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let seen = (0..stretch.len()).filter(|&k| stretch[k].y.is_finite());
    let low = seen
        .clone()
        .min_by(|&a, &b| stretch[a].y.total_cmp(&stretch[b].y));
    let high = seen.max_by(|&a, &b| stretch[a].y.total_cmp(&stretch[b].y));
    match (low, high) {
        (Some(low), Some(high)) => vec![stretch[low.min(high)], stretch[low.max(high)]],
        _ => vec![NO_PLACE],
    }
}

/// The least and the largest of some values; no numbers of none.
pub fn range(values: impl IntoIterator<Item = f64>) -> Bounds {
    Bounds::of(values).unwrap_or(Bounds::new(f64::NAN, f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_have_round_numbers_whatever_they_span() {
        for (range, expected) in [
            (Bounds::new(0.0, 11.0), "0 5 10"),
            (Bounds::new(-0.02, 0.031), "-0.02 0 0.02"),
            (Bounds::new(0.0, 1.0), "0 0.2 0.4 0.6 0.8 1.0"),
        ] {
            let texts: Vec<String> = ticks(range).into_iter().map(|t| t.1).collect();
            assert_eq!(texts.join(" "), expected);
        }
        for odd in [
            Bounds::new(0.0, 0.0),
            Bounds::new(f64::NAN, 1.0),
            Bounds::new(1e300, 1e300),
            Bounds::new(5.0, 5.0 + 1e-15),
            Bounds::new(f64::INFINITY, 0.0),
        ] {
            assert!(ticks(sound(odd)).len() < 30);
        }
    }

    #[test]
    fn a_long_line_keeps_its_highest_and_lowest_points() {
        let line: Vec<Point2<f64>> = (0..10_000)
            .map(|k| Point2::new(f64::from(k), if k == 7777 { 9.0 } else { 0.0 }))
            .collect();
        let thin = thinned(&line, 400);
        assert!(
            thin.len() <= 400 && thin.iter().any(|p| p.y == 9.0),
            "{}",
            thin.len()
        );
        assert!(thin.windows(2).all(|w| w[0].x <= w[1].x));
    }
}

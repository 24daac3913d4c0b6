//! A frame with two scales.

use super::svg::{Anchor, Svg};

/// Room beside and under the frame for the numbers, and beyond it.
const LEFT: f64 = 44.0;
const BOTTOM: f64 = 32.0;
const TOP: f64 = 10.0;
const RIGHT: f64 = 10.0;
/// Numbers on a scale, about.
const TICKS: f64 = 5.0;

/// Values to places in a drawing.
pub struct Axes {
    x: [f64; 2],
    y: [f64; 2],
    /// Left, top, right and bottom of the frame.
    frame: [f64; 4],
}

impl Axes {
    /// For values within `x` and `y` in a drawing of a size. Ranges that hold nothing are made
    /// wider.
    pub fn new(size: [f64; 2], x: [f64; 2], y: [f64; 2]) -> Self {
        let frame = [LEFT, TOP, size[0] - RIGHT, size[1] - BOTTOM];
        Self {
            x: sound(x),
            y: sound(y),
            frame,
        }
    }

    /// The same with one scale for both directions, as in a picture.
    pub fn even(size: [f64; 2], x: [f64; 2], y: [f64; 2]) -> Self {
        let (x, y) = (sound(x), sound(y));
        let frame = [LEFT, TOP, size[0] - RIGHT, size[1] - BOTTOM];
        let per =
            ((x[1] - x[0]) / (frame[2] - frame[0])).max((y[1] - y[0]) / (frame[3] - frame[1]));
        Self {
            x: about(x, per * (frame[2] - frame[0])),
            y: about(y, per * (frame[3] - frame[1])),
            frame,
        }
    }

    pub fn x(&self, value: f64) -> f64 {
        let [left, _, right, _] = self.frame;
        left + (value - self.x[0]) / (self.x[1] - self.x[0]) * (right - left)
    }

    pub fn y(&self, value: f64) -> f64 {
        let [_, top, _, bottom] = self.frame;
        bottom - (value - self.y[0]) / (self.y[1] - self.y[0]) * (bottom - top)
    }

    /// No number outside of the frame's sides.
    pub fn at(&self, x: f64, y: f64) -> [f64; 2] {
        if x < self.x[0] || x > self.x[1] {
            [f64::NAN; 2]
        } else {
            [self.x(x), self.y(y)]
        }
    }

    pub fn top(&self) -> f64 {
        self.frame[1]
    }

    pub fn bottom(&self) -> f64 {
        self.frame[3]
    }

    pub fn sides(&self) -> [f64; 2] {
        [self.frame[0], self.frame[2]]
    }

    /// Lines and numbers of both scales, and what they are.
    pub fn draw(&self, svg: &mut Svg, x_label: &str, y_label: &str) {
        self.draw_x(svg, x_label);
        self.draw_y(svg, y_label);
    }

    pub fn draw_x(&self, svg: &mut Svg, label: &str) {
        let [left, top, right, bottom] = self.frame;
        for (value, text) in ticks(self.x) {
            let x = self.x(value);
            svg.line([x, top], [x, bottom], "grid");
            svg.text([x, bottom + 13.0], Anchor::Middle, "tick", &text);
        }
        svg.line([left, bottom], [right, bottom], "axis");
        svg.text(
            [0.5 * (left + right), bottom + 27.0],
            Anchor::Middle,
            "label",
            label,
        );
    }

    pub fn draw_y(&self, svg: &mut Svg, label: &str) {
        let [left, top, right, bottom] = self.frame;
        for (value, text) in ticks(self.y) {
            let y = self.y(value);
            svg.line([left, y], [right, y], "grid");
            svg.text([left - 5.0, y + 3.5], Anchor::End, "tick", &text);
        }
        svg.line([left, top], [left, bottom], "axis");
        // Upright, as it is read.
        svg.text([left + 5.0, top + 9.0], Anchor::Start, "label", label);
    }
}

/// A range that can be drawn.
fn sound([lo, hi]: [f64; 2]) -> [f64; 2] {
    match (lo.is_finite() && hi.is_finite(), hi - lo) {
        (false, _) => [0.0, 1.0],
        (true, wide) if wide > 1e-9 * (lo.abs() + hi.abs()) && wide > 1e-12 => [lo, hi],
        (true, _) => [lo - 0.5, lo + 0.5],
    }
}

/// Round values within a range, and as text.
fn ticks([lo, hi]: [f64; 2]) -> Vec<(f64, String)> {
    let rough = (hi - lo) / TICKS;
    let power = 10.0_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|m| m * power)
        .find(|s| *s >= rough)
        .unwrap_or(rough);
    let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    let (first, last) = ((lo / step).ceil() as i64, (hi / step).floor() as i64);
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
fn about([lo, hi]: [f64; 2], length: f64) -> [f64; 2] {
    let middle = 0.5 * (lo + hi);
    [middle - 0.5 * length, middle + 0.5 * length]
}

/// At most `most` points or so of a line: of every stretch its lowest and its highest, so that no
/// swing is lost.
pub fn thinned(points: &[[f64; 2]], most: usize) -> Vec<[f64; 2]> {
    if points.len() <= most {
        return points.to_vec();
    }
    let stretch = (2 * points.len()).div_ceil(most.max(2));
    points.chunks(stretch).flat_map(extremes).collect()
}

/// The lowest and the highest point in the order of the line; one without numbers where there is
/// none.
fn extremes(stretch: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let seen = (0..stretch.len()).filter(|&k| stretch[k][1].is_finite());
    let low = seen
        .clone()
        .min_by(|&a, &b| stretch[a][1].total_cmp(&stretch[b][1]));
    let high = seen.max_by(|&a, &b| stretch[a][1].total_cmp(&stretch[b][1]));
    match (low, high) {
        (Some(low), Some(high)) => vec![stretch[low.min(high)], stretch[low.max(high)]],
        _ => vec![[f64::NAN; 2]],
    }
}

/// The least and the largest of some values; no numbers of none.
pub fn range(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let seen = values.into_iter().filter(|v| v.is_finite());
    let ends = seen.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| {
        [lo.min(v), hi.max(v)]
    });
    if ends[0] <= ends[1] {
        ends
    } else {
        [f64::NAN; 2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_have_round_numbers_whatever_they_span() {
        for (range, expected) in [
            ([0.0, 11.0], "0 5 10"),
            ([-0.02, 0.031], "-0.02 0 0.02"),
            ([0.0, 1.0], "0 0.2 0.4 0.6 0.8 1.0"),
        ] {
            let texts: Vec<String> = ticks(range).into_iter().map(|t| t.1).collect();
            assert_eq!(texts.join(" "), expected);
        }
        for odd in [
            [0.0, 0.0],
            [f64::NAN, 1.0],
            [1e300, 1e300],
            [5.0, 5.0 + 1e-15],
            [f64::INFINITY, 0.0],
        ] {
            assert!(ticks(sound(odd)).len() < 30);
        }
    }

    #[test]
    fn a_long_line_keeps_its_highest_and_lowest_points() {
        let line: Vec<[f64; 2]> = (0..10_000)
            .map(|k| [f64::from(k), if k == 7777 { 9.0 } else { 0.0 }])
            .collect();
        let thin = thinned(&line, 400);
        assert!(
            thin.len() <= 400 && thin.iter().any(|p| p[1] == 9.0),
            "{}",
            thin.len()
        );
        assert!(thin.windows(2).all(|w| w[0][0] <= w[1][0]));
    }
}

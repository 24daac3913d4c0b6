//! What the user draws on the picture, while he draws it: an outline, a line along a branch, or places of
//! coloured markers.

use nalgebra::Point2;

/// What is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Subject {
    /// The tree's outline, a polygon.
    #[default]
    Outline,
    /// A line along a branch.
    Branch,
    /// Coloured markers, each by a point.
    Markers,
    /// Which of the markers hang on which: a line from marker to marker, away from the foot.
    MarkerOrder,
}

impl Subject {
    /// What is drawn, in a few words.
    pub fn name(self) -> &'static str {
        match self {
            Subject::Outline => "the outline",
            Subject::Branch => "a line along a branch",
            Subject::Markers => "coloured markers",
            Subject::MarkerOrder => "the order of markers",
        }
    }
}

/// Points set so far, in picture pixels, and the keyboard's cursor once an arrow key was used.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawing {
    subject: Subject,
    points_px: Vec<Point2<f64>>,
    cursor_px: Option<Point2<f64>>,
}

impl Drawing {
    /// A drawing of `subject` without a point.
    pub fn of(subject: Subject) -> Self {
        Self {
            subject,
            ..Self::default()
        }
    }

    pub fn subject(&self) -> Subject {
        self.subject
    }

    /// The corners set so far.
    pub fn points_px(&self) -> &[Point2<f64>] {
        &self.points_px
    }

    /// Where the keyboard's cursor stands.
    pub fn cursor_px(&self) -> Option<Point2<f64>> {
        self.cursor_px
    }

    /// Puts the keyboard's cursor somewhere.
    pub fn set_cursor(&mut self, pixel: Point2<f64>) {
        self.cursor_px = Some(pixel);
    }

    /// Adds a corner; the same place twice running is one corner.
    pub fn add(&mut self, pixel: Point2<f64>) {
        if self.points_px.last() != Some(&pixel) {
            self.points_px.push(pixel);
        }
    }

    /// Takes the last corner back; whether there was one.
    pub fn take_back(&mut self) -> bool {
        self.points_px.pop().is_some()
    }

    /// Whether the last corner is joined to the first.
    pub fn is_closed(&self) -> bool {
        self.subject == Subject::Outline && self.points_px.len() >= 3
    }

    /// Whether neighbouring points are joined by lines.
    pub fn is_joined(&self) -> bool {
        self.subject != Subject::Markers
    }

    /// The finished polygon, not repeating its first point, or the finished line.
    ///
    /// # Errors
    /// What is wrong with it, for the user to read.
    pub fn finish(&self) -> Result<Vec<Point2<f64>>, &'static str> {
        match self.subject {
            Subject::Outline => self.polygon(),
            Subject::Branch if self.points_px.len() < 2 => {
                Err("A line needs at least 2 points; go on, or leave with Esc.")
            }
            Subject::Markers if self.points_px.is_empty() => {
                Err("Click on a marker first, or leave with Esc.")
            }
            Subject::MarkerOrder if self.points_px.len() < 2 => {
                Err("Click on a marker and on the next one away from the foot, or leave with Esc.")
            }
            Subject::Branch | Subject::Markers | Subject::MarkerOrder => Ok(self.points_px.clone()),
        }
    }

    fn polygon(&self) -> Result<Vec<Point2<f64>>, &'static str> {
        let mut polygon = self.points_px.clone();
        // A click on the first corner is a natural way to say "closed".
        if polygon.len() > 1 && polygon.first() == polygon.last() {
            polygon.pop();
        }
        if polygon.len() < 3 {
            return Err("An outline needs at least 3 points; go on, or leave with Esc.");
        }
        if crosses_itself(&polygon) {
            return Err("The outline crosses itself; take points back with Backspace.");
        }
        Ok(polygon)
    }
}

/// Whether two sides of the polygon meet elsewhere than in a common corner.
fn crosses_itself(polygon: &[Point2<f64>]) -> bool {
    let n = polygon.len();
    for i in 0..n {
        let [a, b] = side(polygon, i);
        let [_, c] = side(polygon, (i + 1) % n);
        // A side that runs back over the one before it encloses nothing.
        let along = (b - a).dot(&(c - b));
        if turn(a, b, c) == 0.0 && along < 0.0 {
            return true;
        }
        let mut others = (i + 2..n).filter(|j| (j + 1) % n != i);
        if others.any(|j| meet([a, b], side(polygon, j))) {
            return true;
        }
    }
    false
}

type Side = [Point2<f64>; 2];

fn side(polygon: &[Point2<f64>], i: usize) -> Side {
    [polygon[i], polygon[(i + 1) % polygon.len()]]
}

fn meet([a, b]: Side, [c, d]: Side) -> bool {
    let (s1, s2, s3, s4) = (turn(a, b, c), turn(a, b, d), turn(c, d, a), turn(c, d, b));
    (opposite(s1, s2) && opposite(s3, s4))
        || (s1 == 0.0 && between(a, b, c))
        || (s2 == 0.0 && between(a, b, d))
        || (s3 == 0.0 && between(c, d, a))
        || (s4 == 0.0 && between(c, d, b))
}

fn opposite(x: f64, y: f64) -> bool {
    (x > 0.0 && y < 0.0) || (x < 0.0 && y > 0.0)
}

/// Twice the signed area of a triangle; clicks lie on a grid, so a straight run rounds to nearly
/// zero.
fn turn(a: Point2<f64>, b: Point2<f64>, c: Point2<f64>) -> f64 {
    let area = (b - a).perp(&(c - a));
    if area.abs() < 1e-6 { 0.0 } else { area }
}

/// Whether `p`, known to lie on the line through `a` and `b`, lies between them.
fn between(a: Point2<f64>, b: Point2<f64>, p: Point2<f64>) -> bool {
    (0..2).all(|i| p[i] >= a[i].min(b[i]) - 1e-9 && p[i] <= a[i].max(b[i]) + 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outline_encloses_something_and_a_line_has_two_ends() {
        // Whether the points make an outline, and whether a line.
        let cases: [(&str, &[[f64; 2]], bool, bool); 11] = [
            ("nothing", &[], false, false),
            ("a point", &[[4.0, 4.0]], false, false),
            ("a point twice", &[[4.0, 4.0], [4.0, 4.0]], false, false),
            ("a line", &[[0.0, 0.0], [9.0, 9.0]], false, true),
            (
                "a triangle",
                &[[0.0, 0.0], [9.0, 0.0], [0.0, 9.0]],
                true,
                true,
            ),
            (
                "there and back",
                &[[0.0, 0.0], [9.0, 0.0], [4.0, 0.0]],
                false,
                true,
            ),
            (
                "a bow tie",
                &[[0.0, 0.0], [9.0, 9.0], [9.0, 0.0], [0.0, 9.0]],
                false,
                true,
            ),
            (
                "a straight run in a side",
                &[[0.0, 0.0], [4.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]],
                true,
                true,
            ),
            (
                "a notch",
                &[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [5.0, 2.0], [0.0, 9.0]],
                true,
                true,
            ),
            (
                "a corner on a side",
                &[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [5.0, 0.0], [0.0, 9.0]],
                false,
                true,
            ),
            (
                "closed by hand",
                &[[0.0, 0.0], [9.0, 0.0], [0.0, 9.0], [0.0, 0.0]],
                true,
                true,
            ),
        ];
        for (name, points, outline, line) in cases {
            for (subject, good) in [(Subject::Outline, outline), (Subject::Branch, line)] {
                let mut drawing = Drawing::of(subject);
                points.iter().for_each(|p| drawing.add(Point2::from(*p)));
                let finished = drawing.finish();
                assert_eq!(finished.is_ok(), good, "{name}, {subject:?}: {finished:?}");
            }
        }
    }
}

//! SVG, element by element.

use nalgebra::{Point2, Vector2};
use std::fmt::Write;

/// Wider than this is too wide for half a row.
const BROAD: f64 = 760.0;

/// Where a text stands against its place.
#[derive(Clone, Copy, Debug)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

/// A drawing that grows. Whatever is no number is left out.
pub struct Svg {
    head: String,
    body: String,
}

impl Svg {
    /// `label` is read to those who do not see it.
    pub fn new(width: f64, height: f64, label: &str) -> Self {
        // One that would be too small to read in half a row gets the whole, and can be pushed
        // sideways.
        let broad = if width > BROAD {
            format!("class=\"broad\" style=\"min-width:{width:.0}px\" ")
        } else {
            String::new()
        };
        let label = escaped(label);
        let head = format!(
            "<svg {broad}viewBox=\"0 0 {width:.0} {height:.0}\" role=\"img\" aria-label=\"{label}\">"
        );
        Self {
            head,
            body: String::new(),
        }
    }

    /// A line through points, broken where there is no number; nothing of a point that stands
    /// alone.
    pub fn path(&mut self, points: impl IntoIterator<Item = Point2<f64>>, class: &str) {
        let (mut way, mut pen) = (String::new(), false);
        for p in points {
            let (x, y) = (p.x, p.y);
            if x.is_finite() && y.is_finite() {
                // Writing to a string cannot fail.
                let _ = write!(way, "{}{x:.1} {y:.1}", if pen { "L" } else { "M" });
                pen = true;
            } else {
                pen = false;
            }
        }
        if !way.is_empty() {
            let _ = write!(self.body, "<path class=\"{class}\" d=\"{way}\"/>");
        }
    }

    pub fn line(&mut self, a: Point2<f64>, b: Point2<f64>, class: &str) {
        self.path([a, b], class);
    }

    /// A rectangle between two corners.
    pub fn rect(&mut self, a: Point2<f64>, b: Point2<f64>, class: &str) {
        let (x, y) = (a.x.min(b.x), a.y.min(b.y));
        let (w, h) = ((b.x - a.x).abs(), (b.y - a.y).abs());
        if [x, y, w, h].iter().all(|v| v.is_finite()) {
            let _ = write!(
                self.body,
                "<rect class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\"/>"
            );
        }
    }

    /// A dot; of another shape for every `kind`, so that colours alone need not tell.
    pub fn dot(&mut self, at: Point2<f64>, kind: usize, class: &str) {
        let (x, y) = (at.x, at.y);
        if !(x.is_finite() && y.is_finite()) {
            return;
        }
        let r = 3.6;
        let _ = match kind % 4 {
            0 => write!(
                self.body,
                "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r}\"/>"
            ),
            1 => write!(
                self.body,
                "<rect class=\"{class}\" x=\"{:.1}\" y=\"{:.1}\" width=\"6.4\" height=\"6.4\"/>",
                x - 3.2,
                y - 3.2
            ),
            2 => write!(
                self.body,
                "<path class=\"{class}\" d=\"M{x:.1} {:.1}L{:.1} {:.1}L{:.1} {:.1}Z\"/>",
                y - 4.4,
                x + 4.2,
                y + 3.2,
                x - 4.2,
                y + 3.2
            ),
            _ => write!(
                self.body,
                "<path class=\"{class}\" d=\"M{x:.1} {:.1}L{:.1} {y:.1}L{x:.1} {:.1}L{:.1} {y:.1}Z\"/>",
                y - 4.8,
                x + 4.8,
                y + 4.8,
                x - 4.8
            ),
        };
    }

    pub fn text(&mut self, at: Point2<f64>, anchor: Anchor, class: &str, text: &str) {
        let (x, y) = (at.x, at.y);
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        if x.is_finite() && y.is_finite() {
            let _ = write!(
                self.body,
                "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{}</text>",
                escaped(text)
            );
        }
    }

    /// A picture that lies in the page.
    pub fn image(&mut self, size: Vector2<f64>, address: &str) {
        let (w, h) = (size.x, size.y);
        let _ = write!(
            self.body,
            "<image width=\"{w:.0}\" height=\"{h:.0}\" href=\"{}\"/>",
            escaped(address)
        );
    }

    pub fn finish(self) -> String {
        format!("{}{}</svg>", self.head, self.body)
    }
}

/// Text as it stands in HTML and in its attributes; characters that steer and are no text are left
/// out.
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

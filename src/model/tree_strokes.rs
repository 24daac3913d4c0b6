//! What a user draws on a picture of a tree.

use nalgebra::Point2;

/// Lines on one tree in a picture; those that are not drawn are found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TreeStrokes {
    /// Corners of the closed line round the crown, px; none where it is not drawn.
    pub crown_px: Vec<Point2<f64>>,
    /// Lines along branches, each from its base to its tip, the trunk's first, px.
    pub branches_px: Vec<Vec<Point2<f64>>>,
}

impl TreeStrokes {
    /// Whether nothing is drawn.
    pub fn is_empty(&self) -> bool {
        self.crown_px.is_empty() && self.branches_px.is_empty()
    }

    /// The same in a picture whose sides are `scale` times as long.
    pub fn scaled(&self, scale: f64) -> Self {
        let branches = self.branches_px.iter();
        Self {
            crown_px: scaled(&self.crown_px, scale),
            branches_px: branches.map(|line| scaled(line, scale)).collect(),
        }
    }
}

/// The same places in a picture whose sides are `scale` times as long, px. Places are counted from the
/// middle of the first pixel, and pictures from its corner.
pub fn scaled(line: &[Point2<f64>], scale: f64) -> Vec<Point2<f64>> {
    let places = line.iter().map(|at| at.map(|x| (x + 0.5) * scale - 0.5));
    places.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four pixels become one: the middle of the four is the middle of the one.
    #[test]
    fn the_middle_of_a_picture_stays_there() {
        let half = scaled(&[Point2::new(0.5, 0.5), Point2::new(-0.5, 3.5)], 0.5);
        assert_eq!(half, [Point2::new(0.0, 0.0), Point2::new(-0.5, 1.5)]);
    }
}

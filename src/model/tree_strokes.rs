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
        let scaled = |line: &Vec<Point2<f64>>| line.iter().map(|at| at * scale).collect();
        Self {
            crown_px: scaled(&self.crown_px),
            branches_px: self.branches_px.iter().map(scaled).collect(),
        }
    }
}

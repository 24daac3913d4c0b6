//! What a person at the terminal can ask of a running capture.

use nalgebra::Point2;

/// One wish; it is honoured before the next frame is taken.
#[derive(Clone, Debug, PartialEq)]
pub enum Control {
    /// Use this polygon (px, at least three points) as the outline and start again from here.
    SetOutline(Vec<Point2<f64>>),
    /// A line along a branch (px, at least two points), beside those that there are: from now on
    /// the wood is looked for with it. Points and tree are kept.
    AddStroke(Vec<Point2<f64>>),
    /// Do without the line along a branch that came last.
    TakeBackStroke,
    /// Follow the coloured markers at these places, px, from the next frame on.
    PickMarkers(Vec<Point2<f64>>),
    /// The markers nearest to these places, px, hang on each other in this order, the first nearest to the foot.
    HangMarkers(Vec<Point2<f64>>),
    /// Build the tree from the motion seen so far.
    BuildNow,
    /// Forget tracks and tree, keep the outline rule, start again.
    Restart,
    /// Write the capture as it is now, and go on.
    Export,
    /// Stop or go on taking frames; a camera goes on filming and its frames are dropped and
    /// counted.
    Pause(bool),
    /// Finish: write the capture and end.
    Quit,
}

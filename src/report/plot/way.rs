//! Where the end of a branch went (Hu et al. fig. 3).

use super::HEIGHT;
use super::axes::{Axes, range};
use super::svg::Svg;
use crate::bounds::Bounds;
use crate::report::study::{Branch, Study};
use nalgebra::{Point2, Vector2};

/// Frames that stand out: as many as in the paper's figure.
const FIRST: usize = 80;
/// Points of the whole way at most.
const MOST: usize = 2500;
/// Narrower than the others: it is about as high as wide.
const WIDTH: f64 = 300.0;

/// The whole way, and that of the first frames from the release, or the begin of the film, on;
/// `None` without poses.
pub fn way(study: &Study, branch: &Branch) -> Option<String> {
    let [x, y] = [0, 1].map(|c| range(branch.way_px.iter().map(|p| p[c])));
    if !(x.lo.is_finite() && y.lo.is_finite()) {
        return None;
    }
    let mut svg = Svg::new(
        WIDTH,
        HEIGHT,
        &format!("Way of the end of branch {}", branch.name),
    );
    let axes = Axes::even(Vector2::new(WIDTH, HEIGHT), widened(x), widened(y));
    axes.draw(&mut svg, "to the right, px", "up, px");
    let every = branch.way_px.len().div_ceil(MOST).max(1);
    let way: Vec<Point2<f64>> = branch
        .way_px
        .iter()
        .map(|p| Point2::new(axes.x(p.x), axes.y(p.y)))
        .collect();
    svg.path(way.iter().copied().step_by(every), "way");
    let begin_s = study.onset.map_or(study.span_s.lo, |o| o.at_s);
    let first = branch
        .times_s
        .iter()
        .position(|t| *t >= begin_s)
        .unwrap_or(0);
    svg.path(way.into_iter().skip(first).take(FIRST), "first");
    Some(svg.finish())
}

/// A range with some room on either side.
fn widened(range: Bounds) -> Bounds {
    let room = 0.06 * range.length();
    Bounds::new(range.lo - room, range.hi + room)
}

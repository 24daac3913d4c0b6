//! Where the end of a branch went (Hu et al. fig. 3).

use super::HEIGHT;
use super::axes::{Axes, range};
use super::svg::Svg;
use crate::report::study::{Branch, Study};

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
    if !(x[0].is_finite() && y[0].is_finite()) {
        return None;
    }
    let wide = |[lo, hi]: [f64; 2]| [lo - 0.06 * (hi - lo), hi + 0.06 * (hi - lo)];
    let mut svg = Svg::new(
        WIDTH,
        HEIGHT,
        &format!("Way of the end of branch {}", branch.name),
    );
    let axes = Axes::even([WIDTH, HEIGHT], wide(x), wide(y));
    axes.draw(&mut svg, "to the right, px", "up, px");
    let every = branch.way_px.len().div_ceil(MOST).max(1);
    let at = |p: &[f64; 2]| [axes.x(p[0]), axes.y(p[1])];
    svg.path(branch.way_px.iter().step_by(every).map(at), "way");
    let begin_s = study.onset.map_or(study.span_s[0], |o| o.at_s);
    let first = branch
        .times_s
        .iter()
        .position(|t| *t >= begin_s)
        .unwrap_or(0);
    svg.path(
        branch.way_px.iter().skip(first).take(FIRST).map(at),
        "first",
    );
    Some(svg.finish())
}

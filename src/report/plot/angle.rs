//! The angle of a branch to the one that carries it over time (Hu et al. fig. 6).

use super::axes::{Axes, range, thinned};
use super::svg::Svg;
use super::{HEIGHT, WIDTH};
use crate::report::study::{Branch, Study};

/// Points of a curve at most.
const MOST: usize = 900;

/// The angle in the picture's plane and in space, and what a free decay of the branch's own would
/// be; `None` without poses.
pub fn angle(study: &Study, branch: &Branch) -> Option<String> {
    let fitted = branch.fitted_deg.as_deref().unwrap_or_default();
    let values = branch
        .plane_deg
        .iter()
        .chain(&branch.space_deg)
        .chain(fitted)
        .copied();
    let [lo, hi] = range(values);
    if !(lo.is_finite() && hi.is_finite()) {
        return None;
    }
    let room = 0.12 * (hi - lo);
    let mut svg = Svg::new(
        WIDTH,
        HEIGHT,
        &format!("Angle of branch {} over time", branch.name),
    );
    let axes = Axes::new([WIDTH, HEIGHT], study.span_s, [lo - room, hi + 2.0 * room]);
    if let Some(onset) = study.onset {
        // What comes before the release, after all has died down, or from the next pull on tells
        // nothing of the sway.
        let [left, right] = axes.sides();
        let at = |t: f64| axes.x(t.clamp(study.span_s[0], study.span_s[1]));
        svg.rect(
            [left, axes.top()],
            [at(onset.at_s), axes.bottom()],
            "unused",
        );
        svg.rect(
            [at(study.used_s[1]), axes.top()],
            [right, axes.bottom()],
            "unused",
        );
    }
    axes.draw(&mut svg, "time, s", "degrees");
    let mut curve = |angles: &[f64], class: &str| {
        let points: Vec<[f64; 2]> = branch
            .times_s
            .iter()
            .zip(angles)
            .map(|(t, a)| [*t, *a])
            .collect();
        svg.path(
            thinned(&points, MOST)
                .into_iter()
                .map(|[t, a]| axes.at(t, a)),
            class,
        );
    };
    curve(&branch.space_deg, "space");
    curve(&branch.plane_deg, "plane");
    curve(fitted, "fitted");
    Some(svg.finish())
}

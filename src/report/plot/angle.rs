//! The angle of a branch to the one that carries it over time (Hu et al. fig. 6).

use super::axes::{Axes, range, thinned};
use super::svg::Svg;
use super::{HEIGHT, WIDTH};
use crate::bounds::Bounds;
use crate::report::study::{Branch, Study};
use nalgebra::{Point2, Vector2};

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
    let Bounds { lo, hi } = range(values);
    if !(lo.is_finite() && hi.is_finite()) {
        return None;
    }
    let room = 0.12 * (hi - lo);
    let mut svg = Svg::new(
        WIDTH,
        HEIGHT,
        &format!("Angle of branch {} over time", branch.name),
    );
    let axes = Axes::new(
        Vector2::new(WIDTH, HEIGHT),
        study.span_s,
        Bounds::new(lo - room, hi + 2.0 * room),
    );
    if let Some(onset) = study.onset {
        // What comes before the release, after all has died down, or from the next pull on tells
        // nothing of the sway.
        let sides = axes.sides();
        let [from, to] = [onset.at_s, study.used_s.hi].map(|t| axes.x(study.span_s.clamp(t)));
        svg.rect(
            Point2::new(sides.lo, axes.top()),
            Point2::new(from, axes.bottom()),
            "unused",
        );
        svg.rect(
            Point2::new(to, axes.top()),
            Point2::new(sides.hi, axes.bottom()),
            "unused",
        );
    }
    axes.draw(&mut svg, "time, s", "degrees");
    let curves = [
        (branch.space_deg.as_slice(), "space"),
        (&branch.plane_deg, "plane"),
        (fitted, "fitted"),
    ];
    for (angles, class) in curves {
        let points = branch
            .times_s
            .iter()
            .zip(angles)
            .map(|(t, a)| Point2::new(*t, *a));
        let points = thinned(&points.collect::<Vec<_>>(), MOST);
        svg.path(points.into_iter().map(|p| axes.at(p)), class);
    }
    Some(svg.finish())
}

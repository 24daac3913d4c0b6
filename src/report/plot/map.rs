//! The tree in the picture, with the numbers of its branches.

use super::labels::{Wanted, placed};
use super::svg::{Anchor, Svg};
use crate::report::study::{Branch, Study};
use nalgebra::{Point2, Vector2};

/// The picture's longer side in the drawing: letters of the page's size can then be read on it.
const SIDE: f64 = 720.0;
/// Sizes of the numbers in the drawing, of branches with an answer and of others; on a phone only
/// the first are shown, larger. As in the page's style sheet.
const TOLD: f64 = 15.0;
const TOLD_ON_PHONE: f64 = 22.0;
const UNTOLD: f64 = 13.0;
/// How far from the branch's end a number may be, of the ones and of the others.
const FARTHEST: f64 = 105.0;
const FARTHEST_OF_OTHERS: f64 = 45.0;

/// The drawing, and the branches for whose numbers it has no room.
pub struct Map {
    pub svg: String,
    pub unnamed: Vec<u32>,
}

/// Every branch from where it begins to where it ends, those with a frequency drawn in another way.
pub fn map(study: &Study) -> Map {
    let [w, h] = study.size.map(|s| f64::from(s.max(1)));
    let scale = SIDE / w.max(h);
    let size = Vector2::new(w * scale, h * scale);
    let label = format!(
        "The tree of {} with the numbers of its branches",
        study.name
    );
    let mut svg = Svg::new(size.x, size.y, &label);
    background(&mut svg, study, scale, size);
    let lines: Vec<[Point2<f64>; 2]> = study
        .branches
        .iter()
        .map(|b| [b.base_from_foot_px, b.tip_from_foot_px].map(|p| in_drawing(study, scale, p)))
        .collect();
    // Those with an answer lie above the others.
    let mut lowest_first: Vec<usize> = (0..lines.len()).collect();
    lowest_first.sort_by_key(|&k| study.branches[k].sway.is_ok());
    for &k in &lowest_first {
        let [base, tip] = lines[k];
        svg.line(base, tip, class(&study.branches[k]));
    }
    // Here they come first: where it is crowded, their numbers are the ones that are read.
    let mut named: Vec<usize> = (0..lines.len()).collect();
    named.sort_by_key(|&k| study.branches[k].sway.is_err());
    let wanted: Vec<Wanted> = named
        .iter()
        .map(|&k| wanted(&study.branches[k], lines[k]))
        .collect();
    let places = placed(&wanted, &lines, size);
    for (&k, place) in named.iter().zip(&places) {
        if let Some([from, to]) = place.and_then(|p| p.leader) {
            let class = class(&study.branches[k]);
            svg.line(from, to, &format!("{class} leader"));
        }
    }
    for &k in &lowest_first {
        let class = class(&study.branches[k]);
        svg.dot(lines[k][1], 0, &format!("{class} end"));
    }
    let mut unnamed = Vec::new();
    for (&k, place) in named.iter().zip(&places) {
        let branch = &study.branches[k];
        let Some(place) = place else {
            unnamed.push(branch.name);
            continue;
        };
        let class = format!("{} name", class(branch));
        svg.text(place.at, Anchor::Middle, &class, &branch.name.to_string());
    }
    unnamed.sort_unstable();
    Map {
        svg: svg.finish(),
        unnamed,
    }
}

/// The picture, if there is one, and the outline.
fn background(svg: &mut Svg, study: &Study, scale: f64, size: Vector2<f64>) {
    if let Some(picture) = &study.picture {
        svg.image(size, picture);
        svg.rect(Point2::origin(), size.into(), "veil");
    }
    let corners = study.outline_px.iter();
    let mut outline: Vec<Point2<f64>> = corners.map(|p| p.map(|x| f64::from(x) * scale)).collect();
    outline.extend(outline.first().copied());
    svg.path(outline, "outline");
}

/// A place from the foot, px to the right and up, in a drawing of this scale.
fn in_drawing(study: &Study, scale: f64, p: Point2<f64>) -> Point2<f64> {
    Point2::new(
        (study.foot_px.x + p.x) * scale,
        (study.foot_px.y - p.y) * scale,
    )
}

fn class(branch: &Branch) -> &'static str {
    if branch.sway.is_ok() {
        "told"
    } else {
        "untold"
    }
}

fn wanted(branch: &Branch, [from, at]: [Point2<f64>; 2]) -> Wanted {
    let letters = branch.name.to_string().len();
    match branch.sway {
        Ok(_) => Wanted {
            at,
            from,
            letters,
            size: TOLD,
            size_on_small: Some(TOLD_ON_PHONE),
            farthest: FARTHEST,
        },
        Err(_) => Wanted {
            at,
            from,
            letters,
            size: UNTOLD,
            size_on_small: None,
            farthest: FARTHEST_OF_OTHERS,
        },
    }
}

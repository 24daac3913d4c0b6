//! The tree in the picture, with the numbers of its branches.

use super::svg::{Anchor, Svg};
use crate::report::study::Study;

/// The picture's longer side in the drawing: letters of the page's size can then be read on it.
const SIDE: f64 = 720.0;
/// Numbers are not written nearer to each other than this.
const APART: [f64; 2] = [20.0, 12.0];

/// Every branch from where it begins to where it ends; which have a frequency is told by how they are drawn.
pub fn map(study: &Study) -> String {
    let [w, h] = study.size.map(|s| f64::from(s.max(1)));
    let scale = SIDE / w.max(h);
    let label = format!("The tree of {} with the numbers of its branches", study.name);
    let mut svg = Svg::new(w * scale, h * scale, &label);
    if let Some(picture) = &study.picture {
        svg.image([w * scale, h * scale], picture);
        svg.rect([0.0, 0.0], [w * scale, h * scale], "veil");
    }
    let mut outline: Vec<[f64; 2]> = study.outline_px.iter().map(|p| p.map(|x| f64::from(x) * scale)).collect();
    outline.extend(outline.first().copied());
    svg.path(outline, "outline");
    let at = |p: [f64; 2]| [(study.foot_px[0] + p[0]) * scale, (study.foot_px[1] - p[1]) * scale];
    for answered in [false, true] {
        let class = if answered { "told" } else { "untold" };
        for b in study.branches.iter().filter(|b| b.sway.is_ok() == answered) {
            svg.line(at(b.base), at(b.tip), class);
        }
    }
    // Those with an answer first: where it is crowded, their numbers are the ones that are read.
    let mut written: Vec<[f64; 2]> = Vec::new();
    for answered in [true, false] {
        for b in study.branches.iter().filter(|b| b.sway.is_ok() == answered) {
            let class = if answered { "told" } else { "untold" };
            let [x, y] = at(b.tip);
            svg.dot([x, y], 0, &format!("{class} end"));
            let place = [[6.0, -5.0], [6.0, 12.0], [-6.0, -5.0], [-6.0, 12.0], [6.0, 3.5], [-6.0, 3.5]]
                .into_iter()
                .find_map(|[dx, dy]| {
                    let centre = [x + dx + 8.0 * f64::signum(dx), y + dy];
                    let free = written
                        .iter()
                        .all(|p| (p[0] - centre[0]).abs() > APART[0] || (p[1] - centre[1]).abs() > APART[1]);
                    free.then_some((centre, [x + dx, y + dy], dx > 0.0))
                });
            if let Some((centre, place, right)) = place {
                written.push(centre);
                let anchor = if right { Anchor::Start } else { Anchor::End };
                svg.text(place, anchor, &format!("{class} name"), &b.name.to_string());
            }
        }
    }
    svg.finish()
}

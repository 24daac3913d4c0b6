//! The tree in the picture, with the numbers of its branches.

use super::labels::{Wanted, placed};
use super::svg::{Anchor, Svg};
use crate::report::study::{Branch, Study};

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

/// Every branch from where it begins to where it ends; which have a frequency is told by how they
/// are drawn.
pub fn map(study: &Study) -> Map {
    let [w, h] = study.size.map(|s| f64::from(s.max(1)));
    let scale = SIDE / w.max(h);
    let size = [w * scale, h * scale];
    let label = format!(
        "The tree of {} with the numbers of its branches",
        study.name
    );
    let mut svg = Svg::new(size[0], size[1], &label);
    if let Some(picture) = &study.picture {
        svg.image(size, picture);
        svg.rect([0.0, 0.0], size, "veil");
    }
    let mut outline: Vec<[f64; 2]> = study
        .outline_px
        .iter()
        .map(|p| p.map(|x| f64::from(x) * scale))
        .collect();
    outline.extend(outline.first().copied());
    svg.path(outline, "outline");
    let at = |p: [f64; 2]| {
        [
            (study.foot_px[0] + p[0]) * scale,
            (study.foot_px[1] - p[1]) * scale,
        ]
    };
    let class = |b: &Branch| if b.sway.is_ok() { "told" } else { "untold" };
    // Those with an answer lie above the others.
    let lowest_first = || {
        [false, true]
            .into_iter()
            .flat_map(|ok| study.branches.iter().filter(move |b| b.sway.is_ok() == ok))
    };
    lowest_first().for_each(|b| svg.line(at(b.base), at(b.tip), class(b)));
    // They come first: where it is crowded, their numbers are the ones that are read.
    let (told, others): (Vec<&Branch>, Vec<&Branch>) =
        study.branches.iter().partition(|b| b.sway.is_ok());
    let named: Vec<&Branch> = told.into_iter().chain(others).collect();
    let wanted: Vec<Wanted> = named
        .iter()
        .map(|b| wanted(b, at(b.tip), at(b.base)))
        .collect();
    let lines: Vec<[[f64; 2]; 2]> = study
        .branches
        .iter()
        .map(|b| [at(b.base), at(b.tip)])
        .collect();
    let places = placed(&wanted, &lines, size);
    for (b, place) in named.iter().zip(&places) {
        if let Some([from, to]) = place.and_then(|p| p.leader) {
            svg.line(from, to, &format!("{} leader", class(b)));
        }
    }
    lowest_first().for_each(|b| svg.dot(at(b.tip), 0, &format!("{} end", class(b))));
    let mut unnamed = Vec::new();
    for (b, place) in named.iter().zip(&places) {
        match place {
            Some(p) => svg.text(
                p.at,
                Anchor::Middle,
                &format!("{} name", class(b)),
                &b.name.to_string(),
            ),
            None => unnamed.push(b.name),
        }
    }
    unnamed.sort_unstable();
    Map {
        svg: svg.finish(),
        unnamed,
    }
}

fn wanted(branch: &Branch, at: [f64; 2], from: [f64; 2]) -> Wanted {
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

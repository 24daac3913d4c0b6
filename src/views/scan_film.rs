//! The film of a tree laid on its scan.

use super::film_fit::{FilmFit, Grounds, Upright};
use super::film_lines::FilmPiece;
use crate::cloud::{CloudTree, PlacePair, WoodPiece, by_lines, by_pairs, odd_pair};
use crate::document::Document;
use crate::model::{Excitation, NodeId, Skeleton};
use nalgebra::{Point2, Point3};

/// How a film lies on a scan; `None` where there is nothing to compare. It is to be asked whether
/// it [`holds`](FilmFit::holds). `pairs` are places that a user has found in both: in the film
/// with v down, in the scan against the foot of `tree`.
pub fn register_film(
    tree: &CloudTree,
    film: &Document,
    pairs: Option<&[PlacePair]>,
) -> Option<FilmFit> {
    let pieces = film_wood(&film.skeleton);
    let wood: Vec<WoodPiece<Point2<f64>>> = pieces.iter().map(|p| p.wood).collect();
    let (scan, upright) = (scan_wood(tree), upright_in_wind(film));
    let Some(pairs) = pairs else {
        let found = by_lines(&wood, &scan)?;
        return FilmFit::by_lines(found, &pieces, &scan, upright);
    };
    let height_px = height_px(&film.skeleton);
    let pairs = from_foot(pairs, &film.skeleton);
    let found = by_pairs(&pairs, height_px)?;
    // Three pairs are six numbers for five unknowns; lines say more, and how sure it is. Where the pairs
    // are from a tree in wind they may lead to another side of it.
    let finer = |start| FilmFit::by_lines(start, &pieces, &scan, upright).filter(FilmFit::holds);
    let agrees = |fit: &FilmFit| fit.registration.agrees_with(&pairs, height_px);
    if let Some(fit) = finer(found).filter(agrees) {
        return Some(fit);
    }
    if let Some(fit) = by_lines(&wood, &scan).and_then(finer) {
        let grounds = match agrees(&fit) {
            true => Grounds::Lines,
            false => Grounds::LinesAgainstPairs,
        };
        return Some(FilmFit { grounds, ..fit });
    }
    FilmFit::by_pairs(found, &pairs, &pieces, &scan, upright.is_some())
}

/// Which of the pairs does not fit the others, where one alone does not.
pub fn odd_pair_of(film: &Document, pairs: &[PlacePair]) -> Option<usize> {
    let pairs = from_foot(pairs, &film.skeleton);
    odd_pair(&pairs, height_px(&film.skeleton))
}

/// Height of what was filmed, px.
fn height_px(film: &Skeleton) -> f64 {
    let measured = &film.nodes[..film.measured()];
    measured.iter().map(|n| n.position.y).fold(0.0, f64::max)
}

/// The pairs with the places in the film against its foot, y up.
fn from_foot(pairs: &[PlacePair], film: &Skeleton) -> Vec<PlacePair> {
    let foot_px = film.foot_px;
    let mut out = Vec::with_capacity(pairs.len());
    for pair in pairs {
        let [right, down] = [pair.film_px.x - foot_px.x, pair.film_px.y - foot_px.y];
        out.push(PlacePair {
            film_px: Point2::new(right, -down),
            scan: pair.scan,
        });
    }
    out
}

/// What is known of the upright in a film in wind; `None` for a film of a release, in which the tree
/// comes to rest upright.
fn upright_in_wind(film: &Document) -> Option<Upright> {
    let swaying = film.sway.iter().flatten();
    let is_wind = swaying.map(|s| s.excitation).any(|e| e == Excitation::Wind);
    let upright = match &film.note.tag {
        Some(tag) => Upright::Tag {
            roll_deg: tag.roll_deg,
            sd_deg: tag.roll_sd_deg,
        },
        None => Upright::Camera,
    };
    is_wind.then_some(upright)
}

/// The wood that was filmed, in the picture's plane, the foot at the origin; copies were not.
fn film_wood(skeleton: &Skeleton) -> Vec<FilmPiece> {
    let names = skeleton.botanical_branches();
    let mut pieces = Vec::new();
    for (k, node) in skeleton.nodes[..skeleton.measured()].iter().enumerate() {
        if let Some(parent) = node.parent {
            let wood = WoodPiece {
                from: skeleton.nodes[parent.index()].position.xy(),
                to: node.position.xy(),
                radius: node.radius,
            };
            let branch = names.of(NodeId(k as u32));
            pieces.push(FilmPiece { wood, branch });
        }
    }
    pieces
}

/// The wood of a scan, m, z up, the foot at the origin.
fn scan_wood(tree: &CloudTree) -> Vec<WoodPiece<Point3<f64>>> {
    let foot = tree.nodes.first().map_or(Point3::origin(), |n| n.position);
    let mut pieces = Vec::new();
    for node in &tree.nodes {
        if let Some(parent) = node.parent {
            let [from, to] =
                [tree.nodes[parent].position, node.position].map(|at| Point3::from(at - foot));
            pieces.push(WoodPiece {
                from,
                to,
                radius: node.radius,
            });
        }
    }
    pieces
}

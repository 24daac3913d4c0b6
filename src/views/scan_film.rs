//! The film of a tree laid on its scan: the sway that was filmed, on the wood that was scanned.

use super::film_fit::{FilmFit, FilmPiece, Upright};
use crate::cloud::{CloudTree, PlacePair, Registration, WoodPiece, by_lines, by_pairs};
use crate::document::Document;
use crate::model::{Excitation, NodeId, Skeleton, Swaying, Unidentified};
use nalgebra::{Point2, Point3, Vector2};
use std::collections::BTreeMap;

/// A scanned branch is a filmed one if it lies no farther from its line than this share of the
/// tree's height, and is as thick to that; a right angle between them counts as so far.
const FARTHEST_SHARE: f64 = 0.025;
const ACROSS_SHARE: f64 = 0.05;
/// Samples of a branch.
const SAMPLES: usize = 12;

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
    let Some(pairs) = pairs else {
        let scan = scan_wood(tree);
        let found = by_lines(&wood, &scan)?;
        return FilmFit::by_lines(found, &pieces, &scan, upright_in_wind(film));
    };
    let height_px = wood.iter().map(|p| p.to.y).fold(0.0, f64::max);
    let foot_px = film.skeleton.foot_px;
    let upright = |p: &PlacePair| PlacePair {
        film_px: Point2::new(p.film_px.x - foot_px.x, foot_px.y - p.film_px.y),
        scan: p.scan,
    };
    let pairs: Vec<PlacePair> = pairs.iter().map(upright).collect();
    by_pairs(&pairs, height_px).map(FilmFit::by_pairs)
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

/// The sway of a film on the branches of a scanned tree, by node index. Each filmed branch is given
/// to the pieces of one scanned branch: of those that lie on it the one with most wood. What
/// nothing was filmed on is not measured.
pub fn sway_on_scan(
    scan: &Skeleton,
    metres_per_px: f64,
    film: &Document,
    registration: &Registration,
) -> Vec<Swaying> {
    let project = |at: &Point3<f64>| {
        registration.project(&Point3::new(
            at.x * metres_per_px,
            -at.z * metres_per_px,
            at.y * metres_per_px,
        ))
    };
    let height_px = film_wood(&film.skeleton)
        .iter()
        .map(|p| p.wood.to.y)
        .fold(0.0, f64::max);
    let filmed: Vec<NodeId> = film.skeleton.measured_branches().collect();
    let film_lines: Vec<Vec<Sample>> = filmed
        .iter()
        .map(|n| line(&film.skeleton, *n, |at| at.xy()))
        .collect();
    let names = scan.botanical_branches();
    // Of each filmed branch, by scanned branch: the pieces that lie on it, and how much wood that
    // is.
    let mut found: Vec<BTreeMap<String, Pieces>> = vec![BTreeMap::new(); filmed.len()];
    for piece in scan.measured_branches() {
        let own = line(scan, piece, project);
        let radius = scan.nodes[piece.index()].radius;
        let radius_px = radius * metres_per_px * registration.to_picture.scaling();
        let offs = filmed.iter().zip(&film_lines).map(|(branch, line)| {
            let thicker_px = film.skeleton.nodes[branch.index()].radius - radius_px;
            mean_off(&own, line, ACROSS_SHARE * height_px).hypot(thicker_px)
        });
        let nearest = offs.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((branch, _)) = nearest.filter(|(_, off)| *off <= FARTHEST_SHARE * height_px)
        else {
            continue;
        };
        let pieces = found[branch].entry(names.name(piece)).or_default();
        pieces.wood += length(&own) * radius * radius;
        pieces.nodes.push(piece);
    }
    let mut sway = vec![Err(Unidentified::NotMeasured); scan.nodes.len()];
    for (branch, by_name) in filmed.iter().zip(&found) {
        let Some(own) = film.sway.get(branch.index()).filter(|s| s.is_ok()) else {
            continue;
        };
        let most = by_name.values().max_by(|a, b| a.wood.total_cmp(&b.wood));
        for node in most.into_iter().flat_map(|pieces| &pieces.nodes) {
            sway[node.index()] = *own;
        }
    }
    sway
}

/// Pieces of one scanned branch.
#[derive(Clone, Debug, Default)]
struct Pieces {
    nodes: Vec<NodeId>,
    /// Sum of length and radius squared.
    wood: f64,
}

/// A place on a line, and the way to the next.
#[derive(Clone, Copy, Debug)]
struct Sample {
    at: Point2<f64>,
    way: Vector2<f64>,
}

/// Samples of the branch that ends in a node, from where it begins.
fn line(
    skeleton: &Skeleton,
    node: NodeId,
    project: impl Fn(&Point3<f64>) -> Point2<f64>,
) -> Vec<Sample> {
    let begin = skeleton.begin(node);
    let mut nodes: Vec<NodeId> = vec![node];
    nodes.extend(skeleton.ancestors(node).take_while(|n| Some(*n) != begin));
    nodes.extend(begin);
    nodes.reverse();
    let places: Vec<Point2<f64>> = nodes
        .iter()
        .map(|n| project(&skeleton.nodes[n.index()].position))
        .collect();
    let total: f64 = places.windows(2).map(|p| (p[1] - p[0]).norm()).sum();
    let mut samples = Vec::new();
    for ends in places.windows(2) {
        let way = ends[1] - ends[0];
        let count = (SAMPLES as f64 * way.norm() / total.max(1e-9)).ceil() as usize;
        let step = way / count.max(1) as f64;
        samples.extend((0..count).map(|k| Sample {
            at: ends[0] + step * (k as f64 + 0.5),
            way: step,
        }));
    }
    samples
}

fn length(line: &[Sample]) -> f64 {
    line.iter().map(|s| s.way.norm()).sum()
}

/// The mean distance of a line from another, in place and direction; infinite where one of them is
/// empty.
fn mean_off(line: &[Sample], other: &[Sample], across: f64) -> f64 {
    let mut sum = 0.0;
    for own in line {
        let offs = other.iter().map(|o| {
            let turn = own.way.perp(&o.way) / (own.way.norm() * o.way.norm()).max(1e-12);
            (own.at - o.at).norm_squared() + (across * turn).powi(2)
        });
        sum += offs.fold(f64::INFINITY, f64::min).sqrt();
    }
    if line.is_empty() {
        f64::INFINITY
    } else {
        sum / line.len() as f64
    }
}

//! The sway that was filmed, on the wood that was scanned.
//!
//! Each followed point is on the scanned wood that the camera sees there. A filmed branch is the scanned
//! one that most of its points are on; the points of what it carries count with it, on both sides.

use crate::bounds::Bounds;
use crate::cloud::{LinePlace, Registration, WoodPiece};
use crate::document::note::LaidBranch;
use crate::document::{Document, DocumentError};
use crate::model::{BotanicalBranches, NodeId, Skeleton, Swaying, Unidentified};
use crate::signal::distance_to_segment;
use nalgebra::{Point2, Point3};
use std::collections::BTreeMap;

/// A point is on no wood whose bark is farther off in the picture than this share of the tree's
/// height: a registration is not off by more.
const FARTHEST_POINT_SHARE: f64 = 0.02;
/// Bark that is farther off by no more than this share of the height may be the one it is on as well; the
/// one nearest to the camera hides the others. About a pixel, by which points are off.
const UNSURE_SHARE: f64 = 0.005;
/// This share of the points of a branch, and of what it carries, is on its scanned branch and on what
/// that carries.
const LEAST_POINTS_SHARE: f64 = 0.6;
/// A piece of a scanned branch lies no farther from the filmed one than this share of the height; a right
/// angle between them counts as the second one.
const FARTHEST_SHARE: f64 = 0.04;
const ACROSS_SHARE: f64 = 0.05;
/// Places on a branch at which that is looked at.
const PLACES: f64 = 12.0;

/// A point that was followed in a film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmedPoint {
    /// The deepest node that it belongs to.
    pub node: NodeId,
    /// The middle of its motion, px, v down.
    pub at_px: Point2<f64>,
}

/// The points of the film that its sway rests on.
///
/// # Errors
/// The tracks of the film are missing or damaged.
pub fn filmed_points(film: &Document) -> Result<Vec<FilmedPoint>, DocumentError> {
    let window_s = film.note.config.dynamics.window_s;
    let tracked = film.tracked_within(window_s, Bounds::new(0.0, f64::INFINITY))?;
    let mut points = Vec::with_capacity(tracked.tracks.len());
    for track in &tracked.tracks {
        let node = track.node;
        points.extend(track.middle_px().map(|at_px| FilmedPoint { node, at_px }));
    }
    Ok(points)
}

/// The sway of a film on the branches of a scanned tree.
#[derive(Clone, Debug)]
pub struct ScanSway {
    /// By node index of the scan.
    pub sway: Vec<Swaying>,
    /// Pieces of filmed branches with a frequency, and the scanned branches that were given it.
    pub laid: Vec<LaidBranch>,
}

/// Puts the sway of a film on a scanned tree. `points` are those of the film.
/// Each filmed branch is given to the pieces of its scanned branch that lie on it. What nothing was
/// filmed on is not measured.
pub fn sway_on_scan(
    scan: &Skeleton,
    metres_per_px: f64,
    film: &Document,
    points: &[FilmedPoint],
    registration: &Registration,
) -> ScanSway {
    let seen = SeenScan {
        registration,
        metres_per_px,
    };
    let tops = film.skeleton.nodes.iter().map(|n| n.position.y);
    let height_px = tops.fold(0.0, f64::max);
    let names = scan.botanical_branches();
    let wood = seen.wood(scan);
    let mut votes: Vec<Votes> = vec![Votes::default(); film.skeleton.nodes.len()];
    let foot_px = film.skeleton.foot_px;
    for point in points {
        let at = Point2::new(point.at_px.x - foot_px.x, foot_px.y - point.at_px.y);
        if let Some(node) = node_seen_at(&wood, &at, height_px) {
            let own = film.skeleton.mover(point.node);
            let below = film.skeleton.carriers(own);
            for branch in std::iter::once(own).chain(below) {
                votes[branch.index()].add(&names, names.of(node));
            }
        }
    }
    let (mut trunks, mut filmed) = (Vec::new(), BTreeMap::<usize, Vec<FilmedBranch>>::new());
    for node in film.skeleton.measured_branches() {
        let line = line(&film.skeleton, node, |at| at.xy());
        let own = FilmedBranch { node, line };
        if begins_at_foot(&film.skeleton, node) {
            trunks.push(own.clone());
        }
        if let Some(branch) = votes[node.index()].branch(&names) {
            filmed.entry(branch).or_default().push(own);
        }
    }
    let mut sway = vec![Err(Unidentified::NotMeasured); scan.nodes.len()];
    let mut laid = BTreeMap::<NodeId, Vec<String>>::new();
    for node in film.skeleton.measured_branches() {
        if film.sway.get(node.index()).is_some_and(Result::is_ok) {
            laid.insert(node, Vec::new());
        }
    }
    for piece in scan.measured_branches() {
        let own = line(scan, piece, |at| seen.project(at));
        // Most points of all may be on a bough in which the filmed trunk goes on.
        let on_it = match begins_at_foot(scan, piece) {
            true => Some(&trunks),
            false => filmed.get(&names.of(piece)),
        };
        let offs = on_it
            .into_iter()
            .flatten()
            .map(|f| (f.node, mean_off(&own, &f.line, ACROSS_SHARE * height_px)));
        let nearest = offs.min_by(|a, b| a.1.total_cmp(&b.1));
        let lies = nearest.filter(|(_, off)| *off <= FARTHEST_SHARE * height_px);
        if let Some((node, _)) = lies
            && let Some(on) = laid.get_mut(&node)
        {
            sway[piece.index()] = film.sway[node.index()];
            let name = names.name(piece);
            if !on.contains(&name) {
                on.push(name);
            }
        }
    }
    let film_names = film.skeleton.botanical_branches().piece_names();
    let mut named = Vec::with_capacity(laid.len());
    for (node, scan) in laid {
        let film = film_names[node.index()].clone();
        named.push(LaidBranch { film, scan });
    }
    ScanSway { sway, laid: named }
}

/// Whether the branch that ends in a node begins at the foot.
fn begins_at_foot(skeleton: &Skeleton, node: NodeId) -> bool {
    let begin = skeleton.begin(node);
    begin.is_some_and(|begin| skeleton.nodes[begin.index()].parent.is_none())
}

/// A branch of the film that is known in the scan.
#[derive(Clone)]
struct FilmedBranch {
    node: NodeId,
    line: Vec<LinePlace>,
}

/// A scanned tree in the picture of a film.
struct SeenScan<'a> {
    registration: &'a Registration,
    /// Of the scanned skeleton.
    metres_per_px: f64,
}

/// Scanned wood in the picture, px, y up, the foot at the origin.
struct SeenPiece {
    node: NodeId,
    from: Point2<f64>,
    to: Point2<f64>,
    radius: f64,
    /// How far the bark that faces the camera is behind the foot.
    depth: f64,
}

impl SeenScan<'_> {
    /// From the axes of the scanned skeleton to those of its cloud, m, z up.
    fn in_cloud(&self, at: &Point3<f64>) -> Point3<f64> {
        Point3::new(at.x, -at.z, at.y) * self.metres_per_px
    }

    fn project(&self, at: &Point3<f64>) -> Point2<f64> {
        self.registration.project(&self.in_cloud(at))
    }

    fn wood(&self, scan: &Skeleton) -> Vec<SeenPiece> {
        let px_per_px = self.metres_per_px * self.registration.to_picture.scaling();
        let mut pieces = Vec::with_capacity(scan.nodes.len());
        for (k, node) in (0..).zip(&scan.nodes) {
            let Some(parent) = node.parent else {
                continue;
            };
            let begin = &scan.nodes[parent.index()].position;
            let middle = nalgebra::center(begin, &node.position);
            let radius = node.radius * px_per_px;
            pieces.push(SeenPiece {
                node: NodeId(k),
                from: self.project(begin),
                to: self.project(&node.position),
                radius,
                depth: self.registration.depth_px(&self.in_cloud(&middle)) - radius,
            });
        }
        pieces
    }
}

/// The wood that the camera sees at a place; `None` where no bark is near.
fn node_seen_at(wood: &[SeenPiece], at: &Point2<f64>, height_px: f64) -> Option<NodeId> {
    let mut offs: Vec<f64> = Vec::with_capacity(wood.len());
    for piece in wood {
        let off = distance_to_segment(*at, piece.from, piece.to);
        offs.push((off - piece.radius).max(0.0));
    }
    let nearest = offs.iter().copied().fold(f64::INFINITY, f64::min);
    if nearest > FARTHEST_POINT_SHARE * height_px {
        return None;
    }
    let unsure = nearest + UNSURE_SHARE * height_px;
    let near = wood.iter().zip(&offs).filter(|(_, off)| **off <= unsure);
    let front = near.min_by(|a, b| a.0.depth.total_cmp(&b.0.depth));
    front.map(|(piece, _)| piece.node)
}

/// On which scanned branches the points of a filmed one are, with what it carries.
#[derive(Clone, Debug, Default)]
struct Votes {
    points: u32,
    /// By branch: on it or on what it carries.
    on: BTreeMap<usize, u32>,
}

impl Votes {
    fn add(&mut self, names: &BotanicalBranches, branch: usize) {
        self.points += 1;
        let below = |branch: &usize| names.all.get(*branch)?.carrier;
        for branch in std::iter::successors(Some(branch), below) {
            *self.on.entry(branch).or_default() += 1;
        }
    }

    /// Of the branches that most points are on the one of the highest order.
    fn branch(&self, names: &BotanicalBranches) -> Option<usize> {
        let least = LEAST_POINTS_SHARE * f64::from(self.points);
        let mostly = self.on.iter().filter(|(_, on)| f64::from(**on) >= least);
        let mostly = mostly.map(|(branch, _)| *branch);
        mostly.max_by_key(|branch| names.all[*branch].order)
    }
}

/// Places along the branch that ends in a node, from where it begins.
fn line(
    skeleton: &Skeleton,
    node: NodeId,
    project: impl Fn(&Point3<f64>) -> Point2<f64>,
) -> Vec<LinePlace> {
    let begin = skeleton.begin(node);
    let mut nodes: Vec<NodeId> = vec![node];
    nodes.extend(skeleton.ancestors(node).take_while(|n| Some(*n) != begin));
    nodes.extend(begin);
    let places: Vec<Point2<f64>> = nodes
        .iter()
        .rev()
        .map(|n| project(&skeleton.nodes[n.index()].position))
        .collect();
    let mut pieces = Vec::with_capacity(places.len());
    for ends in places.windows(2) {
        pieces.push(WoodPiece {
            from: ends[0],
            to: ends[1],
            radius: skeleton.nodes[node.index()].radius,
        });
    }
    let length: f64 = pieces.iter().map(WoodPiece::length).sum();
    let parts = pieces.iter().flat_map(|piece| piece.cut(length / PLACES));
    parts.map(|part| part.place()).collect()
}

/// The mean distance of a line from another, in place and direction; infinite where one of them is
/// empty.
fn mean_off(line: &[LinePlace], other: &[LinePlace], across: f64) -> f64 {
    let nearest = line.iter().filter_map(|own| own.nearest_of(other, across));
    let offs: Vec<f64> = nearest.map(|n| n.off).collect();
    if offs.is_empty() {
        return f64::INFINITY;
    }
    offs.iter().sum::<f64>() / offs.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(node: u32, to: [f64; 2], radius: f64, depth: f64) -> SeenPiece {
        SeenPiece {
            node: NodeId(node),
            from: Point2::origin(),
            to: to.into(),
            radius,
            depth,
        }
    }

    #[test]
    fn a_point_is_on_the_wood_that_hides_the_other() {
        let wood = [
            piece(1, [0.0, 300.0], 8.0, 0.0),
            piece(2, [0.0, 200.0], 1.0, -40.0),
            piece(3, [200.0, 200.0], 1.0, -60.0),
        ];
        let seen = |x: f64, y: f64| node_seen_at(&wood, &Point2::new(x, y), 300.0).map(|n| n.0);
        assert_eq!(seen(1.5, 100.0), Some(2));
        assert_eq!(seen(1.5, 250.0), Some(1));
        assert_eq!(seen(150.0, 152.0), Some(3));
        assert_eq!(seen(150.0, 250.0), None);
    }

    #[test]
    fn a_filmed_branch_is_the_last_that_most_of_its_points_are_on() {
        let scan = Skeleton::forked();
        let names = scan.botanical_branches();
        let limb = names.of(NodeId(2));
        assert_ne!(limb, 0);
        let mut votes = Votes::default();
        assert_eq!(votes.branch(&names), None);
        (0..3).for_each(|_| votes.add(&names, limb));
        (0..2).for_each(|_| votes.add(&names, 0));
        assert_eq!(votes.branch(&names), Some(limb));
        votes.add(&names, 0);
        assert_eq!(
            votes.branch(&names),
            Some(0),
            "half of them are on the trunk"
        );
    }
}

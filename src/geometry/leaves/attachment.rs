//! Where leaves can sit: places along the thin limbs, found by how near they are in the picture.

use super::canvas::Grid;
use super::carry::{Carried, between};
use crate::model::{NodeId, Pose, Skeleton};
use crate::shape::{Limb, SkinWeights};
use nalgebra::{Point2, Point3, Vector3};
use std::cmp::Ordering;

/// Leaves sit where a limb is thinner than this share of the thickest.
const THIN: f64 = 0.4;
/// Way between two places on a limb, and reach within which branches count as equally near, as
/// shares of the tree's height.
const STEP: f64 = 1.0 / 80.0;
const REACH: f64 = 1.0 / 25.0;
/// More places than this on all limbs make them only slower to search.
const MOST: f64 = 40_000.0;

/// A place on a limb.
pub(super) struct AttachmentPoint {
    pub node: NodeId,
    /// Model axes at rest, px.
    pub at: Point3<f64>,
    /// Of the limb at rest, of length 1.
    pub direction: Vector3<f64>,
    pub skin: SkinWeights,
    /// Takes it to where the picture shows it.
    pub carried: Carried,
    /// There, px.
    pub depth: f64,
    /// Of the limb, px.
    pub radius: f64,
    /// Where the picture shows it.
    pub cell: Point2<f64>,
    /// Clusters that sit there.
    pub load: f64,
    /// On a limb that is too thick to bear leaves: only where there is no other way to hide it.
    pub thick: bool,
}

/// Which of the branches at a place in the picture a cluster is put on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Side {
    /// Those of the front half of the tree.
    Front,
    Back,
    /// Those nearer to the viewer than this depth, px.
    Before(f64),
}

/// All of them, sorted into squares of the picture.
pub(super) struct AttachmentPoints {
    pub all: Vec<AttachmentPoint>,
    squares: Vec<Vec<u32>>,
    across: usize,
    down: usize,
    /// Side of a square, cells.
    reach: f64,
    /// Depth of the trunk: what is nearer to the viewer is the front of the tree.
    middle: f64,
}

impl AttachmentPoints {
    pub fn new(
        limbs: &[Limb],
        skeleton: &Skeleton,
        pose: Option<&Pose>,
        grid: &Grid,
        height: f64,
    ) -> Self {
        let bearing = Bearing::of(limbs, skeleton);
        let limbs: Vec<&Limb> = limbs
            .iter()
            .filter(|l| bearing.bears(l, skeleton) || level(l, skeleton) >= 2)
            .collect();
        let length = total_length(&limbs);
        let step = (STEP * height).max(length / MOST).max(1e-6);
        let survey = Survey {
            skeleton,
            pose,
            grid,
            step,
        };
        let mut all = Vec::new();
        for limb in limbs {
            survey.add_along(limb, !bearing.bears(limb, skeleton), &mut all);
        }
        let reach = grid.length(REACH * height).max(1.0);
        let (across, down) = [grid.size.width, grid.size.height]
            .map(|n| (f64::from(n) / reach) as usize + 1)
            .into();
        let mut squares = vec![Vec::new(); across * down];
        for (i, attachment) in all.iter().enumerate() {
            let [x, y] = square(attachment.cell, reach, [across, down]);
            squares[y * across + x].push(i as u32);
        }
        let middle = skeleton.nodes.get(1).map_or(0.0, |n| n.position.z);
        Self {
            all,
            squares,
            across,
            down,
            reach,
            middle,
        }
    }

    /// Forgets what has been seated.
    pub fn clear(&mut self) {
        for attachment in &mut self.all {
            attachment.load = 0.0;
        }
    }

    /// Seats a cluster that is seen at `cell`: on the nearest branch in the picture, and where
    /// several are all but equally near, on one of the front half of the tree if it is bright, of
    /// the back half if not, and there on the one that has fewest (Li 2011 app. B.1). Returns the
    /// place and how far it is in the picture, cells.
    pub fn seat(&mut self, cell: Point2<f64>, side: Side) -> Option<(usize, f64)> {
        let hides = matches!(side, Side::Before(_));
        let near = self.near(cell, hides);
        let least = near.iter().map(|n| n.1).fold(f64::MAX, f64::min);
        let mut best: Option<(Cost, usize, f64)> = None;
        for (i, distance) in near {
            if distance > least + self.reach {
                continue;
            }
            let cost = self.cost(i, distance, side);
            if best.is_none_or(|(before, k, _)| cost.order(&before).then(i.cmp(&k)).is_lt()) {
                best = Some((cost, i, distance));
            }
        }
        let (_, i, distance) = best?;
        self.all[i].load += 1.0;
        Some((i, distance))
    }

    /// What it costs to seat a cluster on place `i`, `distance` cells from it.
    fn cost(&self, i: usize, distance: f64, side: Side) -> Cost {
        let place = &self.all[i];
        let on_side = match side {
            Side::Front => place.depth > self.middle,
            Side::Back => place.depth <= self.middle,
            Side::Before(depth) => place.depth >= depth,
        };
        let thick = if place.thick { 2.0 } else { 0.0 };
        Cost {
            wrong_side: !on_side,
            amount: thick + place.load + distance / self.reach,
        }
    }

    /// Places within reach of a cell with their distance; if there are none, those of the first
    /// ring of squares that has some.
    fn near(&self, cell: Point2<f64>, thick: bool) -> Vec<(usize, f64)> {
        let [x, y] = square(cell, self.reach, [self.across, self.down]);
        let mut found = Vec::new();
        for ring in 1..=self.across.max(self.down) {
            let (left, right) = (x.saturating_sub(ring), (x + ring).min(self.across - 1));
            let (top, bottom) = (y.saturating_sub(ring), (y + ring).min(self.down - 1));
            for v in top..=bottom {
                for square in &self.squares[v * self.across + left..=v * self.across + right] {
                    self.add_in_square(square, cell, thick, &mut found);
                }
            }
            if !found.is_empty() {
                break;
            }
        }
        found
    }

    fn add_in_square(
        &self,
        square: &[u32],
        cell: Point2<f64>,
        thick: bool,
        found: &mut Vec<(usize, f64)>,
    ) {
        for &i in square {
            let attachment = &self.all[i as usize];
            if thick || !attachment.thick {
                let way = attachment.cell - cell;
                found.push((i as usize, way.x.hypot(way.y)));
            }
        }
    }
}

/// What it costs to seat a cluster: the side first, then the rest.
#[derive(Clone, Copy)]
struct Cost {
    wrong_side: bool,
    amount: f64,
}

impl Cost {
    fn order(&self, other: &Self) -> Ordering {
        self.wrong_side
            .cmp(&other.wrong_side)
            .then(self.amount.total_cmp(&other.amount))
    }
}

fn square(cell: Point2<f64>, side: f64, count: [usize; 2]) -> [usize; 2] {
    [0, 1].map(|k| ((cell[k] / side).max(0.0) as usize).min(count[k] - 1))
}

/// Which limbs bear leaves. A tree of thick limbs alone still has its leaves.
enum Bearing {
    /// Twigs, and branches up to this radius, px.
    Thin(f64),
    Branches,
    All,
}

impl Bearing {
    fn of(limbs: &[Limb], skeleton: &Skeleton) -> Self {
        let thickest = limbs
            .iter()
            .map(base_radius)
            .filter(|r| r.is_finite())
            .fold(0.0, f64::max);
        for bearing in [Self::Thin(THIN * thickest), Self::Branches] {
            if limbs.iter().any(|l| bearing.bears(l, skeleton)) {
                return bearing;
            }
        }
        Self::All
    }

    fn bears(&self, limb: &Limb, skeleton: &Skeleton) -> bool {
        let is_branch = level(limb, skeleton) >= 2;
        match *self {
            Self::Thin(radius) => limb.twig || is_branch && base_radius(limb) <= radius,
            Self::Branches => is_branch,
            Self::All => true,
        }
    }
}

fn base_radius(limb: &Limb) -> f64 {
    limb.samples.first().map_or(0.0, |s| s.radius)
}

fn level(limb: &Limb, skeleton: &Skeleton) -> u8 {
    skeleton.nodes.get(limb.node.index()).map_or(0, |n| n.level)
}

/// Of all limbs, pieces that are no number left out, px.
fn total_length(limbs: &[&Limb]) -> f64 {
    let mut length = 0.0;
    for limb in limbs {
        for k in 1..limb.samples.len() {
            let piece = piece_length(limb, k - 1);
            if piece.is_finite() {
                length += piece;
            }
        }
    }
    length
}

/// Length of the piece of a limb from sample `k` to the next, px.
fn piece_length(limb: &Limb, k: usize) -> f64 {
    (limb.samples[k + 1].at - limb.samples[k].at).norm()
}

/// How places are found.
struct Survey<'a> {
    skeleton: &'a Skeleton,
    pose: Option<&'a Pose>,
    grid: &'a Grid,
    /// Between two places on a limb, px.
    step: f64,
}

impl Survey<'_> {
    /// Adds the places along one limb; near its base there are none, where it is inside its parent.
    fn add_along(&self, limb: &Limb, thick: bool, all: &mut Vec<AttachmentPoint>) {
        let length = limb.length();
        if !(length > 0.0 && length.is_finite()) {
            return;
        }
        let count = (length / self.step).ceil().max(1.0) as usize;
        let mut piece = 0;
        let mut before = 0.0;
        for k in 0..count {
            let way = length * (k as f64 + 1.0) / count as f64;
            while piece + 2 < limb.samples.len() && before + piece_length(limb, piece) < way {
                before += piece_length(limb, piece);
                piece += 1;
            }
            let span = piece_length(limb, piece);
            let t = if span > 0.0 {
                ((way - before) / span).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let place = self.place(limb, piece, t, thick);
            if place.cell.iter().all(|c| c.is_finite()) {
                all.push(place);
            }
        }
    }

    /// The place at share `t` of a piece of a limb.
    fn place(&self, limb: &Limb, piece: usize, t: f64, thick: bool) -> AttachmentPoint {
        let (a, b) = (&limb.samples[piece], &limb.samples[piece + 1]);
        let at = a.at + (b.at - a.at) * t;
        let skin = between(&a.skin, &b.skin, t);
        let carried = Carried::by(&skin, self.skeleton, self.pose);
        let posed = carried.posed(&at);
        AttachmentPoint {
            node: limb.node,
            at,
            direction: (b.at - a.at).try_normalize(1e-12).unwrap_or(Vector3::y()),
            skin,
            carried,
            depth: posed.z,
            radius: (a.radius + (b.radius - a.radius) * t).max(0.0),
            cell: self.grid.cell_of(&posed),
            load: 0.0,
            thick,
        }
    }
}

//! Where leaves can sit: places along the thin limbs, found by how near they are in the picture.

use super::canvas::Grid;
use super::carry::{Carried, between};
use crate::model::{NodeId, Pose, Skeleton};
use crate::shape::{Limb, Riding};
use nalgebra::{Point3, Vector3};

/// Leaves sit where a limb is thinner than this share of the thickest.
const THIN: f64 = 0.4;
/// Way between two places on a limb, and reach within which branches count as equally near, as
/// shares of the tree's height.
const STEP: f64 = 1.0 / 80.0;
const REACH: f64 = 1.0 / 25.0;
/// More places than this on all limbs make them only slower to search.
const MOST: f64 = 40_000.0;

/// A place on a limb.
pub(super) struct Perch {
    pub node: NodeId,
    /// Model axes at rest, px.
    pub at: Point3<f64>,
    /// Of the limb at rest, of length 1.
    pub direction: Vector3<f64>,
    pub riding: Riding,
    /// Takes it to where the picture shows it.
    pub carried: Carried,
    /// There, px.
    pub depth: f64,
    /// Of the limb, px.
    pub radius: f64,
    /// Where the picture shows it.
    pub cell: [f64; 2],
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
pub(super) struct Perches {
    pub all: Vec<Perch>,
    squares: Vec<Vec<u32>>,
    across: usize,
    down: usize,
    /// Side of a square, cells.
    reach: f64,
    /// Depth of the trunk: what is nearer to the viewer is the front of the tree.
    middle: f64,
}

impl Perches {
    pub fn new(
        limbs: &[Limb],
        skeleton: &Skeleton,
        pose: Option<&Pose>,
        grid: &Grid,
        height: f64,
    ) -> Self {
        let radius = |l: &Limb| l.stations.first().map_or(0.0, |s| s.radius);
        let thickest = limbs
            .iter()
            .map(radius)
            .filter(|r| r.is_finite())
            .fold(0.0, f64::max);
        let level = |l: &Limb| skeleton.nodes.get(l.node.index()).map_or(0, |n| n.level);
        let kinds: [&dyn Fn(&Limb) -> bool; 3] = [
            &|l| l.twig || level(l) >= 2 && radius(l) <= THIN * thickest,
            &|l| level(l) >= 2,
            &|_| true,
        ];
        // A tree of thick limbs alone still has its leaves.
        let some = |bears: &&&dyn Fn(&Limb) -> bool| limbs.iter().any(bears);
        let bears = kinds.iter().find(some).unwrap_or(&kinds[2]);
        let bearing: Vec<&Limb> = limbs.iter().filter(|l| bears(l) || level(l) >= 2).collect();
        let ways = bearing
            .iter()
            .flat_map(|l| l.stations.windows(2).map(|w| (w[1].at - w[0].at).norm()));
        let length: f64 = ways.filter(|w| w.is_finite()).sum();
        let step = (STEP * height).max(length / MOST).max(1e-6);
        let mut all = Vec::new();
        for limb in bearing {
            along(limb, !bears(limb), step, skeleton, pose, grid, &mut all);
        }
        let reach = grid.length(REACH * height).max(1.0);
        let (across, down) = [grid.size.width, grid.size.height]
            .map(|n| (f64::from(n) / reach) as usize + 1)
            .into();
        let mut squares = vec![Vec::new(); across * down];
        for (i, perch) in all.iter().enumerate() {
            let [x, y] = square(perch.cell, reach, [across, down]);
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
        self.all.iter_mut().for_each(|p| p.load = 0.0);
    }

    /// Seats a cluster that is seen at `cell`: on the nearest branch in the picture, and where
    /// several are all but equally near, on one of the front half of the tree if it is bright, of
    /// the back half if not, and there on the one that has fewest (Li et al. B.1). Returns the
    /// place and how far it is in the picture, cells.
    pub fn seat(&mut self, cell: [f64; 2], side: Side) -> Option<(usize, f64)> {
        let hides = matches!(side, Side::Before(_));
        let near = self.near(cell, hides);
        let least = near.iter().map(|n| n.1).fold(f64::MAX, f64::min);
        let front = |i: usize| match side {
            Side::Front => self.all[i].depth > self.middle,
            Side::Back => self.all[i].depth <= self.middle,
            Side::Before(depth) => self.all[i].depth >= depth,
        };
        let thick = |i: usize| if self.all[i].thick { 2.0 } else { 0.0 };
        let cost = |&(i, distance): &(usize, f64)| {
            (
                !front(i),
                thick(i) + self.all[i].load + distance / self.reach,
            )
        };
        let order = |a: &(usize, f64), b: &(usize, f64)| {
            let (x, y) = (cost(a), cost(b));
            x.0.cmp(&y.0).then(x.1.total_cmp(&y.1)).then(a.0.cmp(&b.0))
        };
        let (i, distance) = near
            .iter()
            .filter(|n| n.1 <= least + self.reach)
            .copied()
            .min_by(order)?;
        self.all[i].load += 1.0;
        Some((i, distance))
    }

    /// Places within reach of a cell with their distance; if there are none, those of the first
    /// ring of squares that has some.
    fn near(&self, cell: [f64; 2], thick: bool) -> Vec<(usize, f64)> {
        let [x, y] = square(cell, self.reach, [self.across, self.down]);
        for ring in 1..=self.across.max(self.down) {
            let (left, right) = (x.saturating_sub(ring), (x + ring).min(self.across - 1));
            let (top, bottom) = (y.saturating_sub(ring), (y + ring).min(self.down - 1));
            let squares =
                (top..=bottom).flat_map(|v| (left..=right).map(move |u| v * self.across + u));
            let distance = |i: u32| {
                let c = self.all[i as usize].cell;
                (i as usize, (c[0] - cell[0]).hypot(c[1] - cell[1]))
            };
            let of = squares
                .flat_map(|s| &self.squares[s])
                .filter(|&&i| thick || !self.all[i as usize].thick);
            let found: Vec<(usize, f64)> = of.map(|&i| distance(i)).collect();
            if !found.is_empty() {
                return found;
            }
        }
        Vec::new()
    }
}

fn square(cell: [f64; 2], side: f64, count: [usize; 2]) -> [usize; 2] {
    [0, 1].map(|k| ((cell[k] / side).max(0.0) as usize).min(count[k] - 1))
}

/// Places along one limb, `step` px apart; near its base there are none, where it is inside its
/// parent.
fn along(
    limb: &Limb,
    thick: bool,
    step: f64,
    skeleton: &Skeleton,
    pose: Option<&Pose>,
    grid: &Grid,
    all: &mut Vec<Perch>,
) {
    let length: f64 = limb
        .stations
        .windows(2)
        .map(|w| (w[1].at - w[0].at).norm())
        .sum();
    if !(length > 0.0 && length.is_finite()) {
        return;
    }
    let count = (length / step).ceil().max(1.0) as usize;
    let mut segment = 0;
    let mut before = 0.0;
    for k in 0..count {
        let way = length * (k as f64 + 1.0) / count as f64;
        let span = |s: usize| (limb.stations[s + 1].at - limb.stations[s].at).norm();
        while segment + 2 < limb.stations.len() && before + span(segment) < way {
            before += span(segment);
            segment += 1;
        }
        let (a, b) = (&limb.stations[segment], &limb.stations[segment + 1]);
        let t = if span(segment) > 0.0 {
            ((way - before) / span(segment)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let at = a.at + (b.at - a.at) * t;
        let riding = between(&a.riding, &b.riding, t);
        let carried = Carried::by(&riding, skeleton, pose);
        let posed = carried.posed(&at);
        let direction = (b.at - a.at).try_normalize(1e-12).unwrap_or(Vector3::y());
        let radius = (a.radius + (b.radius - a.radius) * t).max(0.0);
        let cell = grid.cell_of(&posed);
        if cell.iter().all(|c| c.is_finite()) {
            let (node, depth, load) = (limb.node, posed.z, 0.0);
            all.push(Perch {
                node,
                at,
                direction,
                riding,
                carried,
                depth,
                radius,
                cell,
                load,
                thick,
            });
        }
    }
}

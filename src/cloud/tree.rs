//! The tree that a cloud shows.

use super::paths::{Joint, Path};
use nalgebra::Point3;

/// Bends are left out where the line stays this near, in the distance of points.
const STRAIGHT_CELLS: f64 = 0.5;
/// Between two nodes the radius of the wood is off by at most this share of it.
const RADIUS_SHARE: f64 = 0.08;
/// From node to node the radius falls by no more than this share, where there are places between:
/// tables give each piece as a cylinder with the radius of its end.
const LARGEST_STEP: f64 = 0.04;

/// A tree in space.
#[derive(Clone, Debug, PartialEq)]
pub struct CloudTree {
    /// Parents before children; the first is the foot. Where a branch leaves another one, its first
    /// node lies on the bark of that.
    pub nodes: Vec<CloudNode>,
    pub figures: CloudFigures,
}

/// The end of a piece of wood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudNode {
    pub parent: Option<usize>,
    /// m, z up, against the origin of the cloud.
    pub position: Point3<f64>,
    /// m.
    pub radius: f64,
    /// Whether a circle was fitted there.
    pub is_measured: bool,
    /// Whether a branch ends there though only one other goes on from it.
    pub is_joint: bool,
}

/// What was found on the way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CloudFigures {
    /// Points of the cloud, of the ground, of noise, and of what does not hang together with the
    /// tree.
    pub points: usize,
    pub ground: usize,
    pub noise: usize,
    pub apart: usize,
    /// Whether leaves were to be taken off, and their points.
    pub in_leaf: bool,
    pub leaves: usize,
    /// Whether its lines grew in the bare points, as Runions et al. 2007 have it.
    pub is_grown_bare: bool,
    /// Steps of the coordinates of the cloud; 0 where they have none that show, m.
    pub step_m: f64,
    /// Side of the cells in which points are one, m.
    pub cell_m: f64,
    /// Standard deviation of points off thick wood, m; 0 where there is none.
    pub noise_m: f64,
    /// Radius of the last twigs, m.
    pub twig_radius_m: f64,
    /// Height of the tree from its foot, m.
    pub height_m: f64,
    /// Share of its points that lie on the wood.
    pub on_wood: f64,
    /// How thick the foot of the trunk is against the thickest wood; `None` where no circle was found
    /// on the trunk.
    pub foot_share: Option<f64>,
    /// Whether ground was found below it.
    pub has_ground: bool,
    /// Height of the lowest large branch above the foot, as a share of the tree's; `None` where none
    /// leaves the trunk.
    pub clear_stem: Option<f64>,
    /// Of several trees how far below the feet its trunk comes together with that of another, as a share of the
    /// height of the higher; `None` where it does with none.
    pub fork_below: Option<f64>,
    /// Whether no ground was scanned, and another tree of the cloud may be part of a crown without its trunk.
    pub beside_crown: bool,
}

impl CloudFigures {
    /// Share of the cloud's points that so many are, percent.
    pub fn percent(&self, points: usize) -> f64 {
        100.0 * points as f64 / self.points.max(1) as f64
    }
}

/// Puts the paths together; `cell` is the distance of points, m.
pub(super) fn assemble(paths: &[Path], cell: f64) -> Vec<CloudNode> {
    let kept = kept_places(paths, STRAIGHT_CELLS * cell);
    let mut nodes: Vec<CloudNode> = Vec::new();
    let mut node_of: Vec<Vec<Option<usize>>> = Vec::with_capacity(paths.len());
    for (path, keep) in paths.iter().zip(&kept) {
        let mut parent = path.on.and_then(|on| node_at(&node_of, on));
        if let (Some(on), Some(carrier)) = (path.on, parent) {
            let carrier = &nodes[carrier];
            let own = &path.places[0];
            let way = own.at - carrier.position;
            let bark = paths[on.path].places[on.place].radius;
            // A branch that begins inside of what carries it has no other place on its bark.
            if way.norm() > bark + 0.5 * cell {
                nodes.push(CloudNode {
                    parent,
                    position: carrier.position + way * (bark / way.norm()),
                    radius: own.radius,
                    is_measured: false,
                    is_joint: false,
                });
                parent = Some(nodes.len() - 1);
            }
        }
        let mut of_path = vec![None; path.places.len()];
        for (k, place) in path.places.iter().enumerate().filter(|(k, _)| keep[*k]) {
            of_path[k] = Some(nodes.len());
            nodes.push(CloudNode {
                parent,
                position: place.at,
                radius: place.radius,
                is_measured: place.measured.is_some_and(|m| m.is_circle),
                is_joint: false,
            });
            parent = Some(nodes.len() - 1);
        }
        node_of.push(of_path);
    }
    nodes
}

fn node_at(node_of: &[Vec<Option<usize>>], on: Joint) -> Option<usize> {
    *node_of.get(on.path)?.get(on.place)?
}

/// Which places of each path become nodes: ends, forks, and what the line and its radius need
/// (Douglas & Peucker 1973).
fn kept_places(paths: &[Path], tolerance: f64) -> Vec<Vec<bool>> {
    let mut kept: Vec<Vec<bool>> = paths.iter().map(|p| vec![false; p.places.len()]).collect();
    for on in paths.iter().filter_map(|p| p.on) {
        kept[on.path][on.place] = true;
    }
    for (path, keep) in paths.iter().zip(&mut kept) {
        let last = path.places.len() - 1;
        (keep[0], keep[last]) = (true, true);
        let fixed: Vec<usize> = (0..=last).filter(|k| keep[*k]).collect();
        let mut stretches: Vec<[usize; 2]> = fixed.windows(2).map(|w| [w[0], w[1]]).collect();
        while let Some([from, to]) = stretches.pop() {
            let off = farthest_off(path, from, to, tolerance);
            if let Some(off) = off.or_else(|| halfway(path, from, to)) {
                keep[off] = true;
                stretches.extend([[from, off], [off, to]]);
            }
        }
    }
    kept
}

/// The place halfway between two others whose radii are too unlike for one cylinder.
fn halfway(path: &Path, from: usize, to: usize) -> Option<usize> {
    let falls = path.places[to].radius < (1.0 - LARGEST_STEP) * path.places[from].radius;
    (falls && to - from > 1).then_some((from + to) / 2)
}

/// The place between two others that is farthest off the straight cone between them, if that is too
/// far.
fn farthest_off(path: &Path, from: usize, to: usize, tolerance: f64) -> Option<usize> {
    let (a, b) = (&path.places[from], &path.places[to]);
    let way = b.at - a.at;
    let mut worst = None;
    let mut most = 1.0;
    for (k, place) in path.places.iter().enumerate().take(to).skip(from + 1) {
        let t = ((place.at - a.at).dot(&way) / way.norm_squared().max(1e-18)).clamp(0.0, 1.0);
        let off = (a.at + t * way - place.at).norm() / tolerance;
        let radius = a.radius + (b.radius - a.radius) * t;
        let off_radius =
            (radius - place.radius).abs() / (RADIUS_SHARE * place.radius).max(0.25 * tolerance);
        if off.max(off_radius) > most {
            most = off.max(off_radius);
            worst = Some(k);
        }
    }
    worst
}

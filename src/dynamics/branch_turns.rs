//! How every branch turns, frame by frame, from all points at once.
//!
//! A point in the picture moves with the branch that it is on and with all that carry that. Each of
//! these turns by a small angle about the place where it begins, which moves a point by the angle
//! times an arm: that of the picture, but for what bending and depth make of it. The angles of a
//! branch, the arms of a point and its noise are normal, and what makes the film likeliest: a factor
//! analysis of which is known who moves whom (Jöreskog 1969), fitted by expectation and maximisation
//! (Rubin and Thayer 1982). What a point does not show is filled in from the angles.

use super::branch_tree::BranchTree;
use super::film::Film;
use super::members::{count_seen, evenly_chosen, is_seen, mean_px};
use crate::model::NodeId;
use nalgebra::{DMatrix, DVector, Point2, Vector2};

/// A point must have been seen in this share of the frames.
const MIN_SEEN_SHARE: f64 = 0.6;
/// Points at most.
const MOST_POINTS: usize = 400;
/// A branch that has this share of its carrier's points is not told apart from it: the two turn as
/// one.
const MOST_OF_CARRIER: f64 = 0.9;
/// Standard deviation of an arm from that of the picture, as a share of its length; arms shorter than
/// this share of the branch's mean count as so long.
const ARM_SD: f64 = 0.1;
const LEAST_ARM: f64 = 0.5;
/// Steps of the fit.
const STEPS: usize = 15;
/// What the fit begins with: deviations of an angle, rad, and of noise, px.
const FIRST_ANGLE: f64 = 0.02;
const FIRST_NOISE_PX: f64 = 0.3;
/// No point has less noise, px, and no angle less variance, rad².
const MIN_NOISE_PX: f64 = 0.02;
const MIN_VARIANCE: f64 = 1e-12;

/// The angle of one branch against what carries it in each of `frames`: rad, clockwise in the
/// picture. Its size is known to a tenth or two, as that of the arms is. `None` where no point tells
/// it.
pub(super) fn turn_of(
    branch: NodeId,
    tree: &BranchTree,
    film: &Film,
    frames: &[usize],
) -> Option<Vec<f64>> {
    let points = points(film, frames);
    let branches = branches_told_apart(tree, &points);
    let at = branches.binary_search(&branch).ok()?;
    let mut fit = Fit::new(tree, &points, &branches, frames.len());
    for _ in 0..STEPS {
        fit.find_angles()?;
        fit.find_variances_and_arms();
    }
    Some(fit.angles.column(at).iter().copied().collect())
}

/// A point, and where it was in each of the frames that are used.
struct Place {
    node: NodeId,
    at_px: Vec<Point2<f64>>,
}

/// Points that were seen for long enough.
fn points(film: &Film, frames: &[usize]) -> Vec<Place> {
    let least = (MIN_SEEN_SHARE * frames.len() as f64).max(1.0);
    let mut enough = Vec::new();
    for track in &film.tracks {
        let at_px: Vec<Point2<f64>> = frames.iter().map(|&k| track.at_px[k]).collect();
        if count_seen(&at_px) as f64 >= least {
            let node = track.node;
            enough.push(Place { node, at_px });
        }
    }
    let all: Vec<usize> = (0..enough.len()).collect();
    let chosen = evenly_chosen(&all, MOST_POINTS);
    let mut out = Vec::with_capacity(chosen.len());
    for (k, point) in enough.into_iter().enumerate() {
        if chosen.binary_search(&k).is_ok() {
            out.push(point);
        }
    }
    out
}

/// The branch of a point and all that carry it, but for the foot.
fn movers(tree: &BranchTree, node: NodeId) -> impl Iterator<Item = NodeId> + '_ {
    let with_carriers = std::iter::once(node).chain(tree.carriers(node));
    with_carriers.filter(|b| b.index() > 0 && b.index() < tree.len())
}

/// Branches that some of the points are on or above, in order.
fn branches_told_apart(tree: &BranchTree, points: &[Place]) -> Vec<NodeId> {
    let mut counts = vec![0.0; tree.len()];
    for point in points {
        for branch in movers(tree, point.node) {
            counts[branch.index()] += 1.0;
        }
    }
    let mut out = Vec::new();
    for branch in (1..tree.len() as u32).map(NodeId) {
        let carrier = tree.branches[branch.index()].parent.unwrap_or_default();
        let is_on_foot = carrier == NodeId(0);
        let count = counts[branch.index()];
        let is_apart = is_on_foot || count < MOST_OF_CARRIER * counts[carrier.index()];
        if count > 0.0 && is_apart {
            out.push(branch);
        }
    }
    out
}

/// A branch that moves a point, as a column of the angles, and the arm of the picture, px/rad.
struct Mover {
    column: usize,
    arm: Vector2<f64>,
    /// Weight of that arm: one over its variance.
    weight: f64,
}

/// The model, and how far its fit has come.
struct Fit {
    /// Displacement, px, by frame and signal: u and v of each point in turn.
    moved: DMatrix<f64>,
    /// Places in it that no frame shows.
    lacking: Vec<(usize, usize)>,
    /// By point.
    movers: Vec<Vec<Mover>>,
    /// Displacement by angle, px/rad, by signal and branch.
    arms: DMatrix<f64>,
    /// Variances, by branch and by signal.
    of_angles: DVector<f64>,
    of_noise: DVector<f64>,
    /// The likeliest angles, rad, by frame and branch, and the covariance of what is not known of
    /// those of one frame.
    angles: DMatrix<f64>,
    unknown: DMatrix<f64>,
}

impl Fit {
    fn new(tree: &BranchTree, points: &[Place], branches: &[NodeId], frames: usize) -> Self {
        let signals = 2 * points.len();
        let mut out = Self {
            moved: DMatrix::zeros(frames, signals),
            lacking: Vec::new(),
            movers: Vec::with_capacity(points.len()),
            arms: DMatrix::zeros(signals, branches.len()),
            of_angles: DVector::from_element(branches.len(), FIRST_ANGLE.powi(2)),
            of_noise: DVector::from_element(signals, FIRST_NOISE_PX.powi(2)),
            angles: DMatrix::zeros(frames, branches.len()),
            unknown: DMatrix::zeros(branches.len(), branches.len()),
        };
        for point in points {
            let mean_px = mean_px(&point.at_px);
            out.add_signals(&point.at_px, &mean_px);
            let mut of_point = Vec::new();
            for branch in movers(tree, point.node) {
                if let Ok(column) = branches.binary_search(&branch) {
                    let arm = mean_px - tree.branches[branch.index()].base_px;
                    of_point.push(Mover {
                        column,
                        arm: Vector2::new(-arm.y, arm.x),
                        weight: 0.0,
                    });
                }
            }
            out.movers.push(of_point);
        }
        out.weigh_arms();
        out
    }

    /// Those of the next point.
    fn add_signals(&mut self, at_px: &[Point2<f64>], mean_px: &Point2<f64>) {
        let first = 2 * self.movers.len();
        for (frame, at) in at_px.iter().enumerate() {
            for axis in 0..2 {
                if is_seen(at) {
                    self.moved[(frame, first + axis)] = at[axis] - mean_px[axis];
                } else {
                    self.lacking.push((frame, first + axis));
                }
            }
        }
    }

    fn weigh_arms(&mut self) {
        let branches = self.of_angles.len();
        let (mut lengths, mut counts) = (vec![0.0; branches], vec![0.0; branches]);
        for mover in self.movers.iter().flatten() {
            lengths[mover.column] += mover.arm.norm();
            counts[mover.column] += 1.0;
        }
        for (point, movers) in self.movers.iter_mut().enumerate() {
            for mover in movers {
                let least = LEAST_ARM * lengths[mover.column] / counts[mover.column];
                let length = mover.arm.norm().max(least).max(1.0);
                mover.weight = (ARM_SD * length).powi(-2);
                for axis in 0..2 {
                    self.arms[(2 * point + axis, mover.column)] = mover.arm[axis];
                }
            }
        }
    }

    /// The angles from all else, and what no frame shows from them; `None` where numbers fail.
    fn find_angles(&mut self) -> Option<()> {
        let mut weighted = self.arms.clone();
        for (mut row, noise) in weighted.row_iter_mut().zip(&self.of_noise) {
            row /= *noise;
        }
        let mut precision = self.arms.tr_mul(&weighted);
        for (i, variance) in self.of_angles.iter().enumerate() {
            precision[(i, i)] += 1.0 / variance;
        }
        self.unknown = precision.cholesky()?.inverse();
        self.angles = &self.moved * (weighted * &self.unknown);
        for &(frame, signal) in &self.lacking {
            let shown = self.angles.row(frame).dot(&self.arms.row(signal));
            self.moved[(frame, signal)] = shown;
        }
        Some(())
    }

    /// Variances and arms from the angles.
    fn find_variances_and_arms(&mut self) {
        let frames = self.moved.nrows() as f64;
        let products = self.angles.tr_mul(&self.angles) + &self.unknown * frames;
        for (i, variance) in self.of_angles.iter_mut().enumerate() {
            *variance = (products[(i, i)] / frames).max(MIN_VARIANCE);
        }
        let with_moved = self.angles.tr_mul(&self.moved);
        for point in 0..self.movers.len() {
            for axis in 0..2 {
                self.fit_arms(point, axis, &products, &with_moved);
            }
        }
        let left = &self.moved - &self.angles * self.arms.transpose();
        for point in 0..self.movers.len() {
            let both = left.columns(2 * point, 2).norm_squared();
            let variance = (0.5 * both / frames).max(MIN_NOISE_PX.powi(2));
            self.of_noise.rows_mut(2 * point, 2).fill(variance);
        }
    }

    /// The arms of one signal: a regression on the angles of those that move it, with the arms of
    /// the picture as what is known before.
    fn fit_arms(
        &mut self,
        point: usize,
        axis: usize,
        products: &DMatrix<f64>,
        with_moved: &DMatrix<f64>,
    ) {
        let (movers, signal) = (&self.movers[point], 2 * point + axis);
        let noise = self.of_noise[signal];
        let mut normal = DMatrix::zeros(movers.len(), movers.len());
        let mut known = DVector::zeros(movers.len());
        for (i, a) in movers.iter().enumerate() {
            for (j, b) in movers.iter().enumerate() {
                normal[(i, j)] = products[(a.column, b.column)] / noise;
            }
            normal[(i, i)] += a.weight;
            known[i] = with_moved[(a.column, signal)] / noise + a.weight * a.arm[axis];
        }
        let Some(factored) = normal.cholesky() else {
            return;
        };
        let fitted = factored.solve(&known);
        for (mover, arm) in movers.iter().zip(fitted.iter()) {
            self.arms[(signal, mover.column)] = *arm;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::film::{FilmTrack, NOT_SEEN};
    use crate::model::{Node, Size, Skeleton};
    use crate::random::generator;
    use rand::RngExt;
    use std::f64::consts::TAU;

    const FRAMES: usize = 300;

    /// A trunk, and a limb that points to the right from its end.
    fn tree() -> BranchTree {
        BranchTree::of(&Skeleton {
            nodes: vec![
                Node::made_up(0, None, [0.0, 0.0, 0.0]),
                Node::made_up(1, Some(0), [0.0, 100.0, 0.0]),
                Node::made_up(2, Some(1), [80.0, 100.0, 0.0]),
            ],
            foot_px: Point2::new(300.0, 300.0),
            image_size: Size {
                width: 640,
                height: 360,
            },
        })
    }

    fn angle(branch: usize, frame: usize) -> f64 {
        let (size, hz) = [(0.02, 0.5), (0.05, 1.3)][branch - 1];
        size * (TAU * hz * frame as f64 / 15.0).sin()
    }

    /// Points of the trunk and of the limb, some of them on it only; a fifth of their frames is
    /// missing.
    fn film(of_trunk: usize, of_limb: usize) -> Film {
        let mut random = generator(2, 0);
        let mut tracks = Vec::new();
        for k in 0..of_trunk + of_limb {
            let is_on_limb = k >= of_trunk;
            let along = 20.0 + 60.0 * random.random_range(0.0..1.0);
            let rest = if is_on_limb {
                Point2::new(300.0 + along, 200.0)
            } else {
                Point2::new(300.0, 300.0 - along)
            };
            let lost = 60 * (k % 5);
            let mut at_px = Vec::new();
            for frame in 0..FRAMES {
                let arm = rest - Point2::new(300.0, 300.0);
                let mut at = rest + angle(1, frame) * Vector2::new(-arm.y, arm.x);
                if is_on_limb {
                    at.y += angle(2, frame) * along;
                }
                at.x += random.random_range(-0.1..0.1);
                at.y += random.random_range(-0.1..0.1);
                let is_lost = (lost..lost + 60).contains(&frame);
                at_px.push(if is_lost { NOT_SEEN } else { at });
            }
            tracks.push(FilmTrack {
                node: NodeId(1 + u32::from(is_on_limb)),
                at_px,
            });
        }
        let times_s: Vec<f64> = (0..FRAMES).map(|k| k as f64 / 15.0).collect();
        Film::new(&times_s, tracks)
    }

    fn turn(branch: usize, film: &Film) -> Option<Vec<f64>> {
        let frames: Vec<usize> = (0..FRAMES).collect();
        turn_of(NodeId(branch as u32), &tree(), film, &frames)
    }

    /// Share of the squares of the true turn that no multiple of the one that is found has.
    fn share_left(branch: usize, film: &Film) -> f64 {
        let found = DVector::from_vec(turn(branch, film).expect("a turn"));
        let truth = DVector::from_fn(FRAMES, |frame, _| angle(branch, frame));
        1.0 - found.dot(&truth).powi(2) / (found.norm_squared() * truth.norm_squared())
    }

    #[test]
    fn each_branch_has_its_own_turn() {
        let film = film(5, 7);
        for branch in [1, 2] {
            let left = share_left(branch, &film);
            assert!(left < 0.01, "{branch}: {left}");
        }
    }

    /// The limb's points are carried by the trunk, too.
    #[test]
    fn a_trunk_without_points_has_that_of_what_it_carries() {
        let film = film(0, 7);
        assert!(turn(2, &film).is_none(), "not told apart");
        assert!(turn(1, &film).is_some());
    }

    #[test]
    fn without_points_there_is_none() {
        assert!(turn(1, &film(0, 0)).is_none());
        assert!(turn(2, &film(7, 0)).is_none());
        assert!(turn_of(NodeId(1), &tree(), &film(5, 5), &[]).is_none());
    }
}

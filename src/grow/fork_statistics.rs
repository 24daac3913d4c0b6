//! What an example says on the form of new trees: the distributions of its forks (Li 2011 sect. 5.2).

use super::dirichlet::{Dirichlet, DirichletFit, fit};
use super::features::{Bifurcation, Fork, carried_forks, children, forks, with_all_above};
use super::flat_tree::GrowError;
use super::fork_tree::fork_tree;
use super::von_mises::VonMises;
use crate::model::Skeleton;
use crate::random::Generator;
use crate::skeleton::Node2d;
use nalgebra::{Point2, Vector2};

/// An example with fewer forks says nothing on what forks are like.
pub(super) const FEWEST_FORKS: usize = 3;

/// What an example says on the form of trees like it.
#[derive(Clone, Debug, PartialEq)]
pub struct ForkStatistics {
    /// Of its bifurcations and their mirror images, so that left and right are alike.
    pub alike: ForkShapes,
    /// Of bifurcations whose left branch leads on: it carries more. Where both carry as
    /// much either does.
    pub leading_left: ForkShapes,
    /// How forks share out what grows on from them.
    pub sharing: Sharing,
    /// How far branches above the trunk turn from the direction away from the foot, to either side,
    /// radians: those that lead on at a fork, and the others.
    pub leading: VonMises,
    pub others: VonMises,
    /// Number of forks into two, and the largest number of them from the foot to a tip; a fork into
    /// more counts as one less than it has branches.
    pub forks: usize,
    pub deepest: u8,
    /// From the foot to the main fork, px in the picture.
    pub trunk_px: Vector2<f64>,
    /// Usual length of the branches at the main fork, px in the picture: the trunk below may be much
    /// longer or shorter than a stem is.
    pub first_px: f64,
}

/// The distributions of angles and lengths of bifurcations.
#[derive(Clone, Debug, PartialEq)]
pub struct ForkShapes {
    pub angles: DirichletFit,
    pub lengths: DirichletFit,
}

/// How the branches of a fork share the forks above it.
#[derive(Clone, Debug, PartialEq)]
pub struct Sharing {
    /// Of those of the leading and of the other branch as shares of their sum; `None` where no fork
    /// of the example carries two.
    pub shares: Option<Dirichlet>,
}

impl ForkStatistics {
    /// Of the tree of `skeleton`, without its copies.
    ///
    /// # Errors
    /// It has fewer than [`FEWEST_FORKS`] forks.
    pub fn of(skeleton: &Skeleton) -> Result<Self, GrowError> {
        Self::of_tree(&fork_tree(skeleton))
    }

    /// Of a flat tree of forks and tips.
    pub(super) fn of_tree(tree: &[Node2d]) -> Result<Self, GrowError> {
        let children = children(tree);
        let carried = carried_forks(tree, &children);
        let forks = forks(tree, &children, &carried);
        let few = GrowError::TooFewForks { found: forks.len() };
        if forks.len() < FEWEST_FORKS {
            return Err(few);
        }
        let own = forks.iter().map(|fork| fork.shape);
        let mirrored = forks.iter().map(|fork| fork.shape.mirrored());
        let alike = ForkShapes::of(own.chain(mirrored));
        let led = ForkShapes::of(forks.iter().flat_map(Fork::leading_left));
        let (Some(alike), Some(leading_left)) = (alike, led) else {
            return Err(few);
        };
        let trunk = Trunk::of(tree, &children);
        let [leading, others] = directions(tree, &children, &carried);
        Ok(Self {
            alike,
            leading_left,
            sharing: Sharing::of(&forks),
            leading,
            others,
            forks: carried.first().copied().unwrap_or(0),
            deepest: deepest(tree, &children),
            trunk_px: trunk.to_fork_px,
            first_px: trunk.first_px,
        })
    }

    /// Length of a stem whose fork has branches as long as those of the main fork, px.
    pub(super) fn first_stem_px(&self) -> f64 {
        let mean = self.alike.lengths.distribution.mean();
        let stem = mean.first().copied().unwrap_or(1.0 / 3.0);
        self.first_px * stem / (0.5 * (1.0 - stem)).max(f64::MIN_POSITIVE)
    }

    /// A bifurcation like those of the example, whose left branch leads on.
    pub fn sample(&self, random: &mut Generator) -> Bifurcation {
        Bifurcation {
            angles: sampled(&self.leading_left.angles.distribution, random),
            lengths: sampled(&self.leading_left.lengths.distribution, random),
        }
    }
}

impl ForkShapes {
    /// `None` of none.
    fn of(forks: impl Iterator<Item = Bifurcation>) -> Option<Self> {
        let (mut angles, mut lengths) = (Vec::new(), Vec::new());
        for fork in forks {
            angles.push(fork.angles.to_vec());
            lengths.push(fork.lengths.to_vec());
        }
        Some(Self {
            angles: fit(&angles)?,
            lengths: fit(&lengths)?,
        })
    }
}

impl Sharing {
    fn of(forks: &[Fork]) -> Self {
        let mut shares = Vec::new();
        for fork in forks {
            let [left, right] = fork.carried;
            let all = (left + right + 1) as f64;
            if left + right > 1 {
                // Half a fork more for each, as none of many is not none at all.
                let leads = (left.max(right) as f64 + 0.5) / all;
                shares.push(vec![leads, 1.0 - leads]);
            }
        }
        Self {
            shares: fit(&shares).map(|fit| fit.distribution),
        }
    }

    /// How many of `forks` the leading branch gets.
    pub(super) fn leading_of(&self, forks: usize, random: &mut Generator) -> usize {
        let drawn = self.shares.as_ref().map(|shares| shares.sample(random));
        let share = drawn.and_then(|drawn| drawn.into_iter().reduce(f64::max));
        let leads = (share.unwrap_or(0.5) * forks as f64).round() as usize;
        leads.min(forks)
    }
}

/// A tuple of three.
pub(super) fn sampled(distribution: &Dirichlet, random: &mut Generator) -> [f64; 3] {
    let drawn = distribution.sample(random);
    std::array::from_fn(|k| drawn.get(k).copied().unwrap_or(0.0))
}

/// The trunk of a tree.
struct Trunk {
    /// From the foot to the main fork, px.
    to_fork_px: Vector2<f64>,
    /// Geometric mean of the lengths of the branches there, px.
    first_px: f64,
}

impl Trunk {
    /// Up to the main fork: of those that are met with on the way along the branch that carries most,
    /// the one at which the second branch carries most, the lowest of equals; without any to the top.
    /// Twigs that leave the trunk do not end it.
    fn of(tree: &[Node2d], children: &[Vec<usize>]) -> Self {
        let carried = with_all_above(tree, vec![1; tree.len()]);
        let (mut most, mut main_fork, mut top) = (0, None, 0);
        let mut at = (!tree.is_empty()).then_some(0);
        while let Some(node) = at {
            let mut own = children[node].clone();
            own.sort_by_key(|child| std::cmp::Reverse((carried[*child], *child)));
            let second = own.get(1).map_or(0, |child| carried[*child]);
            if node > 0 && second > most {
                (most, main_fork) = (second, Some(node));
            }
            top = node;
            at = own.first().copied();
        }
        let place_px = |node: usize| tree.get(node).map_or(Point2::origin(), |n| n.position_px);
        let end_px = place_px(main_fork.unwrap_or(top));
        let to_fork_px = end_px - place_px(0);
        let branches = main_fork.map_or(&[][..], |node| &children[node]);
        let lengths_px = branches
            .iter()
            .map(|child| (tree[*child].position_px - end_px).norm());
        let ln_sum: f64 = lengths_px.map(|l| l.max(1.0).ln()).sum();
        let first_px = match branches.len() {
            0 => to_fork_px.norm(),
            n => (ln_sum / n as f64).exp(),
        };
        Self {
            to_fork_px,
            first_px,
        }
    }
}

/// The distributions of the angles between the direction from the foot and the branches above the
/// first, and their mirror images: of those that carry more than all others of their fork, and of
/// these.
fn directions(tree: &[Node2d], children: &[Vec<usize>], carried: &[usize]) -> [VonMises; 2] {
    let [mut leading, mut others] = [Vec::new(), Vec::new()];
    for (i, node) in tree.iter().enumerate().filter(|(_, n)| n.level > 1) {
        let below = node.parent.unwrap_or(i);
        let mut beside = children[below].iter().filter(|child| **child != i);
        let leads = beside.all(|child| carried[*child] < carried[i]);
        let from_px = tree[below].position_px;
        let turn = turn(from_px - tree[0].position_px, node.position_px - from_px);
        let angle = turn.y.atan2(turn.x);
        let kind = if leads { &mut leading } else { &mut others };
        kind.extend([angle, -angle]);
    }
    [leading, others].map(|angles| VonMises::fit(&angles).unwrap_or(VonMises::new(0.0, 0.0)))
}

/// Most forks into two from the foot to a tip.
fn deepest(tree: &[Node2d], children: &[Vec<usize>]) -> u8 {
    let mut levels = vec![0_u8; tree.len()];
    for (i, node) in tree.iter().enumerate() {
        if let Some(parent) = node.parent {
            let forks = children[parent].len().saturating_sub(1);
            let forks = u8::try_from(forks.max(1)).unwrap_or(u8::MAX);
            levels[i] = levels[parent].saturating_add(forks);
        }
    }
    levels.into_iter().max().unwrap_or(0)
}

/// The angle from the direction `out` clockwise to that of a branch, as a unit vector: its cosine and
/// its sine.
pub(super) fn turn(out: Vector2<f64>, way: Vector2<f64>) -> Vector2<f64> {
    Vector2::new(out.dot(&way), out.perp(&way)).normalize()
}

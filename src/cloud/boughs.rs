//! Whether trees of one cloud are the boughs of a crown whose trunk is not in it.
//!
//! A crown that was cut off its trunk falls into its boughs, and each stands at the cut like a tree. Boughs part
//! from each other: followed further down they come together at their fork. Trunks stand side by side.

use super::CloudTree;
use super::fit::FOOT_SHARE;
use super::verdict::may_be_of_crown;
use nalgebra::{Point2, Point3, Vector2};

/// Lines that come together pass each other at less than this share of the distance of their feet.
const TOGETHER_SHARE: f64 = 0.5;

/// The lowest part of a trunk as a line.
struct Stem {
    foot: Point3<f64>,
    /// To the side for each metre up.
    lean: Vector2<f64>,
    height_m: f64,
}

impl Stem {
    fn of(tree: &CloudTree) -> Option<Self> {
        let nodes = &tree.nodes;
        let foot = nodes.first()?.position;
        let height_m = tree.figures.height_m;
        let wanted_m = FOOT_SHARE * height_m;
        let mut below = foot;
        let mut lean = None;
        // The trunk is the first of the paths, node by node.
        for (k, node) in nodes.iter().enumerate().skip(1) {
            if node.parent != Some(k - 1) {
                break;
            }
            let [low_m, high_m] = [below, node.position].map(|at| at.z - foot.z);
            let share = ((wanted_m - low_m) / (high_m - low_m)).clamp(0.0, 1.0);
            let at = below + share * (node.position - below);
            if at.z > foot.z {
                lean = Some((at - foot).xy() / (at.z - foot.z));
            }
            if high_m >= wanted_m {
                break;
            }
            below = node.position;
        }
        let lean = lean?;
        Some(Self {
            foot,
            lean,
            height_m,
        })
    }

    /// Where its line is at a height, m.
    fn at(&self, height_m: f64) -> Point2<f64> {
        self.foot.xy() + (height_m - self.foot.z) * self.lean
    }

    /// How far below the higher of their feet it comes together with another, as a share of the height of the
    /// higher tree; `None` where it does not.
    fn fork_below(&self, other: &Self) -> Option<f64> {
        let from_m = self.foot.z.max(other.foot.z);
        let way = self.at(from_m) - other.at(from_m);
        let apart = self.lean - other.lean;
        let below_m = way.dot(&apart) / apart.norm_squared();
        let nearest = (way - below_m * apart).norm();
        let comes_together = below_m > 0.0 && nearest < TOGETHER_SHARE * way.norm();
        comes_together.then(|| below_m / self.height_m.max(other.height_m))
    }
}

/// Says of each tree how far below its foot it comes together with the one that it does so soonest with, and, where
/// no ground was scanned, whether another one may be part of a crown.
pub(super) fn look_for_forks(trees: &mut [&mut CloudTree]) {
    let stems: Vec<Option<Stem>> = trees.iter().map(|tree| Stem::of(tree)).collect();
    for (number, tree) in trees.iter_mut().enumerate() {
        let Some(own) = &stems[number] else { continue };
        let others = stems.iter().enumerate().filter(|(k, _)| *k != number);
        let forks = others.filter_map(|(_, other)| own.fork_below(other.as_ref()?));
        tree.figures.fork_below = forks.min_by(f64::total_cmp);
    }
    let is_of_crown: Vec<bool> = trees
        .iter()
        .map(|tree| may_be_of_crown(&tree.figures))
        .collect();
    for (number, tree) in trees.iter_mut().enumerate() {
        let mut others = is_of_crown.iter().enumerate().filter(|(k, _)| *k != number);
        tree.figures.beside_crown = !tree.figures.has_ground && others.any(|(_, is)| *is);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{CloudFigures, CloudNode};
    use super::*;

    /// A trunk that leans by so much to the side, and a side branch.
    fn leaning(foot: [f64; 3], lean: [f64; 2], height_m: f64) -> CloudTree {
        let foot = Point3::from(foot);
        let mut nodes = Vec::new();
        for k in 0..=10 {
            let up_m = 0.1 * f64::from(k) * height_m;
            nodes.push(CloudNode {
                parent: (k > 0).then(|| k as usize - 1),
                position: foot + nalgebra::Vector3::new(lean[0], lean[1], 1.0) * up_m,
                radius: 0.05,
                is_measured: true,
                is_joint: false,
            });
        }
        nodes.push(CloudNode {
            parent: Some(3),
            ..nodes[10]
        });
        CloudTree {
            nodes,
            figures: CloudFigures {
                height_m,
                ..CloudFigures::default()
            },
        }
    }

    fn forks_below(mut trees: Vec<CloudTree>) -> Vec<Option<f64>> {
        look_for_forks(&mut trees.iter_mut().collect::<Vec<_>>());
        trees.iter().map(|tree| tree.figures.fork_below).collect()
    }

    #[test]
    fn boughs_come_together_below_and_trunks_do_not() {
        // From a fork 1 m below the cut; the second one ends at another height.
        let boughs = vec![
            leaning([0.5, 0.0, 3.0], [0.5, 0.0], 4.0),
            leaning([-0.6, 0.0, 3.2], [-0.5, 0.0], 3.0),
            leaning([0.0, 0.4, 3.0], [0.0, 0.4], 2.0),
        ];
        let found = forks_below(boughs);
        for fork in &found {
            let fork = fork.expect("a fork");
            assert!((0.24..0.31).contains(&fork), "{found:?}");
        }
        // Upright, leaning one way, leaning to each other, and past each other.
        for leans in [
            [[0.0, 0.0], [0.0, 0.0]],
            [[0.3, 0.1], [0.3, 0.1]],
            [[0.3, 0.0], [-0.3, 0.0]],
            [[0.0, 0.4], [0.0, -0.4]],
        ] {
            let trunks = leans
                .iter()
                .enumerate()
                .map(|(k, lean)| leaning([2.0 * k as f64, 0.0, 0.0], *lean, 6.0));
            let found = forks_below(trunks.collect());
            let nearest = found
                .iter()
                .flatten()
                .copied()
                .fold(f64::INFINITY, f64::min);
            assert!(nearest > 1.0, "{leans:?}: {found:?}");
        }
        // Away from each other by a little: far below.
        let away = vec![
            leaning([0.0, 0.0, 0.0], [-0.1, 0.0], 6.0),
            leaning([2.0, 0.0, 0.0], [0.1, 0.0], 5.0),
        ];
        let fork = forks_below(away)[0].expect("a fork");
        assert!((fork - 10.0 / 6.0).abs() < 1e-9, "{fork}");
        assert_eq!(
            forks_below(vec![leaning([0.0; 3], [0.0, 0.1], 6.0)]),
            [None]
        );
    }
}

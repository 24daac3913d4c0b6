//! Which of two trees is better supported by the motion of their points.

use super::signals::Signals;
use crate::model::TrackTable;

/// Points that are compared in threes; more say the same at a higher price (64 make 41,664
/// triplets).
const COMPARED: usize = 64;

/// A point and the branches that it is on in either tree, from the trunk up.
#[derive(Clone, Debug)]
pub struct OnBoth {
    pub row: usize,
    pub old: Vec<u32>,
    pub new: Vec<u32>,
}

/// How much better one tree is supported than another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gain {
    /// Share of triplets that the new tree has right and the old one has not, less the reverse, -1
    /// to 1.
    pub gain: f64,
    /// Its standard error: other points of the same tree would give another.
    pub error: f64,
}

/// Holds two trees against the motion in `table`: of three points a tree should put those two
/// nearest together that move most alike.
///
/// A triplet counts by how clearly the motion tells its nearest pair from the next; pairs that a
/// tree holds equally near share the point. It is the measure by which trees are held against a
/// known truth, with the correlation of displacements in the truth's place, so it speaks of all
/// levels alike and does not care how many splits a tree has. The error is the jackknife's over
/// points, to first order.
pub fn gain(table: &TrackTable, points: &[OnBoth]) -> Gain {
    let some: Vec<&OnBoth> = points
        .iter()
        .step_by(points.len().div_ceil(COMPARED).max(1))
        .collect();
    let triplets = triplets(table, &some);
    let weight: f64 = triplets.iter().map(|t| t.weight).sum();
    if weight <= 0.0 {
        return Gain::default();
    }
    let gain = triplets.iter().map(|t| t.weight * t.gain).sum::<f64>() / weight;
    let mut influence = vec![0.0; some.len()];
    for t in &triplets {
        for &point in &t.points {
            influence[point] += t.weight * (t.gain - gain) / weight;
        }
    }
    Gain {
        gain,
        error: influence.iter().map(|i| i * i).sum::<f64>().sqrt(),
    }
}

/// Three points, and what they say of the two trees.
struct Triplet {
    points: [usize; 3],
    /// By how much the correlation of the nearest pair exceeds the next.
    weight: f64,
    /// 1 if the new tree puts the nearest pair together and the old one does not, -1 if the
    /// reverse; shares where a tree holds pairs equally near.
    gain: f64,
}

fn triplets(table: &TrackTable, points: &[&OnBoth]) -> Vec<Triplet> {
    let rows: Vec<usize> = points.iter().map(|p| p.row).collect();
    let rho = Signals::displacements(table, &rows).correlations();
    let n = points.len();
    let mut triplets = Vec::new();
    for a in 0..n {
        for b in a + 1..n {
            for c in b + 1..n {
                let pairs = [(a, b), (a, c), (b, c)];
                let rho = pairs.map(|p| f64::from(rho[p]));
                let best = (0..3).fold(0, |m, k| if rho[k] > rho[m] { k } else { m });
                let second = (0..3)
                    .filter(|&k| k != best)
                    .map(|k| rho[k])
                    .fold(f64::NEG_INFINITY, f64::max);
                let old = pairs.map(|(i, j)| shared_depth(&points[i].old, &points[j].old));
                let new = pairs.map(|(i, j)| shared_depth(&points[i].new, &points[j].new));
                triplets.push(Triplet {
                    points: [a, b, c],
                    weight: rho[best] - second,
                    gain: share_of(best, new) - share_of(best, old),
                });
            }
        }
    }
    triplets
}

/// How many branches, from the trunk up, two points are both on.
fn shared_depth(a: &[u32], b: &[u32]) -> usize {
    a.iter().zip(b).take_while(|(p, q)| p == q).count()
}

/// What pair `best` gets if the deepest of three wins and equals share.
fn share_of(best: usize, depths: [usize; 3]) -> f64 {
    let deepest = depths.into_iter().max().unwrap_or(0);
    let winners = depths.iter().filter(|d| **d == deepest).count();
    if depths[best] == deepest {
        1.0 / winners as f64
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::TrackId;
    use nalgebra::Point2;
    use std::f64::consts::TAU;

    fn place_px(point: usize, time_s: f64) -> Point2<f32> {
        let branch_hz = [0.5, 0.8][point / 6];
        let twig_hz = [1.3, 1.9, 2.4, 3.1][point / 3];
        let [branch, twig] = [branch_hz, twig_hz].map(|hz| (TAU * hz * time_s).sin());
        Point2::new((4.0 * branch + twig) as f32, 0.0)
    }

    /// Twelve points on two branches that sway at rates of their own, on each of which two twigs do
    /// the same on top.
    fn table() -> TrackTable {
        let times_s: Vec<f64> = (0..150).map(|k| f64::from(k) / 15.0).collect();
        TrackTable {
            ids: (0..12).map(TrackId).collect(),
            positions: (0..12)
                .map(|i| times_s.iter().map(|&t| Some(place_px(i, t))).collect())
                .collect(),
            fb_errors_px: vec![0.02; 12],
            times_s: times_s.clone(),
        }
    }

    fn right(i: u32) -> Vec<u32> {
        vec![0, 1 + i / 6, 3 + i / 3]
    }

    fn held(old: fn(u32) -> Vec<u32>, new: fn(u32) -> Vec<u32>) -> Gain {
        let points: Vec<OnBoth> = (0..12)
            .map(|i| OnBoth {
                row: i as usize,
                old: old(i),
                new: new(i),
            })
            .collect();
        gain(&table(), &points)
    }

    /// A refinement that takes a worse tree for a better one undoes what was known.
    #[test]
    fn the_tree_that_the_motion_shows_is_told_from_one_that_it_does_not() {
        // Every other point on the wrong branch; twigs right and branches wrong; no twigs at all.
        let wrong: [fn(u32) -> Vec<u32>; 3] = [
            |i| vec![0, 1 + i % 2, 3 + i / 3],
            |i| vec![0, 1 + (i / 3) % 2, 3 + i / 3],
            |i| vec![0, 1 + i / 6],
        ];
        for (k, wrong) in wrong.into_iter().enumerate() {
            let (better, worse) = (held(wrong, right), held(right, wrong));
            assert!(better.gain > 3.0 * better.error, "tree {k}: {better:?}");
            assert!(
                (better.gain + worse.gain).abs() < 1e-12 && better.error > 0.0,
                "tree {k}: {worse:?}"
            );
        }
        assert_eq!(
            held(right, right),
            Gain::default(),
            "the same tree is neither better nor worse"
        );
        assert_eq!(gain(&table(), &[]), Gain::default());
    }
}

//! How alike two points are: how near they are, and how alike they move (Zeng eq. 2.20 after Liu et al. 2005).

use crate::track::TrackTable;
use nalgebra::DMatrix;

/// Velocities of all points on common frame steps, mean removed, 0 where a point was not seen at both ends.
pub struct Velocities {
    steps: usize,
    /// `[point][step]`, px per step, and whether it was seen.
    vu: Vec<Vec<f32>>,
    vv: Vec<Vec<f32>>,
    seen: Vec<Vec<f32>>,
}

impl Velocities {
    /// Differences between the frames of `table` for which `use_step(step)` holds, of the points in `rows`.
    pub fn new(table: &TrackTable, rows: &[usize], use_step: impl Fn(usize) -> bool) -> Self {
        let steps: Vec<usize> = (0..table.times_s.len().saturating_sub(1)).filter(|&k| use_step(k)).collect();
        let n = rows.len();
        let zero = vec![vec![0.0f32; steps.len()]; n];
        let (mut vu, mut vv, mut seen) = (zero.clone(), zero.clone(), zero);
        for (i, &row) in rows.iter().enumerate() {
            let p = &table.positions[row];
            let (mut sum, mut count) = ([0.0f32; 2], 0.0f32);
            for (s, &k) in steps.iter().enumerate() {
                if let (Some(a), Some(b)) = (p[k], p[k + 1]) {
                    (vu[i][s], vv[i][s], seen[i][s]) = (b[0] - a[0], b[1] - a[1], 1.0);
                    sum = [sum[0] + vu[i][s], sum[1] + vv[i][s]];
                    count += 1.0;
                }
            }
            for s in 0..steps.len() {
                vu[i][s] -= seen[i][s] * sum[0] / count.max(1.0);
                vv[i][s] -= seen[i][s] * sum[1] / count.max(1.0);
            }
        }
        Self { steps: steps.len(), vu, vv, seen }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.vu.len()
    }

    /// Mean velocity of the points that were seen, step by step, px per step.
    pub fn mean(&self) -> Vec<[f64; 2]> {
        let of_step = |s: usize| {
            let sum = |v: &[Vec<f32>]| v.iter().map(|row| f64::from(row[s])).sum::<f64>();
            let n = sum(&self.seen).max(1.0);
            [sum(&self.vu) / n, sum(&self.vv) / n]
        };
        (0..self.steps).map(of_step).collect()
    }

    /// Real part of rho of Zeng eq. 2.20 for points `a` and `b`, over the steps in which both were seen, -1 to 1.
    ///
    /// The equation as printed multiplies the complex velocities without conjugating one of them, by which two equal
    /// circular motions would come out as unrelated; Liu et al. take the conjugate, and so does this. Of the complex
    /// result the part in phase is kept and not the magnitude: two branches that swing against each other, or a quarter
    /// of a period apart, are different branches.
    pub fn correlation(&self, a: usize, b: usize) -> f32 {
        let (au, av, sa) = (&self.vu[a][..self.steps], &self.vv[a][..self.steps], &self.seen[a][..self.steps]);
        let (bu, bv, sb) = (&self.vu[b][..self.steps], &self.vv[b][..self.steps], &self.seen[b][..self.steps]);
        let (mut re, mut ea, mut eb) = ([0.0f32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
        // Independent sums per lane let the compiler use vector instructions and fix the order of addition.
        for s in 0..self.steps {
            let l = s % LANES;
            re[l] += au[s] * bu[s] + av[s] * bv[s];
            ea[l] += sb[s] * (au[s] * au[s] + av[s] * av[s]);
            eb[l] += sa[s] * (bu[s] * bu[s] + bv[s] * bv[s]);
        }
        let sum = |x: [f32; LANES]| x.iter().sum::<f32>();
        let energy = sum(ea) * sum(eb);
        if energy <= 0.0 { 0.0 } else { (sum(re) / energy.sqrt()).clamp(-1.0, 1.0) }
    }

    /// The correlations of all pairs.
    pub fn correlations(&self) -> DMatrix<f32> {
        let n = self.len();
        let mut rho = DMatrix::identity(n, n);
        for a in 0..n {
            for b in a + 1..n {
                let r = self.correlation(a, b);
                rho[(a, b)] = r;
                rho[(b, a)] = r;
            }
        }
        rho
    }
}

const LANES: usize = 8;
/// Points around a point that are asked whether it moves as they do.
const NEIGHBOURS: usize = 8;

/// Affinity of the points `members`: exp(-d^2 / 2s^2) * max(rho, 0)^power, with s a share of the members' own extent.
pub fn affinity(
    rho: &DMatrix<f32>,
    rest_px: &[[f64; 2]],
    members: &[usize],
    distance_scale: f64,
    power: f64,
) -> DMatrix<f32> {
    let n = members.len();
    let centre = centroid(rest_px, members);
    let variance = members.iter().map(|&i| distance_sq(rest_px[i], centre)).sum::<f64>() / n.max(1) as f64;
    // Twice the root mean square distance from the centroid is about the radius of an evenly filled disc times 1.4.
    let s = (2.0 * variance.sqrt() * distance_scale).max(1.0);
    let mut w = DMatrix::zeros(n, n);
    for a in 0..n {
        for b in a + 1..n {
            let near = (-distance_sq(rest_px[members[a]], rest_px[members[b]]) / (2.0 * s * s)).exp();
            let alike = f64::from(rho[(members[a], members[b])].max(0.0)).powf(power);
            // A floor keeps the graph connected, so that its second eigenvector exists and means a cut.
            let weight = (near * alike).max(1e-6) as f32;
            w[(a, b)] = weight;
            w[(b, a)] = weight;
        }
    }
    w
}

/// Indices of the points that move as those around them do: in the median their correlation with the [`NEIGHBOURS`]
/// nearest is at least `agreement`. The others slid along a branch, hang on the background or on two layers at once;
/// where they were put would be chance.
pub fn in_agreement(rho: &DMatrix<f32>, rest_px: &[[f64; 2]], agreement: f64) -> Vec<usize> {
    let n = rest_px.len();
    let agrees = |i: &usize| {
        let mut others: Vec<usize> = (0..n).filter(|j| j != i).collect();
        others.sort_by(|&a, &b| distance_sq(rest_px[*i], rest_px[a]).total_cmp(&distance_sq(rest_px[*i], rest_px[b])));
        others.truncate(NEIGHBOURS);
        let mut near: Vec<f32> = others.iter().map(|&j| rho[(*i, j)]).collect();
        near.sort_unstable_by(f32::total_cmp);
        near.get(near.len() / 2).is_some_and(|&median| f64::from(median) >= agreement)
    };
    (0..n).filter(agrees).collect()
}

/// Mean of the rest positions of `members`, px.
pub fn centroid(rest_px: &[[f64; 2]], members: &[usize]) -> [f64; 2] {
    let n = members.len().max(1) as f64;
    let sum = members.iter().fold([0.0; 2], |s, &i| [s[0] + rest_px[i][0], s[1] + rest_px[i][1]]);
    [sum[0] / n, sum[1] / n]
}

fn distance_sq(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
}

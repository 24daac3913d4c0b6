//! How the surroundings of a point have moved: a robust local affine fit of displacements.

use super::median;
use nalgebra::{Matrix2, Matrix3, Matrix3x2, Vector2, Vector3};

/// Fewer neighbours than this say nothing.
const AT_LEAST: usize = 4;
/// Rounds of the robust fit.
const ROUNDS: usize = 4;

/// What a neighbour says.
#[derive(Clone, Copy, Debug, Default)]
pub struct Witness {
    /// Its offset from the point at the beginning, and its displacement since, px.
    pub offset: Vector2<f64>,
    pub displacement: Vector2<f64>,
    /// Its weight, above 0 to 1.
    pub weight: f64,
}

/// How the surroundings of a point have moved since the beginning.
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    /// Displacement at the point itself, px.
    pub displacement: Vector2<f64>,
    /// How a small offset from the point is turned and stretched.
    pub warp: Matrix2<f32>,
}

impl Witness {
    /// Square of what the displacement differs from `affine` by, px^2.
    fn miss_sq(&self, affine: &Affine) -> f64 {
        let miss = Vector2::from_fn(|c, _| {
            let fitted =
                affine[(0, c)] + affine[(1, c)] * self.offset.x + affine[(2, c)] * self.offset.y;
            self.displacement[c] - fitted
        });
        miss.norm_squared()
    }
}

/// Displacement at the point itself, and its slopes along u and v (rows), of either coordinate
/// (columns).
type Affine = Matrix3x2<f64>;

/// An affine fit to the displacements of a point's neighbours; `None` where there are too few.
/// Disagreeing neighbours lose their weight (iteratively reweighted least squares with
/// Cauchy-squared weights); the slope is held towards zero, so that few or collinear neighbours
/// still give an answer.
pub fn local_affine(witnesses: &[Witness]) -> Option<Fit> {
    if witnesses.len() < AT_LEAST {
        return None;
    }
    let mut weights: Vec<f64> = witnesses.iter().map(|n| n.weight).collect();
    let mut affine = Affine::zeros();
    for _ in 0..ROUNDS {
        affine = weighted_fit(witnesses, &weights)?;
        let misses_sq: Vec<f64> = witnesses.iter().map(|n| n.miss_sq(&affine)).collect();
        let median_sq = median(misses_sq.clone(), f64::total_cmp)?;
        let scale_sq = (1.5 * 1.5 * median_sq).max(0.3 * 0.3);
        for ((w, miss_sq), n) in weights.iter_mut().zip(misses_sq).zip(witnesses) {
            *w = n.weight * (1.0 + miss_sq / scale_sq).powi(-2);
        }
    }
    let slopes = Matrix2::from_fn(|of, along| affine[(1 + along, of)] as f32);
    Some(Fit {
        displacement: affine.row(0).transpose(),
        warp: Matrix2::new(1.0 + slopes.m11, slopes.m12, slopes.m21, 1.0 + slopes.m22),
    })
}

fn weighted_fit(witnesses: &[Witness], weights: &[f64]) -> Option<Affine> {
    let mut normal = Matrix3::from_diagonal(&Vector3::new(1e-3, 30.0, 30.0));
    let mut right = Affine::zeros();
    for (witness, &w) in witnesses.iter().zip(weights) {
        let row = Vector3::new(1.0, witness.offset.x, witness.offset.y);
        normal += w * row * row.transpose();
        right += w * row * witness.displacement.transpose();
    }
    Some(normal.cholesky()?.solve(&right))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twelve neighbours on a ring that shift by (3, -2) px and turn a little; two are on another
    /// branch.
    #[test]
    fn neighbours_that_disagree_do_not_count() {
        let mut witnesses = Vec::new();
        for k in 0..12 {
            let angle = 0.5 * f64::from(k);
            let offset = 10.0 * Vector2::new(angle.cos(), angle.sin());
            let turned = 0.1 * Vector2::new(-offset.y, offset.x);
            witnesses.push(Witness {
                offset,
                displacement: if k < 2 {
                    Vector2::new(-9.0, 7.0)
                } else {
                    Vector2::new(3.0, -2.0) + turned
                },
                weight: 1.0,
            });
        }
        let fit = local_affine(&witnesses).expect("enough neighbours");
        assert!(
            (fit.displacement - Vector2::new(3.0, -2.0)).norm() < 0.15,
            "{fit:?}"
        );
        assert!((fit.warp.m21 - 0.1).abs() < 0.02, "{fit:?}");
        assert!(local_affine(&witnesses[..3]).is_none());
    }
}

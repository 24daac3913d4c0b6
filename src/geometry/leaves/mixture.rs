//! A mixture of normal distributions of colours, as a model of what a region of a picture shows.

use nalgebra::{Matrix3, Vector3};

/// Parts of a mixture (Rother, Kolmogorov and Blake 2004, "GrabCut", section 3.1).
const PARTS: usize = 5;
/// Variance of a colour by the camera's noise and compression alone, squared steps of 8 bits.
const NOISE: f64 = 16.0;

/// Colours of one region.
pub(super) struct Mixture {
    parts: Vec<Normal>,
}

struct Normal {
    mean: Vector3<f64>,
    inverse: Matrix3<f64>,
    /// Density at the mean, times the share of the part, but for a factor that all have.
    peak: f64,
}

impl Mixture {
    /// Parts are found as by Orchard and Bouman 1991: of those there are, the one that is widest in
    /// one direction is cut at its middle, square to that. `None` without colours.
    pub fn of(colours: Vec<[u8; 3]>) -> Option<Self> {
        let count = colours.len() as f64;
        let mut groups = vec![Group::of(
            colours
                .iter()
                .map(|c| Vector3::from(c.map(f64::from)))
                .collect(),
        )?];
        while groups.len() < PARTS {
            let widest = (0..groups.len()).max_by(|&a, &b| {
                let [a, b] = [a, b].map(|k| groups[k].width);
                a.total_cmp(&b)
            })?;
            let Some((low, high)) = groups[widest].halves() else {
                break;
            };
            groups[widest] = low;
            groups.push(high);
        }
        let parts = groups.iter().filter_map(|g| g.normal(count)).collect();
        Some(Self { parts })
    }

    /// Density at a colour, but for a factor that all mixtures have.
    pub fn density(&self, colour: [u8; 3]) -> f64 {
        let at = Vector3::from(colour.map(f64::from));
        let mut density = 0.0;
        for part in &self.parts {
            let off = at - part.mean;
            density += part.peak * (-0.5 * off.dot(&(part.inverse * off))).exp();
        }
        density
    }
}

/// Colours of one part.
struct Group {
    colours: Vec<Vector3<f64>>,
    mean: Vector3<f64>,
    covariance: Matrix3<f64>,
    /// Where they differ most, and their variance along that.
    direction: Vector3<f64>,
    width: f64,
}

impl Group {
    fn of(colours: Vec<Vector3<f64>>) -> Option<Self> {
        if colours.is_empty() {
            return None;
        }
        let count = colours.len() as f64;
        let mean = colours.iter().sum::<Vector3<f64>>() / count;
        let mut covariance = Matrix3::zeros();
        for colour in &colours {
            let off = colour - mean;
            covariance += off * off.transpose() / count;
        }
        let axes = covariance.symmetric_eigen();
        let widest = axes.eigenvalues.imax();
        Some(Self {
            colours,
            mean,
            covariance,
            direction: axes.eigenvectors.column(widest).into_owned(),
            width: axes.eigenvalues[widest],
        })
    }

    /// Those below and above the mean along the widest direction; `None` where all are alike.
    fn halves(&self) -> Option<(Self, Self)> {
        let above = |c: &&Vector3<f64>| (**c - self.mean).dot(&self.direction) > 0.0;
        let (high, low) = self.colours.iter().partition::<Vec<_>, _>(above);
        Some((
            Self::of(low.into_iter().copied().collect())?,
            Self::of(high.into_iter().copied().collect())?,
        ))
    }

    /// `None` where its covariance has no inverse, which [`NOISE`] keeps from happening.
    fn normal(&self, count: f64) -> Option<Normal> {
        let covariance = self.covariance + Matrix3::identity() * NOISE;
        Some(Normal {
            mean: self.mean,
            inverse: covariance.try_inverse()?,
            peak: self.colours.len() as f64 / count / covariance.determinant().sqrt(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two colours with a step to either side: each is dense, what lies between them is not.
    #[test]
    fn a_mixture_is_dense_where_its_colours_are() {
        let mut colours = Vec::new();
        for k in 0..200_u8 {
            let step = k % 5;
            colours.push([20 + step, 60 + k % 3, 30]);
            colours.push([150, 190 + step, 100 + k % 7]);
        }
        let mixture = Mixture::of(colours).unwrap();
        let [dark, bright, between] =
            [[22, 61, 30], [150, 192, 103], [86, 126, 66]].map(|c| mixture.density(c));
        assert!(dark > 1e3 * between && bright > 1e3 * between);
        assert!((dark / bright).ln().abs() < 1.0, "{dark} {bright}");
    }

    #[test]
    fn few_colours_are_a_mixture_and_none_are_not() {
        assert!(Mixture::of(Vec::new()).is_none());
        let one = Mixture::of(vec![[7, 8, 9]; 3]).unwrap();
        assert!(one.density([7, 8, 9]) > one.density([90, 8, 9]));
        assert!(one.density([90, 8, 9]).is_finite());
    }
}

//! Colours of wood and of all else, as mixtures of normal distributions (Tan et al. 2008
//! sect. 2.1), which OpenCV learns from pixels that are known; and such of any number of parts.

use super::colours::{Bin, Colours};
use super::mask::COLOUR_ODDS;
use nalgebra::{Matrix3, Vector3};
use opencv::core::{Mat, Rect, Vec3b};
use opencv::imgproc::{GC_BGD, GC_FGD, GC_INIT_WITH_MASK, grab_cut};
use opencv::prelude::*;

/// Normal distributions of a mixture of OpenCV's.
const PARTS: usize = 5;
/// What one has: its weight, its mean, and its covariance, row by row; those of all follow upon
/// each other.
const MEANS: usize = PARTS;
const COVARIANCES: usize = MEANS + 3 * PARTS;
const NUMBERS: usize = COVARIANCES + 9 * PARTS;
/// Variance that is added to every colour, grey levels squared: they are whole numbers.
const ROUNDING: f64 = 1.0 / 12.0;
/// Fewer pixels than this make no mixture.
const LEAST_SEEDS: usize = 64;
/// Least density that is believed: a colour that was never seen.
const LEAST_DENSITY: f64 = 1e-30;

/// A colour that is so many squared deviations off a part has less than a thousandth of the least density there.
const FARTHEST_SQUARES: f64 = 160.0;

/// Rounds in which a mixture of any number of parts is learned.
const ROUNDS: usize = 25;
/// Rounds in which the groups that it begins at settle.
const SETTLING_ROUNDS: usize = 10;
/// A part that fewer colours than this have together is none.
const LEAST_WEIGHT: f64 = 4.0;
/// Least deviation of a part, grey levels.
const LEAST_DEVIATION: f64 = 1.0;

/// What is known of a pixel before its colour is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seed {
    Wood,
    Other,
    Unknown,
}

/// How wood is coloured, and all else.
pub struct Mixtures {
    wood: Mixture,
    other: Mixture,
}

impl Mixtures {
    /// Those of the seeds; `None` where wood or the rest has too few.
    ///
    /// # Errors
    /// OpenCV fails.
    pub fn of(pixels: &[Vec3b], seeds: &[Seed]) -> opencv::Result<Option<Self>> {
        let mut known = Vec::new();
        let mut labels = Vec::new();
        for (pixel, seed) in pixels.iter().zip(seeds) {
            let label = match seed {
                Seed::Wood => GC_FGD,
                Seed::Other => GC_BGD,
                Seed::Unknown => continue,
            };
            known.push(*pixel);
            labels.push(label as u8);
        }
        let n_wood = seeds.iter().filter(|seed| **seed == Seed::Wood).count();
        if n_wood < LEAST_SEEDS || known.len() - n_wood < LEAST_SEEDS {
            return Ok(None);
        }
        let (mut wood, mut other) = (Mat::default(), Mat::default());
        opencv::core::set_rng_seed(0)?;
        // Learned only: the cut is our own.
        grab_cut(
            &Mat::from_slice(&known)?,
            &mut Mat::from_slice(&labels)?.clone_pointee(),
            Rect::default(),
            &mut other,
            &mut wood,
            0,
            GC_INIT_WITH_MASK,
        )?;
        let wood = Mixture::of(wood.data_typed()?);
        let other = Mixture::of(other.data_typed()?);
        Ok(Some(Self { wood, other }))
    }

    /// The odds that a pixel of this colour is wood, as a logarithm, if wood is as frequent as all
    /// else.
    pub fn odds_of_wood(&self, pixel: &Vec3b) -> f64 {
        let colour = Vector3::from(pixel.0.map(f64::from));
        (self.wood.density(&colour) / self.other.density(&colour)).ln()
    }
}

/// A mixture of normal distributions.
pub struct Mixture {
    pub parts: Vec<Normal>,
}

/// A normal distribution and its share of a mixture.
#[derive(Clone, Debug)]
pub struct Normal {
    /// Share of the mixture, 0 to 1.
    pub share: f64,
    pub mean: Vector3<f64>,
    /// Its share by the density at its mean, without the factor that all have.
    height: f64,
    precision: Matrix3<f64>,
}

impl Normal {
    /// `None` where the covariance cannot be inverted.
    fn of(share: f64, mean: Vector3<f64>, covariance: &Matrix3<f64>) -> Option<Self> {
        Some(Self {
            share,
            mean,
            height: share / covariance.determinant().max(f64::MIN_POSITIVE).sqrt(),
            precision: covariance.try_inverse()?,
        })
    }

    /// That of colours with this sum, a share of so many in `all`; `None` where it is too few.
    fn of_sum(sum: &Bin, all: f64) -> Option<Self> {
        if sum.count < LEAST_WEIGHT {
            return None;
        }
        let floor = LEAST_DEVIATION.powi(2) * Matrix3::identity();
        Self::of(sum.count / all, sum.mean(), &(sum.covariance() + floor))
    }

    /// Without the factor that all mixtures have.
    fn density(&self, colour: &Vector3<f64>) -> f64 {
        let off = colour - self.mean;
        let squares = off.dot(&(self.precision * off));
        // Far below the least density that is believed.
        if squares > FARTHEST_SQUARES {
            return 0.0;
        }
        self.height * (-0.5 * squares).exp()
    }
}

impl Mixture {
    /// A mixture of at most `parts` normal distributions of these colours (Dempster, Laird and Rubin
    /// 1977), begun at groups that are parted across their greatest spread (Orchard and Bouman 1991)
    /// and settled (Lloyd 1982). No chance is in it: nearly the same colours give nearly the same mixture. It has none
    /// where there are fewer colours than parts.
    pub fn learned(colours: &Colours, parts: usize) -> Self {
        let all = colours.count();
        if all < parts as f64 {
            return Self { parts: Vec::new() };
        }
        let mut groups = Groups::parted(colours, parts);
        for _ in 0..SETTLING_ROUNDS {
            groups.settle(colours);
        }
        let sums = groups.sums.iter();
        let mut mixture = Self {
            parts: sums.filter_map(|sum| Normal::of_sum(sum, all)).collect(),
        };
        for _ in 0..ROUNDS {
            mixture = mixture.improved(colours, all);
        }
        mixture
    }

    /// The normal distributions of the colours of which each has the share in each part that this
    /// mixture gives it.
    fn improved(&self, colours: &Colours, all: f64) -> Self {
        let mut sums = vec![Bin::default(); self.parts.len()];
        let mut densities = vec![0.0; self.parts.len()];
        for bin in &colours.bins {
            let colour = bin.mean();
            for (density, part) in densities.iter_mut().zip(&self.parts) {
                *density = part.density(&colour);
            }
            let of_all = LEAST_DENSITY + densities.iter().sum::<f64>();
            for (sum, density) in sums.iter_mut().zip(&densities) {
                sum.add(bin, density / of_all);
            }
        }
        let sums = sums.iter();
        Self {
            parts: sums.filter_map(|sum| Normal::of_sum(sum, all)).collect(),
        }
    }

    /// The mixture of these parts alone; their shares add up to 1.
    pub fn of_parts(parts: &[Normal]) -> Self {
        let all: f64 = parts.iter().map(|part| part.share).sum();
        let mut own = parts.to_vec();
        for part in &mut own {
            part.share /= all.max(f64::MIN_POSITIVE);
            part.height /= all.max(f64::MIN_POSITIVE);
        }
        Self { parts: own }
    }

    /// One of OpenCV's, whose numbers these are.
    fn of(numbers: &[f64]) -> Self {
        let mut parts = Vec::with_capacity(PARTS);
        if numbers.len() < NUMBERS {
            return Self { parts };
        }
        for k in 0..PARTS {
            let mean = Vector3::from_column_slice(&numbers[MEANS + 3 * k..][..3]);
            let covariance = Matrix3::from_row_slice(&numbers[COVARIANCES + 9 * k..][..9]);
            let covariance = covariance + ROUNDING * Matrix3::identity();
            parts.extend(Normal::of(numbers[k], mean, &covariance));
        }
        Self { parts }
    }

    /// Without the factor that all mixtures have.
    pub fn density(&self, colour: &Vector3<f64>) -> f64 {
        let parts = self.parts.iter().filter(|part| part.height > 0.0);
        LEAST_DENSITY + parts.map(|part| part.density(colour)).sum::<f64>()
    }
}

/// How much more likely a colour is in one mixture than in another one.
pub struct LogRatio {
    pub first: Mixture,
    pub second: Mixture,
}

impl LogRatio {
    /// The odds that a colour is of the first, as a logarithm.
    pub fn of(&self, colour: &Vector3<f64>) -> f64 {
        (self.first.density(colour) / self.second.density(colour)).ln()
    }

    /// The same within the bounds in which it is believed.
    pub fn believed(&self, colour: &Vector3<f64>) -> f64 {
        let most = f64::from(COLOUR_ODDS);
        self.of(colour).clamp(-most, most)
    }

    /// The mean odds of colours, without bounds.
    pub fn mean(&self, colours: &Colours) -> f64 {
        let odds = colours
            .bins
            .iter()
            .map(|bin| bin.count * self.of(&bin.mean()));
        odds.sum::<f64>() / colours.count()
    }
}

/// Colours in groups.
struct Groups {
    /// The group of each bin.
    of_bin: Vec<usize>,
    sums: Vec<Bin>,
}

impl Groups {
    /// So many groups at most: again and again the one with the greatest spread along any direction
    /// is parted at its mean, across that direction.
    fn parted(colours: &Colours, count: usize) -> Self {
        let mut groups = Self {
            of_bin: vec![0; colours.bins.len()],
            sums: vec![Bin::default()],
        };
        for bin in &colours.bins {
            groups.sums[0].add(bin, 1.0);
        }
        while groups.sums.len() < count && groups.part_widest(colours) {}
        groups
    }

    /// Every colour comes to the group whose mean is nearest to it.
    fn settle(&mut self, colours: &Colours) {
        let filled = self.sums.iter().filter(|sum| sum.count > 0.0);
        let means: Vec<Vector3<f64>> = filled.map(Bin::mean).collect();
        self.sums = vec![Bin::default(); means.len()];
        for (group, bin) in self.of_bin.iter_mut().zip(&colours.bins) {
            *group = nearest(&means, &bin.mean());
            self.sums[*group].add(bin, 1.0);
        }
    }

    /// Whether one could be parted.
    fn part_widest(&mut self, colours: &Colours) -> bool {
        let spreads = self.sums.iter().map(Spread::of).enumerate();
        let widest = spreads.max_by(|(_, a), (_, b)| a.sum.total_cmp(&b.sum));
        let Some((widest, spread)) = widest else {
            return false;
        };
        let mean = self.sums[widest].mean();
        let mut sums = [Bin::default(), Bin::default()];
        let new = self.sums.len();
        for (group, bin) in self.of_bin.iter_mut().zip(&colours.bins) {
            if *group == widest {
                let beyond = (bin.mean() - mean).dot(&spread.along) > 0.0;
                sums[usize::from(beyond)].add(bin, 1.0);
                *group = if beyond { new } else { widest };
            }
        }
        let [near, beyond] = sums;
        let is_parted = near.count > 0.0 && beyond.count > 0.0;
        if is_parted {
            self.sums[widest] = near;
            self.sums.push(beyond);
        }
        is_parted
    }
}

/// Which of the means is nearest to a colour.
fn nearest(means: &[Vector3<f64>], colour: &Vector3<f64>) -> usize {
    let mut best = (0, f64::INFINITY);
    for (k, mean) in means.iter().enumerate() {
        let apart = (mean - colour).norm_squared();
        if apart < best.1 {
            best = (k, apart);
        }
    }
    best.0
}

/// How far the colours of a group are spread along the direction in which they are most.
struct Spread {
    along: Vector3<f64>,
    /// Sum of the squares along it.
    sum: f64,
}

impl Spread {
    fn of(group: &Bin) -> Self {
        let eigen = group.covariance().symmetric_eigen();
        let most = eigen.eigenvalues.imax();
        Self {
            along: eigen.eigenvectors.column(most).into_owned(),
            sum: group.count * eigen.eigenvalues[most],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::generator;
    use rand::RngExt;

    #[test]
    fn colours_speak_for_what_they_were_seen_in() {
        let (mut pixels, mut seeds) = (Vec::new(), Vec::new());
        for k in 0..300_u16 {
            let rough = (k * 7 % 23) as u8;
            pixels.push(Vec3b::from([70 + rough, 90 + rough / 2, 110 + rough]));
            seeds.push(Seed::Wood);
            pixels.push(Vec3b::from([200 + rough, 190 + rough, 180 + rough / 3]));
            seeds.push(Seed::Other);
            pixels.push(Vec3b::from([0, 255, 0]));
            seeds.push(Seed::Unknown);
        }
        let mixtures = Mixtures::of(&pixels, &seeds).expect("opencv").expect("two");
        let odds = |colour: [u8; 3]| mixtures.odds_of_wood(&Vec3b::from(colour));
        assert!(odds([80, 95, 120]) > 5.0 && odds([210, 200, 183]) < -5.0);
        // Never seen at all.
        assert!(odds([0, 255, 0]).abs() < 1e-6);
        let few = Mixtures::of(&pixels[..60], &seeds[..60]).expect("opencv");
        assert!(few.is_none());
    }

    #[test]
    fn the_parts_of_a_mixture_are_found() {
        let means = [
            [40.0, 60.0, 50.0],
            [200.0, 210.0, 190.0],
            [90.0, 160.0, 60.0],
        ];
        let mut random = generator(3, 0);
        let mut colours = Vec::new();
        for k in 0..3000 {
            // Half of all are of the first.
            let mean = Vector3::from(means[[0, 1, 0, 2][k % 4]]);
            let noise = Vector3::from_fn(|_, _| random.random_range(-8.0..8.0));
            colours.push(mean + noise);
        }
        let learned = |colours: &[Vector3<f64>]| {
            Mixture::learned(&Colours::counted(colours.iter().copied()), 3)
        };
        let mixture = learned(&colours);
        assert_eq!(mixture.parts.len(), 3);
        for (mean, share) in means.iter().zip([0.5, 0.25, 0.25]) {
            let mean = Vector3::from(*mean);
            let found = mixture.parts.iter().find(|p| (p.mean - mean).norm() < 1.5);
            assert!(
                found.is_some_and(|p| (p.share - share).abs() < 0.01),
                "{mean}"
            );
        }
        let alone = Mixture::of_parts(&mixture.parts[..1]);
        assert!((alone.parts[0].share - 1.0).abs() < 1e-12);
        assert!(learned(&colours[..2]).parts.is_empty());
        let same = learned(&[Vector3::repeat(9.0); 40]);
        assert!(same.density(&Vector3::repeat(9.0)).is_finite());
    }
}

//! How thick the wood is: circles where it is thick, a taper towards a twig's radius where it is
//! thin.
//!
//! Radii below some centimetres that are fitted to a scan are too large in every tool; a taper
//! along each path to the radius of a twig is what makes volumes right (Morales & MacFarlane 2025,
//! "Reducing tree volume overestimation in quantitative structure modeling using modeled branch
//! topology and direct twig measurements").

use super::circle::Circle;
use super::paths::{Joint, Measured, Path};
use crate::signal::median;
use nalgebra::{Point2, Point3, Vector3};

/// From this radius on fitted circles are believed, m.
pub(super) const THICK_M: f64 = 0.03;
/// A circle is believed with so many points on so much of it, and points off it by up to this share
/// of its radius.
const LEAST_POINTS: usize = 12;
const LEAST_COVERED: f64 = 1.0 / 3.0;
const MOST_SPREAD: f64 = 0.2;
/// It is no larger than the points reach from its place, times this.
const LARGEST_SHARE: f64 = 1.5;
/// Points of a place that are looked at.
const MOST_POINTS: usize = 1500;
/// Places to both sides whose points are taken as well.
const AROUND: usize = 0;
/// Radius of a twig where the cloud does not show it, and the bounds in which it may, m.
const TWIG_M: f64 = 0.003;
const LEAST_TWIG_M: f64 = 0.001;
const LARGEST_TWIG_M: f64 = 0.015;
/// Places at the tip of a path that show its twig.
const TIP_PLACES: usize = 3;
/// Of the twigs of a cloud this share is thinner than the one that is taken.
const TWIG_QUANTILE: f64 = 0.25;
/// Measured radii on each of which the taper common to all thin paths weighs as much.
const PRIOR_PLACES: f64 = 5.0;
/// A branch is no thicker than this share of what it leaves.
const LARGEST_OF_PARENT: f64 = 0.95;

/// The points of a cloud by the thinned point that they are in.
pub(super) struct Detail<'a> {
    points: &'a [Point3<f32>],
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl<'a> Detail<'a> {
    /// `of_point` says for each point in which of `thinned` it is, or `u32::MAX`.
    pub fn new(points: &'a [Point3<f32>], of_point: &[u32], thinned: usize) -> Self {
        let mut starts = vec![0_u32; thinned + 1];
        for of in of_point.iter().filter(|of| **of != u32::MAX) {
            starts[*of as usize + 1] += 1;
        }
        for i in 0..thinned {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut order = vec![0; starts[thinned] as usize];
        for (point, of) in (0..).zip(of_point).filter(|(_, of)| **of != u32::MAX) {
            order[next[*of as usize] as usize] = point;
            next[*of as usize] += 1;
        }
        Self {
            points,
            starts,
            order,
        }
    }

    /// The points in some thinned ones, at most [`MOST_POINTS`] of them, evenly.
    fn of(&self, thinned: &[u32]) -> Vec<Point3<f64>> {
        let mut all: Vec<u32> = Vec::new();
        for t in thinned {
            all.extend(
                &self.order
                    [self.starts[*t as usize] as usize..self.starts[*t as usize + 1] as usize],
            );
        }
        let step = all.len().div_ceil(MOST_POINTS).max(1);
        all.iter()
            .step_by(step)
            .map(|p| self.points[*p as usize].cast())
            .collect()
    }
}

/// Measures the radius of every place, and moves the places to the middles of their circles.
pub(super) fn measure(paths: &mut [Path], detail: &Detail) {
    for path in paths.iter_mut() {
        let all = 0..path.places.len();
        let across: Vec<Across> = all.map(|k| Across::of(path, k, detail)).collect();
        for (place, across) in path.places.iter_mut().zip(&across) {
            let found = across.circle();
            place.measured = found.map(|circle| Measured {
                radius: circle.radius,
                spread: circle.spread,
                points: across.points.len(),
                is_circle: true,
            });
            if let Some(circle) = found {
                place.at += across.axes[0] * circle.middle.x + across.axes[1] * circle.middle.y;
            }
        }
    }
    let noise = noise(paths);
    for path in paths.iter_mut() {
        for k in 0..path.places.len() {
            if path.places[k].measured.is_none_or(|m| m.radius < THICK_M) {
                path.places[k].measured = Across::of(path, k, detail).mean_distance(noise);
            }
        }
    }
}

/// The standard deviation of points off thick wood, m; 0 where no circle shows it.
pub(super) fn noise(paths: &[Path]) -> f64 {
    let circles = paths
        .iter()
        .flat_map(|p| &p.places)
        .filter_map(|p| p.measured);
    let spreads: Vec<f64> = circles
        .filter(|m| m.is_circle && m.radius >= THICK_M)
        .map(|m| m.spread)
        .collect();
    median(spreads, f64::total_cmp).unwrap_or(0.0)
}

/// The points of a place, seen along the wood.
struct Across {
    points: Vec<Point2<f64>>,
    axes: [Vector3<f64>; 2],
}

impl Across {
    fn of(path: &Path, place: usize, detail: &Detail) -> Self {
        let along = path.direction(place);
        let beside = if along.z.abs() < 0.9 {
            Vector3::z()
        } else {
            Vector3::x()
        };
        let first = along.cross(&beside).normalize();
        let axes = [first, along.cross(&first)];
        let middle = path.places[place].at;
        let around = place.saturating_sub(AROUND)..(place + AROUND + 1).min(path.places.len());
        let mut thinned: Vec<u32> = Vec::new();
        path.places[around]
            .iter()
            .for_each(|p| thinned.extend(&p.points));
        let points = detail.of(&thinned);
        let flat = points
            .iter()
            .map(|p| Point2::new((p - middle).dot(&axes[0]), (p - middle).dot(&axes[1])));
        Self {
            points: flat.collect(),
            axes,
        }
    }

    /// The circle through them, if it is to be believed.
    fn circle(&self) -> Option<Circle> {
        if self.points.len() < LEAST_POINTS {
            return None;
        }
        let farthest = self
            .points
            .iter()
            .map(|p| p.coords.norm())
            .fold(0.0, f64::max);
        Circle::through(&self.points).filter(|c| {
            c.covered >= LEAST_COVERED
                && c.spread < MOST_SPREAD * c.radius
                && c.radius < LARGEST_SHARE * farthest
                && c.middle.coords.norm() < c.radius
        })
    }

    /// Their distance from the middle line, without what noise adds to its square in two
    /// directions.
    fn mean_distance(&self, noise: f64) -> Option<Measured> {
        let squares: Vec<f64> = self
            .points
            .iter()
            .map(|p| p.coords.norm_squared())
            .collect();
        let square = (median(squares, f64::total_cmp)? - 2.0 * noise * noise).max(0.0);
        Some(Measured {
            radius: square.sqrt(),
            spread: noise,
            points: self.points.len(),
            is_circle: false,
        })
    }
}

/// The radius of the last twigs: as given, or as the thinner ones of the tips show it, m.
pub(super) fn twig_radius(paths: &[Path], noise: f64, given: Option<f64>) -> f64 {
    if let Some(given) = given {
        return given;
    }
    let mut tips: Vec<f64> = Vec::new();
    for path in paths {
        let last = path
            .places
            .iter()
            .rev()
            .take(TIP_PLACES)
            .filter_map(|p| p.measured);
        tips.extend(median(last.map(|m| m.radius).collect(), f64::total_cmp));
    }
    if tips.is_empty() {
        return TWIG_M;
    }
    let place = (TWIG_QUANTILE * (tips.len() - 1) as f64) as usize;
    let shown = *tips.select_nth_unstable_by(place, f64::total_cmp).1;
    // A radius that drowns in noise says nothing.
    if shown > noise {
        shown.clamp(LEAST_TWIG_M, LARGEST_TWIG_M)
    } else {
        TWIG_M
    }
}

/// Gives every place its radius; `twig` is that of the tips, m.
pub(super) fn assign(paths: &mut [Path], twig: f64) {
    let common = common_taper(paths, twig);
    for i in 0..paths.len() {
        let most = match paths[i].on {
            Some(Joint { path, place }) => LARGEST_OF_PARENT * paths[path].places[place].radius,
            None => f64::INFINITY,
        };
        let radii = match thick_part(&paths[i]) {
            Some(thick) => thick.with_taper(&paths[i], twig),
            None => thin(&paths[i], twig, common),
        };
        for (place, radius) in paths[i].places.iter_mut().zip(radii) {
            place.radius = radius.min(most.max(twig));
        }
    }
}

/// By how much thin wood is thicker for each metre from its tip: the mean over the tree.
fn common_taper(paths: &[Path], twig: f64) -> f64 {
    let (mut sum, mut squares) = (0.0, 1e-9);
    for path in paths {
        for (k, place) in path.places.iter().enumerate() {
            if let Some(m) = place.measured.filter(|m| m.radius < THICK_M) {
                let length = path.length_from(k);
                sum += length * (m.radius - twig);
                squares += length * length;
            }
        }
    }
    (sum / squares).max(0.0)
}

/// A path on which no circle is large enough: straight from the twig's radius at its tip on.
fn thin(path: &Path, twig: f64, common: f64) -> Vec<f64> {
    let lengths: Vec<f64> = (0..path.places.len())
        .map(|k| path.length_from(k))
        .collect();
    let weight = PRIOR_PLACES * lengths.iter().map(|l| l * l).sum::<f64>() / lengths.len() as f64;
    let (mut sum, mut squares) = (weight * common, weight + 1e-9);
    for (place, length) in path.places.iter().zip(&lengths) {
        if let Some(m) = place.measured {
            sum += length * (m.radius.min(THICK_M) - twig);
            squares += length * length;
        }
    }
    let taper = (sum / squares).max(0.0);
    lengths.iter().map(|l| twig + taper * l).collect()
}

/// The places of a path whose circles are believed, and radii that nowhere grow.
struct ThickPart {
    places: Vec<usize>,
    radii: Vec<f64>,
}

/// `None` where no place of the path is thick.
fn thick_part(path: &Path) -> Option<ThickPart> {
    let mut part = ThickPart {
        places: Vec::new(),
        radii: Vec::new(),
    };
    let mut weights = Vec::new();
    for (k, place) in path.places.iter().enumerate() {
        if let Some(m) = place
            .measured
            .filter(|m| m.is_circle && m.radius >= THICK_M)
        {
            part.places.push(k);
            part.radii.push(m.radius);
            weights.push((m.points as f64).sqrt());
        }
    }
    if part.places.len() < 2 {
        return None;
    }
    let medians: Vec<f64> = (0..part.radii.len())
        .map(|k| {
            let reach = 2.min(k).min(part.radii.len() - 1 - k);
            median(part.radii[k - reach..=k + reach].to_vec(), f64::total_cmp)
                .unwrap_or(part.radii[k])
        })
        .collect();
    part.radii = falling(&medians, &weights);
    Some(part)
}

impl ThickPart {
    /// The radius at every place of the path.
    fn with_taper(&self, path: &Path, twig: f64) -> Vec<f64> {
        let last = self.places.len() - 1;
        let left = path.length_from(self.places[last]);
        let mut radii = Vec::with_capacity(path.places.len());
        for k in 0..path.places.len() {
            let next = self.places.partition_point(|p| *p < k);
            radii.push(if next > last {
                twig + (self.radii[last] - twig) * path.length_from(k) / left.max(1e-9)
            } else if next == 0 || self.places[next] == k {
                self.radii[next]
            } else {
                let (from, to) = (self.places[next - 1], self.places[next]);
                let share = (k - from) as f64 / (to - from) as f64;
                self.radii[next - 1] + (self.radii[next] - self.radii[next - 1]) * share
            });
        }
        radii
    }
}

/// The values nearest to these that nowhere rise (pool adjacent violators, Ayer et al. 1955).
fn falling(values: &[f64], weights: &[f64]) -> Vec<f64> {
    let mut pools: Vec<Pool> = Vec::new();
    for (value, weight) in values.iter().zip(weights) {
        let mut own = Pool {
            mean: *value,
            weight: *weight,
            count: 1,
        };
        while let Some(before) = pools.pop_if(|before| before.mean < own.mean) {
            let weight = before.weight + own.weight;
            own = Pool {
                mean: (before.mean * before.weight + own.mean * own.weight) / weight,
                weight,
                count: before.count + own.count,
            };
        }
        pools.push(own);
    }
    pools
        .iter()
        .flat_map(|pool| std::iter::repeat_n(pool.mean, pool.count))
        .collect()
}

/// Neighbouring values that are given their mean.
struct Pool {
    mean: f64,
    weight: f64,
    count: usize,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::paths::Place;

    #[test]
    fn radii_nowhere_grow() {
        assert_eq!(
            falling(&[3.0, 1.0, 2.0, 0.5], &[1.0; 4]),
            [3.0, 1.5, 1.5, 0.5]
        );
        assert_eq!(falling(&[1.0, 2.0, 3.0], &[1.0, 1.0, 2.0]), [2.25; 3]);
    }

    fn path(measured: &[Option<f64>]) -> Path {
        let mut path = Path::default();
        for (k, radius) in (0..).zip(measured) {
            let mut place = Place::new(Point3::new(0.0, 0.0, f64::from(k)));
            place.measured = radius.map(|radius| Measured {
                radius,
                spread: 0.001,
                points: 50,
                is_circle: radius >= THICK_M,
            });
            path.places.push(place);
        }
        path
    }

    /// Behind the last thick place it falls evenly to the twig, whatever was measured there.
    #[test]
    fn thin_wood_tapers_to_the_twig() {
        let mut paths = [path(&[
            Some(0.2),
            None,
            Some(0.1),
            Some(0.02),
            Some(0.5e-2),
            Some(0.029),
        ])];
        assign(&mut paths, 0.004);
        let radii: Vec<f64> = paths[0].places.iter().map(|p| p.radius).collect();
        let expected = [0.2, 0.15, 0.1, 0.068, 0.036, 0.004];
        assert!(
            radii
                .iter()
                .zip(expected)
                .all(|(r, e)| (r - e).abs() < 1e-9),
            "{radii:?}"
        );
        assert_eq!(twig_radius(&paths, 0.003, Some(0.002)), 0.002);
        assert_eq!(twig_radius(&paths, 0.9, None), TWIG_M);
    }
}

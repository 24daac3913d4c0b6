//! Fewer points: one for each cell of a grid, and none that stands alone.

use super::grid::{Grid, sorted_cells};
use nalgebra::{Point3, Vector3};

/// Neighbours whose mean distance says how alone a point is, and from how many standard deviations
/// above the mean of all on it is noise (Rusu et al. 2008, "Towards 3D point cloud based object
/// maps", sect. 4.1).
const NEIGHBOURS: usize = 8;
const OUTLIER_SIGMA: f64 = 3.0;
/// Neighbours are looked for so many cells away.
const REACH_CELLS: f32 = 5.0;

/// One point for each cell that holds any.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Thinned {
    /// The mean of the points of each cell.
    pub points: Vec<Point3<f32>>,
    /// For every point that was thinned, its place in `points`.
    pub of_point: Vec<u32>,
}

impl Thinned {
    /// One point for each cell with sides of `cell`.
    pub fn of(points: &[Point3<f32>], cell: f32) -> Self {
        let mut thinned = Self {
            points: Vec::new(),
            of_point: vec![0; points.len()],
        };
        let mut before = None;
        let (mut sum, mut count) = (Vector3::zeros(), 0.0);
        for (key, point) in sorted_cells(points, cell) {
            if before.is_some_and(|b| b != key) {
                thinned.points.push(Point3::from(sum / count).cast());
                (sum, count) = (Vector3::zeros(), 0.0);
            }
            before = Some(key);
            sum += points[point as usize].coords.cast::<f64>();
            count += 1.0;
            thinned.of_point[point as usize] = thinned.points.len() as u32;
        }
        if before.is_some() {
            thinned.points.push(Point3::from(sum / count).cast());
        }
        thinned
    }

    /// How many of the points that were thinned are in one that is kept.
    pub fn kept_points(&self) -> usize {
        self.of_point.iter().filter(|of| **of != u32::MAX).count()
    }

    /// The same without the points that are not `kept`; what was in them is of no point,
    /// `u32::MAX`.
    pub fn without(&mut self, kept: &[bool]) {
        let mut place = Vec::with_capacity(kept.len());
        let mut next = 0;
        for keep in kept {
            place.push(if *keep { next } else { u32::MAX });
            next += u32::from(*keep);
        }
        let mut flags = kept.iter();
        self.points.retain(|_| flags.next() == Some(&true));
        for of in &mut self.of_point {
            *of = place.get(*of as usize).copied().unwrap_or(u32::MAX);
        }
    }
}

/// Which points are near enough to others not to be noise; `cell` is about their distance.
pub(super) fn is_no_outlier(points: &[Point3<f32>], cell: f32) -> Vec<bool> {
    let reach = REACH_CELLS * cell;
    let grid = Grid::new(points, reach);
    let mut distances = Vec::with_capacity(points.len());
    let mut near: Vec<f32> = Vec::new();
    for at in points {
        near.clear();
        grid.within(at, reach, |_, square| near.push(square));
        // What has fewer neighbours than that is as far from them as the reach.
        near.resize(near.len().max(NEIGHBOURS + 1), reach * reach);
        near.select_nth_unstable_by(NEIGHBOURS, f32::total_cmp);
        let sum: f32 = near[..=NEIGHBOURS].iter().map(|square| square.sqrt()).sum();
        distances.push(f64::from(sum) / NEIGHBOURS as f64);
    }
    let count = distances.len().max(1) as f64;
    let mean = distances.iter().sum::<f64>() / count;
    let variance = distances.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / count;
    let most = mean + OUTLIER_SIGMA * variance.sqrt();
    distances.iter().map(|d| *d <= most).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_keeps_the_mean_of_its_points() {
        let points = [[0.1, 0.1, 0.1], [1.5, 0.2, 0.0], [0.3, 0.1, 0.1]].map(Point3::from);
        let mut thinned = Thinned::of(&points, 1.0);
        assert_eq!(thinned.points.len(), 2);
        assert_eq!(thinned.of_point, [0, 1, 0]);
        assert!((thinned.points[0].x - 0.2).abs() < 1e-6);
        thinned.without(&[false, true]);
        assert_eq!(thinned.of_point, [u32::MAX, 0, u32::MAX]);
        assert_eq!(thinned.points, [points[1]]);
        assert_eq!(Thinned::of(&[], 1.0), Thinned::default());
    }

    #[test]
    fn a_point_alone_is_noise() {
        let mut points: Vec<Point3<f32>> = Vec::new();
        for i in 0..20 {
            for k in 0..20 {
                points.push(Point3::new(i as f32, k as f32, 0.0));
            }
        }
        points.push(Point3::new(5.0, 5.0, 4.0));
        let kept = is_no_outlier(&points, 1.0);
        // But for the corners, whose neighbours lie on one side.
        assert!(kept[..400].iter().filter(|k| **k).count() >= 396);
        assert!(!kept[400]);
    }
}

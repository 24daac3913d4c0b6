//! How well the wood that was found agrees with the points, and with how trees are built.

use super::paths::{Measured, Path};
use crate::signal::median;
use crate::signal::statistics::quantile;
use nalgebra::Point3;

/// A point lies on the wood if it is no farther than this from its surface, m, ...
const ON_WOOD_M: f64 = 0.01;
/// ... or than this share of the cell in which points are one, ...
const ON_WOOD_CELLS: f64 = 0.5;
/// ... or than the share of its radius by which wood is not round.
const OUT_OF_ROUND: f64 = 0.25;
/// The foot is the lowest part of the trunk, this share of the tree's height ...
pub(super) const FOOT_SHARE: f64 = 0.15;
/// ... and in it the lowest circles say how thick it is.
const FOOT_CIRCLES: usize = 5;
/// A branch is large if it is at least this share of the tree's height long: shoots at the foot are not.
const LARGE_SHARE: f64 = 0.15;
/// Of all circles of a tree this share is thinner than its thickest wood: single ones about forks are too
/// large.
const THICKEST_QUANTILE: f64 = 0.98;

/// The share of the points that lie on the wood. `points` are the thinned ones, `cell` is their distance,
/// m; so many of them hang together with the foot, also where no path has them.
pub(super) fn on_wood(paths: &[Path], points: &[Point3<f32>], cell: f64, hanging: usize) -> f64 {
    let mut near = 0_usize;
    for path in paths {
        for (k, place) in path.places.iter().enumerate() {
            let along = path.direction(k);
            let most = ON_WOOD_M
                .max(ON_WOOD_CELLS * cell)
                .max(OUT_OF_ROUND * place.radius);
            for point in &place.points {
                let from_place = points[*point as usize].cast() - place.at;
                let from_line = from_place.cross(&along).norm();
                near += usize::from((from_line - place.radius).abs() <= most);
            }
        }
    }
    near as f64 / hanging.max(1) as f64
}

/// How thick the foot of the trunk is against the thickest wood. A tree is thickest there; what
/// stands on its head or lies, or is no tree, is not. `None` where the foot has no circle.
pub(super) fn foot_share(paths: &[Path]) -> Option<f64> {
    let trunk = paths.first()?;
    let bottom = trunk.places.first()?.at.z;
    let low = bottom + FOOT_SHARE * (top(paths, bottom) - bottom);
    let lowest = circles(trunk).filter(|(z, _)| *z <= low);
    let lowest = lowest.map(|(_, circle)| circle.radius).take(FOOT_CIRCLES);
    let foot = median(lowest.collect(), f64::total_cmp)?;
    let all = paths.iter().flat_map(circles);
    let radii = all.map(|(_, circle)| circle.radius).collect();
    Some(foot / quantile(radii, THICKEST_QUANTILE)?)
}

/// How high the lowest large branch leaves the trunk, as a share of the tree's height; `None` where no
/// such one does.
pub(super) fn clear_stem(paths: &[Path]) -> Option<f64> {
    let trunk = paths.first()?;
    let bottom = trunk.places.first()?.at.z;
    let height = top(paths, bottom) - bottom;
    let is_large = |path: &&Path| path.length_from(0) >= LARGE_SHARE * height;
    let joints = paths.iter().filter(is_large).filter_map(|path| path.on);
    let heights = joints
        .filter(|on| on.path == 0)
        .map(|on| (trunk.places[on.place].at.z - bottom) / height);
    heights.min_by(f64::total_cmp)
}

/// The highest place, m; `bottom` of none.
fn top(paths: &[Path], bottom: f64) -> f64 {
    let places = paths.iter().flat_map(|path| &path.places);
    places.map(|place| place.at.z).fold(bottom, f64::max)
}

/// The circles of a path from its base on, and their heights, m.
fn circles(path: &Path) -> impl Iterator<Item = (f64, Measured)> {
    let measured = path
        .places
        .iter()
        .filter_map(|p| Some((p.at.z, p.measured?)));
    measured.filter(|(_, measured)| measured.is_circle)
}

#[cfg(test)]
mod tests {
    use super::super::paths::{Joint, Place};
    use super::*;

    /// A path up with these radii, 0.1 m apart, and four points round every place.
    fn upright(radii: &[f64]) -> (Path, Vec<Point3<f32>>) {
        let mut path = Path::default();
        let mut points: Vec<Point3<f32>> = Vec::new();
        for (k, radius) in (0..).zip(radii) {
            let at = Point3::new(0.0, 0.0, 0.1 * f64::from(k));
            let mut place = Place::new(at);
            place.radius = *radius;
            place.measured = Some(Measured {
                radius: *radius,
                spread: 0.001,
                points: 4,
                is_circle: true,
            });
            for (x, y) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
                place.points.push(points.len() as u32);
                let around = Point3::new(radius * x, radius * y, at.z);
                points.push(around.cast());
            }
            path.places.push(place);
        }
        (path, points)
    }

    #[test]
    fn points_round_the_wood_lie_on_it_and_others_do_not() {
        let (path, mut points) = upright(&[0.1; 20]);
        let paths = [path];
        assert_eq!(on_wood(&paths, &points, 0.01, 80), 1.0);
        // A limb that no path has.
        assert_eq!(on_wood(&paths, &points, 0.01, 100), 0.8);
        for point in points.iter_mut().step_by(4) {
            point.x = 0.15;
        }
        assert_eq!(on_wood(&paths, &points, 0.01, 80), 0.75);
        // Points that are one in so coarse a cell are known no better.
        assert_eq!(on_wood(&paths, &points, 0.12, 80), 1.0);
    }

    #[test]
    fn the_stem_is_clear_up_to_the_lowest_large_branch() {
        let (trunk, _) = upright(&[0.1; 51]);
        let mut paths = vec![trunk];
        assert_eq!(clear_stem(&paths), None);
        for (place, length) in [(5, 3), (20, 20), (30, 15)] {
            let (mut branch, _) = upright(&vec![0.02; length]);
            branch.on = Some(Joint { path: 0, place });
            paths.push(branch);
        }
        let clear = clear_stem(&paths).expect("a branch");
        assert!((clear - 0.4).abs() < 1e-9, "{clear}");
    }

    #[test]
    fn a_tree_is_thickest_at_its_foot() {
        let radii: Vec<f64> = (0..100).map(|k| 0.2 - 0.001 * f64::from(k)).collect();
        let (mut path, _) = upright(&radii);
        let foot = foot_share(std::slice::from_ref(&path)).expect("circles");
        assert!((0.95..=1.05).contains(&foot), "{foot}");
        let (turned, _) = upright(&radii.iter().rev().copied().collect::<Vec<f64>>());
        let foot = foot_share(&[turned]).expect("circles");
        assert!(foot < 0.6, "{foot}");
        for place in &mut path.places[..20] {
            place.measured = None;
        }
        assert_eq!(foot_share(&[path]), None);
    }
}

//! The ground under a tree, and what stands on it.
//!
//! The lowest points of the cells of a grid are ground where they rise by no more than a slope from
//! cell to cell (Vosselman 2000, "Slope based filtering of laser altimetry data"), from the lowest
//! large piece on.

use crate::signal::statistics::quantile;
use nalgebra::{Matrix3, Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Cells of the grid in the height of the cloud.
const CELLS_IN_HEIGHT: f32 = 40.0;
/// How often cells are doubled at most, while fewer than half of those that hold a point hold enough.
const MOST_DOUBLINGS: i32 = 2;
/// Points that a cell must hold: the lowest two may be echoes from below the ground.
const LEAST_IN_CELL: usize = 3;
/// Steepest ground: about 35 degrees.
const STEEPEST: f32 = 0.7;
/// A piece is ground if it is so many cells large, and so wide as a share of the cloud's height, to
/// both sides.
const LEAST_CELLS: usize = 30;
const LEAST_WIDTH: f32 = 0.15;
/// The lower side of a crown is rough, and a piece of it is small. Ground is smooth, or all stands on it: its
/// roughness, divided by the share of the cloud's cells that it covers, is no more than this. 0.38
/// at most for real plots (three scanned from the ground, one from a drone, one from an aeroplane) and made clouds
/// down to 2 % of their points; 0.64 and more for what is found below crowns that were cut off (18 made trees of
/// seeds 68811 to 68830, a real spruce). Two parts of one of the plots, 10 m of undergrowth each, have 0.74 and 1.1.
const ROUGHEST: f32 = 0.5;
/// The roughness is the quantile of this share of how far the lowest points lie off planes through those about
/// them, up to so many cells away.
const ROUGH_QUANTILE: f64 = 0.75;
const ROUGH_REACH: i32 = 3;
/// Ground lies in the lowest part of the cloud, this share of its height.
const LOWEST_SHARE: f32 = 0.3;
/// Points up to this share of the cloud's height above the ground are ground, too: grass, and
/// noise.
const MARGIN_SHARE: f32 = 0.01;
/// Cells to each side whose lowest points a plane is laid through, and to how many at most where
/// there are none.
const PLANE_REACH: i32 = 2;
const FARTHEST_REACH: i32 = 64;

/// A cell of the grid, along x and y.
type Cell = (i32, i32);

/// The lowest points of cells that are ground.
#[derive(Clone, Debug)]
pub(super) struct Ground {
    cell: f32,
    lowest: BTreeMap<Cell, Point3<f32>>,
    margin: f32,
}

impl Ground {
    /// The ground of a cloud whose points are `height` high; `None` where the tree alone was cut
    /// out.
    pub fn of(points: &[Point3<f32>], height: f32) -> Option<Self> {
        let (cell, mut lowest) = lowest_of_cells(points, height / CELLS_IN_HEIGHT);
        let bottom = lowest.values().map(|p| p.z).fold(f32::INFINITY, f32::min);
        let mut best: Vec<Cell> = Vec::new();
        let mut taken: BTreeSet<Cell> = BTreeSet::new();
        for start in lowest.keys() {
            if taken.contains(start) {
                continue;
            }
            let piece = piece_from(*start, &lowest, STEEPEST * cell, &mut taken);
            let mut heights: Vec<f32> = piece.iter().map(|c| lowest[c].z).collect();
            heights.sort_unstable_by(f32::total_cmp);
            let is_low = heights[heights.len() / 2] < bottom + LOWEST_SHARE * height;
            if is_low && piece.len() > best.len() {
                best = piece;
            }
        }
        let extents = [
            extent(best.iter().map(|c| c.0)),
            extent(best.iter().map(|c| c.1)),
        ];
        let is_wide = extents
            .iter()
            .all(|cells| *cells as f32 * cell > LEAST_WIDTH * height);
        if best.len() < LEAST_CELLS || !is_wide {
            return None;
        }
        let cells = lowest.len();
        let piece: BTreeSet<Cell> = best.into_iter().collect();
        lowest.retain(|cell, _| piece.contains(cell));
        let covered = lowest.len() as f32 / cells as f32;
        let rough = roughness(&lowest, cell)?;
        if rough > ROUGHEST * covered {
            return None;
        }
        Some(Self {
            cell,
            lowest,
            margin: MARGIN_SHARE * height,
        })
    }

    /// Height of the ground below a place: of the plane through the lowest points of the cells
    /// about it, or about the nearest that are ground.
    pub fn height_at(&self, x: f32, y: f32) -> f32 {
        let about = cell_at(x, y, self.cell);
        let mut reach = PLANE_REACH;
        while reach <= FARTHEST_REACH {
            let near = near(&self.lowest, about, reach, &Point3::new(x, y, 0.0));
            if let Some(height) = height_of_plane(&near, self.cell) {
                return height;
            }
            reach *= 2;
        }
        self.lowest
            .values()
            .map(|p| p.z)
            .fold(f32::INFINITY, f32::min)
    }

    /// Whether a point is ground, or what grows on it.
    pub fn holds(&self, at: &Point3<f32>) -> bool {
        at.z < self.height_at(at.x, at.y) + self.margin
    }
}

/// Number of cells between the first and the last.
fn extent(places: impl Iterator<Item = i32> + Clone) -> i32 {
    places.clone().max().unwrap_or(0) - places.min().unwrap_or(0)
}

/// Height at the origin of the plane through points, the near ones first; their mean where they lie
/// on a line.
fn height_of_plane(near: &[Vector3<f32>], cell: f32) -> Option<f32> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    let (mut sum, mut weights) = (0.0, 0.0);
    for at in near {
        let weight = 1.0 / (at.xy().norm_squared() + cell * cell);
        let row = Vector3::new(at.x, at.y, cell);
        normal += weight * row * row.transpose();
        right += weight * at.z * row;
        sum += weight * at.z;
        weights += weight;
    }
    if near.is_empty() {
        return None;
    }
    let mean = sum / weights;
    let is_spread = near.len() > 3 && normal.determinant() > 1e-3 * normal.trace().powi(3) / 27.0;
    let plane = normal
        .cholesky()
        .filter(|_| is_spread)
        .map(|c| c.solve(&right).z * cell);
    Some(
        plane
            .filter(|h| (h - mean).abs() < STEEPEST * 4.0 * cell)
            .unwrap_or(mean),
    )
}

fn cell_at(x: f32, y: f32, cell: f32) -> Cell {
    ((x / cell).floor() as i32, (y / cell).floor() as i32)
}

/// The size of a cell, and the lowest point in each but two. Cells are `least` wide, larger where points are sparse.
fn lowest_of_cells(points: &[Point3<f32>], least: f32) -> (f32, BTreeMap<Cell, Point3<f32>>) {
    let mut cell = least;
    for _ in 0..MOST_DOUBLINGS {
        let low = low_in_cells(points, cell);
        let full = low.values().filter(|low| low.len() == LEAST_IN_CELL);
        if 2 * full.count() >= low.len() {
            return (cell, highest_of(low));
        }
        cell *= 2.0;
    }
    (cell, highest_of(low_in_cells(points, cell)))
}

/// The highest of the lowest points of each cell that holds enough.
fn highest_of(low: BTreeMap<Cell, Vec<Point3<f32>>>) -> BTreeMap<Cell, Point3<f32>> {
    low.into_iter()
        .filter_map(|(cell, low)| Some((cell, *low.get(LEAST_IN_CELL - 1)?)))
        .collect()
}

/// The lowest points of each cell, [`LEAST_IN_CELL`] at most, the lowest first.
fn low_in_cells(points: &[Point3<f32>], cell: f32) -> BTreeMap<Cell, Vec<Point3<f32>>> {
    let mut low: BTreeMap<Cell, Vec<Point3<f32>>> = BTreeMap::new();
    for at in points {
        let lowest = low.entry(cell_at(at.x, at.y, cell)).or_default();
        if lowest.len() < LEAST_IN_CELL || at.z < lowest[LEAST_IN_CELL - 1].z {
            lowest.push(*at);
            lowest.sort_unstable_by(|a, b| a.z.total_cmp(&b.z));
            lowest.truncate(LEAST_IN_CELL);
        }
    }
    low
}

/// How far the lowest points lie off planes through those about them, cells. `None` where nothing lies about
/// any.
fn roughness(lowest: &BTreeMap<Cell, Point3<f32>>, cell: f32) -> Option<f32> {
    let mut off = Vec::with_capacity(lowest.len());
    for (own, at) in lowest {
        let mut near = near(lowest, *own, ROUGH_REACH, at);
        near.retain(|other| *other != Vector3::new(0.0, 0.0, at.z));
        if let Some(height) = height_of_plane(&near, cell) {
            off.push(f64::from((at.z - height).abs() / cell));
        }
    }
    quantile(off, ROUGH_QUANTILE).map(|off| off as f32)
}

/// The lowest points of the cells up to `reach` from one, to the side of a place.
fn near(
    lowest: &BTreeMap<Cell, Point3<f32>>,
    about: Cell,
    reach: i32,
    from: &Point3<f32>,
) -> Vec<Vector3<f32>> {
    let (x, y) = about;
    let mut near = Vec::new();
    for column in x - reach..=x + reach {
        let cells = lowest.range((column, y - reach)..=(column, y + reach));
        near.extend(cells.map(|(_, at)| Vector3::new(at.x - from.x, at.y - from.y, at.z)));
    }
    near
}

/// All cells that are reached from one without a step of more than `step`.
fn piece_from(
    start: Cell,
    lowest: &BTreeMap<Cell, Point3<f32>>,
    step: f32,
    taken: &mut BTreeSet<Cell>,
) -> Vec<Cell> {
    let mut piece = vec![start];
    let mut queue = VecDeque::from([start]);
    taken.insert(start);
    while let Some((x, y)) = queue.pop_front() {
        for next in [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)] {
            let Some(at) = lowest.get(&next) else {
                continue;
            };
            if (at.z - lowest[&(x, y)].z).abs() <= step && taken.insert(next) {
                piece.push(next);
                queue.push_back(next);
            }
        }
    }
    piece
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slope(x: f32, y: f32) -> f32 {
        0.2 * x - 0.1 * y
    }

    /// Low points in the middle of a wide cloud, at these heights by their cells of 0.1 m.
    fn below_a_crown(height_of_cell: impl Fn(usize, usize) -> f32) -> Vec<Point3<f32>> {
        let mut points = vec![Point3::new(1.0, 1.0, 4.0)];
        for i in 0..20 {
            for k in 0..20 {
                let is_low = (6..14).contains(&i) && (6..14).contains(&k);
                let z = if is_low { height_of_cell(i, k) } else { 2.0 };
                let at = [0.03, 0.06, 0.08].map(|x| (0.1 * i as f32 + x, 0.1 * k as f32 + x));
                points.extend(at.map(|(x, y)| Point3::new(x, y, z)));
            }
        }
        points
    }

    #[test]
    fn what_is_rough_and_small_is_no_ground() {
        let rough = below_a_crown(|i, k| 0.01 * ((7 * i + 5 * k) % 7) as f32);
        assert!(Ground::of(&rough, 4.0).is_none());
        let smooth = below_a_crown(|i, k| 0.01 * (i + k) as f32);
        assert!(Ground::of(&smooth, 4.0).is_some());
        // All stands on it.
        let mut alone = rough;
        alone.retain(|p| p.z < 1.0 || p.z > 3.0);
        assert!(Ground::of(&alone, 4.0).is_some());
    }

    /// Twenty points per square metre, spread evenly (Halton), as of a scan that was thinned.
    #[test]
    fn sparse_ground_is_found_in_larger_cells() {
        let mut points = vec![Point3::new(0.0, 0.0, 5.0)];
        for i in 1..720 {
            let (x, y) = (
                6.0 * radical_inverse(i, 2) - 3.0,
                6.0 * radical_inverse(i, 3) - 3.0,
            );
            points.push(Point3::new(x, y, slope(x, y)));
        }
        let ground = Ground::of(&points, 5.0).expect("ground");
        assert!((ground.height_at(1.0, 1.0) - slope(1.0, 1.0)).abs() < 0.15);
    }

    /// Number of a Halton sequence in 0 to 1.
    fn radical_inverse(mut i: u32, base: u32) -> f32 {
        let (mut part, mut sum) = (1.0, 0.0);
        while i > 0 {
            part /= base as f32;
            sum += part * (i % base) as f32;
            i /= base;
        }
        sum
    }

    /// A slope with a stem on it, and the stem alone.
    #[test]
    fn a_stem_on_a_slope_stands_on_ground_and_a_stem_alone_does_not() {
        let mut points: Vec<Point3<f32>> = Vec::new();
        for i in 0..200 {
            for k in 0..200 {
                let (x, y) = (0.03 * i as f32 - 3.0, 0.03 * k as f32 - 3.0);
                points.push(Point3::new(x, y, slope(x, y)));
            }
        }
        let stem: Vec<Point3<f32>> = (0..500)
            .map(|i| {
                let angle = i as f32;
                Point3::new(0.1 * angle.cos(), 0.1 * angle.sin(), 0.01 * i as f32)
            })
            .collect();
        points.extend(&stem);
        let ground = Ground::of(&points, 5.0).expect("ground");
        for (x, y) in [(0.0, 0.0), (1.5, -2.0), (-2.9, 2.9)] {
            assert!(
                (ground.height_at(x, y) - slope(x, y)).abs() < 0.01,
                "{x} {y}"
            );
        }
        assert!(ground.holds(&points[777]));
        assert!(!ground.holds(&stem[40]));
        assert!(Ground::of(&stem, 5.0).is_none());
    }
}

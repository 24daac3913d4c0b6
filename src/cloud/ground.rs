//! The ground under a tree, and what stands on it.
//!
//! The lowest points of the cells of a grid are ground where they rise by no more than a slope from
//! cell to cell (Vosselman 2000, "Slope based filtering of laser altimetry data"), from the lowest
//! large piece on.

use nalgebra::{Matrix3, Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Cells of the grid in the height of the cloud.
const CELLS_IN_HEIGHT: f32 = 40.0;
/// Steepest ground: about 35 degrees.
const STEEPEST: f32 = 0.7;
/// A piece is ground if it is so many cells large, and so wide as a share of the cloud's height, to
/// both sides.
const LEAST_CELLS: usize = 30;
const LEAST_WIDTH: f32 = 0.15;
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
        let cell = height / CELLS_IN_HEIGHT;
        let mut lowest = lowest_of_cells(points, cell);
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
        let piece: BTreeSet<Cell> = best.into_iter().collect();
        lowest.retain(|cell, _| piece.contains(cell));
        Some(Self {
            cell,
            lowest,
            margin: MARGIN_SHARE * height,
        })
    }

    /// Height of the ground below a place: of the plane through the lowest points of the cells
    /// about it, or about the nearest that are ground.
    pub fn height_at(&self, x: f32, y: f32) -> f32 {
        let (cx, cy) = cell_at(x, y, self.cell);
        let mut reach = PLANE_REACH;
        while reach <= FARTHEST_REACH {
            let mut near: Vec<Vector3<f32>> = Vec::new();
            for column in cx - reach..=cx + reach {
                let cells = self
                    .lowest
                    .range((column, cy - reach)..=(column, cy + reach));
                near.extend(cells.map(|(_, at)| Vector3::new(at.x - x, at.y - y, at.z)));
            }
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

/// The lowest point in each cell but two: a scanner has echoes from below the ground.
fn lowest_of_cells(points: &[Point3<f32>], cell: f32) -> BTreeMap<Cell, Point3<f32>> {
    let mut three: BTreeMap<Cell, Vec<Point3<f32>>> = BTreeMap::new();
    for at in points {
        let lowest = three.entry(cell_at(at.x, at.y, cell)).or_default();
        if lowest.len() < 3 || at.z < lowest[2].z {
            lowest.push(*at);
            lowest.sort_unstable_by(|a, b| a.z.total_cmp(&b.z));
            lowest.truncate(3);
        }
    }
    three.retain(|_, lowest| lowest.len() == 3);
    three
        .into_iter()
        .map(|(cell, lowest)| (cell, lowest[2]))
        .collect()
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

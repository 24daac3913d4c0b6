//! Which points are near a place.

use nalgebra::Point3;

/// Bits of a cell's number along one axis.
const BITS: u32 = 21;
const MIDDLE: i64 = 1 << (BITS - 1);
const LARGEST: i64 = (1 << BITS) - 1;

/// Points sorted into the cells of an even grid.
#[derive(Clone, Debug)]
pub(super) struct Grid<'a> {
    points: &'a [Point3<f32>],
    cell: f32,
    /// The numbers of the cells that hold points, rising.
    keys: Vec<u64>,
    /// Where the points of each cell begin in `order`, and the end.
    starts: Vec<u32>,
    order: Vec<u32>,
}

/// The cell of a place along the three axes. What lies a million cells away is put to the border.
fn cell_of(at: &Point3<f32>, cell: f32) -> [i64; 3] {
    let cell = f64::from(cell);
    [at.x, at.y, at.z]
        .map(|x| ((f64::from(x) / cell).floor() as i64 + MIDDLE).clamp(1, LARGEST - 1))
}

fn key_of([x, y, z]: [i64; 3]) -> u64 {
    ((x as u64) << (2 * BITS)) | ((y as u64) << BITS) | z as u64
}

/// The number of the cell of each point, and the point, sorted by the first.
pub(super) fn sorted_cells(points: &[Point3<f32>], cell: f32) -> Vec<(u64, u32)> {
    let numbers = (0..).zip(points);
    let mut all: Vec<(u64, u32)> = numbers
        .map(|(i, at)| (key_of(cell_of(at, cell)), i))
        .collect();
    all.sort_unstable();
    all
}

impl<'a> Grid<'a> {
    /// Cells with sides of `cell`, in the unit of the points; more than 0.
    pub fn new(points: &'a [Point3<f32>], cell: f32) -> Self {
        let sorted = sorted_cells(points, cell);
        let mut grid = Self {
            points,
            cell,
            keys: Vec::new(),
            starts: Vec::new(),
            order: Vec::with_capacity(sorted.len()),
        };
        for (key, point) in sorted {
            if grid.keys.last() != Some(&key) {
                grid.keys.push(key);
                grid.starts.push(grid.order.len() as u32);
            }
            grid.order.push(point);
        }
        grid.starts.push(grid.order.len() as u32);
        grid
    }

    /// Calls `visit` with each point nearer than `radius` to `at` and the square of its distance.
    pub fn within(&self, at: &Point3<f32>, radius: f32, mut visit: impl FnMut(u32, f32)) {
        let reach = Point3::new(radius, radius, radius).coords;
        let [low, high] = [at - reach, at + reach].map(|corner| cell_of(&corner, self.cell));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                // Cells above each other follow each other.
                let [first, last] = [low[2], high[2]].map(|z| key_of([x, y, z]));
                let begin = self.keys.partition_point(|key| *key < first);
                for (cell, key) in (begin..).zip(&self.keys[begin..]) {
                    if *key > last {
                        break;
                    }
                    for point in
                        &self.order[self.starts[cell] as usize..self.starts[cell + 1] as usize]
                    {
                        let square = (self.points[*point as usize] - at).norm_squared();
                        if square < radius * radius {
                            visit(*point, square);
                        }
                    }
                }
            }
        }
    }

    /// The nearest point that `is_wanted`, no farther than `most`, and its distance. Among points
    /// as near as each other it is the first.
    pub fn nearest(
        &self,
        at: &Point3<f32>,
        most: f32,
        is_wanted: impl Fn(u32) -> bool,
    ) -> Option<Near> {
        let mut radius = self.cell.min(most);
        loop {
            let mut best: Option<Near> = None;
            self.within(at, radius, |point, square| {
                let own = Near {
                    point,
                    distance: square.sqrt(),
                };
                if is_wanted(point) && best.is_none_or(|b| own.is_before(&b)) {
                    best = Some(own);
                }
            });
            if best.is_some() || radius >= most {
                return best;
            }
            radius = (2.0 * radius).min(most);
        }
    }
}

/// A point, and how far it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Near {
    pub point: u32,
    pub distance: f32,
}

impl Near {
    fn is_before(&self, other: &Self) -> bool {
        (self.distance, self.point) < (other.distance, other.point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against a look at every point.
    #[test]
    fn the_grid_finds_what_a_look_at_all_points_finds() {
        let number = |i: u32, of: u32| ((i * of) % 101) as f32 * 0.07 - 3.0;
        let points: Vec<Point3<f32>> = (0..400)
            .map(|i| Point3::new(number(i, 17), number(i, 31), number(i, 57)))
            .collect();
        let grid = Grid::new(&points, 0.4);
        for at in [
            Point3::origin(),
            Point3::new(-3.0, 1.0, 0.2),
            Point3::new(90.0, 0.0, 0.0),
        ] {
            for radius in [0.3, 1.1] {
                let mut found = Vec::new();
                grid.within(&at, radius, |i, _| found.push(i));
                found.sort_unstable();
                let near = (0..400_u32)
                    .filter(|i| (points[*i as usize] - at).norm_squared() < radius * radius);
                assert_eq!(found, near.collect::<Vec<_>>());
            }
            let odd = grid
                .nearest(&at, 200.0, |i| i % 2 == 1)
                .expect("there are some");
            let all = (1..400).step_by(2).map(|i| (points[i] - at).norm());
            assert!((odd.distance - all.fold(f32::INFINITY, f32::min)).abs() < 1e-5);
        }
        assert_eq!(
            grid.nearest(&Point3::new(90.0, 0.0, 0.0), 5.0, |_| true),
            None
        );
    }
}

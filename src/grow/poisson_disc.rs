//! Places without a pattern of which no two are closer than a distance (R. Bridson, Fast Poisson
//! disk sampling in arbitrary dimensions, 2007).

use crate::random::Generator;
use nalgebra::{Point2, Vector2};
use rand::RngExt;
use std::f64::consts::{SQRT_2, TAU};

/// Candidates about a place before no more are sought there: Bridson's k.
const CANDIDATES: u32 = 30;

/// Places on a rectangle of this size about the origin, no two closer than `spacing`, and no room
/// left for many more. All three are in one unit and above 0.
pub(super) fn poisson_disc(
    width: f64,
    depth: f64,
    spacing: f64,
    random: &mut Generator,
) -> Vec<Point2<f64>> {
    let mut grid = Grid::new(width, depth, spacing);
    let first = Point2::new(
        random.random::<f64>() * width,
        random.random::<f64>() * depth,
    );
    grid.add(first);
    let mut active = vec![0];
    while !active.is_empty() {
        let at = random.random_range(0..active.len());
        match neighbour(&grid, grid.places[active[at]], random) {
            Some(found) => {
                active.push(grid.places.len());
                grid.add(found);
            }
            None => {
                active.swap_remove(at);
            }
        }
    }
    let middle = Vector2::new(0.5 * width, 0.5 * depth);
    grid.places.into_iter().map(|p| p - middle).collect()
}

/// A place that is free, from one to two spacings away from `from`; `None` where none is found.
fn neighbour(grid: &Grid, from: Point2<f64>, random: &mut Generator) -> Option<Point2<f64>> {
    (0..CANDIDATES).find_map(|_| {
        // Even over the area of the ring.
        let away = grid.spacing * (1.0 + 3.0 * random.random::<f64>()).sqrt();
        let (sin, cos) = (TAU * random.random::<f64>()).sin_cos();
        let candidate = from + Vector2::new(cos, sin) * away;
        grid.is_free(candidate).then_some(candidate)
    })
}

/// The places so far, in cells that hold one each.
struct Grid {
    width: f64,
    depth: f64,
    spacing: f64,
    cell: f64,
    columns: usize,
    rows: usize,
    /// Which place is in a cell.
    cells: Vec<Option<u32>>,
    places: Vec<Point2<f64>>,
}

impl Grid {
    fn new(width: f64, depth: f64, spacing: f64) -> Self {
        let cell = spacing / SQRT_2;
        let [columns, rows] = [width, depth].map(|side| (side / cell) as usize + 1);
        Self {
            width,
            depth,
            spacing,
            cell,
            columns,
            rows,
            cells: vec![None; columns * rows],
            places: Vec::new(),
        }
    }

    /// Column and row of a place on the rectangle.
    fn cell_of(&self, at: Point2<f64>) -> [usize; 2] {
        let [column, row] = [at.x, at.y].map(|x| (x / self.cell) as usize);
        [column.min(self.columns - 1), row.min(self.rows - 1)]
    }

    fn add(&mut self, place: Point2<f64>) {
        let [column, row] = self.cell_of(place);
        self.cells[row * self.columns + column] = Some(self.places.len() as u32);
        self.places.push(place);
    }

    /// Whether a place lies on the rectangle and is far enough from all others.
    fn is_free(&self, at: Point2<f64>) -> bool {
        let inside = (0.0..=self.width).contains(&at.x) && (0.0..=self.depth).contains(&at.y);
        if !inside {
            return false;
        }
        let [column, row] = self.cell_of(at);
        // A cell is 0.71 spacings wide: what is closer than one is at most two cells away.
        let columns = column.saturating_sub(2)..=(column + 2).min(self.columns - 1);
        let mut rows = row.saturating_sub(2)..=(row + 2).min(self.rows - 1);
        rows.all(|row| {
            columns.clone().all(|column| {
                let place = self.cells[row * self.columns + column];
                place.is_none_or(|p| (self.places[p as usize] - at).norm() >= self.spacing)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::generator;

    #[test]
    fn no_two_are_closer_than_the_spacing_and_no_room_is_left() {
        for seed in 0..5 {
            let places = poisson_disc(40.0, 25.0, 1.0, &mut generator(seed, 0));
            for (i, a) in places.iter().enumerate() {
                assert!(a.x.abs() <= 20.0 && a.y.abs() <= 12.5, "{a}");
                assert!(places[..i].iter().all(|b| (a - b).norm() >= 1.0));
            }
            // Discs thrown at random until none fits cover 0.547 of the plane (Rényi's constant in
            // two dimensions): 0.70 places in the square of a spacing.
            let density = places.len() as f64 / (40.0 * 25.0);
            assert!((0.62..0.80).contains(&density), "{density}");
        }
    }

    #[test]
    fn a_plot_smaller_than_the_spacing_holds_one() {
        assert_eq!(poisson_disc(0.5, 0.5, 1.0, &mut generator(1, 0)).len(), 1);
    }
}

//! The corners of a chessboard in their rows.
//!
//! Each saddle point has its neighbours along its edges; what is joined so, with bright and dark squares in
//! turns, is the board if it has as many columns and rows.

use super::saddles::{Saddle, saddles};
use crate::model::Luma;
use nalgebra::{Point2, Vector2, distance};
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// A neighbour lies in the direction of an edge to this angle, radians: perspective and distortion turn
/// edges from corner to corner.
const ALONG_EDGE_RAD: f64 = 0.25;

/// A chessboard by its inner corners, where four squares meet; 2 or more along each side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Board {
    pub columns: usize,
    pub rows: usize,
}

impl Board {
    pub fn corners(self) -> usize {
        self.columns * self.rows
    }

    /// The places of its corners on the board, row by row, in squares.
    pub fn places(self) -> Vec<Point2<f64>> {
        let of_row =
            |row| (0..self.columns).map(move |column| Point2::new(column as f64, row as f64));
        (0..self.rows).flat_map(of_row).collect()
    }
}

/// A board in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardView {
    /// Its corners, row by row, px.
    pub corners_px: Vec<Point2<f64>>,
}

impl BoardView {
    /// How far corners are from those of another view on average, px, whichever end is the first.
    pub(super) fn distance_px(&self, other: &Self) -> f64 {
        let forward = mean_distance(self.corners_px.iter(), other.corners_px.iter());
        forward.min(mean_distance(
            self.corners_px.iter(),
            other.corners_px.iter().rev(),
        ))
    }
}

fn mean_distance<'a>(
    a: impl ExactSizeIterator<Item = &'a Point2<f64>>,
    b: impl Iterator<Item = &'a Point2<f64>>,
) -> f64 {
    let count = a.len() as f64;
    a.zip(b).map(|(a, b)| distance(a, b)).sum::<f64>() / count
}

/// The board in a picture; `None` where it is not all seen. Which of its corners is the first is not
/// known: it looks the same from several sides.
pub fn find_board(luma: &Luma, board: Board) -> Option<BoardView> {
    let saddles = saddles(luma, board.corners());
    let neighbours = Neighbours::of(&saddles);
    let mut is_taken = vec![false; saddles.len()];
    for start in 0..saddles.len() {
        if is_taken[start] {
            continue;
        }
        let grid = neighbours.grid_from(start);
        grid.values().for_each(|s| is_taken[*s] = true);
        if let Some(order) = rows_of(&grid, board) {
            let corners_px = order.iter().map(|s| saddles[*s].at_px).collect();
            return Some(BoardView { corners_px });
        }
    }
    None
}

/// A place in a grid: column and row.
type Cell = (i32, i32);

/// The steps of the four directions, one after the other.
const STEPS: [Cell; 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// Another saddle, and which of its edges leads back.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Neighbour {
    saddle: usize,
    back: usize,
}

/// Of each saddle its neighbours along its four edges.
struct Neighbours(Vec<[Option<Neighbour>; 4]>);

impl Neighbours {
    /// Those that are each other's, with squares whose brightness changes between them.
    fn of(saddles: &[Saddle]) -> Self {
        let nearest: Vec<[Option<usize>; 4]> = (0..saddles.len())
            .map(|own| std::array::from_fn(|edge| nearest_along(saddles, own, edge)))
            .collect();
        let of_all =
            (0..saddles.len()).map(|own| std::array::from_fn(|edge| mutual(&nearest, own, edge)));
        Self(of_all.collect())
    }

    /// The saddles that are joined to one, by their places in the grid about it.
    fn grid_from(&self, start: usize) -> BTreeMap<Cell, usize> {
        // Of each saddle its cell, and which of its edges goes the way of the first step.
        let mut place_of = BTreeMap::from([(start, ((0, 0), 0))]);
        let mut grid = BTreeMap::from([((0, 0), start)]);
        let mut queue = vec![start];
        while let Some(own) = queue.pop() {
            let (cell, first): (Cell, usize) = place_of[&own];
            for (k, step) in STEPS.iter().enumerate() {
                let Some(next) = self.0[own][(first + k) % 4] else {
                    continue;
                };
                let to = (cell.0 + step.0, cell.1 + step.1);
                if place_of.contains_key(&next.saddle) || grid.contains_key(&to) {
                    continue;
                }
                // Its edge back is against the step.
                place_of.insert(next.saddle, (to, (next.back + 2 + 4 - k) % 4));
                grid.insert(to, next.saddle);
                queue.push(next.saddle);
            }
        }
        grid
    }
}

/// The neighbour at an edge, if it has this one for its own, and squares alternate.
fn mutual(nearest: &[[Option<usize>; 4]], own: usize, edge: usize) -> Option<Neighbour> {
    let saddle = nearest[own][edge]?;
    let back = nearest[saddle].iter().position(|n| *n == Some(own))?;
    // The edge goes on to the other side, where the same side of it is of the other brightness.
    ((edge + back + 2) % 2 == 1).then_some(Neighbour { saddle, back })
}

/// The nearest saddle in the direction of an edge.
fn nearest_along(saddles: &[Saddle], own: usize, edge: usize) -> Option<usize> {
    let from = &saddles[own];
    let mut best: Option<(usize, f64)> = None;
    for (k, other) in saddles.iter().enumerate() {
        let way: Vector2<f64> = other.at_px - from.at_px;
        let far = way.norm();
        if k == own || best.is_some_and(|b| far >= b.1) {
            continue;
        }
        let off = (way.y.atan2(way.x) - from.edges_rad[edge] + PI).rem_euclid(TAU) - PI;
        if off.abs() < ALONG_EDGE_RAD {
            best = Some((k, far));
        }
    }
    best.map(|b| b.0)
}

/// The saddles of a grid row by row, if it is the board, however it lies.
fn rows_of(grid: &BTreeMap<Cell, usize>, board: Board) -> Option<Vec<usize>> {
    let columns = grid.keys().map(|c| c.0);
    let rows = grid.keys().map(|c| c.1);
    let (left, top) = (columns.clone().min()?, rows.clone().min()?);
    let wide = (columns.max()? - left + 1) as usize;
    let high = (rows.max()? - top + 1) as usize;
    if grid.len() != board.corners() || wide * high != grid.len() {
        return None;
    }
    let is_turned = (wide, high) == (board.rows, board.columns);
    if !is_turned && (wide, high) != (board.columns, board.rows) {
        return None;
    }
    let mut order = Vec::with_capacity(grid.len());
    for row in 0..board.rows as i32 {
        for column in 0..board.columns as i32 {
            let (x, y) = if is_turned {
                (row, column)
            } else {
                (column, row)
            };
            order.push(*grid.get(&(left + x, top + y))?);
        }
    }
    Some(order)
}

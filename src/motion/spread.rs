//! The motion of followed points, spread over the picture. The foot stands still, and what is nearer
//! to it than a point moves by as much less: the tree turns about its foot.

use crate::model::Size;
use nalgebra::{Point2, Vector2};

/// Distance between the places at which the motion is worked out, px. Between them it is
/// interpolated.
const STEP_PX: usize = 8;
/// Points that a place takes its motion from.
const NEAREST: usize = 10;
/// Distance at which a point counts half as much as one at the place itself, px.
const NEAR_PX: f64 = 6.0;
/// A point that moves otherwise than the others by so much counts half, px.
const APART_PX: f64 = 1.0;
/// Rounds of reweighting.
const ROUNDS: usize = 3;

/// Which points each place of a grid takes its motion from.
pub struct Spread {
    size: Size,
    columns: usize,
    /// The nearest points of every place, row by row.
    nearest: Vec<Vec<Near>>,
}

/// A point near a place.
#[derive(Clone, Copy, Debug)]
struct Near {
    point: usize,
    weight: f64,
    /// The place's distance from the foot, in those of the point; 1 where it is farther.
    share: f64,
}

impl Spread {
    /// For points of a tree that stands at `foot_px`, which rest at `rest_px`; `None` without
    /// points.
    pub fn new(size: Size, rest_px: &[Point2<f64>], foot_px: Point2<f64>) -> Option<Self> {
        if rest_px.is_empty() {
            return None;
        }
        let columns = size.width as usize / STEP_PX + 2;
        let rows = size.height as usize / STEP_PX + 2;
        let mut nearest = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            for column in 0..columns {
                let place = Point2::new((column * STEP_PX) as f64, (row * STEP_PX) as f64);
                nearest.push(nearest_points(place, rest_px, foot_px));
            }
        }
        Some(Self {
            size,
            columns,
            nearest,
        })
    }

    /// Size of the picture.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Displacement of every pixel from its place at rest, row by row, px. `displacements` are
    /// those of the points; `None` where one was not seen. Where none of the nearest was, nothing
    /// moves.
    pub fn displacements(&self, displacements: &[Option<Vector2<f64>>]) -> Vec<Vector2<f32>> {
        let mut at_places = Vec::with_capacity(self.nearest.len());
        for near in &self.nearest {
            at_places.push(robust_mean(near, displacements).cast::<f32>());
        }
        let (width, height) = (self.size.width as usize, self.size.height as usize);
        let places = at_places.chunks_exact(self.columns);
        let rows: Vec<Vec<Vector2<f32>>> = places.map(|row| stretched(row, width)).collect();
        let mut field = Vec::with_capacity(width * height);
        for v in 0..height {
            let (above, below) = (&rows[v / STEP_PX], &rows[v / STEP_PX + 1]);
            let down = (v % STEP_PX) as f32 / STEP_PX as f32;
            let between = above.iter().zip(below);
            field.extend(between.map(|(above, below)| interpolated(*above, *below, down)));
        }
        field
    }
}

/// The motion at a row of places, interpolated for each of `width` pixels.
fn stretched(places: &[Vector2<f32>], width: usize) -> Vec<Vector2<f32>> {
    let mut row = Vec::with_capacity(width);
    for u in 0..width {
        let right = (u % STEP_PX) as f32 / STEP_PX as f32;
        let left = u / STEP_PX;
        row.push(interpolated(places[left], places[left + 1], right));
    }
    row
}

/// Linear interpolation, by the share `to` of the way from `a` to `b`.
fn interpolated(a: Vector2<f32>, b: Vector2<f32>, to: f32) -> Vector2<f32> {
    a * (1.0 - to) + b * to
}

/// The nearest points to a place, and how much each counts.
fn nearest_points(place: Point2<f64>, rest_px: &[Point2<f64>], foot_px: Point2<f64>) -> Vec<Near> {
    let distance_sq = |point: &usize| (rest_px[*point] - place).norm_squared();
    let mut points: Vec<usize> = (0..rest_px.len()).collect();
    if points.len() > NEAREST {
        points.select_nth_unstable_by(NEAREST, |a, b| distance_sq(a).total_cmp(&distance_sq(b)));
        points.truncate(NEAREST);
    }
    points.sort_unstable();
    let mut near = Vec::with_capacity(points.len());
    for point in points {
        let weight = NEAR_PX / (NEAR_PX + distance_sq(&point).sqrt());
        let from_foot_px = (rest_px[point] - foot_px).norm();
        let share = (place - foot_px).norm() / from_foot_px.max(f64::MIN_POSITIVE);
        near.push(Near {
            point,
            weight,
            share: share.min(1.0),
        });
    }
    near
}

/// Mean displacement in which points that move otherwise than most hardly count.
fn robust_mean(near: &[Near], displacements: &[Option<Vector2<f64>>]) -> Vector2<f64> {
    // Points that were not seen weigh nothing.
    let mut moved = [Vector2::zeros(); NEAREST];
    let mut by_distance = [0.0; NEAREST];
    for (k, near) in near.iter().enumerate() {
        if let Some(displacement) = displacements.get(near.point).copied().flatten() {
            moved[k] = near.share * displacement;
            by_distance[k] = near.weight;
        }
    }
    let mut mean = weighted_mean(&moved, &by_distance);
    for _ in 0..ROUNDS {
        let mut weights = by_distance;
        for (weight, moved) in weights.iter_mut().zip(&moved) {
            let apart = (moved - mean).norm() / APART_PX;
            *weight /= 1.0 + apart * apart;
        }
        mean = weighted_mean(&moved, &weights);
    }
    mean
}

/// 0 where nothing has a weight.
fn weighted_mean(vectors: &[Vector2<f64>], weights: &[f64]) -> Vector2<f64> {
    let (mut sum, mut all) = (Vector2::zeros(), 0.0);
    for (vector, weight) in vectors.iter().zip(weights) {
        sum += *weight * vector;
        all += weight;
    }
    if all > 0.0 {
        sum / all
    } else {
        Vector2::zeros()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        width: 64,
        height: 40,
    };

    /// All places are about as far from it.
    const FAR_FOOT: Point2<f64> = Point2::new(30.0, 1e5);

    /// Points on the left move by 3 px, those on the right by -2 px.
    fn two_sides() -> (Vec<Point2<f64>>, Vec<Option<Vector2<f64>>>) {
        let (mut rest_px, mut displacements) = (Vec::new(), Vec::new());
        for k in 0..12 {
            let height = 3.0 * f64::from(k);
            rest_px.push(Point2::new(10.0, height));
            displacements.push(Some(Vector2::new(3.0, 0.0)));
            rest_px.push(Point2::new(54.0, height));
            displacements.push(Some(Vector2::new(-2.0, 0.0)));
        }
        (rest_px, displacements)
    }

    fn at(field: &[Vector2<f32>], u: usize, v: usize) -> Vector2<f32> {
        field[v * SIZE.width as usize + u]
    }

    #[test]
    fn a_pixel_moves_as_the_points_beside_it() {
        let (rest_px, displacements) = two_sides();
        let spread = Spread::new(SIZE, &rest_px, FAR_FOOT).expect("points");
        let field = spread.displacements(&displacements);
        assert_eq!(field.len(), SIZE.area());
        assert!((at(&field, 8, 20).x - 3.0).abs() < 0.05);
        assert!((at(&field, 60, 39).x + 2.0).abs() < 0.05);
    }

    #[test]
    fn the_foot_stands_still_and_what_is_near_to_it_moves_less() {
        let foot_px = Point2::new(32.0, 39.0);
        let rest_px = [Point2::new(32.0, 3.0)];
        let spread = Spread::new(SIZE, &rest_px, foot_px).expect("a point");
        let field = spread.displacements(&[Some(Vector2::new(3.0, 0.0))]);
        assert!((at(&field, 32, 3).x - 3.0).abs() < 0.2);
        assert!((at(&field, 32, 21).x - 1.5).abs() < 0.2);
        assert!(at(&field, 32, 39).x < 0.3);
    }

    #[test]
    fn a_point_that_went_astray_hardly_counts() {
        let (rest_px, mut displacements) = two_sides();
        displacements[10] = Some(Vector2::new(40.0, 30.0));
        displacements[14] = None;
        let spread = Spread::new(SIZE, &rest_px, FAR_FOOT).expect("points");
        let moved = at(&spread.displacements(&displacements), 10, 16);
        assert!((moved - Vector2::new(3.0, 0.0)).norm() < 0.2, "{moved}");
    }

    #[test]
    fn without_points_there_is_no_field_and_without_motion_nothing_moves() {
        assert!(Spread::new(SIZE, &[], FAR_FOOT).is_none());
        let spread = Spread::new(SIZE, &[Point2::new(1.0, 1.0)], FAR_FOOT).expect("a point");
        let still = spread.displacements(&[None]);
        assert!(still.iter().all(|d| *d == Vector2::zeros()));
    }
}

//! Quadrilaterals around dark pieces, with edges to parts of a pixel.

use super::threshold::dark_pixels;
use crate::model::Luma;
use crate::signal::convex_hull;
use nalgebra::{Matrix2, Point2, SymmetricEigen, Vector2, distance};

/// A dark piece with a side shorter than this, px, has no code that could be read: eight cells of two
/// pixels each.
const LEAST_SIDE_PX: i32 = 14;
/// The hull of a square seen from anywhere is this share of the quadrilateral of its corners at least.
const LEAST_FILLED: f64 = 0.90;
/// Edges are looked for at so many places of each side, so far from the corners as a share of the side,
/// and so far to both sides of it, px.
const EDGE_PLACES: usize = 24;
const FROM_CORNERS: f64 = 0.12;
const EDGE_REACH_PX: f64 = 2.5;
const EDGE_STEP_PX: f64 = 0.25;
/// An edge is where brightness grows outwards by so many grey levels a pixel.
const LEAST_SLOPE: f64 = 6.0;
/// So many of the places must have one.
const LEAST_PLACES: usize = 10;

/// The outer edge of a dark quadrilateral.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quad {
    /// Its corners, clockwise in the picture, px.
    pub corners_px: [Point2<f64>; 4],
    /// Standard deviation of a corner along each axis, px, from how far the places on edges scatter about
    /// the lines.
    pub corner_sd_px: f64,
}

/// All dark quadrilaterals of a picture, the largest first.
pub fn find_quads(luma: &Luma) -> Vec<Quad> {
    let mut quads = Vec::new();
    for piece in dark_pieces(luma) {
        let quad = corners(&piece).and_then(|corners| refined(luma, &corners));
        quads.extend(quad);
    }
    quads.sort_by(|a, b| area(&b.corners_px).total_cmp(&area(&a.corners_px)));
    quads
}

/// The pixels at the left and right end of every row of a dark piece: they hold its hull.
fn dark_pieces(luma: &Luma) -> Vec<Vec<Point2<f64>>> {
    let (width, height) = (luma.size.width as usize, luma.size.height as usize);
    let mut is_open = dark_pixels(luma);
    let mut pieces = Vec::new();
    let mut stack = Vec::new();
    for start in 0..is_open.len() {
        if !std::mem::take(&mut is_open[start]) {
            continue;
        }
        let mut rows: Vec<(i32, i32)> = Vec::new();
        let top = (start / width) as i32;
        let mut touches_edge = false;
        stack.push(start);
        while let Some(at) = stack.pop() {
            let (u, v) = (at % width, at / width);
            let row = (v as i32 - top) as usize;
            if rows.len() <= row {
                rows.resize(row + 1, (i32::MAX, i32::MIN));
            }
            rows[row] = (rows[row].0.min(u as i32), rows[row].1.max(u as i32));
            touches_edge |= u == 0 || v == 0 || u + 1 == width || v + 1 == height;
            let beside = [
                (u > 0).then(|| at - 1),
                (u + 1 < width).then(|| at + 1),
                (v > 0).then(|| at - width),
                (v + 1 < height).then(|| at + width),
            ];
            for next in beside.into_iter().flatten() {
                if std::mem::take(&mut is_open[next]) {
                    stack.push(next);
                }
            }
        }
        let left = rows.iter().map(|r| r.0).min().unwrap_or(0);
        let right = rows.iter().map(|r| r.1).max().unwrap_or(0);
        if touches_edge || (rows.len() as i32) < LEAST_SIDE_PX || right - left < LEAST_SIDE_PX {
            continue;
        }
        let ends = rows
            .iter()
            .zip(top..)
            .flat_map(|((left, right), v)| [(*left, v), (*right, v)]);
        pieces.push(
            ends.map(|(u, v)| Point2::new(f64::from(u), f64::from(v)))
                .collect(),
        );
    }
    pieces
}

/// The corners of a piece, clockwise in the picture; `None` where it is no quadrilateral.
fn corners(ends_px: &[Point2<f64>]) -> Option<[Point2<f64>; 4]> {
    let hull = convex_hull(ends_px);
    if hull.len() < 4 {
        return None;
    }
    // The longest line in it is a diagonal; the other two corners are farthest from that.
    let (mut first, mut third, mut longest) = (0, 0, 0.0);
    for i in 0..hull.len() {
        for j in 0..i {
            let length = distance(&hull[i], &hull[j]);
            if length > longest {
                (first, third, longest) = (j, i, length);
            }
        }
    }
    let (a, c) = (hull[first], hull[third]);
    let off = |p: &Point2<f64>| (c - a).perp(&(p - a));
    let b = hull.iter().max_by(|p, q| off(p).total_cmp(&off(q)))?;
    let d = hull.iter().min_by(|p, q| off(p).total_cmp(&off(q)))?;
    // Turned to the right from a to c in a picture whose v grows downwards.
    let corners = [a, *d, c, *b];
    let filled = area(&hull) / area(&corners).max(f64::MIN_POSITIVE);
    let is_quad = filled <= 1.0 / LEAST_FILLED && area(&corners) > f64::from(LEAST_SIDE_PX).powi(2);
    is_quad.then_some(corners)
}

/// The area of a polygon, px².
fn area(polygon: &[Point2<f64>]) -> f64 {
    let mut twice = 0.0;
    for (k, p) in polygon.iter().enumerate() {
        let next = polygon[(k + 1) % polygon.len()];
        twice += p.coords.perp(&next.coords);
    }
    0.5 * twice.abs()
}

/// The same corners where the lines along the edges meet (Wang and Olson 2016 sect. III.D).
fn refined(luma: &Luma, corners: &[Point2<f64>; 4]) -> Option<Quad> {
    let middle = Point2::from(corners.iter().map(|c| c.coords).sum::<Vector2<f64>>() / 4.0);
    let mut lines = Vec::with_capacity(4);
    for k in 0..4 {
        let line = edge_line(luma, corners[k], corners[(k + 1) % 4], middle)?;
        lines.push(line);
    }
    let mut refined = [Point2::origin(); 4];
    let mut variance = 0.0;
    for k in 0..4 {
        let (before, after) = (&lines[(k + 3) % 4], &lines[k]);
        refined[k] = before.meets(after)?;
        variance += 0.5 * (before.variance + after.variance);
    }
    let is_near = |k: usize| distance(&refined[k], &corners[k]) < 2.0 * EDGE_REACH_PX;
    (0..4).all(is_near).then_some(Quad {
        corners_px: refined,
        corner_sd_px: (variance / 4.0).sqrt(),
    })
}

/// A line along an edge.
struct EdgeLine {
    through: Point2<f64>,
    direction: Vector2<f64>,
    /// Of where it is at its ends across its direction, px².
    variance: f64,
}

impl EdgeLine {
    fn meets(&self, other: &Self) -> Option<Point2<f64>> {
        let across = self.direction.perp(&other.direction);
        if across.abs() < 0.1 {
            return None;
        }
        let along = (other.through - self.through).perp(&other.direction) / across;
        Some(self.through + along * self.direction)
    }
}

/// The line along the places between two corners where it becomes lighter away from `middle`.
fn edge_line(
    luma: &Luma,
    from: Point2<f64>,
    to: Point2<f64>,
    middle: Point2<f64>,
) -> Option<EdgeLine> {
    let along = to - from;
    let normal = Vector2::new(along.y, -along.x).try_normalize(1e-9)?;
    let outwards = if normal.dot(&(from - middle)) < 0.0 {
        -normal
    } else {
        normal
    };
    let mut places: Vec<Point2<f64>> = Vec::with_capacity(EDGE_PLACES);
    for k in 0..EDGE_PLACES {
        let share = (k as f64 + 0.5) / EDGE_PLACES as f64;
        let at = from + (FROM_CORNERS + (1.0 - 2.0 * FROM_CORNERS) * share) * along;
        places.extend(edge_place(luma, at, outwards));
    }
    if places.len() < LEAST_PLACES {
        return None;
    }
    let n = places.len() as f64;
    let through = Point2::from(places.iter().map(|p| p.coords).sum::<Vector2<f64>>() / n);
    let spread: Matrix2<f64> = places
        .iter()
        .map(|p| (p - through) * (p - through).transpose())
        .sum();
    let eigen = SymmetricEigen::new(spread);
    let main = usize::from(eigen.eigenvalues[1] > eigen.eigenvalues[0]);
    let direction = eigen.eigenvectors.column(main).into_owned();
    // At the end of a line that is fitted to even places it is four times that of the mean.
    let across = eigen.eigenvalues[1 - main].max(0.0) / (n - 2.0);
    Some(EdgeLine {
        through,
        direction,
        variance: 4.0 * across / n,
    })
}

/// Where brightness grows most along a line across an edge, as the mean of the places by their slope;
/// `None` where it hardly grows.
fn edge_place(luma: &Luma, at: Point2<f64>, outwards: Vector2<f64>) -> Option<Point2<f64>> {
    let steps = (EDGE_REACH_PX / EDGE_STEP_PX) as i32;
    let (mut sum, mut weighted, mut steepest) = (0.0, 0.0, 0.0_f64);
    for k in -steps..=steps {
        let off = f64::from(k) * EDGE_STEP_PX;
        let inner = brightness(luma, at + (off - 0.5) * outwards)?;
        let outer = brightness(luma, at + (off + 0.5) * outwards)?;
        let slope = (outer - inner).max(0.0);
        steepest = steepest.max(slope);
        // Squared as in AprilTag, so that what is far from the edge hardly counts.
        sum += slope * slope;
        weighted += slope * slope * off;
    }
    (steepest >= LEAST_SLOPE).then(|| at + weighted / sum * outwards)
}

/// Brightness between pixels, grey levels; `None` off the picture.
pub fn brightness(luma: &Luma, at: Point2<f64>) -> Option<f64> {
    let (width, height) = (luma.size.width as usize, luma.size.height as usize);
    let (u, v) = (at.x.floor(), at.y.floor());
    let is_inside = u >= 0.0 && v >= 0.0 && u + 1.0 < width as f64 && v + 1.0 < height as f64;
    if !is_inside {
        return None;
    }
    let (fu, fv) = (at.x - u, at.y - v);
    let k = v as usize * width + u as usize;
    let pixel = |k: usize| f64::from(luma.pixels[k]);
    let upper = (1.0 - fu) * pixel(k) + fu * pixel(k + 1);
    let lower = (1.0 - fu) * pixel(k + width) + fu * pixel(k + width + 1);
    Some((1.0 - fv) * upper + fv * lower)
}

//! Which points are wood and which are leaves, without training data.
//!
//! Points whose neighbours face the same way are one segment; long segments of many points are wood
//! (LeWoS, Wang, Momo Takoudjou & Casella 2020, "LeWoS: A universal leaf-wood classification method
//! to facilitate the 3D modelling of large tropical trees using terrestrial LiDAR", sect. 2.2). Thin
//! twigs break into short segments; they are wood by the ways of the leaves that they bear to the
//! foot (path detection, Vicari et al. 2019, "Leaf and wood classification framework for
//! terrestrial LiDAR point clouds", sect. 2.3).

use super::graph::{Graph, Ways};
use super::grid::Grid;
use crate::signal::median;
use nalgebra::{Matrix3, Point3, SymmetricEigen, Vector3};

/// Neighbours that a point's normal is taken from, and how far they are looked for, cells.
const NEIGHBOURS: usize = 20;
const REACH_CELLS: f32 = 4.0;
/// Cosine of the largest angle, 18 degrees, between the normals of neighbours in one segment. The
/// paper compares heights of normals, 0.1 to 0.2 apart; angles told more in made clouds.
const LEAST_COSINE: f64 = 0.951;
/// Linearities and sizes above which segments are wood; the share of the pairs that a segment is
/// above is how likely it is wood (the paper's table of thresholds).
const LINEARITIES: [f64; 6] = [0.70, 0.75, 0.80, 0.85, 0.90, 0.95];
const SIZES: [usize; 5] = [10, 20, 30, 40, 50];
/// From this likelihood on it is.
const LIKELY: f64 = 0.5;
/// A segment as large as so many leaves is wood, whatever its shape: trunk and limbs are one.
const LARGE_LEAVES: f64 = 8.0;
/// One that is no longer than so many leaves is none: leaves seen from the edge are lines, too.
const LONG_LEAVES: f64 = 1.5;
/// A twig bears so many leaves at least, in points of a leaf.
const LEAVES_OF_TWIG: f64 = 3.0;

/// Which of the points are wood. `cell` is their distance; `ways` lead to the foot.
pub(super) fn is_wood(points: &[Point3<f32>], graph: &Graph, ways: &Ways, cell: f32) -> Vec<bool> {
    let normals = normals(points, cell);
    let segment_of = graph.pieces_where(|a, b| {
        normals[a as usize].dot(&normals[b as usize]).abs() > LEAST_COSINE
            && (points[a as usize] - points[b as usize]).norm() < REACH_CELLS * cell
    });
    let segments = Segment::all(points, &segment_of);
    let leaf = Segment::leaf(&segments);
    let likely: Vec<bool> = segments.iter().map(|s| s.is_likely_wood(&leaf)).collect();
    let least = (LEAVES_OF_TWIG * leaf.count as f64) as u32;
    let on_way = ways.points_above();
    let members = segment_of.iter().zip(&on_way);
    members
        .map(|(s, above)| likely[*s as usize] || *above >= least)
        .collect()
}

/// The directions in which the neighbours of points are least spread.
fn normals(points: &[Point3<f32>], cell: f32) -> Vec<Vector3<f64>> {
    let reach = REACH_CELLS * cell;
    let grid = Grid::new(points, reach);
    let mut near: Vec<(f32, u32)> = Vec::new();
    let mut normals = Vec::with_capacity(points.len());
    for at in points {
        near.clear();
        grid.within(at, reach, |point, square| near.push((square, point)));
        if near.len() > NEIGHBOURS {
            near.select_nth_unstable_by(NEIGHBOURS - 1, |a, b| a.0.total_cmp(&b.0));
            near.truncate(NEIGHBOURS);
        }
        let ways = near
            .iter()
            .map(|(_, p)| (points[*p as usize] - at).cast::<f64>());
        let spread = Spread::of(ways);
        normals.push(spread.axes().eigenvectors.column(0).into_owned());
    }
    normals
}

/// How some places lie about their middle.
#[derive(Clone, Copy, Debug)]
struct Spread {
    count: usize,
    sum: Vector3<f64>,
    squares: Matrix3<f64>,
}

impl Spread {
    const NONE: Self = Self {
        count: 0,
        sum: Vector3::new(0.0, 0.0, 0.0),
        squares: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    fn of(places: impl Iterator<Item = Vector3<f64>>) -> Self {
        let mut spread = Self::NONE;
        places.for_each(|at| spread.add(&at));
        spread
    }

    fn add(&mut self, at: &Vector3<f64>) {
        self.count += 1;
        self.sum += at;
        self.squares += at * at.transpose();
    }

    /// Main axes, that of the least variance first.
    fn axes(&self) -> SymmetricEigen<f64, nalgebra::Const<3>> {
        let count = self.count.max(1) as f64;
        let mean = self.sum / count;
        let mut own = SymmetricEigen::new(self.squares / count - mean * mean.transpose());
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| own.eigenvalues[*a].total_cmp(&own.eigenvalues[*b]));
        own.eigenvectors = Matrix3::from_columns(&order.map(|k| own.eigenvectors.column(k)));
        own.eigenvalues = Vector3::from(order.map(|k| own.eigenvalues[k]));
        own
    }
}

/// Neighbours that face the same way.
#[derive(Clone, Copy, Debug)]
struct Segment {
    count: usize,
    /// 0 of a ball or a disc, 1 of a line.
    linearity: f64,
    /// Of the even row of points that is as much spread, m.
    length: f64,
}

impl Segment {
    fn all(points: &[Point3<f32>], segment_of: &[u32]) -> Vec<Self> {
        let count = segment_of.iter().max().map_or(0, |s| *s as usize + 1);
        let mut spreads = vec![Spread::NONE; count];
        for (at, segment) in points.iter().zip(segment_of) {
            spreads[*segment as usize].add(&at.coords.cast());
        }
        spreads.iter().map(Self::of).collect()
    }

    fn of(spread: &Spread) -> Self {
        let [_, middle, most]: [f64; 3] = spread.axes().eigenvalues.into();
        Self {
            count: spread.count,
            linearity: (most - middle) / most.max(1e-12),
            length: (12.0 * most.max(0.0)).sqrt(),
        }
    }

    /// The middle one of the segments that are no specks and no lines, in size and in length: a
    /// leaf as the scan shows it.
    fn leaf(segments: &[Self]) -> Self {
        let flat: Vec<&Self> = segments.iter().filter(|s| s.is_flat()).collect();
        let counts = flat.iter().map(|s| s.count).collect();
        let lengths = flat.iter().map(|s| s.length).collect();
        Self {
            count: median(counts, usize::cmp).unwrap_or(1),
            linearity: 0.0,
            length: median(lengths, f64::total_cmp).unwrap_or(0.0),
        }
    }

    /// Whether it is no speck and no line.
    fn is_flat(&self) -> bool {
        self.count >= SIZES[0] && self.linearity < LINEARITIES[0]
    }

    fn is_likely_wood(&self, leaf: &Self) -> bool {
        let is_large = self.count as f64 > LARGE_LEAVES * leaf.count as f64;
        let is_long = self.length > LONG_LEAVES * leaf.length;
        is_large || is_long && self.likelihood() > LIKELY
    }

    fn likelihood(&self) -> f64 {
        let linear = LINEARITIES.iter().filter(|l| self.linearity > **l).count();
        let large = SIZES.iter().filter(|size| self.count > **size).count();
        (linear * large) as f64 / (LINEARITIES.len() * SIZES.len()) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stem, and beside it leaves that hang on nothing.
    #[test]
    fn a_stem_is_wood_and_leaves_beside_it_are_not() {
        let mut points: Vec<Point3<f32>> = Vec::new();
        for ring in 0..200 {
            for k in 0..32 {
                let angle = std::f32::consts::TAU * k as f32 / 32.0;
                points.push(Point3::new(
                    0.05 * angle.cos(),
                    0.05 * angle.sin(),
                    0.01 * ring as f32,
                ));
            }
        }
        let stem = points.len();
        for leaf in 0..20 {
            let slope = 0.3 * (leaf % 5) as f32;
            let at = Point3::new(0.15, 0.0, 0.1 * leaf as f32);
            for i in 0..48 {
                let [x, y] = [0.01 * (i / 6) as f32, 0.01 * (i % 6) as f32];
                points.push(at + nalgebra::Vector3::new(x, y, slope * x));
            }
        }
        let graph = Graph::new(&points, 0.018).bridged(&points, 0.018, 0.2);
        let ways = graph.shortest_ways(&[0]);
        let is_wood = is_wood(&points, &graph, &ways, 0.01);
        let wood_of = |part: &[bool]| part.iter().filter(|w| **w).count() as f64;
        assert!(wood_of(&is_wood[..stem]) > 0.98 * stem as f64);
        let leaves = &is_wood[stem..];
        let share = wood_of(leaves) / leaves.len() as f64;
        assert!(share < 0.1, "{share}");
    }
}

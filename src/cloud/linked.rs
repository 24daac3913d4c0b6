//! The points that stand on the ground thinned, without noise and leaves, and joined to their neighbours.

use super::graph::{Graph, REACH};
use super::grid::Grid;
use super::standing::Standing;
use super::thin::{self, Thinned};
use super::{CloudError, CloudFigures, foot, leaves, stems};
use crate::signal::median;
use nalgebra::Point3;

/// Cells in which points are one, in the height of the tree at first; larger by this factor until
/// there are no more points than that.
const CELLS_IN_HEIGHT: f32 = 700.0;
const LARGER: f32 = 1.2;
const MOST_THINNED: usize = 150_000;
/// To part trees from each other there are so many times as many as there are trees, up to this.
const FINEST_TREES: usize = 20;
/// Gaps that are then led over, cells: trees that stand apart are not joined, and a wider search about
/// each of their points would take long.
const GAP_OF_STAND_CELLS: f32 = 8.0;
/// The distance of points about a place is the median of those that are so many cells away, and no more than so many
/// cells: a trunk may be sparser than twigs, and a gap is none of its points.
const ABOUT_CELLS: f32 = 5.0;
const SPARSEST_CELLS: f32 = 2.0;
/// The distance of a point is that to this one of its neighbours.
const NEIGHBOUR: usize = 3;
/// Gaps are led over up to this share of the tree's height.
const GAP_SHARE: f32 = 0.1;
/// A tree whose lowest wood is farther above the ground than this share of its height has no trunk.
const TRUNKLESS: f32 = 0.25;

/// Thinned points without noise, joined to their neighbours.
pub(super) struct Linked {
    pub thinned: Thinned,
    /// Side of the cells in which points are one.
    pub cell: f32,
    pub graph: Graph,
}

impl Linked {
    /// The standing points as those of any number of trees.
    pub fn coarse(standing: &Standing, figures: &mut CloudFigures) -> Result<Self, CloudError> {
        let (thinned, cell) = thinned(standing, MOST_THINNED, figures)?;
        Ok(Self::of(thinned, cell, GAP_OF_STAND_CELLS * cell))
    }

    /// The same with the gaps of a single tree led over.
    pub fn into_one_tree(self, standing: &Standing) -> Self {
        self.bridged(GAP_SHARE * standing.height)
    }

    /// The standing points as those of one tree.
    pub fn of_tree(standing: &Standing, figures: &mut CloudFigures) -> Result<Self, CloudError> {
        let (thinned, cell) = thinned(standing, MOST_THINNED, figures)?;
        Ok(Self::of(thinned, cell, GAP_SHARE * standing.height))
    }

    /// The standing points as those of so many trees, with more points.
    pub fn of_stand(standing: &Standing, trees: usize) -> Result<Self, CloudError> {
        let most = MOST_THINNED * trees.min(FINEST_TREES);
        let (thinned, cell) = thinned(standing, most, &mut CloudFigures::default())?;
        Ok(Self::of(thinned, cell, GAP_OF_STAND_CELLS * cell))
    }

    /// Gaps are led over up to `widest`.
    fn of(thinned: Thinned, cell: f32, widest: f32) -> Self {
        let mut reaches = spacings_about(&thinned.points, cell);
        reaches.iter_mut().for_each(|s| *s *= REACH);
        let graph = Graph::of_reaches(&thinned.points, &reaches);
        Self {
            thinned,
            cell,
            graph,
        }
        .bridged(widest)
    }

    /// The same with wider gaps led over.
    fn bridged(self, widest: f32) -> Self {
        let reach = REACH * self.cell;
        Self {
            graph: self.graph.bridged(&self.thinned.points, reach, widest),
            ..self
        }
    }

    /// Which trees stand there.
    pub fn stand(&self, standing: &Standing) -> stems::Stand {
        let above = standing.above_ground(&self.thinned.points);
        stems::find(&above, &self.graph, standing.height, self.cell)
    }

    /// The same without the points that are no wood.
    pub fn without_leaves(
        mut self,
        standing: &Standing,
        figures: &mut CloudFigures,
    ) -> Result<Self, CloudError> {
        let (points, cell) = (&self.thinned.points, self.cell);
        let above = standing.above_ground(points);
        let foot = foot::find(&above, &self.graph, standing.height, cell)?;
        let ways = self.graph.shortest_ways(&foot);
        let is_wood = leaves::is_wood(points, &self.graph, &ways, cell);
        let before = self.thinned.kept_points();
        self.thinned.without(&is_wood);
        figures.leaves = before - self.thinned.kept_points();
        let widest = GAP_SHARE * standing.height;
        Ok(Self::of(self.thinned, self.cell, widest))
    }
}

/// The standing points thinned and without noise, and the side of their cells.
fn thinned(
    standing: &Standing,
    most: usize,
    figures: &mut CloudFigures,
) -> Result<(Thinned, f32), CloudError> {
    let mut cell = standing.height / CELLS_IN_HEIGHT;
    let mut thinned = Thinned::of(&standing.points, cell);
    while thinned.points.len() > most {
        cell *= LARGER;
        thinned = Thinned::of(&standing.points, cell);
    }
    let cell = cell.max(spacing(&thinned.points, cell));
    let kept = thin::is_no_outlier(&thinned.points, cell);
    thinned.without(&kept);
    figures.noise += thinned.of_point.len() - thinned.kept_points();
    figures.cell_m = f64::from(cell);
    let lowest = thinned
        .points
        .iter()
        .min_by(|a, b| a.z.total_cmp(&b.z))
        .ok_or(CloudError::NoTree)?;
    if let Some(ground) = &standing.ground {
        let gap = lowest.z - ground.height_at(lowest.x, lowest.y);
        if gap > TRUNKLESS * standing.height {
            return Err(CloudError::NoTrunk {
                gap_m: f64::from(gap),
            });
        }
    }
    Ok((thinned, cell))
}

/// The distance of points about each of them, between `cell` and [`SPARSEST_CELLS`].
fn spacings_about(points: &[Point3<f32>], cell: f32) -> Vec<f32> {
    let grid = Grid::new(points, SPARSEST_CELLS * cell);
    let most = SPARSEST_CELLS * cell;
    let mut own: Vec<f32> = Vec::with_capacity(points.len());
    let mut near: Vec<f32> = Vec::new();
    for at in points {
        own.push(to_neighbour(&grid, at, most, &mut near).unwrap_or(most));
    }
    let mut about: Vec<f32> = Vec::with_capacity(points.len());
    for at in points {
        near.clear();
        grid.within(at, ABOUT_CELLS * cell, |point, _| {
            near.push(own[point as usize])
        });
        let middle = near.len() / 2;
        let median = *near.select_nth_unstable_by(middle, f32::total_cmp).1;
        about.push(median.max(cell));
    }
    about
}

/// How far a point's neighbour is that says its distance; `None` where it is no nearer than `reach`. `near` is only
/// room for what is found.
fn to_neighbour(grid: &Grid, at: &Point3<f32>, reach: f32, near: &mut Vec<f32>) -> Option<f32> {
    near.clear();
    grid.within(at, reach, |_, square| near.push(square));
    if near.len() <= NEIGHBOUR {
        return None;
    }
    let square = *near.select_nth_unstable_by(NEIGHBOUR, f32::total_cmp).1;
    Some(square.sqrt())
}

/// The median distance of points to the third of their neighbours: of a sparse cloud it is more
/// than the side of the cells.
fn spacing(points: &[Point3<f32>], cell: f32) -> f32 {
    let grid = Grid::new(points, 4.0 * cell);
    let step = (points.len() / 1000).max(1);
    let mut thirds: Vec<f64> = Vec::new();
    let mut near: Vec<f32> = Vec::new();
    for at in points.iter().step_by(step) {
        let mut reach = 4.0 * cell;
        let mut third = to_neighbour(&grid, at, reach, &mut near);
        while third.is_none() && 2.0 * reach < 1000.0 * cell {
            reach *= 2.0;
            third = to_neighbour(&grid, at, reach, &mut near);
        }
        thirds.extend(third.map(f64::from));
    }
    median(thirds, f64::total_cmp).map_or(cell, |third| third as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Generator, generator};
    use rand::RngExt;

    /// Points by chance on an upright tube.
    fn tube(chance: &mut Generator, count: usize, radius: f32, x: f32) -> Vec<Point3<f32>> {
        let mut points = Vec::with_capacity(count);
        for _ in 0..count {
            let angle = std::f32::consts::TAU * chance.random::<f32>();
            let up = chance.random::<f32>();
            points.push(Point3::new(
                x + radius * angle.cos(),
                radius * angle.sin(),
                up,
            ));
        }
        points
    }

    /// The most of the first 6000 points that hang together.
    fn largest(graph: &Graph) -> Option<usize> {
        let pieces = graph.pieces();
        let mut sizes = vec![0; pieces.len()];
        pieces[..6000].iter().for_each(|p| sizes[*p as usize] += 1);
        sizes.into_iter().max()
    }

    #[test]
    fn a_trunk_sparser_than_twigs_hangs_together() {
        let mut chance = generator(7, 0);
        let mut points = tube(&mut chance, 6000, 0.1, 0.0);
        points.extend(tube(&mut chance, 12_000, 0.03, 0.5));
        let cell = spacing(&points, 0.005);
        let spacings = spacings_about(&points, cell);
        assert!(
            spacings
                .iter()
                .all(|s| (cell..=SPARSEST_CELLS * cell).contains(s))
        );
        let trunk = median(
            spacings[..6000].iter().map(|s| f64::from(*s)).collect(),
            f64::total_cmp,
        );
        assert!(trunk > Some(1.4 * f64::from(cell)), "{trunk:?} {cell}");
        let reaches: Vec<f32> = spacings.iter().map(|s| REACH * s).collect();
        assert!(largest(&Graph::of_reaches(&points, &reaches)) > Some(5900));
        assert!(largest(&Graph::new(&points, REACH * cell)) < Some(3000));
    }
}

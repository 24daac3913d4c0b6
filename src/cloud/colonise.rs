//! Space colonisation (Runions, Lane & Prusinkiewicz 2007; Hu et al. 2017 sect. 6.1): a tree grows
//! from the foot towards the points of the cloud, each of which draws the node that is nearest to
//! it, until a node is near.

use super::grid::Grid;
use super::raw_tree::{RawNode, RawTree};
use nalgebra::{Point3, Vector3};

/// Length of a step D in the distance of points; the distance d_k in which a point is reached, and
/// d_i in which it draws, in steps. The papers give no numbers for clouds.
const STEP_CELLS: f64 = 2.0;
const KILL_STEPS: f64 = 2.0;
const INFLUENCE_STEPS: f64 = 12.0;
/// A node that would grow a child this near to one that it has, in steps, is drawn to and fro
/// between two points, and stops (the guard that Runions' loop needs to end).
const SAME_CHILD: f64 = 0.1;
/// Nodes that are grown.
const MOST_NODES: usize = 400_000;

/// The nearest node of a point.
#[derive(Clone, Copy, Debug)]
struct Drawn {
    node: u32,
    distance: f32,
    /// A node is near: it draws no more.
    is_reached: bool,
}

/// The state of the growth.
struct Growth<'a> {
    points: &'a [Point3<f32>],
    grid: Grid<'a>,
    tree: RawTree,
    children: Vec<Vec<u32>>,
    drawn: Vec<Drawn>,
    step: f64,
}

/// The tree that is grown from `foot` into the points, which are about `cell` apart and belong to the tree
/// `middles`: points are drawn to the middles of the wood first, and gaps that it leads over are filled,
/// for no point draws over a wide one.
pub(super) fn colonise(
    middles: &RawTree,
    points: &[Point3<f32>],
    foot: Point3<f64>,
    cell: f32,
) -> RawTree {
    let mut drawing = middles.contracted(points);
    drawing.extend(middles.between(STEP_CELLS * f64::from(cell)));
    let mut tree = grown(&drawing, foot, cell);
    tree.of_point.truncate(points.len());
    tree
}

/// The tree that is grown from `foot` into the points, which are about `cell` apart.
fn grown(points: &[Point3<f32>], foot: Point3<f64>, cell: f32) -> RawTree {
    let step = STEP_CELLS * f64::from(cell);
    let mut growth = Growth {
        points,
        grid: Grid::new(points, (INFLUENCE_STEPS * step) as f32),
        tree: RawTree::default(),
        children: Vec::new(),
        drawn: vec![
            Drawn {
                node: u32::MAX,
                distance: f32::INFINITY,
                is_reached: false
            };
            points.len()
        ],
        step,
    };
    growth.add(None, foot);
    growth.rise();
    while growth.grow() && growth.tree.nodes.len() < MOST_NODES {}
    growth.tree.of_point = growth.drawn.iter().map(|d| d.node).collect();
    growth.tree
}

impl Growth<'_> {
    /// Adds a node; points that it is the nearest of are drawn to it.
    fn add(&mut self, parent: Option<usize>, at: Point3<f64>) {
        let node = self.tree.nodes.len() as u32;
        self.tree.nodes.push(RawNode { parent, at });
        self.children.push(Vec::new());
        if let Some(parent) = parent {
            self.children[parent].push(node);
        }
        let kill = (KILL_STEPS * self.step) as f32;
        let drawn = &mut self.drawn;
        self.grid.within(
            &at.cast(),
            (INFLUENCE_STEPS * self.step) as f32,
            |point, square| {
                let own = &mut drawn[point as usize];
                let distance = square.sqrt();
                if distance < own.distance {
                    (own.node, own.distance) = (node, distance);
                }
                own.is_reached |= distance < kill;
            },
        );
    }

    /// The stem grows straight up until a point draws it.
    fn rise(&mut self) {
        let top = self
            .points
            .iter()
            .map(|p| f64::from(p.z))
            .fold(f64::NEG_INFINITY, f64::max);
        while self.drawn.iter().all(|d| d.node == u32::MAX) {
            let last = self.tree.nodes.len() - 1;
            let at = self.tree.nodes[last].at + Vector3::z() * self.step;
            if at.z > top {
                return;
            }
            self.add(Some(last), at);
        }
    }

    fn has_child_at(&self, node: usize, at: &Point3<f64>) -> bool {
        let mut children = self.children[node].iter();
        children.any(|c| (self.tree.nodes[*c as usize].at - at).norm() < SAME_CHILD * self.step)
    }

    /// One round. Returns whether anything grew.
    fn grow(&mut self) -> bool {
        let mut pulls: Vec<Vector3<f64>> = vec![Vector3::zeros(); self.tree.nodes.len()];
        for (at, drawn) in self.points.iter().zip(&self.drawn) {
            if !drawn.is_reached && drawn.node != u32::MAX {
                let way = at.cast::<f64>() - self.tree.nodes[drawn.node as usize].at;
                pulls[drawn.node as usize] += way.try_normalize(1e-12).unwrap_or_default();
            }
        }
        let before = self.tree.nodes.len();
        for (node, pull) in pulls.iter().enumerate() {
            let Some(along) = pull.try_normalize(1e-9) else {
                continue;
            };
            let at = self.tree.nodes[node].at + along * self.step;
            if !self.has_child_at(node, &at) {
                self.add(Some(node), at);
            }
        }
        self.tree.nodes.len() > before
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two points drew one node for ever to and fro between them in the loop as printed.
    #[test]
    fn growth_ends_and_reaches_what_it_can() {
        let pair = [Point3::new(-9.0, 0.0, 5.0), Point3::new(9.0, 0.0, 5.0)];
        assert!(grown(&pair, Point3::origin(), 1.0).nodes.len() < 200);
        let row: Vec<Point3<f32>> = (0..60)
            .map(|i| Point3::new(0.5 * i as f32, 0.0, 10.0 + i as f32))
            .collect();
        let tree = grown(&row, Point3::origin(), 1.0);
        let tip = tree.nodes.iter().map(|n| n.at.z).fold(0.0, f64::max);
        assert!((66.0..70.0).contains(&tip), "{tip}");
        assert!(tree.of_point.iter().all(|n| *n != u32::MAX));
    }

    /// A gap that the ways lead over ended the growth: a tree of 6.5 m was 0.4 m high.
    #[test]
    fn growth_goes_on_over_gaps_that_the_ways_lead_over() {
        let row: Vec<Point3<f32>> = (0..100)
            .map(|i| Point3::new(0.0, 0.0, if i < 40 { i as f32 } else { 60.0 + i as f32 }))
            .collect();
        let mut middles = RawTree::default();
        for (i, at) in row.iter().enumerate() {
            let parent = i.checked_sub(1);
            middles.nodes.push(RawNode {
                parent,
                at: at.cast(),
            });
            middles.of_point.push(i as u32);
        }
        let tree = colonise(&middles, &row, Point3::origin(), 1.0);
        let tip = tree.nodes.iter().map(|n| n.at.z).fold(0.0, f64::max);
        assert!((155.0..162.0).contains(&tip), "{tip}");
        assert_eq!(tree.of_point.len(), row.len());
    }
}

//! Space colonisation (Runions, Lane & Prusinkiewicz 2007; Hu et al. 2017 sect. 6.1): a tree grows
//! from the foot towards the points of the cloud, each of which draws the node that is nearest to
//! it, until a node is near.

use super::grid::Grid;
use super::raw_tree::{RawNode, RawTree};
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;

/// The lengths of the growth. The papers give no numbers for clouds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colonisation {
    /// Length of a step D, in distances of points.
    pub step_cells: f64,
    /// Distance d_k in which a point is reached, and d_i in which it draws, in steps.
    pub kill_steps: f64,
    pub influence_steps: f64,
}

impl Colonisation {
    /// Along the wood. From 12 steps lines cut corners, and points that are reached from 2 are those of short
    /// branches (made clouds 68811 to 68814).
    pub const ALONG_WOOD: Self = Self {
        step_cells: 2.0,
        kill_steps: 1.0,
        influence_steps: 2.0,
    };
    /// In the bare cloud.
    pub const BARE: Self = Self {
        step_cells: 2.0,
        kill_steps: 2.0,
        influence_steps: 8.0,
    };
}

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

/// The middles in the order of a walk from the foot, each with all that it carries behind it.
struct Carried {
    /// Of each middle its number in the walk, and the last number that it carries.
    first: Vec<u32>,
    last: Vec<u32>,
    /// Of each middle those that grow from it, by their numbers.
    above: Vec<Vec<u32>>,
}

impl Carried {
    fn of(middles: &RawTree) -> Self {
        let count = middles.nodes.len();
        let mut above: Vec<Vec<u32>> = vec![Vec::new(); count];
        let mut carried = vec![1_u32; count];
        for (i, node) in middles.nodes.iter().enumerate().rev() {
            if let Some(parent) = node.parent {
                carried[parent] += carried[i];
                above[parent].push(i as u32);
            }
        }
        let mut first = vec![0; count];
        for i in 0..count {
            let mut next = first[i] + 1;
            for child in &above[i] {
                first[*child as usize] = next;
                next += carried[*child as usize];
            }
        }
        let last = first.iter().zip(&carried).map(|(f, c)| f + c - 1).collect();
        Self { first, last, above }
    }

    /// Whether the walk comes to the first one before the second.
    fn is_before(&self, one: u32, other: u32) -> bool {
        self.first[one as usize] < self.first[other as usize]
    }

    /// Whether the way from the second to the foot passes the first.
    fn carries(&self, low: u32, high: u32) -> bool {
        let [low, high] = [low as usize, high as usize];
        (self.first[low]..=self.last[low]).contains(&self.first[high])
    }

    /// Which of those that grow from a middle carries another one.
    fn towards(&self, low: u32, high: u32) -> Option<u32> {
        let above = &self.above[low as usize];
        let number = self.first[high as usize];
        let next = above.partition_point(|child| self.first[*child as usize] <= number);
        let child = *above.get(next.checked_sub(1)?)?;
        self.carries(child, high).then_some(child)
    }
}

/// What draws a node towards one of the branches from where it is, or along its own middle.
#[derive(Clone, Copy, Debug)]
struct Pull {
    sum: Vector3<f64>,
    /// A middle that it draws to, and that of the greatest number.
    to: [u32; 2],
}

/// The state of the growth.
struct Growth<'a> {
    points: &'a [Point3<f32>],
    middles: &'a RawTree,
    carried: Carried,
    /// Of each point the middle that it belongs to; `u32::MAX` of none.
    middle_of: &'a [u32],
    grid: Grid<'a>,
    tree: RawTree,
    /// Of each node the middle where it is.
    at_middle: Vec<u32>,
    children: Vec<Vec<u32>>,
    drawn: Vec<Drawn>,
    /// Length of a step, and the distances in which a point is reached and draws.
    step: f64,
    kill: f32,
    influence: f32,
}

/// The tree that is grown from `foot` into the points, which are about `cell` apart and belong to the tree
/// `middles`: points are drawn to the middles of the wood first, and gaps that it leads over are filled,
/// for no point draws over a wide one.
pub(super) fn colonise(
    middles: &RawTree,
    points: &[Point3<f32>],
    foot: Point3<f64>,
    cell: f32,
    lengths: &Colonisation,
) -> RawTree {
    let mut drawing = middles.contracted(points);
    let mut middle_of = middles.of_point.clone();
    for (middle, at) in middles.between(foot, lengths.step_cells * f64::from(cell)) {
        middle_of.push(middle);
        drawing.push(at);
    }
    let mut tree = grown(&drawing, &middle_of, middles, foot, cell, lengths);
    tree.of_point.truncate(points.len());
    tree
}

/// The loop of Runions 2007 on the points as they are, with no guard but that against the two-point oscillation: all
/// points belong to one middle, and draw what is nearest.
pub(super) fn colonise_bare(
    points: &[Point3<f32>],
    foot: Point3<f64>,
    cell: f32,
    lengths: &Colonisation,
) -> RawTree {
    let mut middles = RawTree::default();
    middles.nodes.push(RawNode {
        parent: None,
        at: foot,
    });
    grown(
        points,
        &vec![0; points.len()],
        &middles,
        foot,
        cell,
        lengths,
    )
}

/// The tree that is grown from `foot` into the points, which are about `cell` apart. A point draws only wood that
/// its way to the foot passes, and is reached only by that: where branches touch, the nearest node is of the other.
fn grown(
    points: &[Point3<f32>],
    middle_of: &[u32],
    middles: &RawTree,
    foot: Point3<f64>,
    cell: f32,
    lengths: &Colonisation,
) -> RawTree {
    let step = lengths.step_cells * f64::from(cell);
    let influence = (lengths.influence_steps * step) as f32;
    let mut growth = Growth {
        points,
        middles,
        carried: Carried::of(middles),
        middle_of,
        grid: Grid::new(points, influence),
        tree: RawTree::default(),
        at_middle: Vec::new(),
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
        kill: (lengths.kill_steps * step) as f32,
        influence,
    };
    growth.add(None, foot, 0);
    growth.rise();
    while growth.grow() && growth.tree.nodes.len() < MOST_NODES {}
    growth.tree.of_point = growth.drawn.iter().map(|d| d.node).collect();
    growth.tree
}

impl Growth<'_> {
    /// Adds a node where a middle is; points that it is the nearest of are drawn to it.
    fn add(&mut self, parent: Option<usize>, at: Point3<f64>, middle: u32) {
        let node = self.tree.nodes.len() as u32;
        self.tree.nodes.push(RawNode { parent, at });
        self.at_middle.push(middle);
        self.children.push(Vec::new());
        if let Some(parent) = parent {
            self.children[parent].push(node);
        }
        let (kill, influence) = (self.kill, self.influence);
        let (drawn, carried, middle_of) = (&mut self.drawn, &self.carried, self.middle_of);
        self.grid.within(&at.cast(), influence, |point, square| {
            let of = middle_of[point as usize];
            if of == u32::MAX || !carried.carries(middle, of) {
                return;
            }
            let own = &mut drawn[point as usize];
            let distance = square.sqrt();
            if distance < own.distance {
                (own.node, own.distance) = (node, distance);
            }
            own.is_reached |= distance < kill;
        });
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
            self.add(Some(last), at, 0);
        }
    }

    /// Whether a node has a child at a place and on the way along a middle. One beside it on another way draws
    /// nothing of this.
    fn has_child_at(&self, node: usize, at: &Point3<f64>, middle: u32) -> bool {
        self.children[node].iter().any(|child| {
            let child = *child as usize;
            let apart = (self.tree.nodes[child].at - at).norm();
            apart < SAME_CHILD * self.step && self.at_middle[child] == middle
        })
    }

    /// What draws each node, for each branch that parts from the middle where it is.
    fn pulls(&self) -> BTreeMap<(u32, Option<u32>), Pull> {
        let mut pulls: BTreeMap<(u32, Option<u32>), Pull> = BTreeMap::new();
        let points = self.points.iter().zip(self.middle_of);
        for ((at, middle), drawn) in points.zip(&self.drawn) {
            if drawn.is_reached || drawn.node == u32::MAX {
                continue;
            }
            let node = drawn.node as usize;
            let way = at.cast::<f64>() - self.tree.nodes[node].at;
            let branch = self.carried.towards(self.at_middle[node], *middle);
            let pull = pulls.entry((drawn.node, branch)).or_insert(Pull {
                sum: Vector3::zeros(),
                to: [*middle; 2],
            });
            pull.sum += way.try_normalize(1e-12).unwrap_or_default();
            if self.carried.is_before(*middle, pull.to[0]) {
                pull.to[0] = *middle;
            } else if self.carried.is_before(pull.to[1], *middle) {
                pull.to[1] = *middle;
            }
        }
        pulls
    }

    /// The middle that is nearest to a place on the common way from one to those that draw.
    fn middle_near(&self, at: &Point3<f64>, from: u32, to: [u32; 2]) -> u32 {
        let (mut nearest, mut next) = (from, from);
        while let Some(above) = self.carried.towards(next, to[0]) {
            if !self.carried.carries(above, to[1]) {
                break;
            }
            let [off, least] = [above, nearest].map(|middle| self.off(at, middle));
            if off <= least {
                nearest = above;
            } else if off > least + 2.0 * self.step {
                break;
            }
            next = above;
        }
        nearest
    }

    /// How far a place is from a middle.
    fn off(&self, at: &Point3<f64>, middle: u32) -> f64 {
        (self.middles.nodes[middle as usize].at - at).norm()
    }

    /// One round. Returns whether anything grew.
    fn grow(&mut self) -> bool {
        let before = self.tree.nodes.len();
        for ((node, _), pull) in self.pulls() {
            let node = node as usize;
            let Some(along) = pull.sum.try_normalize(1e-9) else {
                continue;
            };
            let at = self.tree.nodes[node].at + along * self.step;
            let middle = self.middle_near(&at, self.at_middle[node], pull.to);
            if !self.has_child_at(node, &at, middle) {
                self.add(Some(node), at, middle);
            }
        }
        self.tree.nodes.len() > before
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grown_bare(points: &[Point3<f32>]) -> RawTree {
        colonise_bare(points, Point3::origin(), 1.0, &Colonisation::ALONG_WOOD)
    }

    fn grown_along(middles: &RawTree, points: &[Point3<f32>]) -> RawTree {
        let lengths = Colonisation::ALONG_WOOD;
        colonise(middles, points, Point3::origin(), 1.0, &lengths)
    }

    /// A middle at each point.
    fn middles_at(points: &[Point3<f32>], parent: impl Fn(usize) -> Option<usize>) -> RawTree {
        let mut middles = RawTree::default();
        for (i, at) in points.iter().enumerate() {
            middles.nodes.push(RawNode {
                parent: parent(i),
                at: at.cast(),
            });
            middles.of_point.push(i as u32);
        }
        middles
    }

    /// Two points drew one node for ever to and fro between them in the loop as printed.
    #[test]
    fn growth_ends_and_reaches_what_it_can() {
        let pair = [Point3::new(-3.0, 0.0, 5.0), Point3::new(3.0, 0.0, 5.0)];
        assert!(grown_bare(&pair).nodes.len() < 200);
        let row: Vec<Point3<f32>> = (0..60)
            .map(|i| Point3::new(0.5 * i as f32, 0.0, 10.0 + i as f32))
            .collect();
        let tree = grown_bare(&row);
        let tip = tree.nodes.iter().map(|n| n.at.z).fold(0.0, f64::max);
        assert!((66.0..70.0).contains(&tip), "{tip}");
        assert!(tree.of_point.iter().all(|n| *n != u32::MAX));
    }

    /// A branch that comes back to the trunk: its tip was taken for wood of the trunk.
    #[test]
    fn a_branch_that_touches_another_is_grown_from_its_own_base() {
        let trunk = (0..60).map(|i| Point3::new(0.0, 0.0, i as f32));
        let bow = (1..40).map(|i| {
            let angle = std::f32::consts::PI * i as f32 / 40.0;
            Point3::new(1.0 + 12.0 * angle.sin(), 0.0, 32.0 - 12.0 * angle.cos())
        });
        let points: Vec<Point3<f32>> = trunk.chain(bow).collect();
        let middles = middles_at(
            &points,
            |i| {
                if i == 60 { Some(20) } else { i.checked_sub(1) }
            },
        );
        let tree = grown_along(&middles, &points);
        let mut node = tree.of_point[points.len() - 1] as usize;
        let mut farthest: f64 = 0.0;
        while let Some(parent) = tree.nodes[node].parent {
            node = parent;
            farthest = farthest.max(tree.nodes[node].at.x);
        }
        assert!((11.0..15.0).contains(&farthest), "{farthest}");
    }

    /// Two limbs that leave one node side by side: the second one was taken for the first, and not grown.
    #[test]
    fn limbs_that_part_slowly_are_both_grown() {
        let trunk = (0..20).map(|i| Point3::new(0.0, 0.0, i as f32));
        let limb = |side: f32| {
            (0..40).map(move |i| {
                let way = i as f32;
                Point3::new(side * (0.02 + 0.01 * way * way), 0.0, 20.0 + way)
            })
        };
        let points: Vec<Point3<f32>> = trunk.chain(limb(-1.0)).chain(limb(1.0)).collect();
        let middles = middles_at(
            &points,
            |i| {
                if i == 60 { Some(19) } else { i.checked_sub(1) }
            },
        );
        let tree = grown_along(&middles, &points);
        assert!(tree.of_point.iter().all(|node| *node != u32::MAX));
    }

    /// A gap that the ways lead over ended the growth: a tree of 6.5 m was 0.4 m high.
    #[test]
    fn growth_goes_on_over_gaps_that_the_ways_lead_over() {
        let row: Vec<Point3<f32>> = (0..100)
            .map(|i| Point3::new(0.0, 0.0, if i < 40 { i as f32 } else { 60.0 + i as f32 }))
            .collect();
        let middles = middles_at(&row, |i| i.checked_sub(1));
        let tree = grown_along(&middles, &row);
        let tip = tree.nodes.iter().map(|n| n.at.z).fold(0.0, f64::max);
        assert!((155.0..162.0).contains(&tip), "{tip}");
        assert_eq!(tree.of_point.len(), row.len());
    }
}

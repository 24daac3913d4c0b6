//! A new flat tree, grown fork by fork from root to leaf (Li 2011 sect. 5.3).

use super::dirichlet::{Dirichlet, DirichletFit, fit};
use super::features::{Bifurcation, bifurcations};
use super::fork_tree::fork_tree;
use super::space::GrowthSpace;
use super::von_mises::VonMises;
use crate::model::{Outline, Skeleton};
use crate::random::Generator;
use crate::skeleton::Node2d;
use nalgebra::{Point2, Rotation2, Vector2};
use rand::RngExt;
use rand::seq::SliceRandom;
use std::f64::consts::TAU;

/// An example with fewer forks says nothing on what forks are like.
pub const FEWEST_FORKS: usize = 3;
/// Bifurcations that are looked at for one leaf, at first, each with its mirror image.
const HAND: usize = 12;
/// Leaves of which that with the longest branch goes on: large gaps are closed first.
const LEAVES: u32 = 3;
/// Trees of which the one that fills the region best is taken.
const TREES: u32 = 8;
/// How often bifurcations are sampled anew in place of those that fit nowhere.
const ROUNDS: u32 = 4;
/// No branch is shorter than this share of the region's height.
const SHORTEST: f64 = 0.01;
/// A direction that brings every place nearer by this share of the region's width says next to
/// nothing on where to grow. It is added to every gain, see [`crate::shape::Terms::Both`].
const GAIN_FLOOR: f64 = 0.002;

/// What an example says on the form of trees like it.
#[derive(Clone, Debug, PartialEq)]
pub struct ForkStatistics {
    /// Of its forks, without their mirror images.
    pub bifurcations: Vec<Bifurcation>,
    /// Learned from them and their mirror images, so that left and right are alike.
    pub angles: DirichletFit,
    pub lengths: DirichletFit,
    /// How far branches above the trunk turn from the direction away from the foot, to either side,
    /// radians.
    pub directions: VonMises,
    /// Number of foot, forks and tips, and the level of the highest of them.
    pub nodes: usize,
    pub deepest: u8,
    /// From the foot to the main fork, px in the picture.
    pub trunk_px: Vector2<f64>,
}

/// Why no tree can be grown.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GrowError {
    #[error(
        "the example has {found} forks, and new trees take at least {FEWEST_FORKS}; take one that branches more"
    )]
    TooFewForks { found: usize },
    #[error("the region that is to be filled is empty; draw it over the tree")]
    NoSpace,
    #[error("the region that is to be filled lies off the trunk; draw it over the tree")]
    OffTree,
}

impl ForkStatistics {
    /// Of the tree of `skeleton`, without its copies.
    ///
    /// # Errors
    /// It has fewer than [`FEWEST_FORKS`] forks.
    pub fn of(skeleton: &Skeleton) -> Result<Self, GrowError> {
        let top = skeleton.measured_branches().next().unwrap_or_default();
        let top = skeleton.nodes.get(top.index());
        let top_px = top.map_or(skeleton.foot_px, |n| skeleton.image_from_model(&n.position));
        Self::of_tree(&fork_tree(skeleton), top_px)
    }

    /// Of a flat tree of forks and tips with the trunk's top there, px.
    fn of_tree(tree: &[Node2d], top_px: Point2<f64>) -> Result<Self, GrowError> {
        let found = bifurcations(tree);
        let few = GrowError::TooFewForks { found: found.len() };
        if found.len() < FEWEST_FORKS {
            return Err(few);
        }
        let (mut angles, mut lengths) = (Vec::new(), Vec::new());
        for of_fork in found.iter().flat_map(|b| [*b, b.mirrored()]) {
            angles.push(of_fork.angles.to_vec());
            lengths.push(of_fork.lengths.to_vec());
        }
        let (Some(angles), Some(lengths)) = (fit(&angles), fit(&lengths)) else {
            return Err(few);
        };
        Ok(Self {
            bifurcations: found,
            angles,
            lengths,
            nodes: tree.len(),
            deepest: tree.iter().map(|n| n.level).max().unwrap_or(0),
            directions: directions(tree),
            trunk_px: trunk(tree, top_px),
        })
    }

    /// A bifurcation like those of the example.
    pub fn sample(&self, random: &mut Generator) -> Bifurcation {
        Bifurcation {
            angles: sampled(&self.angles.distribution, random),
            lengths: sampled(&self.lengths.distribution, random),
        }
    }
}

/// A tuple of three.
fn sampled(distribution: &Dirichlet, random: &mut Generator) -> [f64; 3] {
    let drawn = distribution.sample(random);
    std::array::from_fn(|k| drawn.get(k).copied().unwrap_or(0.0))
}

/// From the foot to the main fork: of those up to the trunk's top that are met with on the way
/// along the branch that carries most, the one at which the second branch carries most, the lowest
/// of equals; else to the top. Twigs that leave the trunk do not end it.
fn trunk(tree: &[Node2d], top_px: Point2<f64>) -> Vector2<f64> {
    let mut carried = vec![1_usize; tree.len()];
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); tree.len()];
    for i in (1..tree.len()).rev() {
        if let Some(parent) = tree[i].parent {
            carried[parent] += carried[i];
            children[parent].push(i);
        }
    }
    let (mut most, mut end_px) = (0, top_px);
    let mut at = (!tree.is_empty()).then_some(0);
    while let Some(node) = at {
        let own = &mut children[node];
        own.sort_by_key(|child| std::cmp::Reverse((carried[*child], *child)));
        let second = own.get(1).map_or(0, |child| carried[*child]);
        let here = tree[node].position_px;
        if node > 0 && second > most && here.y >= top_px.y - 1.0 {
            (most, end_px) = (second, here);
        }
        at = own.first().copied();
    }
    tree.first()
        .map_or_else(Vector2::zeros, |foot| end_px - foot.position_px)
}

/// The distribution of the angles between the direction from the foot and the branches above the
/// first, and their mirror images.
fn directions(tree: &[Node2d]) -> VonMises {
    let mut angles = Vec::new();
    for node in tree.iter().filter(|n| n.level > 1) {
        let below = node.parent.map_or(node, |p| &tree[p]);
        let angle = outward(tree[0].position_px, below.position_px, node.position_px);
        angles.extend([angle, -angle]);
    }
    VonMises::fit(&angles).unwrap_or(VonMises::new(0.0, 0.0))
}

/// Angle between the direction from the foot and that of a branch, clockwise, radians.
fn outward(foot_px: Point2<f64>, from_px: Point2<f64>, to_px: Point2<f64>) -> f64 {
    let (out, way) = (from_px - foot_px, to_px - from_px);
    out.perp(&way).atan2(out.dot(&way))
}

/// Grows a tree in `region`, from a foot at `foot_px`. `scale` is how much larger it is to be than
/// the example. Of some trees that are grown the one that fills the region best (eq. 5) is taken.
///
/// As many bifurcations are sampled as the example's number of nodes asks for, and each is put to
/// use once, as it was sampled: so the forks of the tree have the distribution that was learned,
/// whatever room there is. Of three random leaves that with the longest branch is the next apex,
/// and its own branch the stem, which the lengths go by. Of some of the sampled bifurcations and
/// their mirror images, which stand in as many directions, the most probable is taken (eq. 2): it
/// brings the tree nearer to the places of the region (eq. 6), and its branches go away from the
/// foot as the example's do. One that would leave the region is not taken. In place of those that
/// fit nowhere others are sampled, three times. It ends when the bifurcations are used up, or none
/// of them fits at any leaf, or every leaf is as deep as the example's deepest.
///
/// The paper turns a bifurcation about the leaf into the direction that fills most and is natural.
/// To turn it is to change two of its three angles: the forks would no longer be like the
/// example's, and at the border of the region, where only odd directions fit, least of all.
///
/// # Errors
/// The region is empty, or lies off the trunk.
pub fn grow_flat(
    example: &ForkStatistics,
    region: &Outline,
    foot_px: Point2<f64>,
    scale: f64,
    random: &mut Generator,
) -> Result<Vec<Node2d>, GrowError> {
    let space = GrowthSpace::of(region).ok_or(GrowError::NoSpace)?;
    let trunk = Growth::on_trunk(example, space, foot_px, scale)?;
    let mut fullest = trunk.clone();
    for _ in 0..TREES {
        let tree = grown(trunk.clone(), example, random);
        if tree.space.distance_px() < fullest.space.distance_px() {
            fullest = tree;
        }
    }
    Ok(fullest.tree)
}

/// A tree on a trunk.
fn grown<'a>(
    mut trunk: Growth<'a>,
    example: &ForkStatistics,
    random: &mut Generator,
) -> Growth<'a> {
    let forks = example.nodes.saturating_sub(1) / 2;
    for _ in 0..ROUNDS {
        let missing = forks.saturating_sub(trunk.forks());
        let unused = (0..missing).map(|_| example.sample(random)).collect();
        trunk.round(unused, example.deepest, random);
    }
    trunk
}

/// A tree that is being grown.
#[derive(Clone)]
struct Growth<'a> {
    tree: Vec<Node2d>,
    space: GrowthSpace<'a>,
    directions: VonMises,
    shortest_px: f64,
    gain_floor_px: f64,
}

/// One way to go on from a leaf.
#[derive(Clone, Copy, Debug)]
struct Way {
    /// Its place among those that are not used yet.
    bifurcation: usize,
    ends_px: [Point2<f64>; 2],
    /// How probable it is, but for a factor that all have.
    weight: f64,
}

impl<'a> Growth<'a> {
    /// The foot, and the trunk as the example has it.
    fn on_trunk(
        example: &ForkStatistics,
        mut space: GrowthSpace<'a>,
        foot_px: Point2<f64>,
        scale: f64,
    ) -> Result<Self, GrowError> {
        let wanted = foot_px + example.trunk_px * scale;
        let top_px = if space.holds(wanted, wanted) {
            wanted
        } else {
            space.nearest_place(wanted)
        };
        // As far as a drawn shape is led on to the trunk of a tree that is cut to it.
        let is_near = (top_px - wanted).norm() <= 0.5 * space.height_px();
        if !is_near || top_px == foot_px {
            return Err(GrowError::OffTree);
        }
        space.add(foot_px);
        space.add(top_px);
        Ok(Self {
            tree: vec![new_node(None, 0, foot_px), new_node(Some(0), 1, top_px)],
            shortest_px: SHORTEST * space.height_px(),
            gain_floor_px: GAIN_FLOOR * space.width_px(),
            space,
            directions: example.directions,
        })
    }

    /// Number of forks into two.
    fn forks(&self) -> usize {
        self.tree.len() / 2 - 1
    }

    /// Puts bifurcations to use at leaves below the level `deepest`, as long as there are some and
    /// one of them fits.
    fn round(&mut self, mut unused: Vec<Bifurcation>, deepest: u8, random: &mut Generator) {
        let mut is_leaf = vec![true; self.tree.len()];
        for parent in self.tree.iter().filter_map(|n| n.parent) {
            is_leaf[parent] = false;
        }
        let mut leaves: Vec<usize> = (1..self.tree.len()).filter(|i| is_leaf[*i]).collect();
        while !leaves.is_empty() && !unused.is_empty() {
            let leaf = self.longest_of_some(&mut leaves, random);
            if self.tree[leaf].level >= deepest {
                continue;
            }
            unused.shuffle(random);
            let hand = HAND.min(unused.len());
            let mut ways = self.ways(leaf, &unused[..hand], 0);
            if ways.is_empty() {
                ways = self.ways(leaf, &unused[hand..], hand);
            }
            // Where nothing fits the leaf remains one.
            if let Some(way) = best(ways) {
                unused.swap_remove(way.bifurcation);
                leaves.extend(self.fork(leaf, way));
            }
        }
    }

    /// Takes out of `leaves`, of which there is one at least, that with the longest branch of
    /// [`LEAVES`] random ones.
    fn longest_of_some(&self, leaves: &mut Vec<usize>, random: &mut Generator) -> usize {
        let mut longest = random.random_range(0..leaves.len());
        for _ in 1..LEAVES {
            let other = random.random_range(0..leaves.len());
            if self.length_px(leaves[other]) > self.length_px(leaves[longest]) {
                longest = other;
            }
        }
        leaves.swap_remove(longest)
    }

    /// Length of the branch that ends in a node, px.
    fn length_px(&self, node: usize) -> f64 {
        let node = &self.tree[node];
        let parent = node.parent.map_or(node, |p| &self.tree[p]);
        (node.position_px - parent.position_px).norm()
    }

    /// All ways to go on from `leaf` with one of some bifurcations, of which the first is number
    /// `first`.
    fn ways(&self, leaf: usize, bifurcations: &[Bifurcation], first: usize) -> Vec<Way> {
        let mut ways = Vec::new();
        for (number, bifurcation) in (first..).zip(bifurcations) {
            for mirrored in [*bifurcation, bifurcation.mirrored()] {
                ways.extend(self.way(leaf, number, &mirrored));
            }
        }
        ways
    }

    /// `None` where it leaves the region, or has a branch that is too short.
    fn way(&self, leaf: usize, number: usize, bifurcation: &Bifurcation) -> Option<Way> {
        let apex = self.tree[leaf].position_px;
        let below = self.tree[self.tree[leaf].parent?].position_px;
        let ends_px = branches(bifurcation, apex, below);
        let fits = ends_px
            .iter()
            .all(|end| (end - apex).norm() >= self.shortest_px && self.space.holds(apex, *end));
        if !fits {
            return None;
        }
        let gain_px = self.space.gain(ends_px[0], ends_px[1]) + self.gain_floor_px;
        let foot_px = self.tree[0].position_px;
        let densities = ends_px.map(|end| self.directions.density(outward(foot_px, apex, end)));
        let likely = (densities[0] * densities[1]).max(f64::MIN_POSITIVE);
        Some(Way {
            bifurcation: number,
            ends_px,
            weight: gain_px * likely,
        })
    }

    /// Adds the two branches, and returns their places.
    fn fork(&mut self, leaf: usize, way: Way) -> [usize; 2] {
        let level = self.tree[leaf].level.saturating_add(1);
        way.ends_px.map(|end| {
            self.space.add(end);
            self.tree.push(new_node(Some(leaf), level, end));
            self.tree.len() - 1
        })
    }
}

fn new_node(parent: Option<usize>, level: u8, position_px: Point2<f64>) -> Node2d {
    Node2d {
        parent,
        level,
        cluster: None,
        position_px,
        certainty: 1.0,
    }
}

/// Where the branches of a fork at `apex` end, left and right, whose stem comes from `below`, px.
fn branches(bifurcation: &Bifurcation, apex: Point2<f64>, below: Point2<f64>) -> [Point2<f64>; 2] {
    let [stem, left, right] = bifurcation.lengths;
    let down = (below - apex) / stem.max(f64::MIN_POSITIVE);
    let [to_left, between, _] = bifurcation.angles.map(|share| share * TAU);
    [
        apex + Rotation2::new(to_left) * down * left,
        apex + Rotation2::new(to_left + between) * down * right,
    ]
}

/// The most probable of the ways, the first of equals; `None` of none.
fn best(ways: Vec<Way>) -> Option<Way> {
    ways.into_iter().reduce(more_probable)
}

fn more_probable(first: Way, second: Way) -> Way {
    if second.weight > first.weight {
        second
    } else {
        first
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;
    use crate::random::generator;

    const FOOT: Point2<f64> = Point2::new(100.0, 195.0);

    /// A crown 180 px wide on a trunk 10 px wide.
    fn region() -> Outline {
        let size = Size::new(200, 200);
        let mut mask = Vec::new();
        for v in 0..200 {
            for u in 0..200 {
                let crown = (f64::from(u) - 100.0).hypot(f64::from(v) - 80.0) <= 75.0;
                let trunk = (95..=105).contains(&u) && (80..=198).contains(&v);
                mask.push(u8::from(crown || trunk) * 255);
            }
        }
        Outline {
            size,
            mask,
            polygon_px: Vec::new(),
            matte: None,
        }
    }

    /// A tree of 31 forks, at random leaves, with known shares.
    fn example() -> ForkStatistics {
        let mut tree = vec![
            new_node(None, 0, FOOT),
            new_node(Some(0), 1, FOOT - Vector2::new(0.0, 50.0)),
        ];
        let known = Dirichlet::new(vec![40.0, 16.0, 40.0]).expect("sound");
        let lengths = Dirichlet::new(vec![30.0, 22.0, 22.0]).expect("sound");
        let mut random = generator(11, 0);
        let mut leaves = vec![1];
        while tree.len() < 64 {
            let leaf = leaves.swap_remove(random.random_range(0..leaves.len()));
            let fork = Bifurcation {
                angles: sampled(&known, &mut random),
                lengths: sampled(&lengths, &mut random),
            };
            let below = tree[tree[leaf].parent.expect("a stem")].position_px;
            let level = tree[leaf].level + 1;
            for end in branches(&fork, tree[leaf].position_px, below) {
                leaves.push(tree.len());
                tree.push(new_node(Some(leaf), level, end));
            }
        }
        ForkStatistics::of_tree(&tree, FOOT - Vector2::new(0.0, 50.0)).expect("forks")
    }

    fn grown(seed: u64) -> Vec<Node2d> {
        let mut random = generator(seed, 0);
        grow_flat(&example(), &region(), FOOT, 1.0, &mut random).expect("grown")
    }

    #[test]
    fn a_fork_that_is_drawn_has_the_shape_that_it_was_given() {
        let fork = Bifurcation {
            angles: [0.4, 0.15, 0.45],
            lengths: [0.5, 0.2, 0.3],
        };
        let (apex, below) = (Point2::new(3.0, 4.0), Point2::new(9.0, 12.0));
        let ends = branches(&fork, apex, below);
        let tree = [
            new_node(None, 0, below),
            new_node(Some(0), 1, apex),
            new_node(Some(1), 2, ends[0]),
            new_node(Some(1), 2, ends[1]),
        ];
        let found = bifurcations(&tree)[0];
        for (a, b) in found.angles.iter().zip(fork.angles) {
            assert!((a - b).abs() < 1e-12, "{found:?}");
        }
        for (a, b) in found.lengths.iter().zip(fork.lengths) {
            assert!((a - b).abs() < 1e-12, "{found:?}");
        }
    }

    #[test]
    fn a_new_tree_is_within_the_region_and_as_large_as_the_example() {
        let region = region();
        for seed in 1..=5 {
            let tree = grown(seed);
            assert!((40..=65).contains(&tree.len()), "{} nodes", tree.len());
            for node in &tree[1..] {
                let parent = node.parent.expect("on the trunk");
                assert_eq!(node.level, tree[parent].level + 1);
                assert!(region.contains(node.position_px.x, node.position_px.y));
            }
        }
    }

    #[test]
    fn its_forks_are_like_those_of_the_example() {
        let example = example();
        let mut angles = Vec::new();
        let mut lengths = Vec::new();
        for seed in 1..=20 {
            for fork in bifurcations(&grown(seed)) {
                angles.extend([fork.angles.to_vec(), fork.mirrored().angles.to_vec()]);
                lengths.extend([fork.lengths.to_vec(), fork.mirrored().lengths.to_vec()]);
            }
        }
        for (found, learned) in [(angles, &example.angles), (lengths, &example.lengths)] {
            let found = fit(&found).expect("forks").distribution;
            let pairs = found.mean().into_iter().zip(learned.distribution.mean());
            for (found, learned) in pairs {
                assert!((found - learned).abs() < 0.01, "{found} and {learned}");
            }
            let ratio = found.precision() / learned.distribution.precision();
            assert!((0.8..1.25).contains(&ratio), "{ratio}");
        }
    }

    #[test]
    fn a_seed_gives_one_tree_and_another_seed_another() {
        assert_eq!(grown(3), grown(3));
        assert_ne!(grown(3), grown(4));
    }

    #[test]
    fn what_cannot_be_grown_is_an_error() {
        let few = ForkStatistics::of_tree(&[new_node(None, 0, FOOT)], FOOT);
        assert_eq!(few, Err(GrowError::TooFewForks { found: 0 }));
        let mut random = generator(1, 0);
        let mut empty = region();
        empty.mask.fill(0);
        let nothing = grow_flat(&example(), &empty, FOOT, 1.0, &mut random);
        assert_eq!(nothing, Err(GrowError::NoSpace));
        let far = Point2::new(3000.0, 195.0);
        let off = grow_flat(&example(), &region(), far, 1.0, &mut random);
        assert_eq!(off, Err(GrowError::OffTree));
    }

    /// One pixel wide, one pixel large.
    #[test]
    fn a_narrow_region_ends_the_growth() {
        let mut narrow = region();
        for (k, pixel) in narrow.mask.iter_mut().enumerate() {
            *pixel = u8::from(k % 200 == 100) * 255;
        }
        let mut random = generator(1, 0);
        let tree = grow_flat(&example(), &narrow, FOOT, 1.0, &mut random).expect("a trunk");
        assert!(tree.len() >= 2);
    }
}

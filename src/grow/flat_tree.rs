//! A new flat tree, grown fork by fork from root to leaf (Li 2011 sect. 5.3).

use super::features::{Bifurcation, children};
use super::fork_statistics::{FEWEST_FORKS, ForkStatistics, turn};
use super::space::GrowthSpace;
use crate::model::Outline;
use crate::random::Generator;
use crate::skeleton::Node2d;
use nalgebra::{Point2, Rotation2, Vector2};
use rand::RngExt;
use rand::seq::SliceRandom;
use std::f64::consts::TAU;
use std::ops::Range;

/// Bifurcations that are looked at for one leaf, at first, each with its mirror image.
const HAND: usize = 24;
/// Trees of which the one that fills the region best is taken.
const TREES: u32 = 24;
/// How often bifurcations are tried, first where they are to grow, then at random tips, and how
/// likely a direction must be each time, as a share of the likeliest: 83 %, 91 % and 95 % of a normal
/// distribution are left. Near the border of the region only odd directions fit, and elsewhere
/// there may be room in a natural one.
const LEAST_LIKELIHOOD: [f64; 4] = [0.383, 0.237, 0.147, 0.147];
/// No branch is shorter than this share of the region's height.
const SHORTEST: f64 = 0.01;
/// A direction that brings every place nearer by this share of the region's width says next to
/// nothing on where to grow. It is added to every gain, see [`crate::shape::Terms::Both`].
const GAIN_FLOOR: f64 = 0.002;

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

/// Grows a tree in `region`, from a foot at `foot_px`. `scale` is how much larger it is to be than
/// the example. Of some trees that are grown the one that fills the region best (eq. 5) is taken.
///
/// As many bifurcations are sampled as the example has, and each is put to use once, as it was
/// sampled: so the forks of the tree have the distribution that was learned, whatever room there is.
/// They are shared out from the trunk up: of those that a branch is to carry one is its end, and the
/// two branches there share the rest as those of the example do ([`Sharing`]). The branch with most
/// to carry is the next stem, which the lengths go by. Of some of the sampled bifurcations and their
/// mirror images, which stand in as many directions, the most probable is taken (eq. 2): it brings
/// the tree nearer to the places of the region (eq. 6) with little wood, and its branches go away
/// from the foot as the example's do. One that would leave the region is not taken, nor one that
/// goes where hardly any of the example does. Those that fit nowhere are tried again at random tips.
///
/// The paper grows at a random leaf. Then nothing says which branch becomes a limb, and limbs led
/// back along the border of the region.
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
        let tree = grown(trunk.clone(), random);
        if tree.space.distance_px() < fullest.space.distance_px() {
            fullest = tree;
        }
    }
    Ok(fullest.tree)
}

/// A tree on a trunk.
fn grown<'a>(mut trunk: Growth<'a>, random: &mut Generator) -> Growth<'a> {
    let example = trunk.example;
    let mut unused: Vec<BranchPair> = Vec::with_capacity(example.forks);
    unused.resize_with(example.forks, || BranchPair::of(&example.sample(random)));
    let mut leaves = vec![Leaf {
        node: 1,
        forks: example.forks,
    }];
    for least_likelihood in LEAST_LIKELIHOOD {
        trunk.least_likelihood = least_likelihood;
        trunk.round(leaves, &mut unused, random);
        leaves = trunk.shared_out(unused.len(), random);
    }
    trunk
}

/// A tree that is being grown.
#[derive(Clone)]
struct Growth<'a> {
    example: &'a ForkStatistics,
    tree: Vec<Node2d>,
    space: GrowthSpace<'a>,
    /// Length that the first stem counts with, px.
    first_stem_px: f64,
    shortest_px: f64,
    gain_floor_px: f64,
    /// A direction that is less likely, as a share of the likeliest, is not taken now.
    least_likelihood: f64,
}

/// A tip that is to carry so many forks.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    node: usize,
    forks: usize,
}

/// One way to go on from a leaf.
#[derive(Clone, Copy, Debug)]
struct Way {
    /// The place of its bifurcation among those that are not used yet.
    number: usize,
    /// Of the branch that leads on, and of the other.
    ends_px: [Point2<f64>; 2],
    /// Of its directions.
    likelihood: f64,
}

impl Way {
    /// Of its branches, which leave from `apex`, px.
    fn lengths_px(&self, apex: Point2<f64>) -> [f64; 2] {
        self.ends_px.map(|end| (end - apex).norm())
    }
}

impl<'a> Growth<'a> {
    /// The foot, and the trunk as the example has it.
    fn on_trunk(
        example: &'a ForkStatistics,
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
        space.add(foot_px, top_px);
        Ok(Self {
            example,
            tree: vec![new_node(None, 0, foot_px), new_node(Some(0), 1, top_px)],
            shortest_px: SHORTEST * space.height_px(),
            gain_floor_px: GAIN_FLOOR * space.width_px(),
            first_stem_px: example.first_stem_px() * scale,
            least_likelihood: 1.0,
            space,
        })
    }

    /// Puts bifurcations to use at leaves less deep than the example's deepest, as far as they fit.
    /// Those that fit nowhere are left.
    fn round(
        &mut self,
        mut leaves: Vec<Leaf>,
        unused: &mut Vec<BranchPair>,
        random: &mut Generator,
    ) {
        while let Some(leaf) = take_fullest(&mut leaves) {
            if self.tree[leaf.node].level >= self.example.deepest {
                continue;
            }
            let hand = HAND.min(unused.len());
            let _ = unused.partial_shuffle(random, hand);
            unused.rotate_right(hand);
            let (some, others) = (0..hand, hand..unused.len());
            let way = self
                .best_way(leaf.node, unused, some)
                .or_else(|| self.best_way(leaf.node, unused, others));
            let Some(way) = way else { continue };
            unused.swap_remove(way.number);
            let rest = leaf.forks - 1;
            let leading = self.example.sharing.leading_of(rest, random);
            let shares = [leading, rest - leading];
            for (node, forks) in self.fork(leaf.node, way).into_iter().zip(shares) {
                leaves.extend((forks > 0).then_some(Leaf { node, forks }));
            }
        }
    }

    /// So many forks, each at a random tip.
    fn shared_out(&self, forks: usize, random: &mut Generator) -> Vec<Leaf> {
        let children = children(&self.tree);
        let tips: Vec<usize> = (1..self.tree.len())
            .filter(|i| children[*i].is_empty())
            .collect();
        let mut carried = vec![0; self.tree.len()];
        for _ in 0..forks {
            carried[tips[random.random_range(0..tips.len())]] += 1;
        }
        let leaves = carried.into_iter().enumerate();
        leaves
            .filter(|(_, forks)| *forks > 0)
            .map(|(node, forks)| Leaf { node, forks })
            .collect()
    }

    /// The most probable way to go on from `leaf` with one of the bifurcations `from`, the first of
    /// equals; `None` where none fits.
    fn best_way(
        &self,
        leaf: usize,
        bifurcations: &[BranchPair],
        from: Range<usize>,
    ) -> Option<Way> {
        let apex = self.tree[leaf].position_px;
        let stem = self.stem(leaf)?;
        let mut ways = Vec::with_capacity(2 * from.len());
        for number in from {
            let own = bifurcations[number];
            for pair in [own, own.mirrored()] {
                ways.extend(self.way(apex, stem, number, pair));
            }
        }
        let lengths_px = ways.iter().flat_map(|way| way.lengths_px(apex));
        let surroundings = self.space.around(apex, lengths_px.fold(0.0, f64::max));
        let mut best: Option<(f64, Way)> = None;
        for way in ways {
            let gain_px = surroundings.gain(apex, way.ends_px) + self.gain_floor_px;
            let wood_px: f64 = way.lengths_px(apex).iter().sum();
            let weight = gain_px / wood_px.sqrt() * way.likelihood;
            if best.is_none_or(|(most, _)| weight > most) {
                best = Some((weight, way));
            }
        }
        best.map(|(_, way)| way)
    }

    /// The way down the stem below `leaf` in the length that it counts with, px.
    fn stem(&self, leaf: usize) -> Option<Vector2<f64>> {
        let apex = self.tree[leaf].position_px;
        let stem = self.tree[self.tree[leaf].parent?].position_px - apex;
        Some(match leaf {
            1 => stem.normalize() * self.first_stem_px,
            _ => stem,
        })
    }

    /// With a bifurcation on a stem. `None` where it leaves the region, or has a branch that is too
    /// short or goes in too unlikely a direction.
    fn way(
        &self,
        apex: Point2<f64>,
        stem: Vector2<f64>,
        number: usize,
        pair: BranchPair,
    ) -> Option<Way> {
        let ends_px = pair.ends_px(apex, stem);
        let out = apex - self.tree[0].position_px;
        let [leading, other] = ends_px.map(|end| turn(out, end - apex));
        let leading = self.example.leading.likelihood_towards(leading);
        let other = self.example.others.likelihood_towards(other);
        if leading.min(other) < self.least_likelihood {
            return None;
        }
        let fits = ends_px
            .iter()
            .all(|end| (end - apex).norm() >= self.shortest_px && self.space.holds(apex, *end));
        fits.then_some(Way {
            number,
            ends_px,
            likelihood: leading * other,
        })
    }

    /// Adds the two branches, and returns their places: of that which leads on, and of the other.
    fn fork(&mut self, leaf: usize, way: Way) -> [usize; 2] {
        let level = self.tree[leaf].level.saturating_add(1);
        let apex = self.tree[leaf].position_px;
        way.ends_px.map(|end| {
            self.space.add(apex, end);
            self.tree.push(new_node(Some(leaf), level, end));
            self.tree.len() - 1
        })
    }
}

/// Takes out the leaf that is to carry most, the last of equals.
fn take_fullest(leaves: &mut Vec<Leaf>) -> Option<Leaf> {
    let fullest = (0..leaves.len()).max_by_key(|k| leaves[*k].forks)?;
    Some(leaves.remove(fullest))
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

/// Where the branches of a bifurcation end, seen from its apex with the way down the stem as the first
/// axis and as the unit of length; the second axis is a quarter turn clockwise from it.
#[derive(Clone, Copy, Debug)]
struct BranchPair {
    leading: Vector2<f64>,
    other: Vector2<f64>,
}

impl BranchPair {
    /// Of one whose left branch leads on.
    fn of(bifurcation: &Bifurcation) -> Self {
        let [stem, left, right] = bifurcation.lengths;
        let [to_left, between, _] = bifurcation.angles.map(|share| share * TAU);
        let unit = Vector2::x() / stem.max(f64::MIN_POSITIVE);
        Self {
            leading: Rotation2::new(to_left) * unit * left,
            other: Rotation2::new(to_left + between) * unit * right,
        }
    }

    /// Its mirror image.
    fn mirrored(self) -> Self {
        let [leading, other] = [self.leading, self.other].map(|way| Vector2::new(way.x, -way.y));
        Self { leading, other }
    }

    /// On a fork at `apex` with `stem` the way down its stem, px.
    fn ends_px(self, apex: Point2<f64>, stem: Vector2<f64>) -> [Point2<f64>; 2] {
        let clockwise = Vector2::new(-stem.y, stem.x);
        [self.leading, self.other].map(|way| apex + stem * way.x + clockwise * way.y)
    }
}

#[cfg(test)]
mod tests {
    use super::super::dirichlet::{Dirichlet, fit};
    use super::super::features::bifurcations;
    use super::super::fork_statistics::{ForkShapes, sampled};
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
            other_foot_px: None,
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
            let apex = tree[leaf].position_px;
            for end in BranchPair::of(&fork).ends_px(apex, below - apex) {
                leaves.push(tree.len());
                tree.push(new_node(Some(leaf), level, end));
            }
        }
        ForkStatistics::of_tree(&tree).expect("forks")
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
        let ends = BranchPair::of(&fork).ends_px(apex, below - apex);
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
        let ForkShapes {
            angles: of_angles,
            lengths: of_lengths,
        } = &example.alike;
        for (found, learned) in [(angles, of_angles), (lengths, of_lengths)] {
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
        let few = ForkStatistics::of_tree(&[new_node(None, 0, FOOT)]);
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

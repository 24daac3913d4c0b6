//! A tree is grown from the branches that a picture shows, by subtrees of a library on ever more of
//! its branches (Tan et al. 2008 sect. 3).
//!
//! Each round takes some branches, old ones more often, tries all subtrees on them in twelve
//! turns, and keeps the one that brings the attractors nearest: in the picture and in space in turns.
//! What would leave the tree in the picture, or its room in space, or come too near to a branch is
//! pruned before it counts.
//!
//! Subtrees are as long as what carries them, so that where no branch is seen they come nowhere near the leaves, as
//! in the upper half of a dense crown. So limbs that leaves hide, and that are thick there, go on first; and in the end
//! limbs lead to what is left, each from the branch that is nearest and runs that way. Neither is of the paper.

use super::attractors::Attractors;
use super::library::{Library, Subtree, frame, radius_share};
use crate::model::{Node, NodeId, NodeKind, NodeName, Outline, Skeleton};
use crate::random::Generator;
use nalgebra::{Point2, Point3, Rotation3, Unit, Vector3};
use rand::RngExt;
use std::f64::consts::TAU;

/// Rounds (Tan et al. 2008 sect. 3.1: about 100 times).
pub const ROUNDS: usize = 100;
/// Branches that are tried in a round, and turns about them (Tan et al. 2008 sect. 3.1).
const CANDIDATES: usize = 8;
const TURNS: u32 = 12;
/// Rounds without a gain after which the growth ends.
const IDLE_ROUNDS: usize = 12;
/// Least gain of a round for each new branch, by the distance between attractors in the picture.
const LEAST_GAIN: f64 = 2.0;
/// An attractor this many times as far from the tree as attractors are from one another gets a limb of its own
/// (docs/design/photo.md, "Limbs where no branch is seen").
const FAR_STEPS: f64 = 1.5;
/// Shares of a branch's length at which such a limb may leave it, as branches do along all but its lowest part; and how
/// many of these places are tried, the cheapest first: enough to try other branches than the nearest.
const LIMB_SHARES: [f64; 4] = [0.25, 0.5, 0.75, 1.0];
const LIMB_ORIGINS: usize = 24;
/// Depths that are tried for its end, by chance, and how steep it is out of the picture at most, degrees: 20 and 60 are
/// as good (ibid.).
const LIMB_DEPTHS: usize = 6;
const STEEPEST_DEG: f64 = 45.0;
/// A tip that is seen is thick if its radius is so many times that of the thinnest branch. It goes on for this share of
/// the way that there is, as leaves are farther out than wood, by so many steps of attractors at most (there are about
/// twenty across a crown), and tapers to this share of its radius.
const THICK_TIP: f64 = 3.0;
const EXTENDED: f64 = 0.8;
const MOST_EXTENDED: u32 = 20;
const EXTENDED_RADIUS: f64 = 0.3;
/// Nothing grows on a branch shorter than this share of the tree's height.
const SHORTEST: f64 = 0.02;
/// A new branch ends at least this share of its length away from all other branches.
const CLEAR: f64 = 0.2;
/// Places along a branch at which its distance from attractors is looked at, at least, and whether it is
/// inside. Along a long one they are as far apart as attractors; no branch has more.
const SAMPLES: u32 = 3;
const LOOKED_AT: u32 = 5;
const MOST_SAMPLES: u32 = 10_000;
/// A place nearer than this share of its branch's length to a joint is that joint.
const SAME_JOINT: f64 = 0.08;
/// Generations of branches on the trunk, at most.
const MOST_GENERATIONS: u32 = 8;

/// Where a tree may grow.
pub struct GrowthRegion<'a> {
    /// Where the tree is in the picture, its small gaps closed.
    pub tree: &'a Outline,
    /// Whether a branch may run from one place to another (model axes, px).
    pub room: &'a dyn Fn(&Point3<f64>, &Point3<f64>) -> bool,
    /// The attractors in space are used, too; without them the subtrees' tree is flat from the side (Tan et al.
    /// 2008 fig. 6). Limbs lead out of the picture in any case.
    pub in_space: bool,
    /// Radius of the thinnest branch, px.
    pub tip_px: f64,
}

/// What became of a growth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Growth {
    /// Of subtrees, and limbs.
    pub branches: usize,
    /// Of subtrees.
    pub rounds: usize,
    /// How far the attractors in the picture are from a branch in their mean, before and after, px.
    pub before_px: f64,
    pub after_px: f64,
}

/// Grows branches on those of `tree`, which has no copies. They are of the kind `grown`, and stand
/// after all others. There are so many `rounds` of subtrees at most, and then limbs; with 0 nothing grows.
pub fn grow_subtrees(
    tree: &mut Skeleton,
    library: &Library,
    region: &GrowthRegion,
    rounds: usize,
    random: &mut Generator,
) -> Growth {
    let mut engine = Engine::new(tree, library, region);
    let before_px = engine.in_picture.mean_px();
    if rounds == 0 {
        return Growth {
            before_px,
            after_px: before_px,
            ..Growth::default()
        };
    }
    engine.extend_thick_tips();
    let (mut idle, mut done) = (0, 0);
    while done < rounds && idle < IDLE_ROUNDS {
        let in_space = region.in_space && done % 2 == 1 && !engine.in_space.is_empty();
        let has_grown = engine.round(in_space, random);
        idle = if has_grown { 0 } else { idle + 1 };
        done += 1;
    }
    engine.lead_limbs(random);
    let growth = Growth {
        branches: engine.branches.iter().filter(|b| b.is_grown).count(),
        rounds: done,
        before_px,
        after_px: engine.in_picture.mean_px(),
    };
    *tree = engine.skeleton();
    growth
}

/// A joint of the tree while it grows.
#[derive(Clone, Debug)]
struct Joint {
    /// The joint below it; places in the list say nothing of the order.
    parent: Option<usize>,
    at: Point3<f64>,
    radius: f64,
    /// The branch that it is the end or a bend of.
    branch: usize,
    /// As it is in the tree from the picture; `None` where it is new.
    own: Option<Node>,
}

/// A branch: from the joint where it begins over its bends to its end.
#[derive(Clone, Debug)]
struct Branch {
    begin: usize,
    end: usize,
    generation: u32,
    is_grown: bool,
}

/// A branch that may be added.
#[derive(Clone, Copy, Debug)]
struct Shoot {
    /// The shoot that carries it; `None`: the supporting branch.
    on: Option<usize>,
    at: f64,
    from: Point3<f64>,
    to: Point3<f64>,
    radius_share: f64,
}

/// Shoots on a branch, and what they are worth.
struct Candidate {
    branch: usize,
    shoots: Vec<Shoot>,
    gain: f64,
}

/// A shoot on a branch of the tree.
struct Limb {
    branch: usize,
    shoot: Shoot,
}

/// A place on a branch from which a limb may leave.
#[derive(Clone, Copy, Debug)]
struct LimbOrigin {
    branch: usize,
    /// How far along the branch, 0 to 1.
    share: f64,
    at: Point3<f64>,
    /// How far it is, px, up to three times as much where the limb would lead back.
    cost: f64,
}

struct Engine<'a> {
    library: &'a Library,
    region: &'a GrowthRegion<'a>,
    foot_px: Point2<f64>,
    tree: &'a Skeleton,
    height_px: f64,
    joints: Vec<Joint>,
    branches: Vec<Branch>,
    /// Places along all branches.
    samples: Vec<Point3<f64>>,
    in_picture: Attractors,
    in_space: Attractors,
}

impl<'a> Engine<'a> {
    fn new(tree: &'a Skeleton, library: &'a Library, region: &'a GrowthRegion<'a>) -> Self {
        let mut engine = Self {
            library,
            region,
            foot_px: tree.foot_px,
            tree,
            height_px: tree.nodes.iter().map(|n| n.position.y).fold(1.0, f64::max),
            joints: Vec::with_capacity(tree.nodes.len()),
            branches: Vec::new(),
            samples: Vec::new(),
            in_picture: Attractors::in_picture(region.tree, tree.foot_px),
            in_space: Attractors::in_space(),
        };
        let mut branch_of = vec![0; tree.nodes.len()];
        for moving in tree.moving_branches() {
            let place = engine.branches.len();
            moving
                .parts()
                .for_each(|part| branch_of[part.index()] = place);
            let generation = tree.carriers(moving.node).count().max(1) as u32;
            engine.branches.push(Branch {
                begin: moving.begin.index(),
                end: moving.node.index(),
                generation,
                is_grown: false,
            });
        }
        for (i, node) in tree.nodes.iter().enumerate() {
            engine.joints.push(Joint {
                parent: node.parent.map(|p| p.index()),
                at: node.position,
                radius: node.radius,
                branch: branch_of[i],
                own: Some(node.clone()),
            });
        }
        let step_px = engine.in_picture.step_px;
        let mut samples = Vec::new();
        for joint in &engine.joints {
            if let Some(parent) = joint.parent {
                samples.extend(samples_between(
                    engine.joints[parent].at,
                    joint.at,
                    SAMPLES,
                    step_px,
                ));
            }
        }
        engine.take(samples);
        let joints: Vec<Point3<f64>> = engine.joints[1..].iter().map(|j| j.at).collect();
        joints
            .into_iter()
            .for_each(|at| engine.attract_quarter_turned(at));
        engine
    }

    /// Takes in samples of new branches.
    fn take(&mut self, samples: Vec<Point3<f64>>) {
        self.in_picture.take(&samples);
        self.in_space.take(&samples);
        self.samples.extend(samples);
    }

    /// Adds a joint, turned by 90 degrees about the middle of the tree at its height, to the attractors
    /// in space, if the tree may grow there. The paper turns it about the trunk; of a tree that is not
    /// the same to both sides that lies outside.
    fn attract_quarter_turned(&mut self, joint: Point3<f64>) {
        let middle = self.middle_x(joint.y);
        let turned = Point3::new(middle + joint.z, joint.y, -(joint.x - middle));
        if (self.region.room)(&turned, &turned) {
            self.in_space.add(turned, &self.samples);
        }
    }

    /// The middle of the tree in the picture at a height, model axes, px.
    fn middle_x(&self, y: f64) -> f64 {
        let tree = self.region.tree;
        let v = (self.foot_px.y - y)
            .round()
            .clamp(0.0, f64::from(tree.size.height - 1)) as u32;
        let first = (0..tree.size.width).find(|u| tree.has(*u, v));
        let last = (0..tree.size.width).rev().find(|u| tree.has(*u, v));
        match (first, last) {
            (Some(first), Some(last)) => 0.5 * f64::from(first + last) - self.foot_px.x,
            _ => 0.0,
        }
    }

    /// One replacement; `false` where none brings anything.
    fn round(&mut self, in_space: bool, random: &mut Generator) -> bool {
        let mut best: Option<Candidate> = None;
        for branch in self.chosen(random) {
            for subtree in self.library.subtrees() {
                for turn in 0..TURNS {
                    let shoots = self.pruned(branch, subtree, turn);
                    if shoots.is_empty() {
                        continue;
                    }
                    let samples = samples_of(&shoots, self.in_picture.step_px);
                    let gain = match in_space {
                        true => self.in_space.gain(&samples),
                        false => self.in_picture.gain(&samples),
                    };
                    if best.as_ref().is_none_or(|best| gain > best.gain) {
                        best = Some(Candidate {
                            branch,
                            shoots,
                            gain,
                        });
                    }
                }
            }
        }
        let least_px = LEAST_GAIN * self.in_picture.step_px;
        match best {
            Some(best) if best.gain > least_px * best.shoots.len() as f64 => {
                self.add(best.branch, &best.shoots);
                true
            }
            _ => false,
        }
    }

    /// Lets the limbs that are seen up to where leaves hide them, and are thick there, go on as they run.
    fn extend_thick_tips(&mut self) {
        for branch in 0..self.branches.len() {
            let end = self.branches[branch].end;
            let is_tip = !self.joints.iter().any(|joint| joint.parent == Some(end));
            if is_tip && self.joints[end].radius > THICK_TIP * self.region.tip_px {
                self.extend(branch);
            }
        }
    }

    /// Lets a branch go on as it runs, most of the way to where the tree ends in the picture or in space.
    fn extend(&mut self, branch: usize) {
        let from = self.joints[self.branches[branch].end].at;
        let Some(along) = self.vector(branch).try_normalize(1e-9) else {
            return;
        };
        let shoot = |length: f64| Shoot {
            on: None,
            at: 1.0,
            from,
            to: from + length * along,
            radius_share: EXTENDED_RADIUS,
        };
        let step_px = self.in_picture.step_px;
        let lengths = (1..=MOST_EXTENDED).map(|k| f64::from(k) * step_px);
        let free = lengths.take_while(|length| self.is_free(&shoot(*length), &[]));
        if let Some(length) = free.last().filter(|length| *length > 2.0 * step_px) {
            self.add(branch, &[shoot(EXTENDED * length)]);
        }
    }

    /// Leads limbs to the attractors in the picture that are far from the tree, the farthest first. Those that cannot
    /// be reached stay far.
    fn lead_limbs(&mut self, random: &mut Generator) {
        let far_px = FAR_STEPS * self.in_picture.step_px;
        for attractor in self.in_picture.beyond(far_px) {
            // An earlier limb may have come near.
            if self.in_picture.distance_px(attractor) <= far_px {
                continue;
            }
            let target = self.in_picture.place(attractor);
            if let Some(limb) = self.limb_to(target, random) {
                self.add(limb.branch, &[limb.shoot]);
            }
        }
    }

    /// A limb to a place in the picture (model axes, px), from a branch that is near and leads there.
    fn limb_to(&self, target: Point2<f64>, random: &mut Generator) -> Option<Limb> {
        let mut origins = self.limb_origins(target);
        origins.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        for origin in origins.into_iter().take(LIMB_ORIGINS) {
            let reach = (target - origin.at.xy()).norm();
            for _ in 0..LIMB_DEPTHS {
                let steep = random.random_range(-STEEPEST_DEG..STEEPEST_DEG);
                let depth = origin.at.z + reach * steep.to_radians().tan();
                let to = Point3::new(target.x, target.y, depth);
                let length = (to - origin.at).norm() / self.vector(origin.branch).norm();
                let shoot = Shoot {
                    on: None,
                    at: origin.share,
                    from: origin.at,
                    to,
                    radius_share: radius_share(length),
                };
                if self.is_free(&shoot, &[]) {
                    let branch = origin.branch;
                    return Some(Limb { branch, shoot });
                }
            }
        }
        None
    }

    /// Where a limb to a place in the picture may leave the tree.
    fn limb_origins(&self, target: Point2<f64>) -> Vec<LimbOrigin> {
        let mut origins = Vec::new();
        for branch in (0..self.branches.len()).filter(|b| self.may_bear(*b)) {
            let along = self.vector(branch).xy();
            for share in LIMB_SHARES {
                let Some(at) = self.along(branch, share) else {
                    continue;
                };
                let way = target - at.xy();
                let cosine = way.dot(&along) / (way.norm() * along.norm()).max(1e-9);
                let cost = way.norm() * (2.0 - cosine);
                origins.push(LimbOrigin {
                    branch,
                    share,
                    at,
                    cost,
                });
            }
        }
        origins
    }

    /// Branches that are tried, drawn with a probability of one by its generation (Efraimidis and Spirakis
    /// 2006). The paper goes through all from the thickest on, and the first eight that chance takes are
    /// nearly always low ones: the top stays empty.
    fn chosen(&self, random: &mut Generator) -> Vec<usize> {
        let mut drawn: Vec<(usize, f64)> = Vec::new();
        for (b, branch) in self.branches.iter().enumerate() {
            if self.may_bear(b) {
                let key = random.random_range(0.0_f64..1.0);
                drawn.push((b, key.powi(branch.generation.max(1) as i32)));
            }
        }
        drawn.sort_by(|(_, a), (_, b)| b.total_cmp(a));
        drawn.truncate(CANDIDATES);
        drawn.into_iter().map(|(b, _)| b).collect()
    }

    /// Whether anything may grow on a branch.
    fn may_bear(&self, branch: usize) -> bool {
        let is_long = self.vector(branch).norm() >= SHORTEST * self.height_px;
        is_long && self.branches[branch].generation < MOST_GENERATIONS
    }

    /// From where a branch begins to its end.
    fn vector(&self, branch: usize) -> Vector3<f64> {
        let Branch { begin, end, .. } = self.branches[branch];
        self.joints[end].at - self.joints[begin].at
    }

    /// The branches of a subtree on a branch that are neither outside nor too near to others.
    fn pruned(&self, branch: usize, subtree: &Subtree, turn: u32) -> Vec<Shoot> {
        let axis = self.vector(branch);
        let (Some(along), Some(frame)) = (Unit::try_new(axis, 1e-9), frame(axis)) else {
            return Vec::new();
        };
        let begin = self.joints[self.branches[branch].begin].at;
        let angle = TAU * f64::from(turn) / f64::from(TURNS);
        let place = Rotation3::from_axis_angle(&along, angle) * frame.inverse();
        let mut shoots: Vec<Shoot> = Vec::with_capacity(subtree.branches.len());
        let mut place_of: Vec<Option<usize>> = Vec::with_capacity(subtree.branches.len());
        for own in &subtree.branches {
            let on = own.on.map(|on| place_of[on]);
            let from = match on {
                None => self.along(branch, own.at).unwrap_or(begin + own.at * axis),
                Some(None) => {
                    place_of.push(None);
                    continue;
                }
                Some(Some(on)) => shoots[on].from + own.at * (shoots[on].to - shoots[on].from),
            };
            let shoot = Shoot {
                on: on.flatten(),
                at: own.at,
                from,
                to: from + place * own.way * axis.norm(),
                radius_share: own.radius_share,
            };
            if self.is_free(&shoot, &shoots) {
                place_of.push(Some(shoots.len()));
                shoots.push(shoot);
            } else {
                place_of.push(None);
            }
        }
        shoots
    }

    /// Whether a shoot is inside, and ends clear of all branches and of its neighbours.
    fn is_free(&self, shoot: &Shoot, others: &[Shoot]) -> bool {
        let way = shoot.to - shoot.from;
        let step_px = self.in_picture.step_px;
        let mut along = samples_between(shoot.from, shoot.to, LOOKED_AT, step_px);
        if shoot.to.y < 0.0 || !along.all(|at| self.appears_inside(&at)) {
            return false;
        }
        if !(self.region.room)(&shoot.from, &shoot.to) {
            return false;
        }
        let clear_sq = (CLEAR * way.norm()).powi(2);
        let is_near = |at: &Point3<f64>| (at - shoot.to).norm_squared() < clear_sq;
        !others.iter().any(|other| is_near(&other.to)) && !self.samples.iter().any(is_near)
    }

    fn appears_inside(&self, at: &Point3<f64>) -> bool {
        let [u, v] = [self.foot_px.x + at.x, self.foot_px.y - at.y];
        self.region.tree.contains(u, v)
    }

    /// The place at a share of a branch's length along its bends.
    fn along(&self, branch: usize, share: f64) -> Option<Point3<f64>> {
        let bends = self.bends(branch);
        let place = self.place_along(&bends, share)?;
        let [below, above] =
            [bends[place.piece], bends[place.piece + 1]].map(|j| self.joints[j].at);
        Some(below + place.share * (above - below))
    }

    /// The joints of a branch, from where it begins to its end.
    fn bends(&self, branch: usize) -> Vec<usize> {
        let Branch { begin, end, .. } = self.branches[branch];
        let mut bends = vec![end];
        let mut at = end;
        while at != begin
            && let Some(parent) = self.joints[at].parent
        {
            at = parent;
            bends.push(at);
        }
        bends.reverse();
        bends
    }

    fn place_along(&self, bends: &[usize], share: f64) -> Option<PlaceAlong> {
        let length = |pair: &[usize]| (self.joints[pair[1]].at - self.joints[pair[0]].at).norm();
        let whole: f64 = bends.windows(2).map(length).sum();
        let mut left = share.clamp(0.0, 1.0) * whole;
        for (piece, pair) in bends.windows(2).enumerate() {
            let own = length(pair);
            if left <= own || piece + 2 == bends.len() {
                return Some(PlaceAlong {
                    piece,
                    share: (left / own.max(1e-9)).clamp(0.0, 1.0),
                    same: SAME_JOINT * whole / own.max(1e-9),
                });
            }
            left -= own;
        }
        None
    }

    /// The joint at a share of a branch's length, a new one where none is near.
    fn joint_at(&mut self, branch: usize, share: f64) -> usize {
        let bends = self.bends(branch);
        let Some(place) = self.place_along(&bends, share) else {
            return self.branches[branch].end;
        };
        let (below, above) = (bends[place.piece], bends[place.piece + 1]);
        if place.share >= 1.0 - place.same {
            return above;
        }
        if place.share <= place.same && place.piece > 0 {
            return below;
        }
        let [from, to] = [&self.joints[below], &self.joints[above]];
        let new = Joint {
            parent: Some(below),
            at: from.at + place.share * (to.at - from.at),
            radius: from.radius + place.share * (to.radius - from.radius),
            branch: to.branch,
            own: None,
        };
        self.joints.push(new);
        let joint = self.joints.len() - 1;
        self.joints[above].parent = Some(joint);
        joint
    }

    /// Adds shoots on a branch.
    fn add(&mut self, branch: usize, shoots: &[Shoot]) {
        let generation = self.branches[branch].generation + 1;
        let mut branch_of: Vec<usize> = Vec::with_capacity(shoots.len());
        for shoot in shoots {
            let carrier = shoot.on.map_or(branch, |on| branch_of[on]);
            let begin = self.joint_at(carrier, shoot.at);
            let branch = self.branches.len();
            let radius = (shoot.radius_share * self.joints[begin].radius).max(self.region.tip_px);
            self.joints.push(Joint {
                parent: Some(begin),
                at: shoot.to,
                radius: radius.min(self.joints[begin].radius),
                branch,
                own: None,
            });
            self.branches.push(Branch {
                begin,
                end: self.joints.len() - 1,
                generation: generation + u32::from(shoot.on.is_some()),
                is_grown: true,
            });
            branch_of.push(branch);
        }
        self.take(samples_of(shoots, self.in_picture.step_px));
        for shoot in shoots {
            self.attract_quarter_turned(shoot.to);
        }
    }

    /// The tree: what is from the picture first, each joint after its parent.
    fn skeleton(&self) -> Skeleton {
        let mut order: Vec<usize> = Vec::with_capacity(self.joints.len());
        let mut place: Vec<Option<usize>> = vec![None; self.joints.len()];
        for is_grown in [false, true] {
            for joint in 0..self.joints.len() {
                if self
                    .branches
                    .get(self.joints[joint].branch)
                    .is_some_and(|b| b.is_grown)
                    != is_grown
                {
                    continue;
                }
                // What is not placed yet of the way down, the lowest first.
                let mut way = Vec::new();
                let mut at = Some(joint).filter(|j| place[*j].is_none());
                while let Some(next) = at {
                    way.push(next);
                    at = self.joints[next].parent.filter(|p| place[*p].is_none());
                }
                for next in way.into_iter().rev() {
                    place[next] = Some(order.len());
                    order.push(next);
                }
            }
        }
        let placed = |joint: usize| NodeId(place[joint].unwrap_or(0) as u32);
        let names = self.tree.nodes.iter().map(|n| n.name.0).max();
        let mut next_name = names.map_or(0, |n| n.saturating_add(1));
        let mut levels: Vec<u8> = vec![0; self.branches.len()];
        for (b, branch) in self.branches.iter().enumerate() {
            let of_end = self.joints[branch.end].own.as_ref().map(|own| own.level);
            let carrier = levels[self.joints[branch.begin].branch.min(b)];
            levels[b] = of_end.unwrap_or(carrier.saturating_add(1));
        }
        let mut nodes = Vec::with_capacity(order.len());
        for joint in order {
            let own = &self.joints[joint];
            let branch = self.branches.get(own.branch);
            let is_end = branch.is_none_or(|b| b.end == joint) || own.parent.is_none();
            let mover = branch.filter(|_| !is_end).map(|b| placed(b.end));
            let mut node = own.own.clone().unwrap_or_else(|| {
                next_name = next_name.saturating_add(1);
                Node {
                    name: NodeName(next_name - 1),
                    parent: None,
                    level: levels[own.branch],
                    position: own.at,
                    radius: own.radius,
                    n_tracks: 0,
                    kind: match branch.is_some_and(|b| b.is_grown) {
                        true => NodeKind::Grown,
                        false => NodeKind::Traced,
                    },
                    certainty: 0.0,
                    copy_of: None,
                    plane_angle: 0.0,
                    moves_with: None,
                }
            });
            node.parent = own.parent.map(placed);
            node.moves_with = mover;
            nodes.push(node);
        }
        Skeleton {
            nodes,
            ..self.tree.clone()
        }
    }
}

/// A place on a piece of a branch.
struct PlaceAlong {
    piece: usize,
    /// 0 at its lower joint, 1 at its upper one.
    share: f64,
    /// What is nearer to a joint than this share of the piece is that joint.
    same: f64,
}

/// Places behind one up to another, `least` of them, and `step_px` apart at most.
fn samples_between(
    from: Point3<f64>,
    to: Point3<f64>,
    least: u32,
    step_px: f64,
) -> impl Iterator<Item = Point3<f64>> {
    let steps = ((to - from).norm() / step_px).ceil() as u32;
    let count = steps.clamp(least, MOST_SAMPLES);
    (1..=count).map(move |k| from + f64::from(k) / f64::from(count) * (to - from))
}

fn samples_of(shoots: &[Shoot], step_px: f64) -> Vec<Point3<f64>> {
    let mut samples = Vec::new();
    for shoot in shoots {
        samples.extend(samples_between(shoot.from, shoot.to, SAMPLES, step_px));
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grow::SubtreeKind;
    use crate::model::Size;
    use crate::random::generator;

    /// A crown of 220 px about the fork of the tree; its foot is at (320, 300).
    fn crown() -> Outline {
        let size = Size::new(640, 360);
        let mut mask = vec![0; size.area()];
        for (i, m) in mask.iter_mut().enumerate() {
            let (u, v) = ((i % 640) as f64, (i / 640) as f64);
            *m = if (u - 320.0).hypot(v - 150.0) < 110.0 {
                255
            } else {
                0
            };
        }
        Outline {
            size,
            mask,
            polygon_px: Vec::new(),
            matte: None,
            other_foot_px: None,
        }
    }

    fn grown(in_space: bool, rounds: usize) -> (Skeleton, Growth) {
        let crown = crown();
        let room =
            |_: &Point3<f64>, to: &Point3<f64>| (to - Point3::new(0.0, 150.0, 0.0)).norm() < 112.0;
        let region = GrowthRegion {
            tree: &crown,
            room: &room,
            in_space,
            tip_px: 0.3,
        };
        let mut tree = Skeleton::forked();
        let library = Library::predefined(SubtreeKind::Both);
        let random = &mut generator(5, 0);
        let growth = grow_subtrees(&mut tree, &library, &region, rounds, random);
        (tree, growth)
    }

    fn depth(tree: &Skeleton) -> f64 {
        let squares = tree.nodes.iter().map(|n| n.position.z.powi(2));
        (squares.sum::<f64>() / tree.nodes.len() as f64).sqrt()
    }

    #[test]
    fn a_crown_is_filled_and_kept_to() {
        let (tree, growth) = grown(true, ROUNDS);
        assert!(growth.branches > 40, "{growth:?}");
        assert!(growth.after_px < 0.3 * growth.before_px, "{growth:?}");
        let mut names: Vec<u32> = tree.nodes.iter().map(|n| n.name.0).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), tree.nodes.len());
        let crown = crown();
        for (i, node) in tree.nodes.iter().enumerate().skip(1) {
            assert!(node.parent.is_some_and(|p| p.index() < i), "{node:?}");
            if node.kind == NodeKind::Grown {
                let at = tree.image_from_model(&node.position);
                assert!(crown.contains(at.x, at.y), "{at}");
            }
            assert!(tree.moving_parent(NodeId(i as u32)).is_some(), "{node:?}");
        }
        // What the picture shows stays where it is.
        for own in &Skeleton::forked().nodes {
            let kept = tree.nodes.iter().find(|n| n.name == own.name);
            let kept = kept.expect("it is there");
            assert_eq!((kept.position, kept.kind), (own.position, own.kind));
        }
        let branches = tree.moving_branches().len();
        assert_eq!(branches, growth.branches + 3);
    }

    /// Tan et al. 2008 fig. 6.
    #[test]
    fn attractors_in_space_make_the_tree_as_full_from_the_side() {
        let [flat, full] = [false, true].map(|in_space| depth(&grown(in_space, 40).0));
        assert!(full > 1.3 * flat, "{full} {flat}");
    }

    /// Nothing was seen of the right half: leaves there hung in the air.
    #[test]
    fn limbs_lead_to_where_no_branch_is_near() {
        let crown = crown();
        let region = GrowthRegion {
            tree: &crown,
            room: &|_: &Point3<f64>, _: &Point3<f64>| true,
            in_space: true,
            tip_px: 0.3,
        };
        let mut seen = Skeleton::forked();
        seen.nodes.truncate(3);
        let library = Library::predefined(SubtreeKind::Both);
        let n_far = |tree: &Skeleton| {
            let engine = Engine::new(tree, &library, &region);
            let far_px = FAR_STEPS * engine.in_picture.step_px;
            engine.in_picture.beyond(far_px).len()
        };
        let before = n_far(&seen);
        assert!(before > 100, "{before}");
        let mut by_subtrees = seen.clone();
        let mut engine = Engine::new(&by_subtrees, &library, &region);
        let random = &mut generator(5, 0);
        for round in 0..ROUNDS {
            engine.round(round % 2 == 1, random);
        }
        by_subtrees = engine.skeleton();
        let left = n_far(&by_subtrees);
        assert!(left > 0);
        let mut grown = seen.clone();
        grow_subtrees(&mut grown, &library, &region, ROUNDS, &mut generator(5, 0));
        assert_eq!(n_far(&grown), 0, "{left} by subtrees");
    }

    #[test]
    fn the_same_seed_grows_the_same_tree() {
        assert_eq!(grown(true, 20), grown(true, 20));
        let (tree, growth) = grown(true, 0);
        assert_eq!((tree, growth.branches), (Skeleton::forked(), 0));
    }
}

//! The Bayesian push: branches leave their planes to fill the envelope while their angles stay
//! likely (Li 2011 sect. 3, eq. 2-6).

use super::angles::{Angles, angle_between};
use super::envelope::Envelope;
use super::search::{Search, Swept};
use super::trunk::in_trunk;
use crate::config;
use crate::model::Skeleton;
use nalgebra::{Point3, Vector3};

/// The steepest branch to its plane, degrees: hardly any is seen from its end (docs/method.md).
const STEEPEST_DEG: f64 = 70.0;
/// How much farther a way counts that is seen in the picture.
const SEEN: f64 = 3.0;

/// Which terms of the posterior are used; the one-sided ones are the paper's figure 3 a and b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Terms {
    /// Local and global, eq. 2.
    Both {
        /// Power of eq. 6; the paper's is 1.
        weight: f64,
        /// A push that brings one attractor nearer by this share of the tree's width says next to
        /// nothing. It is added to every gain in eq. 6, which else is -inf in logarithms for a push
        /// without gain, and would bend a twig out of all likelihood for a hundredth of a pixel.
        /// The paper's is 0.
        gain_floor: f64,
        /// Of several traversals the first only spreads the tree, and the later ones mend its
        /// angles.
        spread_first: bool,
    },
    /// Only the branching angles, eq. 4.
    Local,
    /// Only the filling of the envelope, eq. 6.
    Global,
}

impl Terms {
    fn gain_floor(self) -> f64 {
        if let Terms::Both { gain_floor, .. } = self {
            gain_floor
        } else {
            0.0
        }
    }
}

/// Pushes every node above the trunk, with all that hangs on it, along the normal of its plane,
/// level by level from the root. Each push is the most probable of `settings.push_options` values
/// in [-delta, delta], with delta a share of the tree's width. No node is pushed out of the
/// envelope, and none for which `trunk` holds is pushed.
///
/// Where a depth camera has seen a node, that is a normal likelihood of its place, one more factor of
/// eq. 2, and the push that brings it there is one of the options, inside of the envelope or not.
///
/// The paper does this once. From the second traversal on (`settings.passes`) the rest of the tree
/// stands, so that the angles of the branches which leave from the node count as well, and a push
/// is measured in a tree without gaps that are filled later.
pub fn push(
    skeleton: &mut Skeleton,
    trunk: &[bool],
    envelope: &Envelope,
    settings: &config::Shape,
    terms: Terms,
) {
    let pushed = vec![0.0; skeleton.nodes.len()];
    let mut pusher = Pusher::new(skeleton, envelope, settings, pushed, None);
    for pass in 0..settings.passes.max(1) {
        pusher.weigh(terms, pass == 0 && settings.passes > 1);
        for i in pusher.order(trunk) {
            pusher.push_one(i, Moved::WithAllOnIt, pass > 0);
        }
    }
}

/// Where the nodes of a tree that goes on stood: a normal prior on how far each is from there along
/// the normal of its plane, a third factor of eq. 2. What moves in the picture, as copies do, is
/// seen; it is held three times as tightly.
#[derive(Clone, Copy, Debug)]
pub struct PositionPrior<'a> {
    /// Where each node stood, model axes, px; `None` for a new one, of which nothing was known.
    pub stood: &'a [Option<Point3<f64>>],
    /// Deviation in depth, px.
    pub sigma_px: f64,
}

/// A way in space squared, what of it is seen in the picture counted three times as long, px².
pub(super) fn squared_way(way: Vector3<f64>) -> f64 {
    (SEEN * way.xy()).norm_squared() + way.z * way.z
}

/// Pushes on from where `skeleton` stands, held by a prior on where its nodes stood: as [`push`]
/// with a tree that stands, and a fork may also move alone, with what leaves from it staying where
/// it is.
pub fn push_on(
    skeleton: &mut Skeleton,
    trunk: &[bool],
    envelope: &Envelope,
    settings: &config::Shape,
    terms: Terms,
    prior: PositionPrior,
) {
    let pushed = (0..skeleton.nodes.len())
        .map(|i| own_push(skeleton, i))
        .collect();
    let mut pusher = Pusher::new(skeleton, envelope, settings, pushed, Some(prior));
    for pass in 0..settings.passes.max(1) {
        pusher.weigh(terms, pass == 0 && settings.passes > 1);
        for i in pusher.order(trunk) {
            pusher.push_one(i, Moved::WithAllOnIt, true);
            pusher.push_one(i, Moved::Alone, true);
        }
    }
}

/// How far a node is out of the plane through its parent, px: the push of its own that has brought
/// it there.
fn own_push(skeleton: &Skeleton, i: usize) -> f64 {
    let node = &skeleton.nodes[i];
    let parent = node.parent.map_or(node, |p| &skeleton.nodes[p.index()]);
    (node.position - parent.position).dot(&plane_normal(node.plane_angle))
}

/// How far every node is out of its plane, px: the sum of its own push and those below it. The
/// trunk is in all planes.
pub(super) fn out_of_planes(skeleton: &Skeleton, trunk: &[bool]) -> Vec<f64> {
    let mut out = vec![0.0; skeleton.nodes.len()];
    for i in 0..skeleton.nodes.len() {
        if in_trunk(trunk, i) {
            continue;
        }
        let below = skeleton.nodes[i].parent.map_or(0.0, |p| out[p.index()]);
        out[i] = below + own_push(skeleton, i);
    }
    out
}

/// What a push takes along.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Moved {
    WithAllOnIt,
    Alone,
}

struct Pusher<'a> {
    skeleton: &'a mut Skeleton,
    envelope: &'a Envelope,
    settings: &'a config::Shape,
    terms: Terms,
    prior: Option<PositionPrior<'a>>,
    angles: Angles,
    search: Search,
    subtrees: Vec<Vec<usize>>,
    children: Vec<Vec<usize>>,
    /// How far each node has been pushed itself, px.
    pushed: Vec<f64>,
    delta: f64,
    gain_floor: f64,
}

/// A node that is to be pushed.
struct Step<'a> {
    node: usize,
    parent: usize,
    what: Moved,
    /// All nodes that move with it, itself included.
    moved: &'a [usize],
    /// Of its plane.
    normal: Vector3<f64>,
    /// How far it has been pushed so far, px.
    at: f64,
    /// Whether the angles of the branches that leave from it count.
    with_children: bool,
}

impl Step<'_> {
    /// By how much it moves if it is pushed `push` px in all.
    fn offset(&self, push: f64) -> Vector3<f64> {
        self.normal * (push - self.at)
    }
}

/// One push that was tried: its length, ln of eq. 4, of the prior and of what a depth camera has
/// seen, and E of eq. 6.
struct Candidate {
    push: f64,
    local: f64,
    prior: f64,
    seen: f64,
    gain: f64,
}

impl<'a> Pusher<'a> {
    fn new(
        skeleton: &'a mut Skeleton,
        envelope: &'a Envelope,
        settings: &'a config::Shape,
        pushed: Vec<f64>,
        prior: Option<PositionPrior<'a>>,
    ) -> Self {
        Self {
            search: Search::new(skeleton, &envelope.attractors(settings.attractors as usize)),
            angles: Angles::of(skeleton, settings),
            subtrees: subtrees(skeleton),
            children: children(skeleton),
            pushed,
            delta: settings.push_range * envelope.width(),
            gain_floor: 0.0,
            terms: Terms::Local,
            skeleton,
            envelope,
            settings,
            prior,
        }
    }

    /// Nodes that may be pushed, from the root up.
    fn order(&self, trunk: &[bool]) -> Vec<usize> {
        let nodes = &self.skeleton.nodes;
        let mut order: Vec<usize> = (0..nodes.len()).filter(|&i| !in_trunk(trunk, i)).collect();
        order.sort_by_key(|&i| (nodes[i].level, i));
        order
    }

    /// Takes the terms of one traversal.
    fn weigh(&mut self, terms: Terms, first_of_several: bool) {
        let spread = first_of_several
            && matches!(
                terms,
                Terms::Both {
                    spread_first: true,
                    ..
                }
            );
        self.terms = if spread { Terms::Global } else { terms };
        self.gain_floor = self.terms.gain_floor() * self.envelope.width();
    }

    /// Pushes node `i` to the most probable of the options. `with_children` says that the angles of
    /// the branches which leave from it count as well.
    fn push_one(&mut self, i: usize, what: Moved, with_children: bool) {
        let moved = match what {
            Moved::WithAllOnIt => self.subtrees[i].clone(),
            Moved::Alone if self.children[i].is_empty() => return,
            Moved::Alone => vec![i],
        };
        let Some(parent) = self.skeleton.nodes[i].parent.map(|p| p.index()) else {
            return;
        };
        let normal = plane_normal(self.skeleton.nodes[i].plane_angle);
        let at = self.pushed[i];
        let step = Step {
            node: i,
            parent,
            what,
            moved: &moved,
            normal,
            at,
            with_children,
        };
        let pushes = self.possible_pushes(&step);
        let swept = self.sweep(&step, &pushes);
        let candidates = self.candidates(&step, &swept, &pushes);
        let Some(best) = most_probable(&candidates, self.terms, self.gain_floor) else {
            return;
        };
        let way = normal * (best - at);
        for &k in &moved {
            self.skeleton.nodes[k].position += way;
        }
        self.pushed[i] = best;
        if what == Moved::Alone {
            for &k in &self.children[i] {
                self.pushed[k] -= best - at;
            }
        }
        self.search.put_back(swept, self.skeleton, &moved);
    }

    /// The pushes that are possible, and with a prior the one that leaves all where it is, px.
    fn possible_pushes(&self, step: &Step) -> Vec<f64> {
        let n = self.settings.push_options;
        let mut pushes: Vec<f64> = (0..n).map(|l| self.delta * option(l, n)).collect();
        if self.prior.is_some() {
            pushes.push(step.at);
        }
        pushes.retain(|push| *push == step.at || self.is_possible(step, *push));
        pushes.extend(self.push_to_seen(step));
        pushes
    }

    /// The push that brings the node to where a depth camera has seen it, px. Measured nodes are in the
    /// plane of the picture, whose normal is the line of sight.
    fn push_to_seen(&self, step: &Step) -> Option<f64> {
        let seen = self.envelope.seen(step.node)?;
        Some(step.at + seen.z_px - self.skeleton.nodes[step.node].position.z)
    }

    /// ln of how likely the node is where a depth camera has seen it, if it is moved by `offset`.
    fn ln_seen(&self, step: &Step, offset: Vector3<f64>) -> f64 {
        self.envelope.seen(step.node).map_or(0.0, |seen| {
            let z_px = self.skeleton.nodes[step.node].position.z + offset.z;
            -0.5 * ((z_px - seen.z_px) / seen.sd_px).powi(2)
        })
    }

    /// The tree without what is moved, and what that may come near to on its way.
    fn sweep(&self, step: &Step, pushes: &[f64]) -> Swept {
        let ways = pushes.iter().map(|push| push - step.at);
        let to_rest = -step.at;
        let least = ways.clone().fold(to_rest, f64::min);
        let most = ways.fold(to_rest, f64::max);
        self.search.sweep(step.moved, &step.normal, least, most)
    }

    fn candidates(&self, step: &Step, swept: &Swept, pushes: &[f64]) -> Vec<Candidate> {
        let before = swept.total_distance(step.offset(0.0));
        let mut candidates = Vec::with_capacity(pushes.len());
        for &push in pushes {
            let offset = step.offset(push);
            let distance = swept.total_distance(offset);
            candidates.push(Candidate {
                push,
                local: self.ln_likelihood(step, offset),
                prior: self.ln_prior(step.moved, offset),
                seen: self.ln_seen(step, offset),
                gain: (before - distance).max(0.0),
            });
        }
        candidates
    }

    /// Outside of the envelope the probability is 0, for the pushes that it leaves to the children
    /// beyond delta as well, unless they get smaller, and for a branch that is steeper to its plane
    /// than [`STEEPEST_DEG`].
    fn is_possible(&self, step: &Step, push: f64) -> bool {
        let nodes = &self.skeleton.nodes;
        let way = nodes[step.node].position - nodes[step.parent].position;
        let in_plane = way - step.normal * way.dot(&step.normal);
        if push.abs() > STEEPEST_DEG.to_radians().tan() * in_plane.norm() {
            return false;
        }
        let offset = step.offset(push);
        for &k in step.moved {
            let position = self.skeleton.nodes[k].position + offset;
            if !self.envelope.contains(&position) {
                return false;
            }
        }
        if step.moved.len() == self.subtrees[step.node].len() {
            return true;
        }
        self.children[step.node].iter().all(|&k| {
            let before = self.pushed[k].abs();
            let after = (self.pushed[k] - (push - step.at)).abs();
            after <= self.delta.max(before)
        })
    }

    /// ln of the prior on where the nodes `moved` by `offset` stood; 0 without a prior.
    fn ln_prior(&self, moved: &[usize], offset: Vector3<f64>) -> f64 {
        let Some(PositionPrior { stood, sigma_px }) = self.prior else {
            return 0.0;
        };
        let mut sum = 0.0;
        for &k in moved {
            let Some(stood) = stood.get(k).copied().flatten() else {
                continue;
            };
            let node = &self.skeleton.nodes[k];
            let normal = plane_normal(node.plane_angle);
            let off = normal * (node.position + offset - stood).dot(&normal);
            sum -= squared_way(off) / (2.0 * sigma_px * sigma_px);
        }
        sum
    }

    /// ln of eq. 4 for the node of `step` moved by `offset`, and for the branches that it carries.
    fn ln_likelihood(&self, step: &Step, offset: Vector3<f64>) -> f64 {
        let nodes = &self.skeleton.nodes;
        let from = nodes[step.parent].position;
        let at = nodes[step.node].position + offset;
        let own = nodes[step.parent].parent.map_or(0.0, |grand| {
            let angle = angle_between(&nodes[grand.index()].position, &from, &at);
            self.angles.ln_likelihood(nodes[step.node].level, angle)
        });
        if !step.with_children {
            return own;
        }
        let carried: f64 = self.children[step.node]
            .iter()
            .map(|&k| self.ln_likelihood_carried(step, k, at, offset))
            .sum();
        own + carried
    }

    /// ln of eq. 4 for branch `k`, which leaves from the node of `step` while that is at `at`, and
    /// for those beyond where it turns against them.
    fn ln_likelihood_carried(
        &self,
        step: &Step,
        k: usize,
        at: Point3<f64>,
        offset: Vector3<f64>,
    ) -> f64 {
        let nodes = &self.skeleton.nodes;
        let from = nodes[step.parent].position;
        let (end, beyond) = match step.what {
            Moved::WithAllOnIt => (nodes[k].position + offset, &[][..]),
            Moved::Alone => (nodes[k].position, &self.children[k][..]),
        };
        let own = self
            .angles
            .ln_likelihood(nodes[k].level, angle_between(&from, &at, &end));
        let beyond: f64 = beyond
            .iter()
            .map(|&m| {
                let angle = angle_between(&at, &end, &nodes[m].position);
                self.angles.ln_likelihood(nodes[m].level, angle)
            })
            .sum();
        own + beyond
    }
}

/// The push with the highest posterior; of equals the smallest, so that nothing moves for nothing.
fn most_probable(options: &[Candidate], terms: Terms, gain_floor: f64) -> Option<f64> {
    let posterior = Posterior::over(options, terms, gain_floor);
    let mut best: Option<(f64, f64)> = None;
    for option in options {
        let (ln, push) = (posterior.ln(option), option.push);
        let is_better = best.is_none_or(|(best_ln, best_push)| {
            ln.total_cmp(&best_ln)
                .then(best_push.abs().total_cmp(&push.abs()))
                .is_ge()
        });
        if is_better {
            best = Some((ln, push));
        }
    }
    best.map(|(_, push)| push)
}

/// Eq. 2 over all options of a push.
struct Posterior {
    terms: Terms,
    /// Power of eq. 6.
    weight: f64,
    gain_floor: f64,
    /// Sum of all gains with their floors; `None` where no option brings the tree nearer to the
    /// envelope: eq. 6 is 0 for all of them then, and says nothing.
    all_gains: Option<f64>,
}

impl Posterior {
    fn over(options: &[Candidate], terms: Terms, gain_floor: f64) -> Self {
        let sum: f64 = options.iter().map(|c| c.gain).sum();
        let speaks = sum > 0.0 && terms != Terms::Local;
        Self {
            terms,
            weight: match terms {
                Terms::Both { weight, .. } => weight,
                Terms::Local | Terms::Global => 1.0,
            },
            gain_floor,
            all_gains: speaks.then_some(sum + gain_floor * options.len() as f64),
        }
    }

    /// ln of the posterior, but for a constant.
    fn ln(&self, option: &Candidate) -> f64 {
        let global = match self.all_gains {
            Some(all) => self.weight * ((option.gain + self.gain_floor) / all).ln(),
            None => 0.0,
        };
        let local = match self.terms {
            Terms::Global => 0.0,
            Terms::Local | Terms::Both { .. } => option.local,
        };
        global + option.prior + option.seen + local
    }
}

/// Option `l` of `n` values spread evenly over [-1, 1]; an odd `n` holds 0.
fn option(l: u32, n: u32) -> f64 {
    if n < 2 {
        0.0
    } else {
        2.0 * f64::from(l) / f64::from(n - 1) - 1.0
    }
}

/// Normal of the plane that is turned by `angle` about the y axis.
pub(super) fn plane_normal(angle: f64) -> Vector3<f64> {
    Vector3::new(angle.sin(), 0.0, angle.cos())
}

/// D of eq. 5: sum over the attractors of the distance to the nearest node, px.
pub fn envelope_distance(skeleton: &Skeleton, envelope: &Envelope, attractors: usize) -> f64 {
    let attractors = envelope.attractors(attractors);
    attractors.iter().map(|a| nearest_node(skeleton, a)).sum()
}

/// Distance from `place` to the nearest node, px.
fn nearest_node(skeleton: &Skeleton, place: &Point3<f64>) -> f64 {
    skeleton
        .nodes
        .iter()
        .map(|n| (place - n.position).norm())
        .fold(f64::INFINITY, f64::min)
}

fn children(skeleton: &Skeleton) -> Vec<Vec<usize>> {
    skeleton
        .children()
        .iter()
        .map(|of| of.iter().map(|c| c.index()).collect())
        .collect()
}

/// Every node's own index and those of all its descendants.
pub(super) fn subtrees(skeleton: &Skeleton) -> Vec<Vec<usize>> {
    let n = skeleton.nodes.len();
    let mut out: Vec<Vec<usize>> = (0..n).map(|i| vec![i]).collect();
    for i in (1..n).rev() {
        if let Some(p) = skeleton.nodes[i].parent {
            let below = out[i].clone();
            out[p.index()].extend(below);
        }
    }
    out
}

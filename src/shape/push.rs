//! The Bayesian push: branches leave their planes to fill the envelope while their angles stay
//! likely (Li et al. section 3, eq. 2-6).

use super::angles::{Angles, angle_between};
use super::envelope::Envelope;
use super::search::Search;
use crate::config;
use crate::model::Skeleton;
use nalgebra::{Point3, Vector3};

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
        no_gain: f64,
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
    fn no_gain(self) -> f64 {
        if let Terms::Both { no_gain, .. } = self {
            no_gain
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
pub struct Tether<'a> {
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
    tether: Tether,
) {
    let pushed = (0..skeleton.nodes.len())
        .map(|i| own_push(skeleton, i))
        .collect();
    let mut pusher = Pusher::new(skeleton, envelope, settings, pushed, Some(tether));
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
    let is_trunk = |i: usize| trunk.get(i).is_some_and(|t| *t);
    let mut out = vec![0.0; skeleton.nodes.len()];
    for i in (0..skeleton.nodes.len()).filter(|&i| !is_trunk(i)) {
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
    tether: Option<Tether<'a>>,
    angles: Angles,
    search: Search,
    subtrees: Vec<Vec<usize>>,
    children: Vec<Vec<usize>>,
    /// How far each node has been pushed itself, px.
    pushed: Vec<f64>,
    delta: f64,
    no_gain: f64,
}

/// One push that was tried: its length, ln of eq. 4 and of the prior, and E of eq. 6.
struct Candidate {
    push: f64,
    local: f64,
    prior: f64,
    gain: f64,
}

impl<'a> Pusher<'a> {
    fn new(
        skeleton: &'a mut Skeleton,
        envelope: &'a Envelope,
        settings: &'a config::Shape,
        pushed: Vec<f64>,
        tether: Option<Tether<'a>>,
    ) -> Self {
        Self {
            search: Search::new(skeleton, &envelope.attractors(settings.attractors as usize)),
            angles: Angles::of(skeleton, settings),
            subtrees: subtrees(skeleton),
            children: children(skeleton),
            pushed,
            delta: settings.push_range * envelope.width(),
            no_gain: 0.0,
            terms: Terms::Local,
            skeleton,
            envelope,
            settings,
            tether,
        }
    }

    /// Nodes that may be pushed, from the root up.
    fn order(&self, trunk: &[bool]) -> Vec<usize> {
        let nodes = &self.skeleton.nodes;
        let mut order: Vec<usize> = (0..nodes.len())
            .filter(|&i| !trunk.get(i).is_some_and(|t| *t))
            .collect();
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
        self.no_gain = self.terms.no_gain() * self.envelope.width();
    }

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
        let without = self.search.distances_without(&moved);
        let at = self.pushed[i];
        let distance = |push: f64| {
            self.search
                .total_distance(&without, &moved, normal * (push - at))
        };
        let before = distance(0.0);
        let n = self.settings.push_options;
        let stays = self.tether.map(|_| at);
        let options = (0..n).map(|l| self.delta * option(l, n)).chain(stays);
        let candidates: Vec<Candidate> = options
            .filter(|&push| push == at || self.may_go(i, &moved, normal, push - at))
            .map(|push| Candidate {
                push,
                local: self.local(i, parent, normal * (push - at), what, with_children),
                prior: self.prior(&moved, normal * (push - at)),
                gain: (before - distance(push)).max(0.0),
            })
            .collect();
        let Some(best) = most_probable(&candidates, self.terms, self.no_gain) else {
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
        self.search.moved(self.skeleton, &moved);
    }

    /// Outside of the envelope the probability is 0, and for the pushes that it leaves to the
    /// children beyond delta as well, unless they get smaller.
    fn may_go(&self, i: usize, moved: &[usize], normal: Vector3<f64>, way: f64) -> bool {
        let inside = |&k: &usize| {
            self.envelope
                .contains(&(self.skeleton.nodes[k].position + normal * way))
        };
        let left = |&k: &usize| {
            let (before, after) = (self.pushed[k].abs(), (self.pushed[k] - way).abs());
            after <= self.delta.max(before)
        };
        moved.iter().all(inside)
            && (moved.len() == self.subtrees[i].len() || self.children[i].iter().all(left))
    }

    /// ln of the prior on where the nodes `moved` by `offset` stood.
    fn prior(&self, moved: &[usize], offset: Vector3<f64>) -> f64 {
        let Some(Tether { stood, sigma_px }) = self.tether else {
            return 0.0;
        };
        let one = |&k: &usize| {
            let node = &self.skeleton.nodes[k];
            let stood = stood.get(k).copied().flatten()?;
            let normal = plane_normal(node.plane_angle);
            let off = normal * (node.position + offset - stood).dot(&normal);
            Some(-squared_way(off) / (2.0 * sigma_px * sigma_px))
        };
        moved.iter().filter_map(one).sum()
    }

    /// ln of eq. 4 for node `i` moved by `offset`, and for the branches that it carries.
    fn local(
        &self,
        i: usize,
        parent: usize,
        offset: Vector3<f64>,
        what: Moved,
        with_children: bool,
    ) -> f64 {
        let nodes = &self.skeleton.nodes;
        let (from, at): (Point3<f64>, Point3<f64>) =
            (nodes[parent].position, nodes[i].position + offset);
        let own = nodes[parent].parent.map_or(0.0, |grand| {
            let angle = angle_between(&nodes[grand.index()].position, &from, &at);
            self.angles.ln_likelihood(nodes[i].level, angle)
        });
        let carried = |&k: &usize| {
            let (end, beyond) = match what {
                Moved::WithAllOnIt => (nodes[k].position + offset, &[][..]),
                Moved::Alone => (nodes[k].position, &self.children[k][..]),
            };
            let on = |&m: &usize| {
                let angle = angle_between(&at, &end, &nodes[m].position);
                self.angles.ln_likelihood(nodes[m].level, angle)
            };
            self.angles
                .ln_likelihood(nodes[k].level, angle_between(&from, &at, &end))
                + beyond.iter().map(on).sum::<f64>()
        };
        own + if with_children {
            self.children[i].iter().map(carried).sum()
        } else {
            0.0
        }
    }
}

/// The push with the highest posterior; of equals the smallest, so that nothing moves for nothing.
fn most_probable(options: &[Candidate], terms: Terms, no_gain: f64) -> Option<f64> {
    let sum: f64 = options.iter().map(|c| c.gain).sum();
    // Eq. 6 is 0 for every option where none brings the tree nearer to the envelope: it then says
    // nothing.
    let global_speaks = sum > 0.0 && terms != Terms::Local;
    let all = sum + no_gain * options.len() as f64;
    let weight = if let Terms::Both { weight, .. } = terms {
        weight
    } else {
        1.0
    };
    let score = |c: &Candidate| {
        let global = if global_speaks {
            weight * ((c.gain + no_gain) / all).ln()
        } else {
            0.0
        };
        global + c.prior + if terms == Terms::Global { 0.0 } else { c.local }
    };
    let better = |a: &&Candidate, b: &&Candidate| {
        score(a)
            .total_cmp(&score(b))
            .then(b.push.abs().total_cmp(&a.push.abs()))
    };
    options.iter().max_by(better).map(|c| c.push)
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
    let nearest = |w: &Point3<f64>| {
        skeleton
            .nodes
            .iter()
            .map(|n| (w - n.position).norm())
            .fold(f64::INFINITY, f64::min)
    };
    attractors.iter().map(nearest).sum()
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

//! The Bayesian push: branches leave their planes to fill the envelope while their angles stay likely
//! (Li et al. section 3, eq. 2-6).

use super::angles::{Angles, angle_between};
use super::envelope::Envelope;
use super::search::Search;
use crate::config;
use crate::model::Skeleton;
use nalgebra::{Point3, Vector3};

/// Which terms of the posterior are used; the one-sided ones are the paper's figure 3 a and b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Terms {
    /// Local and global, eq. 2.
    Both {
        /// Power of eq. 6; the paper's is 1.
        weight: f64,
        /// A push that brings one attractor nearer by this share of the tree's width says next to nothing. It is added
        /// to every gain in eq. 6, which else is -inf in logarithms for a push without gain, and would bend a twig out of
        /// all likelihood for a hundredth of a pixel. The paper's is 0.
        no_gain: f64,
        /// Of several traversals the first only spreads the tree, and the later ones mend its angles.
        spread_first: bool,
    },
    /// Only the branching angles, eq. 4.
    Local,
    /// Only the filling of the envelope, eq. 6.
    Global,
}

impl Terms {
    fn no_gain(self) -> f64 {
        if let Terms::Both { no_gain, .. } = self { no_gain } else { 0.0 }
    }
}

/// Pushes every node above the trunk, with all that hangs on it, along the normal of its plane, level by level from
/// the root. Each push is the most probable of `settings.push_options` values in [-delta, delta], with delta a share
/// of the tree's width. No node is pushed out of the envelope, and none for which `trunk` holds is pushed.
///
/// The paper does this once. From the second traversal on (`settings.passes`) the rest of the tree stands, so that the
/// angles of the branches which leave from the node count as well, and a push is measured in a tree without gaps that
/// are filled later.
pub fn push(skeleton: &mut Skeleton, trunk: &[bool], envelope: &Envelope, settings: &config::Shape, terms: Terms) {
    let angles = Angles::of(skeleton, settings);
    let mut order: Vec<usize> = (0..skeleton.nodes.len()).filter(|&i| !trunk.get(i).is_some_and(|t| *t)).collect();
    order.sort_by_key(|&i| (skeleton.nodes[i].level, i));
    let search = Search::new(skeleton, &envelope.attractors(settings.attractors as usize));
    let mut pusher = Pusher {
        subtrees: subtrees(skeleton),
        children: children(skeleton),
        pushed: vec![0.0; skeleton.nodes.len()],
        delta: settings.push_range * envelope.width(),
        no_gain: 0.0,
        skeleton,
        envelope,
        settings,
        terms,
        angles,
        search,
    };
    for pass in 0..settings.passes.max(1) {
        let spread = pass == 0 && settings.passes > 1 && matches!(terms, Terms::Both { spread_first: true, .. });
        pusher.terms = if spread { Terms::Global } else { terms };
        pusher.no_gain = pusher.terms.no_gain() * envelope.width();
        for &i in &order {
            pusher.push_one(i, pass > 0);
        }
    }
}

struct Pusher<'a> {
    skeleton: &'a mut Skeleton,
    envelope: &'a Envelope,
    settings: &'a config::Shape,
    terms: Terms,
    angles: Angles,
    search: Search,
    subtrees: Vec<Vec<usize>>,
    children: Vec<Vec<usize>>,
    /// How far each node has been pushed itself, px.
    pushed: Vec<f64>,
    delta: f64,
    no_gain: f64,
}

/// One push that was tried: its length, ln of eq. 4, and E of eq. 6.
struct Candidate {
    push: f64,
    local: f64,
    gain: f64,
}

impl Pusher<'_> {
    fn push_one(&mut self, i: usize, with_children: bool) {
        let subtree = &self.subtrees[i];
        let Some(parent) = self.skeleton.nodes[i].parent.map(|p| p.index()) else { return };
        let normal = plane_normal(self.skeleton.nodes[i].plane_angle);
        let without = self.search.distances_without(subtree);
        let at = self.pushed[i];
        let distance = |push: f64| self.search.total_distance(&without, subtree, normal * (push - at));
        let before = distance(0.0);
        let options = (0..self.settings.push_options).map(|l| self.delta * option(l, self.settings.push_options));
        let candidates: Vec<Candidate> = options
            .filter(|&push| push == at || self.stays_inside(subtree, normal * (push - at)))
            .map(|push| Candidate {
                push,
                local: self.local(i, parent, normal * (push - at), with_children),
                gain: (before - distance(push)).max(0.0),
            })
            .collect();
        let Some(best) = most_probable(&candidates, self.terms, self.no_gain) else { return };
        let way = normal * (best - at);
        for &k in subtree {
            self.skeleton.nodes[k].position += way;
        }
        self.pushed[i] = best;
        self.search.moved(self.skeleton, subtree);
    }

    /// Outside of the envelope the probability is 0.
    fn stays_inside(&self, subtree: &[usize], offset: Vector3<f64>) -> bool {
        subtree.iter().all(|&k| self.envelope.contains(&(self.skeleton.nodes[k].position + offset)))
    }

    /// ln of eq. 4 for node `i` moved by `offset`, and for the branches that it carries.
    fn local(&self, i: usize, parent: usize, offset: Vector3<f64>, with_children: bool) -> f64 {
        let nodes = &self.skeleton.nodes;
        let (from, at): (Point3<f64>, Point3<f64>) = (nodes[parent].position, nodes[i].position + offset);
        let own = nodes[parent].parent.map_or(0.0, |grand| {
            let angle = angle_between(&nodes[grand.index()].position, &from, &at);
            self.angles.ln_likelihood(nodes[i].level, angle)
        });
        let carried = |&k: &usize| {
            let angle = angle_between(&from, &at, &(nodes[k].position + offset));
            self.angles.ln_likelihood(nodes[k].level, angle)
        };
        own + if with_children { self.children[i].iter().map(carried).sum() } else { 0.0 }
    }
}

/// The push with the highest posterior; of equals the smallest, so that nothing moves for nothing.
fn most_probable(options: &[Candidate], terms: Terms, no_gain: f64) -> Option<f64> {
    let sum: f64 = options.iter().map(|c| c.gain).sum();
    // Eq. 6 is 0 for every option where none brings the tree nearer to the envelope: it then says nothing.
    let global_speaks = sum > 0.0 && terms != Terms::Local;
    let all = sum + no_gain * options.len() as f64;
    let weight = if let Terms::Both { weight, .. } = terms { weight } else { 1.0 };
    let score = |c: &Candidate| {
        let global = if global_speaks { weight * ((c.gain + no_gain) / all).ln() } else { 0.0 };
        global + if terms == Terms::Global { 0.0 } else { c.local }
    };
    let better =
        |a: &&Candidate, b: &&Candidate| score(a).total_cmp(&score(b)).then(b.push.abs().total_cmp(&a.push.abs()));
    options.iter().max_by(better).map(|c| c.push)
}

/// Option `l` of `n` values spread evenly over [-1, 1]; an odd `n` holds 0.
fn option(l: u32, n: u32) -> f64 {
    if n < 2 { 0.0 } else { 2.0 * f64::from(l) / f64::from(n - 1) - 1.0 }
}

/// Normal of the plane that is turned by `angle` about the y axis.
fn plane_normal(angle: f64) -> Vector3<f64> {
    Vector3::new(angle.sin(), 0.0, angle.cos())
}

/// D of eq. 5: sum over the attractors of the distance to the nearest node, px.
pub fn envelope_distance(skeleton: &Skeleton, envelope: &Envelope, attractors: usize) -> f64 {
    let attractors = envelope.attractors(attractors);
    let nearest =
        |w: &Point3<f64>| skeleton.nodes.iter().map(|n| (w - n.position).norm()).fold(f64::INFINITY, f64::min);
    attractors.iter().map(nearest).sum()
}

fn children(skeleton: &Skeleton) -> Vec<Vec<usize>> {
    skeleton.children().iter().map(|of| of.iter().map(|c| c.index()).collect()).collect()
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

//! Smaller copies of the tree's own subtrees where a shape is bare: growth by self-similarity.

use super::cover::Cover;
use crate::bounds::Bounds;
use crate::config;
use crate::model::{Node, NodeId, NodeName, Outline, Skeleton};
use crate::random::{Generator, generator};
use crate::shape::angles::{Angles, angle_between};
use crate::shape::envelope::Envelope;
use crate::shape::push::subtrees;
use nalgebra::{Point2, Point3, Rotation3, Unit, Vector3};
use rand::RngExt;
use std::f64::consts::PI;

/// So much of the shape is to be covered.
const WANTED: f64 = 0.92;
/// Most branches that are added: a joint each in the model.
const MOST: usize = 1200;
/// Nodes from which a bare place may be reached, the nearest ones, and subtrees that are tried from
/// each.
const REACHED_FROM: usize = 8;
const TRIED: usize = 5;
/// Branches of a subtree that is repeated, at most.
const LARGEST: usize = 12;
/// A copy is at most so much larger than its original, and at least so large.
const SCALE: Bounds = Bounds::new(0.15, 1.25);
/// How far in front or behind the copies end, as a share of the depth that the shape has there.
const DEPTH: f64 = 0.85;

/// A drawn shape: as it is seen in the picture, and the space that it bounds.
pub struct DrawnSpace<'a> {
    pub shape: &'a Outline,
    pub envelope: &'a Envelope,
}

/// A copy of a subtree that would grow from a node.
struct Shoot {
    /// Their ids follow those of the tree.
    nodes: Vec<Node>,
    score: f64,
}

/// Adds copies until the shape is covered or nothing more can be reached. They get names above
/// `last`, which is the highest that any node of the tree had.
pub fn grow(
    skeleton: &mut Skeleton,
    space: &DrawnSpace,
    last: u32,
    settings: &config::Shape,
    seed: u64,
) {
    let measured = skeleton.measured();
    if measured < 2 {
        return;
    }
    let angles = Angles::of(skeleton, settings);
    let templates = templates(skeleton, measured);
    let mut cover = Cover::of(space.shape);
    for node in &skeleton.nodes[1..] {
        cover.add(branch_in_picture(skeleton, node));
    }
    let mut random = generator(seed, 0);
    let first = skeleton.nodes.len();
    let mut last = last;
    let mut given_up = Vec::new();
    for _ in 0..2 * MOST {
        if cover.share() >= WANTED || skeleton.nodes.len() - first >= MOST {
            break;
        }
        let Some(bare_px) = cover.barest(&given_up) else {
            break;
        };
        let site = Site {
            skeleton,
            envelope: space.envelope,
            angles: &angles,
            cover: &cover,
        };
        let shoot = site.best_shoot(&templates, bare_px, &mut random);
        let before = cover.share();
        for mut node in shoot.into_iter().flat_map(|s| s.nodes) {
            // Names are used up: none is given twice.
            let Some(next) = last.checked_add(1) else {
                return;
            };
            last = next;
            node.name = NodeName(last);
            cover.add(branch_in_picture(skeleton, &node));
            skeleton.nodes.push(node);
        }
        if cover.share() <= before {
            cover.give_up(bare_px, &mut given_up);
        }
    }
}

/// The subtrees that may be repeated: their measured nodes, parents first.
fn templates(skeleton: &Skeleton, measured: usize) -> Vec<Vec<usize>> {
    let mut templates = Vec::new();
    for (root, subtree) in subtrees(skeleton).iter().enumerate().take(measured) {
        let mut nodes: Vec<usize> = subtree.iter().copied().filter(|&k| k < measured).collect();
        if skeleton.nodes[root].level >= 2 && nodes.len() <= LARGEST {
            nodes.sort_unstable();
            templates.push(nodes);
        }
    }
    templates
}

/// Both ends of the branch that ends in `node`, px.
fn branch_in_picture(skeleton: &Skeleton, node: &Node) -> [Point2<f64>; 2] {
    let parent = node
        .parent
        .map_or(node.position, |p| skeleton.nodes[p.index()].position);
    [parent, node.position].map(|p| skeleton.image_from_model(&p))
}

/// The tree as it stands, and what a new branch is judged by.
struct Site<'a> {
    skeleton: &'a Skeleton,
    envelope: &'a Envelope,
    angles: &'a Angles,
    cover: &'a Cover,
}

impl Site<'_> {
    /// Of the shoots that are tried towards a bare place in the picture the one with the highest
    /// score; `None` if none fits.
    fn best_shoot(
        &self,
        templates: &[Vec<usize>],
        bare_px: Point2<f64>,
        random: &mut Generator,
    ) -> Option<Shoot> {
        let target = self.place_seen_at(bare_px, random.random_range(-1.0..1.0));
        let mut best: Option<Shoot> = None;
        for from in self.nearest(&target) {
            for _ in 0..TRIED {
                // One straight branch reaches where no subtree is large enough for; it moves as
                // the trunk does.
                let pick = random.random_range(0..=templates.len());
                let template = templates.get(pick).map_or(&[1][..], Vec::as_slice);
                let roll = PI * random.random_range(-1.0..1.0);
                let Some(shoot) = self.shoot(template, from, &target, roll) else {
                    continue;
                };
                if best.as_ref().is_none_or(|b| shoot.score >= b.score) {
                    best = Some(shoot);
                }
            }
        }
        best
    }

    /// A place in space that is seen at `bare_px`, at `deep` (-1 to 1) of the depth there.
    fn place_seen_at(&self, bare_px: Point2<f64>, deep: f64) -> Point3<f64> {
        let foot_px = self.skeleton.foot_px;
        let (x, y) = (bare_px.x - foot_px.x, foot_px.y - bare_px.y);
        Point3::new(
            x,
            y,
            DEPTH * deep * self.envelope.depth(x, y).unwrap_or(0.0),
        )
    }

    /// The nodes above the foot that are nearest to `target`.
    fn nearest(&self, target: &Point3<f64>) -> Vec<usize> {
        let nodes = &self.skeleton.nodes;
        let mut order: Vec<(f64, usize)> = (1..nodes.len())
            .map(|i| ((nodes[i].position - target).norm(), i))
            .collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.truncate(REACHED_FROM);
        order.into_iter().map(|(_, i)| i).collect()
    }

    /// The subtree `template` (its root first) moved so that its farthest tip comes from node
    /// `from` to `target`; what of it is outside is left out. `None` if it does not fit at all, or
    /// covers nothing.
    fn shoot(
        &self,
        template: &[usize],
        from: usize,
        target: &Point3<f64>,
        roll: f64,
    ) -> Option<Shoot> {
        let placement = Placement::new(self.skeleton, template, from, target, roll)?;
        let base = self.skeleton.nodes.len();
        let mut nodes: Vec<Node> = Vec::new();
        let mut new_id: Vec<(usize, usize)> = vec![(placement.root, from)];
        for &i in template {
            let original = &self.skeleton.nodes[i];
            let above = original.parent?.index();
            let Some(&(_, parent_id)) = new_id.iter().find(|(old, _)| *old == above) else {
                continue;
            };
            let position = placement.of(self.skeleton, i);
            let parent = self.node(&nodes, parent_id);
            if !is_inside(self.envelope, &parent.position, &position) {
                continue;
            }
            let node = Node {
                name: NodeName(0),
                parent: Some(NodeId(parent_id as u32)),
                level: parent.level.saturating_add(1),
                position,
                radius: (original.radius * placement.scale).min(parent.radius),
                n_tracks: 0,
                certainty: 0.0,
                copy_of: Some(NodeId(i as u32)),
                plane_angle: placement.plane_angle,
                // What is rigid turns against nothing: it needs not be told.
                moves_with: None,
                kind: original.kind,
            };
            new_id.push((i, base + nodes.len()));
            nodes.push(node);
        }
        let score = self.score(&nodes)?;
        Some(Shoot { nodes, score })
    }

    /// Node `id` of the tree, or of the shoot that would grow on it.
    fn node<'a>(&'a self, shoot: &'a [Node], id: usize) -> &'a Node {
        let standing = &self.skeleton.nodes;
        match id.checked_sub(standing.len()) {
            Some(k) => &shoot[k],
            None => &standing[id],
        }
    }

    /// As in eq. 2: how much of the shape it covers, times how likely its angle is; `None` if it
    /// covers nothing.
    fn score(&self, shoot: &[Node]) -> Option<f64> {
        let mut gain = 0;
        for node in shoot {
            let parent = self.node(shoot, node.parent?.index());
            let ends = [parent.position, node.position];
            gain += self
                .cover
                .gain(ends.map(|p| self.skeleton.image_from_model(&p)));
        }
        if gain == 0 {
            return None;
        }
        let first = shoot.first()?;
        let parent = &self.skeleton.nodes[first.parent?.index()];
        let grand = &self.skeleton.nodes[parent.parent?.index()];
        let angle = angle_between(&grand.position, &parent.position, &first.position);
        Some((gain as f64).ln() + self.angles.ln_likelihood(first.level, angle))
    }
}

/// How a subtree is moved to grow from another node: turned, rolled and scaled about its root.
struct Placement {
    /// The node that the subtree grows from, and where that comes to lie.
    root: usize,
    from: Point3<f64>,
    turn: Rotation3<f64>,
    scale: f64,
    /// By how much the plane of the subtree is turned about the vertical, radians.
    plane_angle: f64,
}

impl Placement {
    /// Brings the farthest tip of `template` to `target`, with its root on node `from`; `roll` is
    /// the turn about the way there, radians. `None` if the copy would be too small or too large.
    fn new(
        skeleton: &Skeleton,
        template: &[usize],
        from: usize,
        target: &Point3<f64>,
        roll: f64,
    ) -> Option<Self> {
        let nodes = &skeleton.nodes;
        let root = nodes[*template.first()?].parent.map_or(0, |p| p.index());
        let was = farthest_way(skeleton, template, root)?;
        let is = target - nodes[from].position;
        let scale = is.norm() / was.norm();
        let straight = template.len() == 1;
        if !scale.is_finite() || scale <= 0.0 || !straight && !SCALE.contains(scale) {
            return None;
        }
        let axis = Unit::try_new(is, 1e-9)?;
        let onto = Rotation3::rotation_between(&was, &is)?;
        Some(Self {
            root,
            from: nodes[from].position,
            turn: Rotation3::from_axis_angle(&axis, roll) * onto,
            scale,
            plane_angle: is.x.atan2(is.z) - was.x.atan2(was.z),
        })
    }

    /// Where node `i` of the subtree comes to lie.
    fn of(&self, skeleton: &Skeleton, i: usize) -> Point3<f64> {
        let way = skeleton.nodes[i].position - skeleton.nodes[self.root].position;
        self.from + self.turn * way * self.scale
    }
}

/// From node `root` to the node of `template` that is farthest from it.
fn farthest_way(skeleton: &Skeleton, template: &[usize], root: usize) -> Option<Vector3<f64>> {
    let from = skeleton.nodes[root].position;
    template
        .iter()
        .map(|&i| skeleton.nodes[i].position - from)
        .max_by(|a, b| a.norm().total_cmp(&b.norm()))
}

fn is_inside(envelope: &Envelope, from: &Point3<f64>, to: &Point3<f64>) -> bool {
    (1..=4).all(|k| envelope.contains(&(from + (to - from) * (f64::from(k) / 4.0))))
}

//! Smaller copies of the tree's own subtrees where a shape is bare: growth by self-similarity.

use super::cover::Cover;
use crate::config;
use crate::model::{Node, NodeId, NodeName, Outline, Skeleton};
use crate::shape::angles::{Angles, angle_between};
use crate::shape::push::subtrees;
use crate::shape::{Envelope, chance};
use nalgebra::{Point3, Rotation3, Unit};

/// So much of the shape is to be covered.
const WANTED: f64 = 0.92;
/// Most branches that are added: a joint each in the model.
const MOST: usize = 1200;
/// Nodes from which a bare place may be reached, the nearest ones, and subtrees that are tried from
/// each.
const REACHED_FROM: usize = 8;
const TRIED: u64 = 5;
/// Branches of a subtree that is repeated, at most.
const LARGEST: usize = 12;
/// A copy is at most so much larger than its original, and at least so large.
const SCALE: std::ops::RangeInclusive<f64> = 0.15..=1.25;
/// How far in front or behind the copies end, as a share of the depth that the shape has there.
const DEPTH: f64 = 0.85;

/// A subtree that would grow from a node.
struct Shoot {
    nodes: Vec<Node>,
    score: f64,
}

/// Adds copies until the shape is covered or nothing more can be reached. They get names above
/// `last`, which is the highest that any node of the tree had.
pub fn grow(
    skeleton: &mut Skeleton,
    (envelope, shape): (&Envelope, &Outline),
    last: u32,
    settings: &config::Shape,
    seed: u64,
) {
    let angles = Angles::of(skeleton, settings);
    let measured = skeleton.measured();
    let all = subtrees(skeleton);
    let repeated = |i: &usize| {
        skeleton.nodes[*i].level >= 2
            && all[*i].iter().filter(|&&k| k < measured).count() <= LARGEST
    };
    let originals: Vec<usize> = (0..measured).filter(repeated).collect();
    let templates: Vec<Vec<usize>> = originals
        .iter()
        .map(|&i| sorted(&all[i], measured))
        .collect();
    let mut cover = Cover::of(shape);
    for i in 1..skeleton.nodes.len() {
        cover.add(seen(skeleton, &skeleton.nodes[i]));
    }
    let first = skeleton.nodes.len();
    let mut last = last;
    let mut given_up = Vec::new();
    if measured < 2 {
        return;
    }
    for step in 0..2 * MOST as u64 {
        if cover.share() >= WANTED || skeleton.nodes.len() - first >= MOST {
            break;
        }
        let Some(bare) = cover.barest(&given_up) else {
            break;
        };
        let target = target(skeleton, envelope, bare, chance::signed(seed, step, 0));
        let shoot = nearest(skeleton, &target)
            .into_iter()
            .flat_map(|from| (0..TRIED).map(move |t| (from, t)))
            .filter_map(|(from, t)| {
                let pick =
                    chance::below(seed, step, 1 + t + TRIED * from as u64, templates.len() + 1);
                // One straight branch reaches where no subtree is large enough for; it moves as the
                // trunk does.
                let template = templates.get(pick).map_or(&[1][..], Vec::as_slice);
                let roll = std::f64::consts::PI * chance::signed(seed, step, 1000 + t);
                let nodes = shoot(skeleton, envelope, template, (from, target), roll)?;
                let score = score(skeleton, &cover, &angles, &nodes)?;
                Some(Shoot { nodes, score })
            })
            .max_by(|a, b| a.score.total_cmp(&b.score));
        let before = cover.share();
        for mut node in shoot.into_iter().flat_map(|s| s.nodes) {
            // Names are used up: none is given twice.
            let Some(next) = last.checked_add(1) else {
                return;
            };
            last = next;
            node.name = NodeName(last);
            cover.add(seen(skeleton, &node));
            skeleton.nodes.push(node);
        }
        if cover.share() <= before {
            cover.give_up(bare, &mut given_up);
        }
    }
}

/// The measured nodes of a subtree, parents first.
fn sorted(subtree: &[usize], measured: usize) -> Vec<usize> {
    let mut nodes: Vec<usize> = subtree.iter().copied().filter(|&k| k < measured).collect();
    nodes.sort_unstable();
    nodes
}

fn seen(skeleton: &Skeleton, node: &Node) -> [[f64; 2]; 2] {
    let parent = node
        .parent
        .map_or(node.position, |p| skeleton.nodes[p.index()].position);
    [parent, node.position].map(|p| skeleton.image_from_model(&p))
}

/// A place in space that is seen at `bare_px`.
fn target(skeleton: &Skeleton, envelope: &Envelope, bare_px: [f64; 2], deep: f64) -> Point3<f64> {
    let (x, y) = (
        bare_px[0] - skeleton.foot_px[0],
        skeleton.foot_px[1] - bare_px[1],
    );
    Point3::new(x, y, DEPTH * deep * envelope.depth(x, y).unwrap_or(0.0))
}

/// The nodes above the foot that are nearest to `target`.
fn nearest(skeleton: &Skeleton, target: &Point3<f64>) -> Vec<usize> {
    let mut order: Vec<(f64, usize)> = (1..skeleton.nodes.len())
        .map(|i| ((skeleton.nodes[i].position - target).norm(), i))
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    order.truncate(REACHED_FROM);
    order.into_iter().map(|(_, i)| i).collect()
}

/// The subtree `template` (its root first) turned, rolled and scaled so that its farthest tip comes
/// from node `from` to
/// `target`; what of it is outside is left out. `None` if it does not fit at all.
fn shoot(
    skeleton: &Skeleton,
    envelope: &Envelope,
    template: &[usize],
    (from, target): (usize, Point3<f64>),
    roll: f64,
) -> Option<Vec<Node>> {
    let place = |i: usize| skeleton.nodes[i].position;
    let root = skeleton.nodes[*template.first()?]
        .parent
        .map_or(0, |p| p.index());
    let reach = |i: &usize| (place(*i) - place(root)).norm();
    let tip = template
        .iter()
        .copied()
        .max_by(|a, b| reach(a).total_cmp(&reach(b)))?;
    let (was, is) = (place(tip) - place(root), target - place(from));
    let scale = is.norm() / was.norm();
    if !SCALE.contains(&scale) && template.len() > 1 || !scale.is_finite() || scale <= 0.0 {
        return None;
    }
    let axis = Unit::try_new(is, 1e-9)?;
    let turn = Rotation3::from_axis_angle(&axis, roll) * Rotation3::rotation_between(&was, &is)?;
    let plane_angle = is.x.atan2(is.z) - was.x.atan2(was.z);
    let base = skeleton.nodes.len();
    let mut out: Vec<Node> = Vec::new();
    let mut new_id: Vec<(usize, usize)> = vec![(root, from)];
    for &i in template {
        let original = &skeleton.nodes[i];
        let above = original.parent?.index();
        let Some(&(_, parent)) = new_id.iter().find(|(old, _)| *old == above) else {
            continue;
        };
        let position = place(from) + turn * (place(i) - place(root)) * scale;
        let parent_at = out
            .get(parent.wrapping_sub(base))
            .map_or_else(|| place(parent), |n: &Node| n.position);
        if !is_inside(envelope, &parent_at, &position) {
            continue;
        }
        let (parent_level, parent_radius) = out.get(parent.wrapping_sub(base)).map_or(
            (
                skeleton.nodes[parent.min(base - 1)].level,
                skeleton.nodes[parent.min(base - 1)].radius,
            ),
            |n| (n.level, n.radius),
        );
        new_id.push((i, base + out.len()));
        out.push(Node {
            name: NodeName(0),
            parent: Some(NodeId(parent as u32)),
            level: parent_level.saturating_add(1),
            position,
            radius: (original.radius * scale).min(parent_radius),
            n_tracks: 0,
            certainty: 0.0,
            copy_of: Some(NodeId(i as u32)),
            plane_angle,
            kind: original.kind,
        });
    }
    (!out.is_empty()).then_some(out)
}

fn is_inside(envelope: &Envelope, from: &Point3<f64>, to: &Point3<f64>) -> bool {
    (1..=4).all(|k| envelope.contains(&(from + (to - from) * (f64::from(k) / 4.0))))
}

/// As in eq. 2: how much of the shape it covers, times how likely its angle is; `None` if it covers
/// nothing.
fn score(skeleton: &Skeleton, cover: &Cover, angles: &Angles, nodes: &[Node]) -> Option<f64> {
    let base = skeleton.nodes.len();
    let at = |id: NodeId| {
        nodes.get(id.index().wrapping_sub(base)).map_or_else(
            || skeleton.nodes[id.index().min(base - 1)].position,
            |n| n.position,
        )
    };
    let gain: usize = nodes
        .iter()
        .filter_map(|n| {
            Some(cover.gain([at(n.parent?), n.position].map(|p| skeleton.image_from_model(&p))))
        })
        .sum();
    let first = nodes.first()?;
    let parent = first.parent?;
    let grand = skeleton.nodes[parent.index()].parent?;
    let angle = angle_between(&at(grand), &at(parent), &first.position);
    (gain > 0).then(|| (gain as f64).ln() + angles.ln_likelihood(first.level, angle))
}

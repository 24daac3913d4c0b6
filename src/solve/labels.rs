//! Which piece of wood belongs to which branch of the motion hierarchy.

use super::along_wood::PointOn;
use crate::model::{BranchGraph, NodeId, Skeleton};

/// A point that is off its branch by more steps than this says no more.
const MOST_STEPS: usize = 3;
/// One branch follows upon another at this cost: two points must say so.
const CHANGE: f64 = 1.5;

/// The branch of every piece of wood; a piece runs from its parent's place to its own.
#[derive(Clone, Debug)]
pub(super) struct Labels {
    /// By piece; 0, the foot, for the first.
    pub branch: Vec<usize>,
    /// The piece in which each branch ends, by measured node; `None` where none of its wood is
    /// seen.
    pub end_of: Vec<Option<usize>>,
}

/// Labels `wood` with the measured nodes of `skeleton`, each of which stands for the branch that
/// ends there.
pub(super) fn label(skeleton: &Skeleton, wood: &BranchGraph, points: &[PointOn]) -> Labels {
    let mut on_piece: Vec<Vec<usize>> = vec![Vec::new(); wood.nodes.len()];
    for point in points {
        if let Some(piece) = wood.piece_at(point.rest_px, skeleton.image_size) {
            on_piece[piece].push(point.node.index());
        }
    }
    let hierarchy = Hierarchy::of(skeleton);
    let mut branch = cheapest(wood, &on_piece, &hierarchy);
    keep_one_piece_each(wood, &on_piece, &hierarchy, &mut branch);
    let end_of = ends(wood, &on_piece, &branch, hierarchy.parent.len());
    Labels { branch, end_of }
}

/// The branches of a skeleton, the foot first.
struct Hierarchy {
    parent: Vec<Option<usize>>,
}

impl Hierarchy {
    fn of(skeleton: &Skeleton) -> Self {
        let nodes = &skeleton.nodes[..skeleton.measured()];
        let parents = nodes.iter().map(|n| n.parent.map(NodeId::index));
        Self {
            parent: parents.collect(),
        }
    }

    fn up(&self, branch: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(branch), |&b| self.parent[b].filter(|&p| p < b))
    }

    /// Steps from `below` up to `above`; `None` where that does not carry it.
    fn steps_up(&self, above: usize, below: usize) -> Option<usize> {
        self.up(below).position(|b| b == above)
    }

    /// Steps from one branch to another, through the last that carries both.
    fn steps(&self, a: usize, b: usize) -> usize {
        for (up, common) in self.up(a).enumerate() {
            if let Some(down) = self.steps_up(common, b) {
                return up + down;
            }
        }
        MOST_STEPS
    }
}

/// The labels of least cost.
fn cheapest(wood: &BranchGraph, on_piece: &[Vec<usize>], hierarchy: &Hierarchy) -> Vec<usize> {
    let n = hierarchy.parent.len();
    let children = wood.children();
    // Least cost of a piece and all above it, by its label.
    let mut cost: Vec<Vec<f64>> = vec![Vec::new(); wood.nodes.len()];
    for piece in (0..wood.nodes.len()).rev() {
        let mut own = vec![0.0; n];
        for (label, own) in own.iter_mut().enumerate() {
            for &point in &on_piece[piece] {
                *own += hierarchy.steps(label, point).min(MOST_STEPS) as f64;
            }
            for &child in &children[piece] {
                *own += follower(&cost[child], label, hierarchy).cost;
            }
        }
        cost[piece] = own;
    }
    let mut branch = vec![0; wood.nodes.len()];
    for piece in 1..wood.nodes.len() {
        let below = branch[wood.nodes[piece].parent.unwrap_or(0)];
        branch[piece] = follower(&cost[piece], below, hierarchy).label;
    }
    branch
}

/// A label of a piece, with its cost.
struct Follower {
    label: usize,
    cost: f64,
}

/// The best label of a piece that follows upon one with the label `below`.
fn follower(cost: &[f64], below: usize, hierarchy: &Hierarchy) -> Follower {
    let mut best: Option<Follower> = None;
    for (label, cost) in cost.iter().enumerate() {
        let Some(steps) = hierarchy.steps_up(below, label) else {
            continue;
        };
        // Nothing is the foot but the foot itself, and from there to the trunk costs nothing.
        if label == 0 && cost.is_finite() && hierarchy.parent.len() > 1 {
            continue;
        }
        let steps = if below == 0 {
            steps.saturating_sub(1)
        } else {
            steps
        };
        let cost = cost + CHANGE * steps as f64;
        if best.as_ref().is_none_or(|best| cost < best.cost) {
            best = Some(Follower { label, cost });
        }
    }
    best.unwrap_or(Follower {
        label: below,
        cost: 0.0,
    })
}

/// Wood of one branch that leaves another one in two places cannot turn about both: the part with
/// most points stays, and the others become part of what they leave.
fn keep_one_piece_each(
    wood: &BranchGraph,
    on_piece: &[Vec<usize>],
    hierarchy: &Hierarchy,
    branch: &mut [usize],
) {
    // Carriers first: what is taken off one may join another.
    for label in 1..hierarchy.parent.len() {
        let mut roots: Vec<usize> = Vec::new();
        for piece in 1..wood.nodes.len() {
            let below = wood.nodes[piece].parent.unwrap_or(0);
            if branch[piece] == label && branch[below] != label {
                roots.push(piece);
            }
        }
        let support = |root: &usize| support(wood, on_piece, branch, *root);
        let kept = roots
            .iter()
            .copied()
            .max_by_key(|root| (support(root), *root));
        for root in roots.iter().filter(|root| Some(**root) != kept) {
            let below = branch[wood.nodes[*root].parent.unwrap_or(0)];
            relabel(wood, branch, *root, below.max(1));
        }
    }
}

/// Points on the wood of one label above and with `root`.
fn support(wood: &BranchGraph, on_piece: &[Vec<usize>], branch: &[usize], root: usize) -> usize {
    let mut is_in = vec![false; wood.nodes.len()];
    let mut count = 0;
    for piece in root..wood.nodes.len() {
        let goes_on = wood.nodes[piece].parent.is_some_and(|p| is_in[p]);
        is_in[piece] = piece == root || goes_on && branch[piece] == branch[root];
        if is_in[piece] {
            count += on_piece[piece].len();
        }
    }
    count
}

/// Gives the wood of one label above and with `root` another one.
fn relabel(wood: &BranchGraph, branch: &mut [usize], root: usize, label: usize) {
    let before = branch[root];
    let mut is_in = vec![false; wood.nodes.len()];
    for piece in root..wood.nodes.len() {
        let goes_on = wood.nodes[piece].parent.is_some_and(|p| is_in[p]);
        is_in[piece] = piece == root || goes_on && branch[piece] == before;
        if is_in[piece] {
            branch[piece] = label;
        }
    }
}

/// Where each branch ends: from its first piece on at every fork with that of its own wood that
/// bears most points, and where none does, with the longest.
fn ends(
    wood: &BranchGraph,
    on_piece: &[Vec<usize>],
    branch: &[usize],
    n_branches: usize,
) -> Vec<Option<usize>> {
    let children = wood.children();
    let mut above: Vec<Above> = vec![Above::default(); wood.nodes.len()];
    for piece in (1..wood.nodes.len()).rev() {
        let parent = wood.nodes[piece].parent.unwrap_or(0);
        let length = (wood.nodes[piece].position_px - wood.nodes[parent].position_px).norm();
        above[piece].points += on_piece[piece].len();
        above[piece].length_px += length;
        let (points, length_px) = (above[piece].points, above[piece].length_px);
        above[parent].points += points;
        above[parent].length_px = above[parent].length_px.max(length_px);
    }
    let mut end_of = vec![None; n_branches];
    for piece in 1..wood.nodes.len() {
        let below = wood.nodes[piece].parent.unwrap_or(0);
        let label = branch[piece];
        if branch[below] == label || end_of[label].is_some() {
            continue;
        }
        let mut end = piece;
        while let Some(next) = goes_on(&children[end], branch, label, &above) {
            end = next;
        }
        end_of[label] = Some(end);
    }
    end_of
}

/// The piece in which a branch goes on. Where others leave it and no point is on its own wood any
/// more, it ends.
fn goes_on(children: &[usize], branch: &[usize], label: usize, above: &[Above]) -> Option<usize> {
    let own = children.iter().filter(|child| branch[**child] == label);
    let next = own.max_by(|a, b| above[**a].order(&above[**b]))?;
    let is_fork = children.iter().any(|child| branch[*child] != label);
    (above[*next].points > 0 || !is_fork).then_some(*next)
}

/// What is on a piece of wood and above it.
#[derive(Clone, Copy, Debug, Default)]
struct Above {
    points: usize,
    /// Way to the farthest tip, px.
    length_px: f64,
}

impl Above {
    fn order(&self, other: &Self) -> std::cmp::Ordering {
        let points = self.points.cmp(&other.points);
        points.then(self.length_px.total_cmp(&other.length_px))
    }
}

//! What was found out about a tree.

use super::along_wood::{PointOn, along_wood};
use super::bent_tree::Names;
use super::clear::{Turns, clear_of_filmed};
use super::lift::{assign_radii, flat};
use super::sub_branches::{self, SubBranch};
use super::taper::{taper, within_pipes};
use crate::config::{Affinity, Config};
use crate::hierarchy::Evidence;
use crate::model::{
    BranchGraph, Foot, LogWindow, MotionHierarchy, NodeDepth, NodeId, Outline, RestDepths,
    Skeleton, Swaying, TrackId, TrackTable, TreeMode, Wood,
};
use crate::motion::Binding;
use crate::shape::{self, PushFigures};
use crate::skeleton;
use nalgebra::Point2;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A tree as far as film has shown it: immutable, and replaced by a newer version as a whole.
#[derive(Clone, Debug)]
pub struct Model {
    pub hierarchy: MotionHierarchy,
    /// The hierarchy in space.
    pub plain: Arc<Skeleton>,
    /// The same with the sub-branches: the tree as it is shown and written.
    pub skeleton: Arc<Skeleton>,
    /// How copies were turned to pass beside filmed limbs.
    pub turns: Turns,
    /// Branches that only their frequency tells; their nodes come after those of the hierarchy.
    pub sub_branches: Vec<SubBranch>,
    /// How each measured branch sways, by node; empty while nobody has asked for it.
    pub modes: Vec<Swaying>,
    /// The modes of the whole tree; empty likewise.
    pub tree_modes: Vec<TreeMode>,
    /// Rest position of every track that was there when the tree was built, px.
    pub rest_px: BTreeMap<TrackId, Point2<f64>>,
    /// What a depth camera has seen of the tree; `None` in a film without depth.
    pub depths: Option<Arc<RestDepths>>,
    /// Where it has seen each node of [`flat`](Self::flat); empty likewise.
    pub seen: Vec<Option<NodeDepth>>,
    /// Tracks that the tree was not built from, with node and rest place, px: those of an older
    /// tree, and those that were found since.
    pub joined: BTreeMap<TrackId, (NodeId, Point2<f64>)>,
    /// Tracks that the film shows to be off their places: they move nothing. Which branches there
    /// are, and how they sway, follows from all tracks all the same.
    pub left_out: BTreeSet<TrackId>,
    /// The wood that the pictures show, where it was looked for and found; the skeleton runs along
    /// it.
    pub wood: Option<Arc<Wood>>,
    pub outline: Arc<Outline>,
    /// The outline where the tree rests: that of a capture's first tree stays.
    pub outline_at_rest: Arc<Outline>,
    /// The foot of its trunk: that of a capture's first tree stays.
    pub foot: Foot,
    /// The tracks that it was built from, and what they are worth.
    pub table: Arc<TrackTable>,
    pub evidence: Evidence,
    /// First frame that was remembered when it was built: the pose is followed from there on.
    pub followed_from: u64,
    /// Frame after which it was built, and its time.
    pub frame: u64,
    pub time_s: f64,
    /// First frame that was posed by it live.
    pub shown_from: u64,
    /// Built before the measure reached its threshold: asked for, or at the end of the frames.
    pub forced: bool,
    /// How the first tree of the capture came about: this one, unless it was refined.
    pub first: First,
    /// How often the tree was built anew.
    pub refinements: u32,
    /// How many names nodes have been given so far.
    pub names: u32,
    /// How many of the measured nodes have their name from the tree before.
    pub kept: usize,
}

/// How the first tree of a capture came about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct First {
    pub frame: u64,
    pub time_s: f64,
    pub measure: f64,
    pub moving: usize,
    pub forced: bool,
}

/// The film that a tree is built from: the first frame that is remembered, the newest, its time (s)
/// and whether the tree is wanted before there is enough motion.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moment {
    pub followed_from: u64,
    pub frame: u64,
    pub time_s: f64,
    pub forced: bool,
}

impl Moment {
    /// That of the newest frame of `window`; `None` where nothing is remembered.
    pub(super) fn of(window: LogWindow) -> Option<Self> {
        let (first, newest) = (window.first()?, window.newest()?);
        Some(Self {
            followed_from: first.frame,
            frame: newest.frame,
            time_s: newest.time_s,
            forced: false,
        })
    }
}

impl Model {
    /// Which track moves which node.
    pub fn binding(&self) -> Binding {
        self.binding_on(&self.skeleton)
    }

    /// The same on another form of its skeleton: straight, or along the wood.
    fn binding_on(&self, skeleton: &Skeleton) -> Binding {
        let mut binding = Binding::new(&self.hierarchy, &self.rest_px, skeleton);
        let places = skeleton.foot_and_branches();
        binding.inherit(&moved_to(&self.joined, &places));
        binding.inherit(&moved_to(&self.on_sub_branches(), &places));
        binding.leave_out(&self.left_out);
        binding.see_depths(self.depths.clone());
        binding
    }

    /// The model with all tracks that `binding` knows by now.
    pub fn joined_by(&self, binding: &Binding) -> Self {
        let built_from = self.hierarchy.members();
        let mut joined = BTreeMap::new();
        for (id, node, rest_px) in binding.bound() {
            if !built_from.contains(&id) {
                joined.insert(id, (self.carrier(node), rest_px));
            }
        }
        Self {
            joined,
            ..self.clone()
        }
    }

    /// The node of `plain` that `node` of `skeleton` is, or the one that carries it if it is a
    /// sub-branch.
    pub(super) fn carrier(&self, node: NodeId) -> NodeId {
        let mover = self.skeleton.mover(node);
        let places = self.skeleton.foot_and_branches();
        let place = places.iter().position(|n| *n == mover).unwrap_or(0);
        match place.checked_sub(self.plain.measured()) {
            Some(k) => self.sub_branches[k].on,
            None => NodeId(place as u32),
        }
    }

    /// The points of the sub-branches with rest place, px, and node; sub-branches are counted after
    /// the nodes of `plain`.
    fn on_sub_branches(&self) -> BTreeMap<TrackId, (NodeId, Point2<f64>)> {
        let mut out = BTreeMap::new();
        let first = self.plain.measured() as u32;
        for (node, branch) in (first..).map(NodeId).zip(&self.sub_branches) {
            for id in &branch.members {
                if let Some(rest_px) = self.rest_px_of(*id) {
                    out.insert(*id, (node, rest_px));
                }
            }
        }
        out
    }

    fn rest_px_of(&self, id: TrackId) -> Option<Point2<f64>> {
        match self.joined.get(&id) {
            Some((_, rest_px)) => Some(*rest_px),
            None => self.rest_px.get(&id).copied(),
        }
    }

    /// Puts `sub_branches` on in place of those that it has.
    pub(super) fn set_sub_branches(&mut self, sub_branches: Vec<SubBranch>, config: &Config) {
        self.sub_branches = sub_branches;
        let before = self.skeleton.clone();
        self.assemble(&before, config);
    }

    /// The same tree along the wood that pictures show. Traced nodes go on as those of `before`
    /// that are in their places.
    pub(super) fn set_wood(&mut self, wood: Option<Arc<Wood>>, before: &Skeleton, config: &Config) {
        self.wood = wood;
        self.assemble(before, config);
    }

    /// The skeleton from its parts: the hierarchy in space, the sub-branches, the wood. Traced nodes
    /// go on as those of `before` that are in their places.
    pub(super) fn assemble(&mut self, before: &Skeleton, config: &Config) {
        self.modes.clear();
        self.tree_modes.clear();
        let mut skeleton = self.joined_parts(before, config);
        self.turns = clear_of_filmed(&mut skeleton, &self.turns);
        self.count_tracks(&mut skeleton);
        self.skeleton = Arc::new(skeleton);
    }

    fn joined_parts(&mut self, before: &Skeleton, config: &Config) -> Skeleton {
        let plain = match config.shape.planes_of(self.is_bare()) {
            1 => Arc::new(self.plain.without_copies()),
            _ => self.plain.clone(),
        };
        let mut straight = sub_branches::with(&plain, &self.sub_branches);
        let none_seen = BranchGraph::default();
        let branches = match &self.wood {
            Some(wood) => &wood.branches,
            None if is_joined_without_wood(config) => &none_seen,
            None => {
                assign_radii(&mut straight, &self.outline_at_rest, config);
                return straight;
            }
        };
        let mut points = Vec::new();
        for (_, node, rest_px) in self.binding_on(&straight).bound() {
            points.push(PointOn { node, rest_px });
        }
        let mut names = Names {
            next: self.names,
            prior: Some(before),
        };
        let mut joined = along_wood(&plain, &straight, branches, &points, &mut names);
        self.names = names.next;
        self.set_depths_seen(&mut joined.skeleton);
        assign_radii(&mut joined.skeleton, &self.outline_at_rest, config);
        // Radii that are seen go before those of the pipe model, and a width that the user gives
        // before both.
        if config.wood.trunk_width_px <= 0.0 {
            let nodes = &mut joined.skeleton.nodes;
            let seen_px = match self.is_bare() {
                true => within_pipes(nodes, &joined.seen_px),
                false => joined.seen_px,
            };
            taper(nodes, &seen_px);
        }
        joined.skeleton
    }

    /// Whether its wood is seen, and no leaves on it.
    pub fn is_bare(&self) -> bool {
        self.wood.as_ref().is_some_and(|wood| wood.bare)
    }

    /// Gives each branch of `skeleton` the number of points that are on it or on what it carries:
    /// along the wood that is not always what its cluster holds.
    fn count_tracks(&self, skeleton: &mut Skeleton) {
        let count = self.binding_on(skeleton).count_tracks();
        for node in skeleton.foot_and_branches() {
            skeleton.nodes[node.index()].n_tracks = count[node.index()];
        }
    }

    /// Branches along wood end where a depth camera has seen the ends of the straight ones.
    fn set_depths_seen(&self, joined: &mut Skeleton) {
        let ends = joined.foot_and_branches();
        shape::set_depths_seen(joined, |node| {
            let place = ends.iter().position(|end| *end == node)?;
            let seen = self.seen.get(place).copied().flatten();
            seen.and(self.plain.nodes.get(place))
                .map(|straight| straight.position.z)
        });
    }

    /// The skeleton in the picture that it was pushed into space from, with the number of points on
    /// every node.
    pub fn flat(&self, config: &Config) -> (Vec<skeleton::Node2d>, Vec<u32>) {
        flat(&self.hierarchy, self.foot.position_px, config)
    }

    /// How well its push fills the envelope, and how likely its angles are, beside the one-sided
    /// ways; without sub-branches, which are not pushed.
    pub fn push_figures(&self, config: &Config) -> PushFigures {
        let (flat, tracks) = self.flat(config);
        PushFigures::of(
            &self.plain,
            &flat,
            &tracks,
            &self.outline_at_rest,
            &config.shape,
        )
    }
}

/// Whether branches leave each other where the motion has them, with joints, where no wood is seen
/// either. The paper's own hierarchy has forks at centroids of halves, and no places for that.
fn is_joined_without_wood(config: &Config) -> bool {
    config.skeleton.along_wood && config.hierarchy.affinity == Affinity::Path
}

/// Points on nodes of the straight tree, on those of another form of it.
fn moved_to(
    points: &BTreeMap<TrackId, (NodeId, Point2<f64>)>,
    places: &[NodeId],
) -> BTreeMap<TrackId, (NodeId, Point2<f64>)> {
    let mut out = BTreeMap::new();
    for (id, (node, rest_px)) in points {
        if let Some(place) = places.get(node.index()) {
            out.insert(*id, (*place, *rest_px));
        }
    }
    out
}

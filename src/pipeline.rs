//! The whole algorithm on one screen: what arborcam means, one synchronous step per frame.
//!
//! The front end finds the outline and follows points; the back end gathers their motion, builds
//! the tree, and from then on poses it and now and then builds it anew. `runtime` runs the same two
//! halves on threads of their own.

mod back;
mod bark;
mod dress;
#[cfg(feature = "opencv")]
mod front;
mod leaves;
mod refine;
mod refiner;
mod reshape;
mod retrace;
#[cfg(feature = "opencv")]
mod seeds;
mod shoots;

pub use back::{BackEnd, Followed, Moved};
pub use dress::{Seen, dress, flutter};
#[cfg(feature = "opencv")]
pub use front::FrontEnd;
pub use refine::Refinement;
pub use reshape::{MOST_RESHAPED, cut_to, reshape};
pub use retrace::Retrace;
#[cfg(feature = "opencv")]
pub use seeds::seeds as leaf_seeds;
pub use shoots::Shoot;

use crate::config::Config;
use crate::hierarchy::{self, Evidence, TrackHistory};
use crate::model::{
    MotionHierarchy, NodeId, Outline, Pose, Skeleton, TrackId, TrackSet, TrackTable,
};
use crate::motion::{Binding, PoseEstimator};
use crate::shape::PushFigures;
#[cfg(feature = "opencv")]
use crate::{cancel::CancelToken, model::Frame};
use crate::{shape, skeleton};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Fewer moving points than this make no tree, whatever is asked.
pub const LEAST_MOVING: usize = 16;
/// Share of the outline's width at the foot that is trunk, where none can be measured above it.
const TRUNK_SHARE: f64 = 0.5;

/// Both halves in one thread.
#[cfg(feature = "opencv")]
pub struct Pipeline {
    pub front: FrontEnd,
    pub back: BackEnd,
}

#[cfg(feature = "opencv")]
impl Pipeline {
    pub fn new(config: &Config, outline: Option<Outline>) -> Self {
        Self {
            front: FrontEnd::new(config, outline),
            back: BackEnd::new(config),
        }
    }

    /// One frame in; what became of it and of frames held back before, in order.
    pub fn step(&mut self, frame: Frame) -> Vec<Moved> {
        self.front
            .step(frame)
            .into_iter()
            .map(|followed| self.back.step(followed))
            .collect()
    }

    /// No more frames: works off what is held and builds from what there is.
    pub fn finish(&mut self) -> Vec<Moved> {
        let moved = self
            .front
            .flush()
            .into_iter()
            .map(|followed| self.back.step(followed))
            .collect();
        self.back.finish(&CancelToken::new());
        moved
    }
}

/// The built tree and what it was built from.
#[derive(Clone, Debug)]
pub struct Tree {
    pub hierarchy: MotionHierarchy,
    /// The hierarchy in space, and the same with the shoots: the tree as it is shown and written.
    pub plain: Arc<Skeleton>,
    pub skeleton: Arc<Skeleton>,
    /// What a refinement has added; their nodes come after those of the hierarchy.
    pub shoots: Vec<Shoot>,
    /// Rest position of every track that was there when the tree was built, px.
    pub rest_px: BTreeMap<TrackId, [f64; 2]>,
    pub outline: Arc<Outline>,
    /// First frame that was remembered when it was built: the pose is followed from there on.
    pub followed_from: u64,
    /// Frame after which it was built, and its time.
    pub frame: u64,
    pub time_s: f64,
    /// First frame that was posed by it live.
    pub shown_from: u64,
    pub evidence: Evidence,
    /// The tracks that it was built from.
    pub table: Arc<TrackTable>,
    /// Built before the measure reached its threshold: asked for, or at the end of the frames.
    pub forced: bool,
    /// How the first tree of the capture came about: this one, unless it is refined.
    pub first: First,
    /// How often the tree was built anew, the names that have been given so far, and how many of
    /// the measured nodes have one from the tree before.
    pub refinements: u32,
    pub names: u32,
    pub kept: usize,
    /// Tracks that older trees knew and this one was not built from, with node and rest place, px.
    pub inherited: BTreeMap<TrackId, (NodeId, [f64; 2])>,
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

/// When a tree is built: the first frame that is remembered, the newest, its time, and whether the
/// build was asked for.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moment {
    pub followed_from: u64,
    pub frame: u64,
    pub time_s: f64,
    pub forced: bool,
}

impl Moment {
    /// That of the newest frame of `history`; `None` where nothing is remembered.
    fn of(history: &TrackHistory, forced: bool) -> Option<Self> {
        let (first, newest) = (history.first()?, history.last()?);
        Some(Self {
            followed_from: first.frame,
            frame: newest.frame,
            time_s: newest.time_s,
            forced,
        })
    }
}

impl Tree {
    pub fn binding(&self) -> Binding {
        let mut binding = Binding::new(&self.hierarchy, &self.rest_px, &self.skeleton);
        binding.inherit(&self.inherited);
        binding.inherit(&self.on_shoots());
        binding
    }

    /// The points of the shoots with node and rest place, px.
    fn on_shoots(&self) -> BTreeMap<TrackId, (NodeId, [f64; 2])> {
        let rest_px = |id: &TrackId| {
            self.inherited
                .get(id)
                .map(|(_, at)| at)
                .or_else(|| self.rest_px.get(id))
                .copied()
        };
        let nodes = (self.plain.measured() as u32..).map(NodeId);
        let of = |(node, shoot): (NodeId, &Shoot)| {
            shoot
                .members
                .iter()
                .filter_map(move |id| Some((*id, (node, rest_px(id)?))))
                .collect::<Vec<_>>()
        };
        nodes.zip(&self.shoots).flat_map(of).collect()
    }

    /// Puts `shoots` on in place of those that it has.
    fn shoot(&mut self, shoots: Vec<Shoot>, config: &Config) {
        self.shoots = shoots;
        let mut skeleton = shoots::with(&self.plain, &self.shoots);
        thicken(&mut skeleton, &self.outline, config);
        self.skeleton = Arc::new(skeleton);
    }

    pub fn estimator(&self, config: &Config) -> PoseEstimator {
        PoseEstimator::new(self.skeleton.clone(), &config.motion)
    }

    /// The skeleton in the picture that it was stood up from, with the number of points on every
    /// node.
    pub fn flat(&self, config: &Config) -> (Vec<skeleton::Node2d>, Vec<u32>) {
        flat(&self.hierarchy, &self.outline, config)
    }

    /// The same with its foot at `foot_px`: that of a capture's first tree stays.
    fn flat_on(&self, foot_px: [f64; 2], config: &Config) -> (Vec<skeleton::Node2d>, Vec<u32>) {
        let (mut flat, tracks) = self.flat(config);
        flat.iter_mut()
            .take(1)
            .for_each(|foot| foot.position_px = foot_px);
        (flat, tracks)
    }

    /// How well its push fills the envelope, and how likely its angles are, beside the one-sided
    /// ways; without shoots, which are not pushed.
    pub fn push_figures(&self, config: &Config) -> PushFigures {
        let (flat, tracks) = self.flat_on(self.plain.foot_px, config);
        PushFigures::of(&self.plain, &flat, &tracks, &self.outline, &config.shape)
    }

    /// Tracks to poses, from the rest pose on.
    fn poser(&self, config: &Config) -> Poser {
        Poser {
            binding: self.binding(),
            estimator: self.estimator(config),
        }
    }
}

/// Where the tracks put each measured node, px; `None` for a node none of whose tracks was seen.
pub type Targets = Vec<Option<[f64; 2]>>;

/// Follows a tree's pose from frame to frame.
struct Poser {
    binding: Binding,
    estimator: PoseEstimator,
}

impl Poser {
    /// The pose in the next frame, and where its tracks put the measured nodes.
    fn step(&mut self, tracks: &TrackSet) -> (Pose, Targets) {
        let targets_px = self.binding.targets_px(tracks);
        let pose = self
            .estimator
            .step(tracks.frame, tracks.time_s, &targets_px);
        (pose, targets_px)
    }
}

/// Where the crown is, from the left, px: the mean of the points that move.
fn crown_u(table: &TrackTable, moving: &[usize]) -> Option<f64> {
    let sum: f64 = moving
        .iter()
        .map(|&row| hierarchy::rest_position_px(table, row)[0])
        .sum();
    (!moving.is_empty()).then(|| sum / moving.len() as f64)
}

/// The skeleton in the picture, and the number of points on every node.
fn flat(
    hierarchy: &MotionHierarchy,
    outline: &Outline,
    config: &Config,
) -> (Vec<skeleton::Node2d>, Vec<u32>) {
    let flat = skeleton::build(hierarchy, outline, &config.skeleton);
    let cluster = |n: &skeleton::Node2d| {
        hierarchy
            .clusters
            .get(n.cluster.map_or(0, |c| c.0 as usize))
    };
    let tracks = flat
        .iter()
        .map(|n| cluster(n).map_or(0, |c| c.members.len() as u32))
        .collect();
    (flat, tracks)
}

/// Radii, from the trunk's as it was given or as the outline shows it.
fn thicken(skeleton: &mut Skeleton, outline: &Outline, config: &Config) {
    let wood = &config.wood;
    let top_px = skeleton.nodes.get(1).map_or(skeleton.foot_px, |top| {
        skeleton.image_from_model(&top.position)
    });
    let measured = shape::trunk_radius_px(outline, skeleton.foot_px, top_px);
    let given = Some(0.5 * wood.trunk_width_px).filter(|&given| given > 0.0);
    let at_foot = || TRUNK_SHARE * skeleton::Foot::of(outline, None).half_width_px;
    let trunk_px = given
        .or(measured)
        .unwrap_or_else(at_foot)
        .max(2.0 * shape::TIP_RADIUS_PX);
    let room = shape::room(
        skeleton,
        Some(outline),
        shape::Bounds::Filmed(config.shape.envelope),
    );
    shape::thicken(skeleton, trunk_px, &room, wood, wood.seed.into());
}

/// Tracks to tree: evidence, hierarchy, 2D skeleton, 3D skeleton. `None` if too few points move.
pub fn build(
    table: &Arc<TrackTable>,
    evidence: Evidence,
    outline: &Arc<Outline>,
    config: &Config,
    Moment {
        followed_from,
        frame,
        time_s,
        forced,
    }: Moment,
) -> Option<Tree> {
    if evidence.moving.len() < LEAST_MOVING {
        return None;
    }
    let foot_px = skeleton::Foot::of(outline, crown_u(table, &evidence.moving)).position_px;
    let hierarchy = hierarchy::build(table, &evidence.moving, foot_px, &config.hierarchy);
    if hierarchy
        .clusters
        .first()
        .is_none_or(|all| all.members.len() < LEAST_MOVING)
    {
        return None;
    }
    let skeleton = Arc::new(stand(&hierarchy, outline, config));
    let rest = |row: usize| (table.ids[row], hierarchy::rest_position_px(table, row));
    let first = First {
        frame,
        time_s,
        measure: evidence.measure,
        moving: evidence.moving.len(),
        forced,
    };
    Some(Tree {
        rest_px: (0..table.ids.len()).map(rest).collect(),
        hierarchy,
        table: table.clone(),
        first,
        refinements: 0,
        names: skeleton.nodes.len() as u32,
        kept: 0,
        inherited: BTreeMap::new(),
        plain: skeleton.clone(),
        skeleton,
        shoots: Vec::new(),
        outline: outline.clone(),
        followed_from,
        frame,
        time_s,
        shown_from: frame,
        evidence,
        forced,
    })
}

/// Hierarchy to tree in space, with its thickness.
pub fn stand(hierarchy: &MotionHierarchy, outline: &Outline, config: &Config) -> Skeleton {
    let (flat, tracks) = flat(hierarchy, outline, config);
    let mut skeleton = shape::build(&flat, &tracks, outline, &config.shape);
    thicken(&mut skeleton, outline, config);
    skeleton
}

//! The whole algorithm on one screen: a log of points becomes a model of the tree.
//!
//! [`solve`] is the only maker of models, for every caller: the pipeline while it films, the end of
//! a film, a log that is finished after a crash, and programs with tracks of their own. It does no
//! I/O, starts no threads and reads no clock.

mod along_wood;
mod at_rest;
mod bent_tree;
mod clear;
mod in_depth;
mod labels;
mod least_wood;
mod lift;
mod model;
mod refine;
mod seen_depth;
mod sub_branches;
mod taper;

pub use in_depth::in_depth_of;
pub use lift::{assign_radii, lift_to_3d};
pub use model::{First, Model, Moment};
pub use sub_branches::SubBranch;
pub use taper::assign_seen_radii;

use crate::cancel::CancelToken;
use crate::config::{Config, Leader};
use crate::dynamics::{Depth, Film, analyse};
use crate::hierarchy::{self, Evidence};
use crate::model::{Foot, Outline, Skeleton, TrackId, TrackLog, TrackTable, Wood};
use at_rest::at_rest;
use clear::Turns;
use nalgebra::Point2;
use refine::Refinement;
use seen_depth::{DepthSource, node_depths, rest_depths};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Fewer moving points than this make no tree, whatever is asked.
pub const LEAST_MOVING: usize = 16;

/// Builds the tree from the points that `log` remembers (the last `accumulate.window_s`), within
/// `outline`.
///
/// With a `prior` model of the same tree the new one keeps its node names, places and sides, and
/// comes about only if it is borne out by the motion at least as well; where it is not, the prior
/// with the sub-branches that are identified by now may be the answer.
///
/// `None` where fewer than [`LEAST_MOVING`] points move, or all of them as a camera moves them,
/// where a prior model stays the better one,
/// or where `cancel` ends the work before.
pub fn solve(
    log: &TrackLog,
    outline: &Arc<Outline>,
    prior: Option<&Model>,
    config: &Config,
    cancel: &CancelToken,
) -> Option<Model> {
    if let Some(prior) = prior {
        let refinement = Refinement::of(log, prior, config)?;
        let evidence = refinement.evidence()?;
        let (table, moment) = (&refinement.table, refinement.moment);
        let depths = DepthSource {
            window: log.last(config.accumulate.window_s),
            prior: prior.depths.as_deref(),
        };
        let new = build(table, evidence, Stand::of(prior), depths, config, moment)?;
        let new = without_doubtful(new, log, &prior.left_out, config);
        return refinement.better(new, cancel);
    }
    let window = log.last(config.accumulate.window_s);
    let (table, evidence) = hierarchy::seen(window, &config.accumulate);
    let table = Arc::new(table);
    let is_enough = evidence.measure >= config.accumulate.threshold
        && window.span_s() >= config.accumulate.min_s;
    let moment = Moment {
        forced: !is_enough,
        ..Moment::of(window)?
    };
    let stand = Stand::find(outline, log, &table, &evidence.moving, config);
    let depths = DepthSource {
        window,
        prior: None,
    };
    let mut model = build(&table, evidence, stand, depths, config, moment)?;
    let before = model.skeleton.clone();
    model.assemble(&before, config);
    Some(without_doubtful(model, log, &BTreeSet::new(), config))
}

/// The model with the points left out that the film shows to be off their places, and those that
/// were `before`.
fn without_doubtful(
    model: Model,
    log: &TrackLog,
    before: &BTreeSet<TrackId>,
    config: &Config,
) -> Model {
    let window = log.last(config.accumulate.window_s);
    let mut left_out = hierarchy::left_out(window, before, &config.accumulate);
    // Coloured markers are on their places, whatever the points around them do.
    left_out.retain(|id| id.marker().is_none());
    Model { left_out, ..model }
}

/// The model with its modes: how its branches sway in `film`, whose points are on the nodes of
/// `skeleton`. That is the model's, as its files give it back: who analyses these finds the same.
/// Branches that were not looked at when `cancel` ended the work are
/// [`NotInTime`](crate::model::Unidentified::NotInTime).
pub fn with_modes(
    model: &Model,
    skeleton: &Skeleton,
    film: &Film,
    config: &Config,
    cancel: &CancelToken,
) -> Model {
    let analysis = analyse(skeleton, film, &config.dynamics, Depth::Full, cancel);
    Model {
        modes: analysis.sway,
        tree_modes: analysis.modes,
        ..model.clone()
    }
}

/// The model along the wood that pictures show: where wood is seen, the skeleton runs on it. With a
/// `prior` model of the same tree, bends that are in the same places keep its names.
pub fn with_wood(
    model: &Model,
    wood: Option<Arc<Wood>>,
    prior: Option<&Model>,
    config: &Config,
) -> Model {
    let mut model = model.clone();
    model.turns = turns_before(&model, wood.is_some(), prior);
    let before = prior.map_or_else(|| model.skeleton.clone(), |prior| prior.skeleton.clone());
    model.set_wood(wood, &before, config);
    model
}

/// How the copies were turned of which `model` with its wood is the next version. With the first
/// wood that is seen the whole tree is another one.
fn turns_before(model: &Model, has_wood: bool, prior: Option<&Model>) -> Turns {
    let before = prior.unwrap_or(model);
    if has_wood && before.wood.is_none() {
        return Turns::new();
    }
    before.turns.clone()
}

/// The prior model with the sub-branches that its frequencies identify by now; `None` where they
/// are those that it has, where too little motion is seen, or where `cancel` ends the work before.
pub fn identify_sub_branches(
    log: &TrackLog,
    prior: &Model,
    config: &Config,
    cancel: &CancelToken,
) -> Option<Model> {
    if cancel.is_cancelled() {
        return None;
    }
    Refinement::of(log, prior, config)?.sub_branches_only(cancel)
}

/// Where the crown is, from the left, px: the mean of the points that move.
fn crown_u(table: &TrackTable, moving: &[usize]) -> Option<f64> {
    let sum: f64 = moving
        .iter()
        .map(|&row| hierarchy::rest_position_px(table, row).x)
        .sum();
    (!moving.is_empty()).then(|| sum / moving.len() as f64)
}

/// The foot of the tree: where the line begins that was drawn along the trunk, or where the outline
/// has it.
fn foot(outline: &Outline, crown_u: Option<f64>, config: &Config) -> Foot {
    let found = Foot::of(outline, crown_u);
    if config.shape.leader != Leader::Drawn {
        return found;
    }
    let line = config.shape.leader_px.iter().copied().map(Point2::from);
    found.at_drawn_trunk(&line.collect::<Vec<_>>(), outline.size)
}

/// Where a tree stands in the picture.
struct Stand {
    outline: Arc<Outline>,
    at_rest: Arc<Outline>,
    foot: Foot,
}

impl Stand {
    fn find(
        outline: &Arc<Outline>,
        log: &TrackLog,
        table: &TrackTable,
        moving: &[usize],
        config: &Config,
    ) -> Self {
        let foot = foot(outline, crown_u(table, moving), config);
        let at_rest = at_rest(outline, log, table, moving, foot.position_px);
        Self {
            outline: outline.clone(),
            at_rest: Arc::new(at_rest),
            foot,
        }
    }

    fn of(prior: &Model) -> Self {
        Self {
            outline: prior.outline.clone(),
            at_rest: prior.outline_at_rest.clone(),
            foot: prior.foot,
        }
    }
}

/// Hierarchy, 2D skeleton, 3D skeleton with straight branches. `None` if too few points move.
fn build(
    table: &Arc<TrackTable>,
    evidence: Evidence,
    stand: Stand,
    depths: DepthSource,
    config: &Config,
    moment: Moment,
) -> Option<Model> {
    if evidence.moving.len() < LEAST_MOVING {
        return None;
    }
    let foot_px = stand.foot.position_px;
    let hierarchy = hierarchy::build(table, &evidence.moving, foot_px, &config.hierarchy);
    if hierarchy.members().len() < LEAST_MOVING {
        return None;
    }
    let mut rest_px = BTreeMap::new();
    for (row, id) in table.ids.iter().enumerate() {
        rest_px.insert(*id, hierarchy::rest_position_px(table, row));
    }
    let depths = rest_depths(depths, &rest_px, foot_px, &config.depth);
    let (flat, _) = lift::flat(&hierarchy, foot_px, config);
    let seen = depths.as_ref().map_or(Vec::new(), |depths| {
        node_depths(&flat, &hierarchy, &rest_px, depths)
    });
    let skeleton = lift_to_3d(&hierarchy, foot_px, &stand.at_rest, &seen, config);
    let skeleton = Arc::new(skeleton);
    let first = First {
        frame: moment.frame,
        time_s: moment.time_s,
        measure: evidence.measure,
        moving: evidence.moving.len(),
        forced: moment.forced,
    };
    Some(Model {
        rest_px,
        depths,
        seen,
        hierarchy,
        table: table.clone(),
        first,
        refinements: 0,
        names: skeleton.nodes.len() as u32,
        kept: 0,
        joined: BTreeMap::new(),
        plain: skeleton.clone(),
        skeleton,
        turns: Turns::new(),
        sub_branches: Vec::new(),
        left_out: BTreeSet::new(),
        wood: None,
        modes: Vec::new(),
        tree_modes: Vec::new(),
        outline: stand.outline,
        outline_at_rest: stand.at_rest,
        foot: stand.foot,
        followed_from: moment.followed_from,
        frame: moment.frame,
        time_s: moment.time_s,
        shown_from: moment.frame,
        evidence,
        forced: moment.forced,
    })
}

//! The tree once more, from what has been seen since: which node is which, and whether the new one
//! is better.

use super::lift::assign_radii;
use super::model::{Model, Moment};
use super::sub_branches::{self, SubBranch};
use crate::cancel::CancelToken;
use crate::config::Config;
use crate::hierarchy::{self, Evidence, Gain, OnBoth};
use crate::model::{NodeId, NodeName, Skeleton, TrackId, TrackLog, TrackTable};
use crate::shape::{Prototype, Twin, go_on, on_foot, twins};
use crate::signal::median;
use nalgebra::{Point2, Vector2};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A point seen in less than this share of the remembered frames stays with the branch that it was
/// found on: it has been seen too briefly to be judged by its own motion.
const SEEN_SHARE: f64 = 0.5;
/// A tree that is worse by more than so many standard errors is not taken. One that only seems
/// worse is, as it has seen more.
const ERRORS: f64 = 2.0;

/// A prior model held against what has been seen since.
pub(super) struct Refinement<'a> {
    pub table: Arc<TrackTable>,
    log: &'a TrackLog,
    prior: &'a Model,
    /// Every track that the prior model knows, with its deepest node that is no sub-branch and its
    /// rest place, px.
    bound: BTreeMap<TrackId, (NodeId, Point2<f64>)>,
    config: &'a Config,
    pub moment: Moment,
}

impl<'a> Refinement<'a> {
    /// `None` where nothing is remembered.
    pub fn of(log: &'a TrackLog, prior: &'a Model, config: &'a Config) -> Option<Self> {
        let window = log.last(config.accumulate.window_s);
        let moment = Moment::of(window)?;
        let mut bound = BTreeMap::new();
        for (id, node, rest_px) in prior.binding().bound() {
            bound.insert(id, (prior.carrier(node), rest_px));
        }
        Some(Self {
            table: Arc::new(hierarchy::table(window)),
            log,
            prior,
            bound,
            config,
            moment,
        })
    }

    /// The `new` tree, built from this evidence, with the prior one's names and place, if it is the
    /// better one.
    ///
    /// It is taken if the motion seen is enough for a build of its own (else a calm spell would
    /// undo what wind has shown), and if it is not worse than the prior one by more than chance.
    /// Each of them is held against what both were built from: on its own evidence any tree looks
    /// good.
    pub fn better(&self, mut new: Model, cancel: &CancelToken) -> Option<Model> {
        let (frame, measure) = (self.moment.frame, new.evidence.measure);
        let (before, since) = (
            self.gain(&self.prior.table, &new),
            self.gain(&self.table, &new),
        );
        let (gain, error) = (before.gain + since.gain, before.error.hypot(since.error));
        let taken = gain >= -ERRORS * error;
        tracing::debug!(
            frame,
            measure,
            before.gain,
            since.gain,
            error,
            taken,
            "refinement"
        );
        if !taken {
            return self.with_other_sub_branches(cancel);
        }
        self.adopt(&mut new);
        let binding = new.binding();
        let found = self.identify(&new.plain, |id| binding.node_of(id), cancel);
        self.put_on(&mut new, found);
        Some(new)
    }

    /// The prior model with the sub-branches that are identified by now, if they are others, and
    /// enough motion is seen; not if `cancel` ends it before.
    pub fn sub_branches_only(&self, cancel: &CancelToken) -> Option<Model> {
        self.evidence()?;
        self.with_other_sub_branches(cancel)
    }

    /// The motion seen, if it is enough for a build of its own.
    pub fn evidence(&self) -> Option<Evidence> {
        let evidence = hierarchy::evidence(&self.table, &self.config.accumulate);
        let enough = self
            .config
            .accumulate
            .threshold
            .min(self.prior.evidence.measure);
        let (frame, measure) = (self.moment.frame, evidence.measure);
        if measure < enough {
            tracing::debug!(frame, measure, enough, "no refinement: too little motion");
        }
        (measure >= enough).then_some(evidence)
    }

    fn with_other_sub_branches(&self, cancel: &CancelToken) -> Option<Model> {
        let prior = self.prior;
        let found = self.identify(&prior.plain, |id| Some(self.bound.get(&id)?.0), cancel);
        if cancel.is_cancelled() || points_of(&found) == points_of(&prior.sub_branches) {
            return None;
        }
        // What came after the tree was built stays where it was put meanwhile, and off the tree if
        // it was put nowhere.
        let known = prior.hierarchy.members();
        let mut model = Model {
            followed_from: self.moment.followed_from,
            frame: self.moment.frame,
            time_s: self.moment.time_s,
            shown_from: self.moment.frame,
            refinements: prior.refinements + 1,
            kept: prior.plain.measured(),
            joined: self.bound.clone(),
            ..prior.clone()
        };
        model.joined.retain(|id, _| !known.contains(id));
        for (row, id) in self.table.ids.iter().enumerate() {
            model
                .rest_px
                .entry(*id)
                .or_insert_with(|| hierarchy::rest_position_px(&self.table, row));
        }
        self.put_on(&mut model, found);
        Some(model)
    }

    /// The sub-branches that as much film shows as sway is analysed in; `node_of` says on which
    /// node of `skeleton` a point is.
    fn identify(
        &self,
        skeleton: &Skeleton,
        node_of: impl Fn(TrackId) -> Option<NodeId>,
        cancel: &CancelToken,
    ) -> Vec<SubBranch> {
        let settings = &self.config.dynamics;
        let table = hierarchy::table(self.log.last(settings.window_s));
        sub_branches::identify(&table, skeleton, node_of, settings, cancel)
    }

    /// Puts sub-branches on `model`. Those that the prior one has on the same branch keep their
    /// names and ends, and its tips that fork their forks; on another branch, or as the
    /// continuation of a tip, one would jump.
    fn put_on(&self, model: &mut Model, mut found: Vec<SubBranch>) {
        let prior = &self.prior.sub_branches;
        let before = hierarchy::persisting(&members_of(prior), &members_of(&found));
        for (branch, before) in found.iter_mut().zip(before) {
            let on = model.plain.name_of(branch.on);
            let is_here = |b: &&SubBranch| self.prior.plain.name_of(b.on) == on;
            if branch.fork < 1.0
                && let Some(forked) = prior.iter().filter(is_here).find(|b| b.fork < 1.0)
            {
                branch.fork = forked.fork;
            }
            let same = before.map(|i| &prior[i]).filter(is_here);
            match same.filter(|b| b.end_px.is_none() == branch.end_px.is_none()) {
                Some(before) => (branch.name, branch.end_px) = (before.name, before.end_px),
                None => {
                    branch.name = NodeName(model.names);
                    model.names += 1;
                }
            }
        }
        model.set_sub_branches(found, self.config);
    }

    /// How much better `new` is borne out by the motion in `table`, by the points that both trees
    /// know.
    fn gain(&self, table: &TrackTable, new: &Model) -> Gain {
        let known = new.hierarchy.members();
        let mut on_both = Vec::new();
        for (row, id) in table.ids.iter().enumerate() {
            if let Some((node, _)) = self.bound.get(id)
                && known.contains(id)
            {
                on_both.push(OnBoth {
                    row,
                    old: upwards(&self.prior.plain, *node),
                    new: chain_of(new, *id),
                });
            }
        }
        hierarchy::gain(table, &on_both)
    }

    /// Names, places and lost tracks go over from the prior model.
    fn adopt(&self, model: &mut Model) {
        let old = &self.prior.plain;
        let matches = self.match_measured_nodes(model);
        model.foot = self.prior.foot;
        let anew = on_foot((*model.plain).clone(), old.foot_px);
        let twins = twins(&anew, old, &matches);
        let (flat, tracks) = model.flat(self.config);
        let prototype = Prototype::seen(
            &flat,
            &tracks,
            &model.outline_at_rest,
            &self.config.shape,
            &model.seen,
        );
        let (mut skeleton, _) = go_on(&anew, old, &twins, &prototype, &self.config.shape);
        // Twigs, and with them the pipes, follow from how far the branches reach.
        assign_radii(&mut skeleton, &model.outline_at_rest, self.config);
        model.names = self.prior.names;
        for (node, twin) in skeleton.nodes.iter_mut().zip(&twins) {
            let known = twin.and_then(|t| old.name_of(t.old));
            node.name = known.unwrap_or(NodeName(model.names));
            model.names += u32::from(known.is_none());
        }
        model.kept = matches.iter().flatten().count();
        model.joined = self.inherited(model, &matches);
        model.plain = Arc::new(skeleton);
        model.skeleton = model.plain.clone();
        model.turns = self.prior.turns.clone();
        model.first = self.prior.first;
        model.refinements = self.prior.refinements + 1;
    }

    /// The prior node of every measured node: foot and trunk go on in any case, the others as most
    /// of their points do.
    fn match_measured_nodes(&self, model: &Model) -> Vec<Option<Twin>> {
        let skeleton = &self.prior.plain;
        let mut old: Vec<Vec<TrackId>> = vec![Vec::new(); skeleton.measured()];
        for (id, (node, _)) in &self.bound {
            for n in upwards(skeleton, *node) {
                old[n as usize].push(*id);
            }
        }
        let clusters = &model.hierarchy.clusters;
        let new: Vec<&Vec<TrackId>> = clusters.iter().map(|c| &c.members).collect();
        let mut out: Vec<Option<Twin>> = vec![None; new.len() + 1];
        out[0] = Some(Twin {
            old: NodeId(0),
            moved_px: Vector2::zeros(),
        });
        // Node 1 is the trunk, and belongs to the cluster of all points.
        let above_old: Vec<Vec<TrackId>> = old.iter().skip(2).cloned().collect();
        let above_new: Vec<Vec<TrackId>> = new.iter().skip(1).map(|&m| m.clone()).collect();
        let mut matches = vec![(1, 0)];
        for (k, i) in hierarchy::persisting(&above_old, &above_new)
            .iter()
            .enumerate()
        {
            if let Some(i) = i {
                matches.push((i + 2, k + 1));
            }
        }
        for (node, cluster) in matches.into_iter().filter(|(node, _)| *node < old.len()) {
            out[cluster + 1] = Some(Twin {
                old: NodeId(node as u32),
                moved_px: self.moved_px(model, &old[node], new[cluster]),
            });
        }
        out
    }

    /// By how much the rest places of the points that `old` and `new` share have moved, px.
    fn moved_px(&self, model: &Model, old: &[TrackId], new: &[TrackId]) -> Vector2<f64> {
        let old: BTreeSet<TrackId> = old.iter().copied().collect();
        let (mut du_px, mut dv_px) = (Vec::new(), Vec::new());
        for id in new.iter().filter(|id| old.contains(id)) {
            if let (Some((_, was)), Some(is)) = (self.bound.get(id), model.rest_px.get(id)) {
                du_px.push(is.x - was.x);
                dv_px.push(is.y - was.y);
            }
        }
        Vector2::from([du_px, dv_px].map(|d| median(d, f64::total_cmp).unwrap_or(0.0)))
    }

    /// Tracks that the new tree was not built from, on the branch that theirs has become or grows
    /// from: lost ones, whose frames keep their rows, and young ones.
    fn inherited(
        &self,
        model: &Model,
        matches: &[Option<Twin>],
    ) -> BTreeMap<TrackId, (NodeId, Point2<f64>)> {
        let old = &self.prior.plain;
        let mut goes_on = vec![None; old.measured()];
        for (k, twin) in matches.iter().enumerate() {
            if let Some(twin) = twin {
                goes_on[twin.old.index()] = Some(NodeId(k as u32));
            }
        }
        let in_tree = model.hierarchy.members();
        let judged = self.judged();
        let mut out = BTreeMap::new();
        for (id, (node, rest_px)) in &self.bound {
            if in_tree.contains(id) || judged.contains(id) {
                continue;
            }
            let chain = upwards(old, *node);
            let node = chain.iter().rev().find_map(|n| goes_on[*n as usize]);
            if let Some(node) = node {
                out.insert(*id, (node, *rest_px));
            }
        }
        out
    }

    /// The tracks that were seen for long enough to be judged by their own motion.
    fn judged(&self) -> BTreeSet<TrackId> {
        let frames = self.table.times_s.len() as f64;
        let mut out = BTreeSet::new();
        for (id, places) in self.table.ids.iter().zip(&self.table.positions) {
            if places.iter().flatten().count() as f64 >= SEEN_SHARE * frames {
                out.insert(*id);
            }
        }
        out
    }
}

/// Which points are on which branch.
fn points_of(branches: &[SubBranch]) -> BTreeSet<(NodeId, Vec<TrackId>)> {
    branches.iter().map(|b| (b.on, b.members.clone())).collect()
}

fn members_of(branches: &[SubBranch]) -> Vec<Vec<TrackId>> {
    branches.iter().map(|b| b.members.clone()).collect()
}

/// The node and those below it down to the trunk's top, from there up; the foot carries all and
/// says nothing.
fn upwards(skeleton: &Skeleton, node: NodeId) -> Vec<u32> {
    let mut chain = vec![node.0];
    let mut at = skeleton.nodes.get(node.index());
    while let Some(parent) = at.and_then(|n| n.parent).filter(|p| p.0 > 0) {
        chain.push(parent.0);
        at = skeleton.nodes.get(parent.index());
    }
    chain.reverse();
    chain
}

/// Nodes from the trunk up to the one that a track is on, in a tree that was just built.
fn chain_of(model: &Model, id: TrackId) -> Vec<u32> {
    let clusters = model.hierarchy.clusters.iter().enumerate();
    clusters
        .filter(|(_, c)| c.members.binary_search(&id).is_ok())
        .map(|(k, _)| k as u32)
        .collect()
}

//! The tree once more, from what has been seen since: who is who, and whether it is better.

use super::back::Live;
use super::{Moment, Shoot, Tree, build, shoots, thicken};
use crate::cancel::CancelToken;
use crate::config::Config;
use crate::hierarchy::{self, Evidence, Gain, OnBoth, TrackHistory};
use crate::model::{MotionHierarchy, NodeId, NodeName, Skeleton, TrackId, TrackTable};
use crate::shape::{Prototype, Twin, go_on, on_foot, twins};
use crate::signal::median;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A point seen in less than this share of the remembered frames stays with the branch that it was
/// found on: it has been seen too briefly to be judged by its own motion.
const SEEN_SHARE: f64 = 0.5;
/// A tree that is worse by more than so many standard errors is not taken. One that only seems
/// worse is, as it has seen more.
const ERRORS: f64 = 2.0;

/// All that a refinement needs, apart from everything that goes on meanwhile: it can be done on any
/// thread.
pub struct Refinement {
    table: Arc<TrackTable>,
    standing: Arc<Tree>,
    /// Every track that the standing tree knows, with its deepest node that is no shoot and its
    /// rest place, px.
    bound: BTreeMap<TrackId, (NodeId, [f64; 2])>,
    config: Config,
    moment: Moment,
}

impl Refinement {
    /// Of a standing tree, from what is remembered; `None` where nothing is.
    pub(super) fn of(history: &TrackHistory, live: &Live, config: &Config) -> Option<Self> {
        let moment = Moment::of(history, false)?;
        let table = Arc::new(history.table(1.0 / hierarchy::COMPARE_HZ));
        let (standing, binding) = (&live.tree, &live.poser.binding);
        let measured = standing.plain.measured();
        let carrier = |node: NodeId| {
            node.index()
                .checked_sub(measured)
                .map_or(node, |k| standing.shoots[k].on)
        };
        let bound = binding
            .bound()
            .map(|(id, node, rest_px)| (id, (carrier(node), rest_px)))
            .collect();
        Some(Self {
            table,
            standing: standing.clone(),
            bound,
            config: config.clone(),
            moment,
        })
    }

    /// Number of points that it is made from: its time grows with their square.
    pub fn points(&self) -> usize {
        self.table.ids.len()
    }

    /// The new tree in the old one's names and place, if it is the better one.
    ///
    /// It is taken if the motion seen is enough for a build of its own (else a calm spell would
    /// undo what wind has shown), and if it is not worse than the old one by more than chance. Each
    /// of them is held against what both were built from: on its own evidence any tree looks good.
    pub fn run(&self) -> Option<Tree> {
        self.run_while(&CancelToken::new())
    }

    /// The same; where `cancel` ends it before, nobody waits for what it gives.
    pub fn run_while(&self, cancel: &CancelToken) -> Option<Tree> {
        let evidence = self.evidence()?;
        let (frame, measure) = (self.moment.frame, evidence.measure);
        let mut tree = build(
            &self.table,
            evidence,
            &self.standing.outline,
            &self.config,
            self.moment,
        )?;
        let (before, since) = (
            self.gain(&self.standing.table, &tree),
            self.gain(&self.table, &tree),
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
            return self.with_other_shoots(cancel);
        }
        self.adopt(&mut tree);
        let binding = tree.binding();
        let shoots = shoots::told(
            &self.table,
            &tree.plain,
            |id| binding.node_of(id),
            &self.config.dynamics,
            cancel,
        );
        self.shoot(&mut tree, shoots);
        Some(tree)
    }

    /// The standing tree with the shoots that are told by now, if they are others, and enough
    /// motion is seen; not if `cancel` ends it before.
    pub(super) fn shoots_while(&self, cancel: &CancelToken) -> Option<Tree> {
        self.evidence()?;
        self.with_other_shoots(cancel)
    }

    /// The motion seen, if it is enough for a build of its own.
    fn evidence(&self) -> Option<Evidence> {
        let evidence = hierarchy::evidence(&self.table, &self.config.accumulate);
        let enough = self
            .config
            .accumulate
            .threshold
            .min(self.standing.evidence.measure);
        let (frame, measure) = (self.moment.frame, evidence.measure);
        if measure < enough {
            tracing::debug!(frame, measure, enough, "no refinement: too little motion");
        }
        (measure >= enough).then_some(evidence)
    }

    fn with_other_shoots(&self, cancel: &CancelToken) -> Option<Tree> {
        let standing = &*self.standing;
        let node_of = |id: TrackId| Some(self.bound.get(&id)?.0);
        let shoots = shoots::told(
            &self.table,
            &standing.plain,
            node_of,
            &self.config.dynamics,
            cancel,
        );
        let points = |all: &[Shoot]| {
            all.iter()
                .map(|s| (s.on, s.members.clone()))
                .collect::<BTreeSet<_>>()
        };
        if cancel.is_cancelled() || points(&shoots) == points(&standing.shoots) {
            return None;
        }
        let mut tree = standing.clone();
        let Moment {
            followed_from,
            frame,
            time_s,
            forced: _,
        } = self.moment;
        (tree.followed_from, tree.frame, tree.time_s) = (followed_from, frame, time_s);
        (tree.refinements, tree.kept) = (standing.refinements + 1, standing.plain.measured());
        // What came after it was built stays where it was put meanwhile, and off the tree if it was
        // put nowhere.
        let known = members(&standing.hierarchy, 0);
        let later = self.bound.iter().filter(|(id, _)| !known.contains(id));
        tree.inherited = later.map(|(id, on)| (*id, *on)).collect();
        for (row, id) in self.table.ids.iter().enumerate() {
            tree.rest_px
                .entry(*id)
                .or_insert_with(|| hierarchy::rest_position_px(&self.table, row));
        }
        self.shoot(&mut tree, shoots);
        Some(tree)
    }

    /// Puts `shoots` on `tree`. Those that the standing tree has on the same branch keep their
    /// names and ends, and its tips that fork their forks; on another branch, or as what a tip goes
    /// on as, one would jump.
    fn shoot(&self, tree: &mut Tree, mut shoots: Vec<Shoot>) {
        let standing = &*self.standing;
        let points = |all: &[Shoot]| all.iter().map(|s| s.members.clone()).collect::<Vec<_>>();
        let before = hierarchy::persisting(&points(&standing.shoots), &points(&shoots));
        for (shoot, before) in shoots.iter_mut().zip(before) {
            let (on, goes_on) = (tree.plain.name_of(shoot.on), shoot.end_px.is_none());
            let same = |s: &&Shoot| standing.plain.name_of(s.on) == on;
            let forked = standing
                .shoots
                .iter()
                .filter(same)
                .map(|s| s.fork)
                .find(|f| *f < 1.0);
            shoot.fork = forked.filter(|_| shoot.fork < 1.0).unwrap_or(shoot.fork);
            match before
                .map(|i| &standing.shoots[i])
                .filter(same)
                .filter(|b| b.end_px.is_none() == goes_on)
            {
                Some(before) => (shoot.name, shoot.end_px) = (before.name, before.end_px),
                None => {
                    shoot.name = NodeName(tree.names);
                    tree.names += 1;
                }
            }
        }
        tree.shoot(shoots, &self.config);
    }

    /// How much better `new` is borne out by the motion in `table`, by the points that both trees
    /// know.
    fn gain(&self, table: &TrackTable, new: &Tree) -> Gain {
        let known = members(&new.hierarchy, 0);
        let on_both = |(row, id): (usize, &TrackId)| {
            let (node, _) = self.bound.get(id).filter(|_| known.contains(id))?;
            Some(OnBoth {
                row,
                old: upwards(&self.standing.plain, *node),
                new: chain_of(new, *id),
            })
        };
        let points: Vec<OnBoth> = table.ids.iter().enumerate().filter_map(on_both).collect();
        hierarchy::gain(table, &points)
    }

    /// Names, places and lost tracks go over from the standing tree.
    fn adopt(&self, tree: &mut Tree) {
        let old = &self.standing.plain;
        let measured = self.measured_twins(tree);
        let anew = on_foot((*tree.plain).clone(), old.foot_px);
        let twins = twins(&anew, old, &measured);
        let (flat, tracks) = tree.flat_on(old.foot_px, &self.config);
        let prototype = Prototype::of(&flat, &tracks, &tree.outline, &self.config.shape);
        let (mut skeleton, _) = go_on(&anew, old, &twins, &prototype, &self.config.shape);
        // Twigs, and with them the pipes, follow from how far the branches reach.
        thicken(&mut skeleton, &tree.outline, &self.config);
        let mut names = self.standing.names;
        for (node, twin) in skeleton.nodes.iter_mut().zip(&twins) {
            node.name = twin.and_then(|t| old.name_of(t.old)).unwrap_or_else(|| {
                names += 1;
                NodeName(names - 1)
            });
        }
        tree.names = names;
        tree.kept = measured.iter().flatten().count();
        tree.inherited = self.inherited(tree, &measured);
        tree.plain = Arc::new(skeleton);
        tree.skeleton = tree.plain.clone();
        (tree.first, tree.refinements) = (self.standing.first, self.standing.refinements + 1);
    }

    /// The twin of every measured node: foot and trunk go on in any case, the others as most of
    /// their points do.
    fn measured_twins(&self, tree: &Tree) -> Vec<Option<Twin>> {
        let skeleton = &self.standing.plain;
        let mut old: Vec<Vec<TrackId>> = vec![Vec::new(); skeleton.measured()];
        for (id, (node, _)) in &self.bound {
            upwards(skeleton, *node)
                .into_iter()
                .for_each(|n| old[n as usize].push(*id));
        }
        let new: Vec<&Vec<TrackId>> = tree.hierarchy.clusters.iter().map(|c| &c.members).collect();
        let above = |groups: &[Vec<TrackId>]| groups.iter().skip(1).cloned().collect::<Vec<_>>();
        let of = hierarchy::persisting(
            &above(&old[1..]),
            &new.iter()
                .skip(1)
                .map(|members| (*members).clone())
                .collect::<Vec<_>>(),
        );
        let foot = Twin {
            old: NodeId(0),
            moved_px: [0.0; 2],
        };
        let trunk = [(1usize, 0usize)].into_iter();
        let others = of
            .iter()
            .enumerate()
            .filter_map(|(k, i)| Some((i.as_ref()? + 2, k + 1)));
        let mut twins: Vec<Option<Twin>> = vec![None; new.len() + 1];
        twins[0] = Some(foot);
        for (i, k) in trunk.chain(others).filter(|(i, _)| *i < old.len()) {
            twins[k + 1] = Some(Twin {
                old: NodeId(i as u32),
                moved_px: self.moved_px(tree, &old[i], new[k]),
            });
        }
        twins
    }

    /// By how much the rest places of the points that `old` and `new` share have moved, px.
    fn moved_px(&self, tree: &Tree, old: &[TrackId], new: &[TrackId]) -> [f64; 2] {
        let old: BTreeSet<TrackId> = old.iter().copied().collect();
        let moved: Vec<[f64; 2]> = new
            .iter()
            .filter(|id| old.contains(id))
            .filter_map(|id| {
                let (was, is) = (self.bound.get(id)?.1, tree.rest_px.get(id)?);
                Some([is[0] - was[0], is[1] - was[1]])
            })
            .collect();
        [0, 1].map(|c| median(moved.iter().map(|m| m[c]).collect(), f64::total_cmp).unwrap_or(0.0))
    }

    /// Tracks that the new tree was not built from, on the branch that theirs has become or grows
    /// from: lost ones, whose frames keep their rows, and young ones.
    fn inherited(
        &self,
        tree: &Tree,
        measured: &[Option<Twin>],
    ) -> BTreeMap<TrackId, (NodeId, [f64; 2])> {
        let old = &self.standing.plain;
        let mut goes_on = vec![None; old.measured()];
        for (k, twin) in measured.iter().enumerate() {
            if let Some(twin) = twin {
                goes_on[twin.old.index()] = Some(NodeId(k as u32));
            }
        }
        let in_tree = members(&tree.hierarchy, 0);
        let frames = self.table.times_s.len() as f64;
        let judged: BTreeSet<TrackId> = (0..self.table.ids.len())
            .filter(|&row| {
                self.table.positions[row].iter().flatten().count() as f64 >= SEEN_SHARE * frames
            })
            .map(|row| self.table.ids[row])
            .collect();
        let others = self
            .bound
            .iter()
            .filter(|(id, _)| !in_tree.contains(id) && !judged.contains(id));
        let place = |(id, (node, rest_px)): (&TrackId, &(NodeId, [f64; 2]))| {
            let node = upwards(old, *node)
                .into_iter()
                .rev()
                .find_map(|n| goes_on[n as usize])?;
            Some((*id, (node, *rest_px)))
        };
        others.filter_map(place).collect()
    }
}

fn members(hierarchy: &MotionHierarchy, cluster: usize) -> BTreeSet<TrackId> {
    hierarchy
        .clusters
        .get(cluster)
        .into_iter()
        .flat_map(|c| c.members.iter().copied())
        .collect()
}

/// The node and those below it down to the trunk's top, from there up; the foot carries all and
/// says nothing.
fn upwards(skeleton: &Skeleton, node: NodeId) -> Vec<u32> {
    let below = |n: &NodeId| {
        skeleton
            .nodes
            .get(n.index())
            .and_then(|n| n.parent)
            .filter(|p| p.0 > 0)
    };
    let mut chain: Vec<u32> = std::iter::successors(Some(node), below)
        .map(|n| n.0)
        .collect();
    chain.reverse();
    chain
}

/// Nodes from the trunk up to the one that a track is on, in a tree that was just built.
fn chain_of(tree: &Tree, id: TrackId) -> Vec<u32> {
    let clusters = tree.hierarchy.clusters.iter().enumerate();
    clusters
        .filter(|(_, c)| c.members.binary_search(&id).is_ok())
        .map(|(k, _)| k as u32)
        .collect()
}

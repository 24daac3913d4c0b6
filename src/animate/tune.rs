//! The frequency and damping of every branch: what was measured, and for the others what they are
//! likely to have.

use super::known::Known;
use crate::bounds::Bounds;
use crate::config;
use crate::model::{NodeId, Skeleton};

/// What can be a frequency of a branch, Hz, and a damping ratio.
const FREQUENCIES_HZ: Bounds = Bounds::new(0.01, 50.0);
const DAMPING: Bounds = Bounds::new(0.001, 1.0);
/// One that was not measured is not higher than this, Hz, nor than so many times the trunk's.
const HIGHEST_HZ: f64 = 8.0;
const HIGHEST_BY_TRUNK: f64 = 12.0;
const LOWEST_BY_TRUNK: f64 = 0.3;
/// Branches whose thickness differs by this factor are as unlike as those a level apart.
const LEVEL_BY_THICKNESS: f64 = 1.4;
/// What a branch carries does not reach less far than this share of the tree's height: radii of
/// stubs are no measure.
const SHORTEST: f64 = 0.03;

/// How one branch sways against the one that carries it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Undamped natural frequency, Hz.
    pub frequency_hz: f64,
    pub damping_ratio: f64,
    /// Whether the frequency was measured.
    pub measured: bool,
}

/// The tuning of every node of the skeleton, by its index. `known` is by node index and may be
/// shorter. What moves with another node has the tuning of that.
///
/// A measured branch keeps what was measured, and a copy has its original's. For the others the
/// logarithm of the frequency is that of a rod, `f ~ sqrt(r) / l` with the radius r and the reach l
/// of what it carries, moved by as much as the measured branches are off that rule: their mean,
/// weighed by likeness in level and thickness. Where nothing was measured the trunk sways with
/// `settings.trunk_hz`.
pub fn tune(skeleton: &Skeleton, known: &[Known], settings: &config::Wind) -> Vec<Tuning> {
    let nodes = &skeleton.nodes;
    if nodes.is_empty() {
        return Vec::new();
    }
    let tuner = Tuner::new(skeleton, known, settings);
    let trunk_hz = tuner
        .measured_hz(tuner.trunk)
        .unwrap_or_else(|| tuner.likely_hz(tuner.trunk))
        .clamp(FREQUENCIES_HZ.lo, HIGHEST_HZ);
    let mut out: Vec<Tuning> = Vec::with_capacity(nodes.len());
    for (i, node) in nodes.iter().enumerate() {
        let original = node.copy_of.and_then(|o| out.get(o.index()).copied());
        out.push(original.unwrap_or_else(|| tuner.tuning(i, trunk_hz)));
    }
    for i in 0..nodes.len() {
        out[i] = out[skeleton.mover(NodeId(i as u32)).index()];
    }
    out
}

/// What was measured of a tree and what follows from it for its other branches.
struct Tuner<'a> {
    skeleton: &'a Skeleton,
    known: &'a [Known],
    settings: &'a config::Wind,
    /// Logarithm of the rule's frequency for every node.
    rods: Vec<f64>,
    /// The node that the first branch ends in.
    trunk: usize,
    /// Each measured branch with the logarithm of its frequency over the rule's.
    off_rule: Vec<(usize, f64)>,
    /// Each branch with a measured damping ratio, and its logarithm.
    damped: Vec<(usize, f64)>,
}

impl<'a> Tuner<'a> {
    fn new(skeleton: &'a Skeleton, known: &'a [Known], settings: &'a config::Wind) -> Self {
        let nodes = &skeleton.nodes;
        let mut tuner = Self {
            skeleton,
            known,
            settings,
            rods: rods(skeleton),
            trunk: trunk(skeleton).index(),
            off_rule: Vec::new(),
            damped: Vec::new(),
        };
        for i in 0..nodes.len() {
            if let Some(frequency_hz) = tuner.measured_hz(i) {
                let off = frequency_hz.ln() - tuner.rods[i];
                tuner.off_rule.push((i, off));
            }
            if let Some(damping_ratio) = tuner.measured_damping(i) {
                tuner.damped.push((i, damping_ratio.ln()));
            }
        }
        tuner
    }

    /// What was measured on a branch itself: nothing on a copy, the foot, or what moves with
    /// another node.
    fn measured(&self, i: usize) -> Known {
        let node = &self.skeleton.nodes[i];
        let moves = self.skeleton.mover(NodeId(i as u32)).index() == i;
        if node.copy_of.is_some() || node.parent.is_none() || !moves {
            return Known::default();
        }
        self.known.get(i).copied().unwrap_or_default()
    }

    fn measured_hz(&self, i: usize) -> Option<f64> {
        self.measured(i)
            .frequency_hz
            .filter(|f| FREQUENCIES_HZ.contains(*f))
    }

    fn measured_damping(&self, i: usize) -> Option<f64> {
        self.measured(i)
            .damping_ratio
            .filter(|d| d.is_finite() && *d > 0.0)
    }

    /// Thickness in steps that make branches as unlike as a level does.
    fn thickness(&self, i: usize) -> f64 {
        self.skeleton.nodes[i].radius.max(1e-3).ln() / LEVEL_BY_THICKNESS.ln()
    }

    /// How much branch `j` says about branch `i`, by likeness in level and thickness.
    fn weight(&self, i: usize, j: usize) -> f64 {
        let nodes = &self.skeleton.nodes;
        let levels = f64::from(nodes[i].level) - f64::from(nodes[j].level);
        let apart = levels * levels + (self.thickness(i) - self.thickness(j)).powi(2);
        (0.5 + apart).powi(-2)
    }

    /// Weighted mean of values measured on other branches; `otherwise` where there is none.
    fn mean_for(&self, i: usize, values: &[(usize, f64)], otherwise: f64) -> f64 {
        let (mut sum, mut weights) = (0.0, 0.0);
        for &(j, value) in values {
            let weight = self.weight(i, j);
            sum += weight * value;
            weights += weight;
        }
        if weights > 0.0 {
            sum / weights
        } else {
            otherwise
        }
    }

    /// By the rule of rods, moved by what the measured branches are off it.
    fn likely_hz(&self, i: usize) -> f64 {
        let by_trunk = self.settings.trunk_hz.ln() - self.rods[self.trunk];
        (self.rods[i] + self.mean_for(i, &self.off_rule, by_trunk)).exp()
    }

    /// The tuning of a branch that is no copy.
    fn tuning(&self, i: usize, trunk_hz: f64) -> Tuning {
        let measured_hz = self.measured_hz(i);
        let frequency_hz = measured_hz.unwrap_or_else(|| {
            let high = HIGHEST_HZ.min(HIGHEST_BY_TRUNK * trunk_hz);
            self.likely_hz(i)
                .clamp(LOWEST_BY_TRUNK * trunk_hz.min(high), high)
        });
        let damping_ratio = self.measured_damping(i).unwrap_or_else(|| {
            let otherwise = self.settings.damping_ratio.ln();
            self.mean_for(i, &self.damped, otherwise).exp()
        });
        Tuning {
            frequency_hz,
            damping_ratio: DAMPING.clamp(damping_ratio),
            measured: measured_hz.is_some(),
        }
    }
}

/// The node that the first branch ends in; the foot where there is none.
fn trunk(skeleton: &Skeleton) -> NodeId {
    let first = skeleton.nodes.iter().position(|n| n.parent.is_some());
    skeleton.mover(NodeId(first.unwrap_or(0) as u32))
}

/// The logarithm of `sqrt(r) / l` for every node.
fn rods(skeleton: &Skeleton) -> Vec<f64> {
    let nodes = &skeleton.nodes;
    let mut reach = vec![0.0f64; nodes.len()];
    for i in (0..nodes.len()).rev() {
        let Some(p) = nodes[i].parent.map(|p| p.index()).filter(|&p| p < i) else {
            continue;
        };
        let length = (nodes[i].position - nodes[p].position).norm();
        // Here from its base: its own length and what goes on from its end.
        reach[i] += if length.is_finite() { length } else { 0.0 };
        reach[p] = reach[p].max(reach[i]);
    }
    for branch in skeleton.moving_branches() {
        // Of a branch from where it begins, by whichever of its parts goes on farthest.
        let from_base = |n: &NodeId| nodes[n.index()].parent == Some(branch.begin);
        let farthest = branch.parts().filter(from_base).map(|n| reach[n.index()]);
        reach[branch.node.index()] = farthest.fold(0.0, f64::max);
    }
    let height = nodes
        .iter()
        .map(|n| n.position.y)
        .filter(|y| y.is_finite())
        .fold(1.0, f64::max);
    let mut rods = Vec::with_capacity(nodes.len());
    for (node, reach) in nodes.iter().zip(&reach) {
        let radius = if node.radius.is_finite() {
            node.radius.max(1e-3)
        } else {
            1.0
        };
        rods.push(0.5 * radius.ln() - reach.max(SHORTEST * height).ln());
    }
    rods
}

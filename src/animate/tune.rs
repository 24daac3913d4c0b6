//! The frequency and damping of every branch: what was measured, and for the others what they are
//! likely to have.

use super::known::Known;
use crate::config;
use crate::model::Skeleton;

/// What can be a frequency of a branch, Hz, and a damping ratio.
const FREQUENCIES_HZ: (f64, f64) = (0.01, 50.0);
const DAMPING: (f64, f64) = (0.001, 1.0);
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
/// shorter.
///
/// A measured branch keeps what was measured, and a copy has its original's. For the others the
/// logarithm of the frequency is that of a rod, `f ~ sqrt(r) / l` with the radius r and the reach l
/// of what it carries, moved by as much as the measured branches are off that rule: their mean,
/// weighed by likeness in level and thickness. Where nothing was measured the trunk sways with
/// `settings.trunk_hz`.
pub fn tune(skeleton: &Skeleton, known: &[Known], settings: &config::Wind) -> Vec<Tuning> {
    let nodes = &skeleton.nodes;
    let rods = rods(skeleton);
    let thickness = |i: usize| nodes[i].radius.max(1e-3).ln() / LEVEL_BY_THICKNESS.ln();
    let within = |x: f64, (low, high): (f64, f64)| x.is_finite() && (low..=high).contains(&x);
    let of = |i: usize| known.get(i).copied().unwrap_or_default();
    let own = |i: usize| nodes[i].copy_of.is_none() && nodes[i].parent.is_some();
    let frequency = |i: usize| {
        of(i)
            .frequency_hz
            .filter(|f| own(i) && within(*f, FREQUENCIES_HZ))
    };
    let damping = |i: usize| {
        of(i)
            .damping_ratio
            .filter(|d| own(i) && d.is_finite() && *d > 0.0)
    };
    let off: Vec<(usize, f64)> = (0..nodes.len())
        .filter_map(|i| Some((i, frequency(i)?.ln() - rods[i])))
        .collect();
    let damped: Vec<(usize, f64)> = (0..nodes.len())
        .filter_map(|i| Some((i, damping(i)?.ln())))
        .collect();
    let likely = |i: usize, from: &[(usize, f64)], else_: f64| {
        let weight = |j: usize| {
            let levels = f64::from(nodes[i].level) - f64::from(nodes[j].level);
            let apart = levels * levels + (thickness(i) - thickness(j)).powi(2);
            (0.5 + apart).powi(-2)
        };
        let (sum, all) = from.iter().fold((0.0, 0.0), |(s, w), &(j, x)| {
            (s + weight(j) * x, w + weight(j))
        });
        if all > 0.0 { sum / all } else { else_ }
    };
    let trunk = nodes.iter().position(|n| n.parent.is_some()).unwrap_or(0);
    let untold = settings.trunk_hz.ln() - rods.get(trunk).copied().unwrap_or(0.0);
    let guessed = |i: usize| (rods[i] + likely(i, &off, untold)).exp();
    let base = frequency(trunk).unwrap_or_else(|| {
        if nodes.is_empty() {
            1.0
        } else {
            guessed(trunk)
        }
    });
    let base = base.clamp(FREQUENCIES_HZ.0, HIGHEST_HZ);
    let mut out: Vec<Tuning> = Vec::with_capacity(nodes.len());
    for (i, node) in nodes.iter().enumerate() {
        let original = node.copy_of.and_then(|o| out.get(o.index()).copied());
        let tuning = original.unwrap_or_else(|| Tuning {
            frequency_hz: frequency(i).unwrap_or_else(|| {
                let high = HIGHEST_HZ.min(HIGHEST_BY_TRUNK * base);
                guessed(i).clamp(LOWEST_BY_TRUNK * base.min(high), high)
            }),
            damping_ratio: damping(i)
                .unwrap_or_else(|| likely(i, &damped, settings.damping_ratio.ln()).exp())
                .clamp(DAMPING.0, DAMPING.1),
            measured: frequency(i).is_some(),
        });
        out.push(tuning);
    }
    out
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
    let height = nodes
        .iter()
        .map(|n| n.position.y)
        .filter(|y| y.is_finite())
        .fold(1.0, f64::max);
    let rod = |(node, reach): (&crate::model::Node, &f64)| {
        let radius = if node.radius.is_finite() {
            node.radius.max(1e-3)
        } else {
            1.0
        };
        0.5 * radius.ln() - reach.max(SHORTEST * height).ln()
    };
    nodes.iter().zip(&reach).map(rod).collect()
}

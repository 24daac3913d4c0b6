//! Chains: limbs that go on in one another, drawn as one tube without a seam.

use crate::model::FARTHEST_PX;
use crate::shape::{CenterlineSample, Limb};
use nalgebra::Vector3;

/// Edges along a tube are at most so many times as long as those around it.
const LONGEST_EDGE: f64 = 6.0;
/// Turn from which on a joint gets more than one ring, and from one ring to the next there,
/// radians.
const FLATTENS: f64 = 0.6;
const FAN_STEP: f64 = 0.4;

/// One limb's share of a chain.
#[derive(Clone, Debug)]
pub(super) struct Link<'a> {
    pub samples: &'a [CenterlineSample],
    /// Rings that it needs at density 1.
    need: f64,
    is_twig: bool,
    pub made_up: bool,
}

/// From the base of a limb over those that it goes on in to a tip.
#[derive(Clone, Debug)]
pub(super) struct Chain<'a> {
    pub links: Vec<Link<'a>>,
    /// Length of the longest twig of the chain and of what it carries, px; infinite if a branch of
    /// the skeleton is there.
    pub size_px: f64,
    /// Radius of what it grows from where it does, px; `None` for what stands on the ground.
    pub grows_from_px: Option<f64>,
}

impl Link<'_> {
    /// Rings along the link, without that of its base.
    pub fn rings(&self, density: f64) -> usize {
        // Where a skin bends, twigs must not float beside it.
        let least = if self.is_twig { 1 } else { 3 };
        ((self.need * density).round() as usize).clamp(least, 20_000)
    }

    /// Rings at the joint to `next`: from a sharp turn on a fan of them about one point, which
    /// rounds the elbow like a ball; a single ring half way would squeeze the tube flat. Twigs are
    /// too thin to show it.
    pub fn rings_to(&self, next: &Self) -> usize {
        let turn = self.at(1.0).1.angle(&next.at(0.0).1);
        if self.is_twig || next.is_twig || turn < FLATTENS {
            1
        } else {
            2 + (turn / FAN_STEP) as usize
        }
    }

    /// The sample at share `t` of the link, 0 to 1, and the direction there: a cubic through the
    /// samples, whose slopes are those of their neighbours.
    pub fn at(&self, t: f64) -> (CenterlineSample, Vector3<f64>) {
        let s = self.samples;
        let place = t.clamp(0.0, 1.0) * (s.len() - 1) as f64;
        let k = (place as usize).min(s.len() - 2);
        let (a, b, x) = (&s[k], &s[k + 1], place - k as f64);
        let chord = b.at - a.at;
        let (m0, m1) = (slope(s, k), slope(s, k + 1));
        let (x2, x3) = (x * x, x * x * x);
        let at = a.at + m0 * (x3 - 2.0 * x2 + x) + chord * (3.0 * x2 - 2.0 * x3) + m1 * (x3 - x2);
        let way =
            m0 * (3.0 * x2 - 4.0 * x + 1.0) + chord * (6.0 * (x - x2)) + m1 * (3.0 * x2 - 2.0 * x);
        let way = way
            .try_normalize(1e-12)
            .or(chord.try_normalize(1e-12))
            .unwrap_or_else(Vector3::y);
        let radius = a.radius + (b.radius - a.radius) * x;
        (
            CenterlineSample {
                at,
                radius,
                skin: a.skin.towards(b.skin, x as f32),
            },
            way,
        )
    }
}

/// Slope of the curve through `samples` at sample `i`, px a sample: half the way between its
/// neighbours. At the ends the one that makes the curvature go on evenly, so that straight stays
/// straight.
fn slope(samples: &[CenterlineSample], i: usize) -> Vector3<f64> {
    let (last, at) = (samples.len() - 1, samples[i].at);
    if samples.len() == 2 {
        samples[1].at - samples[0].at
    } else if i == 0 {
        (samples[1].at - at) * 2.0 - (samples[2].at - at) * 0.5
    } else if i == last {
        (at - samples[i - 1].at) * 2.0 - (at - samples[i - 2].at) * 0.5
    } else {
        (samples[i + 1].at - samples[i - 1].at) * 0.5
    }
}

/// How finely a tube of `radius` px must be divided around at density 1, not rounded.
pub(super) fn sides(radius: f64) -> f64 {
    std::f64::consts::PI * (0.5 * radius).sqrt()
}

/// Puts the limbs together to chains, each limb in one; those without length or with what is no
/// number are left out.
pub(super) fn chains(limbs: &[Limb]) -> Vec<Chain<'_>> {
    let good: Vec<bool> = limbs.iter().map(is_good).collect();
    let goes_on = continuations(limbs);
    let mut size_px: Vec<f64> = limbs
        .iter()
        .map(|l| if l.twig { l.length() } else { f64::INFINITY })
        .collect();
    for (i, limb) in limbs.iter().enumerate().rev() {
        if let Some(p) = limb.parent.filter(|&p| p < i && good[i]) {
            size_px[p] = size_px[p].max(size_px[i]);
        }
    }
    let mut taken = vec![false; limbs.len()];
    let mut out = Vec::new();
    for first in 0..limbs.len() {
        let (mut at, mut links) = (Some(first).filter(|&i| good[i]), Vec::new());
        while let Some(i) = at.filter(|&i| !taken[i]) {
            taken[i] = true;
            links.push(link(&limbs[i]));
            at = goes_on[i];
        }
        if !links.is_empty() {
            let parent = limbs[first].parent.filter(|&p| p < first && good[p]);
            let grows_from_px = parent.and_then(|p| radius_near(&limbs[p], &limbs[first]));
            out.push(Chain {
                links,
                size_px: size_px[first],
                grows_from_px,
            });
        }
    }
    out
}

/// The limb that every limb goes on in: of those that leave its end the thickest, and of those
/// alike the straightest.
pub(super) fn continuations(limbs: &[Limb]) -> Vec<Option<usize>> {
    let good: Vec<bool> = limbs.iter().map(is_good).collect();
    let mut best: Vec<Option<(f64, usize)>> = vec![None; limbs.len()];
    for (i, limb) in limbs.iter().enumerate().filter(|(i, _)| good[*i]) {
        let Some(p) = limb.parent.filter(|&p| p < i && good[p]) else {
            continue;
        };
        let (Some(end), base) = (limbs[p].samples.last(), &limb.samples[0]) else {
            continue;
        };
        let score = base.radius * (2.0 + limbs[p].arrives().dot(&limb.departs()));
        let at_end = (end.at - base.at).norm() <= 1e-9 * (1.0 + end.at.coords.norm());
        if at_end && best[p].is_none_or(|(most, _)| score > most) {
            best[p] = Some((score, i));
        }
    }
    best.into_iter().map(|b| b.map(|(_, k)| k)).collect()
}

fn is_good(limb: &Limb) -> bool {
    limb.samples.len() >= 2
        && limb.samples.iter().all(is_sound)
        && limb.samples.iter().any(|s| s.radius > 1e-6)
        && limb.length() > 1e-6
}

fn is_sound(sample: &CenterlineSample) -> bool {
    sample.at.iter().all(|x| x.abs() <= 2.0 * FARTHEST_PX)
        && (0.0..=FARTHEST_PX).contains(&sample.radius)
}

/// Radius of `parent` at the sample next to the base of `limb`.
fn radius_near(parent: &Limb, limb: &Limb) -> Option<f64> {
    let base = limb.samples.first()?.at;
    parent
        .samples
        .iter()
        .map(|s| ((s.at - base).norm_squared(), s.radius))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, radius)| radius)
}

fn link(limb: &Limb) -> Link<'_> {
    let s = &limb.samples;
    let mut need = 0.0;
    let mut before: Option<Vector3<f64>> = None;
    for pair in s.windows(2) {
        let step = pair[1].at - pair[0].at;
        let Some(way) = step.try_normalize(1e-9) else {
            continue;
        };
        // A bow of curvature k and length l told in n straight pieces is off by k l^2 / (8 n^2).
        let bend = before.map_or(0.0, |b| b.angle(&way));
        need += (bend * step.norm() / 8.0).sqrt();
        let radius = (0.5 * (pair[0].radius + pair[1].radius)).max(1e-6);
        need += step.norm() * sides(radius) / (LONGEST_EDGE * std::f64::consts::TAU * radius);
        before = Some(way);
    }
    Link {
        samples: s,
        need,
        is_twig: limb.twig,
        made_up: limb.made_up,
    }
}

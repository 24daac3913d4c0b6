//! Branches that were captured as one with another, and that their modes tell apart.

use super::super::film::Film;
use super::super::free;
use super::super::sway::{Begun, begun};
use super::{ONE, Reading, told};
use crate::cancel::CancelToken;
use crate::config::Dynamics;
use crate::model::{Excitation, NodeId, Skeleton, Sway};

/// A branch is on the captured one that has this share of its points, and begins with those that
/// are on no branch of that.
const MOST: f64 = 0.75;
const OWN: f64 = 0.6;
/// Points that one must have. Nothing but its mode tells of it, and four agree by chance more often
/// than five.
const FEWEST: usize = 5;

/// A branch of its own on a captured one that is not known to fork there: some of its points have a
/// mode in common that the others have not.
#[derive(Clone, Debug, PartialEq)]
pub struct Shoot {
    /// The captured branch that carries it.
    pub on: NodeId,
    /// Its points, as indices of the film's tracks, in order.
    pub tracks: Vec<usize>,
}

/// The branches that a release shows beyond those of `skeleton`, at most one for every point; none
/// in wind, or where the film carries too little, or where `cancel` ends it before. The one that
/// is clearest by all its points takes them first.
pub fn shoots(
    skeleton: &Skeleton,
    film: &Film,
    config: &Dynamics,
    cancel: &CancelToken,
) -> Vec<Shoot> {
    let Some(Begun {
        members,
        onset,
        demands,
        film,
        ..
    }) = begun(skeleton, film, config)
    else {
        return Vec::new();
    };
    if onset.excitation != Excitation::Release {
        return Vec::new();
    }
    let sways = free::sways(skeleton, &film, &members, &onset, &demands, cancel);
    let Some(mut told) = told(skeleton, &film, &onset, &demands, &sways, cancel) else {
        return Vec::new();
    };
    let mut readings = std::mem::take(&mut told.readings);
    let clearness = |r: &Reading| r.gain * r.points.len() as f64;
    readings.sort_by(|a, b| clearness(b).total_cmp(&clearness(a)));
    let mut taken = vec![false; told.tracks.len()];
    let mut out = Vec::new();
    for reading in &readings {
        let all = reading.points.len() as f64;
        let captured = 1..told.on.len();
        if captured.clone().any(|b| told.alike(b, reading).is_some()) {
            continue;
        }
        let carries = |b: &usize| told.both(*b, reading) as f64 >= MOST * all;
        let Some(on) = captured.filter(carries).min_by_key(|&b| told.on[b].len()) else {
            continue;
        };
        let own = |p: &usize| told.branch_of[*p] == on && !taken[*p];
        let points: Vec<usize> = reading.points.iter().copied().filter(own).collect();
        let carriers =
            std::iter::once(NodeId(on as u32)).chain(skeleton.ancestors(NodeId(on as u32)));
        let known = |s: &Sway| {
            (s.frequency_hz.value / reading.mode.frequency_hz)
                .ln()
                .abs()
                < ONE
        };
        let theirs = carriers
            .filter_map(|b| sways[b.index()].as_ref().ok())
            .any(known);
        if points.len() < FEWEST || (points.len() as f64) < OWN * all || theirs {
            continue;
        }
        points.iter().for_each(|&p| taken[p] = true);
        out.push(Shoot {
            on: NodeId(on as u32),
            tracks: points.iter().map(|&p| told.tracks[p]).collect(),
        });
    }
    out
}

//! Branches told by their modes, after a release.
//!
//! Going down the tree one branch at a time (free.rs) takes the captured tree as it is, and a mode
//! that is told wrongly misleads what is below. Here all points and all modes have their say at
//! once: a point has the modes of the branch that it is on and of those that carry it, and no
//! others; modes are fitted together, points may go to another branch, branches come off others, as
//! long as what the film shows becomes likelier by more than what it costs. What comes out answers
//! for the captured branches that have mostly the same points, and had no answer; and it tells
//! branches that were captured as one with another ([`shoots`]).

mod moves;
mod read;
mod refit;
mod search;
mod shoots;
mod tree;

use super::decay::Mode;
use super::film::Film;
use super::free::{Demands, LEAST_PERIODS, Z, interval};
use super::members::{is_seen, mean_px};
use super::release::Onset;
use super::sway::BELOW_NYQUIST;
use crate::cancel::CancelToken;
use crate::model::{Excitation, NodeId, Skeleton, Sway, Swaying, Unidentified};
use read::Reading;
use search::LEAST;
pub use shoots::{Shoot, shoots};
use tree::{Branch, Decay, Point, Tree};

/// Frames a second that are enough: neighbours are taken together as their mean.
const ENOUGH_HZ: f64 = 15.0;
/// And what comes later after a release says little, s.
const ENOUGH_S: f64 = 20.0;
/// A point must have been seen in this share of the frames.
const SEEN: f64 = 0.8;
/// Damping of a branch whose own is not known.
const DAMPING: f64 = 0.05;
const LEAST_NOISE_PX: f64 = 0.03;
/// A mode is clear if its points gain so much by it, each (but for a quarter of them) and together;
/// if its frequency is known to this standard deviation of the logarithm, and changes by less than
/// this one where some of the points are left out; and if it is damped less than this.
const CLEAR: f64 = 25.0;
const CLEAR_TOGETHER: f64 = 120.0;
const SURE: f64 = 0.009;
const ALIKE: f64 = 0.0045;
const HARDLY: f64 = 0.15;
/// It is a captured branch's own if it is in so much of its points, and so much of the points that
/// have it are on that.
const OF_BRANCH: f64 = 0.75;
const OF_MODE: f64 = 0.6;
/// Frequencies that are no farther apart than this share are one.
const ONE: f64 = 0.012;
/// Intervals are so much wider than the curvature says, and no narrower than these standard
/// deviations. Found on clips of our own (docs/dynamics.md).
const WIDER: f64 = 2.0;
const LEAST_SD: [f64; 2] = [0.003, 0.1];

/// Answers for branches of `sways` that have none, by all points at once.
pub(super) fn answer(
    skeleton: &Skeleton,
    film: &Film,
    onset: &Onset,
    demands: &Demands,
    sways: &mut [Swaying],
    cancel: &CancelToken,
) {
    let open = |sway: &Swaying| {
        matches!(
            sway,
            Err(Unidentified::NoOscillation
                | Unidentified::AncestorsSway
                | Unidentified::TooUncertain)
        )
    };
    if !sways.iter().any(open) {
        return;
    }
    let Some(told) = told(skeleton, film, onset, demands, sways, cancel) else {
        if cancel.is_cancelled() {
            sways
                .iter_mut()
                .filter(|s| open(s))
                .for_each(|s| *s = Err(Unidentified::NotInTime));
        }
        return;
    };
    for b in 2..sways.len() {
        if !open(&sways[b]) {
            continue;
        }
        let above: Vec<f64> = skeleton
            .ancestors(NodeId(b as u32))
            .filter_map(|a| sways[a.index()].as_ref().ok().map(|s| s.frequency_hz.value))
            .collect();
        let fits = |r: &&Reading| {
            let new = above
                .iter()
                .all(|f| (f / r.mode.frequency_hz).ln().abs() >= ONE);
            told.alike(b, r).filter(|_| new)
        };
        let best = told
            .readings
            .iter()
            .filter_map(|r| Some((fits(&r)?, r)))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some(sway) = best.and_then(|(_, r)| sway(r, demands)) {
            sways[b] = Ok(sway);
        }
    }
}

/// What the points say of all branches at once.
struct Told {
    /// The branches that can be told.
    readings: Vec<Reading>,
    /// The points on every captured branch and on what it carries, in order.
    on: Vec<Vec<usize>>,
    /// Of every point: the captured branch that it is on, and its track of the film.
    branch_of: Vec<usize>,
    tracks: Vec<usize>,
}

impl Told {
    /// Points of a reading that are on captured branch `b`.
    fn both(&self, b: usize, reading: &Reading) -> usize {
        reading
            .points
            .iter()
            .filter(|p| self.on[b].binary_search(p).is_ok())
            .count()
    }

    /// How alike the points of a reading and those of captured branch `b` are, 0 to 1, if they are
    /// of one branch.
    fn alike(&self, b: usize, reading: &Reading) -> Option<f64> {
        let both = self.both(b, reading);
        let (here, there) = (self.on[b].len() as f64, reading.points.len() as f64);
        let share = both as f64;
        (both >= LEAST && share >= OF_BRANCH * here && share >= OF_MODE * there)
            .then(|| share / (here + there - share))
    }
}

/// `None` where too little is seen, or `cancel` ends it before.
fn told(
    skeleton: &Skeleton,
    film: &Film,
    onset: &Onset,
    demands: &Demands,
    sways: &[Swaying],
    cancel: &CancelToken,
) -> Option<Told> {
    // All points have the trunk's sway: without it nothing is sure.
    if !sways.get(1).is_some_and(Result::is_ok) {
        return None;
    }
    let (times_s, points, tracks) = thinned(film, onset);
    let span_s = times_s
        .last()
        .zip(times_s.first())
        .map_or(0.0, |(b, a)| b - a);
    if points.len() < LEAST || span_s <= 0.0 {
        return None;
    }
    let rate_hz = (times_s.len() - 1) as f64 / span_s;
    let frequencies_hz = [
        LEAST_PERIODS / span_s,
        (0.5 * BELOW_NYQUIST * rate_hz).min(demands.frequencies_hz[1]),
    ];
    if frequencies_hz[0] >= frequencies_hz[1] {
        return None;
    }
    let decay = Decay::new(times_s, onset.start, frequencies_hz, points);
    let branch_of: Vec<usize> = tracks
        .iter()
        .map(|&k| film.tracks[k].node.index())
        .collect();
    let captured = captured(skeleton, sways, &decay, branch_of.clone());
    let on: Vec<Vec<usize>> = (0..sways.len()).map(|b| captured.all(b)).collect();
    let tree = captured.grown(cancel)?;
    let clear = |r: &Reading| {
        r.gain >= CLEAR
            && r.gain * r.points.len() as f64 >= CLEAR_TOGETHER
            && r.sd[0] <= SURE
            && r.spread <= ALIKE
            && r.mode.damping <= HARDLY
            && r.mode.frequency_hz * span_s > LEAST_PERIODS
            // Films of few frames a second show a fast sway as a slow one.
            && 1.0 / film.step_s() - r.mode.frequency_hz > demands.highest_hz
    };
    let readings = tree.readings().into_iter().filter(clear).collect();
    Some(Told {
        readings,
        on,
        branch_of,
        tracks,
    })
}

fn sway(reading: &Reading, demands: &Demands) -> Option<Sway> {
    let sd = [0, 1].map(|i| (WIDER * reading.sd[i]).hypot(LEAST_SD[i]));
    if Z * sd[0] > demands.widest {
        return None;
    }
    Some(Sway {
        frequency_hz: interval(reading.mode.frequency_hz, sd[0]),
        damping_ratio: (Z * sd[1] <= 1.0).then(|| interval(reading.mode.damping, sd[1])),
        excitation: Excitation::Release,
        amplitude_deg: reading.amplitude_deg,
    })
}

/// The tree as it was captured, with the modes that are known.
fn captured<'a>(
    skeleton: &Skeleton,
    sways: &[Swaying],
    decay: &'a Decay,
    branch_of: Vec<usize>,
) -> Tree<'a> {
    let branch = |(b, sway): (usize, &Swaying)| {
        let node = &skeleton.nodes[b];
        let mode = sway.as_ref().ok().map(|s| Mode {
            frequency_hz: s.frequency_hz.value,
            damping: s.damping_ratio.map_or(DAMPING, |d| d.value),
        });
        Branch {
            parent: node.parent.map(|p| p.index()),
            mode,
            end_px: skeleton.image_from_model(&node.position),
        }
    };
    let mut tree = Tree {
        decay,
        branches: sways.iter().enumerate().map(branch).collect(),
        branch_of,
    };
    for b in 0..tree.branches.len() {
        if tree.all(b).len() < LEAST {
            tree.branches[b].mode = None;
        }
    }
    tree
}

/// Times from the release on, s, the points that were seen nearly always, and which tracks they
/// are. Neighbouring frames are taken together, and short gaps bridged by straight lines: to tell
/// whose a mode is.
fn thinned(film: &Film, onset: &Onset) -> (Vec<f64>, Vec<Point>, Vec<usize>) {
    let together = ((1.0 / (ENOUGH_HZ * film.step_s()) + 0.01) as usize).max(1);
    let until = film
        .times_s
        .partition_point(|t| *t <= onset.at_s + ENOUGH_S);
    let mut rows = film.neighbours(onset.from..until, together);
    rows.retain(|row| row.len() == together);
    let times_s: Vec<f64> = rows
        .iter()
        .map(|row| film.mean_s(row) - onset.at_s)
        .collect();
    let (mut points, mut tracks) = (Vec::new(), Vec::new());
    for (k, track) in film.tracks.iter().enumerate() {
        let mean = |row: &Vec<usize>| {
            let at: Vec<[f64; 2]> = row.iter().map(|&k| track.at_px[k]).collect();
            if at.iter().all(is_seen) {
                mean_px(&at)
            } else {
                [f64::NAN; 2]
            }
        };
        let at: Vec<[f64; 2]> = rows.iter().map(mean).collect();
        let Some(values) = bridged(&times_s, &at) else {
            continue;
        };
        points.push(Point::new(values, mean_px(&at), LEAST_NOISE_PX));
        tracks.push(k);
    }
    (times_s, points, tracks)
}

/// Displacement from the mean, px; nothing for a point that was seen too little.
fn bridged(times_s: &[f64], at_px: &[[f64; 2]]) -> Option<[Vec<f64>; 2]> {
    let seen: Vec<usize> = (0..at_px.len()).filter(|&k| is_seen(&at_px[k])).collect();
    if seen.is_empty() || (seen.len() as f64) < SEEN * at_px.len() as f64 {
        return None;
    }
    let mean = mean_px(at_px);
    let line = |c: usize| {
        let value = |k: usize| {
            let next = seen.partition_point(|s| *s < k);
            let (before, after) = (seen[next.saturating_sub(1)], seen[next.min(seen.len() - 1)]);
            if seen.get(next) == Some(&k) || after <= before {
                return at_px[after][c] - mean[c];
            }
            let share = ((times_s[k] - times_s[before]) / (times_s[after] - times_s[before]))
                .clamp(0.0, 1.0);
            at_px[before][c] + share * (at_px[after][c] - at_px[before][c]) - mean[c]
        };
        (0..at_px.len()).map(value).collect()
    };
    Some([line(0), line(1)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Dynamics;
    use crate::dynamics::sway::{Begun, begun};
    use crate::dynamics::{FilmTrack, analyse, free};
    use crate::model::{Node, NodeName, Size};
    use nalgebra::Point3;
    use rand::RngExt;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    /// A trunk of 0.6 Hz that is let go after 0.5 s with 8 points on it, and a tip with `branches`:
    /// the frequency and the lever arms of the points of each. Noise of 0.1 px.
    fn filmed(branches: &[(f64, &[f64])]) -> (Skeleton, Film) {
        let times: Vec<f64> = (0..150).map(|k| f64::from(k) / 15.0).collect();
        let decay = |hz: f64, t: f64| {
            let t = t - 0.5;
            if t <= 0.0 {
                return 1.0;
            }
            let (z, w) = (0.03_f64, TAU * hz);
            let root = (1.0 - z * z).sqrt();
            (-z * w * t).exp() * ((w * root * t).cos() + z / root * (w * root * t).sin())
        };
        let mut random = crate::random::generator(9, 0);
        let mut noise = || 0.1 * random.sample::<f64, _>(StandardNormal);
        let mut track = |node: u32, trunk: f64, own: Option<(f64, f64)>| {
            let at = |&t: &f64| {
                let sway = trunk * decay(0.6, t) + own.map_or(0.0, |(hz, arm)| arm * decay(hz, t));
                [100.0 + sway + noise(), 100.0 + 0.3 * sway + noise()]
            };
            FilmTrack {
                node: NodeId(node),
                at_px: times.iter().map(at).collect(),
            }
        };
        let mut tracks: Vec<FilmTrack> =
            (0..8).map(|k| track(1, 6.0 + f64::from(k), None)).collect();
        for (hz, arms) in branches {
            tracks.extend(arms.iter().map(|arm| track(2, 15.0, Some((*hz, *arm)))));
        }
        let node = |i: u32| Node {
            name: NodeName(i),
            parent: i.checked_sub(1).map(NodeId),
            level: i as u8,
            position: Point3::new(0.0, 50.0 * f64::from(i), 0.0),
            radius: 1.0,
            n_tracks: 1,
            certainty: 1.0,
            copy_of: None,
            plane_angle: 0.0,
            kind: Default::default(),
        };
        let nodes = (0..3).map(node).collect();
        (
            Skeleton {
                nodes,
                foot_px: [0.0; 2],
                image_size: Size {
                    width: 64,
                    height: 64,
                },
            },
            Film::new(&times, tracks),
        )
    }

    /// Two points of eight are of another branch, which is no reason to say nothing of the six.
    #[test]
    fn a_branch_with_a_few_strangers_gets_its_answer() {
        let (skeleton, film) =
            filmed(&[(1.10, &[4.0, 5.0, 3.5, 4.5, 5.5, 5.0]), (1.6, &[3.0, 4.0])]);
        let sway =
            analyse(&skeleton, &film, &Dynamics::default(), &CancelToken::new()).sway[2].unwrap();
        assert!(sway.frequency_hz.holds(1.10), "{sway:?}");
        assert!(
            sway.damping_ratio.is_some_and(|d| d.holds(0.03)),
            "{sway:?}"
        );
    }

    /// The points of the branches that are told beside the trunk and the tip as a whole.
    fn groups(skeleton: &Skeleton, film: &Film) -> Vec<Vec<usize>> {
        let Some(Begun {
            members,
            onset,
            demands,
            film,
            ..
        }) = begun(skeleton, film, &Dynamics::default())
        else {
            return Vec::new();
        };
        let sways = free::sways(
            skeleton,
            &film,
            &members,
            &onset,
            &demands,
            &CancelToken::new(),
        );
        let Some(told) = told(
            skeleton,
            &film,
            &onset,
            &demands,
            &sways,
            &CancelToken::new(),
        ) else {
            return Vec::new();
        };
        let own = told
            .readings
            .iter()
            .filter(|r| r.points.len() < told.on[2].len());
        let mut groups: Vec<Vec<usize>> = own
            .map(|r| r.points.iter().map(|&p| told.tracks[p]).collect())
            .collect();
        groups.sort();
        groups
    }

    fn found(branches: &[(f64, &[f64])]) -> Vec<Vec<usize>> {
        let (skeleton, film) = filmed(branches);
        groups(&skeleton, &film)
    }

    /// Two branches of 1.10 and 1.15 Hz in one tip: a hidden frequency for whoever looks at either.
    #[test]
    fn two_branches_in_one_tip_come_apart_by_their_modes() {
        let groups = found(&[
            (1.10, &[4.0, 5.0, 3.5, 4.5, 5.5]),
            (1.15, &[3.0, 4.0, 5.0, 3.5, 4.5, 4.0]),
        ]);
        assert_eq!(
            groups,
            [vec![8, 9, 10, 11, 12], vec![13, 14, 15, 16, 17, 18]]
        );
    }

    /// A branch that is cut in two for how far out its points are would be told twice.
    #[test]
    fn one_branch_is_not_cut_whatever_its_lever_arms() {
        assert_eq!(
            found(&[(1.12, &[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 2.5, 4.5, 6.5])]),
            Vec::<Vec<usize>>::new()
        );
        assert_eq!(
            found(&[(1.12, &[0.0; 10])]),
            Vec::<Vec<usize>>::new(),
            "noise on the trunk's sway"
        );
    }

    fn shot(branches: &[(f64, &[f64])]) -> Vec<Vec<usize>> {
        let (skeleton, film) = filmed(branches);
        let shoots = shoots(&skeleton, &film, &Dynamics::default(), &CancelToken::new());
        assert!(shoots.iter().all(|s| s.on == NodeId(2)), "{shoots:?}");
        let mut groups: Vec<Vec<usize>> = shoots.into_iter().map(|s| s.tracks).collect();
        groups.sort();
        groups
    }

    /// Whoever films wants the frequency of each, and a tip that has both cannot have it.
    #[test]
    fn branches_that_only_their_modes_tell_are_shoots_of_their_tip() {
        let two: &[(f64, &[f64])] = &[
            (1.10, &[4.0, 5.0, 3.5, 4.5, 5.5]),
            (1.15, &[3.0, 4.0, 5.0, 3.5, 4.5, 4.0]),
        ];
        assert_eq!(
            shot(two),
            [vec![8, 9, 10, 11, 12], vec![13, 14, 15, 16, 17, 18]]
        );
    }

    #[test]
    fn a_tip_that_is_one_branch_has_no_shoots_and_four_points_are_none() {
        assert_eq!(
            shot(&[(1.12, &[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 2.5, 4.5, 6.5])]),
            Vec::<Vec<usize>>::new()
        );
        assert_eq!(
            shot(&[(1.12, &[0.0; 10])]),
            Vec::<Vec<usize>>::new(),
            "noise on the trunk's sway"
        );
        let small = shot(&[
            (1.10, &[4.0, 5.0, 3.5, 4.5, 5.5, 5.0, 4.0]),
            (1.6, &[3.0, 4.0, 5.0, 4.0]),
        ]);
        assert!(small.iter().flatten().all(|k| *k < 15), "{small:?}");
    }

    /// Three points might be of three branches.
    #[test]
    fn a_few_points_make_no_branch() {
        let groups = found(&[
            (1.10, &[4.0, 5.0, 3.5, 4.5, 5.5, 5.0]),
            (1.6, &[3.0, 4.0, 5.0]),
        ]);
        assert!(
            groups.iter().all(|g| g.iter().all(|k| *k < 14)),
            "{groups:?}"
        );
    }

    #[test]
    fn a_film_that_carries_nothing_shows_none() {
        let (skeleton, mut film) = filmed(&[(1.1, &[4.0; 6]), (1.4, &[4.0; 6])]);
        let short = film.until(20).into_owned();
        assert!(groups(&skeleton, &short).is_empty());
        film.tracks
            .iter_mut()
            .for_each(|t| t.at_px.fill([f64::NAN; 2]));
        assert!(groups(&skeleton, &film).is_empty());
        film.tracks.iter_mut().for_each(|t| t.at_px.fill([3.0; 2]));
        assert!(groups(&skeleton, &film).is_empty());
    }
}

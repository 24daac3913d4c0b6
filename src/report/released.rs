//! What the motion says of releases that its analysis could not use: one before the part that was looked at, or several in it.

use crate::dynamics::{Film, Onset};
use crate::model::Excitation;

/// Time over which speeds are taken, s.
const OVER_S: f64 = 0.12;
/// A point counts if it is seen in so much of the film.
const SEEN: f64 = 0.9;
/// Before a release the tree is at rest for so long, s, with at most this share of the energy that it has at its peak so long
/// after it, s; and that is at least this share of the film's largest.
const REST_S: f64 = 0.6;
const AT_REST: f64 = 0.02;
const RISE_S: f64 = 1.0;
/// At the begin of the film less of the rest may be seen, s.
const LEAST_REST_S: f64 = 0.3;
const LARGE: f64 = 0.2;
/// Two releases are farther apart than this, s.
const APART_S: f64 = 2.0;
/// The film in pieces whose energy falls from each to the next: by so much at the most it may grow, to this share of itself it falls
/// in all, and its logarithm lies so near to a straight line (share of the variance). Of 216 parts of windy films of 5 to 10 s
/// 8 did so, of 57 parts that begin after a release 27.
const PIECES: usize = 4;
const GROWS: f64 = 1.15;
const FALLS: f64 = 0.3;
const STRAIGHT: f64 = 0.85;

/// What the user should try, a sentence each. `given` is whether the user says what made the tree sway.
pub fn hints(film: &Film, onset: Option<Onset>, given: bool) -> Vec<String> {
    let Some(energy) = energy(film) else { return Vec::new() };
    let releases = releases(&energy);
    if releases.len() > 1 {
        let times: Vec<String> = releases.iter().map(|t| format!("{t:.1}")).collect();
        return vec![format!(
            "the tree seems to have been let go {} times, at {} s; choose one of them with --from and --to",
            times.len(),
            times.join(", ")
        )];
    }
    let wind = onset.is_some_and(|o| o.excitation == Excitation::Wind);
    if wind && !given && releases.is_empty() && dies_down(&energy) {
        return vec![
            "the motion dies down from begin to end: if the tree was let go before, say --excitation release, or begin with the \
             release itself (--from and --to)"
                .into(),
        ];
    }
    Vec::new()
}

/// Time, s, and square of the speed of the middle one of the points, px²/s²; `None` where too little was seen.
fn energy(film: &Film) -> Option<Vec<[f64; 2]>> {
    let times = &film.times_s;
    let over = ((OVER_S / film.step_s()).round() as usize).max(1);
    let seen = |p: &[f64; 2]| p[0].is_finite() && p[1].is_finite();
    let tracks: Vec<&Vec<[f64; 2]>> = film
        .tracks
        .iter()
        .map(|t| &t.at_px)
        .filter(|at| at.iter().filter(|p| seen(p)).count() as f64 >= SEEN * times.len() as f64)
        .collect();
    if tracks.is_empty() || times.len() < 8 * PIECES + over {
        return None;
    }
    let at = |k: usize| {
        let dt = times[k + over] - times[k];
        let speed = |at: &&Vec<[f64; 2]>| {
            let (a, b) = (at.get(k)?, at.get(k + over)?);
            let square = (b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2);
            square.is_finite().then_some(square / (dt * dt))
        };
        let mut all: Vec<f64> = tracks.iter().filter_map(speed).collect();
        all.sort_unstable_by(f64::total_cmp);
        Some([0.5 * (times[k] + times[k + over]), *all.get(all.len() / 2)?])
    };
    Some((0..times.len() - over).filter_map(at).collect())
}

/// When the tree was let go from rest, s.
fn releases(energy: &[[f64; 2]]) -> Vec<f64> {
    let top = energy.iter().map(|e| e[1]).fold(0.0, f64::max);
    let first_s = energy.first().map_or(0.0, |e| e[0]);
    let mut out: Vec<f64> = Vec::new();
    for (k, &[now, _]) in energy.iter().enumerate() {
        if now - first_s < LEAST_REST_S || out.last().is_some_and(|last| now - last < APART_S) {
            continue;
        }
        let largest = |of: &mut dyn Iterator<Item = &[f64; 2]>| of.map(|e| e[1]).fold(0.0, f64::max);
        let before = largest(&mut energy[..=k].iter().rev().take_while(|e| now - e[0] <= REST_S));
        let after = largest(&mut energy[k..].iter().take_while(|e| e[0] - now <= RISE_S));
        // Of all moments at which the motion is about to come, the last at rest.
        let begins = energy.get(k + 1).is_some_and(|next| next[1] >= AT_REST * after);
        if after >= LARGE * top && before < AT_REST * after && begins {
            out.push(now);
        }
    }
    out
}

/// Whether the motion grows less from begin to end, as evenly as a free sway does.
fn dies_down(energy: &[[f64; 2]]) -> bool {
    let mean = |piece: &[[f64; 2]]| piece.iter().map(|e| e[1]).sum::<f64>() / piece.len().max(1) as f64;
    let ends: Vec<usize> = (0..=PIECES).map(|k| k * energy.len() / PIECES).collect();
    let means: Vec<f64> = ends.windows(2).map(|w| mean(&energy[w[0]..w[1]])).collect();
    if means.iter().any(|m| *m <= 0.0) || means.windows(2).any(|w| w[1] > GROWS * w[0]) {
        return false;
    }
    let logs: Vec<f64> = means.iter().map(|m| m.ln()).collect();
    let middle = 0.5 * (PIECES - 1) as f64;
    let average = logs.iter().sum::<f64>() / PIECES as f64;
    let product = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        logs.iter().enumerate().map(|(k, y)| of(k as f64 - middle, y - average)).sum()
    };
    let (xx, xy, yy) = (product(&|x, _| x * x), product(&|x, y| x * y), product(&|_, y| y * y));
    xy / xx * (PIECES - 1) as f64 <= FALLS.ln() && xy * xy >= STRAIGHT * xx * yy
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::{FilmTrack, Start};
    use crate::model::NodeId;
    use std::f64::consts::TAU;

    fn chance(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    }

    /// Nine points that move as `sway` says, px, each by another factor, with noise.
    fn film(seconds: f64, sway: impl Fn(f64) -> f64) -> Film {
        let times: Vec<f64> = (0..(30.0 * seconds) as u32).map(|k| f64::from(k) / 30.0).collect();
        let mut seed = 5;
        let track = |i: u32| {
            let factor = 0.5 + 0.1 * f64::from(i);
            let at_px = times.iter().map(|t| [100.0 + factor * sway(*t), 50.0 + 0.3 * chance(&mut seed)]).collect();
            FilmTrack { node: NodeId(1), at_px }
        };
        let tracks = (0..9).map(track).collect();
        Film::new(&times, tracks)
    }

    /// Let go at 0: two modes.
    fn free(t: f64) -> f64 {
        let mode = |hz: f64, px: f64| px * (-0.05 * TAU * hz * t).exp() * (TAU * hz * t).cos();
        if t < 0.0 { 12.0 } else { mode(0.6, 9.0) + mode(0.9, 3.0) }
    }

    fn told(excitation: Excitation) -> Option<Onset> {
        Some(Onset { excitation, start: Start::Moving, at_s: 0.0, from: 0, to: 300 })
    }

    /// Wind shakes an oscillator all the time.
    fn windy(mut seed: u64) -> Film {
        let omega = TAU * 0.6;
        let (mut x, mut v, mut all) = (0.0, 0.0, Vec::new());
        for _ in 0..1200 {
            v += (2000.0 * chance(&mut seed) - 2.0 * 0.05 * omega * v - omega * omega * x) / 30.0;
            x += v / 30.0;
            all.push(x);
        }
        film(20.0, |t| all[600 + (30.0 * t) as usize])
    }

    #[test]
    fn a_part_after_the_release_that_is_taken_for_wind_gets_a_hint() {
        let late = film(9.0, |t| free(t + 2.0));
        let hint = hints(&late, told(Excitation::Wind), false);
        assert!(hint.len() == 1 && hint[0].contains("--excitation release"), "{hint:?}");
        // Not where it is said what it was, or was told rightly.
        assert!(hints(&late, told(Excitation::Wind), true).is_empty());
        assert!(hints(&late, told(Excitation::Release), false).is_empty());
        assert!(hints(&late, None, false).is_empty());
    }

    #[test]
    fn several_releases_in_a_film_get_a_hint_with_their_times() {
        let pulled = |t: f64| free(t - 1.0);
        assert!(hints(&film(11.0, pulled), told(Excitation::Release), false).is_empty());
        // Pulled again within two seconds, held, let go.
        let twice = |t: f64| match t - 14.0 {
            t if t < 0.0 => free(t + 13.0),
            t if t < 2.0 => free(13.0 + t) + (12.0 - free(15.0)) * t / 2.0,
            t => free(t - 3.0),
        };
        for cause in [Excitation::Wind, Excitation::Release] {
            let hint = hints(&film(27.0, twice), told(cause), false);
            assert!(hint.len() == 1 && hint[0].contains("let go 2 times, at 1.0, 17.0 s"), "{hint:?}");
        }
    }

    /// Wind that happens to fade over the film cannot be told from a free sway by its energy alone.
    #[test]
    fn wind_seldom_gets_a_hint_and_stillness_none() {
        let hinted: Vec<u64> =
            (0..60).filter(|&seed| !hints(&windy(seed), told(Excitation::Wind), false).is_empty()).collect();
        assert!(hinted.len() <= 3, "{hinted:?} of 60");
        assert!(hints(&film(10.0, |_| 0.0), told(Excitation::Wind), false).is_empty());
        assert!(hints(&Film::default(), None, false).is_empty());
    }
}

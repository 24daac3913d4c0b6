//! What the motion says of releases that its analysis did not use: one before the part that was
//! looked at, or others in it.

use crate::dynamics::{Analysis, Film, fades_as_a_free_decay};
use crate::model::Excitation;

/// What the user should try, a sentence each. `given` is whether the user says what made the tree
/// sway.
pub fn hints(
    film: &Film,
    Analysis {
        onset, releases_s, ..
    }: &Analysis,
    given: bool,
) -> Vec<String> {
    let Some(onset) = onset else {
        return Vec::new();
    };
    if releases_s.len() > 1 {
        let times: Vec<String> = releases_s.iter().map(|t| format!("{t:.1}")).collect();
        return vec![format!(
            "the tree was let go {} times, at {} s; the answers are of the one at {:.1} s, and \
             --from and --to choose another",
            times.len(),
            times.join(", "),
            onset.at_s
        )];
    }
    if onset.excitation == Excitation::Wind && !given && fades_as_a_free_decay(film) {
        return vec![
            "the motion dies down from begin to end: if the tree was let go before, say \
             --excitation release, or begin with the release itself (--from and --to)"
                .into(),
        ];
    }
    Vec::new()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cancel::CancelToken;
    use crate::config::Dynamics;
    use crate::dynamics::{Depth, FilmTrack, Onset, Start, analyse};
    use crate::model::{Node, NodeId, Size, Skeleton};
    use nalgebra::Point2;
    use std::f64::consts::TAU;

    fn chance(seed: &mut u64) -> f64 {
        *seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    }

    /// Nine points that move as `sway` says, px, each by another factor, with noise.
    fn film(seconds: f64, sway: impl Fn(f64) -> f64) -> Film {
        let times: Vec<f64> = (0..(30.0 * seconds) as u32)
            .map(|k| f64::from(k) / 30.0)
            .collect();
        let mut seed = 5;
        let mut tracks = Vec::new();
        for i in 0..9 {
            let factor = 0.5 + 0.1 * f64::from(i);
            let at_px = times
                .iter()
                .map(|t| Point2::new(100.0 + factor * sway(*t), 50.0 + 0.3 * chance(&mut seed)))
                .collect();
            tracks.push(FilmTrack {
                node: NodeId(1),
                at_px,
            });
        }
        Film::new(&times, tracks)
    }

    /// Released at 0: two modes.
    fn free(t: f64) -> f64 {
        if t < 0.0 {
            12.0
        } else {
            decay(0.6, 9.0, t) + decay(0.9, 3.0, t)
        }
    }

    fn decay(hz: f64, px: f64, t: f64) -> f64 {
        px * (-0.05 * TAU * hz * t).exp() * (TAU * hz * t).cos()
    }

    fn node(k: u32) -> Node {
        Node {
            level: k as u8,
            ..Node::made_up(k, k.checked_sub(1), [0.0, 100.0 * f64::from(k), 0.0])
        }
    }

    fn told(excitation: Excitation) -> Analysis {
        let onset = Onset {
            excitation,
            start: Start::Moving,
            at_s: 0.0,
            from: 0,
            to: 300,
        };
        Analysis {
            sway: Vec::new(),
            modes: Vec::new(),
            onset: Some(onset),
            releases_s: Vec::new(),
        }
    }

    /// The analysis of a film of a trunk.
    fn analysed(film: &Film) -> Analysis {
        let skeleton = Skeleton {
            nodes: vec![node(0), node(1)],
            foot_px: [100.0; 2].into(),
            image_size: Size {
                width: 640,
                height: 360,
            },
        };
        analyse(
            &skeleton,
            film,
            &Dynamics::default(),
            Depth::Full,
            &CancelToken::new(),
        )
    }

    /// Where an oscillator of 0.6 Hz is in `n` frames that wind shakes in those that are `windy`.
    fn shaken(mut seed: u64, n: usize, damping: f64, windy: impl Fn(usize) -> bool) -> Vec<f64> {
        let omega = TAU * 0.6;
        let (mut x, mut v) = (0.0, 0.0);
        let mut out = Vec::with_capacity(n);
        for k in 0..n {
            let gust = 2000.0 * chance(&mut seed);
            let drive = if windy(k) { gust } else { 0.0 };
            v += (drive - 2.0 * damping * omega * v - omega * omega * x) / 30.0;
            x += v / 30.0;
            out.push(x);
        }
        out
    }

    /// Wind all the time.
    fn windy(seed: u64) -> Film {
        let all = shaken(seed, 1200, 0.05, |_| true);
        film(20.0, |t| all[600 + (30.0 * t) as usize])
    }

    /// Wind that rests twice.
    fn with_lulls(seed: u64) -> Film {
        let all = shaken(seed, 1500, 0.1, |k| {
            (60..420).contains(&k) || (660..1020).contains(&k)
        });
        film(50.0, |t| all[((30.0 * t).round() as usize).min(1499)])
    }

    /// Five of these are taken for releases: each gust begins with a jerk, and both die down.
    #[test]
    fn wind_that_rests_and_comes_again_is_seldom_a_release() {
        let found: Vec<Analysis> = (0..30).map(|seed| analysed(&with_lulls(seed))).collect();
        let released = found.iter().filter(|f| !f.releases_s.is_empty()).count();
        assert!(released <= 5, "{released} of 30");
    }

    #[test]
    fn a_part_after_the_release_that_is_taken_for_wind_gets_a_hint() {
        let late = film(9.0, |t| free(t + 2.0));
        let hint = hints(&late, &told(Excitation::Wind), false);
        assert!(
            hint.len() == 1 && hint[0].contains("--excitation release"),
            "{hint:?}"
        );
        // Not where it is said what it was, or was told rightly.
        assert!(hints(&late, &told(Excitation::Wind), true).is_empty());
        assert!(hints(&late, &told(Excitation::Release), false).is_empty());
        assert!(
            hints(
                &late,
                &Analysis {
                    onset: None,
                    ..told(Excitation::Wind)
                },
                false
            )
            .is_empty()
        );
    }

    /// Taken for one decay, or for wind, two would give wrong answers, and nobody would know.
    #[test]
    fn of_several_releases_in_a_film_one_is_analysed_and_all_are_told() {
        let once = film(11.0, |t| free(t - 1.0));
        assert!(hints(&once, &analysed(&once), false).is_empty());
        // Pulled again slowly, or with a jerk, held, released.
        for pulls_s in [2.0, 0.3] {
            let twice = film(27.0, |t| match t - 14.0 {
                t if t < 0.0 => free(t + 13.0),
                t if t < pulls_s => free(13.0 + t) + (12.0 - free(13.0 + pulls_s)) * t / pulls_s,
                t => free(t - 3.0),
            });
            let found = analysed(&twice);
            let hint = hints(&twice, &found, false);
            assert!(
                hint.len() == 1 && hint[0].contains("let go 2 times, at 1.0, 17.0 s"),
                "{hint:?}"
            );
            assert!(
                found
                    .onset
                    .is_some_and(|o| (o.at_s - 1.0).abs() < 0.05 && o.to <= 30 * 14 + 3),
                "{:?}",
                found.onset
            );
            assert!(
                found.sway[1].is_ok_and(|sway| sway.frequency_hz.holds(0.6)),
                "{:?}",
                found.sway
            );
        }
    }

    /// A hand that jerks is no release, in a film with one either.
    #[test]
    fn a_pull_with_a_jerk_before_the_release_is_no_release() {
        let once = film(16.0, |t| match t {
            t if t < 1.0 => 0.0,
            t if t < 4.0 => (t - 1.0).min(0.3) * 40.0,
            t => free(t - 4.0),
        });
        let found = analysed(&once);
        assert!(
            hints(&once, &found, false).is_empty(),
            "{:?}",
            hints(&once, &found, false)
        );
        assert!(
            found.onset.is_some_and(|o| (o.at_s - 4.0).abs() < 0.05),
            "{:?}",
            found.onset
        );
        assert!(
            found.sway[1].is_ok_and(|sway| sway.frequency_hz.holds(0.6)),
            "{:?}",
            found.sway
        );
    }

    /// Wind that happens to fade over the film cannot be told from a free sway by its energy alone.
    #[test]
    fn wind_seldom_gets_a_hint_and_stillness_none() {
        let hinted: Vec<u64> = (0..60)
            .filter(|&seed| !hints(&windy(seed), &told(Excitation::Wind), false).is_empty())
            .collect();
        assert!(hinted.len() <= 3, "{hinted:?} of 60");
        let released: Vec<u64> = (0..60)
            .filter(|&seed| !analysed(&windy(seed)).releases_s.is_empty())
            .collect();
        assert!(released.len() <= 1, "{released:?} of 60");
        assert!(hints(&film(10.0, |_| 0.0), &told(Excitation::Wind), false).is_empty());
        assert!(hints(&Film::default(), &told(Excitation::Wind), false).is_empty());
    }
}

//! Following points, on pictures whose motion is known.

use arborcam::config::{Accumulate, Detect, Track};
use arborcam::hierarchy::{self, Evidence, evidence};
use arborcam::model::{
    Frame, LONGEST_TRIAL_S, Luma, Observation, Size, TrackId, TrackLog, TrackSet,
};
use arborcam::outline::whole;
use arborcam::track::Tracker;
use nalgebra::{Point2, Vector2, distance};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use std::time::Instant;

const SIZE: Size = Size {
    width: 320,
    height: 240,
};

/// Brightness of a smooth random texture anywhere, also between pixels.
fn texture(u: f64, v: f64) -> f64 {
    128.0 + 16.0 * (1..=16).map(|k| wave(k, u, v)).sum::<f64>()
}

/// One of the waves of [`texture`]. Structure of all sizes, as in a photograph: a pyramid of
/// pictures needs the large ones, too.
fn wave(k: i32, u: f64, v: f64) -> f64 {
    let [direction, phase] = [0.618, 0.569].map(|a| TAU * (f64::from(k) * a).fract());
    let length = 7.0 * 1.19f64.powi(k);
    (TAU * (u * direction.cos() + v * direction.sin()) / length + phase).sin()
}

/// Picture `k`, brightness by place.
fn frame(k: u64, at: impl Fn(f64, f64) -> f64) -> Frame {
    let mut pixels = Vec::with_capacity(SIZE.area());
    for v in 0..SIZE.height {
        for u in 0..SIZE.width {
            let brightness = at(f64::from(u), f64::from(v));
            pixels.push(brightness.round().clamp(0.0, 255.0) as u8);
        }
    }
    let luma = Luma { size: SIZE, pixels };
    Frame {
        index: k,
        time_s: k as f64 / 30.0,
        received: Instant::now(),
        luma,
        preview: None,
        colour: None,
        raw: None,
        depth: None,
    }
}

fn tracker() -> Tracker {
    Tracker::new(
        &Detect {
            points: 300,
            min_distance_px: 20.0,
            ..Detect::default()
        },
        &Track::default(),
        &whole(SIZE),
        0,
    )
}

fn places(set: &TrackSet) -> BTreeMap<TrackId, Point2<f64>> {
    set.observations.iter().map(|o| (o.id, o.at_px())).collect()
}

/// Shift of the picture in frame `k`, px: a sway of a few pixels.
fn shift(k: u64) -> Vector2<f64> {
    let phase = TAU * k as f64 / 40.0;
    Vector2::new(6.3 * phase.sin(), 2.1 * (1.7 * phase).sin())
}

#[test]
fn a_known_motion_is_followed_to_a_tenth_of_a_pixel() {
    let mut tracker = tracker();
    let first = places(&tracker.step(&frame(0, texture)));
    assert!(first.len() >= 80, "{} points", first.len());
    for k in 1..40 {
        let d = shift(k);
        let now = places(&tracker.step(&frame(k, |u, v| texture(u - d.x, v - d.y))));
        let mut errors: Vec<f64> = now
            .iter()
            .filter_map(|(id, at)| first.get(id).map(|from| distance(at, &(*from + d))))
            .collect();
        errors.sort_by(f64::total_cmp);
        assert!(
            errors.len() * 10 >= first.len() * 8,
            "frame {k}: {} points are left",
            errors.len()
        );
        assert!(
            errors[errors.len() * 95 / 100] < 0.1,
            "frame {k}: {:?}",
            &errors[errors.len() - 5..]
        );
    }
}

#[test]
fn a_static_picture_stays_where_it_is() {
    let mut tracker = tracker();
    let still = frame(0, texture);
    let first = places(&tracker.step(&still));
    for k in 1..30 {
        let now = places(&tracker.step(&Frame {
            index: k,
            ..still.clone()
        }));
        assert_eq!(now.len(), first.len(), "none is lost in frame {k}");
        for (id, at) in &now {
            assert!(distance(at, &first[id]) < 0.01, "{id:?} drifts");
        }
    }
}

/// A camera's first pictures may be black.
#[test]
fn points_are_found_as_soon_as_there_is_something_to_be_seen() {
    let mut tracker = tracker();
    for k in 0..10 {
        assert!(tracker.step(&frame(k, |_, _| 2.0)).observations.is_empty());
    }
    let light = frame(10, texture);
    let seen = (10..30).map(|k| {
        tracker.step(&Frame {
            index: k,
            time_s: k as f64 / 30.0,
            ..light.clone()
        })
    });
    let n = seen.last().map_or(0, |set| set.observations.len());
    assert!(n >= 80, "{n} points");
}

/// Without wind nothing tells good points from bad ones: the choice waits for it, however long, and
/// so that the screen is not empty meanwhile, nobody goes. When the wind comes, it is made as fast
/// as ever.
#[test]
fn the_choice_of_points_waits_for_wind() {
    let mut tracker = tracker();
    let (mut first, mut rejected, mut decided_s) = (BTreeSet::new(), BTreeSet::new(), None);
    const WIND_S: f64 = 12.0;
    for k in 0..220u64 {
        let time_s = k as f64 / 10.0;
        let phase = TAU * (time_s - WIND_S).max(0.0) / 2.0;
        let [du, dv] = [5.0 * phase.sin(), 2.0 * (1.7 * phase).sin()];
        let set = tracker.step(&Frame {
            time_s,
            ..frame(k, |u, v| texture(u - du, v - dv))
        });
        rejected.extend(set.rejected.iter().copied());
        let ids: BTreeSet<TrackId> = places(&set).into_keys().collect();
        if k == 0 {
            first = ids;
        } else if time_s < WIND_S {
            assert!(
                ids == first && set.observations.iter().all(|o| !o.confirmed),
                "{time_s} s"
            );
        } else if decided_s.is_none()
            && set
                .observations
                .iter()
                .all(|o| o.confirmed && o.error_px.is_some())
        {
            assert!(
                5 * ids.len() >= 2 * first.len(),
                "{} of {} are left",
                ids.len(),
                first.len()
            );
            assert_eq!(
                first.difference(&ids).copied().collect::<BTreeSet<_>>(),
                rejected,
                "who is gone is named"
            );
            decided_s = Some(time_s - WIND_S);
        }
    }
    assert!(
        decided_s.is_some_and(|s| s <= LONGEST_TRIAL_S),
        "{decided_s:?}"
    );
}

fn on_small_tree(p: &Point2<f64>) -> bool {
    (110.0..170.0).contains(&p.x) && (90.0..150.0).contains(&p.y)
}

/// The whole picture for an outline, and a small tree: its points are few of all, but enough to
/// build from, and the choice must not wait for the wall behind it to move.
#[test]
fn a_small_tree_in_a_wide_outline_stirs_too() {
    let detect = Detect {
        points: 600,
        min_distance_px: 12.0,
        ..Detect::default()
    };
    let mut tracker = Tracker::new(&detect, &Track::default(), &whole(SIZE), 0);
    let mut decided_s = None;
    for k in 0..100u64 {
        let time_s = k as f64 / 10.0;
        let du = 5.0 * (TAU * time_s / 2.0).sin();
        let picture = frame(k, |u, v| {
            if on_small_tree(&Point2::new(u, v)) {
                texture(u - du, v)
            } else {
                texture(u, v)
            }
        });
        let set = tracker.step(&Frame { time_s, ..picture });
        let seen = places(&set);
        if k == 0 {
            let inside = seen.values().filter(|p| on_small_tree(p)).count();
            assert!(
                inside >= 20 && 12 * inside < seen.len(),
                "{inside} of {}",
                seen.len()
            );
        }
        if decided_s.is_none() && set.observations.iter().all(|o| o.confirmed) {
            decided_s = Some(time_s);
            let inside = seen.values().filter(|p| on_small_tree(p)).count();
            assert!(inside >= 10, "{inside} of the tree's points are left");
        }
    }
    assert!(
        decided_s.is_some_and(|s| s <= LONGEST_TRIAL_S + 0.5),
        "{decided_s:?}"
    );
}

/// A light breeze moves points by less than would tell them apart: they pass by time.
#[test]
fn points_that_hardly_move_pass_their_trial_by_time() {
    let mut tracker = tracker();
    let mut passed_s = None;
    for k in 0..100u64 {
        let time_s = k as f64 / 10.0;
        let du = 0.7 * (TAU * time_s / 2.0).sin();
        let set = tracker.step(&Frame {
            time_s,
            ..frame(k, |u, v| texture(u - du, v))
        });
        assert!(
            set.observations.len() >= 60,
            "{} points",
            set.observations.len()
        );
        if passed_s.is_none() && set.observations.iter().all(|o| o.confirmed) {
            passed_s = Some(time_s);
        }
    }
    assert!(
        passed_s.is_some_and(|s| (LONGEST_TRIAL_S..LONGEST_TRIAL_S + 1.0).contains(&s)),
        "{passed_s:?}"
    );
}

/// Whether a place is behind the bird, so far from its edge, px.
fn behind_bird(p: &Point2<f64>, inside_px: f64) -> bool {
    (110.0 + inside_px..170.0 - inside_px).contains(&p.x)
        && (80.0 + inside_px..140.0 - inside_px).contains(&p.y)
}

/// A bird flies by: a point behind it is not reported, and has its old name afterwards.
#[test]
fn hidden_points_come_back_with_their_names_in_the_right_place() {
    let mut tracker = tracker();
    let mut first = BTreeMap::new();
    let mut seen_behind = 0;
    for k in 0..40 {
        let d = shift(k);
        let covered = (10..16).contains(&k);
        let now = places(&tracker.step(&frame(k, |u, v| {
            if covered && behind_bird(&Point2::new(u, v), 0.0) {
                40.0
            } else {
                texture(u - d.x, v - d.y)
            }
        })));
        if k == 0 {
            first.clone_from(&now);
        }
        if k == 13 {
            seen_behind = now.values().filter(|p| behind_bird(p, 12.0)).count();
        }
        if k == 39 {
            let behind: Vec<_> = first.iter().filter(|(_, p)| behind_bird(p, 12.0)).collect();
            let back = behind.iter().filter(|(id, from)| {
                now.get(*id)
                    .is_some_and(|at| distance(at, &(*from + d)) < 0.3)
            });
            let n = back.count();
            assert!(
                behind.len() >= 2 && 2 * n >= behind.len(),
                "{n} of {} points came back",
                behind.len()
            );
            assert!(
                seen_behind < behind.len(),
                "{seen_behind} of {} were reported behind the bird",
                behind.len()
            );
        }
    }
}

/// Now and then there is nothing to be seen at all, and every point is lost: names are never given
/// twice.
#[test]
fn names_are_never_given_twice() {
    let mut tracker = tracker();
    let (clear, fog) = (frame(0, texture), frame(0, |_, _| 128.0));
    let (mut last, mut births) = (BTreeMap::new(), 0);
    for k in 0..150u64 {
        let picture = if k % 50 < 25 { &clear } else { &fog };
        let time_s = k as f64 / 4.0;
        let set = tracker.step(&Frame {
            index: k,
            time_s,
            ..picture.clone()
        });
        births += u64::from(set.born);
        for id in places(&set).into_keys() {
            let before = last.insert(id, k).unwrap_or(k);
            assert!(
                k - before <= 21,
                "{id:?} is back in frame {k}, last seen in {before}"
            );
        }
    }
    let lost = last.values().filter(|k| **k < 100).count();
    assert!(lost >= 160, "only {lost} points were ever lost");
    assert_eq!(
        births,
        u64::from(tracker.next_id()),
        "each birth takes one new name"
    );
    assert_eq!(births, last.len() as u64);
}

/// Point `i` of [`log`] in frame `k`.
fn observation(i: u32, k: u64, amplitude_px: f64) -> Observation {
    let [noise_u, noise_v] = [78.233, 39.425]
        .map(|a| 0.1 * ((f64::from(i) * 12.9898 + k as f64 * a).sin() * 43758.5453).fract());
    // Higher points sway more, and each row a little later.
    let (row, column) = (f64::from(i / 6), f64::from(i % 6));
    let phase = TAU * (k as f64 / 30.0) / 1.7 + 0.4 * row;
    let sway = amplitude_px * (0.3 + row / 9.0) * phase.sin();
    Observation {
        id: TrackId(i),
        u_px: (40.0 * column + sway + noise_u) as f32,
        v_px: (20.0 * row + noise_v) as f32,
        fb_error_px: 0.05,
        error_px: Some(0.1),
        confirmed: true,
        depth: None,
    }
}

/// A log of 60 points that sway by `amplitude_px`, each measured with an error of about 0.05
/// px.
fn log(amplitude_px: f64, seconds: f64) -> TrackLog {
    let mut log = TrackLog::new(20.0);
    for k in 0..(30.0 * seconds) as u64 {
        let time_s = k as f64 / 30.0;
        log.push(TrackSet {
            frame: k,
            time_s,
            observations: (0..60).map(|i| observation(i, k, amplitude_px)).collect(),
            ..TrackSet::default()
        });
    }
    log
}

fn measure(amplitude_px: f64, seconds: f64) -> Evidence {
    let log = log(amplitude_px, seconds);
    evidence(&hierarchy::table(log.all()), &Accumulate::default())
}

#[test]
fn the_accumulation_measure_grows_with_motion_and_stays_low_on_noise() {
    let noise = measure(0.0, 6.0);
    assert!(noise.measure < 0.02 && noise.moving.is_empty(), "{noise:?}");
    let growing: Vec<f64> = [0.5, 1.5, 4.0, 10.0]
        .map(|a| measure(a, 6.0).measure)
        .to_vec();
    assert!(
        growing.windows(2).all(|w| w[0] < w[1] + 1e-6) && growing[0] < 0.5,
        "{growing:?}"
    );
    assert!(
        growing[3] > Accumulate::default().threshold && growing[3] <= 1.0,
        "{growing:?}"
    );
    assert_eq!(measure(10.0, 6.0).moving.len(), 60);
}

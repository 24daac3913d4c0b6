//! Whether points move by themselves, or all as one picture, which is what a moving camera shows.

use super::accumulate::noise_px;
use crate::config::Accumulate;
use crate::model::{LogWindow, TrackTable};
use crate::signal::{CommonMotion, Pair};
use nalgebra::Point2;

/// Time over which motion is looked at, s: about half a period of a tree's fastest limbs, and more
/// than noise from frame to frame.
const STEP_S: f64 = 0.4;
/// Points and steps that are looked at; more say the same at a higher price.
const COMPARED: usize = 96;
const STEPS: usize = 60;
/// Fewer points than this have no motion in common.
const LEAST_POINTS: usize = 8;
/// Of a camera's motion all points but those that are followed badly have no motion of their own.
/// Of a tree's, far more than this share has; in a picture of which the tree is a small part, half of
/// them.
const OWN_SHARE: f64 = 0.25;
/// Where the camera's motion is known in this share of the frames it has been taken off.
const KNOWN_SHARE: f64 = 0.5;

/// Whether the points of the rows `moving` may move by nothing but the camera: the frames of
/// `window`, of which `table` is made, do not show how the camera moves, and hardly a point does
/// anything else than one similarity of the whole picture.
pub(super) fn is_cameras(
    window: LogWindow,
    table: &TrackTable,
    moving: &[usize],
    settings: &Accumulate,
) -> bool {
    !is_camera_known(window) && own_share(table, moving, settings.moving_snr) < OWN_SHARE
}

fn is_camera_known(window: LogWindow) -> bool {
    let known = window.sets().filter(|set| set.camera.sd_px().is_some());
    known.count() as f64 >= KNOWN_SHARE * window.len() as f64
}

/// Share of the points of the rows `moving` that move by more than `snr` times the noise of tracking
/// beyond what they have in common.
fn own_share(table: &TrackTable, moving: &[usize], snr: f64) -> f64 {
    let some: Vec<usize> = every_so_many(moving, COMPARED);
    let mut own: Vec<Own> = vec![Own::default(); some.len()];
    for (before, after) in steps(&table.times_s) {
        let mut pairs = Vec::with_capacity(some.len());
        let mut whose = Vec::with_capacity(some.len());
        for (i, &row) in some.iter().enumerate() {
            if let Some(pair) = pair(table, row, before, after) {
                pairs.push(pair);
                whose.push(i);
            }
        }
        if pairs.len() < LEAST_POINTS {
            continue;
        }
        let Some(common) = CommonMotion::of(&pairs) else {
            continue;
        };
        for (pair, i) in pairs.iter().zip(whose) {
            own[i].sum_square_px2 += pair.miss_px(&common.motion).norm_squared();
            own[i].steps += 1.0;
        }
    }
    let (mut judged, mut move_by_themselves) = (0, 0);
    for (own, &row) in own.iter().zip(&some) {
        if own.steps > 0.0 {
            judged += 1;
            // A step has the noise of two places.
            let noise_px = std::f64::consts::SQRT_2 * noise_px(table, row);
            let own_px = (own.sum_square_px2 / own.steps).sqrt();
            move_by_themselves += usize::from(own_px > snr * noise_px);
        }
    }
    if judged == 0 {
        // Nothing is known against them.
        return 1.0;
    }
    move_by_themselves as f64 / judged as f64
}

/// What a point does by itself.
#[derive(Clone, Copy, Debug, Default)]
struct Own {
    sum_square_px2: f64,
    steps: f64,
}

/// Frames of the table that are about [`STEP_S`] apart, over all of its time.
fn steps(times_s: &[f64]) -> Vec<(usize, usize)> {
    let mut steps = Vec::new();
    let mut before = 0;
    for after in 1..times_s.len() {
        if times_s[after] - times_s[before] >= STEP_S {
            steps.push((before, after));
            before = after;
        }
    }
    every_so_many(&steps, STEPS)
}

/// At most `most` of them, evenly spread.
fn every_so_many<T: Copy>(all: &[T], most: usize) -> Vec<T> {
    let stride = all.len().div_ceil(most).max(1);
    all.iter().copied().step_by(stride).collect()
}

/// Where the point of a row was in two frames, if it was seen in both.
fn pair(table: &TrackTable, row: usize, before: usize, after: usize) -> Option<Pair> {
    let at = |frame: usize| -> Option<Point2<f64>> { Some(table.positions[row][frame]?.cast()) };
    Some(Pair {
        from_px: at(before)?,
        to_px: at(after)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Agreement, Background, Observation, TrackId, TrackLog, TrackSet};
    use nalgebra::{Similarity2, Vector2};
    use std::f64::consts::TAU;

    /// Ten seconds of 60 points all over a picture under a camera in a hand; of the first `sway`
    /// of them each has a sway of its own, of 3 px.
    fn log(sway: usize, background: Background) -> TrackLog {
        let mut log = TrackLog::new(60.0);
        for frame in 0..300 {
            let time_s = f64::from(frame) / 30.0;
            let shift = Vector2::new((TAU * 0.3 * time_s).sin(), (TAU * 0.5 * time_s).cos());
            let turn = 0.003 * (TAU * 0.9 * time_s).sin();
            let camera = Similarity2::new(4.0 * shift, turn, 1.0 + 0.001 * time_s);
            let mut set = TrackSet {
                time_s,
                ..TrackSet::default()
            };
            set.camera.background = background;
            for i in 0..60 {
                let rest = Point2::new(60.0 * f64::from(i % 10), 50.0 * f64::from(i / 10));
                let hz = 0.5 + 0.03 * f64::from(i);
                let own_px = 3.0 * (TAU * hz * time_s).sin();
                let is_swaying = (i as usize) < sway;
                let at = camera * (rest + f64::from(u8::from(is_swaying)) * own_px * Vector2::x());
                set.observations.push(Observation {
                    id: TrackId(i),
                    u_px: at.x as f32,
                    v_px: at.y as f32,
                    fb_error_px: 0.05,
                    error_px: None,
                    confirmed: true,
                    depth: None,
                });
            }
            log.push(set);
        }
        log
    }

    #[test]
    fn a_camera_in_a_hand_makes_no_tree() {
        let seen = Background::Seen(Agreement::default());
        for (sway, background, expected) in [
            (0, Background::Unclear, 0),
            // Some points that are followed badly.
            (6, Background::Unclear, 0),
            // A tree in a part of the picture.
            (24, Background::Unclear, 60),
            // What still moves after the camera's motion was taken off moves by itself.
            (0, seen, 60),
        ] {
            let log = log(sway, background);
            let (_, evidence) = super::super::seen(log.all(), &Accumulate::default());
            assert_eq!(evidence.moving.len(), expected, "{sway} {background:?}");
            assert_eq!(
                evidence.measure > 0.0,
                expected > 0,
                "{sway} {background:?}"
            );
        }
    }
}

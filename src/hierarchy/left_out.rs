//! Points that the film shows to have left the place on which they were born.
//!
//! A fifth of all points end beside the surface on which they were found: they slide along their
//! branch, or go over to another. Each picture by itself prefers the wrong place. But over a film
//! the points around a point that move as it does say where it should be, and those that are often
//! elsewhere, or are lost again and again, are the ones to doubt. They move nothing.

use super::accumulate::moves;
use super::rest::rest_position_px;
use super::table::every_track;
use crate::config::Accumulate;
use crate::model::{LogWindow, TrackId, TrackTable};
use crate::signal::statistics::quantile;
use crate::signal::{Fit, Witness, local_affine, median};
use nalgebra::{Point2, Vector2};
use std::collections::BTreeSet;

/// This share of the points that move is left out. On eleven films of known motion, made and bare,
/// in leaf, at night and before a fence, a quarter brings the share of points within 2 px from 0.77
/// to 0.86; 0.2 and 0.3 are 0.02 below and 0.01 above that.
const SHARE: f64 = 0.25;
/// Never so many that fewer are left that move: twice what evidence of motion needs to count in
/// full.
const LEAST_LEFT: usize = 64;
/// A point's place follows from so many that move most like it, of so many nearest.
const ALIKE: usize = 16;
const NEAREST: usize = 32;
/// Frames, evenly spread over the film, in which places are estimated; more say the same at a higher
/// price.
const FRAMES: usize = 40;
/// Points seen in fewer frames of the table are not judged: that is a second.
const LEAST_SEEN: usize = 15;
/// Of a point's distances from where it should be the median and this quantile count: some go astray
/// only in the widest swings.
const WIDE: f64 = 0.8;

/// The points of `window` that are left out, and all of `before`, which stay left out: of the others
/// the worst go, until the share is reached.
pub fn left_out(
    window: LogWindow,
    before: &BTreeSet<TrackId>,
    settings: &Accumulate,
) -> BTreeSet<TrackId> {
    let table = every_track(window);
    let tracks = Tracks::new(&table);
    let rows = 0..table.ids.len();
    let long_enough = rows.filter(|&row| tracks.seen[row] >= LEAST_SEEN);
    let moving = long_enough.filter(|&row| moves(&table, row, settings));
    let verdicts: Vec<Verdict> = moving.filter_map(|row| tracks.judge(row)).collect();
    let n_judged = verdicts.len();
    let most = ((SHARE * n_judged as f64) as usize).min(n_judged.saturating_sub(LEAST_LEFT));
    let judged = worst_first(&verdicts).into_iter();
    let judged: Vec<TrackId> = judged.map(|k| table.ids[verdicts[k].row]).collect();
    let n_before = judged.iter().filter(|id| before.contains(id)).count();
    let others = judged.into_iter().filter(|id| !before.contains(id));
    let mut out = before.clone();
    out.extend(others.take(most.saturating_sub(n_before)));
    out
}

/// What the film says of one point.
#[derive(Clone, Copy, Debug)]
struct Verdict {
    row: usize,
    /// Distances from where those that move alike say that it is: the median and [`WIDE`], px.
    apart_px: f64,
    wide_px: f64,
    /// Share of the frames between the first and the last in which it was seen that do not show it.
    unseen: f64,
}

/// The numbers of the verdicts, the worst first, by the sum of their ranks in the three figures.
fn worst_first(verdicts: &[Verdict]) -> Vec<usize> {
    let by_figure = [
        ranks(verdicts.iter().map(|v| v.apart_px).collect()),
        ranks(verdicts.iter().map(|v| v.wide_px).collect()),
        ranks(verdicts.iter().map(|v| v.unseen).collect()),
    ];
    let sum = |k: usize| by_figure.iter().map(|ranks| ranks[k]).sum::<usize>();
    let mut order: Vec<usize> = (0..verdicts.len()).collect();
    order.sort_by_key(|&k| std::cmp::Reverse(sum(k)));
    order
}

/// How many of `values` are smaller than each.
fn ranks(values: Vec<f64>) -> Vec<usize> {
    let mut sorted = values.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let rank = |value: &f64| sorted.partition_point(|other| other < value);
    values.iter().map(rank).collect()
}

/// The points of a table about their rest places.
struct Tracks<'a> {
    table: &'a TrackTable,
    rest_px: Vec<Point2<f64>>,
    /// Number of frames in which each was seen.
    seen: Vec<usize>,
}

impl<'a> Tracks<'a> {
    fn new(table: &'a TrackTable) -> Self {
        let rows = 0..table.ids.len();
        let seen = table.positions.iter().map(|of| of.iter().flatten().count());
        Self {
            rest_px: rows.map(|row| rest_position_px(table, row)).collect(),
            seen: seen.collect(),
            table,
        }
    }

    /// How far a point is from its rest place in a frame, px.
    fn displacement(&self, row: usize, frame: usize) -> Option<Vector2<f64>> {
        let at = self.table.positions[row][frame]?;
        Some(at.cast::<f64>() - self.rest_px[row])
    }

    /// The points beside one that move most like it, the most alike first.
    fn alike(&self, row: usize) -> Vec<usize> {
        let mut near: Vec<(f64, usize)> = Vec::with_capacity(self.rest_px.len());
        for other in 0..self.rest_px.len() {
            if other != row && self.seen[other] >= LEAST_SEEN {
                near.push((
                    (self.rest_px[other] - self.rest_px[row]).norm_squared(),
                    other,
                ));
            }
        }
        smallest(&mut near, NEAREST);
        let mut alike: Vec<(f64, usize)> = Vec::with_capacity(near.len());
        for &(_, other) in &near {
            alike.extend(self.unlikeness_px(row, other).map(|px| (px, other)));
        }
        smallest(&mut alike, ALIKE);
        alike.into_iter().map(|(_, other)| other).collect()
    }

    /// Root mean square difference of the displacements of two points, px; `None` where they were
    /// never seen together.
    fn unlikeness_px(&self, a: usize, b: usize) -> Option<f64> {
        let (mut squares, mut count) = (0.0, 0_usize);
        for frame in 0..self.table.times_s.len() {
            if let (Some(of_a), Some(of_b)) =
                (self.displacement(a, frame), self.displacement(b, frame))
            {
                squares += (of_a - of_b).norm_squared();
                count += 1;
            }
        }
        (count > 0).then(|| (squares / count as f64).sqrt())
    }

    /// Holds a point against those that move alike; `None` where they say nothing.
    fn judge(&self, row: usize) -> Option<Verdict> {
        let alike = self.alike(row);
        let n_frames = self.table.times_s.len();
        let n = n_frames.min(FRAMES);
        let mut apart_px = Vec::with_capacity(n);
        for k in 0..n {
            let frame = k * (n_frames - 1) / (n - 1).max(1);
            if let (Some(is), Some(fit)) =
                (self.displacement(row, frame), self.fit(row, &alike, frame))
            {
                apart_px.push((is - fit.displacement).norm());
            }
        }
        Some(Verdict {
            row,
            wide_px: quantile(apart_px.clone(), WIDE)?,
            apart_px: median(apart_px, f64::total_cmp)?,
            unseen: self.unseen(row),
        })
    }

    /// What those that move alike say of a point in a frame.
    fn fit(&self, row: usize, alike: &[usize], frame: usize) -> Option<Fit> {
        let mut witnesses = Vec::with_capacity(alike.len());
        for &other in alike {
            if let Some(displacement) = self.displacement(other, frame) {
                witnesses.push(Witness {
                    offset: self.rest_px[other] - self.rest_px[row],
                    displacement,
                    weight: 1.0,
                });
            }
        }
        local_affine(&witnesses)
    }

    fn unseen(&self, row: usize) -> f64 {
        let places = &self.table.positions[row];
        let first = places.iter().position(Option::is_some).unwrap_or(0);
        let last = places.iter().rposition(Option::is_some).unwrap_or(0);
        1.0 - self.seen[row] as f64 / (last + 1 - first) as f64
    }
}

/// Keeps the `n` smallest, in growing order.
fn smallest(of: &mut Vec<(f64, usize)>, n: usize) {
    of.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    of.truncate(n);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::model::{Observation, TrackLog, TrackSet};
    use std::f64::consts::TAU;

    const LIMBS: u32 = 3;
    const FRAMES: u64 = 240;
    /// Slides to and fro along its limb.
    const SLIDES: TrackId = TrackId(7);
    /// Is lost in every third frame.
    const FLICKERS: TrackId = TrackId(40);
    /// Stands behind the tree.
    const RESTS: TrackId = TrackId(1000);

    /// Limbs that swing about one foot at 0.5, 0.8 and 1.1 Hz, with `n` points on each.
    fn frame(frame: u64, n: u32) -> TrackSet {
        let time_s = frame as f64 / 30.0;
        let mut observations = Vec::new();
        for limb in 0..LIMBS {
            let swing = (TAU * (0.5 + 0.3 * f64::from(limb)) * time_s).sin();
            let angle = 0.6 * (f64::from(limb) - 1.0) + 0.08 * swing;
            for k in 0..n {
                let id = TrackId(limb * n + k);
                let mut along_px = 30.0 + 150.0 * f64::from(k) / f64::from(n);
                if id == SLIDES {
                    along_px += 4.0 * (TAU * 0.9 * time_s).sin();
                }
                if id != FLICKERS || !frame.is_multiple_of(3) {
                    let (sin, cos) = angle.sin_cos();
                    observations.push(seen(id, 200.0 + along_px * sin, 220.0 - along_px * cos));
                }
            }
        }
        observations.push(seen(RESTS, 210.0, 100.0));
        TrackSet {
            frame,
            time_s,
            observations,
            ..TrackSet::default()
        }
    }

    fn seen(id: TrackId, u_px: f64, v_px: f64) -> Observation {
        Observation {
            id,
            u_px: u_px as f32,
            v_px: v_px as f32,
            fb_error_px: 0.05,
            error_px: None,
            confirmed: true,
            depth: None,
        }
    }

    fn left_out_of(n: u32, before: &BTreeSet<TrackId>) -> BTreeSet<TrackId> {
        let mut log = TrackLog::new(60.0);
        (0..FRAMES).for_each(|k| drop(log.push(frame(k, n))));
        left_out(log.all(), before, &Config::default().accumulate)
    }

    #[test]
    fn points_that_slide_or_flicker_go_first_and_never_come_back() {
        let out = left_out_of(32, &BTreeSet::new());
        assert_eq!(out.len(), 24, "a quarter of those that move");
        assert!(out.contains(&SLIDES) && out.contains(&FLICKERS), "{out:?}");
        assert!(!out.contains(&RESTS), "what rests is not judged");
        let gone = TrackId(5000);
        let mut all = (0..96).map(TrackId);
        let good = all.find(|id| !out.contains(id)).expect("most are good");
        let later = left_out_of(32, &BTreeSet::from([gone, good]));
        assert!(later.contains(&gone) && later.contains(&good) && later.contains(&SLIDES));
        assert_eq!(later.len(), 25, "still a quarter, and the one that is gone");
    }

    #[test]
    fn of_few_points_none_is_left_out() {
        assert!(left_out_of(21, &BTreeSet::new()).is_empty());
        let mut nothing = TrackLog::new(60.0);
        let settings = Config::default().accumulate;
        assert!(left_out(nothing.all(), &BTreeSet::new(), &settings).is_empty());
        nothing.push(TrackSet::default());
        assert!(left_out(nothing.all(), &BTreeSet::new(), &settings).is_empty());
    }
}

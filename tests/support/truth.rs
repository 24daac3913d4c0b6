//! True places of the shipped recording's points, and how tracks are held against them.

use crate::support;
use arborcam::config::Config;
use arborcam::model::TrackId;
use arborcam::track::Tracker;
use nalgebra::{Point2, distance};
use std::collections::{BTreeMap, BTreeSet};

const TRUTH: &str = "recordings/sparse_winter.truth";
/// A track is one of the truth's points if it was born so near to it, px, and not later than in
/// this frame.
const SNAP_PX: f64 = 2.5;
const LATEST_BIRTH: u64 = 5;
/// A branch's width: tracks beyond that are on another branch.
const NEAR_PX: f64 = 2.0;

/// Positions (px) of each point in the first and in the last second's frames.
pub struct Truth {
    frames: Vec<u64>,
    positions: Vec<Vec<Point2<f64>>>,
}

/// Places (px) of tracks by frame.
pub type Places = BTreeMap<TrackId, BTreeMap<u64, Point2<f64>>>;

/// How near to the truth tracks end.
#[derive(Clone, Copy, Debug)]
pub struct Score {
    /// Tracks that can be held against the truth.
    pub tracks: usize,
    /// Share of their places within 2 px of the truth; where a track is gone it is not.
    pub within_2px: f64,
    pub median_end_px: f64,
}

impl Truth {
    pub fn read() -> Self {
        let bytes = std::fs::read(TRUTH).expect("truth");
        let word =
            |i: usize| u32::from_le_bytes(bytes[4 * i..4 * i + 4].try_into().expect("four bytes"));
        let (points, frames) = (word(0) as usize, word(1) as usize);
        let places: Vec<Point2<f64>> = bytes[4 * (2 + frames)..]
            .as_chunks::<4>()
            .0
            .iter()
            .map(|b| Point2::new([b[0], b[1]], [b[2], b[3]]))
            .map(|p| p.map(|b| f64::from(u16::from_le_bytes(b)) / 64.0))
            .collect();
        assert_eq!(places.len(), points * frames);
        Self {
            frames: (0..frames).map(|k| word(2 + k).into()).collect(),
            positions: places.chunks_exact(points).map(<[_]>::to_vec).collect(),
        }
    }

    pub fn score(&self, tracks: &Places) -> Score {
        let (mut near, mut pairs, mut errors) = (0usize, 0usize, Vec::new());
        let mut scored = 0;
        for seen in tracks.values() {
            let Some((_, &born)) = seen
                .first_key_value()
                .filter(|(frame, _)| **frame <= LATEST_BIRTH)
            else {
                continue;
            };
            let nearest = |a: &usize, b: &usize| {
                distance(&self.positions[0][*a], &born)
                    .total_cmp(&distance(&self.positions[0][*b], &born))
            };
            let point = (0..self.positions[0].len())
                .min_by(nearest)
                .expect("points");
            let start = self.positions[0][point];
            if distance(&start, &born) > SNAP_PX {
                continue;
            }
            scored += 1;
            for (frame, positions) in self.frames.iter().zip(&self.positions).skip(1) {
                let at = positions[point];
                pairs += 1;
                let Some(&there) = seen.get(frame) else {
                    continue;
                };
                let error = distance(&there, &(at + born.coords - start.coords));
                near += usize::from(error < NEAR_PX);
                errors.push(error);
            }
        }
        Score {
            tracks: scored,
            within_2px: near as f64 / pairs as f64,
            median_end_px: median(&mut errors),
        }
    }
}

pub fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// All tracks of the recording that are kept, by frame, and the median of the errors that the
/// tracker itself expects in the last frame, px.
pub fn tracks() -> (Places, f64) {
    let config = Config::default();
    let mut tracker = Tracker::new(&config.detect, &config.track, &support::outline(), 0);
    let mut decode = support::decoding();
    let (mut places, mut rejected, mut expected) = (Places::new(), BTreeSet::new(), Vec::new());
    for k in 0..support::recording().len() {
        let set = tracker.step(&support::decoded(&mut decode, k));
        for o in &set.observations {
            places.entry(o.id).or_default().insert(set.frame, o.at_px());
        }
        rejected.extend(set.rejected.iter().copied());
        expected = set
            .counted()
            .filter_map(|o| o.error_px)
            .map(f64::from)
            .collect();
    }
    places.retain(|id, _| !rejected.contains(id));
    (places, median(&mut expected))
}

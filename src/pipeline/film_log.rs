//! Frames as they came, kept for their colours, and the wood that was found in them.

use crate::model::{RawFrame, TrackSet, Wood, WoodSeen};
use crate::random::seed_of_part;
use std::sync::Arc;

/// Frames that are kept.
const MOST: usize = 40;
/// They take no more memory than this, bytes; but never are fewer kept than [`LEAST`].
const MOST_BYTES: usize = 32 << 20;
const LEAST: usize = 12;

/// A random choice of the frames of the last seconds: enough to see every pose of the tree, and
/// whatever its rhythm, not always the same one. Memory is bounded. What was found in frames stays
/// when they are gone.
#[derive(Clone, Debug)]
pub struct FilmLog {
    remembered_s: f64,
    kept: Vec<KeptFrame>,
    wood: WoodSeen,
}

/// A frame that is kept.
#[derive(Clone, Debug)]
pub struct KeptFrame {
    pub frame: u64,
    pub time_s: f64,
    pub raw: Arc<RawFrame>,
    /// The frames of least rank stay. It hangs on the frame's number alone, so that a replay keeps
    /// the same frames.
    rank: u64,
}

impl FilmLog {
    /// A log that remembers `remembered_s` seconds.
    pub fn new(remembered_s: f64) -> Self {
        Self {
            remembered_s,
            kept: Vec::new(),
            wood: WoodSeen::new(),
        }
    }

    /// Takes the next frame, with the tracks in it.
    pub fn push(&mut self, raw: Arc<RawFrame>, tracks: &TrackSet) {
        let oldest_s = tracks.time_s - self.remembered_s;
        self.kept.retain(|kept| kept.time_s >= oldest_s);
        self.kept.push(KeptFrame {
            frame: tracks.frame,
            time_s: tracks.time_s,
            raw,
            rank: seed_of_part(0, tracks.frame),
        });
        while self.kept.len() > MOST || self.kept.len() > LEAST && self.bytes() > MOST_BYTES {
            let ranks = self.kept.iter().map(|kept| kept.rank);
            let Some((last, _)) = ranks.enumerate().max_by_key(|(_, rank)| *rank) else {
                return;
            };
            self.kept.remove(last);
        }
    }

    fn bytes(&self) -> usize {
        self.kept.iter().map(|kept| kept.raw.bytes.len()).sum()
    }

    /// What is kept, oldest first.
    pub fn frames(&self) -> &[KeptFrame] {
        &self.kept
    }

    /// The wood that was found, by the newest frame that it was looked for with.
    pub fn wood(&self) -> &WoodSeen {
        &self.wood
    }

    /// That which was found with `frame`, or last before it.
    pub fn wood_by(&self, frame: u64) -> Option<&Arc<Wood>> {
        let (_, wood) = self.wood.range(..=frame).next_back()?;
        Some(wood)
    }

    /// Whether wood was found with `frame`.
    pub fn has_wood_of(&self, frame: u64) -> bool {
        self.wood.contains_key(&frame)
    }

    /// Remembers what was found with `frame`. What earlier wood was found in is forgotten: that
    /// of a long film would fill the memory.
    pub fn note_wood(&mut self, frame: u64, wood: Arc<Wood>) {
        self.wood.entry(frame).or_insert(wood);
        for older in self.wood.values_mut().rev().skip(1) {
            if older.at_rest.is_some() {
                *older = Arc::new(Wood {
                    at_rest: None,
                    ..Wood::clone(older)
                });
            }
        }
    }

    /// Takes what was found in this film when its frames were there.
    pub fn put_wood(&mut self, wood: WoodSeen) {
        self.wood = wood;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{AtRest, PixelFormat, Size};

    fn filmed(log: &mut FilmLog, frames: std::ops::Range<u64>, bytes: usize) {
        let raw = Arc::new(RawFrame {
            sequence: None,
            sensor_time_s: 0.0,
            size: Size::new(1, 1),
            format: PixelFormat::Grey,
            bytes: vec![0; bytes],
            depth: None,
        });
        for frame in frames {
            let tracks = TrackSet {
                frame,
                time_s: frame as f64 / 30.0,
                ..TrackSet::default()
            };
            log.push(raw.clone(), &tracks);
        }
    }

    fn kept(log: &FilmLog) -> Vec<u64> {
        log.frames().iter().map(|kept| kept.frame).collect()
    }

    #[test]
    fn of_a_long_film_some_frames_of_the_last_seconds_are_kept() {
        let mut log = FilmLog::new(20.0);
        filmed(&mut log, 0..3000, 10);
        let frames = kept(&log);
        assert_eq!(frames.len(), MOST);
        assert!(frames.iter().all(|f| *f >= 3000 - 601), "{frames:?}");
        assert!(frames.is_sorted() && frames[MOST / 2] < 2900, "{frames:?}");
        let mut again = FilmLog::new(20.0);
        filmed(&mut again, 0..3000, 10);
        assert_eq!(kept(&again), frames);
    }

    #[test]
    fn pictures_are_remembered_of_the_newest_wood_alone() {
        let wood = Arc::new(Wood {
            at_rest: Some(Arc::new(AtRest::made_up(Size::new(1, 1)))),
            ..Wood::default()
        });
        let mut log = FilmLog::new(20.0);
        // A refinement that finds none goes on with what it had.
        for frame in [90, 120, 170] {
            log.note_wood(frame, wood.clone());
        }
        let wood = log.wood().values();
        let has_pictures: Vec<bool> = wood.map(|w| w.at_rest.is_some()).collect();
        assert_eq!(has_pictures, [false, false, true]);
    }

    #[test]
    fn large_frames_take_no_more_memory_but_some_are_kept() {
        let mut log = FilmLog::new(20.0);
        filmed(&mut log, 0..100, 2 << 20);
        assert_eq!(log.frames().len(), 16);
        filmed(&mut log, 100..200, 4 << 20);
        assert_eq!(log.frames().len(), LEAST);
    }
}

//! Whether depth images are of the moment that their stamps say. A branch moves in both: a depth image fits its points
//! best where they were when it was taken. That shows a clock that is late, and one that drifts, where stamps alone
//! show nothing: at 30 images/s some image is always within 17 ms of each picture.

use super::{DepthReader, Pixel};
use crate::config;
use crate::model::{DEPTH_APART_S, DepthImage, LONGEST_LAG_S, Size, TrackId, TrackSet};
use crate::signal::vectors::keep_every_other;
use nalgebra::{Point2, Vector2};
use std::collections::VecDeque;
use std::sync::Arc;

/// Lags are looked for in so many steps to each side.
const STEPS: usize = 15;
const STEP_S: f64 = LONGEST_LAG_S / STEPS as f64;
const LAGS: usize = 2 * STEPS + 1;
/// Depth images this far apart are compared: a slow branch has moved by then, s.
const APART_S: f64 = 0.25;
/// One image in so many seconds is looked at.
const EVERY_S: f64 = 0.1;
/// So many points are looked at, and so many places to each side of each of them.
const POINTS: usize = 120;
const SIDE: i32 = 2;
/// Distance of those places, shares of the picture's width: 4 px of 640.
const SPACING: f64 = 1.0 / 160.0;
/// Depths that differ by more than this share are of different things.
const JUMP_SHARE: f64 = 0.05;
/// Each piece of film of this length gives a lag of its own, s.
const BLOCK_S: f64 = 2.0;
/// The lag is known by so many of them at least.
const LEAST_BLOCKS: usize = 5;
/// So many are kept; when there are more, every other one goes.
const MOST_BLOCKS: usize = 500;
/// Images that wait, and frames that are kept: memory stays bounded whatever the times are.
const MOST_WAITING: usize = 12;
const MOST_FRAMES: usize = 200;

/// How much later depth images are stamped than they were taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthLag {
    /// What the stamps were set right by before, s.
    pub given_s: f64,
    /// In the middle of the film so far, and its standard deviation, s; below 0 where they are stamped too early.
    pub late_s: f64,
    pub late_sd_s: f64,
    /// By how much that grows, and its standard deviation, s each second.
    pub drift: f64,
    pub drift_sd: f64,
    /// How far apart the ends of the film so far are, s.
    pub span_s: f64,
}

/// A lag or a drift counts beyond so many standard deviations.
const SURE_SDS: f64 = 3.0;

impl DepthLag {
    /// Whether depth images are of another moment than their pictures, by more than the times of the two may differ.
    pub fn is_late(&self) -> bool {
        self.late_s.abs() > DEPTH_APART_S + SURE_SDS * self.late_sd_s
    }

    /// Whether the two clocks do not run alike: the lag has changed by more than the times may differ.
    pub fn drifts(&self) -> bool {
        let sure = self.drift.abs() - SURE_SDS * self.drift_sd;
        sure * self.span_s > DEPTH_APART_S
    }
}

/// Measures it, a frame at a time.
#[derive(Clone, Debug)]
pub struct LagMeter {
    reader: DepthReader,
    given_s: f64,
    frames: VecDeque<Seen>,
    waiting: VecDeque<Waiting>,
    /// The block that is being filled.
    begun_s: Option<f64>,
    halves: [Curve; 2],
    blocks: Vec<Block>,
}

/// Where points were seen in a frame, px, by id.
#[derive(Clone, Debug)]
struct Seen {
    time_s: f64,
    places: Vec<(TrackId, Point2<f64>)>,
}

impl Seen {
    fn place(&self, id: TrackId) -> Option<Point2<f64>> {
        let at = self.places.binary_search_by_key(&id, |place| place.0);
        at.ok().map(|at| self.places[at].1)
    }
}

/// A depth image that is looked at when the frames after it are known.
#[derive(Clone, Debug)]
struct Waiting {
    time_s: f64,
    image: Arc<DepthImage>,
    picture: Size,
}

/// The lag of a piece of film.
#[derive(Clone, Copy, Debug)]
struct Block {
    middle_s: f64,
    late_s: f64,
}

/// How often two images show different things beside a point, for each lag.
#[derive(Clone, Copy, Debug)]
struct Curve {
    looked: [u32; LAGS],
    differ: [u32; LAGS],
}

impl Curve {
    const EMPTY: Self = Self {
        looked: [0; LAGS],
        differ: [0; LAGS],
    };

    fn with(&self, other: &Self) -> Self {
        let mut both = *self;
        for k in 0..LAGS {
            both.looked[k] += other.looked[k];
            both.differ[k] += other.differ[k];
        }
        both
    }

    /// Share of the places that differ at a lag.
    fn share(&self, k: usize) -> f64 {
        f64::from(self.differ[k]) / f64::from(self.looked[k].max(1))
    }

    /// The lag at which the images differ least, by a parabola through the three shares there, s; `None` at the end
    /// of the range.
    fn least_s(&self) -> Option<f64> {
        if self.looked.contains(&0) {
            return None;
        }
        let least = (0..LAGS).min_by(|a, b| self.share(*a).total_cmp(&self.share(*b)))?;
        if least == 0 || least == LAGS - 1 {
            return None;
        }
        let [before, at, after] = [least - 1, least, least + 1].map(|k| self.share(k));
        let bend = before - 2.0 * at + after;
        (bend > 0.0).then(|| lag_s(least) + 0.5 * STEP_S * (before - after) / bend)
    }
}

/// The lag of an entry of a curve, s.
fn lag_s(k: usize) -> f64 {
    (k as f64 - STEPS as f64) * STEP_S
}

impl LagMeter {
    /// `None` for a film without depth.
    pub fn new(settings: &config::Depth) -> Option<Self> {
        Some(Self {
            reader: DepthReader::new(settings)?,
            given_s: settings.late_s,
            frames: VecDeque::new(),
            waiting: VecDeque::new(),
            begun_s: None,
            halves: [Curve::EMPTY; 2],
            blocks: Vec::new(),
        })
    }

    /// Takes the points of the next frame and the depth image that belongs to it, if there is one.
    pub fn step(&mut self, tracks: &TrackSet, picture: Size, image: Option<&Arc<DepthImage>>) {
        let time_s = tracks.time_s;
        let places = tracks.counted().map(|o| (o.id, tracks.filmed_px(o)));
        self.frames.push_back(Seen {
            time_s,
            places: places.collect(),
        });
        let is_due = self
            .waiting
            .back()
            .is_none_or(|last| time_s - last.time_s >= EVERY_S);
        if let Some(image) = image.filter(|_| is_due) {
            self.waiting.push_back(Waiting {
                time_s: time_s + image.later_s,
                image: image.clone(),
                picture,
            });
        }
        while let Some(second) = self.next_pair()
            && let Some(first) = self.waiting.pop_front()
        {
            self.compare(&first, &second);
        }
        self.forget();
    }

    /// The image that the first of those that wait is compared with, if the points of both are known at all lags.
    fn next_pair(&self) -> Option<Waiting> {
        let (first, last) = (self.waiting.front()?, self.frames.back()?);
        let second = self
            .waiting
            .iter()
            .find(|later| later.time_s - first.time_s >= APART_S)?;
        (last.time_s - second.time_s >= LONGEST_LAG_S).then(|| second.clone())
    }

    /// Forgets frames that no image needs any more.
    fn forget(&mut self) {
        while self.waiting.len() > MOST_WAITING {
            self.waiting.pop_front();
        }
        let newest_s = self.frames.back().map_or(0.0, |frame| frame.time_s);
        let from_s = self.waiting.front().map_or(newest_s, |first| first.time_s) - LONGEST_LAG_S;
        while self.frames.len() > MOST_FRAMES
            || self.frames.get(1).is_some_and(|next| next.time_s < from_s)
        {
            self.frames.pop_front();
        }
    }

    /// Compares an image with a later one, at all lags.
    fn compare(&mut self, first: &Waiting, second: &Waiting) {
        let begun_s = *self.begun_s.get_or_insert(first.time_s);
        if first.time_s - begun_s >= BLOCK_S {
            self.end_block(0.5 * (begun_s + first.time_s));
            self.begun_s = Some(first.time_s);
        }
        let mut halves = self.halves;
        for k in 0..LAGS {
            let then = self.moment(first.time_s - lag_s(k));
            let later = self.moment(second.time_s - lag_s(k));
            if let (Some(then), Some(later)) = (then, later) {
                self.compare_at(k, (first, &then), (second, &later), &mut halves);
            }
        }
        self.halves = halves;
    }

    /// Compares two images beside the points of two moments. Each half of the points has a curve of its own.
    fn compare_at(
        &self,
        k: usize,
        (first, then): (&Waiting, &Moment),
        (second, later): (&Waiting, &Moment),
        halves: &mut [Curve; 2],
    ) {
        let places = &then.before.places;
        // By their ids: a point that is lost changes nothing for the others.
        let stride = places.len().div_ceil(POINTS).max(1) as u32;
        for (id, _) in places
            .iter()
            .filter(|(id, _)| (id.0 / 2).is_multiple_of(stride))
        {
            if let (Some(then_px), Some(later_px)) = (then.place(*id), later.place(*id)) {
                let curve = &mut halves[(id.0 % 2) as usize];
                curve.looked[k] += 1;
                curve.differ[k] += self.differences(first, then_px, second, later_px);
            }
        }
    }

    /// How many places about a point show one thing in the first image and another in the second.
    fn differences(
        &self,
        first: &Waiting,
        then_px: Point2<f64>,
        second: &Waiting,
        later_px: Point2<f64>,
    ) -> u32 {
        let spacing_px = SPACING * f64::from(first.picture.width);
        let mut differ = 0;
        for down in -SIDE..=SIDE {
            for across in -SIDE..=SIDE {
                let beside = Vector2::new(f64::from(across), f64::from(down)) * spacing_px;
                let was_m = self.depth_m(first, then_px + beside);
                let is_m = self.depth_m(second, later_px + beside);
                let is_alike = match (was_m, is_m) {
                    (Some(was_m), Some(is_m)) => {
                        (was_m - is_m).abs() <= JUMP_SHARE * was_m.min(is_m)
                    }
                    (None, None) => true,
                    _ => false,
                };
                differ += u32::from(!is_alike);
            }
        }
        differ
    }

    fn depth_m(&self, seen: &Waiting, at_px: Point2<f64>) -> Option<f64> {
        let pixel = Pixel::at(at_px, seen.picture, seen.image.size)?;
        self.reader.depth_m(&seen.image, pixel)
    }

    /// The points at a time between two frames.
    fn moment(&self, time_s: f64) -> Option<Moment<'_>> {
        let next = self.frames.partition_point(|frame| frame.time_s < time_s);
        let (before, after) = (
            self.frames.get(next.checked_sub(1)?)?,
            self.frames.get(next)?,
        );
        Some(Moment {
            before,
            after,
            share: (time_s - before.time_s) / (after.time_s - before.time_s),
        })
    }

    /// Ends a block; it gives a lag if both halves of its points give the same.
    fn end_block(&mut self, middle_s: f64) {
        let [even, odd] = std::mem::replace(&mut self.halves, [Curve::EMPTY; 2]);
        let is_known = match (even.least_s(), odd.least_s()) {
            (Some(even_s), Some(odd_s)) => (even_s - odd_s).abs() <= STEP_S,
            _ => false,
        };
        if let Some(late_s) = even.with(&odd).least_s().filter(|_| is_known) {
            self.blocks.push(Block { middle_s, late_s });
        }
        if self.blocks.len() > MOST_BLOCKS {
            keep_every_other(&mut self.blocks);
        }
    }

    /// The lag and its drift: a line through those of the blocks by least squares. `None` while there are too few of
    /// them: what does not move shows no lag.
    pub fn lag(&self) -> Option<DepthLag> {
        let (first, last) = (self.blocks.first()?, self.blocks.last()?);
        let n = self.blocks.len() as f64;
        if self.blocks.len() < LEAST_BLOCKS {
            return None;
        }
        let middle_s = self.blocks.iter().map(|b| b.middle_s).sum::<f64>() / n;
        let late_s = self.blocks.iter().map(|b| b.late_s).sum::<f64>() / n;
        let (mut spread, mut product) = (0.0, 0.0);
        for block in &self.blocks {
            spread += (block.middle_s - middle_s).powi(2);
            product += (block.middle_s - middle_s) * (block.late_s - late_s);
        }
        let drift = product / spread;
        let misses_s = self
            .blocks
            .iter()
            .map(|b| b.late_s - late_s - drift * (b.middle_s - middle_s));
        let sd_s = (misses_s.map(|miss_s| miss_s * miss_s).sum::<f64>() / (n - 2.0)).sqrt();
        Some(DepthLag {
            given_s: self.given_s,
            late_s,
            late_sd_s: sd_s / n.sqrt(),
            drift,
            drift_sd: sd_s / spread.sqrt(),
            span_s: last.middle_s - first.middle_s,
        })
    }
}

/// The points at a time between two frames.
struct Moment<'a> {
    before: &'a Seen,
    after: &'a Seen,
    /// Of the way from the one to the other.
    share: f64,
}

impl Moment<'_> {
    fn place(&self, id: TrackId) -> Option<Point2<f64>> {
        let (from, to) = (self.before.place(id)?, self.after.place(id)?);
        Some(from + (to - from) * self.share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Observation;

    const SIZE: Size = Size {
        width: 320,
        height: 180,
    };
    /// How clocks of a film run, and how far its twigs move.
    #[derive(Clone, Copy)]
    struct Film {
        late_s: f64,
        drift: f64,
        swing_px: f64,
        rate_hz: f64,
    }

    const TRUE: Film = Film {
        late_s: 0.0,
        drift: 0.0,
        swing_px: 12.0,
        rate_hz: 30.0,
    };

    impl Film {
        /// What 20 s of it show of the lag.
        fn lag(&self) -> Option<DepthLag> {
            let settings = config::Depth {
                unit_m: 0.001,
                fx_px: 300.0,
                fy_px: 300.0,
                ..config::Depth::default()
            };
            let mut meter = LagMeter::new(&settings).expect("depth");
            for k in 0..(20.0 * self.rate_hz) as u32 {
                let time_s = f64::from(k) / self.rate_hz;
                // Stamped a third of a frame later than the picture.
                let later_s = 0.33 / self.rate_hz;
                let taken_s = time_s + later_s - self.late_s - self.drift * time_s;
                let image = Arc::new(DepthImage {
                    later_s,
                    ..self.image(taken_s, k)
                });
                meter.step(&self.tracks(time_s), SIZE, Some(&image));
            }
            assert!(meter.waiting.len() < MOST_WAITING && meter.frames.len() < 40);
            meter.lag()
        }

        /// Where twig `n` is across, px.
        fn across_px(&self, n: u32, time_s: f64) -> f64 {
            let rate = 3.0 + 0.7 * f64::from(n);
            40.0 + 50.0 * f64::from(n) + self.swing_px * (rate * time_s + f64::from(n)).sin()
        }

        fn tracks(&self, time_s: f64) -> TrackSet {
            let mut observations = Vec::new();
            for n in 0..5 {
                for k in 0..8 {
                    observations.push(Observation {
                        id: TrackId(8 * n + k),
                        u_px: self.across_px(n, time_s) as f32,
                        v_px: 20.0 + 18.0 * k as f32,
                        fb_error_px: 0.0,
                        error_px: None,
                        confirmed: true,
                        depth: None,
                    });
                }
            }
            TrackSet {
                time_s,
                observations,
                ..TrackSet::default()
            }
        }

        /// Twigs 5 px wide at 2 m, before nothing; one pixel in twenty flickers by chance.
        fn image(&self, time_s: f64, k: u32) -> DepthImage {
            let mut counts = vec![0; SIZE.area()];
            for n in 0..5 {
                let middle_px = self.across_px(n, time_s).round() as usize;
                for row in counts.chunks_exact_mut(SIZE.width as usize) {
                    row[middle_px - 2..=middle_px + 2].fill(2000);
                }
            }
            let mut chance = k;
            for count in &mut counts {
                chance = chance.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                if chance >> 16 < 3277 {
                    *count = 2000 - *count;
                }
            }
            DepthImage::new(SIZE, counts)
        }
    }

    #[test]
    fn a_clock_that_is_late_or_drifts_shows_in_what_moves() {
        let right = TRUE.lag().expect("a lag");
        assert!(right.late_s.abs() < 0.003 && !right.is_late() && !right.drifts());
        for (late_s, rate_hz) in [(0.05, 30.0), (-0.07, 30.0), (0.1, 16.0)] {
            let late = Film {
                late_s,
                rate_hz,
                ..TRUE
            };
            let late = late.lag().expect("a lag");
            assert!((late.late_s - late_s).abs() < 0.003, "{late:?}");
            assert!(late.is_late() && !late.drifts(), "{late:?}");
        }
        let drifting = Film {
            drift: 0.01,
            ..TRUE
        };
        let drifting = drifting.lag().expect("a lag");
        assert!(drifting.drifts() && (drifting.drift - 0.01).abs() < 0.001);
    }

    #[test]
    fn what_stands_still_shows_no_lag() {
        let still = Film {
            late_s: 0.1,
            swing_px: 0.0,
            ..TRUE
        };
        let lag = still.lag();
        assert!(
            lag.is_none_or(|lag| !lag.is_late() && !lag.drifts()),
            "{lag:?}"
        );
    }
}

//! The points of a film, by the branch that they are on: what sway is measured from.

use super::members::mean_px;
use crate::model::{LogWindow, NodeId, Skeleton, TrackId};
use crate::signal::statistics::{median_vector, nth_smallest, rms};
use nalgebra::{Point2, Vector2};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

/// The place of a point in a frame that does not show it, px.
pub const NOT_SEEN: Point2<f64> = Point2::new(f64::NAN, f64::NAN);

/// One followed point.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmTrack {
    /// The deepest node that it belongs to.
    pub node: NodeId,
    /// Where it was in every frame of the film, px; no numbers where it was not seen.
    pub at_px: Vec<Point2<f64>>,
}

impl FilmTrack {
    /// The middle of its motion, px; `None` where it was never seen.
    pub fn middle_px(&self) -> Option<Point2<f64>> {
        let seen = self.at_px.iter().filter(|at| at.x.is_finite());
        seen.clone().next()?;
        Some(median_vector(seen.map(|at| at.coords)).into())
    }

    /// Standard deviation of its place, px; 0 where it was never seen.
    pub fn spread_px(&self) -> f64 {
        let seen = self.at_px.iter().filter(|at| at.x.is_finite());
        let n = seen.clone().count().max(1) as f64;
        let middle = seen.clone().map(|at| at.coords).sum::<Vector2<f64>>() / n;
        rms(seen.map(|at| (at.coords - middle).norm()))
    }

    /// Some of the frames; not seen in those that it does not have.
    fn in_frames(&self, frames: &[usize]) -> Self {
        let mut at_px = Vec::with_capacity(frames.len());
        for &k in frames {
            at_px.push(self.at_px.get(k).copied().unwrap_or(NOT_SEEN));
        }
        Self {
            node: self.node,
            at_px,
        }
    }
}

/// The points of a film in all its frames. Times are those of the sensor: they need not be even,
/// and frames may be missing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Film {
    /// Strictly growing, s.
    pub times_s: Vec<f64>,
    pub tracks: Vec<FilmTrack>,
    /// Whether the points are markers, each bound to its branch by hand: one is enough. Of points that
    /// were found to move together several must agree.
    pub are_markers: bool,
}

impl Film {
    /// Frames whose time is no number, or not later than the one before, are left out: nothing can
    /// be said of them.
    pub fn new(times_s: &[f64], tracks: Vec<FilmTrack>) -> Self {
        let mut kept: Vec<usize> = Vec::with_capacity(times_s.len());
        for (k, time_s) in times_s.iter().enumerate() {
            let last_s = kept.last().map_or(f64::NEG_INFINITY, |&k| times_s[k]);
            if time_s.is_finite() && *time_s > last_s {
                kept.push(k);
            }
        }
        Self {
            times_s: kept.iter().map(|&k| times_s[k]).collect(),
            tracks: tracks.iter().map(|t| t.in_frames(&kept)).collect(),
            are_markers: false,
        }
    }

    /// Points that a branch must have, where `of_followed` are needed to agree.
    pub(super) fn least_points(&self, of_followed: usize) -> usize {
        if self.are_markers { 1 } else { of_followed }
    }

    /// The points of a part of the log; `node_of` says on which measured node of `skeleton` a point
    /// is, `None` where on none.
    pub fn from_log(
        window: LogWindow,
        skeleton: &Skeleton,
        node_of: impl Fn(TrackId) -> Option<NodeId>,
    ) -> Self {
        let measured = skeleton.measured();
        let mut tracks: BTreeMap<TrackId, Option<FilmTrack>> = BTreeMap::new();
        for (k, set) in window.sets().enumerate() {
            for o in &set.observations {
                let track = tracks.entry(o.id).or_insert_with(|| {
                    let node = node_of(o.id).filter(|n| n.index() < measured)?;
                    let at_px = vec![NOT_SEEN; window.len()];
                    Some(FilmTrack { node, at_px })
                });
                if let Some(track) = track {
                    track.at_px[k] = o.at_px();
                }
            }
        }
        let times_s: Vec<f64> = window.sets().map(|set| set.time_s).collect();
        Self::new(&times_s, tracks.into_values().flatten().collect())
    }

    /// The same points, each at another place of the picture.
    pub fn moved(&self, to: impl Fn(Point2<f64>) -> Point2<f64>) -> Self {
        let mut film = self.clone();
        for at_px in film.tracks.iter_mut().flat_map(|track| &mut track.at_px) {
            *at_px = to(*at_px);
        }
        film
    }

    /// The points where they are when the middle row of each frame is read, of a camera that reads the
    /// rows of a picture of this height one after the other within `readout_s`, s: each is carried back
    /// from when its own row is read, by its speed and acceleration there (a Taylor series).
    pub fn at_middle_rows(&self, readout_s: f64, height_px: f64) -> Self {
        let mut film = self.clone();
        for (track, carried) in self.tracks.iter().zip(&mut film.tracks) {
            for k in 1..self.times_s.len().max(1) - 1 {
                let [before, at, after] = [k - 1, k, k + 1].map(|k| track.at_px[k]);
                let late_s = (at.y / height_px - 0.5) * readout_s;
                let [first_s, last_s] = [
                    self.times_s[k] - self.times_s[k - 1],
                    self.times_s[k + 1] - self.times_s[k],
                ];
                let (back, ahead) = ((at - before) / first_s, (after - at) / last_s);
                let speed = (last_s * back + first_s * ahead) / (first_s + last_s);
                let acceleration = 2.0 * (ahead - back) / (first_s + last_s);
                let there = at - late_s * speed + 0.5 * late_s * late_s * acceleration;
                if there.x.is_finite() && there.y.is_finite() {
                    carried.at_px[k] = there;
                }
            }
        }
        film
    }

    /// From the time of the first frame to that of the last, s.
    pub fn span_s(&self) -> f64 {
        self.times_s
            .last()
            .zip(self.times_s.first())
            .map_or(0.0, |(b, a)| b - a)
    }

    /// Some of the frames; itself where these are all.
    pub fn part(&self, frames: Range<usize>) -> Cow<'_, Self> {
        if frames.len() == self.times_s.len() {
            return Cow::Borrowed(self);
        }
        let mut tracks = Vec::with_capacity(self.tracks.len());
        for track in &self.tracks {
            tracks.push(FilmTrack {
                node: track.node,
                at_px: track.at_px[frames.clone()].to_vec(),
            });
        }
        Cow::Owned(Self {
            times_s: self.times_s[frames].to_vec(),
            tracks,
            are_markers: self.are_markers,
        })
    }

    /// Each `every` neighbouring frames as one: the means of their times, and of the places of each
    /// point in those that show it. Frames between which some are missing are not put together.
    pub(super) fn in_means_of(film: Cow<'_, Self>, every: usize) -> Cow<'_, Self> {
        if every < 2 {
            return film;
        }
        let neighbours = film.neighbours(every);
        let mut tracks = Vec::with_capacity(film.tracks.len());
        for track in &film.tracks {
            let places = neighbours
                .iter()
                .map(|of| mean_px(&track.at_px[of.clone()]));
            tracks.push(FilmTrack {
                node: track.node,
                at_px: places.collect(),
            });
        }
        let times_s = neighbours.iter().map(|of| {
            let frames = of.len() as f64;
            film.times_s[of.clone()].iter().sum::<f64>() / frames
        });
        Cow::Owned(Self {
            times_s: times_s.collect(),
            tracks,
            are_markers: film.are_markers,
        })
    }

    /// The frames by `every` neighbours, or fewer where some are missing.
    fn neighbours(&self, every: usize) -> Vec<Range<usize>> {
        let within_s = (every as f64 - 0.5) * self.step_s();
        let mut out: Vec<Range<usize>> = Vec::with_capacity(self.times_s.len() / every + 1);
        for (k, time_s) in self.times_s.iter().enumerate() {
            match out.last_mut() {
                Some(last)
                    if last.len() < every && time_s - self.times_s[last.start] < within_s =>
                {
                    last.end = k + 1;
                }
                _ => out.push(k..k + 1),
            }
        }
        out
    }

    /// Times of some frames, s.
    pub(super) fn times_of(&self, frames: &[usize]) -> Vec<f64> {
        frames.iter().map(|&k| self.times_s[k]).collect()
    }

    /// Time that three quarters of the frames are not farther apart than, s; infinite for less than
    /// two frames.
    pub fn step_s(&self) -> f64 {
        let steps: Vec<f64> = self.times_s.windows(2).map(|w| w[1] - w[0]).collect();
        let three_quarters = 3 * steps.len() / 4;
        nth_smallest(steps, three_quarters).unwrap_or(f64::INFINITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point at the lower edge, 10 ms after the middle row of each frame: its phase is that of the middle
    /// row to a tenth of a degree, and was 7 degrees off.
    #[test]
    fn points_are_carried_to_when_the_middle_row_is_read() {
        let turn = std::f64::consts::TAU * 2.0;
        let times_s: Vec<f64> = (0..60).map(|k| f64::from(k) / 30.0).collect();
        let filmed = times_s
            .iter()
            .map(|t| Point2::new(5.0 * (turn * (t + 0.01)).sin(), 360.0));
        let track = FilmTrack {
            node: NodeId(1),
            at_px: filmed.collect(),
        };
        let film = Film::new(&times_s, vec![track]).at_middle_rows(0.02, 360.0);
        for (t, at) in times_s.iter().zip(&film.tracks[0].at_px).skip(1).take(58) {
            let off = at.x - 5.0 * (turn * t).sin();
            assert!(off.abs() < 0.03, "at {t} s {off} px off");
        }
        assert!(
            Film::default()
                .at_middle_rows(0.02, 360.0)
                .tracks
                .is_empty()
        );
    }

    /// Ten minutes of points are some hundred megabytes: no copy is made of a film that is used
    /// whole.
    #[test]
    fn only_a_film_that_is_cut_is_copied() {
        let at_px = (0..4).map(|k| Point2::new(f64::from(k), 1.0)).collect();
        let film = Film::new(
            &[0.0, 0.1, 0.2, 0.3],
            vec![FilmTrack {
                node: NodeId(1),
                at_px,
            }],
        );
        assert!(matches!(film.part(0..4), Cow::Borrowed(_)));
        let cut = film.part(0..3);
        assert_eq!(
            (cut.times_s.len(), cut.tracks[0].at_px.last()),
            (3, Some(&Point2::new(2.0, 1.0)))
        );
    }
}

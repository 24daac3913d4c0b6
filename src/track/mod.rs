//! Points inside the outline, followed from frame to frame.
//!
//! Each frame: flow forward and back; who does not come home rides on its neighbours for a while; a
//! part of the points is put back on its first patch; who is lost is replaced. Ids are never used
//! twice.

mod anchor;
mod detect;
mod flow;
mod neighbours;
mod point;
mod regain;
mod register;
mod trial;

pub use detect::Detector;
pub use flow::{Flow, OpticalFlow, Pyramid};

use crate::config::{Detect, Track};
use crate::model::{Frame, Observation, Outline, TrackId, TrackSet};
use anchor::{Anchoring, Keyframe, distance};
use neighbours::Fit;
use point::{Point, Record};
use trial::{Trial, Trials};

/// Pictures kept to put points back on; the oldest but the first gives way.
const KEYFRAMES: usize = 4;
/// New points are looked for when so great a share of the wanted ones is missing, and not more
/// often than this.
const REFILL_SHARE: f64 = 0.1;
const REFILL_S: f64 = 0.5;
/// Where there were not enough good points to be found, they are looked for again after so long, s.
const TRY_AGAIN_S: f64 = 10.0;

/// Follows points through the frames of one capture; holds what must last from frame to frame.
pub struct Tracker {
    settings: Track,
    wanted: usize,
    detector: Detector,
    flow: OpticalFlow,
    anchoring: Anchoring,
    previous: Pyramid,
    present: Pyramid,
    /// Number and picture; numbers grow.
    keyframes: Vec<(u32, Keyframe)>,
    /// Ordered by id.
    points: Vec<Point>,
    next_id: u32,
    next_keyframe: u32,
    frames: u64,
    detected_s: f64,
    gaps: regain::Gaps,
    trials: Option<Trials>,
    /// Expected error that points of later trials must not exceed, px; known after the first.
    bar_px: Option<f32>,
    /// Number of points after the last trial, the wanted number before.
    settled: usize,
    /// What the neighbours of each point say in this frame.
    fits: Vec<Option<Fit>>,
    buffers: Buffers,
}

#[derive(Default)]
struct Buffers {
    from: Vec<[f32; 2]>,
    to: Vec<[f32; 2]>,
    forward: Vec<Flow>,
    backward: Vec<Flow>,
}

impl Tracker {
    /// Starts with no points; the first frame is searched for them. Ids start at `first_id`.
    pub fn new(detect: &Detect, track: &Track, outline: &Outline, first_id: u32) -> Self {
        Self {
            settings: track.clone(),
            wanted: detect.points as usize,
            detector: Detector::new(detect, outline),
            flow: OpticalFlow::new(track.window_px),
            anchoring: Anchoring::new(track),
            previous: Pyramid::default(),
            present: Pyramid::default(),
            keyframes: Vec::new(),
            points: Vec::new(),
            next_id: first_id,
            next_keyframe: 0,
            frames: 0,
            gaps: regain::Gaps::default(),
            trials: None,
            bar_px: None,
            settled: detect.points as usize,
            detected_s: 0.0,
            fits: Vec::new(),
            buffers: Buffers::default(),
        }
    }

    /// The id that the next new point will get.
    pub fn next_id(&self) -> u32 {
        self.next_id
    }

    /// Follows all points into `frame` and replaces the lost ones.
    pub fn step(&mut self, frame: &Frame) -> TrackSet {
        std::mem::swap(&mut self.previous, &mut self.present);
        self.present
            .rebuild(&frame.luma, self.settings.window_px, self.settings.levels);
        let before = self.points.len();
        let mut rejected = Vec::new();
        let regaining = self.gaps.regaining(frame.time_s);
        if self.frames > 0 {
            if regaining {
                self.regain(frame);
            } else {
                self.follow();
                self.undo_drift(&frame.luma);
            }
            self.give_up(frame, &mut rejected);
        }
        let lost = (before - self.points.len() - rejected.len()) as u32;
        rejected.extend(self.judge(frame.time_s));
        let born = if self.refill_due(frame.time_s) {
            self.refill(frame)
        } else {
            0
        };
        self.frames += 1;
        let observations = self
            .points
            .iter()
            .filter(|p| p.coasting == 0)
            .map(|p| Observation {
                id: p.id,
                u_px: p.now_px[0],
                v_px: p.now_px[1],
                fb_error_px: p.fb_error_px,
                error_px: p.record.error_px(),
                confirmed: p.trial.is_none(),
            })
            .collect();
        TrackSet {
            frame: frame.index,
            time_s: frame.time_s,
            observations,
            lost,
            born,
            rejected,
        }
    }

    /// Drops the points that were not seen for too long or have left the picture; those on trial
    /// have not passed it.
    fn give_up(&mut self, frame: &Frame, rejected: &mut Vec<TrackId>) {
        let (size, time_s, patience_s) = (frame.luma.size, frame.time_s, self.settings.coast_s);
        self.points.retain_mut(|p| {
            if p.coasting == 0 {
                p.seen_s = time_s;
            }
            let keep = time_s - p.seen_s <= patience_s
                && size.contains(f64::from(p.now_px[0]), f64::from(p.now_px[1]));
            if !keep && p.trial.is_some() {
                rejected.push(p.id);
            }
            keep
        });
    }

    /// Lucas-Kanade forward and back; who misses its start by too much is moved with its
    /// neighbours.
    fn follow(&mut self) {
        let b = &mut self.buffers;
        let pictures = (&self.previous, &self.present);
        // What flow finds where a hidden point is thought to be may be whatever hides it: that it
        // is the point its first patch must tell.
        let blind = self.settings.anchor_every == 0;
        let followed = |p: &Point| p.coasting == 0 || blind;
        b.from.clear();
        b.from
            .extend(self.points.iter().filter(|p| followed(p)).map(|p| p.now_px));
        self.flow
            .track(pictures, &b.from, self.settings.levels, &mut b.forward);
        b.to.clear();
        b.to.extend(b.forward.iter().map(|f| f.to));
        self.flow.track(
            (pictures.1, pictures.0),
            &b.to,
            self.settings.levels,
            &mut b.backward,
        );
        let limit = self.settings.fb_limit_px as f32;
        let mut flows = b.from.iter().zip(b.forward.iter().zip(&b.backward));
        for p in &mut self.points {
            let flow = if followed(p) { flows.next() } else { None };
            let closed = flow.and_then(|(from, (forward, backward))| {
                let error = distance(backward.to, *from);
                (forward.found && backward.found && error < limit).then_some((forward.to, error))
            });
            match closed {
                Some((to, error)) => (p.now_px, p.fb_error_px, p.coasting) = (to, error, 0),
                None => p.coasting += 1,
            }
        }
        self.ask_neighbours();
        self.ride();
    }

    /// Whether points are to be looked for: so many of those that there were are lost, or it is
    /// worth another try.
    fn refill_due(&self, time_s: f64) -> bool {
        let few = |of: usize| {
            of.saturating_sub(self.points.len()) as f64 >= REFILL_SHARE * self.wanted as f64
        };
        let rested = time_s >= self.detected_s + REFILL_S;
        let again = few(self.wanted) && time_s >= self.detected_s + TRY_AGAIN_S;
        // While the tree rests, a trial may be long, and the light may take points away.
        let free = self.trials.as_ref().is_none_or(Trials::at_rest);
        self.frames == 0 || (free && rested && (few(self.settled) || again))
    }

    /// Detects points where there are none; returns how many.
    fn refill(&mut self, frame: &Frame) -> u32 {
        self.detected_s = frame.time_s;
        let taken: Vec<[f32; 2]> = self.points.iter().map(|p| p.now_px).collect();
        // Without comparisons nothing would be known of them at the end of a trial.
        let on_trial = self.settings.anchor_every > 0;
        let share = if on_trial { trial::CANDIDATES } else { 1 };
        let missing = self.wanted.saturating_sub(self.points.len());
        let found = self.detector.detect(&frame.luma, &taken, share * missing);
        if found.is_empty() {
            return 0;
        }
        if self.keyframes.len() == KEYFRAMES {
            self.keyframes.remove(1);
        }
        self.keyframes.push((
            self.next_keyframe,
            Keyframe::new(&frame.luma, &self.settings),
        ));
        let known_ids: Vec<TrackId> =
            (self.points.iter().filter(|p| p.coasting == 0).map(|p| p.id))
                .chain((0..found.len() as u32).map(|k| TrackId(self.next_id + k)))
                .collect();
        let known_px: Vec<[f32; 2]> = (self
            .points
            .iter()
            .filter(|p| p.coasting == 0)
            .map(|p| p.now_px))
        .chain(found.iter().copied())
        .collect();
        for (at, near) in found.iter().zip(neighbours::nearest(&found, &known_px)) {
            self.points.push(Point {
                id: TrackId(self.next_id),
                keyframe: self.next_keyframe,
                born_px: *at,
                now_px: *at,
                patch: self.anchoring.registration.patch(&frame.luma, *at),
                fb_error_px: 0.0,
                coasting: 0,
                seen_s: frame.time_s,
                neighbours: near
                    .into_iter()
                    .map(|j| (known_ids[j as usize], known_px[j as usize]))
                    .collect(),
                record: Record::default(),
                trial: on_trial.then(Trial::default),
            });
            self.next_id += 1;
        }
        self.next_keyframe += 1;
        if on_trial && self.trials.is_none() {
            self.trials = Some(Trials::new(
                frame.time_s,
                self.bar_px.is_none(),
                found.len(),
            ));
        }
        found.len() as u32
    }
}

//! Points inside the outline, followed from frame to frame.
//!
//! Each frame: the camera's motion by what stands still; flow forward and back; a point that does
//! not lead back to its start is carried along by its neighbours for a while; a part of the points
//! is put back on its first patch; lost points are replaced. Ids are never used twice.

mod anchor;
mod background;
mod carry;
mod detect;
mod flow;
mod landmarks;
mod neighbours;
mod point;
mod regain;
mod register;
mod tag_marks;
mod template;
mod trial;
mod trunk_foot;
mod whole_view;

pub use detect::Detector;
pub use whole_view::WholeView;

use crate::config::{Detect, Track};
use crate::model::{self, CameraMotion, Frame, Observation, Outline, TrackId, TrackSet};
use crate::signal::Fit;
use anchor::Anchors;
use background::Background;
use carry::{carry_hidden, neighbour_fits};
use flow::{Flow, OpticalFlow, Pyramid};
use landmarks::Pictures;
use nalgebra::{Point2, distance};
use point::{Point, Record, Trial};
use regain::Gaps;
use trial::Selection;

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
    anchors: Anchors,
    background: Background,
    previous: Pyramid,
    present: Pyramid,
    /// Ordered by id.
    points: Vec<Point>,
    next_id: u32,
    frames: u64,
    detected_s: f64,
    gaps: Gaps,
    selection: Selection,
    /// What the neighbours of each point say in this frame.
    fits: Vec<Option<Fit>>,
    buffers: Buffers,
}

#[derive(Default)]
struct Buffers {
    from: Vec<Point2<f32>>,
    to: Vec<Point2<f32>>,
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
            anchors: Anchors::new(track),
            background: Background::around(outline),
            previous: Pyramid::default(),
            present: Pyramid::default(),
            points: Vec::new(),
            next_id: first_id,
            frames: 0,
            gaps: Gaps::default(),
            selection: Selection::new(detect.points as usize),
            detected_s: 0.0,
            fits: Vec::new(),
            buffers: Buffers::default(),
        }
    }

    /// The id that the next new point will get.
    pub fn next_id(&self) -> u32 {
        self.next_id
    }

    /// A tag that hangs beside the tree is seen with these corners, px, in the frame that is followed
    /// next.
    pub fn see_tag(&mut self, corners_px: [Point2<f64>; 4]) {
        self.background.see_tag(corners_px);
    }

    /// By how much what stands around the tree was off the tag, px, when it was found to move by itself;
    /// once.
    pub fn take_tag_dispute(&mut self) -> Option<f64> {
        self.background.take_dispute()
    }

    /// Follows all points into `frame` and replaces the lost ones.
    pub fn step(&mut self, frame: &Frame) -> TrackSet {
        std::mem::swap(&mut self.previous, &mut self.present);
        self.present
            .rebuild(&frame.luma, self.settings.window_px, self.settings.levels);
        let camera = self.camera(frame);
        let before = self.points.len();
        let mut rejected = Vec::new();
        let regaining = self.gaps.regaining(frame.time_s);
        if self.frames > 0 {
            if regaining {
                self.regain(frame);
            } else {
                self.follow();
                self.anchors
                    .undo_drift(&frame.luma, &mut self.points, &self.fits, self.frames);
            }
            self.give_up(frame, &mut rejected);
        }
        let lost = (before - self.points.len() - rejected.len()) as u32;
        // Where the camera looks elsewhere nothing is to be learned of the points.
        let counts = camera.background != model::Background::Lost;
        if counts {
            let judged = self
                .selection
                .judge(&mut self.points, frame.time_s, &camera);
            rejected.extend(judged);
        }
        let born = if counts && self.refill_due(frame.time_s) {
            self.refill(frame, &camera)
        } else {
            0
        };
        self.frames += 1;
        let seen = self.points.iter().filter(|p| counts && p.coasting == 0);
        TrackSet {
            frame: frame.index,
            time_s: frame.time_s,
            camera,
            observations: seen.map(|p| observation(p, &camera)).collect(),
            lost,
            born,
            rejected,
        }
    }

    /// The camera's motion in `frame`, whose pyramid is made.
    fn camera(&mut self, frame: &Frame) -> CameraMotion {
        if !self.settings.steady {
            return CameraMotion::default();
        }
        let pictures = Pictures {
            luma: &frame.luma,
            time_s: frame.time_s,
            previous: &self.previous,
            present: &self.present,
            levels: self.settings.levels,
        };
        self.background.step(&pictures, &mut self.flow)
    }

    /// Drops the points that were not seen for too long or have left the picture; those on trial
    /// have not passed it.
    fn give_up(&mut self, frame: &Frame, rejected: &mut Vec<TrackId>) {
        let (size, time_s, coast_s) = (frame.luma.size, frame.time_s, self.settings.coast_s);
        self.points.retain_mut(|p| {
            if p.coasting == 0 {
                p.seen_s = time_s;
            }
            let keep = time_s - p.seen_s <= coast_s && size.contains(p.now_px.cast());
            if !keep && p.trial.is_some() {
                rejected.push(p.id);
            }
            keep
        });
    }

    /// Lucas-Kanade forward and back; a point that misses its start by too much is moved with its
    /// neighbours.
    fn follow(&mut self) {
        // What flow finds where a hidden point is thought to be may be whatever hides it: only a
        // comparison with the first patch tells whether it is the point.
        let follow_hidden = self.settings.anchor_every == 0;
        let followed: Vec<usize> = (0..self.points.len())
            .filter(|&i| self.points[i].coasting == 0 || follow_hidden)
            .collect();
        let (levels, b) = (self.settings.levels, &mut self.buffers);
        b.from.clear();
        b.from
            .extend(followed.iter().map(|&i| self.points[i].now_px));
        let (previous, present) = (&self.previous, &self.present);
        self.flow
            .track(previous, present, &b.from, levels, &mut b.forward);
        b.to.clear();
        b.to.extend(b.forward.iter().map(|f| f.to));
        self.flow
            .track(present, previous, &b.to, levels, &mut b.backward);
        let limit_px = self.settings.fb_limit_px as f32;
        for p in &mut self.points {
            p.coasting += 1;
        }
        for (i, (forward, backward)) in followed.into_iter().zip(b.forward.iter().zip(&b.backward))
        {
            let p = &mut self.points[i];
            let error_px = distance(&backward.to, &p.now_px);
            if forward.found && backward.found && error_px < limit_px {
                (p.now_px, p.fb_error_px, p.coasting) = (forward.to, error_px, 0);
            }
        }
        self.carry_hidden();
    }

    /// Looks for every point by its first picture; those that are not found are carried along by
    /// those that are.
    fn regain(&mut self, frame: &Frame) {
        // A point that was not seen for a while is not given up for it: it could not be seen.
        for p in &mut self.points {
            (p.coasting, p.seen_s) = (1, frame.time_s);
        }
        self.anchors
            .find_again(&frame.luma, &self.present, &mut self.points);
        self.carry_hidden();
        let found = self.points.iter().filter(|p| p.coasting == 0).count();
        self.gaps.found(found, self.points.len());
    }

    /// Asks the neighbours of all points, and moves those that are hidden with them.
    fn carry_hidden(&mut self) {
        self.fits = neighbour_fits(&self.points, self.settings.anchor_every, self.frames);
        carry_hidden(&mut self.points, &self.fits);
    }

    /// Whether points are to be looked for: so many of those that there were are lost, or it is
    /// worth another try.
    fn refill_due(&self, time_s: f64) -> bool {
        if self.frames == 0 {
            return true;
        }
        let lost_many = self.misses_many(self.selection.settled());
        let again = self.misses_many(self.wanted) && time_s >= self.detected_s + TRY_AGAIN_S;
        self.selection.is_open() && time_s >= self.detected_s + REFILL_S && (lost_many || again)
    }

    /// Whether so many of the points are missing, of which there should be `expected`, that it is
    /// worth looking for more.
    fn misses_many(&self, expected: usize) -> bool {
        let missing = expected.saturating_sub(self.points.len());
        missing as f64 >= REFILL_SHARE * self.wanted as f64
    }

    /// Detects points where there are none; returns how many.
    fn refill(&mut self, frame: &Frame, camera: &CameraMotion) -> u32 {
        self.detected_s = frame.time_s;
        let taken: Vec<Point2<f32>> = self.points.iter().map(|p| p.now_px).collect();
        // Without comparisons nothing would be known of them at the end of a trial.
        let on_trial = self.settings.anchor_every > 0;
        let share = if on_trial { trial::CANDIDATES } else { 1 };
        let missing = self.wanted.saturating_sub(self.points.len());
        let found = self
            .detector
            .detect(&frame.luma, &taken, share * missing, camera);
        if found.is_empty() {
            return 0;
        }
        let keyframe = self.anchors.add_keyframe(&frame.luma);
        let (mut known_ids, mut known_px) = (Vec::new(), Vec::new());
        for p in self.points.iter().filter(|p| p.coasting == 0) {
            known_ids.push(p.id);
            known_px.push(p.now_px);
        }
        for (id, at) in (self.next_id..).zip(&found) {
            known_ids.push(TrackId(id));
            known_px.push(*at);
        }
        for (at, near) in found.iter().zip(neighbours::nearest(&found, &known_px)) {
            self.points.push(Point {
                id: TrackId(self.next_id),
                keyframe,
                born_px: *at,
                born_steady_px: camera.steady_px(at.cast()).cast(),
                now_px: *at,
                patch: self.anchors.patch(&frame.luma, *at),
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
        if on_trial {
            self.selection.begin(frame.time_s, found.len());
        }
        found.len() as u32
    }
}

fn observation(p: &Point, camera: &CameraMotion) -> Observation {
    let steady_px = camera.steady_px(p.now_px.cast()).cast::<f32>();
    Observation {
        id: p.id,
        u_px: steady_px.x,
        v_px: steady_px.y,
        fb_error_px: p.fb_error_px,
        error_px: p.record.error_px(),
        confirmed: p.trial.is_none(),
        depth: None,
    }
}

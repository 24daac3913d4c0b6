//! Anchors: what points looked like when they were first seen, against which drift is undone.
//!
//! Following a point from frame to frame adds up small errors; a tree sways about a rest pose and
//! comes back, so the patch that a point started with can be found again and the point put back on
//! it.

use super::Tracker;
use super::flow::{Flow, OpticalFlow, Pyramid};
use super::neighbours::{self, Fit, Witness};
use super::point::Point;
use super::register::{Registration, UPRIGHT};
use crate::config::Track;
use crate::model::{Luma, TrackId};

/// Largest forward-backward error of a point found again without its neighbours, px.
const FB_LIMIT_PX: f32 = 0.7;
/// A match may lie so far from where the neighbours say, px.
const NEIGHBOUR_LIMIT_PX: f32 = 4.0;
/// Where it looks like another and is so far from where its neighbours say, px, it is another: flow
/// goes along with whatever comes before a point.
const ASTRAY_PX: f32 = 8.0;
/// So far from there it is another, whatever it looks like, px: there are many edges like the edge
/// of a branch.
const FAR_ASTRAY_PX: f32 = 16.0;
/// A match is taken for less like by so much for every px between it and where the neighbours say.
const LESS_LIKE_PER_PX: f32 = 0.05;
/// From the neighbours' place, too, the search starts where it lies so far from the point's own,
/// px.
const APART_PX: f32 = 0.5;

/// One picture in which points were detected.
pub struct Keyframe {
    pyramid: Pyramid,
}

impl Keyframe {
    pub fn new(luma: &Luma, settings: &Track) -> Self {
        let mut pyramid = Pyramid::default();
        // All levels: after a gap a point may be far from where it was.
        pyramid.rebuild(luma, settings.window_px, settings.levels);
        Self { pyramid }
    }
}

/// Searches with its buffers.
pub struct Anchoring {
    pub registration: Registration,
    flow: OpticalFlow,
    forward: Vec<Flow>,
    backward: Vec<Flow>,
    min_ncc: f32,
}

impl Anchoring {
    pub fn new(settings: &Track) -> Self {
        Self {
            registration: Registration::default(),
            flow: OpticalFlow::new(settings.window_px),
            forward: Vec::new(),
            backward: Vec::new(),
            min_ncc: settings.anchor_ncc as f32,
        }
    }

    /// Looks for the first patches of points far around their first places, on all `levels`. `None`
    /// where what is found does not lead back or does not look alike.
    pub fn search(
        &mut self,
        keyframe: &Keyframe,
        (luma, pyramid): (&Luma, &Pyramid),
        points: &[&Point],
        levels: u32,
    ) -> Vec<Option<[f32; 2]>> {
        let born: Vec<[f32; 2]> = points.iter().map(|p| p.born_px).collect();
        self.flow.track(
            (&keyframe.pyramid, pyramid),
            &born,
            levels,
            &mut self.forward,
        );
        let found: Vec<[f32; 2]> = self.forward.iter().map(|f| f.to).collect();
        self.flow.track(
            (pyramid, &keyframe.pyramid),
            &found,
            levels,
            &mut self.backward,
        );
        let accepted = |(i, p): (usize, &&Point)| {
            let (forward, backward) = (self.forward[i], self.backward[i]);
            let closed =
                forward.found && backward.found && distance(backward.to, p.born_px) < FB_LIMIT_PX;
            let alike = || {
                self.registration
                    .likeness(&p.patch, luma, forward.to, &UPRIGHT)
                    > self.min_ncc
            };
            (closed && alike()).then_some(forward.to)
        };
        points.iter().enumerate().map(accepted).collect()
    }

    /// Looks for a point's first patch, starting where tracking has it and where its neighbours
    /// have it. Gives the best place if it is another than the present one, and how alike point and
    /// patch are then.
    fn reanchor(&self, luma: &Luma, p: &Point, fit: Option<&Fit>) -> (Option<[f32; 2]>, f32) {
        let predicted_px = fit.map_or(p.now_px, |fit| p.predicted_px(fit));
        let warp = fit.map_or(UPRIGHT, |fit| fit.warp);
        let enough = p.found_above(self.min_ncc, fit.is_some());
        let less = |at: [f32; 2]| LESS_LIKE_PER_PX * distance(at, predicted_px);
        let mut best: Option<[f32; 2]> = None;
        let (mut best_score, mut likeness) = (0.0, 0.0);
        let starts = [
            Some(p.now_px),
            (distance(p.now_px, predicted_px) > APART_PX).then_some(predicted_px),
        ];
        for (k, start) in starts.into_iter().enumerate() {
            let Some(start) = start else { continue };
            let found = self.registration.find(&p.patch, luma, start, &warp);
            if k == 0 {
                likeness = found.likeness_at_start;
                // A hidden point is nowhere: any place where it is found is better.
                best_score = if p.coasting == 0 {
                    likeness - less(start)
                } else {
                    f32::MIN
                };
            }
            let score = found.likeness - less(found.at_px);
            let near = distance(found.at_px, predicted_px) < NEIGHBOUR_LIMIT_PX;
            if found.converged && near && found.likeness > enough && score > best_score {
                (best, best_score, likeness) = (Some(found.at_px), score, found.likeness);
            }
        }
        (best, likeness)
    }

    /// Whether something else is seen where tracking has a point, from its likeness with its first
    /// patch there.
    fn covered(&self, p: &Point, likeness: f32, predicted_px: Option<[f32; 2]>) -> bool {
        let astray = |limit_px| predicted_px.is_some_and(|at| distance(p.now_px, at) > limit_px);
        likeness < p.hidden_below()
            || (likeness < self.min_ncc && astray(ASTRAY_PX))
            || astray(FAR_ASTRAY_PX)
    }
}

impl Tracker {
    /// What the neighbours of a point say, by the places that they have now; of every point that
    /// needs it in this frame.
    pub(super) fn ask_neighbours(&mut self) {
        // Apart from the points, which are large: each is asked two dozen times.
        let ids: Vec<TrackId> = self.points.iter().map(|p| p.id).collect();
        let seen: Vec<Option<([f32; 2], f64)>> = self
            .points
            .iter()
            .map(|p| (p.coasting == 0).then(|| (p.now_px, p.trust())))
            .collect();
        let fit = |p: &Point| {
            if p.coasting == 0 && !p.in_turn(self.settings.anchor_every, self.frames) {
                return None;
            }
            let mut witnesses = [Witness::default(); neighbours::NEIGHBOURS];
            let mut n = 0;
            for (id, then_px) in &p.neighbours {
                let Some((now_px, weight)) = ids.binary_search(id).ok().and_then(|j| seen[j])
                else {
                    continue;
                };
                let minus =
                    |a: [f32; 2], b: [f32; 2]| [f64::from(a[0] - b[0]), f64::from(a[1] - b[1])];
                let (offset, displacement) = (minus(*then_px, p.born_px), minus(now_px, *then_px));
                witnesses[n] = Witness {
                    offset,
                    displacement,
                    weight,
                };
                n += 1;
                if n == witnesses.len() {
                    break;
                }
            }
            neighbours::fit(&witnesses[..n])
        };
        self.fits = self.points.iter().map(fit).collect();
    }

    /// Moves the points that are not seen with those around them that are.
    pub(super) fn ride(&mut self) {
        for (p, fit) in self.points.iter_mut().zip(&self.fits) {
            if let (true, Some(fit)) = (p.coasting > 0, fit) {
                p.now_px = p.predicted_px(fit);
            }
        }
    }

    /// Puts a share of the points back on their first patches. One that is just lost is looked for
    /// at once, and then in its turn as all are.
    pub(super) fn undo_drift(&mut self, luma: &Luma) {
        let every = self.settings.anchor_every;
        if every == 0 {
            return;
        }
        for (p, fit) in self.points.iter_mut().zip(&self.fits) {
            let hidden = p.coasting > 0;
            if p.coasting != 1 && !p.in_turn(every, self.frames) {
                continue;
            }
            let (found, likeness) = self.anchoring.reanchor(luma, p, fit.as_ref());
            let predicted_px = fit.as_ref().map(|fit| p.predicted_px(fit));
            if let Some(at) = found {
                (p.now_px, p.coasting) = (at, 0);
            } else if !hidden && self.anchoring.covered(p, likeness, predicted_px) {
                (p.now_px, p.coasting) = (predicted_px.unwrap_or(p.now_px), 1);
            }
            if p.coasting == 0 {
                p.compared(likeness, fit.as_ref());
            }
        }
    }
}

/// Distance between two points, px.
pub fn distance(a: [f32; 2], b: [f32; 2]) -> f32 {
    let [u, v] = [a[0] - b[0], a[1] - b[1]];
    (u * u + v * v).sqrt()
}

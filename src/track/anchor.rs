//! Anchors: what points looked like when they were first seen, against which drift is undone.
//!
//! Following a point from frame to frame adds up small errors; a tree sways about a rest pose and
//! comes back, so the patch that a point started with can be found again and the point put back on
//! it.

use super::flow::{Flow, OpticalFlow, Pyramid};
use super::point::Point;
use super::register::{Patch, Registration, UPRIGHT};
use crate::config::Track;
use crate::model::Luma;
use crate::signal::Fit;
use nalgebra::{Point2, distance};

/// Pictures kept to put points back on; the oldest but the first gives way.
const KEYFRAMES: usize = 4;
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
/// What the correlation of a match is reduced by for every px between it and where the neighbours
/// say.
const NCC_PER_PX: f32 = 0.05;
/// From the neighbours' place, too, the search starts where it lies so far from the point's own,
/// px.
const APART_PX: f32 = 0.5;

/// One picture in which points were detected.
struct Keyframe {
    /// Numbers grow.
    number: u32,
    pyramid: Pyramid,
}

/// The pictures in which points were detected, and what searches for the points' patches.
pub struct Anchors {
    settings: Track,
    keyframes: Vec<Keyframe>,
    next_keyframe: u32,
    registration: Registration,
    flow: OpticalFlow,
    forward: Vec<Flow>,
    backward: Vec<Flow>,
}

/// What the search for a point's first patch has found.
struct Reanchored {
    /// The best place, px, if it is another than the present one.
    better_px: Option<Point2<f32>>,
    /// Correlation of patch and picture there.
    ncc: f32,
}

impl Anchors {
    pub fn new(settings: &Track) -> Self {
        Self {
            settings: settings.clone(),
            keyframes: Vec::new(),
            next_keyframe: 0,
            registration: Registration::default(),
            flow: OpticalFlow::new(settings.window_px),
            forward: Vec::new(),
            backward: Vec::new(),
        }
    }

    /// Keeps the picture in which points were detected; gives its number.
    pub fn add_keyframe(&mut self, luma: &Luma) -> u32 {
        let mut pyramid = Pyramid::default();
        // All levels: after a gap a point may be far from where it was.
        pyramid.rebuild(luma, self.settings.window_px, self.settings.levels);
        if self.keyframes.len() == KEYFRAMES {
            self.keyframes.remove(1);
        }
        let number = self.next_keyframe;
        self.keyframes.push(Keyframe { number, pyramid });
        self.next_keyframe += 1;
        number
    }

    /// What a point at `at_px` looks like.
    pub fn patch(&self, luma: &Luma, at_px: Point2<f32>) -> Patch {
        self.registration.patch(luma, at_px)
    }

    /// Puts a share of the points back on their first patches: in frame number `frame` those whose
    /// turn it is, and those that are just lost. `fits` is what the neighbours of each say.
    pub fn undo_drift(&self, luma: &Luma, points: &mut [Point], fits: &[Option<Fit>], frame: u64) {
        let every = self.settings.anchor_every;
        if every == 0 {
            return;
        }
        for (p, fit) in points.iter_mut().zip(fits) {
            let hidden = p.coasting > 0;
            if p.coasting != 1 && !p.in_turn(every, frame) {
                continue;
            }
            let Reanchored { better_px, ncc } = self.reanchor(luma, p, fit.as_ref());
            let predicted_px = fit.as_ref().map(|fit| p.predicted_px(fit));
            if let Some(at) = better_px {
                (p.now_px, p.coasting) = (at, 0);
            } else if !hidden && self.is_covered(p, ncc, predicted_px) {
                (p.now_px, p.coasting) = (predicted_px.unwrap_or(p.now_px), 1);
            }
            if p.coasting == 0 {
                p.compared(ncc, fit.as_ref());
            }
        }
    }

    /// Looks for a point's first patch, starting where tracking has it and where its neighbours
    /// have it.
    fn reanchor(&self, luma: &Luma, p: &Point, fit: Option<&Fit>) -> Reanchored {
        let predicted_px = fit.map_or(p.now_px, |fit| p.predicted_px(fit));
        let warp = fit.map_or(UPRIGHT, |fit| fit.warp);
        let enough = p.found_above(self.min_ncc(), fit.is_some());
        let at_start = self.registration.find(&p.patch, luma, p.now_px, &warp);
        let mut best = Reanchored {
            better_px: None,
            ncc: at_start.ncc_at_start,
        };
        // A hidden point is nowhere: any place where it is found is better.
        let mut best_score = if p.coasting == 0 {
            score(at_start.ncc_at_start, p.now_px, predicted_px)
        } else {
            f32::MIN
        };
        let elsewhere = (distance(&p.now_px, &predicted_px) > APART_PX)
            .then(|| self.registration.find(&p.patch, luma, predicted_px, &warp));
        for found in std::iter::once(at_start).chain(elsewhere) {
            let score = score(found.ncc, found.at_px, predicted_px);
            let near = distance(&found.at_px, &predicted_px) < NEIGHBOUR_LIMIT_PX;
            if found.converged && near && found.ncc > enough && score > best_score {
                best_score = score;
                best = Reanchored {
                    better_px: Some(found.at_px),
                    ncc: found.ncc,
                };
            }
        }
        best
    }

    /// Whether something else is seen where tracking has a point, from its correlation with its
    /// first patch there.
    fn is_covered(&self, p: &Point, ncc: f32, predicted_px: Option<Point2<f32>>) -> bool {
        let astray_px = predicted_px.map_or(0.0, |at| distance(&p.now_px, &at));
        ncc < p.hidden_below()
            || (ncc < self.min_ncc() && astray_px > ASTRAY_PX)
            || astray_px > FAR_ASTRAY_PX
    }

    /// Looks for every point by the picture in which it was first seen, far around its first place,
    /// on all levels of `pyramid`. Points that are found are seen again.
    pub fn find_again(&mut self, luma: &Luma, pyramid: &Pyramid, points: &mut [Point]) {
        for keyframe in &self.keyframes {
            let of_keyframe: Vec<&mut Point> = points
                .iter_mut()
                .filter(|p| p.keyframe == keyframe.number)
                .collect();
            let born: Vec<Point2<f32>> = of_keyframe.iter().map(|p| p.born_px).collect();
            let levels = self.settings.levels;
            self.flow
                .track(&keyframe.pyramid, pyramid, &born, levels, &mut self.forward);
            let found: Vec<Point2<f32>> = self.forward.iter().map(|f| f.to).collect();
            self.flow.track(
                pyramid,
                &keyframe.pyramid,
                &found,
                levels,
                &mut self.backward,
            );
            let flows = self.forward.iter().zip(&self.backward);
            for (p, (forward, backward)) in of_keyframe.into_iter().zip(flows) {
                let closed = forward.found
                    && backward.found
                    && distance(&backward.to, &p.born_px) < FB_LIMIT_PX;
                if closed && self.is_like(p, luma, forward.to) {
                    (p.now_px, p.coasting, p.fb_error_px) = (forward.to, 0, 0.0);
                }
            }
        }
    }

    /// Whether the picture at `at_px` looks like a point did when it was first seen.
    fn is_like(&self, p: &Point, luma: &Luma, at_px: Point2<f32>) -> bool {
        self.registration.ncc(&p.patch, luma, at_px, &UPRIGHT) > self.min_ncc()
    }

    fn min_ncc(&self) -> f32 {
        self.settings.anchor_ncc as f32
    }
}

/// Correlation of a match, reduced by its distance from where the neighbours say.
fn score(ncc: f32, at_px: Point2<f32>, predicted_px: Point2<f32>) -> f32 {
    ncc - NCC_PER_PX * distance(&at_px, &predicted_px)
}

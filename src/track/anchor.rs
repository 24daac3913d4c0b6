//! Anchors: the pictures in which points were first seen, against which drift is undone.
//!
//! Following a point from frame to frame adds up small errors; a tree sways about a rest pose and comes back, so the
//! patch that a point started with can be found again and the point put back on it.

use super::flow::{Flow, OpticalFlow, Pyramid};
use crate::config::Track;
use crate::model::Luma;

/// Half the side of the patch that is compared, px: 11 x 11 pixels.
const PATCH_HALF_PX: i32 = 5;
/// Largest forward-backward error of an accepted match, px.
const FB_LIMIT_PX: f32 = 0.7;
/// A match may lie so far from where the neighbours say, px.
const NEIGHBOUR_LIMIT_PX: f32 = 4.0;

/// One picture in which points were detected.
pub struct Keyframe {
    luma: Luma,
    pyramid: Pyramid,
}

impl Keyframe {
    pub fn new(luma: &Luma, settings: &Track) -> Self {
        let mut pyramid = Pyramid::default();
        // All levels: after a gap a point may be far from where it was.
        pyramid.rebuild(luma, settings.window_px, settings.levels);
        Self { luma: luma.clone(), pyramid }
    }
}

/// A point to be compared with its anchor.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Where it was when it was detected, px.
    pub born_px: [f32; 2],
    /// Where tracking has it now, px.
    pub now_px: [f32; 2],
    /// Where its neighbours say it is, px.
    pub predicted_px: [f32; 2],
}

/// Searches with its buffers.
pub struct Anchoring {
    flow: OpticalFlow,
    forward: Vec<Flow>,
    backward: Vec<Flow>,
    min_ncc: f32,
}

impl Anchoring {
    pub fn new(settings: &Track) -> Self {
        Self {
            flow: OpticalFlow::new(settings.window_px),
            forward: Vec::new(),
            backward: Vec::new(),
            min_ncc: settings.anchor_ncc as f32,
        }
    }

    /// Looks for the first patches of points far around their first places, on all `levels`. `None` where what is found
    /// does not lead back or does not look alike.
    pub fn search(
        &mut self,
        keyframe: &Keyframe,
        (luma, pyramid): (&Luma, &Pyramid),
        born: &[[f32; 2]],
        levels: u32,
    ) -> Vec<Option<[f32; 2]>> {
        self.flow.track((&keyframe.pyramid, pyramid), born, None, levels, &mut self.forward);
        let found: Vec<[f32; 2]> = self.forward.iter().map(|f| f.to).collect();
        self.flow.track((pyramid, &keyframe.pyramid), &found, None, levels, &mut self.backward);
        let accepted = |(i, b): (usize, &[f32; 2])| {
            let (forward, backward) = (self.forward[i], self.backward[i]);
            let closed = forward.found && backward.found && distance(backward.to, *b) < FB_LIMIT_PX;
            let alike = || ncc((&keyframe.luma, *b), (luma, forward.to)) > self.min_ncc;
            (closed && alike()).then_some(forward.to)
        };
        born.iter().enumerate().map(accepted).collect()
    }

    /// Looks for each candidate's first patch in the present picture, starting where tracking has it and where its
    /// neighbours have it. `None` where nothing beats the present position by correlation, agrees with the neighbours
    /// and survives the way back.
    pub fn reanchor(
        &mut self,
        keyframe: &Keyframe,
        (luma, pyramid): (&Luma, &Pyramid),
        candidates: &[Candidate],
    ) -> Vec<Option<[f32; 2]>> {
        let born: Vec<[f32; 2]> = candidates.iter().map(|c| c.born_px).collect();
        let mut best: Vec<Option<[f32; 2]>> = vec![None; candidates.len()];
        let mut best_ncc: Vec<f32> =
            candidates.iter().map(|c| ncc((&keyframe.luma, c.born_px), (luma, c.now_px))).collect();
        let starts: [fn(&Candidate) -> [f32; 2]; 2] = [|c| c.now_px, |c| c.predicted_px];
        for start in starts {
            let guess: Vec<[f32; 2]> = candidates.iter().map(start).collect();
            self.flow.track((&keyframe.pyramid, pyramid), &born, Some(&guess), 0, &mut self.forward);
            let found: Vec<[f32; 2]> = self.forward.iter().map(|f| f.to).collect();
            self.flow.track((pyramid, &keyframe.pyramid), &found, Some(&born), 0, &mut self.backward);
            for (i, c) in candidates.iter().enumerate() {
                let (f, b) = (self.forward[i], self.backward[i]);
                let closed = f.found && b.found && distance(b.to, c.born_px) < FB_LIMIT_PX;
                if !closed || distance(f.to, c.predicted_px) > NEIGHBOUR_LIMIT_PX {
                    continue;
                }
                let score = ncc((&keyframe.luma, c.born_px), (luma, f.to));
                if score > self.min_ncc && score > best_ncc[i] {
                    best[i] = Some(f.to);
                    best_ncc[i] = score;
                }
            }
        }
        best
    }
}

/// Distance between two points, px.
pub fn distance(a: [f32; 2], b: [f32; 2]) -> f32 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Normalised cross-correlation of the patches about two points, -1 to 1; 0 where a patch has no texture.
fn ncc((a, pa): (&Luma, [f32; 2]), (b, pb): (&Luma, [f32; 2])) -> f32 {
    let (mut sum_a, mut sum_b, mut sum_aa, mut sum_bb, mut sum_ab) = (0.0f32, 0.0f32, 0.0f32, 0.0f32, 0.0f32);
    for dv in -PATCH_HALF_PX..=PATCH_HALF_PX {
        for du in -PATCH_HALF_PX..=PATCH_HALF_PX {
            let x = bilinear(a, pa[0] + du as f32, pa[1] + dv as f32);
            let y = bilinear(b, pb[0] + du as f32, pb[1] + dv as f32);
            sum_a += x;
            sum_b += y;
            sum_aa += x * x;
            sum_bb += y * y;
            sum_ab += x * y;
        }
    }
    let n = ((2 * PATCH_HALF_PX + 1) * (2 * PATCH_HALF_PX + 1)) as f32;
    let (var_a, var_b) = (sum_aa - sum_a * sum_a / n, sum_bb - sum_b * sum_b / n);
    if var_a < 1.0 || var_b < 1.0 { 0.0 } else { (sum_ab - sum_a * sum_b / n) / (var_a * var_b).sqrt() }
}

/// Brightness between pixels; beyond the edge the edge goes on.
fn bilinear(luma: &Luma, u_px: f32, v_px: f32) -> f32 {
    let (w, h) = (luma.size.width as i32, luma.size.height as i32);
    let u = u_px.clamp(0.0, (w - 1) as f32);
    let v = v_px.clamp(0.0, (h - 1) as f32);
    let (u0, v0) = (u as i32, v as i32);
    let (u1, v1) = ((u0 + 1).min(w - 1), (v0 + 1).min(h - 1));
    let (fu, fv) = (u - u0 as f32, v - v0 as f32);
    let at = |u: i32, v: i32| f32::from(luma.pixels[(v * w + u) as usize]);
    (at(u0, v0) * (1.0 - fu) + at(u1, v0) * fu) * (1.0 - fv) + (at(u0, v1) * (1.0 - fu) + at(u1, v1) * fu) * fv
}

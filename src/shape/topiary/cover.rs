//! How much of a shape the tree covers, seen from the front.

use crate::model::{Outline, Skeleton};

/// A branch covers what is nearer to it than this share of the shape's larger side: about as far as the leaves on it
/// reach.
const REACH: f64 = 0.025;

/// Share of the pixels of `shape` that are within a fortieth of the shape's larger side of a branch or of the trunk, in the
/// front projection: 0 to 1.
pub fn coverage(skeleton: &Skeleton, shape: &Outline) -> f64 {
    let mut cover = Cover::of(shape);
    for node in &skeleton.nodes {
        if let Some(parent) = node.parent.and_then(|p| skeleton.nodes.get(p.index())) {
            cover.add([parent, node].map(|n| skeleton.image_from_model(&n.position)));
        }
    }
    cover.share()
}

/// Which pixels of a shape are covered.
pub struct Cover {
    width: usize,
    height: usize,
    /// 1 where the shape is and nothing covers it yet.
    bare: Vec<u8>,
    bare_count: usize,
    all: usize,
    pub reach_px: f64,
}

impl Cover {
    pub fn of(shape: &Outline) -> Self {
        let larger = shape.bounds_px().map_or(0, |[left, top, right, bottom]| (right - left).max(bottom - top) + 1);
        let bare: Vec<u8> = shape.mask.iter().map(|m| u8::from(*m != 0)).collect();
        let all = bare.iter().filter(|b| **b != 0).count();
        let (width, height) = (shape.size.width as usize, shape.size.height as usize);
        Self { width, height, bare, bare_count: all, all, reach_px: (REACH * f64::from(larger)).max(1.0) }
    }

    /// Covered share, 0 to 1.
    pub fn share(&self) -> f64 {
        1.0 - self.bare_count as f64 / self.all.max(1) as f64
    }

    /// Marks what a branch covers.
    pub fn add(&mut self, branch: [[f64; 2]; 2]) {
        let mut newly = Vec::new();
        self.near(branch, self.reach_px, |k| newly.push(k));
        newly.into_iter().for_each(|k| self.cover(k));
    }

    /// Bare pixels that a branch would cover.
    pub fn gain(&self, branch: [[f64; 2]; 2]) -> usize {
        let mut count = 0;
        self.near(branch, self.reach_px, |k| count += usize::from(self.bare[k]));
        count
    }

    /// Notes the bare pixels near `at`, where nothing can be done.
    pub fn give_up(&self, at: [f64; 2], given_up: &mut Vec<usize>) {
        let mut near = Vec::new();
        self.near([at, at], 0.5 * self.reach_px, |k| near.push(k));
        given_up.extend(near.into_iter().filter(|&k| self.bare[k] != 0));
    }

    fn cover(&mut self, k: usize) {
        self.bare_count -= usize::from(self.bare[k]);
        self.bare[k] = 0;
    }

    fn near(&self, [a, b]: [[f64; 2]; 2], reach: f64, mut each: impl FnMut(usize)) {
        if !a.iter().chain(&b).all(|x| x.is_finite()) {
            return;
        }
        let range = |c: usize, size: usize| {
            let (low, high) = (a[c].min(b[c]) - reach, a[c].max(b[c]) + reach);
            (low.ceil().max(0.0) as usize)..((high.floor() + 1.0).clamp(0.0, size as f64) as usize)
        };
        let (along, columns) = ([b[0] - a[0], b[1] - a[1]], range(0, self.width));
        let length_sq = (along[0].powi(2) + along[1].powi(2)).max(1e-12);
        for v in range(1, self.height) {
            for u in columns.clone() {
                let to = [u as f64 - a[0], v as f64 - a[1]];
                let t = ((along[0] * to[0] + along[1] * to[1]) / length_sq).clamp(0.0, 1.0);
                if (to[0] - t * along[0]).powi(2) + (to[1] - t * along[1]).powi(2) <= reach * reach {
                    each(v * self.width + u);
                }
            }
        }
    }

    /// The bare pixel that is farthest from what is covered or outside (city blocks), those in `given_up` left out; `None`
    /// if no pixel is bare.
    pub fn barest(&self, given_up: &[usize]) -> Option<[f64; 2]> {
        let (w, h) = (self.width, self.height);
        let mut far: Vec<u32> = self.bare.iter().map(|b| if *b != 0 { u32::MAX } else { 0 }).collect();
        given_up.iter().for_each(|&k| far[k] = 0);
        let edge = |u: usize, v: usize| u == 0 || v == 0 || u + 1 == w || v + 1 == h;
        for k in 0..far.len() {
            let (u, v) = (k % w, k / w);
            let before = if edge(u, v) { 0 } else { far[k - 1].min(far[k - w]) };
            far[k] = far[k].min(before.saturating_add(1));
        }
        for k in (0..far.len()).rev() {
            let (u, v) = (k % w, k / w);
            let after = if edge(u, v) { 0 } else { far[k + 1].min(far[k + w]) };
            far[k] = far[k].min(after.saturating_add(1));
        }
        let (k, _) = far.iter().enumerate().filter(|(_, d)| **d > 0).max_by(|a, b| a.1.cmp(b.1).then(b.0.cmp(&a.0)))?;
        Some([(k % w) as f64, (k / w) as f64])
    }
}

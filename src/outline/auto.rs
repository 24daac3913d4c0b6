//! The outline found by itself: where motion energy concentrates over the first seconds, closed to one region.

use super::region;
use crate::config;
use crate::model::{Luma, Outline, Size};

/// Width to which pictures are reduced, px: sway of a pixel or two is then still seen, single-pixel noise is not.
const REDUCED_WIDTH: u32 = 320;
/// Motion must stand out so many times above the picture's median standard deviation, and above this in grey levels:
/// sensor noise and compression stay below.
const ABOVE_MEDIAN: f32 = 4.0;
const ABOVE_GREY: f32 = 3.0;
/// Gaps up to this share of the picture's width are closed: between branches there is sky that does not move.
const CLOSE_SHARE: f64 = 0.03;
/// Least share of the picture that a tree covers.
const LEAST_COVERAGE: f64 = 0.005;

/// Gathers motion energy: the variance of every pixel's brightness over time (Welford's running form), less half the
/// mean square of its change from frame to frame. Of white noise that leaves nothing; a sway, which takes many frames,
/// keeps nearly all of its variance.
pub struct AutoOutline {
    settings: config::Outline,
    start_s: Option<f64>,
    reduced: Size,
    scale: u32,
    count: f32,
    mean: Vec<f32>,
    sum_sq: Vec<f32>,
    last: Vec<f32>,
    sum_change_sq: Vec<f32>,
}

/// What the gathering has come to.
#[derive(Debug)]
pub enum Found {
    /// Go on; progress from 0 to 1.
    NotYet(f64),
    /// Motion concentrates here.
    Tree(Outline),
    /// Nothing moved for the longest time allowed: the whole picture, for want of better.
    NoMotion(Outline),
}

impl AutoOutline {
    pub fn new(settings: &config::Outline) -> Self {
        Self {
            settings: settings.clone(),
            start_s: None,
            reduced: Size::new(0, 0),
            scale: 1,
            count: 0.0,
            mean: Vec::new(),
            sum_sq: Vec::new(),
            last: Vec::new(),
            sum_change_sq: Vec::new(),
        }
    }

    /// Takes the next picture, seen at `time_s`.
    pub fn step(&mut self, luma: &Luma, time_s: f64) -> Found {
        let start_s = *self.start_s.get_or_insert_with(|| {
            self.scale = (luma.size.width / REDUCED_WIDTH).max(1);
            self.reduced = Size::new(luma.size.width / self.scale, (luma.size.height / self.scale).max(1));
            let zero = vec![0.0; self.reduced.area()];
            (self.mean, self.sum_sq) = (zero.clone(), zero.clone());
            (self.last, self.sum_change_sq) = (zero.clone(), zero);
            time_s
        });
        self.add(luma);
        let gathered_s = time_s - start_s;
        if gathered_s < self.settings.gather_s {
            return Found::NotYet(gathered_s / self.settings.gather_s);
        }
        match self.conclude(luma.size) {
            Some(outline) => Found::Tree(outline),
            None if gathered_s >= self.settings.give_up_s => Found::NoMotion(whole(luma.size)),
            None => Found::NotYet(0.99),
        }
    }

    /// The region as far as the pictures so far show it; `None` if nothing moves.
    pub fn conclude(&self, size: Size) -> Option<Outline> {
        if self.count < 2.0 {
            return None;
        }
        let sway = |(s, c): (&f32, &f32)| ((s - 0.5 * c) / (self.count - 1.0)).max(0.0).sqrt();
        let deviation: Vec<f32> = self.sum_sq.iter().zip(&self.sum_change_sq).map(sway).collect();
        let mut sorted = deviation.clone();
        sorted.sort_unstable_by(f32::total_cmp);
        let threshold = (ABOVE_MEDIAN * sorted[sorted.len() / 2]).max(ABOVE_GREY);
        let moving: Vec<u8> = deviation.iter().map(|&d| if d > threshold { 255 } else { 0 }).collect();
        let close_px = (CLOSE_SHARE * f64::from(self.reduced.width)).round() as u32;
        let found = region::close_to_one(self.reduced, &moving, close_px);
        let small = found.unwrap_or_else(|e| {
            tracing::error!("automatic outline: {e}");
            None
        })?;
        if small.coverage() < LEAST_COVERAGE {
            return None;
        }
        // The border is traced anew at full size, so that it encloses just the pixels of the mask.
        region::close_to_one(size, &enlarged(&small, size, self.scale), 0).unwrap_or_else(|e| {
            tracing::error!("automatic outline: {e}");
            None
        })
    }

    fn add(&mut self, luma: &Luma) {
        self.count += 1.0;
        let (scale, width) = (self.scale as usize, luma.size.width as usize);
        let per_cell = (scale * scale) as f32;
        for v in 0..self.reduced.height as usize {
            for u in 0..self.reduced.width as usize {
                let rows = luma.pixels[v * scale * width..].chunks(width).take(scale);
                let sum: u32 = rows.flat_map(|row| &row[u * scale..(u + 1) * scale]).map(|&p| u32::from(p)).sum();
                let x = sum as f32 / per_cell;
                let i = v * self.reduced.width as usize + u;
                let before = x - self.mean[i];
                self.mean[i] += before / self.count;
                self.sum_sq[i] += before * (x - self.mean[i]);
                if self.count > 1.0 {
                    self.sum_change_sq[i] += (x - self.last[i]).powi(2);
                }
                self.last[i] = x;
            }
        }
    }
}

/// The whole picture as an outline.
pub fn whole(size: Size) -> Outline {
    let (w, h) = (size.width as i32 - 1, size.height as i32 - 1);
    Outline { size, mask: vec![255; size.area()], polygon_px: vec![[0, 0], [w, 0], [w, h], [0, h]] }
}

/// The mask at full size.
fn enlarged(small: &Outline, size: Size, scale: u32) -> Vec<u8> {
    let mut mask = vec![0; size.area()];
    for (v, row) in mask.chunks_exact_mut(size.width as usize).enumerate() {
        for (u, m) in row.iter_mut().enumerate() {
            let (su, sv) = (u as u32 / scale, v as u32 / scale);
            if su < small.size.width && sv < small.size.height {
                *m = small.mask[(sv * small.size.width + su) as usize];
            }
        }
    }
    mask
}
